/* Evaluates the tracking loop of one sensor against the truth while a run proceeds. */
#ifndef BST_EVAL_LOOP_SUMMARY_H
#define BST_EVAL_LOOP_SUMMARY_H

#include "boresight/messages.h"
#include "sim/eval/loop_figures.h"
#include "sim/world/world.h"

typedef struct bst_loop_summary bst_loop_summary;

/* Creates the evaluation of a sensor's loop. target_object: index of the true target in the world,
 * -1: none. The world must outlive it. */
bst_status bst_loop_summary_create(bst_ctx *ctx, const bst_world *world, int observer, int sensor,
                                   int64_t tick_rate_hz, int target_object,
                                   bst_loop_summary **out) BST_MUST_CHECK;
/* Frees a summary; NULL is allowed. */
void bst_loop_summary_free(bst_loop_summary *summary);

/* Saves or restores what a summary has evaluated. */
void bst_loop_summary_archive(bst_loop_summary *summary, bst_archive *archive);

/* Callback for each completed frame; it is called a few frames late, for the last frames at the
 * end. */
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

/* Changes the true target, -1: none. Acquisition and settling start again; the recorded times
 * remain those of the first target. */
void bst_loop_summary_retarget(bst_loop_summary *summary, int target_object);

/* Completes the frames that still wait for their tracks. */
void bst_loop_summary_finish(bst_loop_summary *summary);
/* Loop figures so far, including frames that wait for their tracks. */
void bst_loop_summary_figures(const bst_loop_summary *summary, bst_loop_figures *out);
/* State of the newest frame, for a progress display. Before its tracks arrive, in_track is that of
 * the previous frame. */
void bst_loop_summary_newest(const bst_loop_summary *summary, bst_loop_frame *out);

#endif
