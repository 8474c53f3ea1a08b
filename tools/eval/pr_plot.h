#pragma once

#include <filesystem>
#include <string>

#include "base/result.h"
#include "eval/score.h"

namespace loopd::eval {

/// Writes the curve as CSV: threshold,precision,recall,right,wrong,dont_care, highest threshold
/// first. Errors: the file cannot be written.
Status write_pr_csv(const Score& score, const std::filesystem::path& path);

/// Draws precision over recall, both 0..1, as a PNG of 800 x 600; the largest recall without a
/// false detection and the accepted loops are marked. Errors: the file cannot be written.
Status write_pr_png(const Score& score, const std::string& title,
                    const std::filesystem::path& path);

}  // namespace loopd::eval
