/* Inside of the executor: partition.c, logical_process.c, synchronisation.c, observers.c and
 * executor.c. See docs/explanation/executor.md. */
#ifndef BST_ENGINE_KERNEL_EXECUTOR_INTERNAL_H
#define BST_ENGINE_KERNEL_EXECUTOR_INTERNAL_H

#include "sim/engine/kernel/engine_internal.h"

enum {
    /* windows of one process whose records observers have not yet seen */
    BST_MOST_SEGMENTS = 16,
    /* steps of deferred modules that are under way behind their sensor's process */
    BST_MOST_SAMPLES = 16,
    /* A process runs ahead of the slowest one by at most so many seconds of simulated time. */
    BST_MOST_LEAD_S = 16,
    /* Records that are done in one go. */
    BST_RECORDS_AT_ONCE = 32,
    /* Frames of a process that may be held at the beginning of a window. A window ends at the tick
     * in which a frame is recorded or copied: one for observers and one for a deferred module. */
    BST_MOST_FRAMES_HELD = BST_OVERLAP_FRAMES - 2
};

/* ---- what observers are to see ---- */

/* The messages and events of one window, one after the other. */
typedef struct record_segment {
    char *bytes;
    size_t used, room;
} record_segment;

/* Of one process. `filled` and `observed` count segments and are under the executor's lock. */
typedef struct observer_log {
    record_segment segments[BST_MOST_SEGMENTS];
    int64_t filled;
    int64_t observed;
    /* of the thread that observes: what it may read, the segment that it is at, and where in it */
    int64_t readable, reading;
    size_t read;
} observer_log;

/* ---- logical processes ---- */

typedef enum process_kind {
    BST_PROCESS_SENSORS,  /* modules of one sensor, or of all that cannot be separated */
    BST_PROCESS_LINK,     /* multi-sensor modules */
    BST_PROCESS_DEFERRED, /* deferred modules of one sensor */
} process_kind;

/* What a module's `ahead` has done for a sample. */
typedef enum look_state { BST_LOOK_NONE, BST_LOOK_BUSY, BST_LOOK_DONE } look_state;

/* A tick at which a deferred process steps, with its inputs copied. */
typedef struct sample_point {
    int64_t tick;
    int64_t number; /* of those in which the module that looks ahead steps; -1: it does not */
    int64_t after;  /* tick of the one before with a number */
    look_state look;
} sample_point;

/* An input from another process. */
typedef struct process_input {
    int source;       /* process */
    port_copies mode; /* BST_COPY_EACH or BST_COPY_SAMPLED */
    const port_state *output;
    int64_t delay_ticks;
} process_input;

typedef struct logical_process {
    process_kind kind;
    int *members; /* instances, in stepping order */
    int member_count;
    process_input *inputs;
    int input_count;
    bool delivers; /* messages of another process make an instance step */
    int source;    /* of a deferred process: the process that copies its inputs; else -1 */
    int looker;    /* of a deferred process: the instance that may look ahead, -1: none */
    bool linked;   /* of sensors: the multi-sensor modules read from it */
    int frames;    /* held by observers and copies; atomic */

    /* of the thread that steps it */
    bst_heap heap;
    bst_ctx ctx;
    bst_status status;
    int64_t failed_tick;
    int failed_instance;
    int64_t last_tick; /* of its last step, -1: none */
    int64_t link_tick; /* of sensors: when inputs of the multi-sensor modules are to be copied */
    int64_t reached;   /* every tick below is done */
    int64_t tick;      /* under way */
    bool interrupted;
    bool shows_frame; /* a frame was recorded in this window */

    /* of a deferred process, of the thread that steps its source */
    int64_t sample_due; /* when a message becomes visible that makes it step */
    bool sampled;       /* in the window under way, at the tick: */
    int64_t sampled_tick;
    bool sampled_looks; /* the module that looks ahead steps */

    observer_log log;

    /* under the executor's lock */
    int64_t clock;   /* every tick below is done, and other processes may know */
    int order;       /* at tick `clock`, instances before are done */
    int64_t limit;   /* of the window under way */
    int64_t horizon; /* of the multi-sensor modules: their next step */
    bool busy;
    double took_s[2]; /* the last windows: frames come every other one */
    int windows;
    sample_point samples[BST_MOST_SAMPLES];
    int64_t first_sample, next_sample; /* those between wait for their step */
    int64_t numbered, numbers_done, last_numbered_tick;
    int looking;
    int64_t *cursors[BST_STEP_LANES]; /* of the looker's inputs */
} logical_process;

struct bst_executor {
    bst_engine *engine;
    logical_process *processes;
    int count;
    int link;         /* process of multi-sensor modules, -1: none of their own */
    bool link_ahead;  /* when it steps is known: by its periods alone */
    bool caller_only; /* the one process of sensors belongs to the calling thread, which does
                         nothing else */
    pthread_t *threads;
    int thread_count;
    pthread_mutex_t lock; /* over what follows, and what processes have under it */
    pthread_cond_t changed;
    int sleeping;
    bool running, stop;
    int64_t end; /* ticks below are to be done */
    bool interrupted;
    bool observing; /* somebody calls observers */
    int looking;
    bst_status heard; /* first failure of an observer */
    bst_ctx ctx;      /* of observers */
    pthread_mutex_t asking;
};

/* Divides a loaded engine into logical processes and connects their inputs (partition.c).
 *
 * Given:     threads  threads of the executor
 * Errors:    BST_ERR_MEMORY */
bst_status bst_partition_make(bst_ctx *ctx, bst_executor *x, int threads) BST_MUST_CHECK;
/* Frees the logical processes of an executor and their inputs. */
void bst_partition_free(bst_executor *x);

/* logical_process.c */
/* Steps a process to its limit, or until others should know how far it is. */
void bst_process_step(bst_executor *x, logical_process *self);
/* Calls a module's `ahead` for a sample. */
void bst_process_look(bst_executor *x, logical_process *self, const sample_point *sample);

/* synchronisation.c; all with the lock held */
/* Whether a process can be stepped now; then its limit is set. */
bool bst_sync_can_step(bst_executor *x, logical_process *self);
/* After a window: others learn how far the process is. */
void bst_sync_end_window(bst_executor *x, logical_process *self);
/* What deferred processes and multi-sensor modules learn from a process that is so far. */
void bst_sync_follow(bst_executor *x, const logical_process *source);
/* All records before this tick and instance are there. */
void bst_sync_complete_before(const bst_executor *x, int64_t *tick, int *order);
/* The first sample that a module may look at, NULL: none. */
sample_point *bst_sync_next_look(logical_process *self);
/* Wakes threads that wait. */
void bst_sync_wake(bst_executor *x);

/* observers.c */
/* Whether there is something to do; with the lock held. */
bool bst_observers_ready(bst_executor *x);
/* Whether much of it waits; with the lock held. */
bool bst_observers_behind(const bst_executor *x);
/* Does some of it. Called, and returns, with the lock held. */
void bst_observers_work(bst_executor *x);
/* Lets go of what nobody will observe. */
void bst_observers_discard(bst_executor *x);

static inline bool bst_before(int64_t tick, int order, int64_t other_tick, int other) {
    return tick < other_tick || (tick == other_tick && order < other);
}

static inline int64_t bst_tick_sum(int64_t tick, int64_t more) {
    return tick > INT64_MAX - more ? INT64_MAX : tick + more;
}

#endif
