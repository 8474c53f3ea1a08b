#include "capture/libcamera_dev_watch.h"

#include <sys/inotify.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>

namespace loopd {

DevWatch::DevWatch(const std::string& folder)
    : inotify_(::inotify_init1(IN_CLOEXEC | IN_NONBLOCK)) {
  constexpr std::uint32_t kChanges =
      IN_CREATE | IN_DELETE | IN_ATTRIB | IN_MOVED_FROM | IN_MOVED_TO | IN_ONLYDIR;
  if (inotify_.valid() && ::inotify_add_watch(inotify_.get(), folder.c_str(), kChanges) < 0)
    inotify_.reset();
}

bool DevWatch::removed(const std::vector<std::string>& names) {
  bool gone = false;
  alignas(inotify_event) std::array<char, 4096> buffer{};
  while (true) {
    const ssize_t got = ::read(inotify_.get(), buffer.data(), buffer.size());
    if (got <= 0) return gone;  // empty, or there is no watch
    const auto end = static_cast<std::size_t>(got);
    for (std::size_t at = 0; at + sizeof(inotify_event) <= end;) {
      inotify_event event{};
      std::memcpy(&event, buffer.data() + at, sizeof event);
      const char* const name = buffer.data() + at + sizeof event;
      const std::string_view text(name, ::strnlen(name, event.len));
      if ((event.mask & (IN_DELETE | IN_MOVED_FROM)) != 0)
        gone |= std::find(names.begin(), names.end(), text) != names.end();
      gone |= (event.mask & IN_Q_OVERFLOW) != 0 && !names.empty();
      at += sizeof event + event.len;
    }
  }
}

}  // namespace loopd
