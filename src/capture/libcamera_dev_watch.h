#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "base/unique_fd.h"

namespace loopd {

/// Watches the folder of device nodes for nodes that come, go, or change owner or mode. The kernel
/// itself makes and removes the nodes, so it works where udev's messages do not arrive.
/// Thread: one caller at a time.
class DevWatch {
 public:
  /// fd() is -1 if there is nothing to watch with (no inotify instance or no such folder).
  explicit DevWatch(const std::string& folder = "/dev");

  /// Readable when something has changed.
  int fd() const { return inotify_.get(); }

  /// Reads all changes. True if one of `names` (of nodes in the folder) was removed, or if so much
  /// has changed that the kernel dropped some of it.
  bool removed(const std::vector<std::string>& names);

  /// Reads all changes and forgets them.
  void acknowledge() { removed({}); }

 private:
  UniqueFd inotify_;
};

}  // namespace loopd
