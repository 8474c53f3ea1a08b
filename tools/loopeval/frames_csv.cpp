#include "loopeval/frames_csv.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cstdio>
#include <system_error>

namespace loopd::loopeval {
namespace {

constexpr std::string_view kUnreadable = "unreadable";

// A row under construction; a field not given stays empty.
class Row {
 public:
  Row& text(std::string_view value) {
    if (!first_) text_ += ',';
    first_ = false;
    text_ += value;
    return *this;
  }
  Row& empty(int fields) {
    for (int i = 0; i < fields; ++i) text("");
    return *this;
  }
  template <class Integer>
  Row& number(Integer value) {
    return text(std::to_string(value));
  }
  // The shortest text that reads back as `value`.
  Row& real(double value) {
    std::array<char, 32> digits{};
    const auto end = std::to_chars(digits.data(), digits.data() + digits.size(), value).ptr;
    return text({digits.data(), static_cast<std::size_t>(end - digits.data())});
  }
  Row& milliseconds(std::int64_t ns) {
    std::array<char, 40> digits{};
    const std::int64_t us = (ns + 500) / 1000;
    const int length =
        std::snprintf(digits.data(), digits.size(), "%lld.%03d", static_cast<long long>(us / 1000),
                      static_cast<int>(us % 1000));
    return text({digits.data(), static_cast<std::size_t>(length)});
  }
  std::string take() { return std::move(text_); }

 private:
  std::string text_;
  bool first_ = true;
};

// RFC 4180; control characters, which no reader of lines survives, appear as '?'.
std::string csv_field(std::string_view value) {
  std::string text(value);
  std::replace_if(
      text.begin(), text.end(), [](unsigned char c) { return c < ' '; }, '?');
  if (text.find_first_of(",\"") == std::string::npos) return text;
  for (std::size_t at = 0; (at = text.find('"', at)) != std::string::npos; at += 2)
    text.insert(at, 1, '"');
  return '"' + text + '"';
}

void add_island(Row& row, const std::optional<Island>& island,
                std::span<const std::uint64_t> sequence_of) {
  if (!island || island->last >= sequence_of.size()) {
    row.empty(2);
    return;
  }
  row.number(sequence_of[island->first]).number(sequence_of[island->last]);
}

void add_decision(Row& row, const Report& report, std::span<const std::uint64_t> sequence_of) {
  row.text(outcome_name(report.outcome));
  if (report.match)
    row.number(report.match->sequence);
  else
    row.empty(1);
  add_island(row, report.island, sequence_of);
  if (report.match)
    row.real(report.match->similarity);
  else
    row.empty(1);
  if (report.verification) {
    const Verification& v = *report.verification;
    row.number(v.point_inliers).number(v.line_inliers).number(v.inliers());
  } else {
    row.empty(3);
  }
}

void add_times(Row& row, const StageTimes& times) {
  row.milliseconds(times.features_ns).milliseconds(times.search_ns).milliseconds(times.verify_ns);
  row.milliseconds(times.update_ns).milliseconds(times.total_ns);
}

void add_evidence(Row& row, const std::optional<Verification>& verification) {
  if (!verification) {
    row.empty(5);
    return;
  }
  const Verification& v = *verification;
  row.number(v.point_matches).number(v.line_matches).number(v.cells).number(v.spread_inliers);
  row.text(model_name(v.model));
}

}  // namespace

std::string report_row(const Report& report, std::string_view file,
                       std::span<const std::uint64_t> sequence_of) {
  Row row;
  row.number(report.sequence).text(csv_field(file));
  add_decision(row, report, sequence_of);
  add_times(row, report.times);
  row.number(report.words_points).number(report.words_lines).number(report.bytes);
  add_evidence(row, report.verification);
  row.text(report.still ? "1" : "0").number(report.points).number(report.lines);
  row.number(report.images);
  if (report.verification)
    row.number(report.verification->agreeing);
  else
    row.empty(1);
  return row.take();
}

std::string unreadable_row(std::uint64_t sequence, std::string_view file) {
  Row row;
  row.number(sequence).text(csv_field(file)).text(kUnreadable);
  row.empty(static_cast<int>(std::count(kFramesHeader.begin(), kFramesHeader.end(), ',')) - 2);
  return row.take();
}

FramesCsv::FramesCsv(const std::filesystem::path& path)
    : path_(path), partial_(path.string() + ".partial"), stream_(partial_, std::ios::binary) {}

Error FramesCsv::failed(const char* what) const {
  return errno_error(std::string("cannot ") + what + " " + partial_.string(), errno);
}

Result<FramesCsv> FramesCsv::create(const std::filesystem::path& path) {
  errno = 0;
  FramesCsv csv(path);
  if (!csv.stream_) return csv.failed("make");
  if (Status header = csv.write(kFramesHeader); !header) return header.error();
  return csv;
}

Status FramesCsv::write(std::string_view row) {
  errno = 0;
  stream_ << row << '\n';
  if (!stream_) return failed("write");
  return Nothing{};
}

Status FramesCsv::finish() {
  errno = 0;
  stream_.close();
  if (!stream_) return failed("write");
  std::error_code error;
  std::filesystem::rename(partial_, path_, error);
  if (error) return errno_error("cannot rename " + partial_.string(), error.value());
  return Nothing{};
}

}  // namespace loopd::loopeval
