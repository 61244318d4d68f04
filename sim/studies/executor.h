/* Interface of executors, which start the shards of a study and report how they ended: a pool of
 * processes, or the scheduler of a cluster. The driver (sim/studies/driver.h) finds missing runs,
 * cuts them into shards, reads the study's folder when a shard ends, and repeats missing runs up to
 * a limit. An executor may run a shard twice or lose it: a shard publishes its results atomically,
 * and the first ones count. */
#ifndef BST_STUDIES_EXECUTOR_H
#define BST_STUDIES_EXECUTOR_H

#include <stdbool.h>
#include <stdint.h>

#include "boresight/status.h"

/* One attempt at the runs first .. first + count - 1. */
typedef struct bst_study_shard_job {
    int64_t id; /* of this attempt: 0, 1, ...; unique during the life of the driver */
    int64_t first, count;
    int32_t attempt; /* 1: the first attempt at these runs */
} bst_study_shard_job;

typedef enum bst_study_shard_news_kind {
    BST_SHARD_AT_WORK, /* runs_done and runs_failed so far */
    BST_SHARD_ENDED,   /* it ended by itself; its published rows are its result. Text: why it could
                          not continue (disk full, no device) */
    BST_SHARD_LOST,    /* it was killed or has disappeared; see the text */
} bst_study_shard_news_kind;

enum { BST_SHARD_TEXT_BYTES = 480 };

/* State of a shard job; no news after ENDED or LOST. */
typedef struct bst_study_shard_news {
    int64_t id;
    int64_t runs_done, runs_failed; /* of this attempt; -1: unknown */
    int32_t kind;                   /* bst_study_shard_news_kind */
    char text[BST_SHARD_TEXT_BYTES];
} bst_study_shard_news;

typedef struct bst_executor {
    void *self;
    const char *name; /* name for messages, such as "local pool" */
    /* Number of further jobs that it accepts now: idle workers; a scheduler accepts all. */
    int64_t (*room)(void *self);
    /* Starts `count` jobs, at most room. After an error none was started. */
    bst_status (*start)(bst_ctx *ctx, void *self, const bst_study_shard_job *jobs, int64_t count);
    /* Waits for news for at most `timeout_ms` (0: no wait) and returns up to `capacity` news;
     * *count 0: none. An error is one of the executor: the driver cancels. */
    bst_status (*poll)(bst_ctx *ctx, void *self, int timeout_ms, bst_study_shard_news *news,
                       int capacity, int *count);
    /* Requests all jobs to end early and publish their results; returns at once. Each job is still
     * reported as ENDED or LOST. `now`: kills them. */
    void (*cancel)(void *self, bool now);
    /* Ends remaining jobs and frees self. */
    void (*close)(void *self);
} bst_executor;

#endif
