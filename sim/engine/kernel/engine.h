/* The fixed-step scheduler: modules, channels between them, one clock of integer ticks. */
#ifndef BST_ENGINE_KERNEL_ENGINE_H
#define BST_ENGINE_KERNEL_ENGINE_H

#include "boresight/module.h"
#include "sim/engine/kernel/pacing.h"

typedef struct bst_engine bst_engine;

/* Reading an input later than it was written. */
typedef struct bst_input_delay {
    int port; /* index into desc->ports */
    int64_t ticks;
} bst_input_delay;

enum { BST_MAX_DELAYS = 16 };

/* One module to run. */
typedef struct bst_instance_spec {
    const bst_module_desc *desc;
    bool plugin;          /* of a plug-in: each message is checked before it is published */
    const char *scope;    /* "observer/sensor": scope of its channels */
    const char *instance; /* "observer/sensor/module": unique */
    const void *config;   /* outlives the engine */
    int64_t period_ticks; /* 0: stepped by triggers only */
    int64_t offset_ticks; /* first periodic step */
    bst_input_delay delays[BST_MAX_DELAYS];
    int delay_count;
    /* what the module may access; copied into its env if the descriptor's flags permit */
    const struct bst_world *world;
    const struct bst_knowledge *knowledge;
    struct bst_device *device;
    struct bst_link *link;
    int observer, sensor;
    double exposure_s; /* longest exposure that the scenario sets for the sensor */
    double frame_exposure_s, frame_period_s, frame_latency_s;
    int64_t los_period_ticks, los_offset_ticks; /* of the gimbal's steps; 0: not periodic */
    const bst_fleet_member *members; /* of a multi-sensor module; must outlive the engine */
    int member_count;                /* 0: a module of one sensor, whose scope it has */
    uint32_t planes;                 /* bit k: the bst_plane k is recorded */
    double mask_threshold_sigma;
    uint64_t seed, run;
    bool never_steps; /* as in bst_module_env */
} bst_instance_spec;

/* State of the observer's `wants` for one channel; zero at first. */
typedef struct bst_hook_mark {
    void *of;
    int64_t unwanted_before; /* tick; `wants` is not called for earlier messages */
    bool bare; /* `message` gets only the metadata: a frame message without its frame */
} bst_hook_mark;

/* Observers of a run; any member may be NULL. One thread at a time calls `message` and `event`, in
 * order of tick and stepping order; with bst_engine_parallel it may be any thread. The calling
 * thread calls `interrupted`. */
typedef struct bst_engine_hooks {
    void *user;
    /* A message was published (before any MODIFY port touches it). */
    bst_status (*message)(void *user, const char *scope, const char *channel, const void *payload,
                          int64_t tick);
    bst_status (*event)(void *user, int64_t tick, const char *instance, const char *kind,
                        const char *text);
    /* Called about every 20 ms of wall time; true ends the run with BST_ERR_INTERRUPTED. */
    bool (*interrupted)(void *user, int64_t tick);
    /* False: `message` is not called for this message. Called before `message`, for every message
     * from the mark's tick on, by the thread that steps the writer, one thread at a time. */
    bool (*wants)(void *user, const char *scope, const char *channel, const void *payload,
                  int64_t tick, bst_hook_mark *mark);
    /* Context for errors of `message` and `event`. NULL: that of the run; bst_engine_parallel needs
     * a separate one. */
    bst_ctx *ctx;
} bst_engine_hooks;

/* Creates an engine without instances.
 *
 * Given:     tick_rate_hz  ticks per second, 1 to 1000000
 * Returned:  *out  NULL on error
 * Errors:    BST_ERR_CONFIG, BST_ERR_MEMORY
 * Ownership: free *out with bst_engine_free */
bst_status bst_engine_create(bst_ctx *ctx, int64_t tick_rate_hz, bst_engine **out) BST_MUST_CHECK;
/* Stops the engine's threads and frees it with its modules and channels; NULL is allowed. */
void bst_engine_free(bst_engine *engine);
/* Sets the observers of an engine. The struct is copied. Not during bst_engine_run or
 * bst_engine_advance. */
void bst_engine_set_hooks(bst_engine *engine, const bst_engine_hooks *hooks);

/* Adds a module; before bst_engine_load. The spec is copied, its strings too. */
bst_status bst_engine_add(bst_ctx *ctx, bst_engine *engine,
                          const bst_instance_spec *spec) BST_MUST_CHECK;

/* Connects the channels, sorts the modules topologically (ties by instance name) and creates them.
 * Errors (BST_ERR_CONFIG): an input without a writer, two writers of a channel, a cycle without a
 * declared delay (the message shows it), a delay on a ring that is extended in place, two instances
 * of one name. */
bst_status bst_engine_load(bst_ctx *ctx, bst_engine *engine) BST_MUST_CHECK;

