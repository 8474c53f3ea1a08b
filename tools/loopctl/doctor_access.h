#pragma once

#include <sys/types.h>

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "loopctl/finding.h"

namespace loopd::loopctl {

/// Whom the daemon runs as.
struct DaemonUser {
  std::string name;
  uid_t uid = 0;
  std::vector<gid_t> groups;  ///< all of them, the primary one too
};

/// Looks a user up; `more_groups` (names, separated by spaces) are added, as systemd does. None if
/// there is no such user. Reentrant.
std::optional<DaemonUser> find_user(const std::string& name, std::string_view more_groups);

/// Who runs this program.
DaemonUser current_user();

/// To whom a file belongs, and who may do what with it.
struct Ownership {
  uid_t uid = 0;
  gid_t gid = 0;
  mode_t mode = 0;  ///< with the kind of file
  std::string group;
};

/// None if it is not there or cannot be looked at. Follows links.
std::optional<Ownership> ownership_of(const std::string& path);

/// Whether `user` may do what `bits` (4 read, 2 write) ask of a file, by its mode; access lists
/// are not looked at.
bool may_use(const DaemonUser& user, const Ownership& file, mode_t bits);

/// Whether the daemon may open the camera's node.
Finding judge_node_access(const std::string& node, const Ownership& owner, const DaemonUser& user);

/// Whether the daemon may read its config file; nothing if it may.
Findings judge_config_access(const std::string& path, const Ownership& owner,
                             const DaemonUser& user);

}  // namespace loopd::loopctl
