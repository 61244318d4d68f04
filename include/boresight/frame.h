/* A focal-plane frame: an opaque, reference-counted handle. The renderer creates it (usually on an
 * OpenCL device); readers map it. */
#ifndef BORESIGHT_FRAME_H
#define BORESIGHT_FRAME_H

#include <stdbool.h>
#include <stdint.h>

#include "boresight/status.h"

typedef struct bst_frame bst_frame;

/* Frames that deferred steps may hold at a time, besides those in queues. */
enum { BST_OVERLAP_FRAMES = 9 };

/* Functions of a frame's owner. Their first argument is the owner's pointer. */
typedef struct bst_frame_ops {
    /* Called from any thread. Makes the pixels readable: row-major uint16 [height][width], in
     * digital numbers. */
    bst_status (*map)(void *owner, bst_ctx *ctx, const uint16_t **pixels);
    void (*unmap)(void *owner);
    /* The device buffer (cl_mem) that holds the same pixels, or NULL. */
    void *(*device_buffer)(void *owner);
    /* Called when the last reference is released: returns the buffer to the pool. */
    void (*recycle)(void *owner);
    /* May be NULL: refuses. Asks to keep the frame for a clone of the simulation, which may hold it
     * for any time. False: the owner needs the buffer; the clone copies the pixels. Any thread. */
    bool (*share)(void *owner);
} bst_frame_ops;

/* The owner embeds this in its own frame object (no allocation per frame). */
struct bst_frame {
    const bst_frame_ops *ops;
    void *owner;
    int width, height;
    int references, maps; /* atomic: readers may be in other threads than the owner */
};

/* Takes a reference to a frame. Any thread. */
static inline void bst_frame_retain(bst_frame *frame) {
    __atomic_fetch_add(&frame->references, 1, __ATOMIC_RELAXED);
}

/* Releases a reference to a frame; the last one returns it to its owner. NULL is allowed. Any
 * thread. */
static inline void bst_frame_release(bst_frame *frame) {
    if (frame && __atomic_sub_fetch(&frame->references, 1, __ATOMIC_ACQ_REL) == 0) {
        frame->ops->recycle(frame->owner);
    }
}

/* Makes the pixels of a frame readable.
 *
 * Returned:  *pixels  [height][width], row-major, DN; valid until the matching bst_frame_unmap
 * Errors:    those of the owner's map (BST_ERR_DEVICE)
 * Notes:     maps nest. Any thread. */
static inline bst_status bst_frame_map(bst_frame *frame, bst_ctx *ctx, const uint16_t **pixels) {
    bst_status status = frame->ops->map(frame->owner, ctx, pixels);
    if (status == BST_OK) {
        __atomic_fetch_add(&frame->maps, 1, __ATOMIC_RELAXED);
    }
    return status;
}
/* Ends a bst_frame_map; the last one releases the mapping. */
static inline void bst_frame_unmap(bst_frame *frame) {
    if (__atomic_sub_fetch(&frame->maps, 1, __ATOMIC_ACQ_REL) == 0) {
        frame->ops->unmap(frame->owner);
    }
}

/* OpenCL buffer (cl_mem) with the pixels of a frame; NULL if there is none. It belongs to the
 * frame. */
static inline void *bst_frame_device_buffer(bst_frame *frame) {
    return frame->ops->device_buffer ? frame->ops->device_buffer(frame->owner) : NULL;
}

#endif
