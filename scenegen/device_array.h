/* Growing device buffer. */
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

/* Ensures room for `bytes`; the content is lost if the buffer grows.
 *
 * Given:     most_bytes  largest buffer of the device
 * Errors:    BST_ERR_DEVICE */
bst_status bst_device_array_reserve(bst_ctx *ctx, cl_context context, uint64_t most_bytes,
                                    bst_device_array *array, size_t bytes) BST_MUST_CHECK;

#endif
