/* A scenario run from its start to its end, judged against the truth, written to a folder or not.
 */
#ifndef BST_RUN_RUN_SCENARIO_H
#define BST_RUN_RUN_SCENARIO_H

#include "sim/engine/simulation.h"
#include "sim/eval/run_metrics.h"
#include "sim/eval/sightings.h"

typedef struct bst_run_request {
    const char *out; /* folder of the results; NULL: nothing is written */
    bool overwrite;  /* replace an earlier run there */
    bool force;      /* start although its frames need more space than is free */
    bool progress;   /* a line on the standard error */
    bool print;      /* the table of results on the standard output */
    bool metrics;    /* without a folder: work out sightings, too */
    double most_s;   /* > 0, without a folder: stepping ends after so much time */
} bst_run_request;

typedef struct bst_run_sensor_figures {
    char scope[160]; /* "observer/sensor" */
    bst_loop_figures loop;
    bst_run_metric_figures metrics;
} bst_run_sensor_figures;

typedef struct bst_run_report {
    bst_run_sensor_figures *sensors; /* in the scenario's order; the caller frees */
    int count;
    double wall_s;      /* of stepping */
    double part;        /* of the scenario's duration that was stepped; below 1 after most_s */
    bool has_sightings; /* there are objects, and the record is to have them */
    bst_sightings_figures sightings; /* with figures asked for, or a folder */
} bst_run_report;

/* Runs a simulation that was made of the scenario and was not stepped yet. BST_ERR_INTERRUPTED when
 * the user asks to stop: then the folder keeps its .partial name, as after an error. `report`:
 * NULL, or filled with BST_OK. */
bst_status bst_run_scenario(bst_ctx *ctx, const bst_scenario *scenario, bst_simulation *sim,
                            const bst_run_request *request, bst_run_report *report) BST_MUST_CHECK;

#endif
