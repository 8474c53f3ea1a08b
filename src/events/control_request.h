#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace loopd {

// What travels over the control socket, as plain values, and its text: one JSON object a line
// (docs/protocol.md). All functions are reentrant; none throws but std::bad_alloc.

enum class ControlOp : std::uint8_t {
  kStatus,
  kPause,
  kResume,
  kReset,
  kReload,
  kRecord,
  kStopRecord,
};

/// "status", "pause", "resume", "reset", "reload", "record", "stop_record".
std::string_view control_op_name(ControlOp op);

/// Bounds of a recording; the defaults are those of a request that names none.
struct RecordLimits {
  static constexpr double kMaxSeconds = 24 * 3600;
  static constexpr std::uint64_t kMaxMib = 1024 * 1024;

  double seconds = 60;                                          ///< (0, kMaxSeconds]
  std::uint64_t max_bytes = std::uint64_t{1024} * 1024 * 1024;  ///< whole MiB, 1 to kMaxMib of them
};

/// One member of an answer.
struct ControlField {
  std::string name;
  std::variant<std::string, std::int64_t, double, bool> value;
};
using ControlFields = std::vector<ControlField>;

/// A request read, or why not.
struct ParsedControl {
  std::optional<ControlOp> op;
  RecordLimits limits;  ///< of kRecord
  std::string name;     ///< the op's name, as far as it could be read
  std::string error;    ///< one sentence for the client, if not
};

/// Reads one line, without its newline, of any bytes.
ParsedControl parse_control(std::string_view line);

// The text of one record, without the newline. A number that is not finite is left out.

/// {"class":<record_class>,"op":<op>,...fields}; an empty `op` is left out.
std::string control_text(std::string_view record_class, std::string_view op,
                         const ControlFields& fields);
/// {"class":"error","op":<op>,"message":<message>}; an empty `op` is left out.
std::string control_error_text(std::string_view op, std::string_view message);

/// A client's request, the inverse of parse_control(). `limits`: of kRecord, ignored otherwise.
std::string control_request_text(ControlOp op, const RecordLimits& limits = {});

}  // namespace loopd
