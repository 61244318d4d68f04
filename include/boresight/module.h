/* The module interface: a static descriptor, a configuration table, ports, and three functions. */
#ifndef BORESIGHT_MODULE_H
#define BORESIGHT_MODULE_H

#include "boresight/archive.h"
#include "boresight/config.h"
#include "boresight/messages.h"
#include "boresight/rng.h"

#pragma GCC visibility push(default)

#define BST_MODULE_ABI 7

struct bst_camera;    /* boresight/camera.h */
struct bst_world;     /* sim/world: the truth */
struct bst_knowledge; /* sim/world: onboard knowledge */
struct bst_device;    /* sim/device */
struct bst_link;      /* sim/link */
struct bst_step;      /* sim/engine; accessed through the functions below */

typedef enum bst_port_direction {
    BST_PORT_IN,
    BST_PORT_OUT,
    BST_PORT_MODIFY, /* modifies the message of another module before any reader gets it */
} bst_port_direction;

enum {
    BST_PORT_OPTIONAL = 1u << 0, /* input: may have no writer; output: yields to another module
                                    that writes the channel (bst_env_writes) */
    BST_PORT_TRIGGER = 1u << 1, /* input: the module steps whenever a new message becomes visible */
    BST_PORT_FEEDBACK = 1u << 2, /* input: closes a loop; delayed by at least one tick */
};

typedef struct bst_port {
    const char *channel; /* BST_CHANNEL_... */
    bst_port_direction direction;
    unsigned flags;
    double
        max_age_s; /* input: older than this at the time of reading is stale; 0: any age is fresh */
    int capacity; /* output with items: default number; bst_env_set_capacity changes it in create */
} bst_port;

enum {
    BST_MODULE_READS_TRUTH = 1u << 0, /* gets env->world; onboard modules do not */
    BST_MODULE_NEEDS_DEVICE = 1u << 1,
    BST_MODULE_DEFERRABLE =
        1u << 2, /* deferrable: may step in another thread than modules that do not
               read it. Shares only constant or locked data with them,
               has no period and never requests a wake */
    BST_MODULE_NEEDS_LINK = 1u << 3,   /* gets env->link: another program replaces the module */
    BST_MODULE_MULTI_SENSOR = 1u << 4, /* multi-sensor: one instance for all sensors, named beside
                                   the observers. It has each port once per sensor
                                   (bst_member_port); env->knowledge is NULL */
    BST_MODULE_HAS_LOOKAHEAD =
        1u << 5, /* BST_MODULE_MULTI_SENSOR with a lookahead (bst_step_set_lookahead), so that
               sensors may run ahead. It has a period, never requests a
               wake, and reads its queues to the end in each step */
    BST_MODULE_INPUTS_ONLY = 1u << 6, /* steps on its inputs and wakes alone: it has no period, and
                                         rate_hz and offset_s of a scenario have no effect. So it
                                         is with BST_MODULE_DEFERRABLE */
};

/* One of the sensors that a BST_MODULE_MULTI_SENSOR module serves. */
typedef struct bst_fleet_member {
    const char *scope;    /* "observer/sensor" */
    int observer, sensor; /* indices in the world */
    const struct bst_knowledge *knowledge;
    double frame_exposure_s, frame_period_s, frame_latency_s; /* as in bst_module_env */
} bst_fleet_member;

/* Port number of a module that serves several sensors: port `port` of its descriptor for sensor
 * `member`.
 *
 * Given:     port_count  number of ports of the descriptor
 *            member      index in bst_module_env.members
 *            port        index in desc->ports */
static inline int bst_member_port(int port_count, int member, int port) {
    return member * port_count + port;
}

