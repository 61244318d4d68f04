/* How well one sensor's loop did, judged against the truth as the run goes. */
#ifndef BST_EVAL_LOOP_SUMMARY_H
#define BST_EVAL_LOOP_SUMMARY_H

#include "sim/core/messages.h"
#include "sim/world/world.h"

typedef struct bst_loop_summary bst_loop_summary;

/* What one frame showed, for plots. */
typedef struct bst_loop_frame {
    int64_t exposure_id;
    double time_s;   /* middle of the exposure */
    double error_px; /* boresight to true target; NAN when the target is not there */
    double error_x_px, error_y_px;
    double target_x_px, target_y_px;
    double target_snr; /* true SNR, target in the field; else 0 */
    bool visible;      /* target sunlit, not behind the Earth, brighter than nothing */
    bool in_track;     /* the track of interest is confirmed and is the right target's */
    bool settled;      /* counts for the pointing figures */
    int mode;          /* bst_mode at the end of the exposure */
} bst_loop_frame;

typedef struct bst_loop_figures {
    int64_t frames;
    int final_mode;
    double time_to_confirm_s; /* NAN: never */
    double time_to_settle_s;  /* NAN: never */
    double track_fraction;    /* of the visible frames after the first confirmation; 0 if never
                                 confirmed */
    /* frames in which the track of interest was not the target's: more than 5 px away and, where
     * the tracker says what hides its object, also beyond 99.99 % of its covariance */
    int64_t wrong_target_frames;
    double pointing_rms_px,
        pointing_p99_px;     /* over the frames after settling but those in which control coasts,
                                as the target is hidden; NAN when there are none */
    double pointing_bias_px; /* length of the mean error vector */
    int64_t pointing_frames;
    int64_t earth_frames, moon_frames,
        sun_frames; /* in which their disc covers part of the image */
} bst_loop_figures;

/* target_object: index of the right target in the world, -1 when there is none. The world must
 * outlive the summary. */
bst_status bst_loop_summary_create(bst_ctx *ctx, const bst_world *world, int observer, int sensor,
                                   int64_t tick_rate_hz, int target_object,
                                   bst_loop_summary **out) BST_MUST_CHECK;
void bst_loop_summary_free(bst_loop_summary *summary);

/* Called once for every frame when its verdict is final (a few frames late, the last ones at the
 * end). */
typedef void (*bst_loop_frame_fn)(void *user, const bst_loop_frame *frame);
void bst_loop_summary_on_frame(bst_loop_summary *summary, bst_loop_frame_fn fn, void *user);

/* Messages as they are published. */
bst_status bst_loop_summary_truth(bst_ctx *ctx, bst_loop_summary *summary,
                                  const bst_truth *truth) BST_MUST_CHECK;
void bst_loop_summary_tracks(bst_loop_summary *summary, const bst_tracks *tracks, int64_t tick);
void bst_loop_summary_status(bst_loop_summary *summary, const bst_control_status *status);

/* The target is another one from now on, -1: none: confirmation and settling begin anew; the times
 * to them stay those of the first. */
void bst_loop_summary_retarget(bst_loop_summary *summary, int target_object);

/* Settles the frames that still wait for their tracks. */
void bst_loop_summary_finish(bst_loop_summary *summary);
void bst_loop_summary_figures(const bst_loop_summary *summary, bst_loop_figures *out);
/* The newest frame's state, for a progress line; before its tracks have come in_track is that of
 * the frame before. */
void bst_loop_summary_newest(const bst_loop_summary *summary, bst_loop_frame *out);

#endif
