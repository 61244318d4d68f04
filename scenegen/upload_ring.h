/* What goes between host and device with each frame, in sets that take turns: while the device
 * works on one frame's, the host fills the next one's. A set has parts, buffers that grow; each is
 * mapped ahead of its next use, so that nobody waits for a frame that is under way. */
#ifndef BST_SCENEGEN_UPLOAD_RING_H
#define BST_SCENEGEN_UPLOAD_RING_H

#include <stddef.h>

#include "sim/device/device.h"

typedef struct bst_stage bst_stage;

/* Sets: frames that may be under way before the host waits. */
enum { BST_STAGE_SETS = 2 };

typedef enum bst_stage_part {
    BST_STAGE_TABLE,      /* of nodes */
    BST_STAGE_SOURCES,    /* that are drawn */
    BST_STAGE_SHARES,     /* of the sources' spectra */
    BST_STAGE_BACKGROUND, /* on its coarse grid */
    BST_STAGE_HITS,       /* of radiation */
    BST_STAGE_ROWS,       /* offsets of the sensor's rows */
    BST_STAGE_SATURATED,  /* from the device: counts */
    BST_STAGE_PARTS
} bst_stage_part;

bst_status bst_stage_create(bst_ctx *ctx, bst_device *device, bst_stage **out) BST_MUST_CHECK;
/* Waits for the device. */
void bst_stage_free(bst_stage *stage);

/* Takes the next set in turn and returns its index, 0 to BST_STAGE_SETS - 1. */
int bst_stage_begin(bst_stage *stage);

/* Copies `bytes` of `data` into a part of the present set. *buffer, of at least one byte, holds
 * them for commands enqueued until bst_stage_end. Waits for the frame that used the set before. */
bst_status bst_stage_put(bst_ctx *ctx, bst_stage *stage, bst_stage_part part, const void *data,
                         size_t bytes, cl_mem *buffer) BST_MUST_CHECK;

/* The same for a part that the device fills. */
bst_status bst_stage_room(bst_ctx *ctx, bst_stage *stage, bst_stage_part part, size_t bytes,
                          cl_mem *buffer) BST_MUST_CHECK;

/* What the device left in a part of a set; waits for the frame that used it. To be called between
 * bst_stage_end of that frame and bst_stage_put or bst_stage_room of the next with the set. */
bst_status bst_stage_result(bst_ctx *ctx, bst_stage *stage, int set, bst_stage_part part,
                            const void **data) BST_MUST_CHECK;

/* Ends the present set's frame, after its last command was enqueued. Does not wait. */
bst_status bst_stage_end(bst_ctx *ctx, bst_stage *stage) BST_MUST_CHECK;

#endif