/* Makes bst_engine_run use several threads (docs/explanation/executor.md). The results are those of
 * one thread, to the bit.
 *
 * Given:     threads  including the calling thread
 * Notes:     Sensors that only multi-sensor modules connect are stepped concurrently. With one
 *            thread, or with pacing, the calling thread steps all sensors.
 *            Deferred modules and the observers `message` and `event` always have an additional
 *            thread,
 *            and a second one if a module has `ahead`.
 *            Modules of different sensors may share only what is constant or locked.
 *            Call it after bst_engine_load and bst_engine_pace, before the engine runs. */
bst_status bst_engine_parallel(bst_ctx *ctx, bst_engine *engine, int threads) BST_MUST_CHECK;

/* Makes bst_engine_run follow the wall clock (BST_PACING_REALTIME), or only measure frame times
 * (other modes). Call it after bst_engine_load and before bst_engine_parallel. */
bst_status bst_engine_pace(bst_ctx *ctx, bst_engine *engine,
                           const bst_pacing_config *config) BST_MUST_CHECK;
/* Timing figures of a paced run so far. False if the engine is not paced. */
bool bst_engine_pacing(const bst_engine *engine, bst_pacing_figures *out);

/* Steps all module instances that are due before `until_tick` (exclusive), and finishes the run. */
bst_status bst_engine_run(bst_ctx *ctx, bst_engine *engine, int64_t until_tick) BST_MUST_CHECK;

/* As bst_engine_run, without the modules' actions at the end of a run: more steps follow. With
 * threads, all of them have reached the tick when it returns, and all observers were called. */
bst_status bst_engine_advance(bst_ctx *ctx, bst_engine *engine, int64_t until_tick) BST_MUST_CHECK;
/* Lets the modules act as at the end of a run, after bst_engine_advance.
 *
 * Errors:    those of the modules */
bst_status bst_engine_finish(bst_ctx *ctx, bst_engine *engine) BST_MUST_CHECK;
/* Schedules one additional step of an instance at a tick, between two calls of bst_engine_advance.
 * BST_ERR_NOT_FOUND: no instance has the name. */
bst_status bst_engine_wake(bst_ctx *ctx, bst_engine *engine, const char *instance,
                           int64_t tick) BST_MUST_CHECK;

/* Makes the bst_engine_advance in progress return after the current step, also within a tick; the
 * next one goes on there. An observer may call it. With threads it has no effect. */
void bst_engine_pause(bst_engine *engine);
/* True if the last bst_engine_advance was paused. */
bool bst_engine_is_paused(const bst_engine *engine);
/* Earliest tick at which an instance is due; INT64_MAX: none. Without threads only. */
int64_t bst_engine_next_tick(const bst_engine *engine);
/* Keeps the newest frame of each channel until the next one, for bst_engine_newest. Call it before
 * the engine runs. */
void bst_engine_hold_frames(bst_engine *engine);

/* Number of channels, in a fixed order. */
int bst_engine_channel_count(const bst_engine *engine);
/* Scope, name and number of items of a channel; they belong to the engine.
 *
 * Given:     index  0 to one less than the number of channels
 * Returned:  *scope, *capacity  NULL allowed; capacity: items that a message has room for
 * Notes:     the function's value is the name of the channel. */
const char *bst_engine_channel(const bst_engine *engine, int index, const char **scope,
                               int *capacity);
/* Newest message of a channel.
 *
 * Given:     index  see bst_engine_channel
 * Returned:  payload NULL: none yet. Valid until the next call that steps the engine
 * Notes:     between two calls of bst_engine_advance. */
bst_sample bst_engine_newest(const bst_engine *engine, int index);
/* Index of a channel; -1: there is none. scope NULL: the first of this name. */
int bst_engine_find_channel(const bst_engine *engine, const char *scope, const char *name);

/* Tick of the last step of any module instance; -1 before the first. */
int64_t bst_engine_tick(const bst_engine *engine);
/* Number of module instances of an engine. */
int bst_engine_instance_count(const bst_engine *engine);

/* Name of an instance ("observer/sensor/module"); it belongs to the engine.
 *
 * Given:     index  position in the order of stepping, from 0 */
const char *bst_engine_instance_name(const bst_engine *engine, int index);
/* Number of steps that a module instance has made. */
int64_t bst_engine_instance_steps(const bst_engine *engine, int index);
/* Counters of the run by name: "queue_overflow", "stale_input" and those of modules. False after
 * the last one. */
bool bst_engine_counter(const bst_engine *engine, int index, const char **name, int64_t *count);

/* Period in ticks of a rate. BST_ERR_CONFIG if tick_rate / rate is no integer; the message names
 * the nearest allowed rates. */
bst_status bst_period_ticks(bst_ctx *ctx, int64_t tick_rate_hz, double rate_hz,
                            int64_t *out) BST_MUST_CHECK;
/* Converts a time to whole ticks. BST_ERR_CONFIG if it is no multiple of a tick; the message names
 * the nearest allowed times. */
bst_status bst_seconds_to_ticks(bst_ctx *ctx, int64_t tick_rate_hz, double seconds,
                                int64_t *out) BST_MUST_CHECK;

#endif
