# Each header compiles with nothing before it, and twice in a row (include guard), as C17; where it
# says extern "C", also as C++17.
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

foreach(folder ${all_folders})
  file(GLOB_RECURSE headers RELATIVE ${CMAKE_CURRENT_SOURCE_DIR} ${folder}/*.h)
  foreach(header ${headers})
    math(EXPR count "${count} + 1")
    compile(${header} ${CC} -std=c17 -x c)
    file(READ ${header} text)
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
