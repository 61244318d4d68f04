/* boresight study: kinds of runs, and what its parts share. */
#ifndef BST_STUDY_KINDS_STUDY_KINDS_H
#define BST_STUDY_KINDS_STUDY_KINDS_H

#include "sim/catalogue/stars.h"
#include "sim/engine/simulation.h"
#include "sim/studies/executor.h"
#include "sim/studies/kind.h"

extern const bst_study_kind bst_study_loop_kind, bst_study_pd_kind, bst_study_cubes_kind;
/* The kind of a bst_study_kind_id. */
const bst_study_kind *bst_study_kind_of(int kind);

/* What a worker keeps from run to run: the device, once a run needed one, and the latest star
 * catalogue, whose checksum takes as long to verify as some runs do. */
typedef struct bst_study_warm {
    int threads;
    char selector[128]; /* of the device; "": the default */
    struct bst_device *device;
    bst_stars *stars;
    char catalogue[512];
} bst_study_warm;

/* Prints what the study will do: runs, time, disk. Two runs are tried, in a process and a folder of
 * their own. `out`: where the results would go. */
void bst_study_print_plan(const bst_study *study, const bst_study_kind *kind, int workers,
                          const char *device, const char *out);

/* As `check` of bst_study_kind, of the scenario. `user`: a bst_study_plugins that takes what the
 * scenario uses, or NULL. */
bst_status bst_study_check_scenario(bst_ctx *ctx, void *user, const bst_study_run *run, bool deep);

/* Creates a worker that keeps device and star catalogue open from run to run.
 *
 * Given:     place  device and threads of the worker
 * Returned:  *worker  to be freed with bst_study_warm_close
 * Errors:    BST_ERR_MEMORY */
bst_status bst_study_warm_open(bst_ctx *ctx, void *user, const bst_study_worker_place *place,
                               void **worker);
/* Frees a worker with its device and catalogue. */
void bst_study_warm_close(void *worker);
/* True if a signal has asked the program to stop; `user` is not used. */
bool bst_study_stop_requested(void *user);
/* Opens the worker's device unless it is open. */
bst_status bst_study_warm_device(bst_ctx *ctx, bst_study_warm *warm) BST_MUST_CHECK;
/* Has the scenario's world use the worker's star catalogue. */
void bst_study_warm_stars(bst_study_warm *warm, bst_scenario *scenario);
/* Makes a simulation of a scenario on the worker's device. */
bst_status bst_study_simulation(bst_ctx *ctx, bst_study_warm *warm, bst_scenario *scenario,
                                bst_simulation **out) BST_MUST_CHECK;
/* The scenario with every default, as text. */
bst_status bst_study_print_scenario(bst_ctx *ctx, const bst_scenario *scenario,
                                    FILE *stream) BST_MUST_CHECK;

/* Slurm as executor of the study in the folder `out`; `site_file` NULL: the user's own, if any;
 * `device`: for its tasks, "" for the default. */
bst_status bst_study_slurm(bst_ctx *ctx, const char *site_file, const char *device, const char *out,
                           bst_executor *executor) BST_MUST_CHECK;

#endif
