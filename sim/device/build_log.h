/* Log of an OpenCL compiler, with the names of the kernel files. */
#ifndef BST_DEVICE_BUILD_LOG_H
#define BST_DEVICE_BUILD_LOG_H

#include "sim/device/device.h"

/* Copies a log of a compiler that ignores #line, as NVIDIA's does: "<kernel>:12:" becomes
 * "file.cl:3:", with the line in that file.
 *
 * Given:     texts    [text_count] of the program in order; those at 2, 4, ... are `sources`
 *            sources  [(text_count - 1) / 2]
 * Returned:  to be freed with free; NULL: no memory */
char *bst_build_log_with_names(const char *log, const char *const *texts, int text_count,
                               const bst_device_kernel_source *const *sources);

#endif
