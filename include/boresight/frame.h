/* A focal-plane frame: an opaque, reference-counted handle. Whoever renders makes it (usually on an
 * OpenCL device); whoever reads maps it. */
#ifndef BORESIGHT_FRAME_H
#define BORESIGHT_FRAME_H

#include <stdint.h>

#include "boresight/status.h"

typedef struct bst_frame bst_frame;

/* Frames that may be under way behind the thread that steps the modules, besides those in queues.
 */
enum { BST_OVERLAP_FRAMES = 9 };

/* What a maker of frames supplies. All functions get the maker's own pointer. */
typedef struct bst_frame_ops {
    /* Called from any thread. Makes the pixels readable: row-major uint16 [height][width], in
     * digital numbers. */
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
    int references, maps; /* atomic: readers may be in other threads than the maker */
};

static inline void bst_frame_retain(bst_frame *frame) {
    __atomic_fetch_add(&frame->references, 1, __ATOMIC_RELAXED);
}
static inline void bst_frame_release(bst_frame *frame) {
    if (frame && __atomic_sub_fetch(&frame->references, 1, __ATOMIC_ACQ_REL) == 0) {
        frame->ops->recycle(frame->owner);
    }
}
/* Pixels stay valid until the matching unmap; maps nest. */
static inline bst_status bst_frame_map(bst_frame *frame, bst_ctx *ctx, const uint16_t **pixels) {
    bst_status status = frame->ops->map(frame->owner, ctx, pixels);
    if (status == BST_OK) {
        __atomic_fetch_add(&frame->maps, 1, __ATOMIC_RELAXED);
    }
    return status;
}
static inline void bst_frame_unmap(bst_frame *frame) {
    if (__atomic_sub_fetch(&frame->maps, 1, __ATOMIC_ACQ_REL) == 0) {
        frame->ops->unmap(frame->owner);
    }
}
static inline void *bst_frame_device_buffer(bst_frame *frame) {
    return frame->ops->device_buffer ? frame->ops->device_buffer(frame->owner) : NULL;
}

#endif
