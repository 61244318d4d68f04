/* Inside of the engine, shared by its files only. */
#ifndef BST_ENGINE_KERNEL_ENGINE_INTERNAL_H
#define BST_ENGINE_KERNEL_ENGINE_INTERNAL_H

#include <pthread.h>

#include "sim/engine/kernel/engine.h"

typedef struct slot {
    int64_t written_tick;
    void *payload;
    bool owned; /* the payload holds what type->release lets go of */
} slot;

/* A port that reads a channel. */
typedef struct channel_reader {
    int instance, port;
} channel_reader;

/* A channel of one scope: a ring of slots that holds the last `depth` messages. */
typedef struct channel {
    const bst_channel_type *type;
    const char *scope; /* borrowed from an instance or a member */
    int writer;        /* instance */
    int writer_port;
    slot *slots;
    int depth;
    int head;        /* slot of the next message */
    int64_t written; /* messages so far */
    size_t payload_bytes;
    int capacity;     /* items */
    double rate_hz;   /* about how often it is written */
    int64_t released; /* sequences below have been let go */
    bool apart;       /* its writer is */
    bst_hook_mark mark;
    channel_reader *readers; /* BST_PORT_IN and BST_PORT_MODIFY ports, part of engine->readers */
    int reader_count;
    bool triggers; /* one of them is stepped for its messages */
    bool paced;    /* pacing.c: its messages show that a frame has been dealt with */
} channel;

/* What an instance needs to know about one of its ports. */
typedef struct port_state {
    int channel; /* -1: optional and absent */
    int64_t delay_ticks;
    int64_t max_age_ticks;  /* 0: none */
    int64_t cursor;         /* next sequence to read */
    int64_t trigger_cursor; /* next sequence to be stepped for */
    int capacity;
    bool writing;         /* its payload was handed out and not yet published */
    int64_t silent_until; /* promised not to be written before */
    int island; /* parallel_executor.c: an output across islands: the one that it is for */
} port_state;

typedef struct instance {
    bst_instance_spec spec;
    char *scope, *name;
    void *self;
    bool created;
    bool apart; /* no other instance waits for what it writes: steps last in a tick, and beside the
                   others when overlapping */
    int port_count; /* the descriptor's; of one that links sensors, those for each */
    port_state *ports;
    int *triggers; /* ports whose messages make it step */
    int trigger_count;
    int64_t next_period, wake; /* INT64_MAX: none */
    struct bst_heap *heap;     /* that it waits in */
    int island, order;         /* parallel_executor.c: its number; place in the stepping order */
    bool reads_aside;          /* parallel_executor.c: what was put aside at the end of a span */
    int64_t steps;
    int64_t jobs, jobs_done; /* put aside and made behind the stepping thread */
    double own_rate_hz;      /* set by bst_env_set_rate */
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

/* pipeline.c: what one thread does behind the stepping one */
typedef struct bst_overlap bst_overlap;
typedef struct bst_overlap_job bst_overlap_job;
/* parallel_executor.c: sensors stepped by several threads */
typedef struct bst_islands bst_islands;
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
    bst_overlap *overlap; /* NULL: everything is done by the stepping thread... */
    bst_islands *islands; /* ...unless sensors are stepped by several */
    bst_pacing *pacing;   /* NULL: simulated time is free of the wall clock */
};

/* What a module's step sees. */
struct bst_step {
    bst_engine *engine;
    instance *self;
    bst_ctx *ctx;
    int64_t tick;
    int writing;            /* ports whose payload was handed out and not yet published */
    bst_status hook_status; /* first failure of a hook during this step */
    bst_overlap_job *job;   /* inputs of a step behind the stepping thread, else NULL */
    bool ahead;             /* of that step, and none itself */
};

/* wiring.c */
bst_status bst_engine_wire(bst_ctx *ctx, bst_engine *engine) BST_MUST_CHECK;

/* Determines readers and rates of all channels and allocates their slots.
 *
 * Errors:    BST_ERR_MEMORY and those of the wiring */
bst_status bst_engine_allocate_channels(bst_ctx *ctx, bst_engine *engine) BST_MUST_CHECK;
/* channel.c */
bst_status bst_engine_commit(struct bst_step *step) BST_MUST_CHECK;
/* Releases what the slots of queues own (frames) as soon as all readers have read them. */
void bst_engine_release_read(bst_engine *engine);
/* Increments a counter of the run's summary; any thread. Names beyond MAX_COUNTERS are dropped. */
void bst_engine_count(bst_engine *engine, const char *what);
/* Passes a hook's status on, with its message in ctx. */
bst_status bst_engine_heard(bst_ctx *ctx, const bst_engine *engine,
                            bst_status status) BST_MUST_CHECK;
