#include "loopctl/doctor_access.h"

#include <grp.h>
#include <pwd.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>

#include "capture/v4l2_sysfs.h"

namespace loopd::loopctl {

namespace {

constexpr std::size_t kEntryBytes = 16 * 1024;
constexpr int kMostGroups = 1024;
constexpr mode_t kRead = 4, kWrite = 2;

std::vector<gid_t> groups_of(const passwd& entry) {
  std::vector<gid_t> groups(kMostGroups);
  int count = kMostGroups;
  if (getgrouplist(entry.pw_name, entry.pw_gid, groups.data(), &count) < 0) count = 0;
  groups.resize(static_cast<std::size_t>(std::clamp(count, 0, kMostGroups)));
  return groups;
}

std::optional<gid_t> find_group(const std::string& name) {
  std::array<char, kEntryBytes> memory{};
  group entry{};
  group* found = nullptr;
  if (getgrnam_r(name.c_str(), &entry, memory.data(), memory.size(), &found) != 0 || !found)
    return std::nullopt;
  return found->gr_gid;
}

std::string name_of(uid_t uid) {
  std::array<char, kEntryBytes> memory{};
  passwd entry{};
  passwd* found = nullptr;
  if (getpwuid_r(uid, &entry, memory.data(), memory.size(), &found) != 0 || !found)
    return "uid " + std::to_string(uid);
  return found->pw_name;
}

}  // namespace

std::optional<DaemonUser> find_user(const std::string& name, std::string_view more_groups) {
  std::array<char, kEntryBytes> memory{};
  passwd entry{};
  passwd* found = nullptr;
  if (getpwnam_r(name.c_str(), &entry, memory.data(), memory.size(), &found) != 0 || !found)
    return std::nullopt;
  DaemonUser user{found->pw_name, found->pw_uid, groups_of(*found)};
  while (!more_groups.empty()) {
    const std::string_view word = more_groups.substr(0, more_groups.find(' '));
    more_groups.remove_prefix(std::min(word.size() + 1, more_groups.size()));
    if (const auto group = find_group(std::string(word))) user.groups.push_back(*group);
  }
  return user;
}

DaemonUser current_user() {
  DaemonUser user{name_of(geteuid()), geteuid(), std::vector<gid_t>(kMostGroups)};
  const int count = getgroups(kMostGroups, user.groups.data());
  user.groups.resize(static_cast<std::size_t>(std::max(count, 0)));
  user.groups.push_back(getegid());
  return user;
}

std::optional<Ownership> ownership_of(const std::string& path) {
  struct stat status {};
  if (stat(path.c_str(), &status) != 0) return std::nullopt;
  return Ownership{status.st_uid, status.st_gid, status.st_mode, owning_group(path)};
}

bool may_use(const DaemonUser& user, const Ownership& file, mode_t bits) {
  if (user.uid == 0) return true;
  if (user.uid == file.uid) return (file.mode >> 6 & bits) == bits;
  if (std::ranges::find(user.groups, file.gid) != user.groups.end())
    return (file.mode >> 3 & bits) == bits;
  return (file.mode & bits) == bits;
}

Finding judge_node_access(const std::string& node, const Ownership& owner, const DaemonUser& user) {
  if (may_use(user, owner, kRead | kWrite))
    return Finding::ok("access", "the user " + user.name + " may use " + node);
  const bool group_may = (owner.mode >> 3 & (kRead | kWrite)) == (kRead | kWrite);
  const std::string who = "the user " + user.name + " may not use " + node;
  if (!group_may || owner.gid == 0) {
    return Finding::problem("access", who + ", nor does a group help (mode and group of the node)",
                            "a udev rule with GROUP=\"video\", MODE=\"0660\" mends that");
  }
  return Finding::problem(
      "access", who + ": it belongs to the group " + owner.group,
      "sudo usermod -aG " + owner.group + " " + user.name + ", and start the daemon anew");
}

Findings judge_config_access(const std::string& path, const Ownership& owner,
                             const DaemonUser& user) {
  if (may_use(user, owner, kRead)) return {};
  return {Finding::problem("config", "the user " + user.name + " may not read " + path,
                           "sudo chmod a+r " + path)};
}

}  // namespace loopd::loopctl
