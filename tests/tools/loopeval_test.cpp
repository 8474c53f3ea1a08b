// loopeval as its users meet it: a program with arguments, files and exit codes; and beside the
// daemon, which must tell the same loops.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>
#include <string>
#include <tuple>
#include <vector>

#include "events/client.h"
#include "loopeval/frames_csv.h"
#include "make_sequence/sequence.h"
#include "support/child_process.h"
#include "support/lap_folder.h"
#include "support/notify_socket.h"
#include "support/temp_dir.h"

namespace loopd {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using testing::ChildProcess;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;
using testing::TempDir;

constexpr std::chrono::seconds kPatience(100);

// The columns that tools and people rely on; more may follow.
constexpr const char* kFixedColumns =
    "query,file,outcome,match,island_first,island_last,similarity,point_inliers,line_inliers,"
    "inliers,features_ms,search_ms,verify_ms,update_ms,total_ms,words_points,words_lines,bytes,";

using Row = std::map<std::string, std::string>;

std::vector<std::string> split(const std::string& line) {
  std::vector<std::string> fields;
  std::istringstream stream(line);
  for (std::string field; std::getline(stream, field, ',');) fields.push_back(field);
  if (line.ends_with(',')) fields.emplace_back();
  return fields;
}

std::string slurp(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  EXPECT_TRUE(in) << path;
  return {std::istreambuf_iterator<char>(in), {}};
}

/// The rows of a frames.csv without quoted fields, each field by its column's name.
std::vector<Row> read_rows(const fs::path& path) {
  std::istringstream in(slurp(path));
  std::string line;
  std::getline(in, line);
  const std::vector<std::string> names = split(line);
  std::vector<Row> rows;
  while (std::getline(in, line)) {
    const std::vector<std::string> fields = split(line);
    EXPECT_EQ(fields.size(), names.size()) << line;
    Row& row = rows.emplace_back();
    for (std::size_t i = 0; i < std::min(names.size(), fields.size()); ++i)
      row[names[i]] = fields[i];
  }
  return rows;
}

/// The text of a frames.csv but for the columns that may differ from run to run.
std::string without_times(const fs::path& path) {
  std::string text;
  for (const Row& row : read_rows(path)) {
    for (const auto& [name, field] : row)
      if (!name.ends_with("_ms")) text += name + "=" + field + ",";
    text += '\n';
  }
  return text;
}

std::vector<std::string> column(const std::vector<Row>& rows, const std::string& name) {
  std::vector<std::string> fields;
  for (const Row& row : rows) fields.push_back(row.at(name));
  return fields;
}

/// Query, match, inliers of a loop, frames by their number in the recording.
using Loop = std::tuple<std::uint64_t, std::uint64_t, int>;

std::vector<Loop> loops_of(const std::vector<Row>& rows) {
  std::vector<Loop> loops;
  for (const Row& row : rows)
    if (row.at("outcome") == "loop")
      loops.emplace_back(std::stoull(row.at("query")), std::stoull(row.at("match")),
                         std::stoi(row.at("inliers")));
  return loops;
}

class LoopevalTest : public ::testing::Test {
 protected:
  /// Settings under which small images in small folders give loops quickly.
  static std::vector<std::string> small_settings() {
    std::vector<std::string> arguments;
    for (const char* set : {"features.points=300", "features.lines=60", "loop.waiting_frames=8",
                            "loop.waiting_s=0", "camera.max_pixels=65536"})
      arguments.insert(arguments.end(), {"--set", set});
    return arguments;
  }

  int call(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), LOOPEVAL_PATH);
    process_.emplace(std::move(arguments), (folder_ / "stdout").string());
    return process_->wait(kPatience).value_or(-1);
  }

  /// `loopeval run` on `dataset` with small settings; returns the folder of the results.
  fs::path run(const fs::path& dataset, const std::string& name,
               const std::vector<std::string>& more = {}) {
    const fs::path out = folder_ / name;
    std::vector<std::string> arguments = {"run", dataset.string(), "--out", out.string()};
    const auto settings = small_settings();
    arguments.insert(arguments.end(), settings.begin(), settings.end());
    arguments.insert(arguments.end(), more.begin(), more.end());
    EXPECT_EQ(call(arguments), 0) << errors();
    return out;
  }

  /// Two laps along a wall, image 5 damaged: from there on, numbers of frames and of processed
  /// images differ.
  fs::path laps_with_a_bad_image() {
    testing::write_laps(images_, 16);
    images_.write("0005.pgm", "P5\n240 180\n255\nshort");
    return images_.path();
  }

  std::string output() const { return process_->standard_output(); }
  std::string errors() const { return process_->standard_error(); }

  TempDir folder_;
  TempDir images_;
  std::optional<ChildProcess> process_;
};

