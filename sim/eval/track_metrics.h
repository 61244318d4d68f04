/* How well a tracker kept several objects: coverage, time to confirm, breaks, purity, false tracks.
 */
#ifndef BST_EVAL_TRACK_METRICS_H
#define BST_EVAL_TRACK_METRICS_H

#include <stdbool.h>
#include <stdint.h>

#include "boresight/status.h"
#include "boresight/vec.h"

typedef struct bst_track_metrics bst_track_metrics;

typedef struct bst_track_figures {
    int64_t frames;
    double hours;             /* from the first frame to the last */
    double gospa_rms;         /* rad; cutoff as given at creation, order 2 */
    double coverage;          /* frames in which visible objects had a track, over visible frames */
    double time_to_confirm_s; /* mean over the objects that ever had one, since first visible */
    int objects_seen, objects_tracked; /* ever visible; ever with a track */
    int breaks;                        /* an object had a track and later one of another identity */
    double purity; /* share of a track's paired frames that went to the object it had most often,
                      over all tracks, weighted by frames; NAN without any */
    int tracks,
        false_tracks; /* identities; those that were nowhere near an object in most frames */
    double false_tracks_per_hour;
} bst_track_figures;

/* `objects` true objects; room for max_tracks identities in all, of which at most max_at_once in
 * one frame. A pair is nearer than cutoff_rad. The caller frees. */
bst_status bst_track_metrics_create(bst_ctx *ctx, int objects, int max_tracks, int max_at_once,
                                    double cutoff_rad, bst_track_metrics **out) BST_MUST_CHECK;
/* Frees the metrics of tracks; NULL is allowed. */
void bst_track_metrics_free(bst_track_metrics *metrics);

/* One frame, later than the one before: true directions (unit) of all objects with who is visible,
 * and the confirmed tracks. Objects and tracks are paired by bst_gospa. BST_ERR_ARGUMENT when a
 * frame has too many tracks or the table of identities is full. */
bst_status bst_track_metrics_frame(bst_ctx *ctx, bst_track_metrics *metrics, double seconds,
                                   const bst_vec3 *truth, const bool *visible,
                                   const int64_t *track_ids, const bst_vec3 *track_directions,
                                   int tracks) BST_MUST_CHECK;

/* Computes the figures of tracks over all frames so far; NAN without frames. */
void bst_track_metrics_figures(const bst_track_metrics *metrics, bst_track_figures *out);

#endif
