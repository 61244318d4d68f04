/* How well one sensor's loop did, judged against the truth as the run goes. */
#ifndef BST_EVAL_LOOP_SUMMARY_H
#define BST_EVAL_LOOP_SUMMARY_H

#include "boresight/messages.h"
#include "sim/eval/loop_figures.h"
#include "sim/world/world.h"

typedef struct bst_loop_summary bst_loop_summary;

/* target_object: index of the right target in the world, -1 when there is none. The world must
 * outlive the summary. */
bst_status bst_loop_summary_create(bst_ctx *ctx, const bst_world *world, int observer, int sensor,
                                   int64_t tick_rate_hz, int target_object,
                                   bst_loop_summary **out) BST_MUST_CHECK;
/* Frees a summary; NULL is allowed. */
void bst_loop_summary_free(bst_loop_summary *summary);

/* Called once for every frame when its verdict is final (a few frames late, the last ones at the
 * end). */
typedef void (*bst_loop_frame_fn)(void *user, const bst_loop_frame *frame);
/* Sets the function that gets each frame once it is evaluated; NULL: none. */
void bst_loop_summary_on_frame(bst_loop_summary *summary, bst_loop_frame_fn fn, void *user);

/* Adds the truth of an exposure. Messages come as they are published.
 *
 * Errors:    those of the world's view */
bst_status bst_loop_summary_truth(bst_ctx *ctx, bst_loop_summary *summary,
                                  const bst_truth *truth) BST_MUST_CHECK;

/* Evaluates the frame of a tracks message. Messages come in order of their exposures.
 *
 * Given:     tick  tick at which the message was published */
void bst_loop_summary_tracks(bst_loop_summary *summary, const bst_tracks *tracks, int64_t tick);
/* Stores the mode of control. */
void bst_loop_summary_status(bst_loop_summary *summary, const bst_control_status *status);

/* The target is another one from now on, -1: none: acquisition and settling begin anew; the times
 * stay those of the first. */
void bst_loop_summary_retarget(bst_loop_summary *summary, int target_object);

/* Settles the frames that still wait for their tracks. */
void bst_loop_summary_finish(bst_loop_summary *summary);
/* Figures so far; frames that wait for their tracks are counted too. */
void bst_loop_summary_figures(const bst_loop_summary *summary, bst_loop_figures *out);
/* The newest frame's state, for a progress line; before its tracks have come in_track is that of
 * the frame before. */
void bst_loop_summary_newest(const bst_loop_summary *summary, bst_loop_frame *out);

#endif
