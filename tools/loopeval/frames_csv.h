#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <span>
#include <string>
#include <string_view>

#include "base/result.h"
#include "loopd/report.h"

namespace loopd::loopeval {

/// The header line of frames.csv; up to `bytes` fixed, after that columns may be added at the end.
inline constexpr std::string_view kFramesHeader =
    "query,file,outcome,match,island_first,island_last,similarity,point_inliers,line_inliers,"
    "inliers,features_ms,search_ms,verify_ms,update_ms,total_ms,words_points,words_lines,bytes,"
    "point_matches,line_matches,cells,spread_inliers,model,still,points,lines,images,agreeing";

/// The row of a processed frame, without its line feed. Images are named by their index in the
/// recording: `sequence_of` gives it for each ImageId up to report.query. What is not known stays
/// empty. The same report gives the same text.
std::string report_row(const Report& report, std::string_view file,
                       std::span<const std::uint64_t> sequence_of);

/// The row of a frame that could not be read: index, file and the outcome "unreadable".
std::string unreadable_row(std::uint64_t sequence, std::string_view file);

/// A frames.csv being written: beside its name with ".partial" added until it is complete, so that
/// an older one is only replaced by a whole one. Thread: one owner.
class FramesCsv {
 public:
  /// Errors: the file cannot be made.
  static Result<FramesCsv> create(const std::filesystem::path& path);

  /// Appends a row. Errors: it cannot be written.
  Status write(std::string_view row);
  /// Gives the file its name. Errors: the rest cannot be written, or not renamed.
  Status finish();

 private:
  explicit FramesCsv(const std::filesystem::path& path);
  Error failed(const char* what) const;

  std::filesystem::path path_;
  std::filesystem::path partial_;
  std::ofstream stream_;
};

}  // namespace loopd::loopeval
