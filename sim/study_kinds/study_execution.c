#include "sim/study_kinds/study_execution.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <unistd.h>

#include "sim/cli/cli.h"
#include "sim/core/text.h"
#include "sim/core/wall_clock.h"
#include "sim/io/draft_file.h"
#include "sim/studies/driver.h"
#include "sim/studies/gather.h"
#include "sim/studies/local_pool.h"
#include "sim/studies/scheduler.h"
#include "sim/studies/slurm.h"
#include "sim/studies/study_folder.h"
#include "sim/studies/study_outcome.h"
#include "sim/studies/tables.h"
#include "sim/study_kinds/study_kinds.h"
#include "sim/study_kinds/study_plugins.h"

/* Duration of a shard. Schedulers take longer to start one, and so do PoCL and the catalogue. */
static const double SHARD_S = 4.0, SCHEDULED_SHARD_S = 60.0;

/* Progress line on the terminal. */
typedef struct progress_line {
    bool on, drawn;
    double newest;
} progress_line;

static void show(void *user, const bst_driver_progress *p) {
    progress_line *s = user;
    double now = bst_wall_seconds();
    if (!s->on || now - s->newest < 0.25) {
        return;
    }
    s->newest = now;
    s->drawn = true;
    fprintf(stderr, "\r\033[K%" PRId64 " of %" PRId64 " runs", p->done, p->runs);
    if (!isnan(p->runs_per_s)) {
        fprintf(stderr, ", %.3g a second, %.0f s left", p->runs_per_s, p->left_s);
    }
    if (p->failed > 0) {
        fprintf(stderr, ", %" PRId64 " failed", p->failed);
    }
    fflush(stderr);
}

/* Marks rows as missing whose files are gone or cut short, for example after a power cut. */
static void forget_what_is_gone(bst_ctx *ctx, bst_results *results, const bst_study_kind *kind,
                                const char *out) {
    int64_t gone = 0;
    for (int64_t i = 0; kind->intact && i < results->study->runs; i++) {
        const bst_study_run run = {
            .study = results->study, .place = bst_study_place_of(results->study, i), .out = out};
        if (results->state[i] == BST_ROW_DONE &&
            !kind->intact(kind->user, &run, results->metrics + i * kind->metric_count)) {
            bst_results_forget(results, i);
            gone++;
        }
    }
    if (gone > 0) {
        bst_log(ctx, BST_LOG_WARNING, "files of %s are gone or cut short; they are made again",
                bst_text_of_count((char[BST_COUNT_TEXT]){0}, gone, "run", "runs"));
    }
}

/* A study that is executed. */
typedef struct work {
    const bst_study_request *request;
    const bst_study *study;
    const bst_study_kind *kind;
    const char *out; /* the folder */
    int lock;        /* its lock */
} work;

static bst_status open_pool(bst_ctx *ctx, const work *w, bst_executor *executor) {
    const bst_study_request *r = w->request;
    const bst_local_pool_options pool = {.devices = r->devices.list,
                                         .device_count = r->devices.count,
                                         .cores = (int)r->cores,
                                         .study = w->study,
                                         .kind = w->kind,
                                         .out = w->out,
                                         .workers = (int)r->workers,
                                         .lock_fd = w->lock,
                                         .unpinned = r->unpinned};
    return bst_local_pool_open(ctx, &pool, executor);
}

/* Starts the executor that the request asks for. */
static bst_status open_executor(bst_ctx *ctx, const work *w, bst_executor *executor) {
    const bst_study_request *r = w->request;
    const char *device = r->device ? r->device : "";
    return r->slurm       ? bst_study_slurm(ctx, r->site, device, w->out, executor)
           : r->scheduler ? bst_study_scheduler(ctx, r->scheduler, device, w->out, executor)
                          : open_pool(ctx, w, executor);
}

bst_status bst_study_check_inputs(bst_ctx *ctx, const bst_study_request *r) {
    for (int i = 0; i < r->part_count; i++) {
        BST_TRY(bst_study_gather_check(ctx, r->parts[i]));
    }
    bst_slurm_site site;
    if (r->slurm) {
        BST_TRY(bst_study_site_load(ctx, r->site, &site));
    }
    bst_scheduler scheduler;
    return r->scheduler ? bst_scheduler_load(ctx, r->scheduler, &scheduler) : BST_OK;
}

