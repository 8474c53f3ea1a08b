#include <poll.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <vector>

#include "capture/child_process.h"
#include "loopctl/doctor_unit.h"

namespace loopd::loopctl {

namespace {

using Clock = std::chrono::steady_clock;

constexpr std::chrono::seconds kPatience{5};
constexpr std::size_t kMaxBytes = std::size_t{64} * 1024;

const std::vector<std::string> kServiceProperties = {
    "LoadState",           "UnitFileState", "ActiveState", "Result",
    "ExecMainStatus",      "StatusText",    "NRestarts",   "MainPID",
    "MemoryMax",           "LimitRTPRIO",   "AllowedCPUs", "User",
    "SupplementaryGroups", "DevicePolicy",  "DeviceAllow", "NeedDaemonReload"};
const std::vector<std::string> kSocketProperties = {"LoadState", "ActiveState"};

/// All that `child` prints, as far as it does so in time.
std::string output_of(const ChildProcess& child) {
  const auto deadline = Clock::now() + kPatience;
  std::string text;
  while (text.size() < kMaxBytes) {
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(deadline - Clock::now());
    pollfd readable{child.output(), POLLIN, 0};
    const int ready = poll(&readable, 1, std::max(0, static_cast<int>(left.count())));
    if (ready < 0 && errno == EINTR) continue;
    if (ready <= 0) break;
    std::array<char, 4096> bytes;
    const ssize_t n = read(child.output(), bytes.data(), bytes.size());
    if (n == 0 || (n < 0 && errno != EAGAIN && errno != EINTR)) break;
    if (n > 0) text.append(bytes.data(), static_cast<std::size_t>(n));
  }
  return text;
}

/// The first line of what a program complained about.
std::string first_line(const std::string& text) { return text.substr(0, text.find('\n')); }

Result<UnitProperties> show(const std::string& unit, const std::vector<std::string>& properties) {
  std::vector<std::string> command = {"systemctl", "show", "--no-pager", unit};
  for (const std::string& property : properties) command.push_back("--property=" + property);
  Result<ChildProcess> child = ChildProcess::start(command);
  if (!child) return child.error();
  const std::string text = output_of(*child);
  const int status = child->finish();
  if (WIFEXITED(status) && WEXITSTATUS(status) == 0) return UnitProperties(text);
  const std::string complaint = first_line(child->error_text(1024));
  return Error{"systemctl does not answer" + (complaint.empty() ? "" : ": " + complaint), 0};
}

}  // namespace

Result<CameraUnits> ask_systemd(const std::string& camera) {
  Result<UnitProperties> service = show("loopd@" + camera + ".service", kServiceProperties);
  if (!service) return service.error();
  Result<UnitProperties> socket = show("loopd@" + camera + ".socket", kSocketProperties);
  if (!socket) return socket.error();
  return CameraUnits{std::move(service).value(), std::move(socket).value()};
}

}  // namespace loopd::loopctl