TEST_F(LoopevalTest, RenderedSequenceGivesTheSameRowsOnEveryRunAndWithOneLaneOrTwo) {
  sequence::SequenceOptions options;
  options.frames = 56;
  options.step_m = 0.9;
  options.width_px = 200;
  options.height_px = 150;
  options.gap = 10;
  const auto written =
      sequence::write_sequence(options, images_ / "seq", 1, [](std::size_t, std::size_t) {});
  ASSERT_TRUE(written.ok()) << written.error().message;
  const fs::path first = run(images_ / "seq", "first");
  const fs::path again = run(images_ / "seq", "again", {"--lanes", "2"});
  const fs::path one_lane = run(images_ / "seq", "one", {"--lanes", "1"});
  const std::string text = without_times(first / "frames.csv");
  EXPECT_EQ(without_times(again / "frames.csv"), text);
  EXPECT_EQ(without_times(one_lane / "frames.csv"), text);
  const auto rows = read_rows(first / "frames.csv");
  EXPECT_EQ(rows.size(), 56u);
  EXPECT_GE(loops_of(rows).size(), 5u) << "the sequence proves nothing without loops";

  const std::string truth = (images_ / "seq/groundtruth.csv").string();
  EXPECT_EQ(call({"score", (first / "frames.csv").string(), truth}), 0) << errors();
  EXPECT_THAT(output(), HasSubstr("accepted loops: precision"));
}

TEST_F(LoopevalTest, HeaderAndRowsAreAsDocumented) {
  const fs::path out = run(laps_with_a_bad_image(), "out");
  EXPECT_THAT(slurp(out / "frames.csv"), StartsWith(kFixedColumns));
  const auto rows = read_rows(out / "frames.csv");
  ASSERT_EQ(rows.size(), 32u);
  EXPECT_EQ(rows[0].at("outcome"), "map_empty");
  EXPECT_EQ(rows[0].at("match"), "");
  EXPECT_EQ(rows[0].at("inliers"), "");
  int with_candidate = 0;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const Row& row = rows[i];
    EXPECT_EQ(row.at("query"), std::to_string(i));
    EXPECT_THAT(row.at("file"), EndsWith(".pgm"));
    EXPECT_EQ(row.at("match").empty(), row.at("inliers").empty());
    EXPECT_EQ(row.at("match").empty(), row.at("similarity").empty());
    if (row.at("match").empty()) continue;
    ++with_candidate;
    EXPECT_EQ(std::stoi(row.at("inliers")),
              std::stoi(row.at("point_inliers")) + std::stoi(row.at("line_inliers")));
    EXPECT_LE(std::stoi(row.at("island_first")), std::stoi(row.at("match")));
    EXPECT_GE(std::stoi(row.at("island_last")), std::stoi(row.at("match")));
    EXPECT_LT(std::stoul(row.at("match")), i);
  }
  EXPECT_GE(with_candidate, 5);
}

TEST_F(LoopevalTest, AnImageThatCannotBeReadIsARowOfItsOwn) {
  const fs::path out = run(laps_with_a_bad_image(), "out");
  const auto rows = read_rows(out / "frames.csv");
  ASSERT_EQ(rows.size(), 32u);
  for (const auto& [name, field] : rows[5]) {
    if (name == "query") {
      EXPECT_EQ(field, "5");
    } else if (name == "file") {
      EXPECT_EQ(field, "0005.pgm");
    } else if (name == "outcome") {
      EXPECT_EQ(field, "unreadable");
    } else {
      EXPECT_EQ(field, "") << name;
    }
  }
  EXPECT_THAT(column(rows, "outcome"), ::testing::Contains("loop"));
  EXPECT_THAT(errors(), HasSubstr("0005.pgm"));
  const json summary = json::parse(slurp(out / "summary.json"));
  EXPECT_EQ(summary["outcomes"]["unreadable"], 1);
}

TEST_F(LoopevalTest, SummaryHoldsTheWholeConfigAndAddsUp) {
  const fs::path out = run(laps_with_a_bad_image(), "out", {"--set", "verify.seed=77"});
  const json summary = json::parse(slurp(out / "summary.json"));
  EXPECT_EQ(summary["config"]["verify.seed"], 77);
  EXPECT_EQ(summary["config"]["features.points"], 300);
  EXPECT_EQ(summary["config"]["camera.path"], images_.string());
  EXPECT_EQ(summary["frames"], 32);
  int sum = 0;
  for (const auto& [name, count] : summary["outcomes"].items()) sum += count.get<int>();
  EXPECT_EQ(sum, 32);
  EXPECT_EQ(summary["loops"], loops_of(read_rows(out / "frames.csv")).size());
  for (const char* stage : {"features", "search", "verify", "update", "total"}) {
    const json& times = summary["stage_ms"][stage];
    EXPECT_LE(times["p50"], times["p95"]) << stage;
    EXPECT_LE(times["p95"], times["p99"]) << stage;
    EXPECT_LE(times["p99"], times["max"]) << stage;
  }
  EXPECT_GT(summary["stage_ms"]["features"]["mean"], 0);
  EXPECT_THAT(output(), HasSubstr("32 frames"));
  EXPECT_THAT(output(), HasSubstr("stage (ms)"));
}

TEST_F(LoopevalTest, SetChangesTheRun) {
  const fs::path out = run(laps_with_a_bad_image(), "out", {"--set", "loop.waiting_frames=1000"});
  EXPECT_THAT(loops_of(read_rows(out / "frames.csv")), IsEmpty());
}

