/* Candidate objects of a run: orbits of tracks that no object of the catalogue explains. */
#ifndef BST_RUN_RUN_CANDIDATES_H
#define BST_RUN_RUN_CANDIDATES_H

#include "boresight/archive.h"
#include "sim/io/run_store.h"
#include "sim/run/run_arcs.h"
#include "sim/run/run_new_objects.h"
#include "sim/world/world.h"

/* Arcs without an object are linked (bst_od_link_arc); the truth is used for scoring only. */
typedef struct bst_run_candidates bst_run_candidates;

typedef struct bst_candidate_figures {
    int64_t candidates; /* orbits of two tracks or more */
    int64_t confirmed;  /* of three or more */
    int64_t wrong;      /* of tracks of different objects, or of none */
} bst_candidate_figures;

/* Creates the store, and the table in `store`, which must outlive it; NULL: figures only. Errors:
 * BST_ERR_MEMORY, those of bst_sky_clock_create and of the table */
bst_status bst_run_candidates_create(bst_ctx *ctx, const bst_world *world, bst_run *store,
                                     bst_run_candidates **out) BST_MUST_CHECK;
void bst_run_candidates_free(bst_run_candidates *candidates); /* NULL allowed */

/* Takes an arc that belongs to no object that is known, and writes its row.
 *
 * Given:     true_object  that it belongs to; -1: none
 * Returned:  *made        the new object if the candidate has three tracks or more, and an orbit
 *                         that they determine (batch least squares with a factor on the variances;
 *                         bst_od_solution.bend below 1); the candidate is then removed. Its
 *                         noise is 0. score.updates 0: none */
bst_status bst_run_candidates_take(bst_ctx *ctx, bst_run_candidates *candidates, int sensor,
                                   const bst_run_arc *arc, int true_object,
                                   bst_run_new_object *made) BST_MUST_CHECK;

/* Figures so far. */
bst_candidate_figures bst_run_candidates_figures(const bst_run_candidates *candidates);

/* Saves or restores arcs, orbits and figures. Errors: BST_ERR_FORMAT, also for an object of the
 * truth that the world lacks */
bst_status bst_run_candidates_archive(bst_run_candidates *candidates, int world_objects,
                                      bst_archive *archive) BST_MUST_CHECK;

#endif
