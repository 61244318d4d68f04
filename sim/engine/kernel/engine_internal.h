/* Internal types and functions of the simulation engine: channels, message logs,
 * schedule, pacing. */
#ifndef BST_ENGINE_KERNEL_ENGINE_INTERNAL_H
#define BST_ENGINE_KERNEL_ENGINE_INTERNAL_H

#include <pthread.h>

#include "sim/engine/kernel/engine.h"

/* One message in a log. */
typedef struct slot {
    int64_t written_tick, sequence; /* sequence: index of the message in its channel, from 0 */
    void *payload;
    bool owned; /* the payload has a resource that type->release must release */
} slot;

/* A log of messages in the order of the ticks at which they were written (message_log.c). Positions
 * count from 0. The log of a channel is a ring of the last `depth` messages; position = sequence.
 * An input from another logical process has a copy, which grows and keeps messages until they are
 * trimmed. */
typedef struct message_log {
    slot *slots;
    int depth;
    int head;        /* index of the slot for the next message */
    int64_t written; /* number of messages so far */
    int64_t oldest;  /* position of the oldest message that is kept */
    bool copied;     /* a copy, written by another logical process: `lock` protects the log */
    int *frames;     /* of a copy: number of messages that hold a frame; atomic */
    pthread_mutex_t lock;
} message_log;

/* A port that reads a channel. */
typedef struct channel_reader {
    int instance, port;
} channel_reader;

/* A channel: messages of one type in one scope. */
typedef struct channel {
    const bst_channel_type *type;
    const char *scope; /* owned by an instance or a fleet member */
    int writer;        /* index of the instance */
    int writer_port;
    message_log log;
    size_t payload_bytes;
    int capacity;     /* items per message */
    double rate_hz;   /* estimated rate of its messages */
    int64_t released; /* messages with a smaller sequence have been released */
    int process;      /* logical process of the writer; 0 without an executor */
    bst_hook_mark mark;
    channel_reader *readers; /* BST_PORT_IN and BST_PORT_MODIFY ports, part of engine->readers */
    int reader_count;
    bool triggers; /* at least one reader is stepped by its messages */
    bool crosses;  /* at least one reader belongs to another logical process */
    bool paced;    /* pacing.c: a message on it completes a frame */
} channel;

/* How an input gets the messages of another logical process. */
typedef enum port_copies {
    BST_COPY_NONE,    /* same process: it reads the channel's log */
    BST_COPY_EACH,    /* every message is copied when it is published */
    BST_COPY_SAMPLED, /* the writer's process copies visible messages at each reader step */
} port_copies;

/* State of one port of a module instance. */
typedef struct port_state {
    int channel; /* -1: optional and absent */
    int64_t delay_ticks;
    int64_t max_age_ticks;  /* 0: none */
    message_log *log;       /* the log that an input reads; NULL: none */
    int64_t cursor;         /* next position to read */
    int64_t trigger_cursor; /* next position that triggers a step */
    int capacity;
    bool writing; /* its payload was handed out and not yet published */
    int64_t
        silent_until; /* output: tick of the declared lookahead, before which nothing is written */
    /* input from another process; the writer's process owns `copied` and `announced` */
    port_copies copies;
    int64_t copied;    /* next position of the channel to copy */
    int64_t announced; /* next position of the channel that triggers a step of the reader */
    int64_t lookahead; /* output: `silent_until` as published to other processes */
} port_state;

typedef struct instance {
    bst_instance_spec spec;
    char *scope, *name;
    void *self;
    bool created;
    bool deferred;  /* BST_MODULE_DEFERRABLE and no prompt reader: steps last in a tick, possibly in
                       its own logical process */
    int port_count; /* ports of the descriptor, times members of a multi-sensor module */
    port_state *ports;
    int *triggers; /* indices of the trigger ports */
    int trigger_count;
    int64_t next_period, wake; /* ticks; INT64_MAX: none */
    struct bst_heap *heap;     /* heap of the schedule that contains the instance */
    int order;                 /* index in the stepping order */
    int process;               /* partition.c: its logical process */
    int lane;                  /* work space of the current step */
    int64_t steps;
    double own_rate_hz; /* set by bst_env_set_rate */
    double rate_hz;
} instance;

