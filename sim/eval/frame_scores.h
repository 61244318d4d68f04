/* Scores of all confirmed tracks of a sensor's frames against all objects in its field: GOSPA,
 * OSPA(2), purity, changes of identity, ghosts (docs/reference/summary.md). */
#ifndef BST_EVAL_FRAME_SCORES_H
#define BST_EVAL_FRAME_SCORES_H

#include "boresight/camera.h"
#include "boresight/light.h"
#include "boresight/messages.h"
#include "sim/eval/track_metrics.h"

typedef struct bst_frame_scores bst_frame_scores;

/* An object in the field at mid-exposure. */
typedef struct bst_scored_object {
    int64_t number;     /* in the world */
    bst_vec3 direction; /* geometric, with light time */
    bool counts;        /* it is as bright as the detection threshold, and lit */
} bst_scored_object;

/* Truth of a frame. */
typedef struct bst_scored_frame {
    const bst_camera *camera;
    double mid_tick;
    bst_quat q_cam_from_gcrf; /* mid-exposure */
    bst_light light;
    const bst_scored_object *objects; /* [count] */
    int count;
} bst_scored_frame;

/* Creates the scores for objects 0 to objects - 1.
 *
 * Given:     cutoff_rad  distance from which on a track and an object are no pair
 * Errors:    BST_ERR_ARGUMENT, BST_ERR_MEMORY
 * Ownership: free with bst_frame_scores_free */
bst_status bst_frame_scores_create(bst_ctx *ctx, int objects, double cutoff_rad,
                                   bst_frame_scores **out) BST_MUST_CHECK;
/* Frees the scores; NULL is allowed. */
void bst_frame_scores_free(bst_frame_scores *scores);

/* Saves or restores the scores.
 *
 * Errors:    BST_ERR_MEMORY */
bst_status bst_frame_scores_archive(bst_frame_scores *scores, bst_archive *archive) BST_MUST_CHECK;

/* Adds the tracks of a frame.
 *
 * Notes:     tracks count while they are confirmed or coasting, not predicted to be hidden, and in
 *            the field; a track that is near an object that does not count, and near none that
 *            does, is left out. Frames without objects and tracks that count are left out.
 * Errors:    BST_ERR_ARGUMENT, BST_ERR_MEMORY */
bst_status bst_frame_scores_add(bst_ctx *ctx, bst_frame_scores *scores,
                                const bst_scored_frame *frame,
                                const bst_tracks *tracks) BST_MUST_CHECK;

/* Figures so far; times in ticks. */
void bst_frame_scores_figures(const bst_frame_scores *scores, bst_track_figures *out);

#endif
