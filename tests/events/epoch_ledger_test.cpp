#include "events/epoch_ledger.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <random>
#include <sstream>
#include <vector>

#include "support/temp_dir.h"

namespace loopd {
namespace {

namespace fs = std::filesystem;
using loopd::testing::TempDir;
using ::testing::HasSubstr;

constexpr ClassSet kLoops{RecordClass::kLoop};
constexpr ClassSet kAll{RecordClass::kLoop, RecordClass::kCandidate, RecordClass::kState,
                        RecordClass::kStats};

EpochLedger opened(const std::string& path) {
  EpochLedger::Opened result = EpochLedger::open(path);
  EXPECT_EQ(result.warning, "");
  EXPECT_TRUE(result.ledger.has_file());
  return std::move(result.ledger);
}

std::string warning_of(const std::string& path) {
  EpochLedger::Opened result = EpochLedger::open(path);
  // Whatever was wrong: it works, if only in memory.
  result.ledger.begin_epoch("new", 1);
  result.ledger.add(RecordClass::kLoop);
  EXPECT_EQ(result.ledger.index_after({"new", 0}), result.ledger.epoch_index());
  EXPECT_EQ(result.ledger.count(result.ledger.epoch_index(), result.ledger.next_index(), kAll), 1u);
  return result.warning;
}

std::string content(const std::string& path) {
  std::ostringstream text;
  text << std::ifstream(path, std::ios::binary).rdbuf();
  return text.str();
}

void add(EpochLedger& ledger, int n, RecordClass record_class = RecordClass::kLoop) {
  for (int i = 0; i < n; ++i) ledger.add(record_class);
}

TEST(EpochLedger, CountsWhatAClientHasMissed) {
  EpochLedger ledger;
  ledger.begin_epoch("a", 1);
  add(ledger, 3);
  add(ledger, 2, RecordClass::kStats);
  ledger.begin_epoch("b", 6);
  add(ledger, 4);
  EXPECT_EQ(ledger.index_after({"a", 2}), 2u);
  EXPECT_EQ(ledger.last_seq("a"), 5u);
  EXPECT_EQ(ledger.epoch_index(), 5u);
  EXPECT_EQ(ledger.epoch_first_seq(), 6u);
  EXPECT_EQ(ledger.count(2, 5, kLoops), 1u);
  EXPECT_EQ(ledger.count(2, 5, kAll), 3u);
  EXPECT_EQ(ledger.count(2, ledger.next_index(), kLoops), 5u);
  EXPECT_EQ(ledger.count(2, 2, kAll), 0u);
}

TEST(EpochLedger, KnowsNoOtherEpochsAndRecords) {
  EpochLedger ledger;
  ledger.begin_epoch("a", 10);
  EXPECT_EQ(ledger.last_seq("a"), 9u) << "none yet";
  add(ledger, 3);
  for (const auto& [epoch, seq] : std::vector<std::pair<std::string, std::uint64_t>>{
           {"b", 11}, {"", 11}, {"a", 8}, {"a", 13}, {"a", ~0ull}, {std::string(5000, 'a'), 11}}) {
    EXPECT_FALSE(ledger.index_after({epoch, seq})) << epoch.substr(0, 9) << seq;
  }
  EXPECT_EQ(ledger.index_after({"a", 9}), 0u) << "a client that saw nothing but the greeting";
  EXPECT_EQ(ledger.index_after({"a", 12}), 3u);
}

TEST(EpochLedger, AnEpochWithALongNameIsCountedButNotFound) {
  EpochLedger ledger;
  ledger.begin_epoch("a", 1);
  add(ledger, 1);
  const std::string longest(EpochLedger::kMaxNameBytes, 'x');
  ledger.begin_epoch(longest + "x", 1);
  add(ledger, 2);
  ledger.begin_epoch(longest, 1);
  EXPECT_FALSE(ledger.index_after({longest + "x", 1}));
  EXPECT_TRUE(ledger.index_after({longest, 0}));
  EXPECT_EQ(ledger.count(*ledger.index_after({"a", 1}), ledger.epoch_index(), kAll), 2u);
}

TEST(EpochLedger, AgreesWithAPlainListAcrossReopening) {
  const TempDir dir;
  std::mt19937 random(5);
  std::vector<RecordClass> plain;
  std::vector<std::pair<std::string, std::size_t>> starts;
  for (int epoch = 0; epoch < 12; ++epoch) {
    EpochLedger ledger = opened(dir / "ledger");
    starts.emplace_back("e" + std::to_string(epoch), plain.size());
    ledger.begin_epoch(starts.back().first, 1);
    for (auto i = random() % 300; i > 0; --i) {
      plain.push_back(static_cast<RecordClass>(random() % kRecordClasses));
      ledger.add(plain.back());
    }
    for (int trial = 0; trial < 50; ++trial) {
      const auto& [name, start] = starts[random() % starts.size()];
      const std::uint64_t seq = random() % 100;
      const auto from = ledger.index_after({name, seq});
      if (!from) continue;
      ASSERT_EQ(*from, start + seq);
      const auto expected = std::count(plain.begin() + static_cast<std::ptrdiff_t>(*from),
                                       plain.end(), RecordClass::kLoop);
      EXPECT_EQ(ledger.count(*from, plain.size(), kLoops), static_cast<std::uint64_t>(expected));
    }
  }
}

TEST(EpochLedger, ForgetsTheOldestEpochsAndClasses) {
  const TempDir dir;
  EpochLedger ledger = opened(dir / "ledger");
  for (int i = 0; i < 40; ++i) {
    ledger.begin_epoch("e" + std::to_string(i), 1);
    add(ledger, 1);
  }
  EXPECT_FALSE(ledger.index_after({"e24", 0}));
  EXPECT_TRUE(ledger.index_after({"e25", 0}));
  add(ledger, static_cast<int>(EpochLedger::kRecords));
  const std::uint64_t end = ledger.next_index();
  EXPECT_EQ(ledger.count(end - EpochLedger::kRecords, end, kLoops), EpochLedger::kRecords);
  EXPECT_FALSE(ledger.count(end - EpochLedger::kRecords - 1, end, kLoops)) << "too long ago";
  EXPECT_EQ(ledger.count(0, 0, kLoops), 0u) << "nothing is known to be nothing";
}

TEST(EpochLedger, SurvivesBeingKilled) {
  const TempDir dir;
  const std::string path = dir / "ledger";
  const pid_t child = fork();
  if (child == 0) {
    EpochLedger ledger = std::move(EpochLedger::open(path).ledger);
    ledger.begin_epoch("killed", 1);
    add(ledger, 123);
    ::raise(SIGKILL);
  }
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFSIGNALED(status));
  const EpochLedger ledger = opened(path);
  EXPECT_EQ(ledger.last_seq("killed"), 123u);
}

TEST(EpochLedger, IsValidAfterEachOfItsWrites) {
  // All files that a kill could leave while an epoch begins and a record is added.
  const TempDir dir;
  const std::string path = dir / "ledger";
  {
    EpochLedger ledger = opened(path);
    for (int i = 0; i < 20; ++i) ledger.begin_epoch("e" + std::to_string(i), 1);
    add(ledger, 5);
  }
  const std::string before = content(path);
  {
    EpochLedger ledger = opened(path);
    ledger.begin_epoch("next", 1);
    add(ledger, 1);
  }
  const std::string after = content(path);
  // The slot and then the count of epochs; the class and then the count of records.
  const std::size_t slots = 24, classes = slots + 16 * 80;
  std::string torn = before;
  for (const auto& [from, bytes] : std::vector<std::pair<std::size_t, std::size_t>>{
           {slots, 16 * 40}, {slots, 16 * 80}, {8, 8}, {classes, EpochLedger::kRecords}, {16, 8}}) {
    torn.replace(from, bytes, after, from, bytes);
    dir.write("torn", torn);
    const EpochLedger ledger = opened(dir / "torn");
    EXPECT_EQ(ledger.last_seq("e19"), 5u);
  }
  EXPECT_EQ(torn, after);
}

TEST(EpochLedger, IsForItsOwnerOnly) {
  const TempDir dir;
  const EpochLedger ledger = opened(dir / "ledger");
  struct stat file;
  ASSERT_EQ(stat((dir / "ledger").c_str(), &file), 0);
  EXPECT_EQ(file.st_mode & 0777u, 0600u);
}

TEST(EpochLedger, OneProcessAtATime) {
  const TempDir dir;
  EpochLedger first = opened(dir / "ledger");
  first.begin_epoch("a", 1);
  EXPECT_THAT(warning_of(dir / "ledger"), HasSubstr("another process uses it"));
  add(first, 2);
  first = EpochLedger();
  EXPECT_EQ(opened(dir / "ledger").last_seq("a"), 2u);
}

TEST(EpochLedger, WorksInMemoryWithoutAUsableFile) {
  const TempDir dir;
  fs::create_directory(dir / "folder");
  fs::create_symlink("nowhere", dir / "link");
  ASSERT_EQ(mkfifo((dir / "fifo").c_str(), 0600), 0);
  EXPECT_THAT(warning_of(dir / "no/ledger"), HasSubstr("No such file"));
  EXPECT_NE(warning_of(dir / "folder"), "");
  EXPECT_NE(warning_of(dir / "link"), "");
  EXPECT_THAT(warning_of(dir / "fifo"), HasSubstr("not a regular file"));
  EXPECT_FALSE(fs::exists(dir / "nowhere"));
}

TEST(EpochLedger, BeginsDamagedFilesAnew) {
  const TempDir dir;
  const std::string path = dir / "ledger";
  {
    EpochLedger ledger = opened(path);
    ledger.begin_epoch("a", 1);
    add(ledger, 3);
  }
  const std::string good = content(path);
  for (const std::string& bad :
       {good.substr(0, good.size() - 1), good + "x", std::string("short"),
        std::string(good.size(), '\0'), std::string(good.size(), '\xff')}) {
    dir.write("ledger", bad);
    EXPECT_THAT(warning_of(path), HasSubstr("damaged"));
    EXPECT_EQ(fs::file_size(path), good.size());
    EXPECT_EQ(warning_of(path), "") << "mended";
  }
}

TEST(EpochLedger, AnswersWhateverTheFileHolds) {
  const TempDir dir;
  const std::string path = dir / "ledger";
  {
    EpochLedger ledger = opened(path);
    for (int i = 0; i < 18; ++i) {
      ledger.begin_epoch("e" + std::to_string(i), 1);
      add(ledger, 3);
    }
  }
  const std::string good = content(path);
  std::mt19937 random(6);
  for (int round = 0; round < 300; ++round) {
    std::string bad = good;
    for (int i = 0; i < 3; ++i) {
      // Most of it in the counts and epochs, where it matters.
      const std::size_t at = random() % 4 == 0 ? random() % bad.size() : random() % 1304;
      bad[at] = static_cast<char>(random());
    }
    dir.write("ledger", bad);
    EpochLedger ledger = std::move(EpochLedger::open(path).ledger);
    ledger.begin_epoch("now", 1);
    add(ledger, 2);
    for (int i = 0; i < 18; ++i) {
      const auto from = ledger.index_after({"e" + std::to_string(i), random() % 5});
      if (!from) continue;
      ASSERT_LE(*from, ledger.epoch_index());
      const auto count = ledger.count(*from, ledger.next_index(), kAll);
      EXPECT_LE(count.value_or(0), EpochLedger::kRecords);
    }
  }
}

TEST(EpochLedger, AFileThatCannotBeKeptUpIsEmptied) {
  const TempDir dir;
  const std::string path = dir / "ledger";
  EpochLedger ledger = opened(path);
  ledger.begin_epoch("a", 1);
  const auto before = signal(SIGXFSZ, SIG_IGN);
  rlimit limit{};
  getrlimit(RLIMIT_FSIZE, &limit);
  const rlimit none{0, limit.rlim_max};
  setrlimit(RLIMIT_FSIZE, &none);
  add(ledger, 1);
  setrlimit(RLIMIT_FSIZE, &limit);
  signal(SIGXFSZ, before);
  EXPECT_FALSE(ledger.has_file());
  EXPECT_EQ(fs::file_size(path), 0u) << "better nothing than too little";
  EXPECT_EQ(ledger.last_seq("a"), 1u) << "in memory it goes on";
  EXPECT_EQ(opened(path).last_seq("a"), std::nullopt);
}

}  // namespace
}  // namespace loopd
