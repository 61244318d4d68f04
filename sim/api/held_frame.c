/* Frames that a program keeps beyond the next step of a sim. */
#include <assert.h>

#include "boresight/boresight.h"

bst_status bst_sim_hold_frame(bst_ctx *ctx, const bst_sim_frame *frame, bst_frame **held) {
    assert(frame && frame->message && held);
    const uint16_t *pixels;
    *held = NULL;
    BST_TRY(bst_frame_map(frame->message->frame, ctx, &pixels));
    assert(pixels == frame->pixels); /* maps of a frame share one mapping */
    bst_frame_retain(frame->message->frame);
    *held = frame->message->frame;
    return BST_OK;
}

void bst_sim_release_frame(bst_frame *held) {
    if (held) {
        bst_frame_unmap(held);
        bst_frame_release(held);
    }
}
