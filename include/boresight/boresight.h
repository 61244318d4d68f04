/* The simulator as a library: a model is a scenario that has been read and checked, with the sky
 * and the device that its runs share; a sim is one run of it, and all that changes. A program that
 * includes this header needs no other.
 *
 *   bst_ctx ctx;
 *   bst_model *model = NULL;
 *   bst_sim *sim = NULL;
 *   bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
 *   if (bst_model_load(&ctx, "scenario.json", NULL, &model) != BST_OK ||
 *       bst_sim_create(&ctx, model, NULL, &sim) != BST_OK ||
 *       bst_sim_run_until(&ctx, sim, 10.0) != BST_OK) {
 *       fprintf(stderr, "%s\n", ctx.message);
 *   }
 *   bst_sim_free(sim);
 *   bst_model_free(model);
 *
 * Threads: any number of threads may use one model; a sim is for one thread at a time. */
#ifndef BORESIGHT_H
#define BORESIGHT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "boresight/camera.h"
#include "boresight/messages.h"
#include "boresight/state.h"
#include "boresight/status.h"
#include "boresight/vec.h"
#include "boresight/version.h"

#pragma GCC visibility push(default)

typedef struct bst_model bst_model;
typedef struct bst_sim bst_sim;

/* ---- model ---- */

/* How a model is loaded. All zero: the defaults. */
typedef struct bst_model_options {
    /* [assignment_count] overrides "POINTER=VALUE" ("/record/frames=none"), as of --set */
    const char *const *assignments;
    int assignment_count;
    const char *text;   /* JSON text of the scenario instead of a file; NULL: the file */
    const char *device; /* OpenCL device: part of its name or its number, NULL: default */
    int threads;        /* of the device's processor, 0: all cores */
    bool no_plugins;    /* refuses scenarios with plug-ins */
} bst_model_options;

/* Reads and checks a scenario.
 *
 * Given:     path     scenario file (JSON); may extend another file. With options->text: the name
 *                     of the text for messages; relative paths start in its folder
 *            options  NULL: the defaults
 * Returned:  *out  the model; NULL on error
 * Errors:    BST_ERR_ARGUMENT, BST_ERR_IO, BST_ERR_FORMAT, BST_ERR_CONFIG, BST_ERR_MEMORY; the
 *            message names file, key and allowed values
 * Ownership: free *out with bst_model_free, after all of its sims
 * Notes:     loads the plug-ins of the scenario into the process. The star catalogue and the device
 *            are opened by the first bst_sim_create or bst_model_prepare. */
bst_status bst_model_load(bst_ctx *ctx, const char *path, const bst_model_options *options,
                          bst_model **out) BST_MUST_CHECK;

/* Opens what the sims of a model share: star catalogue, orbits, device. The first sim does it too.
 *
 * Errors:    BST_ERR_DEVICE, BST_ERR_IO, BST_ERR_CONFIG, BST_ERR_MEMORY */
bst_status bst_model_prepare(bst_ctx *ctx, const bst_model *model) BST_MUST_CHECK;

/* Frees a model; NULL is allowed. */
void bst_model_free(bst_model *model);

/* Name of the scenario; it belongs to the model. */
const char *bst_model_name(const bst_model *model);
/* Epoch of the scenario, ISO 8601, UTC; it belongs to the model. */
const char *bst_model_epoch_utc(const bst_model *model);
/* Rate of the clock that times all messages, ticks per second (Hz). */
int64_t bst_model_tick_rate_hz(const bst_model *model);
/* Duration of a run as the scenario sets it, s. */
double bst_model_duration_s(const bst_model *model);
/* Seed of all random streams, as the scenario sets it. */
uint64_t bst_model_seed(const bst_model *model);
/* Number of the run, as the scenario sets it. */
uint64_t bst_model_run(const bst_model *model);

