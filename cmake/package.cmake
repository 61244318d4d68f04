# What CPack makes of an installed tree: a Debian package (./dev package).
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME boresight)
set(CPACK_PACKAGE_VENDOR "The Boresight authors")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "simulator of space-based telescopes that track satellites")
set(CPACK_PACKAGE_DESCRIPTION
"Boresight closes the loop of a space-based electro-optical tracking payload in software: orbits,
attitude and gimbal, the frame of the focal plane rendered from the real sky with a full detector,
detections, tracks, and the gimbal's command. It runs closed or open, by images or by an observation
generator, alone, against hardware over a link, or as studies of many runs.")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_INSTALL_CMAKE_PROJECTS "${PROJECT_BINARY_DIR};boresight;Unspecified;/")
set(CPACK_COMPONENTS_ALL Unspecified)

set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PACKAGE_MAINTAINER "The Boresight authors <boresight@localhost>")
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
# found at run time, not by the linker
set(CPACK_DEBIAN_PACKAGE_DEPENDS pocl-opencl-icd)
set(CPACK_DEBIAN_PACKAGE_RECOMMENDS "gnuplot-nox, xz-utils")
set(CPACK_DEBIAN_PACKAGE_SUGGESTS "ffmpeg, slurm-client")
include(CPack)
