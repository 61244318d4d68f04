/* Who starts the shards of a study and tells how they ended: a pool of processes on this machine, a
 * cluster's scheduler. The driver (sim/studies/driver.h) is one and the same for all: it knows
 * which runs have no results yet, cuts them into shards, hands these over, looks into the study's
 * folder when one ended, and hands what is missing over again, with a bound. An executor therefore
 * may run a shard twice, and may lose one: results are published by the shard itself, whole, and
 * the first ones count. */
#ifndef BST_STUDIES_EXECUTOR_H
#define BST_STUDIES_EXECUTOR_H

#include <stdbool.h>
#include <stdint.h>

#include "boresight/status.h"

/* One attempt at the runs first .. first + count - 1. */
typedef struct bst_study_shard_job {
    int64_t id; /* of this attempt: 0, 1, ...: never reused while the driver lives */
    int64_t first, count;
    int32_t attempt; /* 1: the first at these runs */
} bst_study_shard_job;

typedef enum bst_study_shard_news_kind {
    BST_SHARD_AT_WORK, /* runs_done and runs_failed so far */
    BST_SHARD_ENDED,   /* it ended by itself; what it published tells what it did. A text: why it
                          could not go on (no room on the disk, no device) */
    BST_SHARD_LOST,    /* it was killed, or nothing is known of it any more; the text says so */
} bst_study_shard_news_kind;

enum { BST_SHARD_TEXT_BYTES = 480 };

/* What became of a job. After ENDED or LOST no more is told of it. */
typedef struct bst_study_shard_news {
    int64_t id;
    int64_t runs_done, runs_failed; /* of this attempt; -1: not known */
    int32_t kind;                   /* bst_study_shard_news_kind */
    char text[BST_SHARD_TEXT_BYTES];
} bst_study_shard_news;

typedef struct bst_executor {
    void *self;
    const char *name; /* "local pool" */
    /* How many more jobs it takes now: an idle worker each; a scheduler all. */
    int64_t (*room)(void *self);
    /* Takes `count` jobs, at most room. With an error none of them was started. */
    bst_status (*start)(bst_ctx *ctx, void *self, const bst_study_shard_job *jobs, int64_t count);
    /* Waits for news at most `timeout_ms` (0: not at all) and tells at most `capacity` of them in
     * *count, 0 when there are none. An error is one of the executor itself: the driver cancels. */
    bst_status (*poll)(bst_ctx *ctx, void *self, int timeout_ms, bst_study_shard_news *news,
                       int capacity, int *count);
    /* Asks all jobs to end early, having published what they have; returns at once. Each still is
     * told of as ENDED or LOST. With `now` they are killed. */
    void (*cancel)(void *self, bool now);
    /* Ends what still runs and frees self. */
    void (*close)(void *self);
} bst_executor;

#endif
