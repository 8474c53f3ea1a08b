#include "app/camera_factory.h"

#include "capture/file_camera.h"
#include "capture/libcamera_driver.h"
#include "capture/live_camera.h"
#include "capture/v4l2_driver.h"

namespace loopd {
namespace {

FileCameraOptions file_options(const CameraConfig& camera) {
  FileCameraOptions options;
  options.path = camera.path;
  options.fps = camera.fps;
  options.loop = camera.loop;
  options.start = camera.start;
  options.nominal_fps = camera.nominal_fps;
  options.faults = camera.faults;
  return options;
}

/// V4L2 and libcamera take the same wishes.
template <class Options>
Options live_options(const CameraConfig& camera) {
  Options options;
  options.camera = camera.path;
  options.width_px = camera.width;
  options.height_px = camera.height;
  options.fps = camera.fps;
  options.format = camera.format;
  options.controls = camera_controls(camera);
  return options;
}

}  // namespace

Result<std::unique_ptr<Camera>> open_camera(const CameraConfig& camera, FramePool& pool) {
  if (camera.source == "v4l2")
    return make_live_camera(make_v4l2_driver(live_options<V4l2Options>(camera)), pool);
  if (camera.source == "libcamera")
    return make_live_camera(make_libcamera_driver(live_options<LibcameraOptions>(camera)), pool);
  return open_file_camera(file_options(camera), pool);
}

}  // namespace loopd