/* schedule.c: binary heap of instances; the first is the next to be stepped. */
typedef struct bst_heap {
    int *items; /* [heap index] instance */
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
    instance **instances; /* in stepping order after bst_engine_load */
    int instance_count, instance_capacity;
    channel *channels;
    int channel_count;
    channel_reader *readers;
    int *releasable; /* channels whose payloads own resources */
    int releasable_count;
    /* schedule.c: due ticks and the heap of instances */
    int64_t *due;  /* [instance] tick of the next step */
    bst_heap heap; /* of all instances; unused with an executor */
    int *place;    /* [instance] index in its heap */
    bst_engine_hooks hooks;
    double
        asked_s; /* wall time of the last call of hooks.interrupted, also of an earlier advance */
    int64_t tick;
    bool loaded;
    bool paused;       /* an observer has asked for the end of bst_engine_advance */
    bool holds_frames; /* the newest frame of a channel is kept until the next one */
    pthread_mutex_t counting;
    counter counters[MAX_COUNTERS]; /* sorted by name */
    int counter_count;
    bst_executor *executor; /* NULL: the calling thread steps all instances */
    bst_pacing *pacing;     /* NULL: the run does not follow the wall clock */
};

/* Context of one step of a module instance. */
struct bst_step {
    bst_engine *engine;
    instance *self;
    bst_ctx *ctx;
    int64_t tick;
    int writing;            /* ports whose payload was handed out and not yet published */
    bst_status hook_status; /* first failure of an observer during this step */
    int lane;
    int64_t *ahead; /* [port] cursors of a call of `ahead`; NULL: a regular step */
};

/* Connects ports to channels and sorts the instances into stepping order (wiring.c).
 *
 * Errors:    BST_ERR_CONFIG for two instances of one name, missing or double writers, undeclared
 *            cycles; BST_ERR_MEMORY */
bst_status bst_engine_wire(bst_ctx *ctx, bst_engine *engine) BST_MUST_CHECK;

/* Determines readers and rates of all channels and allocates their slots.
 *
 * Errors:    BST_ERR_MEMORY, BST_ERR_CONFIG */
bst_status bst_engine_allocate_channels(bst_ctx *ctx, bst_engine *engine) BST_MUST_CHECK;

/* Publishes what a step has written (channel.c).
 *
 * Errors:    the first error of an observer during the step, and errors of observers of
 *            its messages */
bst_status bst_engine_commit(struct bst_step *step) BST_MUST_CHECK;
/* Releases the messages that all readers have read, on the channels that a logical
 * process writes. */
void bst_engine_release_read(bst_engine *engine, int process);
/* Increments a counter of the run's summary; any thread. Names beyond MAX_COUNTERS are dropped. */
void bst_engine_count(bst_engine *engine, const char *what);
/* Returns an observer's status and copies its message into ctx. */
bst_status bst_engine_heard(bst_ctx *ctx, const bst_engine *engine,
                            bst_status status) BST_MUST_CHECK;

/* message_log.c; the caller has locked a copy */
/* Newest position of a log that is visible at `tick` after the port's delay; -1: none. */
int64_t bst_log_newest(const message_log *log, int64_t delay, int64_t tick);
/* First visible position from *cursor on, -1: none. Counts messages that were
 * overwritten unread. */
int64_t bst_log_unread(bst_engine *engine, const message_log *log, int64_t *cursor, int64_t delay,
                       int64_t tick);
/* Skips all messages from *cursor on that are visible at `tick`; true if there was one. */
bool bst_log_pass(const message_log *log, int64_t *cursor, int64_t delay, int64_t tick);
/* Tick at which the first message from `cursor` on becomes visible; INT64_MAX: there is none. */
int64_t bst_log_next_visible(const message_log *log, int64_t cursor, int64_t delay);
/* These functions lock the copy themselves. */
bst_status bst_log_copy(bst_ctx *ctx, message_log *to, const channel *ch,
                        const slot *from) BST_MUST_CHECK;
