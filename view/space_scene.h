/* The world of a run, for answers about space: made at its first use. */
#ifndef BST_VIEW_SPACE_SCENE_H
#define BST_VIEW_SPACE_SCENE_H

#include "boresight/vec.h"
#include "view/routes.h"

/* Forgets the world of a run: its scenario.json has changed. Any thread. */
void bst_view_space_forget(bst_view_run *run);

/* Calls an answer with the run locked and its world made.
 *
 * Errors:    those of bst_view_subject_run, bst_run_scene_open and of the answer */
bst_status bst_view_with_scene(bst_ctx *ctx, bst_view_exchange *x,
                               bst_status (*answer)(bst_ctx *, bst_view_run *,
                                                    bst_view_exchange *)) BST_MUST_CHECK;

/* BST_ERR_ARGUMENT: a time before the epoch or later than 1e9 s. */
bst_status bst_view_space_check_time(bst_ctx *ctx, double from_s) BST_MUST_CHECK;

/* Writes a vector to three numbers. Returns the place behind them. */
static inline double *bst_view_put(double *at, bst_vec3 v) {
    at[0] = v.x;
    at[1] = v.y;
    at[2] = v.z;
    return at + 3;
}

#endif
