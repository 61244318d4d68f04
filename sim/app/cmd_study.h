/* boresight study: kinds of runs, and what its parts share. */
#ifndef BST_APP_CMD_STUDY_H
#define BST_APP_CMD_STUDY_H

#include "sim/engine/simulation.h"
#include "sim/studies/executor.h"
#include "sim/studies/kind.h"

/* The kinds, in the order of bst_study_kind_id. */
extern const bst_study_kind bst_app_study_loop;
const bst_study_kind *bst_app_study_kind(int kind);

/* What a worker keeps from run to run: the device, once a run needed one. */
typedef struct bst_study_warm {
    int threads;
    struct bst_device *device;
} bst_study_warm;

/* As `check` of bst_study_kind, of the scenario. */
bst_status bst_study_check_scenario(bst_ctx *ctx, void *user, const bst_study_run *run, bool deep);
bst_status bst_study_warm_open(bst_ctx *ctx, void *user, int threads, void **worker);
void bst_study_warm_close(void *worker);
bool bst_study_stop_requested(void *user);
/* Makes a simulation of a scenario on the worker's device. */
bst_status bst_study_simulation(bst_ctx *ctx, bst_study_warm *warm, const bst_scenario *scenario,
                                bst_simulation **out) BST_MUST_CHECK;
/* The scenario with every default, as text. */
bst_status bst_study_print_scenario(bst_ctx *ctx, const bst_scenario *scenario,
                                    FILE *stream) BST_MUST_CHECK;

/* Slurm as executor of the study in the folder `out`; `site_file` NULL: the user's own, if any. */
bst_status bst_app_study_slurm(bst_ctx *ctx, const char *site_file, const char *out,
                               bst_executor *executor) BST_MUST_CHECK;

#endif
