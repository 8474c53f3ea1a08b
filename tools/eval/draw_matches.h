#pragma once

#include <filesystem>
#include <span>
#include <string>

#include "base/result.h"
#include "loopd/frame.h"
#include "loopd/report.h"

namespace loopd::eval {

/// Draws a matched pair side by side, the query on the left: inlier points as circles with thin
/// joining lines in one colour, end points of inlier lines as squares and joining lines in
/// another, `caption` and a key above. Saves a PNG. Pairs outside the images are left out.
/// Errors: an image without pixels; the file cannot be written. Reentrant.
Status draw_matches(const LumaView& query, const LumaView& match, std::span<const InlierPair> pairs,
                    const std::string& caption, const std::filesystem::path& path);

}  // namespace loopd::eval
