# The two OpenCV libraries that the project uses, found one by one: the all-in development package
# would pull in more than a hundred others. Targets: bst_opencv_core, bst_opencv_imgproc.
include_guard(GLOBAL)

find_path(OPENCV_INCLUDE_DIR opencv2/core.hpp PATH_SUFFIXES opencv4 REQUIRED)
mark_as_advanced(OPENCV_INCLUDE_DIR)
foreach(part core imgproc)
  find_library(OPENCV_${part}_LIBRARY opencv_${part} REQUIRED)
  mark_as_advanced(OPENCV_${part}_LIBRARY)
  add_library(bst_opencv_${part} INTERFACE IMPORTED GLOBAL)
  target_include_directories(bst_opencv_${part} SYSTEM INTERFACE ${OPENCV_INCLUDE_DIR})
  target_link_libraries(bst_opencv_${part} INTERFACE ${OPENCV_${part}_LIBRARY})
endforeach()
target_link_libraries(bst_opencv_imgproc INTERFACE bst_opencv_core)
