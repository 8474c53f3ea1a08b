# Debian packages: loopd (what a robot needs), loopd-libcamera and loopd-tools (evaluation, videos);
# `tools/package` builds them.

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME loopd)
set(CPACK_PACKAGE_VERSION ${PROJECT_VERSION})
set(CPACK_PACKAGE_CONTACT "loopd developers <loopd@loopd.invalid>")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_COMPONENTS_ALL daemon libcamera tools)
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS
  OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)

set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(CPACK_DEBIAN_COMPRESSION_TYPE xz)

set(CPACK_DEBIAN_DAEMON_PACKAGE_NAME loopd)
set(CPACK_DEBIAN_DAEMON_PACKAGE_SECTION video)
set(CPACK_DEBIAN_DAEMON_DESCRIPTION 
"Watches a camera and tells other programs over a Unix socket when it sees a
place that it has seen before, with the geometry between the two views. Uses
points and lines, needs no training, and runs as a hardened systemd service.")
set(CPACK_DEBIAN_DAEMON_PACKAGE_DEPENDS "systemd (>= 252), passwd, kmod")
set(CPACK_DEBIAN_DAEMON_PACKAGE_SUGGESTS "loopd-libcamera, loopd-tools")
set(CPACK_DEBIAN_DAEMON_PACKAGE_CONTROL_EXTRA
  ${CMAKE_SOURCE_DIR}/packaging/conffiles
  ${CMAKE_SOURCE_DIR}/packaging/postinst
  ${CMAKE_SOURCE_DIR}/packaging/prerm
  ${CMAKE_SOURCE_DIR}/packaging/postrm)

set(CPACK_DEBIAN_LIBCAMERA_PACKAGE_NAME loopd-libcamera)
set(CPACK_DEBIAN_LIBCAMERA_PACKAGE_SECTION video)
set(CPACK_DEBIAN_LIBCAMERA_DESCRIPTION
"Lets loopd use the cameras that libcamera drives: sensors behind the image
processor of a small computer, beside the cameras of the kernel's V4L2 that
loopd uses by itself.")
set(CPACK_DEBIAN_LIBCAMERA_PACKAGE_DEPENDS "loopd (= ${PROJECT_VERSION})")
set(CPACK_DEBIAN_LIBCAMERA_PACKAGE_RECOMMENDS "libcamera-ipa")

set(CPACK_DEBIAN_TOOLS_PACKAGE_NAME loopd-tools)
set(CPACK_DEBIAN_TOOLS_PACKAGE_SECTION video)
set(CPACK_DEBIAN_TOOLS_DESCRIPTION 
"Evaluation and video tools: runs the loop-closure detector of loopd over
recorded sequences and scores it against ground truth, renders test sequences,
and lets the daemon read videos.")
set(CPACK_DEBIAN_TOOLS_PACKAGE_SUGGESTS "loopd")

# What Debian's policy wants beside the files: copyright and a compressed changelog for each package.
find_program(GZIP gzip REQUIRED)
function(loopd_package_docs component package)
  install(FILES ${CMAKE_SOURCE_DIR}/packaging/copyright
    DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/${package} COMPONENT ${component})
  install(FILES ${CMAKE_BINARY_DIR}/changelog.gz
    DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/${package} COMPONENT ${component})
endfunction()
file(CONFIGURE OUTPUT ${CMAKE_BINARY_DIR}/changelog CONTENT
"loopd (@PROJECT_VERSION@) unstable; urgency=medium

  * Version @PROJECT_VERSION@; see README.md for what it does.

 -- loopd developers <loopd@loopd.invalid>  Sun, 01 Nov 2026 00:00:00 +0000
" @ONLY)
execute_process(COMMAND ${GZIP} -9nkf ${CMAKE_BINARY_DIR}/changelog COMMAND_ERROR_IS_FATAL ANY)
loopd_package_docs(daemon loopd)
loopd_package_docs(libcamera loopd-libcamera)
loopd_package_docs(tools loopd-tools)

# loopd_install_man(COMPONENT PAGES...): manual pages, compressed as Debian wants them.
function(loopd_install_man component)
  foreach(page ${ARGN})
    cmake_path(GET page EXTENSION LAST_ONLY section)
    string(SUBSTRING ${section} 1 1 section)
    set(packed ${CMAKE_BINARY_DIR}/man/${page}.gz)
    file(MAKE_DIRECTORY ${CMAKE_BINARY_DIR}/man)
    add_custom_command(OUTPUT ${packed}
      COMMAND ${GZIP} -9nc ${CMAKE_SOURCE_DIR}/docs/${page} > ${packed}
      DEPENDS ${CMAKE_SOURCE_DIR}/docs/${page} VERBATIM)
    add_custom_target(man_${page} ALL DEPENDS ${packed})
    install(FILES ${packed} DESTINATION ${CMAKE_INSTALL_MANDIR}/man${section}
      COMPONENT ${component})
  endforeach()
endfunction()
