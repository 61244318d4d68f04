/* Inside of the engine, shared by its files only. */
#ifndef BST_ENGINE_KERNEL_ENGINE_INTERNAL_H
#define BST_ENGINE_KERNEL_ENGINE_INTERNAL_H

#include <pthread.h>

#include "sim/engine/kernel/engine.h"

/* A message as a log keeps it. */
typedef struct slot {
    int64_t written_tick, sequence; /* sequence: the channel's count of messages */
    void *payload;
    bool owned; /* the payload holds what type->release lets go of */
} slot;

/* message_log.c: messages by the tick at which they were written. Positions count from 0. The log
 * of a channel is a ring: it keeps the last `depth` messages, and positions are sequences. A copy,
 * which an input across logical processes has, keeps what is not yet trimmed, and grows. */
typedef struct message_log {
    slot *slots;
    int depth;
    int head;        /* slot of the next message */
    int64_t written; /* positions so far */
    int64_t oldest;  /* first position that is kept */
    bool copied;     /* written by another logical process: `lock` is over all of the log */
    int *frames;     /* of a copy: counts messages that own something; atomic */
    pthread_mutex_t lock;
} message_log;

/* A port that reads a channel. */
typedef struct channel_reader {
    int instance, port;
} channel_reader;

/* A channel of one scope. */
typedef struct channel {
    const bst_channel_type *type;
    const char *scope; /* borrowed from an instance or a member */
    int writer;        /* instance */
    int writer_port;
    message_log log;
    size_t payload_bytes;
    int capacity;     /* items */
    double rate_hz;   /* about how often it is written */
    int64_t released; /* sequences below have been let go */
    int process;      /* logical process of its writer; 0 without an executor */
    bst_hook_mark mark;
    channel_reader *readers; /* BST_PORT_IN and BST_PORT_MODIFY ports, part of engine->readers */
    int reader_count;
    bool triggers; /* one of them is stepped for its messages */
    bool crosses;  /* one of them belongs to another logical process */
    bool paced;    /* pacing.c: its messages show that a frame has been dealt with */
} channel;

/* How an input gets messages of another logical process. */
typedef enum port_copies {
    BST_COPY_NONE,    /* it reads its channel's log */
    BST_COPY_EACH,    /* every message is copied when it is published */
    BST_COPY_SAMPLED, /* the writer's process copies what is visible whenever the reader's steps */
} port_copies;

/* What an instance needs to know about one of its ports. */
typedef struct port_state {
    int channel; /* -1: optional and absent */
    int64_t delay_ticks;
    int64_t max_age_ticks;  /* 0: none */
    message_log *log;       /* that an input reads, by positions; NULL: none */
    int64_t cursor;         /* next position to read */
    int64_t trigger_cursor; /* next position to be stepped for */
    int capacity;
    bool writing;         /* its payload was handed out and not yet published */
    int64_t silent_until; /* an output: its lookahead: not written before */
    /* an input across logical processes; `copied` and `announced` are the writer's process's */
    port_copies copies;
    int64_t copied;    /* next message of the channel that is to be copied */
    int64_t announced; /* next message of the channel that makes the reader step */
    int64_t lookahead; /* an output: silent_until as other processes know it */
} port_state;

typedef struct instance {
    bst_instance_spec spec;
    char *scope, *name;
    void *self;
    bool created;
    bool deferred;  /* no other instance waits for what it writes: steps last in a tick, and may do
                       so  in a logical process of its own */
    int port_count; /* the descriptor's; of one that links sensors, those for each */
    port_state *ports;
    int *triggers; /* ports whose messages make it step */
    int trigger_count;
    int64_t next_period, wake; /* INT64_MAX: none */
    struct bst_heap *heap;     /* that it waits in */
    int order;                 /* place in the stepping order */
    int process;               /* partition.c: its logical process */
    int lane;                  /* of the step under way */
    int64_t steps;
    double own_rate_hz; /* set by bst_env_set_rate */
    double rate_hz;
} instance;

/* schedule.c: instances that wait, the next to be stepped first. */
typedef struct bst_heap {
    int *items; /* [place] instance */
    int count;
} bst_heap;

typedef struct counter {
    char name[48];
    int64_t count;
} counter;

enum { MAX_COUNTERS = 64 };

/* executor.c: logical processes stepped by several threads */
typedef struct bst_executor bst_executor;
/* pacing.c: the wall clock */
typedef struct bst_pacing bst_pacing;

