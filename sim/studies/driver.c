#include "sim/studies/driver.h"

#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "sim/core/wall_clock.h"

enum { NEWS = 64, POLL_MS = 100, GRACE_S = 10, SMALL_SHARD = 16, MOST_RUNS_A_SHARD = 5000 };

/* Consecutive shards that may fail for reasons of the machine before the study is given up. */
enum { FAILURES_IN_A_ROW = 6 };

typedef struct flight {
    bst_study_shard_job job;
    int64_t done, failed; /* as reported */
    double started;
} flight;

typedef struct driver {
    bst_results *results;
    bst_executor *executor;
    const bst_driver_options *options;
    bst_driver_outcome *outcome;
    uint8_t *attempts; /* [runs] lost attempts */
    uint8_t *flying;   /* [runs] in progress */
    flight *flights;
    int64_t flight_count, flight_room, next_id;
    int64_t cursor; /* all earlier runs are complete, in progress or given up */
    int64_t given_up;
    int failures_in_a_row;
    double run_s; /* duration of a run: measured, else as given */
    double started;
    int64_t done_before;
    bool stopping;
} driver;

/* True if a run of the study is missing, not in progress and not given up. */
static bool is_free(const driver *d, int64_t run) {
    return d->results->state[run] == BST_ROW_MISSING && !d->flying[run] &&
           d->attempts[run] < BST_DRIVER_ATTEMPTS;
}

/* Number of runs of the next shard, from the duration of a run; small after a lost attempt. */
static int64_t wanted_runs(const driver *d, int attempts) {
    const bst_driver_options *o = d->options;
    int64_t missing = d->results->study->runs - d->results->done;
    double n = o->shard_runs > 0 ? (double)o->shard_runs
               : d->run_s > 0.0  ? o->shard_s / d->run_s
                                 : 1.0;
    if (o->shard_runs == 0 && o->parallel > 0) {
        n = fmin(n, ceil((double)missing / (2.0 * o->parallel)));
    }
    n = attempts == 1 ? fmin(n, SMALL_SHARD) : attempts > 1 ? 1.0 : n;
    return (int64_t)fmax(fmin(n, MOST_RUNS_A_SHARD), 1.0);
}

/* The next runs that no worker executes; count 0: none. */
static bst_study_shard_job next_job(driver *d) {
    int64_t runs = d->results->study->runs, run = d->cursor;
    while (run < runs && !is_free(d, run)) {
        run++;
    }
    d->cursor = run;
    bst_study_shard_job job = {.id = d->next_id, .first = run};
    if (run == runs) {
        return job;
    }
    int attempts = d->attempts[run];
    int64_t most = wanted_runs(d, attempts);
    while (job.count < most && run < runs && is_free(d, run) && d->attempts[run] == attempts) {
        job.count++;
        run++;
    }
    job.attempt = attempts + 1;
    return job;
}

/* Records a shard as in progress. */
static bst_status note_flight(bst_ctx *ctx, driver *d, const bst_study_shard_job *job) {
    if (d->flight_count == d->flight_room) {
        int64_t wanted = 2 * d->flight_room + 16;
        flight *grown = realloc(d->flights, (size_t)wanted * sizeof *grown);
        if (!grown) {
            return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %" PRId64 " shards", wanted);
        }
        d->flights = grown;
        d->flight_room = wanted;
    }
    d->flights[d->flight_count++] = (flight){.job = *job, .started = bst_wall_seconds()};
    memset(d->flying + job->first, 1, (size_t)job->count);
    d->next_id++;
    return BST_OK;
}

/* Passes as many shards to the executor as it accepts. */
static bst_status start_shards(bst_ctx *ctx, driver *d) {
    enum { BATCH = 256 };
    bst_study_shard_job jobs[BATCH];
    int64_t room = d->executor->room(d->executor->self), n = 0;
    if (d->options->probe && d->options->shard_runs == 0 && d->run_s <= 0.0) {
        room = d->flight_count > 0 ? 0 : 1;
    }
    while (n < BATCH && n < room) {
        jobs[n] = next_job(d);
        if (jobs[n].count == 0) {
            break;
        }
        BST_TRY(note_flight(ctx, d, &jobs[n]));
        n++;
    }
    return n > 0 ? d->executor->start(ctx, d->executor->self, jobs, n) : BST_OK;
}