/* Arguments of create. Pointers outlive the module. */
typedef struct bst_module_env {
    bst_ctx *ctx;
    const char *instance; /* "observer/sensor/module" */
    int64_t tick_rate_hz;
    int64_t period_ticks; /* 0: stepped by triggers only */
    uint64_t seed, run;
    const struct bst_world *world; /* NULL unless the descriptor says BST_MODULE_READS_TRUTH */
    const struct bst_knowledge *knowledge; /* of this sensor */
    struct bst_device *device;             /* NULL unless the descriptor asks for it */
    int observer, sensor;                  /* indices in the world */
    double
        exposure_s; /* longest exposure of this sensor: its own setting, or exposure_s of a module
                       that commands it; from the first to the last row of a rolling shutter */
    int64_t los_period_ticks,
        los_offset_ticks;        /* steps at which this sensor's los_history is written */
    uint32_t planes;             /* bit k: the bst_plane k is recorded */
    double mask_threshold_sigma; /* minimum light of a pixel in the segmentation mask */
    void *engine_private;
    double frame_exposure_s, frame_period_s; /* of this sensor's frames, as set or commanded */
    double frame_latency_s; /* from the end of an exposure until control has its tracks: sum of the
                               declared delays */
    struct bst_link *link;  /* NULL unless the descriptor asks for it */
    const bst_fleet_member *
        members; /* of a BST_MODULE_MULTI_SENSOR module: all sensors in scenario order; else NULL */
    int member_count;
    bool never_steps; /* the simulation is only looked at (boresight check): what takes long and
                         only step needs, such as compiling kernels, may be left out */
} bst_module_env;

typedef struct bst_module_desc {
    uint32_t abi;     /* BST_MODULE_ABI */
    const char *role; /* "gimbal", "scenegen", "imgproc", "tracker", "control", ... */
    const char *type; /* name in a scenario's "type", such as "second_order" */
    const char *doc;
    unsigned flags;
    const bst_config_desc *config;
    size_t config_bytes;
    double default_rate_hz; /* used when the scenario gives no "rate_hz"; 0: triggers only */
    const bst_port *ports;
    int port_count;
    /* `config` is the filled struct; it outlives the module. */
    bst_status (*create)(const bst_module_env *env, const void *config, void **self);
    bst_status (*step)(void *self, struct bst_step *step);
    void (*destroy)(void *self);
    /* May be NULL. Called at the end of a run to count unfinished work; publishes nothing. */
    bst_status (*finish)(void *self, struct bst_step *step);
    /* May be NULL; only for BST_MODULE_DEFERRABLE. The engine may call it before a step, on another
     * thread, while earlier steps or their `ahead` are running. It does the work that depends only
     * on that step's inputs from modules that are not BST_MODULE_DEFERRABLE, and reads no others.
     * It publishes and counts nothing, and stores its results by bst_step_lane for the step. The
     * step does the work itself if there is no stored result, so that an error here occurs there
     * again.
     */
    bst_status (*ahead)(void *self, struct bst_step *step);
    /* May be NULL. Roles, NULL-terminated, that this module replaces if the sensor's
     * observation_source is "generator"; otherwise it does not step. Keys that its table shares
     * with theirs take their values. Its last trigger is delayed by the sum of the delays between
     * them. */
    const char *const *substitutes_for;
    const char *also; /* alternative name for "type"; NULL: none */
    /* Saves the state of a module, or restores it into an instance that was created from the same
     * configuration, between two steps. After a restore every later step gives the same bytes as
     * that of the module that was saved. What `create` makes and no step changes is not archived.
     * NULL: a simulation with this module cannot be saved. */
    bst_status (*archive)(void *self, bst_archive *archive);
} bst_module_desc;

/* In create: sets the number of items that an output's payload holds.
 *
 * Given:     port   index in desc->ports
 *            items  1 or more */
void bst_env_set_capacity(const bst_module_env *env, int port, int items);

/* In create: true if this module writes an output; false for an optional output that another module
 * writes. */
bool bst_env_writes(const bst_module_env *env, int port);

/* In create: declares how often a module that wakes itself (bst_step_wake_at) steps at most.
 *
 * Given:     rate_hz  steps per second, approximately
 * Notes:     sizes the queues that this module writes. */
void bst_env_set_rate(const bst_module_env *env, double rate_hz);

/* In create: declares that an input is not read, so that no writer of it is waited for.
 *
 * Given:     port  index in desc->ports */
void bst_env_ignore(const bst_module_env *env, int port);