struct bst_engine {
    int64_t tick_rate_hz;
    instance **instances; /* in stepping order once loaded */
    int instance_count, instance_capacity;
    channel *channels;
    int channel_count;
    channel_reader *readers;
    int *releasable; /* channels whose payloads own something */
    int releasable_count;
    /* schedule.c: a heap of instances, the next to be stepped at its top */
    int64_t *due;  /* [instance] */
    bst_heap heap; /* of all */
    int *place;    /* [instance] in its heap */
    bst_engine_hooks hooks;
    int64_t tick;
    bool loaded;
    pthread_mutex_t counting;
    counter counters[MAX_COUNTERS]; /* by name */
    int counter_count;
    bst_executor *executor; /* NULL: the calling thread does all, in the order of tick and step */
    bst_pacing *pacing;     /* NULL: simulated time is free of the wall clock */
};

/* What a module's step sees. */
struct bst_step {
    bst_engine *engine;
    instance *self;
    bst_ctx *ctx;
    int64_t tick;
    int writing;            /* ports whose payload was handed out and not yet published */
    bst_status hook_status; /* first failure of a hook during this step */
    int lane;
    int64_t *ahead; /* [port] cursors of a module's `ahead`; NULL: it is a step */
};

/* Connects ports to channels and puts the instances into the order of stepping (wiring.c).
 *
 * Errors:    BST_ERR_CONFIG for two instances of one name, missing or double writers, undeclared
 *            cycles; BST_ERR_MEMORY */
bst_status bst_engine_wire(bst_ctx *ctx, bst_engine *engine) BST_MUST_CHECK;

/* Determines readers and rates of all channels and allocates their slots.
 *
 * Errors:    BST_ERR_MEMORY and those of the wiring */
bst_status bst_engine_allocate_channels(bst_ctx *ctx, bst_engine *engine) BST_MUST_CHECK;

/* Publishes what a step has written (channel.c).
 *
 * Errors:    the first error of a hook during the step, and those of hooks that observe the
 *            messages */
bst_status bst_engine_commit(struct bst_step *step) BST_MUST_CHECK;
/* Lets go of what all readers have read, on channels that a logical process writes. */
void bst_engine_release_read(bst_engine *engine, int process);
/* Increments a counter of the run's summary; any thread. Names beyond MAX_COUNTERS are dropped. */
void bst_engine_count(bst_engine *engine, const char *what);
/* Passes a hook's status on, with its message in ctx. */
bst_status bst_engine_heard(bst_ctx *ctx, const bst_engine *engine,
                            bst_status status) BST_MUST_CHECK;

/* message_log.c; with the log locked where it is a copy */
/* Newest position that is visible at `tick` through a delay, -1: none. */
int64_t bst_log_newest(const message_log *log, int64_t delay, int64_t tick);
/* First visible position from *cursor on, -1: none; counts those that are no longer kept. */
int64_t bst_log_unread(bst_engine *engine, const message_log *log, int64_t *cursor, int64_t delay,
                       int64_t tick);
/* Whether a message from *cursor on has become visible; passes over all that have. */
bool bst_log_pass(const message_log *log, int64_t *cursor, int64_t delay, int64_t tick);
/* When the first message from `cursor` on becomes visible, INT64_MAX: there is none. */
int64_t bst_log_next_visible(const message_log *log, int64_t cursor, int64_t delay);
/* These lock the copy themselves. */
bst_status bst_log_copy(bst_ctx *ctx, message_log *to, const channel *ch,
                        const slot *from) BST_MUST_CHECK;
/* Drops from a port's copy what no step after `tick` can see. */
void bst_log_trim(const channel *ch, port_state *port, int64_t tick);
/* Releases what the slots of a log own and frees the log's memory. */
void bst_log_free(const bst_channel_type *type, message_log *log);
/* Of a message: what its readers may look at. */
size_t bst_log_used_bytes(const channel *ch, const void *payload);

/* Allocates the heap of instances and sets their first ticks (schedule.c).
 *
 * Errors:    BST_ERR_MEMORY */
bst_status bst_engine_make_schedule(bst_ctx *ctx, bst_engine *engine) BST_MUST_CHECK;
/* Earliest tick at which an instance wants to be stepped. */
int64_t bst_engine_earliest(const instance *self);

/* Sets the tick of an instance's next step and restores the order of its heap.
 *
 * Given:     instance  index of the instance
 *            due       tick */
