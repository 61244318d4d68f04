/* The fixed-step scheduler: modules, channels between them, one clock of integer ticks. */
#ifndef BST_ENGINE_KERNEL_ENGINE_H
#define BST_ENGINE_KERNEL_ENGINE_H

#include "boresight/module.h"
#include "sim/engine/kernel/pacing.h"

typedef struct bst_engine bst_engine;

/* Reading an input later than it was written. */
typedef struct bst_input_delay {
    int port; /* index into desc->ports; of one that links sensors, for each */
    int64_t ticks;
} bst_input_delay;

enum { BST_MAX_DELAYS = 16 };

/* One module to run. */
typedef struct bst_instance_spec {
    const bst_module_desc *desc;
    const char *scope;    /* "observer/sensor": where its channels live */
    const char *instance; /* "observer/sensor/module": unique */
    const void *config;   /* outlives the engine */
    int64_t period_ticks; /* 0: triggers only */
    int64_t offset_ticks; /* first periodic step */
    bst_input_delay delays[BST_MAX_DELAYS];
    int delay_count;
    /* what the module gets to see; filled into its env as the descriptor's flags allow */
    const struct bst_world *world;
    const struct bst_knowledge *knowledge;
    struct bst_device *device;
    struct bst_link *link;
    int observer, sensor;
    double exposure_s; /* the longest of the sensor that the scenario sets */
    double frame_exposure_s, frame_period_s, frame_latency_s;
    int64_t los_period_ticks, los_offset_ticks; /* of its gimbal; 0: there is none with a period */
    const bst_fleet_member *members; /* of a module that links sensors; outlive the engine */
    int member_count;                /* 0: it is one sensor's, and has its scope */
    uint32_t planes;                 /* bit k: the bst_plane k is recorded */
    double mask_threshold_sigma;
    uint64_t seed, run;
} bst_instance_spec;

/* State of the hook `wants` for a channel; zero at first. */
typedef struct bst_hook_mark {
    void *of;
    int64_t unwanted_before; /* tick; `wants` is not called for earlier messages */
    bool bare; /* `message` gets this one without what it owns: a frame's message without frame */
} bst_hook_mark;

/* Observers of a run; any member may be NULL. One thread at a time calls `message` and `event`, in
 * order of tick and then of stepping; with bst_engine_parallel it may be any thread. The calling
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
/* Sets the hooks of an engine; they are copied. Not during bst_engine_run or bst_engine_advance. */
void bst_engine_set_hooks(bst_engine *engine, const bst_engine_hooks *hooks);

/* Adds a module; before bst_engine_load. The spec is copied, its strings too. */
bst_status bst_engine_add(bst_ctx *ctx, bst_engine *engine,
                          const bst_instance_spec *spec) BST_MUST_CHECK;

/* Wires the channels, sorts the modules (topologically; ties by instance name), creates them.
 * Errors (BST_ERR_CONFIG): an input that nobody writes, two writers of a channel, a cycle without a
 * declared delay (the message shows it), a delay on a ring that is extended in place, two instances
 * of one name. */
bst_status bst_engine_load(bst_ctx *ctx, bst_engine *engine) BST_MUST_CHECK;

/* Has bst_engine_run use `threads` threads, the calling one among them, by
 * docs/explanation/executor.md: sensors that share nothing but what multi-sensor modules link are
 * stepped at the same time (with one thread, or with pacing, the calling thread steps all of
 * them); deferred modules (BST_MODULE_DEFERRABLE that no other waits for), and the hooks `message`
 * and `event`, have a thread besides in any case, and a second one where a module looks ahead.
 * Results are those of one thread, to the bit. Modules of different sensors may share only what is
 * constant or locked. After bst_engine_load, and bst_engine_pace if it is called, and before the
 * engine runs. */
bst_status bst_engine_parallel(bst_ctx *ctx, bst_engine *engine, int threads) BST_MUST_CHECK;

/* Has bst_engine_run keep to the wall clock (BST_PACING_REALTIME), or only watch how long frames
 * take (the other modes). After bst_engine_load, before bst_engine_parallel. */
bst_status bst_engine_pace(bst_ctx *ctx, bst_engine *engine,
                           const bst_pacing_config *config) BST_MUST_CHECK;
/* Timing of a paced run so far; false if the engine is not paced. */
bool bst_engine_pacing(const bst_engine *engine, bst_pacing_figures *out);

/* Steps everything that is due before `until_tick` (exclusive). All of it is done on return. */
bst_status bst_engine_run(bst_ctx *ctx, bst_engine *engine, int64_t until_tick) BST_MUST_CHECK;

/* The same, when more is to come: what modules do at the end of a run is left to bst_engine_run. */
bst_status bst_engine_advance(bst_ctx *ctx, bst_engine *engine, int64_t until_tick) BST_MUST_CHECK;
/* Has an instance (by its name) step at a tick besides those of its own; between two calls of
 * bst_engine_advance. BST_ERR_NOT_FOUND. */
bst_status bst_engine_wake(bst_ctx *ctx, bst_engine *engine, const char *instance,
                           int64_t tick) BST_MUST_CHECK;

/* Tick of the last step, -1 before the first. */
int64_t bst_engine_tick(const bst_engine *engine);
/* Number of instances. */
int bst_engine_instance_count(const bst_engine *engine);

/* Name of an instance ("observer/sensor/module"); it belongs to the engine.
 *
 * Given:     index  position in the order of stepping, from 0 */
const char *bst_engine_instance_name(const bst_engine *engine, int index);
/* Steps that an instance has made. */
int64_t bst_engine_instance_steps(const bst_engine *engine, int index);
/* Conditions counted so far by name ("queue_overflow", "stale_input", what modules count); false
 * after the last. */
bool bst_engine_counter(const bst_engine *engine, int index, const char **name, int64_t *count);

/* Period in ticks of a rate. BST_ERR_CONFIG when tick_rate / rate is no integer: the message names
 * the nearest rates that are. */
bst_status bst_period_ticks(bst_ctx *ctx, int64_t tick_rate_hz, double rate_hz,
                            int64_t *out) BST_MUST_CHECK;
/* Whole ticks of a time. BST_ERR_CONFIG when it is none, naming the nearest times that are. */
bst_status bst_seconds_to_ticks(bst_ctx *ctx, int64_t tick_rate_hz, double seconds,
                                int64_t *out) BST_MUST_CHECK;

#endif
