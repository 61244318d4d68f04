include_guard(GLOBAL)

# Runs on the build machine, so it takes no project flags (a sanitized build stays quick).
add_executable(bst_embed_tool ${CMAKE_CURRENT_LIST_DIR}/embed.c)

# bst_embed_kernels(target file...)
# Embeds text files in `target` as C strings: for each b_c.cl the symbol bst_kernel_b_c of type
# bst_device_kernel_source, declared in the generated header "<target>_kernels.h" (on target's include path).
function(bst_embed_kernels target)
  set(files ${ARGN})
  list(TRANSFORM files PREPEND ${CMAKE_CURRENT_SOURCE_DIR}/ REGEX "^[^/]")
  set(source ${CMAKE_CURRENT_BINARY_DIR}/embed/${target}_kernels.c)
  set(header ${CMAKE_CURRENT_BINARY_DIR}/embed/${target}_kernels.h)
  file(MAKE_DIRECTORY ${CMAKE_CURRENT_BINARY_DIR}/embed)
  add_custom_command(
    OUTPUT ${source} ${header}
    COMMAND bst_embed_tool ${source} ${header} ${files}
    DEPENDS bst_embed_tool ${files}
    COMMENT "Embedding kernels of ${target}"
    VERBATIM)
  target_sources(${target} PRIVATE ${source})
  target_include_directories(${target} PUBLIC ${CMAKE_CURRENT_BINARY_DIR}/embed)
endfunction()

# bst_embed_page(target file...)
# Embeds the files of the viewer's page in `target` as `bst_view_page_files` (view/page_files.h).
function(bst_embed_page target)
  set(files ${ARGN})
  list(TRANSFORM files PREPEND ${CMAKE_CURRENT_SOURCE_DIR}/ REGEX "^[^/]")
  set(source ${CMAKE_CURRENT_BINARY_DIR}/embed/${target}_page.c)
  file(MAKE_DIRECTORY ${CMAKE_CURRENT_BINARY_DIR}/embed)
  add_custom_command(
    OUTPUT ${source}
    COMMAND bst_embed_tool --page ${source} ${files}
    DEPENDS bst_embed_tool ${files}
    COMMENT "Embedding the page of ${target}"
    VERBATIM)
  target_sources(${target} PRIVATE ${source})
endfunction()
