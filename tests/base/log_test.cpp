#include "base/log.h"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cstdlib>

#include "base/unique_fd.h"

namespace loopd {
namespace {

struct Pipe {
  UniqueFd read_end;
  UniqueFd write_end;
};

Pipe make_pipe() {
  std::array<int, 2> fds{};
  EXPECT_EQ(pipe(fds.data()), 0);
  return {UniqueFd(fds[0]), UniqueFd(fds[1])};
}

/// All that was written to the pipe, which is closed for writing.
std::string drained(Pipe& ends) {
  ends.write_end.reset();
  std::string text(4096, '\0');
  const ssize_t count = read(ends.read_end.get(), text.data(), text.size());
  text.resize(count > 0 ? static_cast<std::size_t>(count) : 0);
  return text;
}

std::string logged(Log::Format format, void (*write)(const Log&)) {
  Pipe ends = make_pipe();
  write(Log(ends.write_end.get(), format));
  return drained(ends);
}

TEST(Log, PrefixesLevelsForTheJournalAndForPeople) {
  const auto write = [](const Log& log) {
    log.error("no socket");
    log.warning("slow");
    log.info("up");
    log.write(LogLevel::kDebug, "not written");
  };
  EXPECT_EQ(logged(Log::Format::kJournal, write), "<3>no socket\n<4>slow\n<6>up\n");
  EXPECT_EQ(logged(Log::Format::kPlain, write), "error: no socket\nwarning: slow\nup\n");
}

TEST(Log, QuotesFieldsThatNeedIt) {
  const auto write = [](const Log& log) {
    log.info("camera", {{"name", "front"}, {"path", "/a b"}, {"cause", "say \"no\""}, {"x", ""}});
  };
  EXPECT_EQ(logged(Log::Format::kPlain, write),
            "camera name=front path=\"/a b\" cause=\"say \\\"no\\\"\" x=\"\"\n");
}

TEST(Log, StaysOneLineWhateverIsInIt) {
  const auto write = [](const Log& log) {
    log.info("two\nlines", {{"file", "a\n<3>fake\x7f.png"}});
  };
  EXPECT_EQ(logged(Log::Format::kJournal, write), "<6>two\\x0alines file=a\\x0a<3>fake\\x7f.png\n");
}

TEST(Log, UsesTheJournalsFormOnlyOnTheStreamThatSystemdConnected) {
  Pipe ends = make_pipe();
  struct stat status {};
  ASSERT_EQ(fstat(ends.write_end.get(), &status), 0);
  const std::string stream = std::to_string(status.st_dev) + ":" + std::to_string(status.st_ino);
  const UniqueFd real_stderr(dup(STDERR_FILENO));
  ASSERT_GE(dup2(ends.write_end.get(), STDERR_FILENO), 0);
  setenv("JOURNAL_STREAM", stream.c_str(), 1);
  Log::to_stderr().warning("matched");
  setenv("JOURNAL_STREAM", "1:2", 1);
  Log::to_stderr().warning("other stream");
  unsetenv("JOURNAL_STREAM");
  Log::to_stderr().warning("no systemd");
  ASSERT_GE(dup2(real_stderr.get(), STDERR_FILENO), 0);
  EXPECT_EQ(drained(ends), "<4>matched\nwarning: other stream\nwarning: no systemd\n");
}

}  // namespace
}  // namespace loopd
