/* Figures of merit of one sensor besides its loop (sim/eval/loop_figures.h): detections, accuracy
 * of the target's track, false tracks. */
#ifndef BST_EVAL_RUN_METRICS_H
#define BST_EVAL_RUN_METRICS_H

#include "boresight/messages.h"
#include "sim/eval/loop_summary.h"
#include "sim/world/world.h"

typedef struct bst_run_metrics bst_run_metrics;

/* Items that a sensor lost for lack of capacity, with numbers of frames. */
typedef struct bst_run_losses {
    int64_t frames;                       /* of the sensor */
    int64_t detections, detection_frames; /* detections beyond the capacity of their message */
    int64_t tracks, track_frames;         /* tracks beyond the capacity */
    int64_t smoothed_tracks, smoothed_track_frames; /* tracks without room in the smoother */
    int64_t identities, identity_frames;            /* tracks and objects left out of comparisons */
    int64_t truth, truth_frames;                    /* sources beyond the capacity */
    int64_t dropped_frames;                         /* lost between camera and image processing */
    int64_t no_stars_frames;    /* processed frames without an identified star */
    int64_t no_attitude_frames; /* frames that the tracker processed without a stellar attitude */
    int64_t earth_frames, moon_frames, sun_frames; /* partly covered by the disc of that body */
} bst_run_losses;

typedef struct bst_run_metric_figures {
    int64_t in_field_frames;  /* visible frames with the target in the field */
    int64_t detected_frames;  /* with a detection within BST_RIGHT_TARGET_PX of the target */
    double detected_fraction; /* detected_frames over in_field_frames; NAN: never in the field */
    int64_t detections;       /* detections of any source */
    /* error of the track of interest (confirmed or coasting) to the target's true direction, px:
     * frames with tracks, and the target in the field and in track; NAN without any */
    int64_t track_frames;
    double track_rms_px, track_median_px, track_p95_px, track_max_px;
    /* the same of its smoothed states (channel tracks_smoothed), as far as there are any, and of
     * the tracker's own in these frames; NAN without any */
    int64_t smoothed_frames;
    double smoothed_rms_px, smoothed_filtered_rms_px;
    /* confirmed tracks by identity; false: no object nearby in most of its frames */
    int64_t tracks, false_tracks;
    /* of all confirmed tracks against all objects in the field (frame_scores.h); NAN without any */
    int64_t scored_frames;
    double gospa_px, ospa2_px; /* cutoff BST_RIGHT_TARGET_PX, order 2; means over scored_frames */
    double purity;
    int64_t id_switches, ghosts;
    int64_t bad_pixels;      /* learned by image processing up to the latest frame */
    int64_t objects_seen;    /* objects that were in the field */
    int64_t objects_tracked; /* ever near a confirmed track */
    bst_run_losses losses;
} bst_run_metric_figures;

/* Creates the metrics of a sensor. target_object: as of bst_loop_summary_create. The world must
 * outlive them. */
bst_status bst_run_metrics_create(bst_ctx *ctx, const bst_world *world, int observer, int sensor,
                                  int target_object, bst_run_metrics **out) BST_MUST_CHECK;
/* Frees the metrics of a run; NULL is allowed. */
void bst_run_metrics_free(bst_run_metrics *metrics);

/* Saves or restores the metrics.
 *
 * Errors:    BST_ERR_MEMORY */
bst_status bst_run_metrics_archive(bst_run_metrics *metrics, bst_archive *archive) BST_MUST_CHECK;

/* Adds the truth of an exposure. Messages come as they are published.
 *
 * Errors:    BST_ERR_MEMORY and those of the world's view */
bst_status bst_run_metrics_truth(bst_ctx *ctx, bst_run_metrics *metrics,
                                 const bst_truth *truth) BST_MUST_CHECK;
/* Counts the detections of a frame and whether the target is among them. */
void bst_run_metrics_detections(bst_run_metrics *metrics, const bst_detections *detections);

/* Pairs the tracks of a frame with the nearest objects and adds their errors.
 *
 * Errors:    BST_ERR_MEMORY */
bst_status bst_run_metrics_tracks(bst_ctx *ctx, bst_run_metrics *metrics,
                                  const bst_tracks *tracks) BST_MUST_CHECK;
/* Adds the error of the smoothed track of interest. */
void bst_run_metrics_smoothed(bst_run_metrics *metrics, const bst_tracks_smoothed *tracks);
/* Counts what comparisons with the catalogue left out. */
void bst_run_metrics_identities(bst_run_metrics *metrics, const bst_track_identities *identities);
/* Counts a frame, evaluated by the loop summary, with the target in the field. */
void bst_run_metrics_frame(bst_run_metrics *metrics, const bst_loop_frame *frame);
/* Changes the true target of the metrics; -1: none. */
void bst_run_metrics_retarget(bst_run_metrics *metrics, int target_object);

/* Computes the metrics of the run so far; NAN where there are no data. */
void bst_run_metrics_figures(const bst_run_metrics *metrics, bst_run_metric_figures *out);

#endif
