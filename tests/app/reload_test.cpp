#include "app/reload.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace loopd {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

DaemonConfig live_config() {
  DaemonConfig config;
  config.camera.source = "v4l2";
  config.camera.path = "/dev/video0";
  return config;
}

TEST(Reload, EqualConfigsChangeNothing) {
  const ConfigChanges changes = changes_between(live_config(), live_config());
  EXPECT_TRUE(changes.none());
  EXPECT_EQ(changes_text(changes), "nothing has changed");
}

TEST(Reload, SortsKeysByWhatTheyNeed) {
  DaemonConfig wanted = live_config();
  wanted.camera.controls = "gain=3";
  wanted.camera.width = 320;
  wanted.camera.buffers = 8;
  wanted.events.stats_interval_s = 1;
  wanted.detector.verify.min_inliers = 99;
  const ConfigChanges changes = changes_between(live_config(), wanted);
  EXPECT_THAT(changes.camera, ElementsAre("camera.width", "camera.controls"));
  EXPECT_THAT(changes.at_once, ElementsAre("events.stats_interval_s"));
  EXPECT_THAT(changes.restart, ElementsAre("camera.buffers", "verify.min_inliers"));
  EXPECT_EQ(changes_text(changes),
            "taken over: events.stats_interval_s; the camera is opened again for camera.width, "
            "camera.controls; only a restart changes camera.buffers, verify.min_inliers");
}

TEST(Reload, TheConfigInForceTakesOverOnlyWhatCanChange) {
  DaemonConfig wanted = live_config();
  wanted.camera.path = "/dev/video2";
  wanted.events.stats_interval_s = 1;
  wanted.detector.verify.min_inliers = 99;
  const DaemonConfig running = changes_between(live_config(), wanted).config;
  EXPECT_EQ(running.camera.path, "/dev/video2");
  EXPECT_EQ(running.events.stats_interval_s, 1);
  EXPECT_EQ(running.detector.verify.min_inliers, DaemonConfig().detector.verify.min_inliers);
  // What needs a restart is told again by the next reload, since it still differs.
  EXPECT_THAT(changes_between(running, wanted).restart, ElementsAre("verify.min_inliers"));
}

TEST(Reload, ARecordingIsNotExchangedForACamera) {
  DaemonConfig recording;
  recording.camera.path = "/data";
  const ConfigChanges changes = changes_between(recording, live_config());
  EXPECT_THAT(changes.camera, IsEmpty());
  EXPECT_THAT(changes.restart, ElementsAre("camera.source", "camera.path"));
}

}  // namespace
}  // namespace loopd
