#include "base/log.h"

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cstdlib>

#include "base/unique_fd.h"
#include "support/temp_dir.h"

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

/// Stands in for the journal's socket.
UniqueFd bound_datagram_socket(const std::string& path) {
  UniqueFd fd(socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  path.copy(std::begin(address.sun_path), sizeof(address.sun_path) - 1);
  EXPECT_EQ(bind(fd.get(), reinterpret_cast<const sockaddr*>(&address), sizeof(address)), 0);
  return fd;
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

TEST(Log, QuotesFieldsThatNeedItAndLeavesEmptyOnesOut) {
  const auto write = [](const Log& log) {
    log.info("camera", {{"name", "front"}, {"path", "/a b"}, {"cause", "say \"no\""}, {"x", ""}});
  };
  EXPECT_EQ(logged(Log::Format::kPlain, write),
            "camera name=front path=\"/a b\" cause=\"say \\\"no\\\"\"\n");
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
  const testing::TempDir folder;  // holds no socket of a journal
  const std::string nobody = (folder / "socket").string();
  setenv("JOURNAL_STREAM", stream.c_str(), 1);
  Log::to_stderr(nobody).warning("matched");
  setenv("JOURNAL_STREAM", "1:2", 1);
  Log::to_stderr(nobody).warning("other stream");
  unsetenv("JOURNAL_STREAM");
  Log::to_stderr(nobody).warning("no systemd");
  ASSERT_GE(dup2(real_stderr.get(), STDERR_FILENO), 0);
  EXPECT_EQ(drained(ends), "<4>matched\nwarning: other stream\nwarning: no systemd\n");
}

/// Makes standard error the stream that systemd connected to the journal, until destruction.
class JournalOnStderr {
 public:
  explicit JournalOnStderr(int fd) : real_stderr_(dup(STDERR_FILENO)) {
    struct stat status {};
    EXPECT_EQ(fstat(fd, &status), 0);
    EXPECT_GE(dup2(fd, STDERR_FILENO), 0);
    setenv("JOURNAL_STREAM",
           (std::to_string(status.st_dev) + ":" + std::to_string(status.st_ino)).c_str(), 1);
  }
  ~JournalOnStderr() {
    unsetenv("JOURNAL_STREAM");
    dup2(real_stderr_.get(), STDERR_FILENO);
  }

 private:
  UniqueFd real_stderr_;
};

TEST(Log, SendsEntriesWithFieldsWhereTheJournalAnswers) {
  const testing::TempDir folder;
  const std::string path = (folder / "socket").string();
  const UniqueFd journal = bound_datagram_socket(path);
  Pipe ends = make_pipe();
  {
    const JournalOnStderr redirected(ends.write_end.get());
    Log::to_stderr(path).write(LogLevel::kWarning, "camera lost",
                               {{"camera", "front"}, {"cause", "two\nlines"}},
                               "0123456789abcdef0123456789abcdef");
  }
  std::string entry(4096, '\0');
  const ssize_t count = recv(journal.get(), entry.data(), entry.size(), MSG_DONTWAIT);
  ASSERT_GT(count, 0);
  entry.resize(static_cast<std::size_t>(count));
  const std::string length("\x09\0\0\0\0\0\0\0", 8);
  EXPECT_EQ(entry,
            "MESSAGE=camera lost camera=front cause=two\\x0alines\n"
            "PRIORITY=4\nSYSLOG_IDENTIFIER=loopd\nMESSAGE_ID=0123456789abcdef0123456789abcdef\n"
            "LOOPD_CAMERA=front\nLOOPD_CAUSE\n" +
                length + "two\nlines\n");
  EXPECT_EQ(drained(ends), "") << "told twice";
}

TEST(Log, AFullJournalCostsTheEntryAndNotTheCaller) {
  const testing::TempDir folder;
  const std::string path = (folder / "socket").string();
  const UniqueFd journal = bound_datagram_socket(path);
  Pipe ends = make_pipe();
  const JournalOnStderr redirected(ends.write_end.get());
  const Log log = Log::to_stderr(path);
  const std::string text(1000, 'x');
  for (int i = 0; i < 10'000; ++i) log.info(text);  // nobody reads: must come to its end
}

}  // namespace
}  // namespace loopd
