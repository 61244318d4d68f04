/* Custody of the catalogue in a run: tables custody and custody_tracks, and their summary. */
#ifndef BST_RUN_RUN_CUSTODY_H
#define BST_RUN_RUN_CUSTODY_H

#include "boresight/archive.h"
#include "boresight/messages.h"
#include "sim/engine/scenario/scenario.h"
#include "sim/io/run_store.h"
#include "sim/world/world.h"

struct cJSON;

/* Filters of all objects on element sets, and of new objects whose orbits tracks without an object
 * determine (run_new_objects.h); each confirmed track gives one update, when the tracker
 * no longer lists it. A track that the tracker resumes after that is not used again. The truth is
 * used for the error that the catalogue begins with, which it lacks, and for scoring. Observers are
 * where they are in truth: navigation errors are left out. */
typedef struct bst_run_custody bst_run_custody;

typedef struct bst_custody_figures {
    int64_t objects;      /* with a filter and a position at the end */
    int64_t updated;      /* by at least one track */
    int64_t in_custody;   /* standard deviation of the position within record/custody_within_m */
    int64_t tracks;       /* confirmed tracks with enough detections */
    int64_t correlated;   /* with an object */
    int64_t ambiguous;    /* with more than one, or with none beside the light of one: not used */
    int64_t uncorrelated; /* with none, or the filter has no state there */
    int64_t unknown;      /* objects that the catalogue lacks, by record/custody_unknown_share */
    int64_t candidates, candidates_confirmed, candidates_wrong; /* bst_candidate_figures */
    /* orbits of candidates that became objects; tracks that updated them after that, which are
     * correlated ones too; new objects of tracks of different objects or of none, or of an object
     * that is known; candidates whose orbit was that of one known object: a catalogued one took it
     */
    int64_t new_objects, new_tracks, new_wrong, new_matched;
    double new_sigma_median_m, new_nees_mean; /* at the end; NAN: none */
    int64_t cross_tags;                 /* correlated with another object than that of the truth */
    double age_mean_s;                  /* since the last update, of updated objects; NAN: none */
    double sigma_median_m, sigma_p90_m; /* of the position at the end, of all objects */
    double sigma_updated_median_m;      /* of updated objects; NAN: none */
    double nees_mean;                   /* of updated objects at the end; NAN: none */
    double nees_low, nees_high; /* within which the mean is with probability 0.95, if consistent */
} bst_custody_figures;

/* Creates the filters, and the tables in `store`, which must outlive them; NULL: figures only.
 *
 * Given:     scenario  its seed and run, with each object's catalogue number (its name where that
 *                      is 0), key the errors of the catalogue; further its record and tick rate
 * Returned:  *out  NULL: custody is disabled
 * Errors:    BST_ERR_CONFIG for a world without an object on an element set */
bst_status bst_run_custody_create(bst_ctx *ctx, const bst_world *world,
                                  const bst_scenario *scenario, bst_run *store,
                                  bst_run_custody **out) BST_MUST_CHECK;
void bst_run_custody_free(bst_run_custody *custody); /* NULL allowed */

/* Saves or restores the filters, the tracks that have not ended and the ids of those used. Objects
 * on another element set than in the saved state start anew. NULL custody: nothing.
 *
 * Errors:    BST_ERR_MEMORY, BST_ERR_FORMAT */
bst_status bst_run_custody_archive(bst_run_custody *custody, bst_archive *archive) BST_MUST_CHECK;

/* Takes the detections of a frame, whose centroids the tracks of this frame, which come later,
 * refer to. NULL custody: nothing. Errors: BST_ERR_MEMORY */
bst_status bst_run_custody_detections(bst_ctx *ctx, bst_run_custody *custody, int sensor,
                                      const bst_detections *detections) BST_MUST_CHECK;
/* Takes the tracks of a frame; `sensor`: index over all observers. NULL custody: nothing. */
bst_status bst_run_custody_tracks(bst_ctx *ctx, bst_run_custody *custody, int sensor,
                                  const bst_tracks *tracks) BST_MUST_CHECK;
/* Ends all tracks and writes the table custody. */
bst_status bst_run_custody_finish(bst_ctx *ctx, bst_run_custody *custody,
                                  double end_s) BST_MUST_CHECK;

/* Figures after bst_run_custody_finish; false and all zero: none. */
bool bst_run_custody_figures(const bst_run_custody *custody, bst_custody_figures *out);
/* Adds "custody" to the manifest. */
void bst_run_custody_add(const bst_run_custody *custody, struct cJSON *manifest);
/* Prints the figures to stdout. */
void bst_run_custody_print(const bst_run_custody *custody);

#endif
