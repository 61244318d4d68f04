/* Fixed-lag smoother of tracks: the states of an earlier frame given the detections of all frames
 * since (Rauch-Tung-Striebel recursion over the latest frames). */
#ifndef BST_TRACKER_MTT_SMOOTHER_H
#define BST_TRACKER_MTT_SMOOTHER_H

#include "tracker/mtt/multitarget.h"

/* Most frames of lag. */
#define BST_SMOOTHER_MAX_LAG 60

typedef struct bst_smoother bst_smoother;

/* A frame of the multi-target tracker. */
typedef struct bst_smoother_frame {
    int64_t exposure_id, tick;
    double seconds;
    int64_t target_id; /* track of interest, 0: none */
} bst_smoother_frame;

/* State of a track in an earlier frame. */
typedef struct bst_smoothed {
    int64_t id;
    bst_track_status status; /* in that frame */
    int later_frames;        /* frames after it that contribute, 0 to the lag */
    bst_sky_state state;
} bst_smoothed;

/* Creates a smoother for as many tracks at the same time, and a lag of 1 to BST_SMOOTHER_MAX_LAG
 * frames. The caller frees it.
 *
 * Errors:    BST_ERR_MEMORY */
bst_status bst_smoother_create(bst_ctx *ctx, int tracks, int lag_frames,
                               bst_smoother **out) BST_MUST_CHECK;
/* Frees a smoother; NULL is allowed. */
void bst_smoother_free(bst_smoother *smoother);

/* Saves or restores the smoother. What one of another lag saved, before a change during a run, is
 * dropped: the smoother begins anew.
 *
 * Given:     smoother  NULL: no smoothing
 *            tracks    room of the smoother, or of the one that was saved
 * Errors:    BST_ERR_FORMAT for damaged tracks, BST_ERR_MEMORY */
bst_status bst_smoother_archive(bst_smoother *smoother, int tracks,
                                bst_archive *archive) BST_MUST_CHECK;

/* Adds the state of the multi-target tracker after a frame; its parameter keep_priors is set.
 *
 * Notes:     a track is a chain of frames. It ends when the track is deleted or becomes stationary,
 *            and also where a track takes the identity of an earlier one: the gap before is not
 *            bridged. Frames without a detection are part of the chain. */
void bst_smoother_step(bst_smoother *smoother, const bst_smoother_frame *frame, const bst_mtt *mtt);

/* Smoothed states of the frame that lies the lag before the latest one: of all tracks that have
 * been confirmed by now, that of interest first, then by ascending identity.
 *
 * Returned:  false in the first frames, which have no such frame
 *            *frame   that frame
 *            *states  [*count] valid until the next step
 *            *lost    tracks of the latest frame that had no room */
bool bst_smoother_get(const bst_smoother *smoother, bst_smoother_frame *frame,
                      const bst_smoothed **states, int *count, int *lost);

#endif
