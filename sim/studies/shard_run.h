/* Executes the runs of a shard and publishes their rows. */
#ifndef BST_STUDIES_SHARD_RUN_H
#define BST_STUDIES_SHARD_RUN_H

#include "sim/studies/executor.h"
#include "sim/studies/kind.h"

/* State of a worker process between shards. */
typedef struct bst_shard_worker {
    const bst_study *study;
    const bst_study_kind *kind;
    const char *out; /* the study's folder */
    bst_study_worker_place place;
    double most_s; /* > 0: trial runs, see bst_study_run */
    void *state;   /* state of the kind; created with the first run */
} bst_shard_worker;

typedef void (*bst_shard_report)(void *user, const bst_study_shard_news *news);

/* Executes one run. An error of the run itself is returned as text in `error` with BST_OK; a
 * returned error means that it could not be executed on this machine. The caller frees
 * result->series. */
bst_status bst_shard_run_one(bst_ctx *ctx, bst_shard_worker *worker, int64_t run,
                             bst_study_result *result, char error[BST_MESSAGE_BYTES],
                             double *wall_s) BST_MUST_CHECK;

/* Executes the runs of a job in order and publishes their rows, also those before an error.
 * `report` is called after each run. BST_ERR_INTERRUPTED: stop requested. *out: published rows, and
 * why it ended early. */
bst_status bst_shard_execute(bst_ctx *ctx, bst_shard_worker *worker, const bst_study_shard_job *job,
                             bst_shard_report report, void *user,
                             bst_study_shard_news *out) BST_MUST_CHECK;
/* Ends the state of a worker; the caller owns the struct. */
void bst_shard_worker_close(bst_shard_worker *worker);

#endif
