#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "capture/camera.h"

namespace loopd::testing {

/// "frame 3", "corrupt_frame 4", "unplugged 5 lost", "end" or "interrupted".
inline std::string event_text(const CameraEvent& event) {
  if (const auto* frame = std::get_if<Frame>(&event))
    return "frame " + std::to_string(frame->sequence);
  if (const auto* error = std::get_if<CameraError>(&event))
    return std::string(camera_fault_name(error->fault)) + " " + std::to_string(error->sequence) +
           (error->lost ? " lost" : "");
  if (const auto* notice = std::get_if<CameraNotice>(&event)) return "notice: " + notice->message;
  return std::holds_alternative<EndOfStream>(event) ? "end" : "interrupted";
}

/// The next `count` events of `camera` as texts; each frame is given back at once.
inline std::vector<std::string> next_events(Camera& camera, int count) {
  std::vector<std::string> texts;
  for (int i = 0; i < count; ++i) texts.push_back(event_text(camera.next()));
  return texts;
}

/// The next event, which must be a frame.
inline Frame next_frame(Camera& camera) {
  CameraEvent event = camera.next();
  EXPECT_TRUE(std::holds_alternative<Frame>(event)) << event_text(event);
  return std::holds_alternative<Frame>(event) ? std::get<Frame>(std::move(event)) : Frame();
}

/// The next event, which must be an error.
inline CameraError next_error(Camera& camera) {
  CameraEvent event = camera.next();
  EXPECT_TRUE(std::holds_alternative<CameraError>(event)) << event_text(event);
  return std::holds_alternative<CameraError>(event) ? std::get<CameraError>(std::move(event))
                                                    : CameraError();
}

}  // namespace loopd::testing
