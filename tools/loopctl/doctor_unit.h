#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "base/result.h"
#include "loopctl/finding.h"

namespace loopd::loopctl {

/// What systemctl show tells of a unit. Reentrant.
class UnitProperties {
 public:
  UnitProperties() = default;
  /// "Name=value" a line; of a name that comes again, the values are joined by a newline.
  explicit UnitProperties(std::string_view text);

  /// Empty if it was not told.
  std::string get(const std::string& name) const;
  /// None if it is no number ("infinity", "[not set]").
  std::optional<std::uint64_t> number(const std::string& name) const;

  bool installed() const { return get("LoadState") == "loaded"; }
  bool active() const { return get("ActiveState") == "active"; }

 private:
  std::map<std::string, std::string> values_;
};

/// The service of one camera, and the socket that systemd holds for it.
struct CameraUnits {
  UnitProperties service;
  UnitProperties socket;
};

/// Asks systemd by the systemctl program; waits for it at most 5 s. Errors: no such program, or
/// systemd does not run here.
Result<CameraUnits> ask_systemd(const std::string& camera);

/// `source`: camera.source, which decides what devices the unit must allow.
Findings judge_units(const std::string& camera, const CameraUnits& units,
                     const std::string& source);

}  // namespace loopd::loopctl
