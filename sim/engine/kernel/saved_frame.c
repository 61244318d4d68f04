#include "sim/engine/kernel/saved_frame.h"

#include <stdlib.h>
#include <string.h>

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

static bool share_saved(void *owner) {
    (void)owner;
    return true;
}

static const bst_frame_ops saved_ops = {
    .map = map_saved, .unmap = unmap_saved, .recycle = free_saved, .share = share_saved};

enum { MOST_PIXELS_PER_AXIS = 65536 };

/* Bytes of the pixels of a frame. */
static size_t pixel_bytes(const int size[2]) {
    return sizeof(uint16_t) * (size_t)size[0] * (size_t)size[1];
}

bst_status bst_frame_save(bst_ctx *ctx, bst_archive *archive, bst_frame *frame) {
    const uint16_t *pixels;
    int size[2] = {frame->width, frame->height};
    if (bst_archive_refers(archive)) {
        BST_ARCHIVE(archive, frame);
        return BST_OK;
    }
    BST_ARCHIVE(archive, size);
    BST_TRY(bst_frame_map(frame, ctx, &pixels));
    bst_archive_bytes(archive, (uint16_t *)pixels, pixel_bytes(size));
    bst_frame_unmap(frame);
    return BST_OK;
}

/* Makes a frame without pixels in host memory. */
static bst_status make_frame(bst_ctx *ctx, const int size[2], saved_frame **out) {
    *out = malloc(sizeof **out + pixel_bytes(size));
    if (!*out) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for a saved frame of %d x %d pixels",
                        size[0], size[1]);
    }
    (*out)->frame = (bst_frame){
        .ops = &saved_ops, .owner = *out, .width = size[0], .height = size[1], .references = 1};
    return BST_OK;
}

/* Takes the frame that an archive refers to, or copies it if its owner needs the buffer. */
static bst_status take_frame(bst_ctx *ctx, bst_archive *archive, bst_frame **out) {
    bst_frame *frame;
    const uint16_t *pixels;
    saved_frame *copy;
    BST_ARCHIVE(archive, frame);
    if (frame->ops->share && frame->ops->share(frame->owner)) {
        bst_frame_retain(frame);
        *out = frame;
        return BST_OK;
    }
    const int size[2] = {frame->width, frame->height};
    BST_TRY(make_frame(ctx, size, &copy));
    bst_status status = bst_frame_map(frame, ctx, &pixels);
    if (status != BST_OK) {
        free(copy);
        return status;
    }
    memcpy(copy->pixels, pixels, pixel_bytes(size));
    bst_frame_unmap(frame);
    *out = &copy->frame;
    return BST_OK;
}

bst_status bst_frame_restore(bst_ctx *ctx, bst_archive *archive, bst_frame **out) {
    int size[2] = {0, 0};
    saved_frame *saved;
    *out = NULL;
    if (bst_archive_refers(archive)) {
        return take_frame(ctx, archive, out);
    }
    BST_ARCHIVE(archive, size);
    if (size[0] < 1 || size[0] > MOST_PIXELS_PER_AXIS || size[1] < 1 ||
        size[1] > MOST_PIXELS_PER_AXIS) {
        return bst_fail(ctx, BST_ERR_FORMAT, "the saved state has a frame of %d x %d pixels",
                        size[0], size[1]);
    }
    if (bst_archive_remaining(archive) < pixel_bytes(size)) {
        return bst_fail(ctx, BST_ERR_FORMAT,
                        "the saved state has not all pixels of a frame of %d x %d", size[0],
                        size[1]);
    }
    BST_TRY(make_frame(ctx, size, &saved));
    bst_archive_bytes(archive, saved->pixels, pixel_bytes(size));
    *out = &saved->frame;
    return BST_OK;
}
