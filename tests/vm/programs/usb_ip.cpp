#include "usb_ip.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <string>

namespace loopd::vm {
namespace {

constexpr const char* kAttach = "/devices/platform/vhci_hcd.0/attach";
constexpr unsigned kDeviceId = 0x10001;  // bus 1, device 1
constexpr unsigned kHighSpeed = 3;
constexpr std::size_t kHeaderBytes = 48;
constexpr std::size_t kMaxTransfer = 1U << 20;
constexpr int kSocketBytes = 4 << 20;

enum Command : std::uint32_t { kSubmit = 1, kUnlink = 2, kReturnSubmit = 3, kReturnUnlink = 4 };

/// A header: twelve big-endian words, the last two of a submit being the setup packet.
using Header = std::array<std::uint32_t, kHeaderBytes / 4>;

/// Reads all of `size` bytes; false: the other end is closed.
Result<bool> read_all(int fd, void* to, std::size_t size) {
  auto* next = static_cast<std::uint8_t*>(to);
  while (size > 0) {
    const ssize_t n = read(fd, next, size);
    if (n == 0) return false;
    if (n < 0 && errno == EINTR) continue;
    if (n < 0 && errno == ECONNRESET) return false;
    if (n < 0) return errno_error("cannot read from vhci-hcd", errno);
    next += n;
    size -= static_cast<std::size_t>(n);
  }
  return true;
}

Status write_all(int fd, std::span<const std::uint8_t> bytes) {
  while (!bytes.empty()) {
    const ssize_t n = send(fd, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return errno_error("cannot write to vhci-hcd", errno);
    bytes = bytes.subspan(static_cast<std::size_t>(n));
  }
  return Nothing{};
}

}  // namespace

Result<UsbIpPort> UsbIpPort::attach(unsigned port, const std::string& sysfs) {
  int ends[2];
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0) {
    return errno_error("cannot make a socket pair", errno);
  }
  UniqueFd ours(ends[0]);
  const UniqueFd kernels(ends[1]);
  setsockopt(ours.get(), SOL_SOCKET, SO_SNDBUF, &kSocketBytes, sizeof kSocketBytes);
  const UniqueFd attach(open((sysfs + kAttach).c_str(), O_WRONLY | O_CLOEXEC));
  if (!attach.valid()) return errno_error("cannot attach: is vhci-hcd loaded?", errno);
  const std::string line = std::to_string(port) + " " + std::to_string(kernels.get()) + " " +
                           std::to_string(kDeviceId) + " " + std::to_string(kHighSpeed);
  if (write(attach.get(), line.data(), line.size()) != static_cast<ssize_t>(line.size())) {
    return errno_error("vhci-hcd does not take the device", errno);
  }
  return UsbIpPort(std::move(ours));
}

Result<UsbIpPort::Request> UsbIpPort::receive() {
  Header header{};
  const auto got = read_all(socket_.get(), header.data(), kHeaderBytes);
  if (!got) return got.error();
  if (!got.value()) return Request(Detached{});
  const std::uint32_t id = ntohl(header[1]);
  if (ntohl(header[0]) == kUnlink) return Request(Unlink{id, ntohl(header[5])});
  if (ntohl(header[0]) != kSubmit) return Error{"vhci-hcd sent an unknown command"};
  Submit submit;
  submit.id = id;
  submit.to_host = ntohl(header[3]) == 1;
  submit.endpoint = ntohl(header[4]);
  submit.length = ntohl(header[6]);
  std::memcpy(submit.setup.data(), &header[10], submit.setup.size());
  if (submit.length > kMaxTransfer) return Error{"vhci-hcd wants a transfer larger than 1 MiB"};
  if (!submit.to_host) {
    submit.data.resize(submit.length);
    const auto data = read_all(socket_.get(), submit.data.data(), submit.length);
    if (!data) return data.error();
    if (!data.value()) return Request(Detached{});
  }
  return Request(std::move(submit));
}

Status UsbIpPort::reply(const Submit& submit, std::int32_t status, std::size_t length,
                        std::span<const std::uint8_t> data) {
  Header header{};
  header[0] = htonl(kReturnSubmit);
  header[1] = htonl(submit.id);
  header[5] = htonl(static_cast<std::uint32_t>(status));
  header[6] = htonl(static_cast<std::uint32_t>(length));
  packet_.resize(kHeaderBytes + data.size());
  std::memcpy(packet_.data(), header.data(), kHeaderBytes);
  if (!data.empty()) std::memcpy(packet_.data() + kHeaderBytes, data.data(), data.size());
  return write_all(socket_.get(), packet_);
}

Status UsbIpPort::complete(const Submit& submit, std::span<const std::uint8_t> data) {
  if (!submit.to_host) return reply(submit, 0, submit.length, {});
  data = data.first(std::min(data.size(), submit.length));
  return reply(submit, 0, data.size(), data);
}

Status UsbIpPort::stall(const Submit& submit) { return reply(submit, -EPIPE, 0, {}); }

Status UsbIpPort::unlinked(const Unlink& unlink, bool cancelled) {
  Header header{};
  header[0] = htonl(kReturnUnlink);
  header[1] = htonl(unlink.id);
  header[5] = htonl(static_cast<std::uint32_t>(cancelled ? -ECONNRESET : 0));
  std::array<std::uint8_t, kHeaderBytes> packet{};
  std::memcpy(packet.data(), header.data(), kHeaderBytes);
  return write_all(socket_.get(), packet);
}

}  // namespace loopd::vm
