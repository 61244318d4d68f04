/* Internal types of the parallel executor: partition.c, logical_process.c, synchronisation.c,
 * observers.c and executor.c. See docs/explanation/executor.md. */
#ifndef BST_ENGINE_KERNEL_EXECUTOR_INTERNAL_H
#define BST_ENGINE_KERNEL_EXECUTOR_INTERNAL_H

#include "sim/engine/kernel/engine_internal.h"

enum {
    /* windows of one process that observers have not yet processed */
    BST_MOST_SEGMENTS = 16,
    /* pending steps of deferred modules behind their sensor's process */
    BST_MOST_SAMPLES = 16,
    /* maximum lead of a process over the slowest one, in seconds of simulated time */
    BST_MOST_LEAD_S = 16,
    /* Records that observers process in one call. */
    BST_RECORDS_AT_ONCE = 32,
    /* Frames of a process that may be retained at the beginning of a window. A window ends at the
     * tick in which a frame is recorded or copied: one for observers and one for a
     * deferred module. */
    BST_MOST_FRAMES_HELD = BST_OVERLAP_FRAMES - 2
};

/* ---- what observers are to see ---- */

/* The messages and events of one window, in sequence. */
typedef struct record_segment {
    char *bytes;
    size_t used, room;
} record_segment;

/* Records of one process for observers. `filled` and `observed` count segments; the executor's lock
 * protects them. */
typedef struct observer_log {
    record_segment segments[BST_MOST_SEGMENTS];
    int64_t filled;
    int64_t observed;
    /* used only by the observing thread: end of the readable segments, current segment, position in
     * it */
    int64_t readable, reading;
    size_t read;
} observer_log;

/* ---- logical processes ---- */

typedef enum process_kind {
    BST_PROCESS_SENSORS,  /* modules of one sensor, or of all sensors if they cannot be separated */
    BST_PROCESS_LINK,     /* multi-sensor modules */
    BST_PROCESS_DEFERRED, /* deferred modules of one sensor */
} process_kind;

/* State of a module's `ahead` for a sample. */
typedef enum look_state { BST_LOOK_NONE, BST_LOOK_BUSY, BST_LOOK_DONE } look_state;

/* A tick at which a deferred process steps; its inputs have been copied. */
typedef struct sample_point {
    int64_t tick;
    int64_t number; /* counts the samples in which the module with `ahead` steps; -1: it does not
                       step */
    int64_t after;  /* tick of the previous numbered sample */
    look_state look;
} sample_point;

/* An input that is written by another logical process. */
typedef struct process_input {
    int source;       /* index of the writing process */
    port_copies mode; /* BST_COPY_EACH or BST_COPY_SAMPLED */
    const port_state *output;
    int64_t delay_ticks;
} process_input;

typedef struct logical_process {
    process_kind kind;
    int *members; /* indices of instances, in stepping order */
    int member_count;
    process_input *inputs;
    int input_count;
    bool delivers;     /* messages of another process trigger an instance */
    int source;        /* of a deferred process: the process that copies its inputs; else -1 */
    int follower;      /* the first deferred process whose source this is; -1: none */
    int next_follower; /* of a deferred process: the next one of its source; -1: none */
    int looker;        /* of a deferred process: the instance with `ahead`; -1: none */
    bool linked;       /* of a sensor process: multi-sensor modules read from it */
    int frames;        /* frames retained by observers and copies; atomic */

    /* used only by the thread that steps the process */
    bst_heap heap;
    bst_ctx ctx;
    bst_status status;
    int64_t failed_tick;
    int failed_instance;
    int64_t last_tick; /* tick of the last step, -1: none */
    int64_t link_tick; /* of a sensor process: next tick at which inputs of multi-sensor modules are
                          copied */
    int64_t reached;   /* all ticks below are complete */
    int64_t tick;      /* current tick */
    bool interrupted;
    bool shows_frame; /* a frame was recorded in this window */

    /* of a deferred process; used by the thread that steps its source process */
    int64_t sample_due; /* tick at which the next trigger message becomes visible */
    bool sampled;       /* in the current window, at sampled_tick: */
    int64_t sampled_tick;
    bool sampled_looks; /* the module with `ahead` steps */

    observer_log log;

    /* protected by the executor's lock */
    int64_t clock;   /* all ticks below are complete, as published to other processes */
    int order;       /* at tick `clock`, the instances before this one are complete */
    int64_t limit;   /* end of the current window, exclusive */
    int64_t horizon; /* of multi-sensor modules: their next step */
    bool busy;
    double took_s[2]; /* duration of the last two windows: frames occur in every second one */
    int windows;
    sample_point samples[BST_MOST_SAMPLES];
    int64_t first_sample, next_sample; /* samples in between wait for their step */
    int64_t numbered, numbers_done, last_numbered_tick;
    int looking;
    int64_t *cursors[BST_STEP_LANES]; /* of the inputs of the module with `ahead` */
} logical_process;

