/* Kinds of study runs (loop, pd, cubes) for `boresight study`. */
#ifndef BST_STUDY_KINDS_STUDY_KINDS_H
#define BST_STUDY_KINDS_STUDY_KINDS_H

#include "sim/catalogue/stars.h"
#include "sim/engine/simulation.h"
#include "sim/studies/executor.h"
#include "sim/studies/kind.h"

extern const bst_study_kind bst_study_loop_kind, bst_study_pd_kind, bst_study_cubes_kind;
/* The kind of runs with this bst_study_kind_id. */
const bst_study_kind *bst_study_kind_of(int kind);

/* Resources that a worker keeps between runs: OpenCL device and star catalogue, whose verification
 * takes as long as a short run. */
typedef struct bst_study_warm {
    int threads;
    char selector[128]; /* of the device; "": default */
    struct bst_device *device;
    bst_stars *stars;
    char catalogue[512];
} bst_study_warm;

/* Prints the plan of a study: runs, time, disk. It executes two trial runs in a process and folder
 * of their own. `out`: folder of the results. */
void bst_study_print_plan(const bst_study *study, const bst_study_kind *kind, int workers,
                          const char *device, const char *out);

/* Checks the scenario of a run, as `check` of bst_study_kind. `user`: a bst_study_plugins that
 * collects plug-ins, or NULL. */
bst_status bst_study_check_scenario(bst_ctx *ctx, void *user, const bst_study_run *run, bool deep);

/* Creates a worker that keeps device and star catalogue open between runs.
 *
 * Given:     place  device and threads of the worker
 * Returned:  *worker  free it with bst_study_warm_close
 * Errors:    BST_ERR_MEMORY */
bst_status bst_study_warm_open(bst_ctx *ctx, void *user, const bst_study_worker_place *place,
                               void **worker);
/* Frees a worker with its device and catalogue. */
void bst_study_warm_close(void *worker);
/* True if a signal requested a stop of the program; `user` is not used. */
bool bst_study_stop_requested(void *user);
/* Opens the worker's device unless it is open. */
bst_status bst_study_warm_device(bst_ctx *ctx, bst_study_warm *warm) BST_MUST_CHECK;
/* Makes the scenario's world use the worker's open star catalogue. */
void bst_study_warm_stars(bst_study_warm *warm, bst_scenario *scenario);
/* Creates a simulation of a scenario on the worker's device. */
bst_status bst_study_simulation(bst_ctx *ctx, bst_study_warm *warm, bst_scenario *scenario,
                                bst_simulation **out) BST_MUST_CHECK;
/* Prints the scenario with all defaults as JSON. */
bst_status bst_study_print_scenario(bst_ctx *ctx, const bst_scenario *scenario,
                                    FILE *stream) BST_MUST_CHECK;

/* Creates the executor of the scheduler in a file (sim/studies/scheduler.h) for the study in folder
 * `out`. `device`: of its jobs, "": default. */
bst_status bst_study_scheduler(bst_ctx *ctx, const char *file, const char *device, const char *out,
                               bst_executor *executor) BST_MUST_CHECK;

struct bst_slurm_site;
/* Reads a site file of Slurm; `file` NULL: the user's own, or defaults if there is none. Errors of
 * bst_slurm_site_load. */
bst_status bst_study_site_load(bst_ctx *ctx, const char *file,
                               struct bst_slurm_site *out) BST_MUST_CHECK;
/* Creates the Slurm executor of the study in folder `out`. `site_file` NULL: the user's own, if
 * any; `device`: of its tasks, "": default. */
bst_status bst_study_slurm(bst_ctx *ctx, const char *site_file, const char *device, const char *out,
                           bst_executor *executor) BST_MUST_CHECK;

#endif
