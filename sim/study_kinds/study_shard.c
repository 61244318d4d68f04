#include "sim/study_kinds/study_shard.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include "sim/cli/command_line.h"
#include "sim/studies/local_pool.h"
#include "sim/studies/results.h"
#include "sim/studies/shard_range.h"
#include "sim/studies/shard_run.h"
#include "sim/studies/study_folder.h"

enum { SHARD_RUNS = 5000 };

/* Executes those runs of `part` that have no results, in shards of at most SHARD_RUNS. */
static bst_status run_part(bst_ctx *ctx, const bst_study_shard_job *part, bst_shard_worker *worker,
                           bst_results *results, int64_t *done) {
    bst_status status = BST_OK;
    int64_t run = part->first, end = part->first + part->count;
    while (status == BST_OK && run < end) {
        bst_study_shard_job job = {.first = run};
        bst_study_shard_news news;
        while (run < end && results->state[run] == BST_ROW_MISSING && job.count < SHARD_RUNS) {
            job.count++;
            run++;
        }
        if (job.count > 0) {
            status = bst_shard_execute(ctx, worker, &job, NULL, NULL, &news);
            *done += news.runs_done;
        } else {
            run++;
        }
    }
    return status;
}

int bst_study_execute_shard(bst_ctx *ctx, const bst_study_request *r, const bst_study *study,
                            const bst_study_kind *kind, const char *out) {
    bst_study_shard_job part = {0};
    bst_results results;
    int lock = -1;
    int64_t done = 0;
    bool exact;
    if (bst_study_shard_range(ctx, r->shard, study->runs, &part, &exact) != BST_OK) {
        return bst_options_misuse(ctx, "study");
    }
    bst_status status = bst_results_create(ctx, study, kind, &results);
    /* a driver at work holds the lock of the folder, and asks for exact runs */
    if (status == BST_OK && !exact) {
        status = bst_study_folder_open(ctx, study, out, true, true, &lock);
    }
    if (status == BST_OK) {
        status = bst_results_load_folder(ctx, &results, out, part.first, part.count, false);
    }
    if (status == BST_OK) {
        /* a job of an array ("env/N") has devices of its own */
        int64_t number = exact || r->shard[0] == 'e' ? 0 : strtoll(r->shard, NULL, 10) - 1;
        bst_shard_worker worker = {.study = study,
                                   .kind = kind,
                                   .out = out,
                                   .place = {bst_local_settle(0, 1, (int)r->cores, true),
                                             bst_study_device(&r->devices, number)}};
        status = run_part(ctx, &part, &worker, &results, &done);
        bst_shard_worker_close(&worker);
    }
    if (status == BST_OK) {
        printf("runs %" PRId64 " to %" PRId64 ": %" PRId64
               " made; tables when all are there: "
               "boresight study %s --resume\n",
               part.first, part.first + part.count - 1, done, out);
    }
    bst_results_free(&results);
    if (lock >= 0) {
        close(lock);
    }
    return bst_command_line_end(ctx, status);
}