void bst_engine_set_due(bst_engine *engine, int instance, int64_t due);

/* engine.c: the steps of one tick in a heap; *failed: the instance whose step failed. */
bst_status bst_engine_step_tick(bst_ctx *ctx, bst_engine *engine, bst_heap *heap, int64_t tick,
                                bool *long_step, int *failed) BST_MUST_CHECK;

/* Frees the pacing of an engine (pacing.c); NULL is allowed. */
void bst_pacing_free(bst_pacing *pacing);
/* Whether ticks wait for their time. */
bool bst_pacing_by_clock(const bst_engine *engine);
/* Waits until a tick's time has come; the first one's is now. */
bst_status bst_pacing_wait(bst_ctx *ctx, bst_engine *engine, int64_t tick) BST_MUST_CHECK;
/* In the step in which an exposure ends: true when its frame is to be dropped. */
bool bst_pacing_frame(struct bst_step *step, int64_t exposure_id);
/* In the step that publishes on a paced channel. */
void bst_pacing_done(const struct bst_step *step, const channel *ch, const void *payload);
/* Scheduling of a thread, for bst_pacing_thread_give_back. */
typedef struct bst_pacing_thread {
    unsigned char saved[256];
} bst_pacing_thread;

/* Gives the calling thread the priority and processor that pacing configures.
 *
 * Returned:  *saved  earlier settings, for bst_pacing_thread_give_back
 * Notes:     warns if the operating system refuses; the run continues. */
void bst_pacing_thread_take(bst_ctx *ctx, bst_engine *engine, bst_pacing_thread *saved);
/* Restores the priority and processors of the calling thread. */
void bst_pacing_thread_give_back(const bst_engine *engine, const bst_pacing_thread *saved);

/* deferred.c: finds the instances that may be deferred and puts them last; before channels are
 * allocated */
void bst_engine_set_deferred(bst_engine *engine);

/* Ends the executor's threads and frees it (executor.c); without an executor it does nothing. */
void bst_executor_free(bst_engine *engine);

/* Runs the logical processes up to a tick, and all hooks due until then.
 *
 * Given:     until_tick  exclusive
 * Errors:    those of modules and hooks; BST_ERR_INTERRUPTED */
bst_status bst_executor_run(bst_ctx *ctx, bst_engine *engine, int64_t until_tick) BST_MUST_CHECK;
/* logical_process.c: a message was published that an input of another logical process reads. */
bst_status bst_process_reach(struct bst_step *step, const channel *ch, const slot *s,
                             channel_reader reader) BST_MUST_CHECK;

/* Records a message of a step for the hooks, which are called later (observers.c).
 *
 * Errors:    BST_ERR_MEMORY */
bst_status bst_observers_message(struct bst_step *step, const channel *ch,
                                 const void *payload) BST_MUST_CHECK;

/* Records an event of a step for the hooks, which are called later.
 *
 * Errors:    BST_ERR_MEMORY */
bst_status bst_observers_event(struct bst_step *step, const char *kind,
                               const char *text) BST_MUST_CHECK;
/* `wants` of the hooks, by one thread at a time. */
bool bst_observers_want(bst_engine *engine, channel *ch, const void *payload, int64_t tick);

static inline const bst_port *bst_instance_port(const instance *self, int port) {
    return &self->spec.desc->ports[port % self->spec.desc->port_count];
}

/* Where the channel of a port lives. */
static inline const char *bst_instance_port_scope(const instance *self, int port) {
    return self->spec.member_count > 0
               ? self->spec.members[port / self->spec.desc->port_count].scope
               : self->scope;
}

/* The slot of a position that is kept, or of the next one (position == written). */
static inline slot *bst_log_slot(const message_log *log, int64_t position) {
    int back = (int)(log->written - position);
    return &log->slots[log->head >= back ? log->head - back : log->head - back + log->depth];
}

/* The message in the slot at the head is complete. */
static inline void bst_log_advance(message_log *log) {
    log->written++;
    log->head = log->head + 1 == log->depth ? 0 : log->head + 1;
    if (log->written - log->oldest > log->depth) {
        log->oldest = log->written - log->depth;
    }
}

static inline void bst_log_lock(message_log *log) {
    if (log->copied) {
        pthread_mutex_lock(&log->lock);
    }
}
static inline void bst_log_unlock(message_log *log) {
    if (log->copied) {
        pthread_mutex_unlock(&log->lock);
    }
}

#endif
