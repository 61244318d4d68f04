/* Shards of a study as jobs of any scheduler, through three commands of the user: one that submits
 * a job, one that reports the state of jobs, and one that cancels them. Where nodes share no folder
 * with the driver, the commands also bring back the files of shards. */
#ifndef BST_STUDIES_SCHEDULER_H
#define BST_STUDIES_SCHEDULER_H

#include "boresight/config.h"
#include "boresight/status.h"
#include "sim/studies/executor.h"

/* Settings of a scheduler, from a small JSON file. The commands are executed by sh -c in the
 * study's folder. */
typedef struct bst_scheduler {
    char submit[4096];  /* $1: command line of the shard, $2: FIRST:COUNT; prints the job's name */
    char poll[4096];    /* "$@": names of jobs; prints "JOB STATE [REASON]" for each */
    char cancel[4096];  /* "$@": names of jobs */
    int64_t queue_size; /* maximum jobs in the queue */
    double poll_s, grace_s, patience_s;
    double call_s; /* time that a command may take */
} bst_scheduler;

extern const bst_config_desc bst_scheduler_table[];

/* Reads the file of a scheduler. BST_ERR_CONFIG; errors of bst_json_load. */
bst_status bst_scheduler_load(bst_ctx *ctx, const char *path, bst_scheduler *out) BST_MUST_CHECK;

/* Creates the executor of a scheduler.
 *
 * Given:     study_folder  of the results; the commands start there
 *            program       NULL-terminated command line of a shard, without its "FIRST:COUNT"
 * Returned:  *out
 * Errors:    BST_ERR_IO: no such folder; BST_ERR_MEMORY
 * Ownership: ends with out->close */
bst_status bst_scheduler_create(bst_ctx *ctx, const bst_scheduler *scheduler,
                                const char *study_folder, const char *const program[],
                                bst_executor *out) BST_MUST_CHECK;

#endif
