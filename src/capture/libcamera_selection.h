#pragma once

#include <optional>
#include <set>
#include <span>
#include <string>
#include <variant>

#include "capture/camera.h"

namespace loopd {

/// What a camera is chosen by.
struct CameraName {
  std::string id;     ///< libcamera's
  std::string model;  ///< may be empty
};

/// Chooses one of the cameras that are there now, and remembers it.
///
/// `wanted` is an id, or a part of an id or of a model name, or empty for any. A whole id comes
/// first; a part must fit one camera only; with an empty one the first is taken. After a choice
/// was kept, only the same camera will do, or one that fits and has appeared since: one that stood
/// beside it all the time is never taken for it.
///
/// Thread: one caller at a time.
class CameraSelection {
 public:
  explicit CameraSelection(std::string wanted) : wanted_(std::move(wanted)) {}

  using Choice = std::variant<std::size_t, CameraError>;  ///< index, or kNoDevice with the remedy
  Choice choose(std::span<const CameraName> cameras) const;

  /// The camera at `index` was opened: it is the one to look for from now on.
  void keep(std::span<const CameraName> cameras, std::size_t index);

  const std::string& wanted() const { return wanted_; }

 private:
  bool fits(const CameraName& camera) const;
  bool stood_beside(const CameraName& camera) const;
  CameraError none(std::span<const CameraName> cameras) const;

  std::string wanted_;
  std::optional<std::string> kept_;
  std::set<std::string> bystanders_;
};

}  // namespace loopd
