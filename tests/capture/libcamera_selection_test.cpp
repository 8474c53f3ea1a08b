#include "capture/libcamera_selection.h"

#include <gtest/gtest.h>

#include <cerrno>
#include <vector>

#include "capture/libcamera_error.h"

namespace loopd {
namespace {

const CameraName kSensor{"/base/soc/i2c@1/imx219@10", "imx219"};
const CameraName kFront{"\\_SB_.PCI0.XHC-1:1.0-046d:0825", "UVC Camera (046d:0825)"};
const CameraName kRear{"\\_SB_.PCI0.XHC-2:1.0-046d:0825", "UVC Camera (046d:0825)"};
const CameraName kFrontMoved{"\\_SB_.PCI0.XHC-3:1.0-046d:0825", "UVC Camera (046d:0825)"};

using Cameras = std::vector<CameraName>;

// The id chosen, or the fault's name.
std::string chosen(const CameraSelection& selection, const Cameras& cameras) {
  const auto choice = selection.choose(cameras);
  if (const auto* error = std::get_if<CameraError>(&choice))
    return std::string(camera_fault_name(error->fault));
  return cameras.at(std::get<std::size_t>(choice)).id;
}

std::string refusal(const CameraSelection& selection, const Cameras& cameras) {
  return std::get<CameraError>(selection.choose(cameras)).message;
}

TEST(CameraSelection, EmptyTakesTheFirst) {
  const CameraSelection selection("");
  EXPECT_EQ(chosen(selection, {kRear, kFront}), kRear.id);
}

TEST(CameraSelection, AWholeIdComesBeforeParts) {
  const CameraSelection selection("cam");
  EXPECT_EQ(chosen(selection, {{"cam1", ""}, {"cam", ""}, {"cam2", ""}}), "cam");
}

TEST(CameraSelection, APartOfIdOrModel) {
  EXPECT_EQ(chosen(CameraSelection("XHC-2"), {kFront, kRear, kSensor}), kRear.id);
  EXPECT_EQ(chosen(CameraSelection("imx219"), {kFront, kRear, kSensor}), kSensor.id);
}

TEST(CameraSelection, APartOfSeveralIsRefusedWithTheirNames) {
  const std::string message = refusal(CameraSelection("046d"), {kFront, kRear, kSensor});
  EXPECT_NE(message.find(kFront.id), std::string::npos) << message;
  EXPECT_NE(message.find(kRear.id), std::string::npos) << message;
}

TEST(CameraSelection, NothingThatFits) {
  EXPECT_EQ(chosen(CameraSelection(""), {}), "no_device");
  const std::string message = refusal(CameraSelection("ov5640"), {kFront});
  EXPECT_NE(message.find("ov5640"), std::string::npos) << message;
  EXPECT_NE(message.find(kFront.id), std::string::npos) << message;
}

TEST(CameraSelection, TheSameCameraAgainWhateverTheOrder) {
  CameraSelection selection("");
  selection.keep(Cameras{kFront, kRear}, 0);
  EXPECT_EQ(chosen(selection, {kRear, kFront}), kFront.id);
}

TEST(CameraSelection, WhatStoodBesideIsNotTakenForTheLostOne) {
  CameraSelection selection("");
  selection.keep(Cameras{kFront, kRear}, 0);
  EXPECT_EQ(chosen(selection, {kRear}), "no_device");
  EXPECT_NE(refusal(selection, {kRear}).find(kFront.id), std::string::npos);
}

TEST(CameraSelection, TheLostOneInAnotherPortIsTaken) {
  CameraSelection selection("046d");
  selection.keep(Cameras{kFront, kSensor}, 0);
  EXPECT_EQ(chosen(selection, {kSensor, kFrontMoved}), kFrontMoved.id);
}

TEST(CameraSelection, AnotherThatHasAppearedMustFitTheName) {
  CameraSelection selection("046d");
  selection.keep(Cameras{kFront}, 0);
  EXPECT_EQ(chosen(selection, {kSensor}), "no_device");
}

TEST(CameraSelection, AWholeIdTakesNoOther) {
  CameraSelection selection(kFront.id);
  selection.keep(Cameras{kFront, kRear}, 0);
  EXPECT_EQ(chosen(selection, {kRear, kFrontMoved}), "no_device");
}

TEST(LibcameraFailure, NamesTheCauseAndTheRemedy) {
  const CameraError busy = libcamera_failure("cam", "it cannot be taken", -EBUSY);
  EXPECT_EQ(busy.fault, CameraFault::kBusy);
  EXPECT_EQ(busy.code, EBUSY);
  EXPECT_TRUE(busy.lost);
  EXPECT_NE(busy.message.find("cam: it cannot be taken"), std::string::npos) << busy.message;
  EXPECT_NE(busy.message.find("; end the other program"), std::string::npos) << busy.message;
  EXPECT_EQ(libcamera_failure("cam", "x", -EPERM).fault, CameraFault::kPermission);
  EXPECT_EQ(libcamera_failure("cam", "x", -ENODEV).fault, CameraFault::kNoDevice);
  EXPECT_EQ(libcamera_failure("cam", "x", -ENOTSUP).fault, CameraFault::kUnsupported);
  EXPECT_EQ(libcamera_failure("cam", "x", -EINVAL).fault, CameraFault::kStreamError);
}

}  // namespace
}  // namespace loopd
