#pragma once

#include <string>
#include <vector>

#include "loopctl/json_view.h"

namespace loopd::loopctl {

/// What came of looking at one thing.
struct Finding {
  enum class Level {
    kOk,
    kSkipped,  ///< not looked at; the text says why not
    kWarning,  ///< it works, but not as well or as safely as it could
    kProblem,  ///< it does not work
  };

  Level level = Level::kOk;
  std::string topic;   ///< "camera": one word
  std::string text;    ///< what is so: one clause
  std::string remedy;  ///< what to do about it: one clause; empty if nothing needs doing

  static Finding ok(std::string topic, std::string text);
  static Finding skipped(std::string topic, std::string text, std::string remedy = {});
  static Finding warning(std::string topic, std::string text, std::string remedy);
  static Finding problem(std::string topic, std::string text, std::string remedy);
};
using Findings = std::vector<Finding>;

void append(Findings& findings, Findings more);

bool has_problem(const Findings& findings);

/// A line each, "PROBLEM  camera: /dev/video7 is not there; plug the camera in", and a last one
/// that counts.
std::string findings_text(const Findings& findings);

/// {"ok":false,"findings":[{"level":"problem","topic":...,"text":...,"remedy":...},...]}; levels
/// are "ok", "skipped", "warning", "problem".
Json findings_json(const Findings& findings);

}  // namespace loopd::loopctl
