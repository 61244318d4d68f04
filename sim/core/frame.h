/* A focal-plane frame: an opaque, reference-counted handle. Whoever renders makes it (usually on an
 * OpenCL device); whoever reads maps it. */
#ifndef BST_CORE_FRAME_H
#define BST_CORE_FRAME_H

#include <stdint.h>

#include "sim/core/status.h"

typedef struct bst_frame bst_frame;

/* What a maker of frames supplies. All functions get the maker's own pointer. */
typedef struct bst_frame_ops {
    /* Makes the pixels readable: row-major uint16 [height][width], in digital numbers. */
    bst_status (*map)(void *owner, bst_ctx *ctx, const uint16_t **pixels);
    void (*unmap)(void *owner);
    /* The device buffer (cl_mem) that holds the same pixels, or NULL. */
    void *(*device_buffer)(void *owner);
    /* The last reference is gone: take the buffer back into the pool. */
    void (*recycle)(void *owner);
} bst_frame_ops;

/* The maker embeds this in its own frame object (no allocation per frame). */
struct bst_frame {
    const bst_frame_ops *ops;
    void *owner;
    int width, height;
    int references; /* single-threaded by the rule that one run is stepped by one thread */
    int maps;
};

static inline void bst_frame_retain(bst_frame *frame) {
    frame->references++;
}
static inline void bst_frame_release(bst_frame *frame) {
    if (frame && --frame->references == 0) {
        frame->ops->recycle(frame->owner);
    }
}
/* Pixels stay valid until the matching unmap; maps nest. */
static inline bst_status bst_frame_map(bst_frame *frame, bst_ctx *ctx, const uint16_t **pixels) {
    bst_status status = frame->ops->map(frame->owner, ctx, pixels);
    if (status == BST_OK) {
        frame->maps++;
    }
    return status;
}
static inline void bst_frame_unmap(bst_frame *frame) {
    if (--frame->maps == 0) {
        frame->ops->unmap(frame->owner);
    }
}
static inline void *bst_frame_device_buffer(bst_frame *frame) {
    return frame->ops->device_buffer ? frame->ops->device_buffer(frame->owner) : NULL;
}

#endif
