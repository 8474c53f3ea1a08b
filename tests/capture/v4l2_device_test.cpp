// A V4L2 stream over a fake kernel: frames, and everything that goes wrong with them.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <linux/dma-buf.h>

#include <algorithm>
#include <limits>
#include <string>
#include <vector>

#include "capture/interrupt.h"
#include "capture/live_camera.h"
#include "support/camera_events.h"
#include "support/v4l2_fixture.h"

namespace loopd {
namespace {

using testing::event_text;
using testing::FakeFrame;
using testing::FakeNode;
using ::testing::HasSubstr;
using testing::V4l2Test;

constexpr std::int64_t kSecond_ns = 1'000'000'000;

// The time of the fake kernel, which a wait moves on.
class KernelClock : public LiveClock {
 public:
  explicit KernelClock(testing::FakeV4l2& kernel) : kernel_(kernel) {}
  std::int64_t now_ns() const override { return kernel_.time_ns; }
  Interrupt::Ready wait(const Interrupt&, int, std::int64_t deadline_ns) override {
    kernel_.time_ns = std::max(kernel_.time_ns, deadline_ns);
    return Interrupt::Ready::kTimeout;
  }

 private:
  testing::FakeV4l2& kernel_;
};

class V4l2DeviceTest : public V4l2Test {
 protected:
  CaptureDevice::Grab grab(CaptureDevice& device) {
    return device.grab(interrupt_, kernel_.now_ns() + kSecond_ns);
  }

  RawFrame grab_frame(CaptureDevice& device) {
    const CaptureDevice::Grab grabbed = grab(device);
    if (const auto* frame = std::get_if<RawFrame>(&grabbed)) return *frame;
    const auto* error = std::get_if<CameraError>(&grabbed);
    ADD_FAILURE() << (error != nullptr ? error->message : "no frame");
    return {};
  }

  CameraError grab_error(CaptureDevice& device) {
    const CaptureDevice::Grab grabbed = grab(device);
    if (const auto* error = std::get_if<CameraError>(&grabbed)) return *error;
    ADD_FAILURE() << "no error";
    return {};
  }

  void frame(FakeFrame frame) { camera().frames.push_back(frame); }

