#include "events/listening_socket.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>

#include <array>
#include <barrier>
#include <cerrno>
#include <filesystem>
#include <optional>
#include <thread>
#include <vector>

#include "support/temp_dir.h"

namespace loopd {
namespace {

namespace fs = std::filesystem;
using loopd::testing::TempDir;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::StartsWith;

std::string error_of(const std::string& path) {
  const Result<ListeningSocket> socket = ListeningSocket::bind(path, 0666);
  EXPECT_FALSE(socket.ok()) << path;
  return socket.ok() ? "" : socket.error().message;
}

ListeningSocket bound(const std::string& path) {
  Result<ListeningSocket> socket = ListeningSocket::bind(path, 0666);
  EXPECT_TRUE(socket.ok()) << socket.error().message;
  return std::move(socket).value();
}

UniqueFd bound_fd(const std::string& path, int type) {
  const sockaddr_un address = unix_address(path).value();
  UniqueFd fd(::socket(AF_UNIX, type, 0));
  EXPECT_EQ(::bind(fd.get(), reinterpret_cast<const sockaddr*>(&address), sizeof(address)), 0);
  return fd;
}

/// What a daemon that was killed leaves: the file, nobody behind it.
void leave_stale_socket(const std::string& path, int type) { bound_fd(path, type); }

/// What a service manager hands over.
UniqueFd listening_fd(const std::string& path, int type = SOCK_STREAM) {
  UniqueFd fd = bound_fd(path, type);
  EXPECT_EQ(::listen(fd.get(), 8), 0);
  return fd;
}

std::string adopt_error(UniqueFd fd, const std::string& path, int type = SOCK_STREAM) {
  const Result<ListeningSocket> socket = ListeningSocket::adopt(std::move(fd), path, type);
  EXPECT_FALSE(socket.ok());
  return socket.ok() ? "" : socket.error().message;
}

TEST(ListeningSocket, MakesItsFileForAllAndRemovesIt) {
  const TempDir dir;
  const fs::path path = dir / "s";
  const mode_t before = umask(077);
  {
    const ListeningSocket socket = bound(path);
    struct stat file;
    ASSERT_EQ(stat(path.c_str(), &file), 0);
    EXPECT_EQ(file.st_mode & 0777u, 0666u);
  }
  umask(before);
  EXPECT_FALSE(fs::exists(path));
}

TEST(ListeningSocket, RefusesPathsTheKernelCannotTake) {
  const TempDir dir;
  const std::string folder = dir.string() + "/";
  EXPECT_THAT(error_of(folder + std::string(108 - folder.size(), 'x')),
              AllOf(HasSubstr("is 108 bytes long"), HasSubstr("at most 107")));
  EXPECT_THAT(error_of(std::string(100'000, 'x')), HasSubstr("100000 bytes"));
  EXPECT_THAT(error_of(""), HasSubstr("empty"));
  EXPECT_THAT(error_of(std::string("a\0b", 3)), HasSubstr("NUL"));
  const ListeningSocket longest = bound(folder + std::string(107 - folder.size(), 'x'));
}

TEST(ListeningSocket, RefusesTheSocketOfALiveDaemon) {
  const TempDir dir;
  const std::string path = dir / "s";
  const ListeningSocket first = bound(path);
  EXPECT_THAT(error_of(path), HasSubstr("a running daemon uses it"));
  EXPECT_TRUE(fs::exists(path));
}

TEST(ListeningSocket, ReplacesAStaleSocket) {
  const TempDir dir;
  const std::string path = dir / "s";
  leave_stale_socket(path, SOCK_STREAM);
  ASSERT_TRUE(fs::exists(path));
  { const ListeningSocket socket = bound(path); }
  leave_stale_socket(path, SOCK_DGRAM);
  const ListeningSocket socket = bound(path);
}

TEST(ListeningSocket, RefusesALiveSocketOfAnotherType) {
  const TempDir dir;
  const std::string path = dir / "s";
  const sockaddr_un address = unix_address(path).value();
  const UniqueFd fd(::socket(AF_UNIX, SOCK_DGRAM, 0));
  ASSERT_EQ(::bind(fd.get(), reinterpret_cast<const sockaddr*>(&address), sizeof(address)), 0);
  EXPECT_THAT(error_of(path), HasSubstr("another type"));
}

TEST(ListeningSocket, NeverDeletesWhatIsNoSocket) {
  const TempDir dir;
  dir.write("file", "precious");
  fs::create_directory(dir / "folder");
  fs::create_symlink("nowhere", dir / "link");
  for (const char* name : {"file", "folder", "link"}) {
    EXPECT_THAT(error_of(dir / name), HasSubstr("not a socket")) << name;
    EXPECT_TRUE(fs::exists(fs::symlink_status(dir / name))) << name;
  }
}

TEST(ListeningSocket, NamesAMissingFolder) {
  const TempDir dir;
  EXPECT_THAT(error_of(dir / "no/s"),
              AllOf(HasSubstr((dir / "no").string()), HasSubstr("does not exist; create it")));
}

TEST(ListeningSocket, LeavesTheFileOfASuccessor) {
  const TempDir dir;
  const std::string path = dir / "s";
  {
    const ListeningSocket old = bound(path);
    fs::rename(path, dir / "aside");  // keeps the inode from being used again at once
    leave_stale_socket(path, SOCK_STREAM);
  }
  EXPECT_TRUE(fs::exists(path));
}

TEST(ListeningSocket, LeavesNoLockBehind) {
  const TempDir dir;
  const std::string path = dir / "s";
  {
    const ListeningSocket socket = bound(path);
    EXPECT_TRUE(fs::exists(path + ".lock"));
  }
  EXPECT_TRUE(fs::is_empty(dir.path()));
}

TEST(ListeningSocket, TheLockOfADaemonThatStartsKeepsAnotherOut) {
  const TempDir dir;
  const std::string path = dir / "s";
  leave_stale_socket(path, SOCK_STREAM);
  const Result<PathLock> starting = PathLock::take(path);
  ASSERT_TRUE(starting.ok());
  EXPECT_THAT(error_of(path), HasSubstr("a running daemon uses it"));
  EXPECT_TRUE(fs::exists(path)) << "nor is its file touched";
}

TEST(ListeningSocket, TheLockFileOfADaemonThatWasKilledIsNoObstacle) {
  const TempDir dir;
  dir.write("s.lock", "");
  const ListeningSocket socket = bound(dir / "s");
}

TEST(ListeningSocket, ALockThatCannotBeTakenIsNamed) {
  const TempDir dir;
  fs::create_directory(dir / "s.lock");
  EXPECT_THAT(error_of(dir / "s"), HasSubstr("cannot lock"));
}

TEST(ListeningSocket, OfManyThatStartAtOnceOnOneStaleSocketOneWins) {
  const TempDir dir;
  const std::string path = dir / "s";
  for (int round = 0; round < 50; ++round) {
    leave_stale_socket(path, SOCK_STREAM);
    constexpr int kDaemons = 4;
    std::barrier gate(kDaemons);
    std::array<std::optional<Result<ListeningSocket>>, kDaemons> sockets;
    std::vector<std::thread> daemons;
    for (auto& socket : sockets) {
      daemons.emplace_back([&] {
        gate.arrive_and_wait();
        socket.emplace(ListeningSocket::bind(path, 0666));
      });
    }
    for (std::thread& daemon : daemons) daemon.join();
    int winners = 0;
    for (const auto& socket : sockets) {
      winners += socket->ok() ? 1 : 0;
      if (socket->ok()) continue;
      EXPECT_THAT(socket->error().message, HasSubstr("a running daemon"));
    }
    EXPECT_EQ(winners, 1);
    EXPECT_TRUE(fs::exists(path));
  }
}

TEST(ListeningSocket, AdoptsASocketAndLeavesItsFile) {
  const TempDir dir;
  const std::string path = dir / "s";
  UniqueFd fd = listening_fd(path);
  const int number = fd.get();
  {
    const Result<ListeningSocket> socket = ListeningSocket::adopt(std::move(fd), path);
    ASSERT_TRUE(socket.ok()) << socket.error().message;
    EXPECT_EQ(socket.value().fd(), number);
    EXPECT_NE(fcntl(number, F_GETFL) & O_NONBLOCK, 0);
    EXPECT_EQ(fcntl(number, F_GETFD), FD_CLOEXEC);
  }
  EXPECT_TRUE(fs::exists(path));
}

TEST(ListeningSocket, AdoptsThroughALinkToItsFolder) {
  const TempDir dir;
  fs::create_directory(dir / "real");
  fs::create_directory_symlink("real", dir / "link");
  EXPECT_TRUE(ListeningSocket::adopt(listening_fd(dir / "real/s"), dir / "link/s").ok());
}

TEST(ListeningSocket, AdoptsNothingElse) {
  const TempDir dir;
  const std::string path = dir / "s";
  EXPECT_THAT(adopt_error(UniqueFd(), path), HasSubstr("no Unix socket"));
  EXPECT_THAT(adopt_error(UniqueFd(open("/dev/null", O_RDWR)), path), HasSubstr("no Unix socket"));
  EXPECT_THAT(adopt_error(UniqueFd(::socket(AF_INET, SOCK_STREAM, 0)), path),
              HasSubstr("no Unix socket"));
  EXPECT_THAT(adopt_error(bound_fd(dir / "a", SOCK_STREAM), path), HasSubstr("does not listen"));
  EXPECT_THAT(adopt_error(listening_fd(dir / "b", SOCK_SEQPACKET), path),
              HasSubstr("use ListenStream="));
  EXPECT_THAT(adopt_error(listening_fd(dir / "c"), path, SOCK_SEQPACKET),
              HasSubstr("use ListenSequentialPacket="));
  EXPECT_THAT(adopt_error(listening_fd(dir / "d"), path),
              AllOf(HasSubstr((dir / "d").string()), HasSubstr("must be the same")));
  const UniqueFd unnamed(::socket(AF_UNIX, SOCK_STREAM, 0));
  ASSERT_EQ(::listen(unnamed.get(), 1), -1) << "an unbound one cannot listen";
}

TEST(InheritedSockets, AreFoundByTheirPaths) {
  const TempDir dir;
  std::vector<UniqueFd> fds;
  fds.push_back(listening_fd(dir / "control.sock"));
  fds.push_back(UniqueFd(open("/dev/null", O_RDWR)));
  fds.push_back(listening_fd(dir / "events.sock"));
  const int events = fds.back().get();
  InheritedSockets inherited(std::move(fds));
  EXPECT_EQ(inherited.take(dir / "events.sock").get(), events);
  EXPECT_FALSE(inherited.take(dir / "events.sock").valid());
  EXPECT_FALSE(inherited.take(dir / "other").valid());
  EXPECT_THAT(inherited.left(),
              ElementsAre((dir / "control.sock").string(), StartsWith("descriptor ")));
}

TEST(ListeningSocket, ThePacketSocketLiesBesideTheOther) {
  EXPECT_EQ(seqpacket_path("/run/loopd/front/events.sock"), "/run/loopd/front/events.seqpacket");
  EXPECT_EQ(seqpacket_path("/run/x.y/events"), "/run/x.y/events.seqpacket");
  const TempDir dir;
  const Result<ListeningSocket> socket = ListeningSocket::bind(dir / "s", 0666, SOCK_SEQPACKET);
  ASSERT_TRUE(socket.ok());
  EXPECT_THAT(error_of(dir / "s"), HasSubstr("a running daemon")) << "whatever its type";
}

}  // namespace
}  // namespace loopd
