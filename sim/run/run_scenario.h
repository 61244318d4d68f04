/* Runs a scenario from start to end with evaluation against the truth, and records it into a folder
 * if requested. */
#ifndef BST_RUN_RUN_SCENARIO_H
#define BST_RUN_RUN_SCENARIO_H

#include "sim/engine/simulation.h"
#include "sim/eval/run_metrics.h"
#include "sim/eval/sightings.h"
#include "sim/run/run_saving.h"

typedef struct bst_run_request {
    const char *out;              /* output folder; NULL: nothing is written */
    bool overwrite;               /* replace an existing run */
    bool force;                   /* start even if the disk is too small for the frames */
    bool progress;                /* progress display on standard error */
    bool print;                   /* table of results on standard output */
    bool metrics;                 /* without folder: compute sightings too */
    double most_s;                /* > 0, without folder: limit of stepping time */
    const bst_run_saving *saving; /* NULL: the whole run, without saved states */
    bst_run_restored *restored;   /* state that the simulation has; NULL: the start */
} bst_run_request;

typedef struct bst_run_sensor_figures {
    char scope[160]; /* "observer/sensor" */
    bst_loop_figures loop;
    bst_run_metric_figures metrics;
} bst_run_sensor_figures;

typedef struct bst_run_report {
    bst_run_sensor_figures *sensors; /* in the scenario's order; freed by the caller */
    int count;
    double wall_s; /* of stepping */
    double part;   /* fraction of the scenario's duration that was stepped; below 1 after most_s */
    bool has_sightings;              /* there are objects, and sightings are enabled */
    bst_sightings_figures sightings; /* if metrics are requested or there is a folder */
} bst_run_report;

/* Runs a simulation of the scenario that has not been stepped since it was created or restored.
 * BST_ERR_INTERRUPTED: stop requested; the folder then keeps its .partial name, as after an error.
 * `report`: NULL, or filled with BST_OK. */
bst_status bst_run_scenario(bst_ctx *ctx, const bst_scenario *scenario, bst_simulation *sim,
                            const bst_run_request *request, bst_run_report *report) BST_MUST_CHECK;

#endif
