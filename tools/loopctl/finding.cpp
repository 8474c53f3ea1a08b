#include "loopctl/finding.h"

#include <algorithm>
#include <iterator>
#include <utility>

namespace loopd::loopctl {

namespace {

using Level = Finding::Level;

/// In lines for people.
std::string level_text(Level level) {
  switch (level) {
    case Level::kOk:
      return "ok";
    case Level::kSkipped:
      return "-";
    case Level::kWarning:
      return "warning";
    case Level::kProblem:
      return "PROBLEM";
  }
  return {};
}

std::string level_name(Level level) {
  switch (level) {
    case Level::kSkipped:
      return "skipped";
    case Level::kProblem:
      return "problem";
    default:
      return level_text(level);
  }
}

std::string line(const Finding& finding) {
  std::string text = level_text(finding.level);
  text.resize(9, ' ');
  text += finding.topic + ": " + printable(finding.text);
  if (!finding.remedy.empty()) text += "; " + printable(finding.remedy);
  return text + "\n";
}

std::string counted(std::ptrdiff_t count, const std::string& what) {
  return std::to_string(count) + " " + what + (count == 1 ? "" : "s");
}

std::string summary(const Findings& findings) {
  const auto problems = std::ranges::count(findings, Level::kProblem, &Finding::level);
  const auto warnings = std::ranges::count(findings, Level::kWarning, &Finding::level);
  if (problems == 0 && warnings == 0) return "all is well\n";
  return counted(problems, "problem") + ", " + counted(warnings, "warning") + "\n";
}

}  // namespace

Finding Finding::ok(std::string topic, std::string text) {
  return {Level::kOk, std::move(topic), std::move(text), {}};
}
Finding Finding::skipped(std::string topic, std::string text, std::string remedy) {
  return {Level::kSkipped, std::move(topic), "not checked: " + std::move(text), std::move(remedy)};
}
Finding Finding::warning(std::string topic, std::string text, std::string remedy) {
  return {Level::kWarning, std::move(topic), std::move(text), std::move(remedy)};
}
Finding Finding::problem(std::string topic, std::string text, std::string remedy) {
  return {Level::kProblem, std::move(topic), std::move(text), std::move(remedy)};
}

void append(Findings& findings, Findings more) {
  std::ranges::move(more, std::back_inserter(findings));
}

bool has_problem(const Findings& findings) {
  return std::ranges::any_of(findings, [](const Finding& f) { return f.level == Level::kProblem; });
}

std::string findings_text(const Findings& findings) {
  std::string text;
  for (const Finding& finding : findings) text += line(finding);
  return text + summary(findings);
}

Json findings_json(const Findings& findings) {
  Json list = Json::array();
  for (const Finding& finding : findings) {
    list.push_back({{"level", level_name(finding.level)},
                    {"topic", finding.topic},
                    {"text", finding.text},
                    {"remedy", finding.remedy}});
  }
  return {{"ok", !has_problem(findings)}, {"findings", std::move(list)}};
}

}  // namespace loopd::loopctl
