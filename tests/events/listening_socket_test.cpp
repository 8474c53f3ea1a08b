#include "events/listening_socket.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>

#include <cerrno>
#include <filesystem>

#include "support/temp_dir.h"

namespace loopd {
namespace {

namespace fs = std::filesystem;
using loopd::testing::TempDir;
using ::testing::AllOf;
using ::testing::HasSubstr;

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

/// What a daemon that was killed leaves: the file, nobody behind it.
void leave_stale_socket(const std::string& path, int type) {
  const sockaddr_un address = unix_address(path).value();
  UniqueFd fd(::socket(AF_UNIX, type, 0));
  ASSERT_EQ(::bind(fd.get(), reinterpret_cast<const sockaddr*>(&address), sizeof(address)), 0);
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

}  // namespace
}  // namespace loopd
