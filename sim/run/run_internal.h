/* A run in progress, shared by run_scenario.c (stepping and recording), run_execution.c
 * (figures), run_manifest.c and run_saving.c (saved states). */
#ifndef BST_RUN_RUN_INTERNAL_H
#define BST_RUN_RUN_INTERNAL_H

#include <pthread.h>

#include "sim/engine/recorder/recorder.h"
#include "sim/run/run_custody.h"
#include "sim/run/run_pictures.h"
#include "sim/run/run_saving.h"
#include "sim/run/run_scenario.h"
#include "sim/run/run_sightings.h"
#include "sim/run/run_wall_clock.h"
#include "sim/run/run_watched.h"

enum { BST_RUN_WATCHED_CHANNELS = 32 };

/* A sensor with its evaluation and pictures. */
typedef struct bst_run_sensor_watch {
    char scope[160];
    int recorder_index;
    bst_run_watched channels[BST_RUN_WATCHED_CHANNELS];
    int channel_count;
    bst_loop_summary *summary;
    int target; /* object of its cue, -1: none */
    bst_run_metrics *metrics;
    bst_run_pictures *pictures; /* of the first sensor of a recorded run; else NULL */
} bst_run_sensor_watch;

typedef struct bst_run_execution {
    bst_ctx *ctx;
    bst_ctx hooks;           /* for on_message and on_event, which another thread may call */
    pthread_mutex_t summing; /* protects the summaries during the run */
    const bst_scenario *scenario;
    bst_simulation *sim;
    bst_run *store; /* NULL: nothing is recorded */
    bst_recorder *recorder;
    bst_run_sensor_watch *sensors;
    int sensor_count;
    int64_t begin_tick, end_tick; /* of the record */
    int64_t start_tick;           /* of this process: that of the state from which it resumed */
    int64_t save_ticks;           /* between saved states; 0: none is saved */
    double most_s;                /* limit of stepping time; 0: none */
    bool cut;                     /* the limit was reached */
    const bst_run_request *request;
    const bst_run_steering *steering; /* NULL: none */
    bool part_ended;                  /* by BST_RUN_PART */
    bst_run_sightings *sightings;     /* NULL: not requested */
    bst_run_custody *custody;         /* NULL: not requested */
    bst_run_wall_clock *wall_clock;   /* NULL: nothing is recorded */
    bool progress;
    double earlier_s;      /* wall time of stepping before start_tick, since begin_tick */
    double started, shown; /* wall seconds */
} bst_run_execution;

/* Copies the figures of a sensor. */
void bst_run_get_figures(const bst_run_sensor_watch *sensor, bst_run_sensor_figures *out);

/* Wall time of stepping since begin_tick, s. */
double bst_run_wall_s(const bst_run_execution *run);
/* Time of the end of the last step, since the epoch, s. */
double bst_run_seconds(const bst_run_execution *run);
/* Time that was simulated in this wall time, s. */
double bst_run_simulated_s(const bst_run_execution *run);
/* What may happen to the pixels of a sensor's frames. */
bst_run_pixels bst_run_pixels_of(const bst_run_execution *run, const bst_run_sensor_watch *sensor);

/* Writes the manifest.
 *
 * Given:     wall   wall time of stepping, s
 *            ended  status of the run
 *            why    message of a failed run; else NULL */
bst_status bst_run_write_manifest(const bst_run_execution *run, double wall, bst_status ended,
                                  const char *why) BST_MUST_CHECK;

/* Sets the ticks at which the run begins, ends and saves.
 *
 * Errors:    BST_ERR_ARGUMENT with the option */
bst_status bst_run_plan(bst_run_execution *run, const bst_run_request *request) BST_MUST_CHECK;
/* True if the run goes on in the folder of an interrupted run. */
bool bst_run_resumes(const bst_run_request *request);
/* Restores the recording of an interrupted run into its new recorder, evaluation and pictures.
 *
 * Errors:    BST_ERR_STATE: another "record" block; those of the parts */
bst_status bst_run_resume(bst_run_execution *run, bst_run_restored *restored) BST_MUST_CHECK;
/* Steps the simulation to the end of the run. States are saved on the way, and at an interrupt. */
bst_status bst_run_advance(bst_run_execution *run) BST_MUST_CHECK;

#endif
