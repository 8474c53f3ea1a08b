#pragma once

#include <memory>

#include "base/result.h"
#include "capture/folder_source.h"
#include "capture/frame_source.h"
#include "capture/interrupt.h"

namespace loopd {

/// Opens a raw recording (see recording_format.h) as a source. Frame n of a lap is the one with
/// that number in the file; its sequence number and time are the recorded ones. Later laps go on
/// from the first one's highest sequence number and last time. A damaged frame costs that frame.
/// `options.nominal_fps` gives times to frames recorded without one.
/// Errors: those of RecordingReader::open(). `interrupt` must outlive the source.
Result<std::unique_ptr<FrameSource>> open_recording_source(const SourceOptions& options,
                                                           const Interrupt& interrupt);

}  // namespace loopd
