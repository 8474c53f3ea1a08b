#pragma once

#include <string>
#include <string_view>

#include "base/unique_fd.h"

namespace loopd {

/// Tells systemd how the service does (the protocol of sd_notify(3)), or nobody if none asked.
/// Unlike sd_notify() it never blocks: while systemd does not read, messages are lost, so that a
/// stuck manager costs the clients nothing. Thread: one owner.
class ServiceNotifier {
 public:
  /// To the socket that NOTIFY_SOCKET names.
  ServiceNotifier();

  /// Sends one message, such as "READY=1".
  void tell(std::string_view message) const;

 private:
  std::string path_;  ///< empty: nobody listens
  UniqueFd fd_;
};

}  // namespace loopd
