#pragma once

#include <memory>
#include <string>
#include <vector>

#include "base/result.h"
#include "capture/frame_source.h"

namespace loopd {

/// What a FrameSource is made from.
struct SourceOptions {
  std::string path;
  bool loop = false;
  double nominal_fps = 0;      ///< for times where no other is known; 0 = none
  std::size_t max_pixels = 0;  ///< of one frame
};

/// Paths of the images that open_folder_source(path) delivers: the one at index i is frame i of a
/// lap. Nothing is opened: a frame that turns out to be unreadable costs that frame, and the
/// numbers of the others stay. A path that is no folder stands for itself, be it an image or not.
/// Errors: the folder cannot be listed, holds no image or more than a million. Reentrant.
Result<std::vector<std::string>> list_images(const std::string& path);

/// Opens a folder of images, or the `images/` in it, or one image file as a source.
/// Errors: it cannot be listed, holds no image or more than a million, or `times.txt` is bad.
Result<std::unique_ptr<FrameSource>> open_folder_source(const SourceOptions& options);

}  // namespace loopd
