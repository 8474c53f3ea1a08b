#include "base/unique_fd.h"

#include <fcntl.h>
#include <gtest/gtest.h>

namespace loopd {
namespace {

bool is_open(int fd) { return fcntl(fd, F_GETFD) != -1; }
int open_null() { return open("/dev/null", O_RDONLY | O_CLOEXEC); }

TEST(UniqueFd, ClosesWhatItOwns) {
  const int raw = open_null();
  {
    const UniqueFd fd(raw);
    EXPECT_TRUE(fd.valid());
    EXPECT_TRUE(is_open(raw));
  }
  EXPECT_FALSE(is_open(raw));
}

TEST(UniqueFd, MovesAndReleases) {
  UniqueFd a(open_null());
  const int raw = a.get();
  UniqueFd b(std::move(a));
  EXPECT_FALSE(a.valid());  // NOLINT(bugprone-use-after-move): what a moved-from one is
  b = UniqueFd(open_null());
  EXPECT_NE(b.get(), -1);
  const int kept = b.release();
  EXPECT_FALSE(b.valid());
  EXPECT_TRUE(is_open(kept));
  b.reset(kept);
  b.reset();
  EXPECT_FALSE(is_open(kept));
  EXPECT_FALSE(is_open(raw) && raw != kept);
}

}  // namespace
}  // namespace loopd
