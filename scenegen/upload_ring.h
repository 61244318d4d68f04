/* Ring of host-device transfer buffers, in sets: while the device works on one frame, the host
 * fills the next one's set. A set has growing buffers (parts), each mapped ahead of its next use,
 * so that the host does not wait for a frame in progress. */
#ifndef BST_SCENEGEN_UPLOAD_RING_H
#define BST_SCENEGEN_UPLOAD_RING_H

#include <stddef.h>
#include <stdint.h>

#include "boresight/archive.h"
#include "sim/device/device.h"

typedef struct bst_upload_ring bst_upload_ring;

/* Number of sets: frames in progress before the host waits. */
enum { BST_STAGE_SETS = 2 };

typedef enum bst_upload_ring_part {
    BST_STAGE_TABLE,      /* node table */
    BST_STAGE_SOURCES,    /* rendered sources */
    BST_STAGE_SHARES,     /* spectrum shares of the sources */
    BST_STAGE_BACKGROUND, /* coarse background grid */
    BST_STAGE_HITS,       /* cosmic rays */
    BST_STAGE_ROWS,       /* row offsets of the sensor */
    BST_STAGE_SATURATED,  /* from the device: saturation counts */
    BST_STAGE_PARTS
} bst_upload_ring_part;

/* Creates the ring of buffers for uploads to a device.
 *
 * Returned:  *out  to be freed, after an error too, if it is not NULL
 * Errors:    BST_ERR_MEMORY, BST_ERR_DEVICE */
bst_status bst_upload_ring_create(bst_ctx *ctx, bst_device *device,
                                  bst_upload_ring **out) BST_MUST_CHECK;
/* Frees the ring; waits for the device. */
void bst_upload_ring_free(bst_upload_ring *stage);

/* Saves or restores which set is the current one. The buffers' contents are of frames in progress
 * and are not archived.
 *
 * Returned:  index of the current set */
int bst_upload_ring_archive(bst_upload_ring *stage, bst_archive *archive);

/* Starts the next set and returns its index, 0 to BST_STAGE_SETS - 1. */
int bst_upload_ring_begin(bst_upload_ring *stage);

/* Copies `bytes` of `data` into a part of the current set. *buffer, at least one byte, holds them
 * for commands enqueued until bst_upload_ring_end. Waits for the frame that used the set before. */
bst_status bst_upload_ring_put(bst_ctx *ctx, bst_upload_ring *stage, bst_upload_ring_part part,
                               const void *data, size_t bytes, cl_mem *buffer) BST_MUST_CHECK;

/* Reserves a part that the device fills. */
bst_status bst_upload_ring_room(bst_ctx *ctx, bst_upload_ring *stage, bst_upload_ring_part part,
                                size_t bytes, cl_mem *buffer) BST_MUST_CHECK;

/* Result of the device in a part of a set; waits for the frame that used it. Call it between
 * bst_upload_ring_end of that frame and bst_upload_ring_put or bst_upload_ring_room of the next
 * frame with the set. */
bst_status bst_upload_ring_result(bst_ctx *ctx, bst_upload_ring *stage, int set,
                                  bst_upload_ring_part part, const void **data) BST_MUST_CHECK;

/* Ends the current set's frame after its last command was enqueued. Does not wait. */
bst_status bst_upload_ring_end(bst_ctx *ctx, bst_upload_ring *stage) BST_MUST_CHECK;

#endif
