// Holds DESIGN's table of who may include whom against the #include lines.

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace {

namespace fs = std::filesystem;

// Folder -> folders it may include, besides itself and the public headers.
const std::map<std::string, std::set<std::string>> kMayInclude = {
    {"base", {}},
    {"capture", {"base"}},
    {"features", {"base"}},
    {"index", {"base"}},
    {"verify", {"base"}},
    {"events", {"base"}},
    {"store", {"base"}},
    {"loop", {"base", "features", "index", "verify", "store"}},
    {"app", {"base", "capture", "events", "store"}},
};

struct Include {
  std::string file;
  std::string path;
  bool quoted = false;
};

// The include of one line, if it is one.
std::optional<Include> parse_include(const std::string& line, const std::string& file) {
  const std::size_t hash = line.find_first_not_of(" \t");
  if (hash == std::string::npos || line[hash] != '#') return std::nullopt;
  const std::size_t word = line.find_first_not_of(" \t", hash + 1);
  if (word == std::string::npos || line.compare(word, 7, "include") != 0) return std::nullopt;
  const std::size_t open = line.find_first_of("<\"", word);
  if (open == std::string::npos) return std::nullopt;
  const bool quoted = line[open] == '"';
  const std::size_t close = line.find(quoted ? '"' : '>', open + 1);
  if (close == std::string::npos) return std::nullopt;
  return Include{file, line.substr(open + 1, close - open - 1), quoted};
}

std::vector<Include> includes_below(const fs::path& folder) {
  std::vector<Include> includes;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.path().extension() != ".h" && entry.path().extension() != ".cpp") continue;
    std::ifstream file(entry.path());
    std::string line;
    while (std::getline(file, line))
      if (auto include = parse_include(line, entry.path().string()))
        includes.push_back(std::move(*include));
  }
  return includes;
}

// What is wrong with one include of a file in `folder` of src/, or nothing.
std::string violation(const std::string& folder, const Include& include) {
  if (!include.quoted) return "";
  const std::string target = include.path.substr(0, include.path.find('/'));
  if (include.path.find('/') == std::string::npos) return "is not written as \"folder/file.h\"";
  if (target == "loopd" || target == folder) return "";
  const auto rule = kMayInclude.find(folder);
  if (rule == kMayInclude.end()) return "comes from a folder without a rule";
  return rule->second.count(target) == 1 ? "" : "is not allowed";
}

TEST(IncludeRules, SourceFoldersIncludeOnlyWhatTheDesignAllows) {
  const fs::path src = fs::path(LOOPD_SOURCE_DIR) / "src";
  std::size_t checked = 0;
  for (const auto& entry : fs::directory_iterator(src)) {
    if (!entry.is_directory()) continue;
    const std::string folder = entry.path().filename().string();
    for (const Include& include : includes_below(entry.path())) {
      EXPECT_EQ(violation(folder, include), "")
          << include.file << ": #include \"" << include.path << '"';
      ++checked;
    }
  }
  EXPECT_GT(checked, 100U) << "found too few includes to have looked at the sources";
}

TEST(IncludeRules, PublicHeadersNeedOnlyTheStandardLibrary) {
  const fs::path folder = fs::path(LOOPD_SOURCE_DIR) / "include" / "loopd";
  const auto includes = includes_below(folder);
  EXPECT_GT(includes.size(), 5U);
  for (const Include& include : includes) {
    const bool own = include.quoted && include.path.rfind("loopd/", 0) == 0;
    const bool standard = !include.quoted && include.path.find('/') == std::string::npos &&
                          include.path.find('.') == std::string::npos;
    EXPECT_TRUE(own || standard) << include.file << ": " << include.path;
  }
}

// The daemon's own code sees pixels: OpenCV is for the tools, and the reference in tests.
TEST(IncludeRules, TheDaemonNeedsNoOpenCv) {
  for (const Include& include : includes_below(fs::path(LOOPD_SOURCE_DIR) / "src"))
    EXPECT_NE(include.path.rfind("opencv", 0), 0U) << include.file << ": " << include.path;
}

TEST(IncludeRules, TheCheckSeesAWrongEdge) {
  EXPECT_NE(violation("base", {"x.h", "index/vocabulary.h", true}), "");
  EXPECT_NE(violation("capture", {"x.h", "features/lbd.h", true}), "");
  EXPECT_NE(violation("app", {"x.h", "loop/map.h", true}), "");
  EXPECT_NE(violation("index", {"x.h", "vocabulary.h", true}), "");
  EXPECT_EQ(violation("loop", {"x.h", "index/vocabulary.h", true}), "");
}

}  // namespace