/* Newest visible sequence of a port, -1 when there is none. */
int64_t bst_engine_newest(const channel *ch, const port_state *port, int64_t tick);
/* Next unread visible sequence, -1 when there is none; counts those that were overwritten. */
int64_t bst_engine_unread(bst_engine *engine, const channel *ch, port_state *port, int64_t tick);
/* Whether a message of the trigger has become visible; passes over it. */
bool bst_engine_pass_trigger(const channel *ch, port_state *port, int64_t tick);

/* A message as a reader gets it; marks and counts it as stale if it is older than the port allows.
 *
 * Given:     payload, written_tick, sequence  the message
 *            port                             port of the reader */
bst_sample bst_engine_sample(struct bst_step *step, const port_state *port, const void *payload,
                             int64_t written_tick, int64_t sequence);
/* schedule.c */
bst_status bst_engine_make_schedule(bst_ctx *ctx, bst_engine *engine) BST_MUST_CHECK;
/* Earliest tick at which an instance wants to be stepped. */
int64_t bst_engine_earliest(const bst_engine *engine, const instance *self);

/* Sets the tick of an instance's next step and restores the order of its heap.
 *
 * Given:     instance  index of the instance
 *            due       tick */
void bst_engine_set_due(bst_engine *engine, int instance, int64_t due);

/* engine.c: one step of an instance, and what it publishes. */
bst_status bst_engine_step(bst_ctx *ctx, bst_engine *engine, int index,
                           int64_t tick) BST_MUST_CHECK;

/* pacing.c */
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

/* parallel_executor.c */
void bst_islands_stop(bst_engine *engine);

/* Runs the logical processes in parallel up to a tick, and all hooks due until then.
 *
 * Given:     until_tick  exclusive
 * Errors:    those of modules and hooks; BST_ERR_INTERRUPTED */
bst_status bst_islands_run(bst_ctx *ctx, bst_engine *engine, int64_t until_tick) BST_MUST_CHECK;
/* In a step, in place of the hooks. */
bst_status bst_islands_message(struct bst_step *step, const channel *ch,
                               const void *payload) BST_MUST_CHECK;

/* Logs an event of a step for the hooks, which run later.
 *
 * Errors:    BST_ERR_MEMORY */
bst_status bst_islands_event(struct bst_step *step, const char *kind,
                             const char *text) BST_MUST_CHECK;
/* Reads from what was put aside. */
bst_sample bst_islands_latest(struct bst_step *step, int port);
/* bst_step_next for a module that serves several sensors: from the log of its inputs. */
bst_sample bst_islands_next(struct bst_step *step, int port);

/* deferred.c: finds the instances that are apart and puts them last; before channels are allocated
 */
void bst_engine_set_apart(bst_engine *engine);
/* pipeline.c */
bst_status bst_overlap_start(bst_ctx *ctx, bst_engine *engine) BST_MUST_CHECK;
/* Ends the pipeline's threads and frees it; without a pipeline it does nothing. */
void bst_overlap_stop(bst_engine *engine);
/* The following are called by the stepping thread; they fail with what failed behind it. */
bst_status bst_overlap_message(bst_ctx *ctx, bst_engine *engine, const channel *ch,
                               const void *payload, int64_t tick) BST_MUST_CHECK;

/* Puts an event into the pipeline, for the hooks in its thread.
 *
 * Errors:    those of the pipeline, if it has stopped */
bst_status bst_overlap_event(bst_ctx *ctx, bst_engine *engine, int64_t tick, const char *instance,
                             const char *kind, const char *text) BST_MUST_CHECK;
/* Steps the instances that are apart in the scope of this one, with their inputs as they are now.
 */
bst_status bst_overlap_step(bst_ctx *ctx, bst_engine *engine, int index,
                            int64_t tick) BST_MUST_CHECK;
/* Waits until all is done. */
bst_status bst_overlap_drain(bst_ctx *ctx, bst_engine *engine) BST_MUST_CHECK;
/* In a step behind: reads from what was put aside. */
bst_sample bst_overlap_latest(struct bst_step *step, int port);
/* bst_step_next for a deferred step: from the inputs that its job carries. */
bst_sample bst_overlap_next(struct bst_step *step, int port);
/* Lane of a job (bst_step_lane). */
int bst_overlap_lane(const bst_overlap_job *job);

static inline const bst_port *bst_instance_port(const instance *self, int port) {
    return &self->spec.desc->ports[port % self->spec.desc->port_count];
}

/* Where the channel of a port lives. */
static inline const char *bst_instance_port_scope(const instance *self, int port) {
    return self->spec.member_count > 0
               ? self->spec.members[port / self->spec.desc->port_count].scope
               : self->scope;
}

/* The slot of a message among the last `depth`, or of the next one (sequence == written). */
static inline slot *bst_engine_slot(const channel *ch, int64_t sequence) {
    int back = (int)(ch->written - sequence);
    return &ch->slots[ch->head >= back ? ch->head - back : ch->head - back + ch->depth];
}

#endif
