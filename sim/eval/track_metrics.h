/* Metrics of a multi-target tracker: coverage, time to confirm, breaks, purity, false tracks,
 * ghosts, GOSPA, OSPA(2). */
#ifndef BST_EVAL_TRACK_METRICS_H
#define BST_EVAL_TRACK_METRICS_H

#include <stdbool.h>
#include <stdint.h>

#include "boresight/archive.h"
#include "boresight/vec.h"

/* Frames of the window of OSPA(2). */
#define BST_TRACK_WINDOW 10
/* Frames in a row without an object nearby after which a confirmed track is a ghost. */
#define BST_TRACK_GHOST_FRAMES 3

typedef struct bst_track_metrics bst_track_metrics;

typedef struct bst_track_figures {
    int64_t frames;
    double hours;      /* from the first frame to the last */
    double gospa_rms;  /* rad; cutoff as given at creation, order 2 */
    double gospa_mean; /* rad; mean over the frames */
    double ospa2_mean; /* rad; OSPA(2) over BST_TRACK_WINDOW frames, the same cutoff and order */
    double coverage;   /* visible frames with a track over visible frames */
    double time_to_confirm_s;          /* mean over objects that had a track, since first visible */
    int objects_seen, objects_tracked; /* ever visible; ever tracked */
    int breaks;    /* times that a tracked object got a track of another identity */
    double purity; /* fraction of a track's paired frames with its most frequent object, weighted by
                      frames; NAN without any */
    int tracks, false_tracks; /* identities; false: without an object nearby in most frames */
    double false_tracks_per_hour;
    int ghosts; /* tracks without an object for more than BST_TRACK_GHOST_FRAMES frames in a row */
} bst_track_figures;

/* Creates the metrics for true objects 0 to objects - 1. Pairs are nearer than cutoff_rad. The
 * caller frees them. */
bst_status bst_track_metrics_create(bst_ctx *ctx, int objects, double cutoff_rad,
                                    bst_track_metrics **out) BST_MUST_CHECK;
/* Frees the metrics of tracks; NULL is allowed. */
void bst_track_metrics_free(bst_track_metrics *metrics);

/* Saves or restores the metrics.
 *
 * Errors:    BST_ERR_MEMORY */
bst_status bst_track_metrics_archive(bst_track_metrics *metrics,
                                     bst_archive *archive) BST_MUST_CHECK;

/* A frame: the visible objects and the confirmed tracks. */
typedef struct bst_track_frame {
    double seconds;
    const int64_t *objects; /* [visible] numbers of the visible objects, each once */
    const bst_vec3 *truth;  /* [visible] their true directions, unit */
    int visible;
    const int64_t *track_ids;
    const bst_vec3 *track_directions; /* [tracks] unit */
    int tracks;
} bst_track_frame;

/* Adds a frame, later than the previous one. bst_gospa_near pairs objects and tracks.
 *
 * Errors:    BST_ERR_ARGUMENT, BST_ERR_MEMORY */
bst_status bst_track_metrics_frame(bst_ctx *ctx, bst_track_metrics *metrics,
                                   const bst_track_frame *frame) BST_MUST_CHECK;

/* Computes the figures of tracks over all frames so far; NAN without frames. */
void bst_track_metrics_figures(const bst_track_metrics *metrics, bst_track_figures *out);

#endif