TEST_F(LoopevalTest, EveryMistakeInTheSettingsIsListed) {
  EXPECT_EQ(call({"run", images_.string(), "--out", (folder_ / "o").string(), "--set",
                  "verify.sed=1", "--set", "features.points=-4", "--set", "loop.waiting_frames=x"}),
            2);
  EXPECT_THAT(errors(), HasSubstr("verify.sed"));
  EXPECT_THAT(errors(), HasSubstr("features.points = -4"));
  EXPECT_THAT(errors(), HasSubstr("loop.waiting_frames"));
  EXPECT_FALSE(fs::exists(folder_ / "o"));
  EXPECT_EQ(call({"run", images_.string()}), 2);
  EXPECT_THAT(errors(), HasSubstr("--out"));
  EXPECT_EQ(call({"run", images_.string(), "--out", "o", "--lanes", "3"}), 2);
  EXPECT_EQ(call({}), 2);
  EXPECT_EQ(call({"--help"}), 0);
}

TEST_F(LoopevalTest, FoldersThatCannotBeUsedAreSaid) {
  const std::string out = (folder_ / "out").string();
  EXPECT_EQ(call({"run", images_.string(), "--out", out}), 1);
  EXPECT_THAT(errors(), HasSubstr("no image in the folder " + images_.string()));
  EXPECT_EQ(call({"run", "/nonexistent", "--out", out}), 1);
  EXPECT_THAT(errors(), HasSubstr("/nonexistent: No such file"));
  EXPECT_FALSE(fs::exists(out)) << "a folder is made for nothing";
  const fs::path images = laps_with_a_bad_image();
  const fs::path file = folder_.write("file", "");
  EXPECT_EQ(call({"run", images.string(), "--out", (file / "sub").string()}), 1);
  EXPECT_THAT(errors(), HasSubstr("cannot make the folder"));
}

TEST_F(LoopevalTest, GalleryHoldsOnlyPicturesOfThisRun) {
  const fs::path images = laps_with_a_bad_image();
  folder_.write("out/gallery/loop_009_old.png", "of an earlier run");
  folder_.write("out/gallery/notes.txt", "a person's");
  const fs::path out = run(images, "out", {"--gallery", "2"});
  int pictures = 0;
  for (const auto& entry : fs::directory_iterator(out / "gallery")) {
    if (entry.path().extension() != ".png") continue;
    ++pictures;
    EXPECT_THAT(slurp(entry.path()), StartsWith("\x89PNG"));
  }
  EXPECT_GE(pictures, 1);
  EXPECT_LE(pictures, 2);
  EXPECT_FALSE(fs::exists(out / "gallery/loop_009_old.png"));
  EXPECT_TRUE(fs::exists(out / "gallery/notes.txt"));
}

// What the daemon tells, watched from before the first frame.
std::vector<Loop> loops_until_the_end(EventClient& client) {
  std::vector<Loop> loops;
  while (auto line = client.next(kPatience)) {
    if (!line.value()) break;
    const json record = json::parse(*line.value());
    EXPECT_NE(record["class"], "gap");
    if (record["class"] == "loop")
      loops.emplace_back(
          record["query"]["frame_seq"].get<std::uint64_t>(),
          record["match"]["frame_seq"].get<std::uint64_t>(),
          record["inliers"]["points"].get<int>() + record["inliers"]["lines"].get<int>());
  }
  return loops;
}

TEST_F(LoopevalTest, TheDaemonInLockStepTellsExactlyTheLoopsOfFramesCsv) {
  const fs::path images = laps_with_a_bad_image();
  const auto expected = loops_of(read_rows(run(images, "out") / "frames.csv"));
  ASSERT_GE(expected.size(), 5u) << "the sequence proves nothing without loops";

  const std::string socket = (folder_ / "s").string();
  std::vector<std::string> command = {LOOPD_PATH};
  const auto settings = small_settings();
  command.insert(command.end(), settings.begin(), settings.end());
  for (const std::string& set :
       {"camera.path=" + images.string(), "events.socket=" + socket,
        std::string("camera.wait_for_clients=2"), std::string("camera.exit_at_end=true")})
    command.insert(command.end(), {"--set", set});
  testing::NotifySocket notify((folder_ / "n").string());
  ChildProcess daemon(command, (folder_ / "daemon").string(), {notify.environment()});
  ASSERT_TRUE(notify.wait_for("READY=1")) << daemon.standard_error();

  EventClient client = EventClient::connect(socket).value();
  ASSERT_TRUE(client.watch({}).ok());
  while (true) {  // until the watch is in force; only then may the frames begin
    auto line = client.next(kPatience);
    ASSERT_TRUE(line.ok() && line.value());
    if (json::parse(*line.value())["class"] == "watch") break;
  }
  const EventClient starter = EventClient::connect(socket).value();
  EXPECT_EQ(loops_until_the_end(client), expected);
  EXPECT_EQ(daemon.wait(kPatience), 0) << daemon.standard_error();
}

}  // namespace
}  // namespace loopd