/* Drops messages from a port's copy that no step after `tick` can read. */
void bst_log_trim(const channel *ch, port_state *port, int64_t tick);
/* Releases what the slots of a log own and frees the log's memory. */
void bst_log_free(const bst_channel_type *type, message_log *log);
/* Bytes of a message that its readers may access. */
size_t bst_log_used_bytes(const channel *ch, const void *payload);

/* Allocates the heap of instances and sets their first ticks (schedule.c).
 *
 * Errors:    BST_ERR_MEMORY */
bst_status bst_engine_make_schedule(bst_ctx *ctx, bst_engine *engine) BST_MUST_CHECK;
/* Earliest tick at which an instance is due: period, wake-up or trigger. */
int64_t bst_engine_earliest(const instance *self);

/* Sets the tick of an instance's next step and restores the order of its heap.
 *
 * Given:     instance  index of the instance
 *            due       tick */
void bst_engine_set_due(bst_engine *engine, int instance, int64_t due);

/* Steps all instances of a heap that are due in one tick. *failed: the instance whose step failed
 * (engine.c). */
bst_status bst_engine_step_tick(bst_ctx *ctx, bst_engine *engine, bst_heap *heap, int64_t tick,
                                bool *long_step, int *failed) BST_MUST_CHECK;

/* Frees the pacing of an engine (pacing.c); NULL is allowed. */
void bst_pacing_free(bst_pacing *pacing);
/* True if ticks wait for their wall-clock time. */
bool bst_pacing_by_clock(const bst_engine *engine);
/* Waits until the wall-clock time of a tick. The first tick sets the origin. */
bst_status bst_pacing_wait(bst_ctx *ctx, bst_engine *engine, int64_t tick) BST_MUST_CHECK;
/* Called at the end of an exposure: true if pacing drops the frame. */
bool bst_pacing_frame(struct bst_step *step, int64_t exposure_id);
/* Called when a message is published on a paced channel: records the response time of the frame. */
void bst_pacing_done(const struct bst_step *step, const channel *ch, const void *payload);
/* Saved scheduling of a thread, for bst_pacing_thread_give_back. */
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

/* Finds the deferred instances and moves them to the end of the stepping order (deferred.c). Call
 * it before channels are allocated. */
void bst_engine_set_deferred(bst_engine *engine);

/* Stops the executor's threads and frees it (executor.c). Without an executor it does nothing. */
void bst_executor_free(bst_engine *engine);

/* Runs the logical processes up to a tick, and calls the observers of all their messages.
 *
 * Given:     until_tick  exclusive
 * Errors:    those of modules and observers; BST_ERR_INTERRUPTED */
bst_status bst_executor_run(bst_ctx *ctx, bst_engine *engine, int64_t until_tick) BST_MUST_CHECK;
/* Copies a published message to an input of another logical process (logical_process.c). */
bst_status bst_process_reach(struct bst_step *step, const channel *ch, const slot *s,
                             channel_reader reader) BST_MUST_CHECK;

/* Records a message of a step for the observers, which are called later (observers.c).
 *
 * Errors:    BST_ERR_MEMORY */
bst_status bst_observers_message(struct bst_step *step, const channel *ch,
                                 const void *payload) BST_MUST_CHECK;

/* Records an event of a step for the observers, which are called later.
 *
 * Errors:    BST_ERR_MEMORY */
bst_status bst_observers_event(struct bst_step *step, const char *kind,
                               const char *text) BST_MUST_CHECK;
/* Calls the observers' `wants` for a message; one thread at a time. */
bool bst_observers_want(bst_engine *engine, channel *ch, const void *payload, int64_t tick);

static inline const bst_port *bst_instance_port(const instance *self, int port) {
    return &self->spec.desc->ports[port % self->spec.desc->port_count];
}

/* Scope of the channel of a port. */
static inline const char *bst_instance_port_scope(const instance *self, int port) {
    return self->spec.member_count > 0
               ? self->spec.members[port / self->spec.desc->port_count].scope
               : self->scope;
}

/* Slot of a kept position, or of the next message (position == written). */
static inline slot *bst_log_slot(const message_log *log, int64_t position) {
    int back = (int)(log->written - position);
    return &log->slots[log->head >= back ? log->head - back : log->head - back + log->depth];
}

/* Completes the message in the head slot. */
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
