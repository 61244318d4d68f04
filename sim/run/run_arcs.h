/* Arcs of a run's tracks: what each track measured, given when the tracker no longer lists it. */
#ifndef BST_RUN_RUN_ARCS_H
#define BST_RUN_RUN_ARCS_H

#include "boresight/archive.h"
#include "boresight/messages.h"
#include "sim/world/world.h"
#include "tracker/orbit/custody.h"

/* A confirmed track with five detections at least that has ended. */
typedef struct bst_run_arc {
    int64_t id;
    int32_t hits;
    bst_custody_observation state; /* the tracker's, at the last detection */
    /* directions that were measured: each, or in long arcs every second, every fourth, ... Frames
     * without attitude from stars, and centroids of more than 8 frames ago, are left out. */
    int32_t count;
    bst_od_observation directions[BST_CUSTODY_DIRECTIONS];
    bst_mat3 gcrf_from_teme[2]; /* at the first and the last direction */
} bst_run_arc;

typedef bst_status (*bst_run_arc_fn)(void *user, bst_ctx *ctx, int sensor, const bst_run_arc *arc);

/* Arcs of the tracks of all sensors. Each track gives one, even if the tracker resumes it later.
 * Observers are where they are in truth: navigation errors are left out. */
typedef struct bst_run_arcs bst_run_arcs;

/* Creates arcs for the sensors of a world, which must outlive them. Errors: BST_ERR_MEMORY, and
 * those of bst_knowledge_create */
bst_status bst_run_arcs_create(bst_ctx *ctx, const bst_world *world, double tick_rate_hz,
                               bst_run_arcs **out) BST_MUST_CHECK;
void bst_run_arcs_free(bst_run_arcs *arcs); /* NULL allowed */

/* Takes the detections of a frame, to which its tracks, which come later, refer; `sensor`: index
 * over all observers. Errors: BST_ERR_MEMORY */
bst_status bst_run_arcs_detections(bst_ctx *ctx, bst_run_arcs *arcs, int sensor,
                                   const bst_detections *detections) BST_MUST_CHECK;
/* Takes the tracks of a frame, and gives the arcs of those that are listed no longer. Of a sensor
 * 64 tracks at a time are followed, confirmed ones first. */
bst_status bst_run_arcs_tracks(bst_ctx *ctx, bst_run_arcs *arcs, int sensor,
                               const bst_tracks *tracks, bst_run_arc_fn take,
                               void *user) BST_MUST_CHECK;
/* Gives the arcs of all tracks, at the end of a run. */
bst_status bst_run_arcs_finish(bst_ctx *ctx, bst_run_arcs *arcs, bst_run_arc_fn take,
                               void *user) BST_MUST_CHECK;

/* Saves or restores the tracks that have not ended and the ids of those that have. Errors:
 * BST_ERR_MEMORY; BST_ERR_FORMAT: the saved state lacks a part of them */
bst_status bst_run_arcs_archive(bst_run_arcs *arcs, bst_archive *archive) BST_MUST_CHECK;

#endif