struct bst_executor {
    bst_engine *engine;
    logical_process *processes;
    int count;
    int link; /* process of the multi-sensor modules; -1: they have no process of their own */
    bool link_ahead;  /* multi-sensor modules step by their periods only, so that their ticks are
                         known */
    bool caller_only; /* the only sensor process belongs to the calling thread, which does nothing
                         else */
    pthread_t *threads;
    int thread_count;
    pthread_mutex_t
        lock; /* protects all members below, and the members of processes marked above */
    pthread_cond_t changed;
    int sleeping;
    bool running, stop;
    int64_t end; /* ticks below are part of the run */
    bool interrupted;
    bool observing; /* a thread is calling observers */
    int looking;
    bst_status heard; /* first failure of an observer */
    bst_ctx ctx;      /* of the observers */
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
/* Steps the modules of a process up to its limit, or until its progress should be published. */
void bst_process_step(bst_executor *x, logical_process *self);
/* Calls a module's `ahead` for a sample of a deferred process. */
void bst_process_look(bst_executor *x, logical_process *self, const sample_point *sample);

/* synchronisation.c; call these with the lock held */
/* The clock of the slowest logical process. */
int64_t bst_sync_least_clock(const bst_executor *x);
/* Checks whether a process can be stepped now, and sets the limit of its window. least: that of
 * bst_sync_least_clock. */
bool bst_sync_can_step(bst_executor *x, logical_process *self, int64_t least);
/* Publishes the progress of a process after a window. */
void bst_sync_end_window(bst_executor *x, logical_process *self);
/* Updates deferred processes and multi-sensor modules with the progress of a process. */
void bst_sync_follow(bst_executor *x, const logical_process *source);
/* All records before this tick and instance exist. */
void bst_sync_complete_before(const bst_executor *x, int64_t *tick, int *order);
/* The first sample that a module with `ahead` may process; NULL: none. */
sample_point *bst_sync_next_look(logical_process *self);
/* Wakes the executor's waiting threads. */
void bst_sync_wake(bst_executor *x);

/* observers.c */
/* Gives the next window the largest free buffer of its process: few of them grow to the size of the
 * largest windows, not all. With the lock held. */
void bst_observers_begin_window(observer_log *log);
/* Checks whether observers have records to process; with the lock held. */
bool bst_observers_ready(bst_executor *x);
/* Checks whether half of the segments of a process wait for observers; with the lock held. */
bool bst_observers_behind(const bst_executor *x);
/* Passes up to BST_RECORDS_AT_ONCE records to the observers. Called, and returns, with the lock
 * held. */
void bst_observers_work(bst_executor *x);
/* Releases the records that no observer will receive. */
void bst_observers_discard(bst_executor *x);

static inline bool bst_before(int64_t tick, int order, int64_t other_tick, int other) {
    return tick < other_tick || (tick == other_tick && order < other);
}

static inline int64_t bst_tick_sum(int64_t tick, int64_t more) {
    return tick > INT64_MAX - more ? INT64_MAX : tick + more;
}

#endif