/* Loads and copies the rows of the folders of --gather; executes nothing. */
static bst_status gather(bst_ctx *ctx, const work *w, bst_results *results,
                         bst_driver_outcome *outcome) {
    for (int i = 0; i < w->request->part_count; i++) {
        int64_t files;
        BST_TRY(bst_study_gather(ctx, results, w->request->parts[i], w->out, &files));
    }
    forget_what_is_gone(ctx, results, w->kind, w->out);
    outcome->done = results->done;
    outcome->failed = results->failed;
    outcome->missing = w->study->runs - results->done;
    return BST_OK;
}

static bst_status execute(bst_ctx *ctx, const work *w, bst_results *results,
                          bst_driver_outcome *outcome) {
    const bst_study_request *r = w->request;
    bst_executor executor;
    bool scheduled = r->slurm || r->scheduler;
    progress_line line = {.on = !r->quiet && isatty(STDERR_FILENO) == 1};
    const bst_driver_options options = {
        .out = w->out,
        .kind = w->kind,
        .shard_s = scheduled ? SCHEDULED_SHARD_S : SHARD_S,
        .shard_runs = r->shard_runs,
        .parallel = scheduled ? 0 : bst_local_workers((int)r->workers, r->devices.count),
        .probe = scheduled,
        .progress = show,
        .user = &line};
    BST_TRY(bst_results_load_folder(ctx, results, w->out, 0, w->study->runs, true));
    if (r->gather) {
        return gather(ctx, w, results, outcome);
    }
    forget_what_is_gone(ctx, results, w->kind, w->out);
    BST_TRY(open_executor(ctx, w, &executor));
    bst_status status = bst_driver_run(ctx, results, &executor, &options, outcome);
    executor.close(executor.self);
    if (line.drawn) {
        fputs("\r\033[K", stderr);
    }
    return status;
}

int bst_study_execute(bst_ctx *ctx, const bst_study_request *r, const bst_study *study,
                      const bst_study_kind *kind, const char *out) {
    bst_results results;
    bst_driver_outcome outcome = {0};
    int lock = -1;
    double started = bst_wall_seconds();
    if (bst_results_create(ctx, study, kind, &results) != BST_OK) {
        fprintf(stderr, "boresight: %s\n", ctx->message);
        return BST_EXIT_FAILED;
    }
    bst_status status = bst_study_check_inputs(ctx, r);
    if (status == BST_OK) {
        status = bst_study_folder_open(ctx, study, out, r->resume || r->gather, false, &lock);
    }
    if (status == BST_OK) {
        bst_draft_sweep(out); /* drafts of a driver that was killed; the lock is held */
        status = bst_study_plugins_settle(ctx, kind->user, out);
    }
    if (status == BST_OK) {
        const work w = {r, study, kind, out, lock};
        status = execute(ctx, &w, &results, &outcome);
    }
    if (status == BST_OK && outcome.missing == 0) {
        bst_results_sort(&results);
        status = kind->finish ? kind->finish(ctx, kind->user, &results, out) : BST_OK;
        if (status == BST_OK) {
            status = bst_study_write_tables(ctx, &results, out);
        }
    }
    if (status == BST_OK || status == BST_ERR_INTERRUPTED) {
        bst_study_print_outcome(stdout, &results, &outcome, bst_wall_seconds() - started, out);
    } else {
        fprintf(stderr, "boresight: %s\n", ctx->message);
    }
    int code = status == BST_ERR_INTERRUPTED         ? BST_EXIT_INTERRUPTED
               : status != BST_OK || outcome.missing ? BST_EXIT_FAILED
               : results.failed > 0                  ? BST_EXIT_RUNS_FAILED
                                                     : BST_EXIT_OK;
    bst_results_free(&results);
    if (lock >= 0) {
        close(lock);
    }
    return code;
}
