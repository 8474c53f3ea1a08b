#include "loopctl/control.h"

#include <pwd.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>

#include "capture/v4l2_sysfs.h"
#include "loopctl/json_view.h"

namespace loopd::loopctl {

namespace {

std::string own_user_name() {
  std::array<char, 4096> memory{};
  passwd entry{};
  passwd* found = nullptr;
  const uid_t user = geteuid();
  const int failed = getpwuid_r(user, &entry, memory.data(), memory.size(), &found);
  return failed != 0 || found == nullptr ? std::to_string(user) : found->pw_name;
}

/// None if the path cannot be looked at.
std::optional<std::string> group_of(const std::string& path) {
  std::string group = owning_group(path);
  return group.empty() ? std::nullopt : std::optional(std::move(group));
}

}  // namespace

std::string permission_remedy(const std::string& user, const std::optional<std::string>& group) {
  if (group == "root") return "this daemon was started by root: use sudo";
  return "join the group " + group.value_or("loopd") + ": sudo usermod -aG " +
         group.value_or("loopd") + " " + user + ", then log in again";
}

Result<ControlClient> connect_control(const std::string& control_path) {
  Result<ControlClient> client = ControlClient::connect(control_path);
  if (client || client.error().code != EACCES) return client;
  return Error{"may not use the control socket \"" + control_path + "\" (permission denied); " +
                   permission_remedy(own_user_name(), group_of(control_path)),
               EACCES};
}

std::string done_text(ControlOp op, const std::string& answer) {
  const Json json = parse_json(answer);
  if (const Json& result = member(json, "result"); result.is_string()) return text_of(result);
  switch (op) {
    case ControlOp::kPause:
      return "paused: images are thrown away and no loops are told until loopctl resume";
    case ControlOp::kResume:
      return "resumed";
    case ControlOp::kReset:
      return "all images and words are forgotten: a new epoch begins";
    default:
      return std::string(control_op_name(op)) + ": done";
  }
}

int control(const ControlCommand& command, std::ostream& out, std::ostream& err) {
  Result<ControlClient> client = connect_control(command.control_path);
  const Result<std::string> answer =
      client ? client->request(command.op, command.timeout) : Result<std::string>(client.error());
  if (!answer) {
    err << "loopctl: " << printable(answer.error().message) << std::endl;
    return 1;
  }
  out << (command.json ? answer.value() : done_text(command.op, answer.value())) << std::endl;
  return out ? 0 : 1;
}

}  // namespace loopd::loopctl
