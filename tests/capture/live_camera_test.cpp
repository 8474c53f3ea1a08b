// The live camera over a fake driver, in a time of its own: nothing here waits.

#include "capture/live_camera.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <numeric>
#include <string>
#include <thread>
#include <vector>

#include "support/camera_events.h"
#include "support/fake_capture.h"

namespace loopd {
namespace {

using ::testing::ElementsAre;
using testing::event_text;
using testing::FakeCamera;
using testing::FakeDriver;
using ::testing::HasSubstr;
using testing::next_error;
using testing::next_frame;

constexpr std::int64_t kMs = 1'000'000;
constexpr std::int64_t kFrame_ns = 33 * kMs;

class LiveCameraTest : public ::testing::Test {
 protected:
  LiveCameraTest() {
    std::iota(pixels_.begin(), pixels_.end(), std::uint8_t{1});
    fake_.grab = [this](std::int64_t) { return CaptureDevice::Grab(raw()); };
  }

  // A good frame, a frame time after the one before, stamped 20 ms ago.
  RawFrame raw() {
    fake_.clock.pass_ns(kFrame_ns);
    RawFrame frame{.width_px = 4, .height_px = 2, .stride_bytes = 4};
    frame.bytes = pixels_;
    frame.sequence = sequence_++;
    frame.time_ns = now_ns() - 20 * kMs;
    return frame;
  }

  std::int64_t now_ns() const { return fake_.clock.now_ns(); }

  std::unique_ptr<Camera> open() {
    return make_live_camera(std::make_unique<FakeDriver>(fake_), pool_, fake_.clock);
  }

  // A camera of which the first frame has come.
  std::unique_ptr<Camera> streaming() {
    auto camera = open();
    EXPECT_THAT(event_text(camera->next()), HasSubstr("opened Fake"));
    next_frame(*camera);
    return camera;
  }

  // Every event but frames, up to `count` events of any kind.
  static std::vector<std::string> told(Camera& camera, int count) {
    std::vector<std::string> texts;
    for (int i = 0; i < count; ++i) {
      const CameraEvent event = camera.next();
      if (!std::holds_alternative<Frame>(event)) texts.push_back(event_text(event));
    }
    return texts;
  }

