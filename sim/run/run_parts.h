/* A run in parts: between two of them the scenario changes, or the run goes back to an earlier
 * state. Each part is a simulation of its own that begins from the state at the end of another one,
 * and goes on in the same folder. */
#ifndef BST_RUN_RUN_PARTS_H
#define BST_RUN_RUN_PARTS_H

#include "sim/cli/load.h"
#include "sim/run/run_scenario.h"

typedef struct bst_run_parts bst_run_parts;

/* Checks the simulation of a scenario before its run begins. */
typedef bst_status (*bst_run_check)(bst_ctx *ctx, const bst_scenario *scenario,
                                    const bst_simulation *simulation);

/* Reads a scenario whose changes are to be made.
 *
 * Given:     path, load  as bst_load_scenario; not kept
 *            check       called once; NULL: nothing is checked
 *            options     of the simulations; device, threads, parallel and pace are used
 * Errors:    those of bst_load_scenario, also for the scenario after each of its changes
 * Ownership: free *out with bst_run_parts_free */
bst_status bst_run_parts_open(bst_ctx *ctx, const char *path, const bst_load_options *load,
                              const bst_simulation_options *options, bst_run_check check,
                              bst_run_parts **out) BST_MUST_CHECK;
/* Frees the scenarios of a run in parts; NULL is allowed. */
void bst_run_parts_free(bst_run_parts *parts);

/* The scenario at time 0, with all changes in its list. It belongs to `parts` and is valid until a
 * change is added or removed. */
const bst_scenario *bst_run_parts_scenario(const bst_run_parts *parts);
/* The scenario's text after the changes up to a tick; free it with cJSON_Delete. NULL: out of
 * memory, or a change that cannot be made. */
struct cJSON *bst_run_parts_document(const bst_run_parts *parts, int64_t tick);

/* Reads the scenario after the changes up to a tick.
 *
 * Errors:    those of bst_load_scenario
 * Ownership: free both results; *document outlives *scenario */
bst_status bst_run_parts_changed(bst_ctx *ctx, const bst_run_parts *parts, int64_t tick,
                                 bst_json **document, bst_scenario *scenario) BST_MUST_CHECK;

/* Adds a change by hand after those up to its time.
 *
 * Given:     tick  the present one of the run
 *            set   "/json/pointer=value"
 * Errors:    BST_ERR_CONFIG, BST_ERR_ARGUMENT and others: the change, or the scenario after it, is
 *            not allowed; then nothing is added */
bst_status bst_run_parts_change(bst_ctx *ctx, bst_run_parts *parts, int64_t tick,
                                const char *set) BST_MUST_CHECK;
/* Removes the changes by hand from number `keep` on; those of the scenario stay.
 *
 * Errors:    BST_ERR_MEMORY and those of bst_load_scenario */
bst_status bst_run_parts_cut(bst_ctx *ctx, bst_run_parts *parts, int keep) BST_MUST_CHECK;

/* Number of changes by hand from number `from` on. */
int bst_run_parts_by_hand(const bst_run_parts *parts, int from);
/* Bounds a step by the next change.
 *
 * Given:     made        changes that are made
 *            until_tick  end of the step
 * Returned:  *until_tick  not later than the next change
 *            true: that change is due, so the part ends here */
bool bst_run_parts_due(const bst_run_parts *parts, int made, int64_t tick, int64_t *until_tick);

/* Where a part begins. */
typedef struct bst_run_part {
    const void *state; /* [size] of bst_run_steering.saved; NULL: time 0 */
    size_t size;
    int64_t tick; /* of the state */
    int made;     /* changes that were made before the state was saved */
    bool ended;   /* returned: by BST_RUN_PART */
} bst_run_part;

/* Runs one part, with all changes up to its first tick.
 *
 * Given:     request  as bst_run_scenario; `restored`, `echo` and `changes` are set here
 * Returned:  status of bst_run_scenario; part->ended
 * Notes:     a state that does not fit the changed scenario is an error before the folder is
 *            touched */
bst_status bst_run_parts_run(bst_ctx *ctx, bst_run_parts *parts, bst_run_part *part,
                             const bst_run_request *request) BST_MUST_CHECK;

/* Runs the scenario with its own changes, in as many parts as they need.
 *
 * Given:     request  as bst_run_scenario; steering->next and `saved` are used here
 * Errors:    those of bst_run_scenario */
bst_status bst_run_parts_all(bst_ctx *ctx, bst_run_parts *parts,
                             const bst_run_request *request) BST_MUST_CHECK;

/* Runs a scenario that is read, with its own changes, as bst_run_parts_all.
 *
 * Given:     json  copied; the rest as bst_run_parts_open
 * Errors:    also BST_ERR_ARGUMENT: request->saving restores or saves a state */
bst_status bst_run_parts_read(bst_ctx *ctx, const bst_json *json,
                              const bst_simulation_options *options, bst_run_check check,
                              const bst_run_request *request) BST_MUST_CHECK;

#endif
