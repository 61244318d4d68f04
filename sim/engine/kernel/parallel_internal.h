/* Shared by parallel_executor.c and message_log.c only. */
#ifndef BST_ENGINE_KERNEL_PARALLEL_INTERNAL_H
#define BST_ENGINE_KERNEL_PARALLEL_INTERNAL_H

#include "sim/engine/kernel/engine_internal.h"

/* Spans that may be under way, from the first whose hooks are left to do. */
enum { BST_ISLAND_SPANS = 16 };

/* Messages, events or inputs, one after the other. */
typedef struct notes {
    char *bytes;
    size_t used, room, read;
} notes;

typedef struct island {
    bst_heap heap;
    notes notes[BST_ISLAND_SPANS];  /* what the hooks are to be told of a span */
    notes inputs[BST_ISLAND_SPANS]; /* what is read across islands, as it is at a span's end */
    bst_ctx ctx;
    bst_status status;
    int64_t failed_tick, last_tick;
    int failed_instance;
    int64_t span;      /* that it does, or will next */
    bool busy;         /* it does */
    int64_t free_tick; /* what links the islands writes nothing for it before */
    double took_s[2];  /* the last spans: frames come every other one */
} island;

struct bst_islands {
    bst_engine *engine;
    island *islands; /* the last one: what links the others */
    int count;       /* without that */
    /* islands go on to later spans while what links them, which then is one instance, reads what
     * was put aside at the end of an earlier one */
    bool ahead;
    int link; /* that instance */
    pthread_t *threads;
    int thread_count;
    pthread_mutex_t lock; /* over what follows, and `span`, `busy`, `free_tick` of islands */
    pthread_cond_t changed;
    int sleeping;
    bst_ctx *ctx; /* of who does hooks */
    bst_status heard;
    int64_t from_tick, last_tick; /* of the next span; of the run */
    int64_t link_tick;            /* when what links them steps in a span that is not yet open */
    int64_t until_tick[BST_ISLAND_SPANS];
    /* spans that were opened, are over with what links the islands, and whose hooks are done */
    int64_t opened, linked, hooked;
    int64_t end;  /* spans that are to be done; in the last of them a step failed, when... */
    bool failed;  /* ...this is set: then its hooks are for the caller */
    bool linking; /* somebody steps what links them... */
    bool hooking; /* ...or does hooks */
    bool stop;
};

/* Frees the message logs of a logical process. */
void bst_islands_free_notes(island *self);

/* Puts aside what the instance that links islands reads of this one, at the end of a span. */
bst_status bst_islands_put_aside(bst_ctx *ctx, bst_engine *engine, island *self) BST_MUST_CHECK;

/* Does up to `most` hooks of one span, none after the instance last_instance at last_tick. *all:
 * those were all. */
bst_status bst_islands_do_hooks(bst_ctx *ctx, bst_engine *engine, int64_t span, int most,
                                int64_t last_tick, int last_instance, bool *all) BST_MUST_CHECK;

static inline bool bst_islands_before(int64_t tick, int instance_, int64_t other_tick, int other) {
    return tick < other_tick || (tick == other_tick && instance_ < other);
}

#endif
