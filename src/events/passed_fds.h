#pragma once

#include <sys/socket.h>
#include <sys/types.h>

#include <cstddef>
#include <span>

#include "base/result.h"
#include "base/unique_fd.h"

namespace loopd {

/// The file descriptors that came with the requests of one client (SCM_RIGHTS). Holds one at most;
/// whatever is not wanted is closed at once. Thread: one owner at a time.
class PassedFds {
 public:
  /// recvmsg() that does not block and keeps the descriptors that come. `cut_off`: a packet was
  /// longer than `into`.
  ssize_t receive(int socket, std::span<char> into, bool& cut_off);

  /// The descriptor, if exactly one came since the last clear().
  Result<UniqueFd> take();
  /// Closes what is held.
  void clear();

 private:
  void keep(const msghdr& message);

  UniqueFd first_;
  std::size_t count_ = 0;
};

/// Whether `fd` can be written to as a recording: a regular file, opened for writing, and not in
/// append mode, in which the kernel ignores where a write is to go.
Status check_recording_file(const UniqueFd& fd);

}  // namespace loopd
