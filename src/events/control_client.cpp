#include "events/control_client.h"

#include <cerrno>

#include "events/json_text.h"

namespace loopd {

namespace {

using json_text::Json;

constexpr std::size_t kMaxRecordBytes = 1024 * 1024;

std::string text_member(const Json& json, const char* name) {
  if (!json.is_object()) return {};
  const auto it = json.find(name);
  return it != json.end() && it->is_string() ? it->get<std::string>() : std::string();
}

/// Empty strings if the record is no JSON: the caller goes on as with one of an unknown class.
struct Answer {
  std::string record_class;
  std::string message;
};

Answer read_answer(const std::string& record) {
  const Json json = Json::parse(record, nullptr, false);
  return {text_member(json, "class"), text_member(json, "message")};
}

}  // namespace

Result<ControlClient> ControlClient::connect(const std::string& socket_path) {
  Result<ClientConnection> connection = ClientConnection::connect(socket_path, kMaxRecordBytes);
  if (!connection) return connection.error();
  return ControlClient(std::move(connection).value());
}

Result<std::string> ControlClient::request(ControlOp op, std::chrono::milliseconds timeout,
                                           const RecordLimits& limits, int file) {
  const auto deadline = std::chrono::steady_clock::now() + timeout;
  const Status sent = connection_.send(control_request_text(op, limits) + "\n", file);
  // One that was turned away finds the reason in what it can still read.
  if (!sent && sent.error().code != EPIPE) return sent.error();
  while (true) {
    const auto left =
        std::chrono::ceil<std::chrono::milliseconds>(deadline - std::chrono::steady_clock::now());
    Result<std::optional<std::string>> record = connection_.next(left);
    if (!record) return record.error();
    if (!record.value()) {
      return Error{"loopd at \"" + connection_.path() + "\" has not answered \"" +
                       std::string(control_op_name(op)) + "\" in time",
                   ETIMEDOUT};
    }
    std::string text = *std::move(record.value());
    Answer answer = read_answer(text);
    if (answer.record_class == "ok") return text;
    if (answer.record_class == "error") return Error{std::move(answer.message), 0};
    later_.push_back(std::move(text));
  }
}

Result<std::optional<std::string>> ControlClient::next(std::chrono::milliseconds timeout,
                                                       int wake_fd) {
  if (later_.empty()) return connection_.next(timeout, wake_fd);
  std::optional<std::string> text = std::move(later_.front());
  later_.pop_front();
  return text;
}

}  // namespace loopd