/* Number of sensors of all observers. */
int bst_model_sensor_count(const bst_model *model);
/* Name "observer/sensor" of a sensor; it belongs to the model.
 *
 * Given:     sensor  0 to one less than the number of sensors
 * Returned:  NULL for any other number */
const char *bst_model_sensor(const bst_model *model, int sensor);
/* True camera of a sensor; it belongs to the model.
 *
 * Given:     sensor  0 to one less than the number of sensors
 * Returned:  NULL before bst_model_prepare, and for any other number */
const bst_camera *bst_model_camera(const bst_model *model, int sensor);

/* The complete scenario as JSON, with defaults filled in.
 *
 * Returned:  *out  text; free it with bst_text_free
 * Errors:    BST_ERR_MEMORY */
bst_status bst_model_scenario(bst_ctx *ctx, const bst_model *model, char **out) BST_MUST_CHECK;
/* Frees a text that a function of this header returned; NULL is allowed. */
void bst_text_free(char *text);

/* ---- sim ---- */

/* Options of a run. All zero: the defaults. */
typedef struct bst_sim_options {
    bool other_run; /* `run` replaces the scenario's number of the run, which keys its noise */
    uint64_t run;
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
 * Ownership: free *out with bst_sim_free
 * Notes:     modules of type "external" take what bst_sim_command gives if the scenario's
 *            "link" has no address; otherwise another program plays them. */
bst_status bst_sim_create(bst_ctx *ctx, const bst_model *model, const bst_sim_options *options,
                          bst_sim **out) BST_MUST_CHECK;

/* Frees a sim; NULL is allowed. */
void bst_sim_free(bst_sim *sim);

/* Sets the observer of a sim; it is called from the next step on.
 *
 * Given:     observer  copied; NULL: no observer
 * Notes:     observer->user must stay valid until it is replaced or the sim is freed. */
void bst_sim_observe(bst_sim *sim, const bst_sim_observer *observer);

/* Steps everything that is due before a time.
 *
 * Given:     until_s  seconds since the scenario's epoch; nothing is done if this time has been
 *                     reached; the scenario's duration is no limit
 * Errors:    those of modules and of the observer; BST_ERR_INTERRUPTED; BST_ERR_ARGUMENT if until_s
 *            is not finite or beyond 9e15 ticks; BST_ERR_STATE after a failed step
 * Notes:     until_s is rounded up to a tick. */
bst_status bst_sim_run_until(bst_ctx *ctx, bst_sim *sim, double until_s) BST_MUST_CHECK;

/* Steps until a message is published, or until a time.
 *
 * Given:     scope    "observer/sensor"; NULL: any sensor
 *            channel  "frame", "exposure", "detections", ...; NULL: the end of the next tick at
 *                     which a module steps
 *            until_s  as bst_sim_run_until
 * Returned:  *arrived  false: until_s was reached first; NULL is allowed
 * Errors:    those of bst_sim_run_until; BST_ERR_NOT_FOUND: no module writes such a channel
 * Notes:     the sim stops right after the step that publishes, before any module reads the
 *            message; the next call goes on within the tick. */
bst_status bst_sim_step(bst_ctx *ctx, bst_sim *sim, const char *scope, const char *channel,
                        double until_s, bool *arrived) BST_MUST_CHECK;

/* Time that the sim has reached, seconds since the scenario's epoch. */
double bst_sim_time_s(const bst_sim *sim);
/* Tick that the sim has reached: modules due at earlier ticks have stepped. */
int64_t bst_sim_tick(const bst_sim *sim);
/* Number of the run, which keys the noise. */
uint64_t bst_sim_run(const bst_sim *sim);
/* Model of a sim. */
const bst_model *bst_sim_model(const bst_sim *sim);

/* Counter of the run by index ("queue_overflow", "stale_input" and those of modules).
 *
 * Returned:  name, *count; NULL after the last one */
const char *bst_sim_counter(const bst_sim *sim, int index, int64_t *count);

/* ---- messages ---- */

/* The newest message of a channel. */
typedef struct bst_sim_message {
    const void *payload;  /* struct of the channel; NULL: none was published yet */
    int64_t written_tick; /* when it was published */
    int64_t sequence;     /* 0, 1, ... per channel; -1: none */
    int items;            /* number of items in use, for channels with items */
    int capacity;         /* items that there is room for */
} bst_sim_message;

/* A channel of a sim by index.
 *
 * Returned:  name; *scope ("observer/sensor"), which belong to the sim; NULL after the last one */
const char *bst_sim_channel(const bst_sim *sim, int index, const char **scope);

/* Lends the newest message of a channel.
 *
 * Given:     scope    "observer/sensor"; NULL: the first sensor that has the channel
 *            channel  name
 * Returned:  *out  the payload is valid until the next call that steps, restores or frees the sim
 * Errors:    BST_ERR_NOT_FOUND: no module writes such a channel */
bst_status bst_sim_view(bst_ctx *ctx, const bst_sim *sim, const char *scope, const char *channel,
                        bst_sim_message *out) BST_MUST_CHECK;

/* The newest frame with its pixels. */
typedef struct bst_sim_frame {
    const bst_frame_message *message; /* NULL: no frame yet */
    const uint16_t *pixels;           /* [height][width], DN */
    int width, height;
} bst_sim_frame;

/* Lends the newest frame of a sensor, without a copy where the device shares memory with the host.
 *
 * Given:     scope  "observer/sensor"; NULL: the first sensor with frames
 * Returned:  *out  valid until the next call that steps, restores or frees the sim
 * Errors:    BST_ERR_NOT_FOUND: no module renders frames; BST_ERR_DEVICE */
bst_status bst_sim_view_frame(bst_ctx *ctx, bst_sim *sim, const char *scope,
                              bst_sim_frame *out) BST_MUST_CHECK;

/* Keeps a frame that bst_sim_view_frame has lent: its pixels stay valid, and unchanged, until
 * bst_sim_release_frame, also when the sim goes on or is freed.
 *
 * Given:     frame  lent, with a message
 * Returned:  *held  the frame
 * Errors:    BST_ERR_DEVICE
 * Notes:     hold few: a renderer has `pool_frames` frames, and fails when all are held. The model
 *            must outlive what is held. */
bst_status bst_sim_hold_frame(bst_ctx *ctx, const bst_sim_frame *frame,
                              bst_frame **held) BST_MUST_CHECK;
/* Ends a bst_sim_hold_frame; any thread. NULL is allowed. */
void bst_sim_release_frame(bst_frame *held);

/* Gives a module of type "external" its next output, with the checks of the packet link.
 *
 * Given:     scope    "observer/sensor"; NULL: the first sensor with such a module
 *            channel  "detections" (of an external imgproc), "tracks" or "predictions" (tracker),
 *                     "los_command", "sensor_command" or "control_status" (control)
 *            payload  struct of the channel; copied
 * Errors:    BST_ERR_NOT_FOUND: no external module writes the channel; BST_ERR_ARGUMENT: a value
 *            out of range, the message names it
 * Notes:     the module publishes it at its next step. A later call before that step replaces it.
 */
bst_status bst_sim_command(bst_ctx *ctx, bst_sim *sim, const char *scope, const char *channel,
                           const void *payload) BST_MUST_CHECK;

/* Gives an external gimbal the line of sight from now on.
 *
 * Given:     scope    as bst_sim_command
 *            samples  [count] tick (ascending) and attitude of the camera; interpolated, and held
 *                     after the last one
 * Errors:    as bst_sim_command */
bst_status bst_sim_command_pointing(bst_ctx *ctx, bst_sim *sim, const char *scope,
                                    const bst_los_sample *samples, int count) BST_MUST_CHECK;

/* Sets the state of an object whose key "external_states" is true; two-body motion continues it.
 *
 * Given:     object        its name
 *            time_s        since the epoch; later than that of its last state
 *            position_m    GCRF
 *            velocity_mps  GCRF
 * Errors:    BST_ERR_NOT_FOUND, BST_ERR_ARGUMENT */
bst_status bst_sim_command_state(bst_ctx *ctx, bst_sim *sim, const char *object, double time_s,
                                 bst_vec3 position_m, bst_vec3 velocity_mps) BST_MUST_CHECK;

/* Sets the attitude of an object with a shape whose key "external_states" is true, in place of its
 * key "attitude"; it turns at a constant rate until the next command.
 *
 * Given:     object            its name
 *            time_s            since the epoch; later than that of its last attitude
 *            q_body_from_gcrf  unit
 *            rate_body_radps   angular velocity, body frame
 * Errors:    BST_ERR_NOT_FOUND, BST_ERR_ARGUMENT */
bst_status bst_sim_command_attitude(bst_ctx *ctx, bst_sim *sim, const char *object, double time_s,
                                    bst_quat q_body_from_gcrf,
                                    bst_vec3 rate_body_radps) BST_MUST_CHECK;

/* ---- saved states ---- */

/* Saves the state of a sim to memory.
 *
 * Returned:  *bytes  [*size] begins with version and digest; free it with bst_state_free
 * Errors:    BST_ERR_STATE: a module cannot be saved (another program plays it), or the sim has
 *            failed; BST_ERR_MEMORY, BST_ERR_DEVICE
 * Notes:     the sim goes on as if it had not been saved. */
bst_status bst_sim_save(bst_ctx *ctx, bst_sim *sim, void **bytes, size_t *size) BST_MUST_CHECK;
/* Frees a saved state; NULL is allowed. */
void bst_state_free(void *bytes);

/* Restores a saved state, or components of it. Continued with the same commands, every message and
 * every pixel equals that of the sim that was saved, byte for byte.
 *
 * Given:     sim         of a model of the same scenario, in this or another process
 *            bytes       [size] of bst_sim_save
 *            components  BST_STATE_ALL, or some of BST_STATE_PLANT, BST_STATE_ONBOARD,
 *                        BST_STATE_RANDOM and BST_STATE_TIME: the others keep their state. Without
 *                        BST_STATE_TIME, sim and saved state must be at the same tick; without
 *                        BST_STATE_RANDOM the noise from now on is that of the sim's own run
 * Errors:    BST_ERR_FORMAT: no saved state, a damaged one, or that of another version of the
 *            program; BST_ERR_STATE: that of another scenario, or components that do not fit;
 *            BST_ERR_MEMORY, BST_ERR_DEVICE. After an error in the middle the sim has failed: it
 *            can be restored anew or freed */
bst_status bst_sim_restore(bst_ctx *ctx, bst_sim *sim, const void *bytes, size_t size,
                           unsigned components) BST_MUST_CHECK;

/* Saves to a file, which appears complete or not at all.
 *
 * Errors:    those of bst_sim_save; BST_ERR_IO */
bst_status bst_sim_save_file(bst_ctx *ctx, bst_sim *sim, const char *path) BST_MUST_CHECK;
/* Restores from a file of bst_sim_save_file.
 *
 * Errors:    those of bst_sim_restore; BST_ERR_IO, BST_ERR_NOT_FOUND */
bst_status bst_sim_restore_file(bst_ctx *ctx, bst_sim *sim, const char *path,
                                unsigned components) BST_MUST_CHECK;

/* A second sim of the same model in the same state.
 *
 * Returned:  *out  without observer; NULL on error
 * Errors:    those of bst_sim_create, bst_sim_save and bst_sim_restore
 * Ownership: free *out with bst_sim_free; the sims are independent
 * Notes:     both hold the newest frame. A sim shares up to four frames with its clones; further
 *            ones are copied. */
bst_status bst_sim_clone(bst_ctx *ctx, bst_sim *sim, bst_sim **out) BST_MUST_CHECK;

#pragma GCC visibility pop

#endif
