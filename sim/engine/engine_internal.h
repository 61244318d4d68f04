/* Inside of the engine, shared by its files only. */
#ifndef BST_ENGINE_ENGINE_INTERNAL_H
#define BST_ENGINE_ENGINE_INTERNAL_H

#include "sim/engine/engine.h"

typedef struct slot {
    int64_t written_tick;
    void *payload;
    bool owned; /* the payload holds what type->release lets go of */
} slot;

/* A channel of one scope: a ring of slots. Message `sequence` lies in slots[sequence % depth]. */
typedef struct channel {
    const bst_channel_type *type;
    const char *scope; /* borrowed from an instance */
    int writer;        /* instance, -1: none */
    int writer_port;
    slot *slots;
    int depth;
    int64_t written;  /* messages so far */
    int capacity;     /* items */
    double rate_hz;   /* at most how often it is written */
    int64_t released; /* sequences below have been let go */
} channel;

enum { MAX_PORTS = 16, TRIGGER_RING = 64 };

/* What an instance needs to know about one of its ports. */
typedef struct port_state {
    int channel; /* -1: optional and absent */
    int64_t delay_ticks;
    int64_t max_age_ticks; /* 0: none */
    int64_t cursor;        /* next sequence to read */
    bool uses_next;        /* has read by bst_step_next: losses count */
    bool writing;          /* a payload was handed out and is not yet committed */
    int capacity;
    /* ticks at which trigger messages become visible, ascending */
    int64_t trigger[TRIGGER_RING];
    int trigger_head, trigger_count;
} port_state;

typedef struct instance {
    bst_instance_spec spec;
    char *scope, *name;
    void *self;
    bool created;
    port_state ports[MAX_PORTS];
    int64_t next_period, wake; /* INT64_MAX: none */
    int64_t due;
    int64_t steps;
    double rate_hz;
} instance;

typedef struct counter {
    char name[48];
    int64_t count;
} counter;

enum { MAX_COUNTERS = 64 };

struct bst_engine {
    int64_t tick_rate_hz;
    instance **instances; /* in stepping order once loaded */
    int instance_count, instance_capacity;
    channel *channels;
    int channel_count;
    bst_engine_hooks hooks;
    int64_t tick;
    bool loaded;
    counter counters[MAX_COUNTERS];
    int counter_count;
};

/* What a module's step sees. */
struct bst_step {
    bst_engine *engine;
    instance *self;
    int self_index;
    bst_ctx *ctx;
    int64_t tick;
    bst_status hook_status; /* first failure of a hook during this step */
};

/* wiring.c */
bst_status bst_engine_wire(bst_ctx *ctx, bst_engine *engine) BST_MUST_CHECK;
bst_status bst_engine_allocate_channels(bst_ctx *ctx, bst_engine *engine) BST_MUST_CHECK;
/* channel.c */
bst_status bst_engine_commit(struct bst_step *step) BST_MUST_CHECK;
void bst_engine_release_read(bst_engine *engine);
void bst_engine_count(bst_engine *engine, const char *what);
/* Earliest tick at which an instance wants to be stepped. */
int64_t bst_engine_due(const instance *i);

#endif
