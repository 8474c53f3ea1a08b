# The libcamera driver. What needs no libcamera is built, and tested, everywhere.
target_sources(loopd_capture PRIVATE
  libcamera_clock.cpp libcamera_completions.cpp libcamera_dev_watch.cpp libcamera_error.cpp
  libcamera_formats.cpp libcamera_frames.cpp libcamera_loader.cpp libcamera_selection.cpp)
target_compile_definitions(loopd_capture PRIVATE LOOPD_VERSION="${PROJECT_VERSION}")
target_link_libraries(loopd_capture PUBLIC ${CMAKE_DL_LIBS})

# The rest is loaded at run time (libcamera_plugin.h).
if(LOOPD_HAVE_LIBCAMERA)
  loopd_library(loopd_libcamera_parts SOURCES libcamera_controls.cpp libcamera_manager.cpp
    LINKS loopd_capture PkgConfig::LIBCAMERA)
  add_library(loopd_libcamera MODULE
    libcamera_device.cpp libcamera_driver.cpp)
  set_target_properties(loopd_libcamera PROPERTIES
    PREFIX "" OUTPUT_NAME loopd-libcamera
    LIBRARY_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/lib/loopd
    CXX_VISIBILITY_PRESET hidden VISIBILITY_INLINES_HIDDEN ON)
  target_compile_definitions(loopd_libcamera PRIVATE LOOPD_VERSION="${PROJECT_VERSION}")
  target_link_libraries(loopd_libcamera PRIVATE loopd_libcamera_parts)
  target_link_options(loopd_libcamera PRIVATE LINKER:--exclude-libs,ALL)
  install(TARGETS loopd_libcamera LIBRARY DESTINATION lib/loopd COMPONENT libcamera)
endif()
