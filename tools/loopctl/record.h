#pragma once

#include <ostream>
#include <string>

#include "base/result.h"
#include "base/unique_fd.h"
#include "events/control_request.h"
#include "loopctl/json_view.h"

namespace loopd::loopctl {

struct RecordCommand {
  std::string control_path;
  std::string file;
  RecordLimits limits;
  bool force = false;     ///< replace a file that is there
  bool progress = false;  ///< tell every second how far it is
};

/// The file of a recording while it is not known whether there will be one: a new one, which
/// vanishes unless keep() is called. What it is to replace stays as it is until then. Move-only.
class NewRecording {
 public:
  /// Errors: the file is there and `replace` is false; what is there is no regular file; it cannot
  /// be made.
  static Result<NewRecording> create(const std::string& path, bool replace);
  ~NewRecording();
  NewRecording(NewRecording&& other) noexcept;
  NewRecording& operator=(NewRecording&&) = delete;

  int fd() const { return fd_.get(); }
  /// It stays, under the name asked for. Errors: the system's.
  Status keep();

 private:
  NewRecording(UniqueFd fd, std::string path, std::string made)
      : fd_(std::move(fd)), path_(std::move(path)), made_(std::move(made)) {}

  UniqueFd fd_;
  std::string path_;
  std::string made_;  ///< the name it has until keep(); empty once kept
};

/// Whether the daemon's `recorded` tells of a recording with every frame until its end.
bool is_complete(const Json& recorded);

/// What the daemon's `recorded` tells, for people: one line.
std::string recorded_text(const Json& recorded, const std::string& file);

/// Has the daemon write what its camera gives into a file, until a limit or a signal (SIGINT,
/// SIGTERM). Returns the exit status: 0 all of it is in the file, 1 not.
int record(const RecordCommand& command, std::ostream& out, std::ostream& err);

}  // namespace loopd::loopctl
