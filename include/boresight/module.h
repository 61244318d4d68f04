/* What a module is: a static descriptor, a configuration table, ports, and three functions. */
#ifndef BORESIGHT_MODULE_H
#define BORESIGHT_MODULE_H

#include "boresight/config.h"
#include "boresight/messages.h"
#include "boresight/rng.h"

#pragma GCC visibility push(default)

#define BST_MODULE_ABI 3

struct bst_world;     /* sim/world: what is true */
struct bst_knowledge; /* sim/world: what the onboard side knows */
struct bst_device;    /* sim/device */
struct bst_link;      /* sim/link */
struct bst_step;      /* sim/engine; reached through the functions below */

typedef enum bst_port_direction {
    BST_PORT_IN,
    BST_PORT_OUT,
    BST_PORT_MODIFY, /* changes in place what another module wrote, before any reader sees it */
} bst_port_direction;

enum {
    BST_PORT_OPTIONAL = 1u << 0, /* input: may have no writer; output: yields to another module
                                    that writes the channel (bst_env_writes) */
    BST_PORT_TRIGGER = 1u << 1, /* input: the module steps whenever a new message becomes visible */
    BST_PORT_FEEDBACK = 1u << 2, /* input: closes a loop; read with a delay of at least one tick */
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
    BST_MODULE_APART = 1u << 2,      /* may step in another thread than modules that do not read it:
                                        shares with them only what is constant or locked, has no period
                                        and never asks to be woken */
    BST_MODULE_NEEDS_LINK = 1u << 3, /* gets env->link: another program plays it */
    BST_MODULE_LINKS = 1u << 4,      /* one for all sensors of a scenario, which names it beside the
                                        observers: its ports are there once for each sensor
                                        (bst_member_port), and env->knowledge is NULL */
    BST_MODULE_PROMISES = 1u << 5,   /* BST_MODULE_LINKS: says how long it will not write
                                        (bst_step_promise), so that sensors go on meanwhile. It has
                                        a period, never asks to be woken, and reads its queues to
                                        the last message in each step */
};

/* A sensor as a module sees it that links several. */
typedef struct bst_fleet_member {
    const char *scope;    /* "observer/sensor" */
    int observer, sensor; /* indices in the world */
    const struct bst_knowledge *knowledge;
    double frame_exposure_s, frame_period_s, frame_latency_s; /* as in bst_module_env */
} bst_fleet_member;

/* The port of a module that links sensors: `port` of its descriptor for one of the members. */
static inline int bst_member_port(int port_count, int member, int port) {
    return member * port_count + port;
}

/* What create gets. Pointers outlive the module. */
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
    double exposure_s;                     /* the longest of this sensor that the scenario sets: its
                                              own, or exposure_s of a module that commands it; from
                                              the first to the last row of a rolling shutter */
    int64_t los_period_ticks, los_offset_ticks; /* when this sensor's los_history is written */
    uint32_t planes;                            /* bit k: the bst_plane k is recorded */
    double mask_threshold_sigma; /* least light of a pixel of the segmentation mask */
    void *engine_private;
    double frame_exposure_s, frame_period_s; /* of this sensor's frames, as set and commanded */
    double frame_latency_s; /* from an exposure's end until control has what it showed: the declared
                               delays in between */
    struct bst_link *link;  /* NULL unless the descriptor asks for it */
    const bst_fleet_member *members; /* of a BST_MODULE_LINKS one: all sensors, in the order of the
                                        scenario; else NULL */
    int member_count;
} bst_module_env;

