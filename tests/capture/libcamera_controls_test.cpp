#include "capture/libcamera_controls.h"

#include <gtest/gtest.h>
#include <libcamera/control_ids.h>

#include "capture/libcamera_driver.h"
#include "capture/libcamera_manager.h"

namespace loopd {
namespace {

namespace controls = libcamera::controls;
using libcamera::ControlInfo;
using libcamera::ControlInfoMap;
using libcamera::ControlValue;
using Settings = std::vector<std::pair<std::string, std::string>>;

ControlInfoMap camera_controls() {
  return ControlInfoMap(
      {{&controls::AeEnable, ControlInfo(false, true)},
       {&controls::ExposureTime, ControlInfo(std::int32_t{100}, std::int32_t{33'000})},
       {&controls::Brightness, ControlInfo(-1.0F, 1.0F)},
       {&controls::ColourGains, ControlInfo(0.0F, 32.0F)},
       {&controls::FrameDurationLimits,
        ControlInfo(std::int64_t{16'667}, std::int64_t{1'000'000})}},
      controls::controls);
}

struct Outcome {
  ControlInfoMap known = camera_controls();
  libcamera::ControlList list{known};
  std::vector<std::string> warnings;
};

TEST(LibcameraControls, ValuesOfEveryType) {
  EXPECT_EQ(control_value(libcamera::ControlTypeBool, "on")->get<bool>(), true);
  EXPECT_EQ(control_value(libcamera::ControlTypeBool, "false")->get<bool>(), false);
  EXPECT_EQ(control_value(libcamera::ControlTypeByte, "255")->get<std::uint8_t>(), 255);
  EXPECT_EQ(control_value(libcamera::ControlTypeInteger32, "-7")->get<std::int32_t>(), -7);
  EXPECT_EQ(control_value(libcamera::ControlTypeInteger64, "9000000000")->get<std::int64_t>(),
            9'000'000'000);
  EXPECT_FLOAT_EQ(control_value(libcamera::ControlTypeFloat, "1.5")->get<float>(), 1.5F);
  const auto pair = control_value(libcamera::ControlTypeFloat, "1.5,-2");
  const auto numbers = pair->get<libcamera::Span<const float>>();
  ASSERT_EQ(numbers.size(), 2U);
  EXPECT_FLOAT_EQ(numbers[1], -2.0F);
}

TEST(LibcameraControls, WhatIsNoValue) {
  for (const char* text : {"", " 1", "1 ", "1x", ",", "1,", ",1", "1,,2", "99999999999", "1.5"})
    EXPECT_FALSE(control_value(libcamera::ControlTypeInteger32, text)) << '"' << text << '"';
  for (const char* text : {"", "yes", "2", "TRUE "})
    EXPECT_FALSE(control_value(libcamera::ControlTypeBool, text)) << text;
  for (const char* text : {"", "nan", "inf", "1e99", "0x1"})
    EXPECT_FALSE(control_value(libcamera::ControlTypeFloat, text)) << text;
  EXPECT_FALSE(control_value(libcamera::ControlTypeByte, "256"));
  EXPECT_FALSE(control_value(libcamera::ControlTypeRectangle, "0,0,1,1"));
  EXPECT_FALSE(control_value(libcamera::ControlTypeNone, "0"));
}

TEST(LibcameraControls, AddsWhatTheCameraKnows) {
  Outcome outcome;
  add_controls(outcome.known,
               Settings{{"AeEnable", "false"}, {"ExposureTime", "8000"}, {"ColourGains", "1.5,2"}},
               outcome.list, outcome.warnings);
  EXPECT_TRUE(outcome.warnings.empty());
  EXPECT_EQ(outcome.list.get(controls::AeEnable), false);
  EXPECT_EQ(outcome.list.get(controls::ExposureTime), 8000);
  ASSERT_TRUE(outcome.list.get(controls::ColourGains));
  EXPECT_FLOAT_EQ((*outcome.list.get(controls::ColourGains))[0], 1.5F);
}

TEST(LibcameraControls, NamesWhatItDoesNotAndGoesOn) {
  Outcome outcome;
  add_controls(outcome.known,
               Settings{{"Sharpness", "1"}, {"ExposureTime", "long"}, {"Brightness", "0.5"}},
               outcome.list, outcome.warnings);
  ASSERT_EQ(outcome.warnings.size(), 2U);
  EXPECT_NE(outcome.warnings[0].find("Sharpness"), std::string::npos);
  EXPECT_NE(outcome.warnings[1].find("long"), std::string::npos);
  EXPECT_EQ(outcome.list.size(), 1U);
}

TEST(LibcameraControls, LimitsAreHeld) {
  Outcome outcome;
  add_controls(outcome.known,
               Settings{{"ExposureTime", "99"}, {"ExposureTime", "33001"}, {"Brightness", "1.01"}},
               outcome.list, outcome.warnings);
  ASSERT_EQ(outcome.warnings.size(), 3U);
  EXPECT_NE(outcome.warnings[0].find("33000"), std::string::npos) << outcome.warnings[0];
  EXPECT_TRUE(outcome.list.empty());
}

TEST(LibcameraControls, TheRateIsAFrameDuration) {
  Outcome outcome;
  EXPECT_NEAR(add_frame_rate(outcome.known, 30, outcome.list, outcome.warnings), 30, 0.001);
  EXPECT_TRUE(outcome.warnings.empty());
  const auto limits = outcome.list.get(controls::FrameDurationLimits);
  ASSERT_TRUE(limits);
  EXPECT_EQ((*limits)[0], 33'333);
  EXPECT_EQ((*limits)[1], 33'333);
}

TEST(LibcameraControls, ARateTheCameraCannotGiveIsBoundedAndTold) {
  Outcome outcome;
  EXPECT_NEAR(add_frame_rate(outcome.known, 200, outcome.list, outcome.warnings), 60, 0.01);
  EXPECT_NEAR(add_frame_rate(outcome.known, 0.1, outcome.list, outcome.warnings), 1, 0.001);
  EXPECT_EQ(outcome.warnings.size(), 2U);
}

TEST(LibcameraControls, ACameraWithoutRatesSaysSo) {
  const ControlInfoMap none({}, controls::controls);
  libcamera::ControlList list(none);
  std::vector<std::string> warnings;
  EXPECT_EQ(add_frame_rate(none, 30, list, warnings), 0);
  EXPECT_EQ(warnings.size(), 1U);
  EXPECT_TRUE(list.empty());
}

TEST(LibcameraManager, ThereIsOneAProcess) {
  {
    const auto first = LibcameraManager::start();
    ASSERT_TRUE(first.ok()) << first.error().message;
    const auto second = LibcameraManager::start();
    ASSERT_FALSE(second.ok());
    EXPECT_EQ(second.error().code, EBUSY);
  }
  EXPECT_TRUE(LibcameraManager::start().ok());
}

}  // namespace
}  // namespace loopd
