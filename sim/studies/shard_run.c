#include "sim/studies/shard_run.h"

#include <cjson/cJSON.h>
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "sim/core/wall_clock.h"
#include "sim/studies/results.h"

/* Checks whether an error is due to the machine and not to the run. */
static bool is_of_the_place(bst_status status) {
    return status == BST_ERR_IO || status == BST_ERR_MEMORY || status == BST_ERR_DEVICE ||
           status == BST_ERR_INTERRUPTED;
}

static bst_status run_documents(bst_ctx *ctx, bst_shard_worker *w, bst_study_run *run,
                                bst_study_result *result) {
    bst_study_value *values = calloc(BST_STUDY_AXES, sizeof *values);
    char folder[4096];
    cJSON *settings;
    if (!values) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a run");
    }
    bst_study_values(w->study, &run->place, values);
    bst_status status =
        bst_study_document(ctx, w->study, &run->place, values, &run->scenario, &settings);
    free(values);
    BST_TRY(status);
    run->settings = settings;
    if (w->study->config.keep != BST_KEEP_SUMMARY && w->out) {
        int n = snprintf(folder, sizeof folder, "%s/runs/%06" PRId64, w->out, run->place.run);
        run->folder = folder;
        status = n > 0 && (size_t)n < sizeof folder
                     ? BST_OK
                     : bst_fail(ctx, BST_ERR_ARGUMENT, "%s: the path is too long", w->out);
    }
    if (status == BST_OK) {
        status = w->kind->run(ctx, w->state, run, result);
    }
    bst_json_free(run->scenario);
    cJSON_Delete(settings);
    return status;
}

/* Processor time of all threads of this process so far. */
static double processor_seconds(void) {
    struct timespec used;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &used);
    return (double)used.tv_sec + 1e-9 * (double)used.tv_nsec;
}

bst_status bst_shard_run_one(bst_ctx *ctx, bst_shard_worker *w, int64_t index,
                             bst_study_result *result, char error[BST_MESSAGE_BYTES],
                             double *wall_s) {
    double started = bst_wall_seconds(), busy = processor_seconds();
    bst_study_run run = {.study = w->study,
                         .place = bst_study_place_of(w->study, index),
                         .out = w->out,
                         .most_s = w->most_s};
    memset(result, 0, sizeof *result);
    error[0] = '\0';
    if (!w->state) {
        BST_TRY(w->kind->open(ctx, w->kind->user, &w->place, &w->state));
    }
    bst_status status = run_documents(ctx, w, &run, result);
    *wall_s = bst_wall_seconds() - started;
    result->cpu_s = processor_seconds() - busy;
    if (status != BST_OK && !is_of_the_place(status)) {
        memcpy(error, ctx->message, BST_MESSAGE_BYTES);
        if (!*error) {
            strcpy(error, bst_status_name(status));
        }
        status = BST_OK;
    }
    if (status != BST_OK) {
        free(result->series);
        result->series = NULL;
        return bst_fail_prefix(ctx, status, "run %" PRId64, index);
    }
    return BST_OK;
}

bst_status bst_shard_execute(bst_ctx *ctx, bst_shard_worker *w, const bst_study_shard_job *job,
                             bst_shard_report report, void *user, bst_study_shard_news *out) {
    bst_study_shard_draft draft;
    *out = (bst_study_shard_news){.id = job->id, .kind = BST_SHARD_AT_WORK};
    bst_status status = bst_study_shard_begin(ctx, w->study, w->kind, job->first, &draft);
    for (int64_t i = 0; status == BST_OK && i < job->count; i++) {
        bst_study_result result;
        char error[BST_MESSAGE_BYTES];
        double wall_s;
        if (w->kind->stop_requested(w->kind->user)) {
            status = bst_fail(ctx, BST_ERR_INTERRUPTED, "interrupted");
            break;
        }
        status = bst_shard_run_one(ctx, w, job->first + i, &result, error, &wall_s);
        if (status == BST_OK) {
            bst_study_shard_add(&draft, &result, wall_s, *error ? error : NULL);
            free(result.series);
            out->runs_done++;
            out->runs_failed += *error != '\0';
            if (report) {
                report(user, out);
            }
        }
    }
    char why[BST_MESSAGE_BYTES];
    memcpy(why, ctx->message, sizeof why);
    bst_status published = draft.stream ? bst_study_shard_publish(ctx, &draft, w->out) : BST_OK;
    if (published != BST_OK) {
        out->runs_done = out->runs_failed = 0;
        status = status == BST_OK ? published : status;
        memcpy(why, ctx->message, sizeof why);
    }
    out->kind = BST_SHARD_ENDED;
    if (status != BST_OK) {
        snprintf(out->text, sizeof out->text, "%.*s", BST_SHARD_TEXT_BYTES - 1,
                 status == BST_ERR_INTERRUPTED ? "" : why);
        memcpy(ctx->message, why, sizeof why);
    }
    return status;
}

void bst_shard_worker_close(bst_shard_worker *w) {
    if (w->state) {
        w->kind->close(w->state);
        w->state = NULL;
    }
}
