/* Executes the runs of a shard and publishes their rows. */
#ifndef BST_STUDIES_SHARD_RUN_H
#define BST_STUDIES_SHARD_RUN_H

#include "sim/studies/executor.h"
#include "sim/studies/kind.h"

/* A process's own part: what it keeps between shards. */
typedef struct bst_shard_worker {
    const bst_study *study;
    const bst_study_kind *kind;
    const char *out; /* the study's folder */
    bst_study_worker_place place;
    double most_s; /* > 0: runs may end after so much time, see bst_study_run */
    void *state;   /* of the kind; made with the first run */
} bst_shard_worker;

typedef void (*bst_shard_report)(void *user, const bst_study_shard_news *news);

/* Executes one run. What the run itself does wrong comes as a text in `error` with BST_OK; an error
 * that is returned says that it could not be executed here and now. The caller frees
 * result->series. */
bst_status bst_shard_run_one(bst_ctx *ctx, bst_shard_worker *worker, int64_t run,
                             bst_study_result *result, char error[BST_MESSAGE_BYTES],
                             double *wall_s) BST_MUST_CHECK;

/* Executes the job's runs in order and publishes their rows, those before an error as well.
 * `report` is told after each run. BST_ERR_INTERRUPTED: the user asked to stop. *out tells what was
 * published and why it ended early. */
bst_status bst_shard_execute(bst_ctx *ctx, bst_shard_worker *worker, const bst_study_shard_job *job,
                             bst_shard_report report, void *user,
                             bst_study_shard_news *out) BST_MUST_CHECK;
/* Ends the worker's state; the struct itself belongs to the caller. */
void bst_shard_worker_close(bst_shard_worker *worker);

#endif