  FakeCamera fake_;
  std::vector<std::uint8_t> pixels_ = std::vector<std::uint8_t>(8);
  std::uint64_t sequence_ = 0;
  FramePool pool_{2, 8};
};

TEST_F(LiveCameraTest, FramesComeWithTheirPixelsTimesAndNumbers) {
  const auto camera = open();
  EXPECT_EQ(
      event_text(camera->next()),
      "notice: opened Fake (/dev/video0, usb-1): 4x2 GREY at 30 fps, time stamps by monotonic "
      "clock");
  for (std::uint64_t i = 0; i < 5; ++i) {
    const Frame frame = next_frame(*camera);
    EXPECT_EQ(frame.sequence, i);
    EXPECT_EQ(frame.time_ns, now_ns() - 20 * kMs);
    EXPECT_EQ(std::vector<std::uint8_t>(frame.buffer.get(), frame.buffer.get() + 8), pixels_);
    EXPECT_EQ(fake_.out, 0) << "given back to the driver";
  }
  EXPECT_EQ(camera->dropped(), 0u);
  EXPECT_EQ(camera->restamped(), 0u);
  EXPECT_EQ(camera->describe(), "fake camera: Fake (/dev/video0, usb-1), 4x2 GREY at 30 fps");
}

TEST_F(LiveCameraTest, WarningsOfTheDeviceAreTold) {
  fake_.info.warnings = {"no gain", "no focus"};
  const auto camera = open();
  EXPECT_THAT(told(*camera, 4),
              ElementsAre(HasSubstr("opened"), "notice: no gain", "notice: no focus"));
}

TEST_F(LiveCameraTest, ADeviceThatIsNotThereIsAskedForMoreAndMoreSlowlyAndToldTwiceASecond) {
  fake_.away = true;
  const auto camera = open();
  const std::int64_t start_ns = now_ns();
  EXPECT_EQ(event_text(camera->next()), "no_device 0 lost");
  EXPECT_EQ(now_ns(), start_ns) << "the first attempt does not wait";
  for (int i = 1; i <= 20; ++i) {
    EXPECT_EQ(event_text(camera->next()), "no_device 0 lost");
    EXPECT_EQ(now_ns(), start_ns + i * 500 * kMs);
  }
  EXPECT_LT(fake_.open_calls, 35);
  EXPECT_GT(fake_.open_calls, 20);
  fake_.away = false;
  EXPECT_THAT(event_text(camera->next()), HasSubstr("opened"));
  next_frame(*camera);
}

TEST_F(LiveCameraTest, AHotplugEventIsTriedAtOnceButNoOftenerThanEveryTenMilliseconds) {
  fake_.away = fake_.hotplug = true;
  const auto camera = open();
  for (int i = 0; i < 10; ++i) camera->next();  // the back-off is at its longest
  const std::int64_t start_ns = now_ns();
  fake_.open_times_ns.clear();
  for (int i = 0; i < 20; ++i) fake_.clock.change_at(start_ns + 100 * kMs);
  camera->next();
  ASSERT_GE(fake_.open_times_ns.size(), 20u);
  EXPECT_EQ(fake_.open_times_ns.front(), start_ns + 100 * kMs);
  for (std::size_t i = 1; i < fake_.open_times_ns.size(); ++i)
    EXPECT_GE(fake_.open_times_ns[i] - fake_.open_times_ns[i - 1], 10 * kMs);
}

TEST_F(LiveCameraTest, UnpluggedAndBack) {
  const auto camera = streaming();
  const auto stream = fake_.grab;
  fake_.away = true;
  fake_.grab = [](std::int64_t) {
    return CameraError{CameraFault::kUnplugged, "it went away", ENODEV, true, 0};
  };
  EXPECT_EQ(event_text(camera->next()), "unplugged 1 lost");
  EXPECT_EQ(fake_.open_now, 0) << "closed at once";
  const std::int64_t lost_ns = now_ns();
  EXPECT_EQ(event_text(camera->next()), "no_device 1 lost");
  EXPECT_EQ(now_ns(), lost_ns + 500 * kMs);
  fake_.away = false;
  fake_.grab = stream;
  sequence_ = 0;
  EXPECT_THAT(event_text(camera->next()), HasSubstr("opened"));
  EXPECT_EQ(next_frame(*camera).sequence, 1u) << "goes on, though the driver starts at 0 again";
  EXPECT_EQ(next_frame(*camera).sequence, 2u);
  EXPECT_EQ(camera->dropped(), 0u);
}

TEST_F(LiveCameraTest, AThousandUnpluggingsLeaveNothingOpen) {
  const auto camera = streaming();
  const auto stream = fake_.grab;
  for (int i = 0; i < 1000; ++i) {
    fake_.grab = [](std::int64_t) {
      return CameraError{CameraFault::kUnplugged, "it went away", ENODEV, true, 0};
    };
    EXPECT_EQ(event_text(camera->next()), "unplugged " + std::to_string(i + 1) + " lost");
    fake_.grab = stream;
    EXPECT_THAT(event_text(camera->next()), HasSubstr("opened"));
    EXPECT_EQ(next_frame(*camera).sequence, static_cast<std::uint64_t>(i) + 1);
  }
  EXPECT_EQ(fake_.opened, 1001);
  EXPECT_EQ(fake_.open_now, 1);
  EXPECT_EQ(pool_.available(), 2u);
}

TEST_F(LiveCameraTest, AnotherCameraUnderTheSameNodeIsNoticed) {
  const auto camera = streaming();
  const auto stream = fake_.grab;
  fake_.grab = [](std::int64_t) {
    return CameraError{CameraFault::kUnplugged, "it went away", ENODEV, true, 0};
  };
  fake_.info.id = "usb-2";
  fake_.info.name = "Else";
  camera->next();
  fake_.grab = stream;
  EXPECT_EQ(event_text(camera->next()),
            "notice: another camera is there now: it was Fake (/dev/video0, usb-1), it is Else "
            "(/dev/video0, usb-2)");
  EXPECT_THAT(event_text(camera->next()), HasSubstr("opened Else"));
}

TEST_F(LiveCameraTest, NoFrameForASecondIsAStall) {
  const auto camera = streaming();
  const std::int64_t last_ns = now_ns();
  const auto stream = fake_.grab;
  fake_.grab = [](std::int64_t) { return CaptureDevice::Grab(TimedOut{}); };
  const CameraError error = next_error(*camera);
  EXPECT_EQ(error.fault, CameraFault::kStalled);
  EXPECT_TRUE(error.lost);
  EXPECT_EQ(now_ns(), last_ns + 1000 * kMs);
  EXPECT_EQ(fake_.open_now, 0);
  fake_.grab = stream;
  EXPECT_THAT(event_text(camera->next()), HasSubstr("opened"));
  next_frame(*camera);
}

TEST_F(LiveCameraTest, ASlowCameraHasFiveFrameTimes) {
  fake_.info.fps = 2;
  const auto camera = streaming();
  const std::int64_t last_ns = now_ns();
  fake_.grab = [](std::int64_t) { return CaptureDevice::Grab(TimedOut{}); };
  EXPECT_EQ(next_error(*camera).fault, CameraFault::kStalled);
  EXPECT_EQ(now_ns(), last_ns + 2500 * kMs);
}

TEST_F(LiveCameraTest, RatesNoCameraHasDoNoHarm) {
  for (double fps : {-1.0, 0.0, 1e300, 1e-300, std::numeric_limits<double>::infinity(),
                     std::numeric_limits<double>::quiet_NaN()}) {
    fake_.info.fps = fps;
    sequence_ = 0;
    streaming();
  }
}

TEST_F(LiveCameraTest, ACameraSlowToStartIsGivenMoreTimeEachOpeningAndKeepsIt) {
  std::int64_t opened_ns = 0;
  std::int64_t start_ms = 3500;  // what the first frame takes
  bool unplugged = false;
  fake_.grab = [&](std::int64_t deadline_ns) -> CaptureDevice::Grab {
    if (unplugged) return CameraError{CameraFault::kUnplugged, "it went away", ENODEV, true, 0};
    if (deadline_ns < opened_ns + start_ms * kMs) return TimedOut{};
    fake_.clock.pass_ns(std::max<std::int64_t>(opened_ns + start_ms * kMs - now_ns(), 0));
    return raw();
  };
  const auto camera = open();
  // Opens it and waits; how long until there was a frame or a stall, in ms.
  const auto wait = [&] {
    EXPECT_THAT(event_text(camera->next()), HasSubstr("opened"));
    opened_ns = now_ns();
    camera->next();
    return (now_ns() - opened_ns) / kMs;
  };
  const auto replug = [&] {
    unplugged = true;
    EXPECT_EQ(next_error(*camera).fault, CameraFault::kUnplugged);
    unplugged = false;
  };
  EXPECT_EQ(wait(), 1000);
  EXPECT_EQ(wait(), 2000);
  EXPECT_EQ(wait(), 3533) << "a frame";
  replug();
  EXPECT_EQ(wait(), 3533) << "at once";
  replug();
  start_ms = 100;
  EXPECT_EQ(wait(), 133);
  replug();
  start_ms = 3500;
  EXPECT_EQ(wait(), 1000) << "it did not need it last time";
}

TEST_F(LiveCameraTest, DamagedAndShortFramesCostThemselvesOnly) {
  const auto camera = streaming();
  const auto stream = fake_.grab;
  fake_.grab = [this](std::int64_t) {
    RawFrame frame = raw();
    frame.damaged = true;
    return CaptureDevice::Grab(frame);
  };
  EXPECT_EQ(event_text(camera->next()), "corrupt_frame 1");
  fake_.grab = [this](std::int64_t) {
    RawFrame frame = raw();
    frame.bytes = frame.bytes.first(7);
    return CaptureDevice::Grab(frame);
  };
  const CameraError error = next_error(*camera);
  EXPECT_EQ(error.fault, CameraFault::kCorruptFrame);
  EXPECT_FALSE(error.lost);
  EXPECT_THAT(error.message, HasSubstr("7 of 8 bytes"));
  fake_.grab = stream;
  EXPECT_EQ(next_frame(*camera).sequence, 3u);
  EXPECT_EQ(camera->dropped(), 0u);
  EXPECT_EQ(fake_.out, 0);
  EXPECT_EQ(pool_.available(), 2u);
}

TEST_F(LiveCameraTest, OnlyDamagedFramesForTheTimeOutAreAStall) {
  const auto camera = streaming();
  const std::int64_t good_ns = now_ns();
  fake_.grab = [this](std::int64_t) {
    RawFrame frame = raw();
    frame.damaged = true;
    return CaptureDevice::Grab(frame);
  };
  int corrupt = 0;
  CameraError error = next_error(*camera);
  for (; !error.lost; error = next_error(*camera)) ++corrupt;
  EXPECT_EQ(error.fault, CameraFault::kStalled);
  EXPECT_NEAR(static_cast<double>(now_ns() - good_ns), 1e9, 1e8);
  EXPECT_EQ(corrupt, 30);
  EXPECT_EQ(fake_.open_now, 0);
}

TEST_F(LiveCameraTest, ADeviceThatAnswersErrorsAtOnceDoesNotSpin) {
  fake_.grab = [](std::int64_t) {
    return CameraError{CameraFault::kCorruptFrame, "no", EIO, false, 0};
  };
  const auto camera = open();
  const std::int64_t start_ns = now_ns();
  for (int i = 0; i < 10'000; ++i) camera->next();
  EXPECT_GT(now_ns() - start_ns, 20'000 * kMs) << "10000 answers in less than 20 s";
}

TEST_F(LiveCameraTest, ADeviceThatOpensAndFailsDoesNotSpin) {
  fake_.grab = [](std::int64_t) {
    return CameraError{CameraFault::kStreamError, "no", EIO, true, 0};
  };
  const auto camera = open();
  const std::int64_t start_ns = now_ns();
  for (int i = 0; i < 30; ++i) camera->next();  // notice and error, fifteen times
  EXPECT_GT(now_ns() - start_ns, 4'000 * kMs);
  EXPECT_LE(fake_.open_calls, 16);
}

TEST_F(LiveCameraTest, FramesTooLargeAreTheLossOfTheCamera) {
  std::vector<std::uint8_t> large(16);
  const auto camera = streaming();
  fake_.grab = [&](std::int64_t) {
    RawFrame frame = raw();
    frame.height_px = 4;
    frame.bytes = large;
    return CaptureDevice::Grab(frame);
  };
  const std::int64_t start_ns = now_ns();
  int told = 0;
  while (now_ns() - start_ns < 4'000 * kMs) {
    const CameraEvent event = camera->next();
    if (std::holds_alternative<CameraNotice>(event)) continue;
    ASSERT_TRUE(std::holds_alternative<CameraError>(event)) << event_text(event);
    const CameraError& error = std::get<CameraError>(event);
    EXPECT_EQ(error.fault, CameraFault::kTooLarge);
    EXPECT_TRUE(error.lost) << "all its frames are like this one";
    ++told;
  }
  EXPECT_GE(told, 2);
  EXPECT_LE(told, 30) << "it is opened again and again without a pause";
}

TEST_F(LiveCameraTest, GapsFramesPassedOverAndWantOfBuffersAreDropped) {
  const auto camera = streaming();
  sequence_ = 5;  // 1 to 4 are missing
  EXPECT_EQ(next_frame(*camera).sequence, 5u);
  EXPECT_EQ(camera->dropped(), 4u);
  const auto stream = fake_.grab;
  fake_.grab = [this](std::int64_t) {
    sequence_ += 2;  // 6 and 7 were given back unread
    RawFrame frame = raw();
    frame.passed_over = 2;
    return CaptureDevice::Grab(frame);
  };
  Frame held = next_frame(*camera);
  EXPECT_EQ(held.sequence, 8u);
  EXPECT_EQ(camera->dropped(), 6u);
  fake_.grab = stream;
  std::optional<Frame> also_held = next_frame(*camera);
  fake_.grab = [&](std::int64_t) {
    if (sequence_ == 12) also_held.reset();  // 10 and 11 came while both buffers were out
    return CaptureDevice::Grab(raw());
  };
  EXPECT_EQ(next_frame(*camera).sequence, 12u);
  EXPECT_EQ(camera->dropped(), 8u);
}

TEST_F(LiveCameraTest, StampsThatLieAreReplacedAndToldOnceAKindAndOpening) {
  const auto camera = streaming();
  const auto stream = fake_.grab;
  fake_.grab = [this](std::int64_t) {
    RawFrame frame = raw();
    frame.time_ns = now_ns() + 34 * kMs;
    return CaptureDevice::Grab(frame);
  };
  for (int i = 0; i < 3; ++i) {
    CameraEvent event = camera->next();
    if (i == 1) {
      EXPECT_THAT(event_text(event), HasSubstr("in the future (by 34 ms)"));
      event = camera->next();
    }
    ASSERT_TRUE(std::holds_alternative<Frame>(event)) << event_text(event);
    EXPECT_EQ(std::get<Frame>(event).time_ns, now_ns());
  }
  EXPECT_EQ(camera->restamped(), 3u);
  fake_.grab = [this](std::int64_t) {
    RawFrame frame = raw();
    frame.time_ns.reset();
    return CaptureDevice::Grab(frame);
  };
  EXPECT_THAT(told(*camera, 5), ElementsAre(HasSubstr("missing")));
  EXPECT_EQ(camera->restamped(), 7u);
  fake_.grab = [](std::int64_t) {
    return CameraError{CameraFault::kUnplugged, "it went away", ENODEV, true, 0};
  };
  camera->next();
  fake_.grab = [this](std::int64_t) {
    RawFrame frame = raw();
    frame.time_ns.reset();
    return CaptureDevice::Grab(frame);
  };
  EXPECT_THAT(told(*camera, 5), ElementsAre(HasSubstr("opened"), HasSubstr("missing")))
      << "told again, in another opening";
}

TEST_F(LiveCameraTest, AnInterruptEndsItForGood) {
  const auto camera = streaming();
  camera->interrupt();
  EXPECT_EQ(event_text(camera->next()), "interrupted");
  EXPECT_EQ(event_text(camera->next()), "interrupted");
  fake_.away = true;
  const auto other = open();
  other->next();
  other->interrupt();
  EXPECT_EQ(event_text(other->next()), "interrupted");
}

TEST_F(LiveCameraTest, AnInterruptFromAnotherThreadEndsARealWait) {
  fake_.away = true;
  LiveClock real;
  const auto camera = make_live_camera(std::make_unique<FakeDriver>(fake_), pool_, real);
  EXPECT_EQ(event_text(camera->next()), "no_device 0 lost");
  std::thread other([&] { camera->interrupt(); });
  std::string last;
  while (last != "interrupted") last = event_text(camera->next());
  other.join();
}

}  // namespace
}  // namespace loopd
