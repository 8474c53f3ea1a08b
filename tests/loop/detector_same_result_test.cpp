// The same frames and config give the same reports, on every run and however they are given.
#include <gtest/gtest.h>

#include <cstring>

#include "base/lanes.h"
#include "loop/detector_run.h"

namespace loopd {
namespace {

using testing::Image;
using testing::laps_of;
using testing::small_config;
using testing::TestRun;
using testing::text_of;
using testing::walk;

constexpr std::int64_t kStepNs = 200'000'000;

/// Two laps with black, still and changing-size frames between them.
std::vector<Image> mixed_frames() {
  std::vector<Image> images = laps_of(walk(18), 2);
  images.insert(images.begin() + 20, Image(320, 240, 0));
  images.insert(images.begin() + 10, images[9]);
  images.insert(images.begin() + 5, Image(1, 1, 9));
  return images;
}

/// The reports of a run as text.
std::vector<std::string> reports_of(const std::vector<Image>& images, const Config& config,
                                    LaneExecutor* lanes) {
  TestRun run(config, lanes);
  std::vector<std::string> reports;
  std::int64_t time_ns = 5'000'000'000;
  for (const Image& image : images) reports.push_back(text_of(run.see(image, time_ns += kStepNs)));
  return reports;
}

TEST(DetectorSameResult, OnTwoRuns) {
  const auto images = mixed_frames();
  const auto first = reports_of(images, small_config(), nullptr);
  EXPECT_EQ(first, reports_of(images, small_config(), nullptr));
  int loops = 0;  // what is compared is worth it
  for (const std::string& report : first) loops += report.find(" loop ") != std::string::npos;
  EXPECT_GE(loops, 15);
}

TEST(DetectorSameResult, AfterClearAsFromTheStart) {
  const auto images = mixed_frames();
  Detector detector(small_config());
  const auto report = std::make_unique<Report>();
  const auto lap_twice = [&] {
    std::vector<std::string> reports;
    for (std::size_t i = 0; i < images.size(); ++i) {
      detector.process(images[i].frame(i, static_cast<std::int64_t>(i) * kStepNs), *report);
      detector.absorb(*report);
      reports.push_back(text_of(*report));
    }
    return reports;
  };
  const auto first = lap_twice();
  detector.clear();
  EXPECT_EQ(lap_twice(), first);
}

TEST(DetectorSameResult, WithOneLaneOrTwo) {
  const auto images = mixed_frames();
  const auto lanes = TwoLanes::start({.name = "lines"});
  ASSERT_TRUE(lanes.ok()) << lanes.error().message;
  EXPECT_EQ(reports_of(images, small_config(), nullptr),
            reports_of(images, small_config(), lanes.value().get()));
}

TEST(DetectorSameResult, WithLanesInEitherOrder) {
  class LinesFirst : public LaneExecutor {
   public:
    void run(const std::function<void()>& points, const std::function<void()>& lines) override {
      lines();
      points();
    }
  } lines_first;
  const auto images = mixed_frames();
  EXPECT_EQ(reports_of(images, small_config(), nullptr),
            reports_of(images, small_config(), &lines_first));
}

TEST(DetectorSameResult, FromFeaturesInsteadOfFrames) {
  TestRun by_frame(small_config());
  TestRun by_features(small_config());
  std::int64_t time_ns = 0;
  for (const Image& image : mixed_frames()) {
    time_ns += kStepNs;
    by_frame.see(image, time_ns);
    const Features features = *by_frame.detector.features(by_frame.report().query);
    by_features.see(features, time_ns);
    EXPECT_EQ(text_of(by_frame.report(), false), text_of(by_features.report(), false));
  }
}

TEST(DetectorSameResult, WithAnyStride) {
  TestRun packed(small_config());
  TestRun padded(small_config());
  std::uint64_t sequence = 0;
  for (const Image& image : laps_of(walk(8), 2)) {
    const int stride = image.width_px + 37;
    std::vector<std::uint8_t> pixels(
        static_cast<std::size_t>(stride) * static_cast<std::size_t>(image.height_px), 0xa5);
    for (int y = 0; y < image.height_px; ++y)
      std::memcpy(
          &pixels[static_cast<std::size_t>(y) * static_cast<std::size_t>(stride)],
          &image.pixels[static_cast<std::size_t>(y) * static_cast<std::size_t>(image.width_px)],
          static_cast<std::size_t>(image.width_px));
    Frame frame;
    frame.buffer = FrameBuffer(pixels.data());  // released by nobody: the vector owns it
    frame.width_px = image.width_px;
    frame.height_px = image.height_px;
    frame.stride_bytes = stride;
    frame.sequence = sequence++;
    padded.detector.process(frame, padded.report());
    padded.absorb();
    EXPECT_EQ(text_of(packed.see(image)), text_of(padded.report()));
  }
}

TEST(DetectorSameResult, WhateverTheReportHeldBefore) {
  const auto images = laps_of(walk(12), 2);
  TestRun reused(small_config());
  Detector detector(small_config());
  for (std::size_t i = 0; i < images.size(); ++i) {
    const auto fresh = std::make_unique<Report>();
    detector.process(images[i].frame(i), *fresh);
    detector.absorb(*fresh);
    EXPECT_EQ(text_of(reused.see(images[i])), text_of(*fresh));
  }
}

TEST(DetectorSameResult, SeedChangesNoMoreThanTheSampling) {
  Config other = small_config();
  other.verify.seed = 12345;
  TestRun a(small_config());
  TestRun b(other);
  for (const Image& image : laps_of(walk(12), 2)) {
    const Report& first = a.see(image);
    const Report& second = b.see(image);
    EXPECT_EQ(first.outcome, second.outcome);
    EXPECT_EQ(first.words_points, second.words_points);
    ASSERT_EQ(first.fused.size(), second.fused.size());
  }
}

}  // namespace
}  // namespace loopd