/* Loads the rows that a shard published: all, or a part under its own file name. */
static bst_status take_rows(bst_ctx *ctx, driver *d, const bst_study_shard_job *job, int64_t done) {
    char path[4096];
    bst_ctx quiet = {0};
    int64_t count = done > 0 && done <= job->count ? done : job->count;
    BST_TRY(bst_study_shard_path(ctx, d->options->out, job->first, count, path, sizeof path));
    bst_status status = bst_results_load(&quiet, d->results, path);
    if (status == BST_ERR_NOT_FOUND && done != 0) {
        return bst_results_load_folder(ctx, d->results, d->options->out, job->first, job->count,
                                       true);
    }
    if (status == BST_ERR_FORMAT) {
        bst_results_reject(ctx, path, quiet.message);
        return BST_OK;
    }
    return status == BST_OK || status == BST_ERR_NOT_FOUND
               ? BST_OK
               : bst_fail(ctx, status, "%s", quiet.message);
}

/* Counts a lost attempt for the missing runs of a shard; they are repeated up to the limit. */
static void count_attempt(driver *d, const bst_study_shard_job *job, bool blame) {
    for (int64_t run = job->first; run < job->first + job->count; run++) {
        d->flying[run] = 0;
        if (d->results->state[run] == BST_ROW_MISSING && blame) {
            d->attempts[run]++;
            d->given_up += d->attempts[run] == BST_DRIVER_ATTEMPTS;
        }
    }
    d->cursor = job->first < d->cursor ? job->first : d->cursor;
}

/* Mean duration of the completed runs of a job, without start-up. */
static double mean_wall_s(const driver *d, const bst_study_shard_job *job) {
    double sum = 0.0;
    int64_t n = 0;
    for (int64_t run = job->first; run < job->first + job->count; run++) {
        if (d->results->state[run] != BST_ROW_MISSING) {
            sum += d->results->wall_s[run];
            n++;
        }
    }
    return n > 0 ? fmax(sum / (double)n, 1e-6) : 0.0;
}

/* True if a run of the shard has no result row. */
static bool has_missing(const driver *d, const bst_study_shard_job *job) {
    for (int64_t run = job->first; run < job->first + job->count; run++) {
        if (d->results->state[run] == BST_ROW_MISSING) {
            return true;
        }
    }
    return false;
}

/* Loads the rows of a shard that ended and counts the attempt if runs were lost. */
static bst_status end_shard(bst_ctx *ctx, driver *d, int64_t index,
                            const bst_study_shard_news *news) {
    flight f = d->flights[index];
    int64_t before = d->results->done;
    d->flights[index] = d->flights[--d->flight_count];
    BST_TRY(take_rows(ctx, d, &f.job, news->runs_done));
    int64_t gained = d->results->done - before;
    if (gained > 0) {
        double run_s = mean_wall_s(d, &f.job);
        d->run_s = d->run_s > 0.0 ? 0.5 * (d->run_s + run_s) : run_s;
        d->failures_in_a_row = 0;
    }
    /* a shard that ended without progress would be restarted forever */
    bool idle = gained == 0 && has_missing(d, &f.job);
    const char *why = news->text[0] || news->kind == BST_SHARD_LOST || !idle
                          ? news->text
                          : "it ended well, but none of its rows could be read";
    bool blame = !d->stopping && (news->kind == BST_SHARD_LOST || *why);
    if (blame) {
        d->outcome->attempts_lost++;
        d->failures_in_a_row += gained == 0 && news->kind != BST_SHARD_LOST;
        snprintf(d->outcome->why, sizeof d->outcome->why, "%.*s", BST_SHARD_TEXT_BYTES - 1, why);
        bst_log(ctx, BST_LOG_WARNING, "runs %" PRId64 " to %" PRId64 ", attempt %d: %s",
                f.job.first + gained, f.job.first + f.job.count - 1, (int)f.job.attempt, why);
    }
    count_attempt(d, &f.job, blame);
    return BST_OK;
}

