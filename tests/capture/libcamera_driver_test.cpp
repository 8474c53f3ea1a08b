#include "capture/libcamera_driver.h"

#include <gtest/gtest.h>

namespace loopd {
namespace {

LibcameraOptions options_for(std::string camera) {
  LibcameraOptions options;
  options.camera = std::move(camera);
  return options;
}

TEST(LibcameraDriver, SaysWhatItWants) {
  EXPECT_NE(make_libcamera_driver(options_for("imx219"))->describe().find("imx219"),
            std::string::npos);
}

// Runs libcamera itself, whatever cameras the machine has.
TEST(LibcameraDriver, ACameraThatIsNotThereIsNamedAgainAndAgain) {
  const auto driver = make_libcamera_driver(options_for("no-camera-has-this-name"));
  for (int tries = 0; tries < 3; ++tries) {
    const auto opened = driver->open();
    const auto* error = std::get_if<CameraError>(&opened);
    ASSERT_NE(error, nullptr);
    if (libcamera_build().present) {
      EXPECT_TRUE(error->fault == CameraFault::kNoDevice ||
                  error->fault == CameraFault::kPermission)
          << error->message;
    } else {
      EXPECT_EQ(error->fault, CameraFault::kUnsupported);
      EXPECT_EQ(error->message.rfind("this loopd has no libcamera; ", 0), 0U) << error->message;
    }
  }
}

TEST(LibcameraDriver, ListsWhatThereIsOrSaysWhyNot) {
  const auto listings = list_libcamera_cameras();
  ASSERT_EQ(listings.ok(), libcamera_build().present);
  if (!listings.ok()) return;
  for (const CameraListing& listing : listings.value()) {
    EXPECT_FALSE(listing.id.empty());
    EXPECT_EQ(listing.driver, "libcamera");
  }
}

TEST(LibcameraDriver, TellsOfItsBuild) {
  const LibcameraBuild build = libcamera_build();
  EXPECT_EQ(build.text.rfind(build.present ? "libcamera v" : "this loopd has no libcamera", 0), 0U)
      << build.text;
}

}  // namespace
}  // namespace loopd
