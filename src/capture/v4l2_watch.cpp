#include "capture/v4l2_watch.h"

#include <sys/inotify.h>
#include <unistd.h>

#include <array>
#include <cstdint>
#include <utility>

namespace loopd {

FolderWatch::FolderWatch(std::vector<std::string> folders)
    : folders_(std::move(folders)), inotify_(::inotify_init1(IN_CLOEXEC | IN_NONBLOCK)) {
  watch_all();
}

void FolderWatch::acknowledge() {
  if (!inotify_.valid()) return;
  alignas(inotify_event) std::array<char, 4096> events{};
  while (::read(inotify_.get(), events.data(), events.size()) > 0) {
  }
  watch_all();
}

// Again and again: a folder that was removed and made anew is another one, and one that is watched
// already stays so.
void FolderWatch::watch_all() {
  if (!inotify_.valid()) return;
  constexpr std::uint32_t kChanges =
      IN_CREATE | IN_DELETE | IN_ATTRIB | IN_MOVED_FROM | IN_MOVED_TO | IN_ONLYDIR;
  for (const std::string& folder : folders_)
    ::inotify_add_watch(inotify_.get(), folder.c_str(), kChanges);
}

}  // namespace loopd