/* Handles one message of the executor: progress or end of a shard. */
static bst_status take_news(bst_ctx *ctx, driver *d, const bst_study_shard_news *news) {
    for (int64_t i = 0; i < d->flight_count; i++) {
        flight *f = &d->flights[i];
        if (f->job.id != news->id) {
            continue;
        }
        if (news->kind != BST_SHARD_AT_WORK) {
            return end_shard(ctx, d, i, news);
        }
        f->done = news->runs_done;
        f->failed = news->runs_failed;
        if (d->run_s <= 0.0 && f->done > 0) {
            d->run_s = (bst_wall_seconds() - f->started) / (double)f->done;
        }
        return BST_OK;
    }
    return BST_OK;
}

/* Reports completed and failed runs, rate and remaining time of the study. */
static void report_progress(const driver *d) {
    if (!d->options->progress) {
        return;
    }
    bst_driver_progress p = {.runs = d->results->study->runs,
                             .done = d->results->done,
                             .failed = d->results->failed,
                             .elapsed_s = bst_wall_seconds() - d->started,
                             .runs_per_s = NAN,
                             .left_s = NAN};
    for (int64_t i = 0; i < d->flight_count; i++) {
        p.done += d->flights[i].done > 0 ? d->flights[i].done : 0;
        p.failed += d->flights[i].failed > 0 ? d->flights[i].failed : 0;
    }
    int64_t made = p.done - d->done_before;
    if (made > 0 && p.elapsed_s > 0.0) {
        p.runs_per_s = (double)made / p.elapsed_s;
        p.left_s = (double)(p.runs - p.done) / p.runs_per_s;
    }
    d->options->progress(d->options->user, &p);
}

/* Waits for news of the executor. True while there is work. */
static bst_status await_news(bst_ctx *ctx, driver *d, bool *more) {
    bst_study_shard_news news[NEWS];
    int count;
    BST_TRY(d->executor->poll(ctx, d->executor->self, POLL_MS, news, NEWS, &count));
    for (int i = 0; i < count; i++) {
        BST_TRY(take_news(ctx, d, &news[i]));
    }
    report_progress(d);
    if (!d->stopping && d->failures_in_a_row >= FAILURES_IN_A_ROW) {
        d->stopping = true;
        d->executor->cancel(d->executor->self, false);
    }
    if (!d->stopping) {
        BST_TRY(start_shards(ctx, d));
    }
    *more = d->flight_count > 0;
    return BST_OK;
}

/* Runs all shards of the study; on a stop request cancels them, after GRACE_S by force. */
static bst_status drive(bst_ctx *ctx, driver *d) {
    const bst_study_kind *kind = d->options->kind;
    bool more = true, interrupted = false;
    double stop_at = 0.0;
    BST_TRY(start_shards(ctx, d));
    more = d->flight_count > 0;
    while (more) {
        if (!interrupted && kind->stop_requested(kind->user)) {
            interrupted = d->stopping = true;
            stop_at = bst_wall_seconds() + GRACE_S;
            d->executor->cancel(d->executor->self, false);
        }
        if (interrupted && bst_wall_seconds() > stop_at) {
            stop_at = INFINITY;
            d->executor->cancel(d->executor->self, true);
        }
        BST_TRY(await_news(ctx, d, &more));
    }
    return interrupted ? bst_fail(ctx, BST_ERR_INTERRUPTED, "interrupted") : BST_OK;
}

bst_status bst_driver_run(bst_ctx *ctx, bst_results *results, bst_executor *executor,
                          const bst_driver_options *options, bst_driver_outcome *outcome) {
    size_t runs = (size_t)results->study->runs;
    memset(outcome, 0, sizeof *outcome);
    driver d = {.results = results,
                .executor = executor,
                .options = options,
                .outcome = outcome,
                .attempts = calloc(runs, 1),
                .flying = calloc(runs, 1),
                .run_s = options->run_s,
                .started = bst_wall_seconds(),
                .done_before = results->done};
    bst_status status = d.attempts && d.flying
                            ? drive(ctx, &d)
                            : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the study");
    if (status != BST_OK && status != BST_ERR_INTERRUPTED) {
        executor->cancel(executor->self, true);
    }
    outcome->done = results->done;
    outcome->failed = results->failed;
    outcome->missing = results->study->runs - results->done;
    free(d.attempts);
    free(d.flying);
    free(d.flights);
    return status;
}
