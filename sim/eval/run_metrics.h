/* What tables of many runs tell of one sensor: custody, detections, accuracy of the target's track,
 * false tracks; beside sim/eval/loop_summary.h, from the same messages. */
#ifndef BST_EVAL_RUN_METRICS_H
#define BST_EVAL_RUN_METRICS_H

#include "sim/core/messages.h"
#include "sim/eval/loop_summary.h"
#include "sim/world/world.h"

typedef struct bst_run_metrics bst_run_metrics;

typedef struct bst_run_metric_figures {
    int64_t frames;
    int64_t visible_frames;  /* the target lit, not behind the Earth */
    int64_t in_field_frames; /* of them: in the field */
    int64_t detected_frames; /* of those: with a detection on the target */
    int64_t in_track_frames; /* visible, and in confirmed track */
    int64_t breaks;          /* times that a confirmed track of the visible target was lost */
    bool in_track_at_end;
    int64_t detections; /* all */
    /* the target's confirmed track against the truth, angle in pixels; NAN without any */
    double track_rms_px, track_median_px, track_p95_px;
    double pointing_median_px; /* of the frames that bst_loop_figures takes */
    /* confirmed tracks, by identity; false: near no object in most of its frames */
    int64_t tracks, false_tracks;
    int64_t objects_seen;    /* objects that were in the field */
    int64_t objects_tracked; /* of them: ever near a confirmed track */
} bst_run_metric_figures;

/* target_object: as of bst_loop_summary_create. The world must outlive the metrics. */
bst_status bst_run_metrics_create(bst_ctx *ctx, const bst_world *world, int observer, int sensor,
                                  int target_object, bst_run_metrics **out) BST_MUST_CHECK;
void bst_run_metrics_free(bst_run_metrics *metrics);

/* Messages as they are published, and verdicts of the loop summary on frames. */
bst_status bst_run_metrics_truth(bst_ctx *ctx, bst_run_metrics *metrics,
                                 const bst_truth *truth) BST_MUST_CHECK;
void bst_run_metrics_detections(bst_run_metrics *metrics, const bst_detections *detections);
bst_status bst_run_metrics_tracks(bst_ctx *ctx, bst_run_metrics *metrics,
                                  const bst_tracks *tracks) BST_MUST_CHECK;
void bst_run_metrics_frame(bst_run_metrics *metrics, const bst_loop_frame *frame);

void bst_run_metrics_figures(const bst_run_metrics *metrics, bst_run_metric_figures *out);

#endif
