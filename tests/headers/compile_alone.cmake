# Each header compiles with nothing before it, and twice in a row (include guard), as C17; where it
# says extern "C", also as C++17. A header with a guard that a source of the same name includes before
# all else has been compiled so with that source.
include(${CMAKE_CURRENT_LIST_DIR}/folders.cmake)
set(flags -Wall -Wextra -Wshadow -Wconversion -Werror -D_POSIX_C_SOURCE=200809L -fsyntax-only
  -I include -I . -I ${BUILD} -I /usr/include/cjson)
set(empty ${BUILD}/tests/headers/empty.c)
file(WRITE ${empty} "")
set(failures 0)
set(count 0)

function(compile header compiler)
  execute_process(
    COMMAND ${compiler} ${flags} ${ARGN} -include ${header} -include ${header} ${empty}
    RESULT_VARIABLE result ERROR_VARIABLE messages)
  if(NOT result EQUAL 0)
    message("${header} does not compile alone (${ARGN}):\n${messages}")
    math(EXPR failures "${failures} + 1")
    set(failures ${failures} PARENT_SCOPE)
  endif()
endfunction()

# Sets `out` to whether the header's own source has shown it. Not in parts with unity builds, where
# another source may stand before.
function(shown_by_source header text out)
  set(${out} OFF PARENT_SCOPE)
  if(header MATCHES "^(control|gimbal|sim/engine)/" OR text MATCHES "extern \"C\"" OR
      NOT text MATCHES "#ifndef (BST_[A-Z0-9_]+_H)\n#define (BST_[A-Z0-9_]+_H)\n")
    return()
  endif()
  if(NOT CMAKE_MATCH_1 STREQUAL CMAKE_MATCH_2)
    return()
  endif()
  string(REGEX REPLACE "h$" "c" source ${header})
  if(EXISTS ${CMAKE_CURRENT_SOURCE_DIR}/${source})
    file(STRINGS ${source} first REGEX "^#" LIMIT_COUNT 1)
    if(first STREQUAL "#include \"${header}\"")
      set(${out} ON PARENT_SCOPE)
    endif()
  endif()
endfunction()

foreach(folder ${all_folders})
  file(GLOB_RECURSE headers RELATIVE ${CMAKE_CURRENT_SOURCE_DIR} ${folder}/*.h)
  foreach(header ${headers})
    math(EXPR count "${count} + 1")
    file(READ ${header} text)
    shown_by_source(${header} "${text}" shown)
    if(shown)
      continue()
    endif()
    compile(${header} ${CC} -std=c17 -x c)
    if(text MATCHES "extern \"C\"")
      compile(${header} ${CXX} -std=c++17 -x c++)
    endif()
  endforeach()
endforeach()
if(count LESS 20)
  message(FATAL_ERROR "only ${count} headers found: run this from the root of the sources")
elseif(failures)
  message(FATAL_ERROR "${failures} of ${count} headers do not compile alone")
endif()
message("${count} headers compile alone")
