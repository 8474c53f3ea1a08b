#include "capture/libcamera_dev_watch.h"

#include <gtest/gtest.h>
#include <poll.h>

#include <filesystem>

#include "support/temp_dir.h"

namespace loopd {
namespace {

bool readable(const DevWatch& watch) {
  pollfd entry{watch.fd(), POLLIN, 0};
  return ::poll(&entry, 1, 0) == 1;
}

TEST(DevWatch, TellsOfNodesThatAppear) {
  const testing::TempDir folder;
  DevWatch watch(folder.string());
  EXPECT_FALSE(readable(watch));
  folder.write("video0", "");
  EXPECT_TRUE(readable(watch));
  watch.acknowledge();
  EXPECT_FALSE(readable(watch));
}

TEST(DevWatch, TellsOfNodesThatBecomeUsable) {
  const testing::TempDir folder;
  const auto node = folder.write("video0", "");
  DevWatch watch(folder.string());
  std::filesystem::permissions(node, std::filesystem::perms::owner_all);
  EXPECT_TRUE(readable(watch));
}

TEST(DevWatch, KnowsTheRemovedNodeEvenIfItIsBack) {
  const testing::TempDir folder;
  const auto node = folder.write("video0", "");
  DevWatch watch(folder.string());
  std::filesystem::remove(node);
  folder.write("video0", "");
  EXPECT_TRUE(watch.removed({"media0", "video0"}));
  EXPECT_FALSE(watch.removed({"video0"})) << "told once";
}

TEST(DevWatch, OtherNodesDoNotMatter) {
  const testing::TempDir folder;
  const auto node = folder.write("video10", "");
  DevWatch watch(folder.string());
  folder.write("video1", "");
  std::filesystem::remove(node);
  EXPECT_FALSE(watch.removed({"video1"}));
  EXPECT_FALSE(readable(watch));
}

TEST(DevWatch, ManyChangesAreReadInOneGo) {
  const testing::TempDir folder;
  DevWatch watch(folder.string());
  for (int i = 0; i < 400; ++i) {
    const auto node = folder.write("a-node-with-a-rather-long-name" + std::to_string(i), "");
    std::filesystem::remove(node);
  }
  EXPECT_TRUE(watch.removed({"a-node-with-a-rather-long-name399"}));
  EXPECT_FALSE(readable(watch));
}

TEST(DevWatch, WithoutAFolderThereIsNothingToWait) {
  DevWatch watch("/no/such/folder");
  EXPECT_EQ(watch.fd(), -1);
  EXPECT_FALSE(watch.removed({"video0"}));
}

}  // namespace
}  // namespace loopd
