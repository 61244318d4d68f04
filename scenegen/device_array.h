/* A device buffer that grows. */
#ifndef BST_SCENEGEN_DEVICE_ARRAY_H
#define BST_SCENEGEN_DEVICE_ARRAY_H

#include <stddef.h>
#include <stdint.h>

#include "boresight/status.h"
#include "sim/device/device.h"

/* All zero: empty. Its owner releases the buffer. */
typedef struct bst_device_array {
    cl_mem buffer;
    size_t bytes;
} bst_device_array;

/* Makes room for `bytes`; the content is lost when the buffer grows. most_bytes: of one buffer, by
 * the device. BST_ERR_DEVICE. */
bst_status bst_device_array_reserve(bst_ctx *ctx, cl_context context, uint64_t most_bytes,
                                    bst_device_array *array, size_t bytes) BST_MUST_CHECK;

#endif
