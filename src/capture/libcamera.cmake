# The libcamera driver. What needs no libcamera is built, and tested, everywhere.
target_sources(loopd_capture PRIVATE
  libcamera_clock.cpp libcamera_completions.cpp libcamera_dev_watch.cpp libcamera_error.cpp
  libcamera_formats.cpp libcamera_frames.cpp libcamera_selection.cpp)
if(LOOPD_HAVE_LIBCAMERA)
  target_sources(loopd_capture PRIVATE
    libcamera_controls.cpp libcamera_device.cpp libcamera_driver.cpp libcamera_manager.cpp)
  target_link_libraries(loopd_capture PRIVATE PkgConfig::LIBCAMERA)
else()
  target_sources(loopd_capture PRIVATE libcamera_absent.cpp)
endif()