typedef struct bst_module_desc {
    uint32_t abi;     /* BST_MODULE_ABI */
    const char *role; /* "gimbal", "scenegen", "imgproc", "tracker", "control", ... */
    const char *type; /* "second_order": what a scenario writes as "type" */
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
    /* May be NULL. At the end of a run: counts what was still under way; publishes nothing. */
    bst_status (*finish)(void *self, struct bst_step *step);
    /* May be NULL; of a BST_MODULE_APART one. May be called before a step, on another thread, while
     * earlier steps or their `ahead` are under way, to do what depends on nothing but that step's
     * inputs from modules that are not apart. It reads those alone, publishes and counts nothing,
     * and keeps what it made by bst_step_lane for the step, which does it itself where nothing is
     * kept: what fails here fails there again. */
    bst_status (*ahead)(void *self, struct bst_step *step);
    /* May be NULL. Roles, NULL-terminated, in whose place this module steps where the sensor's
     * observation_source is "generator"; otherwise it does not step. Keys of its table that theirs
     * have too take their values. Its last trigger is delayed by what passes between them. */
    const char *const *stands_for;
    const char *also; /* another name that a scenario may write as "type"; NULL: none */
} bst_module_desc;

/* In create: number of items that an output's payload shall hold. `port` indexes desc->ports. */
void bst_env_set_capacity(const bst_module_env *env, int port, int items);
/* In create: whether an output that yields is this module's to write. */
bool bst_env_writes(const bst_module_env *env, int port);
/* In create of a module that wakes itself (bst_step_wake_at): about how often it will step at most.
 * Queues behind it are sized by that. */
void bst_env_set_rate(const bst_module_env *env, double rate_hz);
/* In create: this input will not be read, so that nothing waits for who writes it. */
void bst_env_ignore(const bst_module_env *env, int port);
/* In create: a key of a random stream of this instance. */
static inline bst_rng_key bst_env_rng(const bst_module_env *env, const char *stream) {
    return bst_rng_make_key(env->seed, env->run, env->instance, stream);
}

/* One message as a reader sees it. payload is NULL when nothing valid is there yet. */
typedef struct bst_sample {
    const void *payload;
    int64_t written_tick; /* when its writer wrote it; it became visible `delay` later */
    int64_t sequence;     /* 0, 1, ... per channel */
    bool stale; /* older than the port's max_age_s: to be treated as absent unless the module knows
                   better */
} bst_sample;

/* In step. Port numbers index desc->ports. */
bst_ctx *bst_step_ctx(struct bst_step *step);
int64_t bst_step_tick(const struct bst_step *step);
double bst_step_seconds(const struct bst_step *step); /* tick / rate, since the scenario's epoch */
/* Steps of an instance whose `ahead` may have been called take turns in BST_STEP_LANES lanes, 0 the
 * first: no two with one lane are under way. 0 for all others. */
enum { BST_STEP_LANES = 3 };
int bst_step_lane(const struct bst_step *step);
/* The newest visible message of an input. Queue messages stay unread. */
bst_sample bst_step_latest(struct bst_step *step, int port);
/* The next unread visible message of a queue input; payload NULL when there is none. */
bst_sample bst_step_next(struct bst_step *step, int port);
/* The payload to fill; visible to readers when the step returns BST_OK. A latest channel's payload
 * keeps what was written last; a queue slot holds an old message to overwrite. *capacity (may be
 * NULL): number of items there is room for. */
void *bst_step_write(struct bst_step *step, int port, int *capacity);
/* MODIFY port: the message written at this tick, NULL when none was. */
void *bst_step_modify(struct bst_step *step, int port);
/* Asks to be stepped at an absolute tick (later than now) besides the period and the triggers. One
 * wish is kept, the earliest, until it comes true. */
void bst_step_wake_at(struct bst_step *step, int64_t tick);
/* BST_MODULE_PROMISES: this output will not be written in steps before an absolute tick. To write
 * it all the same is an error. */
void bst_step_promise(struct bst_step *step, int port, int64_t tick);
/* An event for the record: kind is a short fixed word, text free. */
void bst_step_event(struct bst_step *step, const char *kind, const char *format, ...)
    BST_PRINTF(3, 4);
/* Counts a condition of the data ("saturated", "queue_overflow", ...) for the run summary. */
void bst_step_count(struct bst_step *step, const char *what);

#pragma GCC visibility pop

#endif
