#include "scenegen/saturation_count.h"

#include <assert.h>

enum { NONE = -1 };

void bst_saturation_count_init(bst_saturation_count *c) {
    *c = (bst_saturation_count){0};
    for (int i = 0; i < BST_STAGE_SETS; i++) {
        c->restored[i] = NONE;
    }
}

/* Saturated pixels of the frame that used a set; NONE if it is counted already. */
static bst_status pixels_of(bst_ctx *ctx, const bst_saturation_count *c, bst_upload_ring *ring,
                            int set, int64_t *pixels) {
    const void *counts;
    *pixels = c->restored[set];
    if (c->tiles[set] == 0) {
        return BST_OK;
    }
    BST_TRY(bst_upload_ring_result(ctx, ring, set, BST_STAGE_SATURATED, &counts));
    *pixels = 0;
    for (int i = 0; i < c->tiles[set]; i++) {
        *pixels += ((const cl_int *)counts)[i];
    }
    return BST_OK;
}

bst_status bst_saturation_count_frame(bst_ctx *ctx, bst_saturation_count *c, bst_upload_ring *ring,
                                      int set) {
    assert(c && ring && set >= 0 && set < BST_STAGE_SETS);
    int64_t pixels;
    bst_status status = pixels_of(ctx, c, ring, set, &pixels);
    c->tiles[set] = 0;
    c->restored[set] = NONE;
    if (status == BST_OK && pixels != NONE) {
        c->pixels = pixels;
        c->frames += pixels > 0;
    }
    return status;
}

bst_status bst_saturation_count_archive(bst_saturation_count *c, bst_upload_ring *ring,
                                        bst_archive *archive) {
    assert(c && ring && archive);
    bool restoring = bst_archive_is_restoring(archive);
    for (int i = 0; i < BST_STAGE_SETS; i++) {
        int64_t pixels = NONE;
        if (!restoring) {
            BST_TRY(pixels_of(bst_archive_ctx(archive), c, ring, i, &pixels));
        }
        pixels = bst_archive_integer(archive, pixels, NONE, INT32_MAX);
        if (restoring) {
            c->tiles[i] = 0;
            c->restored[i] = pixels;
        }
    }
    c->pixels = bst_archive_integer(archive, c->pixels, 0, INT32_MAX);
    c->frames = bst_archive_integer(archive, c->frames, 0, INT64_MAX / 2);
    return BST_OK;
}
