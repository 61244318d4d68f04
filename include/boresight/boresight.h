/* The simulator as a library: a model is a scenario that has been read and checked, a sim is one
 * run of it. A program that includes this header needs no other.
 *
 *   bst_ctx ctx;
 *   bst_model *model = NULL;
 *   bst_sim *sim = NULL;
 *   bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
 *   if (bst_model_load(&ctx, "scenario.json", NULL, 0, &model) != BST_OK ||
 *       bst_sim_create(&ctx, model, NULL, &sim) != BST_OK ||
 *       bst_sim_run_until(&ctx, sim, 10.0) != BST_OK) {
 *       fprintf(stderr, "%s\n", ctx.message);
 *   }
 *   bst_sim_free(sim);
 *   bst_model_free(model);
 */
#ifndef BORESIGHT_H
#define BORESIGHT_H

#include <stdbool.h>
#include <stdint.h>

#include "boresight/messages.h"
#include "boresight/status.h"
#include "boresight/vec.h"
#include "boresight/version.h"

#pragma GCC visibility push(default)

typedef struct bst_model bst_model;
typedef struct bst_sim bst_sim;

/* Reads and checks a scenario.
 *
 * Given:     path         scenario file (JSON); may extend another file
 *            assignments  [count] overrides "POINTER=VALUE" ("/record/frames=none"), as of --set;
 *                         NULL with count 0
 *            count        number of assignments, 0 or more
 * Returned:  *out  the model; NULL on error
 * Errors:    BST_ERR_ARGUMENT, BST_ERR_IO, BST_ERR_FORMAT, BST_ERR_CONFIG, BST_ERR_MEMORY; the
 *            message names file, key and allowed values
 * Ownership: free *out with bst_model_free, after all of its sims
 * Notes:     loads the plug-ins of the scenario into the process. A model is constant; several sims
 *            may share it. */
bst_status bst_model_load(bst_ctx *ctx, const char *path, const char *const *assignments, int count,
                          bst_model **out) BST_MUST_CHECK;

/* Frees a model; NULL is allowed. */
void bst_model_free(bst_model *model);

/* Rate of the clock that times all messages, ticks per second (Hz). */
int64_t bst_model_tick_rate_hz(const bst_model *model);
/* Duration of a run as the scenario sets it, s. */
double bst_model_duration_s(const bst_model *model);

/* Options of a run. All zero: the defaults. */
typedef struct bst_sim_options {
    const char *device; /* OpenCL device: part of its name or its number, NULL: default */
    int threads;        /* of the host, 0: all cores */
} bst_sim_options;

/* Callbacks of a run. Any function may be NULL. An error that a function returns ends the run. */
typedef struct bst_sim_observer {
    void *user; /* first argument of the functions */
    /* A message was published on `channel` ("detections") of the sensor `scope`
     * ("observer/sensor"). The payload has the type of its channel (boresight/messages.h) and is
     * borrowed for the call. */
    bst_status (*message)(void *user, const char *scope, const char *channel, const void *payload,
                          int64_t tick);
    /* Something happened in a module ("observer/sensor/module"): a word for its kind, and a text.
     */
    bst_status (*event)(void *user, int64_t tick, const char *instance, const char *kind,
                        const char *text);
    /* Asked about every 20 ms of wall time; true ends the run with BST_ERR_INTERRUPTED. */
    bool (*interrupted)(void *user, int64_t tick);
} bst_sim_observer;

/* Creates a run of a model at time 0. Nothing is written to disk.
 *
 * Given:     model    must outlive the sim
 *            options  NULL: the defaults
 * Returned:  *out  the sim; NULL on error
 * Errors:    BST_ERR_DEVICE, BST_ERR_IO, BST_ERR_CONFIG, BST_ERR_MEMORY, and those of the modules
 * Ownership: free *out with bst_sim_free */
bst_status bst_sim_create(bst_ctx *ctx, const bst_model *model, const bst_sim_options *options,
                          bst_sim **out) BST_MUST_CHECK;

/* Frees a sim; NULL is allowed. */
void bst_sim_free(bst_sim *sim);

/* Sets the observer of a sim; it is called from the next bst_sim_run_until on.
 *
 * Given:     observer  copied; NULL: no observer
 * Notes:     observer->user must stay valid until it is replaced or the sim is freed. */
void bst_sim_observe(bst_sim *sim, const bst_sim_observer *observer);

/* Steps everything that is due before a time.
 *
 * Given:     until_s  seconds since the scenario's epoch; nothing is done if this time has been
 *                     reached
 * Errors:    those of modules and of the observer; BST_ERR_INTERRUPTED; BST_ERR_ARGUMENT if until_s
 *            is not finite or beyond 9e15 ticks
 * Notes:     until_s is rounded up to a tick. */
bst_status bst_sim_run_until(bst_ctx *ctx, bst_sim *sim, double until_s) BST_MUST_CHECK;

/* Time that the sim has reached, seconds since the scenario's epoch. */
double bst_sim_time_s(const bst_sim *sim);

#pragma GCC visibility pop

#endif