/* In create: onboard model of this sensor's camera.
 *
 * Returned:  the camera; it outlives the module. NULL for a BST_MODULE_MULTI_SENSOR module */
const struct bst_camera *bst_env_camera(const bst_module_env *env);

/* In create: key of a random stream of this instance.
 *
 * Given:     stream  name of the stream, distinct within the module */
static inline bst_rng_key bst_env_rng(const bst_module_env *env, const char *stream) {
    return bst_rng_make_key(env->seed, env->run, env->instance, stream);
}

/* One message as a reader gets it. payload is NULL if there is none. */
typedef struct bst_sample {
    const void *payload;
    int64_t written_tick; /* when its writer wrote it; it became visible `delay` later */
    int64_t sequence;     /* 0, 1, ... per channel */
    bool stale; /* older than the port's max_age_s: to be treated as absent unless the module knows
                   better */
} bst_sample;

/* In step: context for messages, log and warnings of this step. */
bst_ctx *bst_step_ctx(struct bst_step *step);
/* In step: tick of this step, counted from the scenario's epoch. */
int64_t bst_step_tick(const struct bst_step *step);
/* In step: time of this step, seconds since the scenario's epoch (tick over tick rate). */
double bst_step_seconds(const struct bst_step *step); /* tick / rate, since the scenario's epoch */
/* Number of work spaces (lanes) that steps of an instance with `ahead` use in turn. */
enum { BST_STEP_LANES = 3 };

/* In step and ahead: work space that this step uses.
 *
 * Returned:  0 to BST_STEP_LANES - 1; always 0 for instances without `ahead`
 * Notes:     no two steps of an instance that run at the same time have the same lane. */
int bst_step_lane(const struct bst_step *step);

/* In step: newest visible message of an input.
 *
 * Given:     port  index in desc->ports
 * Returned:  payload NULL if there is none; the payload is valid for this step
 * Notes:     leaves the messages of a queue unread. */
bst_sample bst_step_latest(struct bst_step *step, int port);

/* In step: next unread message of a queue input; marks it read.
 *
 * Given:     port  index in desc->ports
 * Returned:  payload NULL if there is none; the payload is valid for this step */
bst_sample bst_step_next(struct bst_step *step, int port);

/* In step: payload of an output to fill; readers see it when the step returns BST_OK.
 *
 * Given:     port  index in desc->ports
 * Returned:  *capacity  number of items that fit; capacity may be NULL
 * Notes:     the payload of a latest channel holds the last message written; that of a queue holds
 *            an old message. A second call in a step publishes the first message and starts
 *            another. */
void *bst_step_write(struct bst_step *step, int port, int *capacity);

/* In step: message that was written at this tick to a MODIFY port, to be changed in place.
 *
 * Given:     port  index in desc->ports
 * Returned:  NULL if no message was written at this tick */
void *bst_step_modify(struct bst_step *step, int port);

/* In step: requests a step at an absolute tick, besides the period and the triggers.
 *
 * Given:     tick  later than now; earlier ticks are ignored
 * Notes:     one request is kept, the earliest, until it is due. */
void bst_step_wake_at(struct bst_step *step, int64_t tick);

/* In step: declares a lookahead: this output will not be written before an absolute tick.
 *
 * Given:     port  index in desc->ports
 *            tick  absolute; an earlier one than declared before has no effect
 * Errors:    the step fails with BST_ERR_STATE if the module lacks BST_MODULE_HAS_LOOKAHEAD, or
 * writes earlier after all Reference: Fujimoto, Parallel and Distributed Simulation Systems, 2000,
 * chapter 3 (lookahead) */
void bst_step_set_lookahead(struct bst_step *step, int port, int64_t tick);

/* In step: records an event.
 *
 * Given:     kind    short fixed word
 *            format  printf-style text, cut at 399 bytes */
void bst_step_event(struct bst_step *step, const char *kind, const char *format, ...)
    BST_PRINTF(3, 4);

/* In step: counts a condition of the data ("saturated", ...) for the summary of the run.
 *
 * Given:     what  name of the counter */
void bst_step_count(struct bst_step *step, const char *what);

#pragma GCC visibility pop

#endif
