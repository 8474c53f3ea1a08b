#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "capture/folder_source.h"
#include "capture/frame_source.h"
#include "capture/interrupt.h"

namespace loopd {

/// How a decoder's output begins: "YUV4MPEG2 W640 H480 F30:1 Cmono" and a line feed. Each frame
/// then is "FRAME", a line feed and width x height bytes of luma. (YUV4MPEG2, the raw video format
/// of mjpegtools that most video programs write, in its one-plane form.)
struct Y4mHeader {
  ImageSize size;
  double fps = 0;  ///< 0 if it is not given or makes no sense
};

/// Reads the first line of a Y4M stream, without its line feed.
Result<Y4mHeader> parse_y4m_header(std::string_view line);

/// Programs to try as the decoder, in order: `chosen` alone if it is not empty, else `loopd-video`
/// beside this executable, in the installed libexec folder, and in PATH.
std::vector<std::string> video_decoder_candidates(const std::string& chosen);

/// Opens the video options.path by a decoder process. `interrupt` ends waits for
/// the decoder and must outlive the source. Errors: no decoder found, or it cannot decode the file
/// (with its own words), or frames larger than options.max_pixels.
Result<std::unique_ptr<FrameSource>> open_video_source(const SourceOptions& options,
                                                       const std::string& decoder,
                                                       const Interrupt& interrupt);

}  // namespace loopd
