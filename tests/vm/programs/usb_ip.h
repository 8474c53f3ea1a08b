#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "base/result.h"
#include "base/unique_fd.h"

namespace loopd::vm {

/// A transfer that the kernel wants done by the device.
struct Submit {
  std::uint32_t id = 0;
  bool to_host = false;
  unsigned endpoint = 0;
  std::size_t length = 0;               ///< bytes wanted, or sent
  std::array<std::uint8_t, 8> setup{};  ///< of a control transfer (endpoint 0)
  std::vector<std::uint8_t> data{};     ///< sent to the device
};

/// The kernel no longer wants the transfer `target`.
struct Unlink {
  std::uint32_t id = 0;
  std::uint32_t target = 0;
};

/// The kernel has closed the connection.
struct Detached {};

/// The device's end of a USB port of vhci-hcd: what USB/IP (Linux Documentation/usb/usbip_protocol)
/// sends over a network goes over a socket pair here. The kernel sees a high-speed device that is
/// plugged in on attach() and pulled out when this object goes. Thread: one caller at a time.
class UsbIpPort {
 public:
  using Request = std::variant<Submit, Unlink, Detached>;

  /// Plugs a device into `port` (0..7) of the kernel whose sysfs is mounted there. Errors: vhci-hcd
  /// is not loaded, or the port is not free (also for some milliseconds after a device there was
  /// pulled out).
  static Result<UsbIpPort> attach(unsigned port, const std::string& sysfs);

  int fd() const { return socket_.get(); }

  /// Waits for the kernel's next request.
  Result<Request> receive();

  /// `submit` is done: `data` goes to the host, or, if it went to the device, was taken.
  Status complete(const Submit& submit, std::span<const std::uint8_t> data);
  /// The device does not know the request.
  Status stall(const Submit& submit);
  /// `cancelled`: the transfer had not been done and will not be.
  Status unlinked(const Unlink& unlink, bool cancelled);

 private:
  explicit UsbIpPort(UniqueFd socket) : socket_(std::move(socket)) {}
  Status reply(const Submit& submit, std::int32_t status, std::size_t length,
               std::span<const std::uint8_t> data);

  UniqueFd socket_;
  std::vector<std::uint8_t> packet_;
};

}  // namespace loopd::vm
