/* Records sightings of a run: tables passes and sightings, and their summary. */
#ifndef BST_RUN_RUN_SIGHTINGS_H
#define BST_RUN_RUN_SIGHTINGS_H

#include "boresight/archive.h"
#include "sim/engine/recorder/recorder.h"
#include "sim/eval/sightings.h"
#include "sim/io/run_store.h"

struct cJSON;

typedef struct bst_run_sightings bst_run_sightings;

/* Creates the tables in `store`, which must outlive them; NULL: figures only. *out NULL: sightings
 * are disabled, or there are no objects. */
bst_status bst_run_sightings_create(bst_ctx *ctx, const bst_world *world,
                                    const bst_recorder_config *record, int64_t tick_rate_hz,
                                    bst_run *store, bst_run_sightings **out) BST_MUST_CHECK;
void bst_run_sightings_free(bst_run_sightings *sightings); /* NULL allowed */

/* Saves or restores what has been seen. NULL sightings: nothing.
 *
 * Errors:    BST_ERR_MEMORY */
bst_status bst_run_sightings_archive(bst_run_sightings *sightings,
                                     bst_archive *archive) BST_MUST_CHECK;

/* Takes a message; `sensor`: index over all observers. NULL sightings: nothing. */
bst_status bst_run_sightings_message(bst_ctx *ctx, bst_run_sightings *sightings, int sensor,
                                     const char *channel, const void *payload) BST_MUST_CHECK;
/* Writes the last rows at the end of the simulated time. */
bst_status bst_run_sightings_finish(bst_ctx *ctx, bst_run_sightings *sightings,
                                    double end_s) BST_MUST_CHECK;

/* Summary, after bst_run_sightings_finish; false and all zero: none. */
bool bst_run_sightings_figures(const bst_run_sightings *sightings, bst_sightings_figures *out);

/* Adds "sightings" to the manifest. */
void bst_run_sightings_add(const bst_run_sightings *sightings, struct cJSON *manifest);
/* Prints the summary of all objects to stdout, if there are at least two. */
void bst_run_sightings_print(const bst_run_sightings *sightings);

#endif
