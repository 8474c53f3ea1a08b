#pragma once

#include <string>
#include <vector>

#include "base/unique_fd.h"

namespace loopd {

/// Watches folders for entries that come, go, or change owner or mode. Folders that do not exist
/// yet, as /dev/v4l/by-id before the first camera, are watched once a folder they lie in tells of
/// a change. The kernel itself makes the nodes in /dev, so it works where udev's messages do not
/// arrive (PrivateNetwork=yes). Thread: one caller at a time.
class FolderWatch {
 public:
  explicit FolderWatch(std::vector<std::string> folders);

  /// Readable when something has changed; -1 if there is nothing to watch with.
  int fd() const { return inotify_.get(); }

  /// Forgets all changes so far, and watches what has come to exist.
  void acknowledge();

 private:
  void watch_all();

  const std::vector<std::string> folders_;
  UniqueFd inotify_;
};

}  // namespace loopd
