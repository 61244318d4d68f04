#include "sim/engine/kernel/saved_frame.h"

#include <stdlib.h>

/* A frame that a message owned when the engine was saved. */
typedef struct saved_frame {
    bst_frame frame;
    uint16_t pixels[];
} saved_frame;

static bst_status map_saved(void *owner, bst_ctx *ctx, const uint16_t **pixels) {
    (void)ctx;
    *pixels = ((saved_frame *)owner)->pixels;
    return BST_OK;
}

static void unmap_saved(void *owner) {
    (void)owner;
}

static void free_saved(void *owner) {
    free(owner);
}

static const bst_frame_ops saved_ops = {
    .map = map_saved, .unmap = unmap_saved, .recycle = free_saved};

enum { MOST_PIXELS_PER_AXIS = 65536 };

bst_status bst_frame_save(bst_ctx *ctx, bst_archive *archive, bst_frame *frame) {
    const uint16_t *pixels;
    int size[2] = {frame->width, frame->height};
    BST_TRY(bst_frame_map(frame, ctx, &pixels));
    BST_ARCHIVE(archive, size);
    bst_archive_bytes(archive, (uint16_t *)pixels,
                      sizeof *pixels * (size_t)size[0] * (size_t)size[1]);
    bst_frame_unmap(frame);
    return BST_OK;
}

bst_status bst_frame_restore(bst_ctx *ctx, bst_archive *archive, bst_frame **out) {
    int size[2] = {0, 0};
    BST_ARCHIVE(archive, size);
    *out = NULL;
    if (size[0] < 1 || size[0] > MOST_PIXELS_PER_AXIS || size[1] < 1 ||
        size[1] > MOST_PIXELS_PER_AXIS) {
        return bst_fail(ctx, BST_ERR_FORMAT, "the saved state has a frame of %d x %d pixels",
                        size[0], size[1]);
    }
    size_t bytes = sizeof(uint16_t) * (size_t)size[0] * (size_t)size[1];
    saved_frame *saved =
        bst_archive_remaining(archive) >= bytes ? malloc(sizeof *saved + bytes) : NULL;
    if (!saved) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for a saved frame of %d x %d pixels",
                        size[0], size[1]);
    }
    saved->frame = (bst_frame){
        .ops = &saved_ops, .owner = saved, .width = size[0], .height = size[1], .references = 1};
    bst_archive_bytes(archive, saved->pixels, bytes);
    *out = &saved->frame;
    return BST_OK;
}