  Interrupt interrupt_;
};

TEST_F(V4l2DeviceTest, FramesComeWithTheirBytesNumbersAndTimes) {
  const auto device = opened();
  for (std::uint8_t i = 0; i < 20; ++i) {
    frame({.sequence = 100u + i, .time_us = 5'000'000 + i * 33'333, .value = i});
    const RawFrame raw = grab_frame(*device);
    EXPECT_EQ(raw.format, PixelFormat::kYuyv);
    EXPECT_EQ(raw.width_px, 8);
    EXPECT_EQ(raw.height_px, 4);
    EXPECT_EQ(raw.stride_bytes, 16);
    EXPECT_EQ(raw.sequence, 100u + i);
    EXPECT_EQ(raw.time_ns, (5'000'000 + i * 33'333) * 1'000L);
    EXPECT_EQ(std::vector<std::uint8_t>(raw.bytes.begin(), raw.bytes.end()),
              std::vector<std::uint8_t>(64, i));
    EXPECT_FALSE(raw.damaged);
    EXPECT_EQ(raw.passed_over, 0u);
    device->release();
  }
  EXPECT_EQ(device->info().clock, "monotonic");
  EXPECT_EQ(device->info().instant, StampInstant::kEndOfFrame);
}

TEST_F(V4l2DeviceTest, TheNewestFrameWinsAndTheOthersAreGivenBackAndCounted) {
  const auto device = opened();
  for (std::uint8_t i = 0; i < 3; ++i) frame({.sequence = i, .value = i});
  const RawFrame raw = grab_frame(*device);
  EXPECT_EQ(raw.sequence, 2u);
  EXPECT_EQ(raw.bytes[0], 2);
  EXPECT_EQ(raw.passed_over, 2u);
  EXPECT_EQ(camera().queue.size(), 3u) << "all but the one that is out";
  device->release();
  EXPECT_EQ(camera().queue.size(), 4u);
}

TEST_F(V4l2DeviceTest, ADriverThatIsFasterThanItsReaderIsNotFollowedForEver) {
  const auto device = opened();
  for (std::uint32_t i = 0; i < 1000; ++i) frame({.sequence = i});
  EXPECT_LE(grab_frame(*device).passed_over, 32u);
}

TEST_F(V4l2DeviceTest, AFrameNotReleasedIsGivenBackByTheNextGrab) {
  const auto device = opened();
  for (std::uint8_t i = 0; i < 20; ++i) {
    frame({.sequence = i});
    EXPECT_EQ(grab_frame(*device).sequence, i);
  }
}

TEST_F(V4l2DeviceTest, TimeStampsAreTakenForWhatTheyAre) {
  const auto device = opened();
  const auto stamp = [&](std::uint32_t flags, std::int64_t time_us) {
    frame({.time_us = time_us, .flags = flags});
    return grab_frame(*device).time_ns;
  };
  EXPECT_EQ(stamp(V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC, 7), 7'000);
  EXPECT_EQ(stamp(V4L2_BUF_FLAG_TIMESTAMP_COPY, 7), 7'000) << "judged by its reader";
  EXPECT_EQ(stamp(V4L2_BUF_FLAG_TIMESTAMP_UNKNOWN, 7), std::nullopt);
  for (std::int64_t mad :
       {std::int64_t{-1}, std::int64_t{-5'000'000}, std::numeric_limits<std::int64_t>::max(),
        std::numeric_limits<std::int64_t>::min()})
    EXPECT_EQ(stamp(V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC, mad), std::nullopt) << mad;
}

TEST_F(V4l2DeviceTest, ClockAndInstantComeFromTheFlags) {
  camera().lie = [](unsigned long request, void* argument) {
    if (request == VIDIOC_QUERYBUF)
      static_cast<v4l2_buffer*>(argument)->flags =
          V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC | V4L2_BUF_FLAG_TSTAMP_SRC_SOE;
  };
  EXPECT_EQ(opened()->info().instant, StampInstant::kStartOfExposure);
  camera().lie = [](unsigned long request, void* argument) {
    if (request == VIDIOC_QUERYBUF) static_cast<v4l2_buffer*>(argument)->flags = 0;
  };
  const auto device = opened();
  EXPECT_EQ(device->info().clock, "unknown");
  EXPECT_EQ(device->info().instant, StampInstant::kUnknown);
}

TEST_F(V4l2DeviceTest, AnErrorFlagIsADamagedFrame) {
  const auto device = opened();
  frame({.flags = V4L2_BUF_FLAG_ERROR | V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC});
  EXPECT_TRUE(grab_frame(*device).damaged);
  frame({});
  EXPECT_FALSE(grab_frame(*device).damaged);
}

TEST_F(V4l2DeviceTest, NothingComesAndThatIsATimeOut) {
  const auto device = opened();
  const std::int64_t start_ns = kernel_.now_ns();
  EXPECT_TRUE(std::holds_alternative<TimedOut>(grab(*device)));
  EXPECT_EQ(kernel_.now_ns() - start_ns, kSecond_ns);
}

TEST_F(V4l2DeviceTest, NothingComesFromAnInputWithoutSignal) {
  camera().input_status = 0;
  const auto device = opened();
  EXPECT_TRUE(std::holds_alternative<TimedOut>(grab(*device)));
  for (const auto& [status, text] :
       std::vector<std::pair<std::uint32_t, std::string>>{{V4L2_IN_ST_NO_SIGNAL, "no signal"},
                                                          {V4L2_IN_ST_NO_POWER, "no power"},
                                                          {V4L2_IN_ST_NO_SYNC, "cannot lock"}}) {
    camera().input_status = status;
    const CameraError error = grab_error(*device);
    EXPECT_EQ(error.fault, CameraFault::kNoSignal);
    EXPECT_TRUE(error.lost);
    EXPECT_THAT(error.message, HasSubstr(text));
  }
}

TEST_F(V4l2DeviceTest, AnInterruptEndsAGrab) {
  const auto device = opened();
  interrupt_.request();
  EXPECT_TRUE(std::holds_alternative<Interrupted>(grab(*device)));
}

TEST_F(V4l2DeviceTest, UnpluggedIsNamedAtOnce) {
  const auto device = opened();
  frame({});
  grab_frame(*device);
  camera().gone = true;
  const std::int64_t start_ns = kernel_.now_ns();
  const CameraError error = grab_error(*device);
  EXPECT_EQ(error.fault, CameraFault::kUnplugged);
  EXPECT_TRUE(error.lost);
  EXPECT_EQ(error.code, ENODEV);
  EXPECT_EQ(kernel_.now_ns(), start_ns);
}

TEST_F(V4l2DeviceTest, AFatalErrorOfTheStreamIsNamed) {
  const auto device = opened();
  camera().extra_revents = POLLERR;
  camera().faults[VIDIOC_DQBUF] = {-EIO, -1};
  CameraError error = grab_error(*device);
  EXPECT_EQ(error.fault, CameraFault::kStreamError);
  EXPECT_TRUE(error.lost);
  EXPECT_EQ(error.code, EIO);
  camera().faults.clear();  // POLLERR alone
  error = grab_error(*device);
  EXPECT_EQ(error.fault, CameraFault::kStreamError);
}

TEST_F(V4l2DeviceTest, ADescriptorThatIsReadyAndHoldsNothingDoesNotSpin) {
  const auto device = opened();
  for (const short revents : {short{POLLIN}, short{POLLPRI}}) {
    camera().extra_revents = revents;
    const long before = kernel_.polls;
    EXPECT_EQ(grab_error(*device).fault, CameraFault::kStreamError);
    EXPECT_LE(kernel_.polls - before, 100);
  }
}

TEST_F(V4l2DeviceTest, ARefusedBufferIsQueuedAgainLater) {
  const auto device = opened();
  frame({.sequence = 0});
  grab_frame(*device);
  camera().faults[VIDIOC_QBUF] = {-EINVAL, 1};
  device->release();
  EXPECT_EQ(camera().queue.size(), 3u);
  frame({.sequence = 1});
  EXPECT_EQ(grab_frame(*device).sequence, 1u);
  device->release();
  EXPECT_EQ(camera().queue.size(), 4u);
}

TEST_F(V4l2DeviceTest, WithoutAnyBufferQueuedTheStreamIsLost) {
  const auto device = opened();
  camera().faults[VIDIOC_QBUF] = {-EINVAL, -1};
  for (std::uint32_t i = 0; i < 3; ++i) {
    frame({.sequence = i});
    EXPECT_EQ(grab_frame(*device).sequence, i);
  }
  frame({.sequence = 3});
  grab_frame(*device);
  EXPECT_EQ(grab_error(*device).fault, CameraFault::kStreamError);
}

TEST_F(V4l2DeviceTest, AnotherSourceEndsTheStream) {
  const auto device = opened();
  camera().events = {0};
  frame({});
  grab_frame(*device);  // not of the resolution: no matter
  camera().events = {V4L2_EVENT_SRC_CH_RESOLUTION};
  CameraError error = grab_error(*device);
  EXPECT_EQ(error.fault, CameraFault::kStreamError);
  EXPECT_THAT(error.message, HasSubstr("another source"));
  camera().events = {V4L2_EVENT_SRC_CH_RESOLUTION};
  camera().input_status = V4L2_IN_ST_NO_SIGNAL;
  error = grab_error(*device);
  EXPECT_EQ(error.fault, CameraFault::kNoSignal);
}

TEST_F(V4l2DeviceTest, MoreBytesThanABufferHoldsAreCutOff) {
  const auto device = opened();
  for (const std::uint32_t used : {65u, 0xffffffffu}) {
    frame({.bytesused = used});
    EXPECT_EQ(grab_frame(*device).bytes.size(), 64u);
  }
  frame({.bytesused = 0});
  EXPECT_EQ(grab_frame(*device).bytes.size(), 0u);
}

TEST_F(V4l2DeviceTest, AMultiplanarNodeGivesItsFirstPlaneFromItsOffset) {
  camera().capabilities = V4L2_CAP_VIDEO_CAPTURE_MPLANE | V4L2_CAP_STREAMING;
  camera().formats = {{V4L2_PIX_FMT_NV12M, {{8, 4, {30}}}}};
  std::uint32_t data_offset = 16;
  camera().lie = [&](unsigned long request, void* argument) {
    if (request == VIDIOC_DQBUF)
      static_cast<v4l2_buffer*>(argument)->m.planes[0].data_offset = data_offset;
  };
  const auto device = opened();
  EXPECT_EQ(device->info().format, PixelFormat::kNv12);
  frame({.value = 9});
  EXPECT_EQ(grab_frame(*device).bytes.size(), 48u);
  data_offset = 0xffffffff;
  frame({.value = 9});
  EXPECT_EQ(grab_frame(*device).bytes.size(), 0u);
}

TEST_F(V4l2DeviceTest, ABufferThatCannotBeIsTheEndOfTheStream) {
  for (const std::uint32_t index : {4u, 1000u, 0xffffffffu}) {
    camera().lie = nullptr;
    camera().frames.clear();
    const auto device = opened();
    camera().lie = [=](unsigned long request, void* argument) {
      if (request == VIDIOC_DQBUF) static_cast<v4l2_buffer*>(argument)->index = index;
    };
    frame({});
    EXPECT_EQ(grab_error(*device).fault, CameraFault::kStreamError);
  }
  camera().lie = nullptr;
  const auto device = opened();
  camera().lie = [](unsigned long request, void* argument) {
    if (request == VIDIOC_DQBUF) static_cast<v4l2_buffer*>(argument)->index = 0;
  };
  frame({});
  grab_frame(*device);  // lent out; another frame in the same buffer cannot be
  camera().frames = {{}, {}};
  camera().faults[VIDIOC_QBUF] = {-EINVAL, -1};
  EXPECT_TRUE(std::holds_alternative<CameraError>(grab(*device)));
}

TEST_F(V4l2DeviceTest, BuffersWithoutMemoryAreRefused) {
  camera().lie = [](unsigned long request, void* argument) {
    if (request == VIDIOC_QUERYBUF) static_cast<v4l2_buffer*>(argument)->length = 0;
  };
  EXPECT_EQ(open_error().fault, CameraFault::kStreamError);
  camera().lie = [](unsigned long request, void* argument) {
    if (request == VIDIOC_QUERYBUF) static_cast<v4l2_buffer*>(argument)->length = 0xffffffff;
  };
  EXPECT_EQ(open_error().fault, CameraFault::kStreamError) << "more than can be mapped";
  camera().lie = [](unsigned long request, void* argument) {
    if (request == VIDIOC_REQBUFS) static_cast<v4l2_requestbuffers*>(argument)->count = 0;
  };
  EXPECT_EQ(open_error().fault, CameraFault::kStreamError);
  EXPECT_EQ(kernel_.descriptors(), 0);
  EXPECT_EQ(kernel_.mappings(), 0);
}

TEST_F(V4l2DeviceTest, ExportedBuffersAreSynchronisedAroundReading) {
  {
    const auto device = opened();
    EXPECT_EQ(kernel_.descriptors(), 1 + 4);
    frame({});
    grab_frame(*device);
    EXPECT_TRUE(kernel_.requests.contains(DMA_BUF_IOCTL_SYNC));
  }
  EXPECT_EQ(kernel_.descriptors(), 0);
  kernel_.requests.clear();
  camera().exports = false;
  const auto device = opened();
  EXPECT_EQ(kernel_.descriptors(), 1);
  frame({});
  grab_frame(*device);
  EXPECT_FALSE(kernel_.requests.contains(DMA_BUF_IOCTL_SYNC));
}

TEST_F(V4l2DeviceTest, SignalsInEveryCallChangeNothing) {
  kernel_.interrupted = true;
  const auto device = opened();
  for (std::uint8_t i = 0; i < 10; ++i) {
    frame({.sequence = i});
    EXPECT_EQ(grab_frame(*device).sequence, i);
  }
  EXPECT_TRUE(std::holds_alternative<TimedOut>(grab(*device)));
}

// Every request that opening and streaming make, failing at any of its uses.
TEST_F(V4l2DeviceTest, AFailureOfAnyCallIsAnErrorOrNothingAndLeaksNothing) {
  camera().input_status = 0;
  camera().dv_timings = 0;
  camera().controls = {{"Gain", 0, 10}};
  const V4l2Options options{.controls = {{"gain", "3"}}};
  {
    const auto device = opened(options);
    frame({});
    grab_frame(*device);
  }
  const std::set<unsigned long> requests = kernel_.requests;
  EXPECT_GT(requests.size(), 17u);
  for (const unsigned long request : requests)
    for (const int result : {-ENODEV, -EIO, -EINVAL, -EBUSY, -ENOTTY, -ENOMEM, -EPERM}) {
      camera().frames.clear();
      camera().faults[request] = {result, -1};
      auto outcome = open(options);
      if (auto* device = std::get_if<std::unique_ptr<CaptureDevice>>(&outcome)) {
        frame({});
        grab(**device);
        grab(**device);
      }
      outcome = CameraError{};
      camera().faults.clear();
      EXPECT_EQ(kernel_.descriptors(), 0) << std::hex << request << " " << result;
      EXPECT_EQ(kernel_.mappings(), 0) << std::hex << request << " " << result;
    }
}

TEST_F(V4l2DeviceTest, AThousandUnpluggingsLeakNothingAndTheCameraComesBack) {
  FramePool pool(2, 8 * 4);
  const auto driver_options = V4l2Options{.camera = path()};
  KernelClock clock(kernel_);
  auto camera_object =
      make_live_camera(make_v4l2_driver(driver_options, kernel_, paths_), pool, clock);
  std::uint64_t last = 0;
  for (int i = 0; i < 1000; ++i) {
    camera().gone = false;
    frame({.time_us = 0});
    CameraEvent event = camera_object->next();
    while (!std::holds_alternative<Frame>(event)) {
      const auto* error = std::get_if<CameraError>(&event);
      ASSERT_TRUE(error == nullptr || error->fault == CameraFault::kUnplugged) << error->message;
      event = camera_object->next();
    }
    const std::uint64_t sequence = std::get<Frame>(event).sequence;
    if (i > 0) {
      EXPECT_EQ(sequence, last + 1);
    }
    last = sequence;
    EXPECT_EQ(kernel_.descriptors(), 5);
    EXPECT_EQ(kernel_.mappings(), 4);
    camera().gone = true;
    // What was to be told of the opening comes first.
    event = camera_object->next();
    while (std::holds_alternative<CameraNotice>(event)) event = camera_object->next();
    EXPECT_EQ(event_text(event), "unplugged " + std::to_string(last + 1) + " lost");
    EXPECT_EQ(kernel_.descriptors(), 0);
    EXPECT_EQ(kernel_.mappings(), 0);
  }
}

}  // namespace
}  // namespace loopd
