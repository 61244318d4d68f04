/* Runs a scenario from start to end with evaluation against the truth, and records it into a folder
 * if requested. */
#ifndef BST_RUN_RUN_SCENARIO_H
#define BST_RUN_RUN_SCENARIO_H

#include "sim/engine/simulation.h"
#include "sim/eval/run_metrics.h"
#include "sim/eval/sightings.h"
#include "sim/run/run_custody.h"
#include "sim/run/run_saving.h"

/* What happens next between two steps. */
typedef enum bst_run_action {
    BST_RUN_ADVANCE = 0, /* step to `until_tick` */
    BST_RUN_SAVE,        /* save the state, then ask again */
    BST_RUN_PART,        /* save the state and end with BST_ERR_INTERRUPTED: another part follows */
    BST_RUN_END,         /* the run is complete */
} bst_run_action;

/* Steers a run from outside, and sees its messages. Any function may be NULL. */
typedef struct bst_run_steering {
    void *user; /* first argument of the functions */
    /* Called between two steps by the thread that steps; it may wait. Modules due before `tick`
     * have stepped. *until_tick: later than `tick`. */
    bst_run_action (*next)(void *user, int64_t tick, int64_t *until_tick);
    /* A state was saved; the function owns `bytes` [size] (free). */
    void (*saved)(void *user, int64_t tick, void *bytes, size_t size);
    /* A message was published that the run uses; as bst_sim_observer. Frames have their pixels. */
    bst_status (*message)(void *user, bst_ctx *ctx, int sensor, const char *channel,
                          const void *payload, int64_t tick);
    bool stops; /* `next` looks for stop requests: they do not interrupt a step */
} bst_run_steering;

typedef struct bst_run_request {
    const char *out;              /* output folder; NULL: nothing is written */
    bool overwrite;               /* replace an existing run */
    bool force;                   /* start even if the disk is too small for the frames */
    bool progress;                /* progress display on standard error */
    bool print;                   /* table of results on standard output */
    bool no_pictures;             /* quicklook.png and pointing.png are not written */
    bool metrics;                 /* without folder: compute sightings and custody too */
    double most_s;                /* > 0, without folder: limit of stepping time */
    const bst_run_saving *saving; /* NULL: the whole run, without saved states */
    bst_run_restored *restored;   /* state that the simulation has; NULL: the start */
    const struct cJSON *echo;     /* scenario to write in place of the run's own; NULL: its own */
    const bst_scenario_change *changes; /* [change_count] made at the start: recorded as events */
    int change_count;
    const bst_run_steering *steering; /* NULL: none */
    bool *part_ended;                 /* returned if not NULL: ended by BST_RUN_PART */
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
    bool has_custody;                /* it is enabled; likewise */
    bst_custody_figures custody;
} bst_run_report;

/* Runs a simulation of the scenario that has not been stepped since it was created or restored.
 * BST_ERR_INTERRUPTED: stop requested; the folder then keeps its .partial name, as after an error.
 * `report`: NULL, or filled with BST_OK. */
bst_status bst_run_scenario(bst_ctx *ctx, const bst_scenario *scenario, bst_simulation *sim,
                            const bst_run_request *request, bst_run_report *report) BST_MUST_CHECK;

#endif
