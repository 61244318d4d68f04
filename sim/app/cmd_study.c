/* boresight study: expands a study into runs, has them executed, and makes tables of them. */
#include <cjson/cJSON.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "sim/app/app.h"
#include "sim/cli/options.h"
#include "sim/cli/stop_signals.h"
#include "sim/core/text.h"
#include "sim/core/wall_clock.h"
#include "sim/io/draft_file.h"
#include "sim/io/run_store.h"
#include "sim/registry/registry.h"
#include "sim/studies/driver.h"
#include "sim/studies/local_pool.h"
#include "sim/studies/shard_run.h"
#include "sim/studies/study_folder.h"
#include "sim/studies/tables.h"
#include "sim/study_kinds/study_devices.h"
#include "sim/study_kinds/study_kinds.h"
#include "sim/study_kinds/study_plugins.h"

enum { FAILURES_SHOWN = 5 };
/* How long a shard takes. Slurm needs a while to start each, PoCL and the star catalogue too. */
static const double SHARD_S = 4.0, SLURM_SHARD_S = 60.0;

typedef struct study_request {
    const char *out, *shard, *site, *device;
    int64_t workers, cores, emit, shard_runs;
    bool resume, dry_run, quiet, schema, help, unpinned, slurm;
    bst_study_devices devices; /* of `device` */
} study_request;

/* ------------------------------------------------------------------ execution */

typedef struct shown {
    bool on, drawn;
    double newest;
} shown;

static void show(void *user, const bst_driver_progress *p) {
    shown *s = user;
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

/* What became of the study, on the standard output. */
static void print_end(const bst_results *r, const bst_driver_outcome *o, double wall,
                      const char *out) {
    const bst_study *s = r->study;
    printf("%s: %" PRId64 " of %s in %s, %.1f s\n", s->config.name, r->done,
           bst_text_of_count((char[BST_COUNT_TEXT]){0}, s->runs, "run", "runs"),
           bst_text_of_count((char[BST_COUNT_TEXT]){0}, s->settings, "setting", "settings"), wall);
    for (int64_t i = 0; i < r->error_count && i < FAILURES_SHOWN; i++) {
        printf("  run %" PRId64 " failed: %s\n", r->errors[i].run, r->errors[i].text);
    }
    if (r->error_count > FAILURES_SHOWN) {
        printf("  and %" PRId64 " more: see status and error in the table runs\n",
               r->error_count - FAILURES_SHOWN);
    }
    if (o->missing > 0) {
        printf("  %s %s missing%s%s\n",
               bst_text_of_count((char[BST_COUNT_TEXT]){0}, o->missing, "run", "runs"),
               o->missing == 1 ? "is" : "are", *o->why ? ": " : "", o->why);
        printf("  go on: boresight study %s --resume\n", out);
    } else {
        printf("  results in %s/study.sqlite and CSV files beside it\n", out);
    }
    if (r->differing > 0) {
        printf("  warning: made twice with different results: %s\n",
               bst_text_of_count((char[BST_COUNT_TEXT]){0}, r->differing, "run", "runs"));
    }
}

/* Rows whose files are gone or cut short, as a power cut may leave them, are made again. */
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
    const study_request *request;
    const bst_study *study;
    const bst_study_kind *kind;
    const char *out; /* the folder */
    int lock;        /* its lock */
} work;

static bst_status open_pool(bst_ctx *ctx, const work *w, bst_executor *executor) {
    const study_request *r = w->request;
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

static bst_status execute(bst_ctx *ctx, const work *w, bst_results *results,
                          bst_driver_outcome *outcome) {
    const study_request *r = w->request;
    bst_executor executor;
    shown line = {.on = !r->quiet && isatty(STDERR_FILENO) == 1};
    const bst_driver_options options = {
        .out = w->out,
        .kind = w->kind,
        .shard_s = r->slurm ? SLURM_SHARD_S : SHARD_S,
        .shard_runs = r->shard_runs,
        .parallel = r->slurm ? 0 : bst_local_workers((int)r->workers, r->devices.count),
        .probe = r->slurm,
        .progress = show,
        .user = &line};
    BST_TRY(bst_results_load_folder(ctx, results, w->out, 0, w->study->runs, true));
    forget_what_is_gone(ctx, results, w->kind, w->out);
    if (r->slurm) {
        BST_TRY(bst_study_slurm(ctx, r->site, r->device ? r->device : "", w->out, &executor));
    } else {
        BST_TRY(open_pool(ctx, w, &executor));
    }
    bst_status status = bst_driver_run(ctx, results, &executor, &options, outcome);
    executor.close(executor.self);
    if (line.drawn) {
        fputs("\r\033[K", stderr);
    }
    return status;
}

static int run_study(bst_ctx *ctx, const study_request *r, const bst_study *study,
                     const bst_study_kind *kind, const char *out) {
    bst_results results;
    bst_driver_outcome outcome = {0};
    int lock;
    double started = bst_wall_seconds();
    if (bst_results_create(ctx, study, kind, &results) != BST_OK) {
        fprintf(stderr, "boresight: %s\n", ctx->message);
        return BST_EXIT_FAILED;
    }
    bst_status status = bst_study_folder_open(ctx, study, out, r->resume, false, &lock);
    if (status == BST_OK) {
        bst_draft_sweep(out); /* under the lock: a driver's that was killed */
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
        print_end(&results, &outcome, bst_wall_seconds() - started, out);
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

/* ------------------------------------------------------------------ one shard, by hand */

/* "3/8": the third of eight equal parts; "40:20": 20 runs from run 40 on, *exact. */
static bst_status parse_shard(bst_ctx *ctx, const char *text, int64_t runs,
                              bst_study_shard_job *job, bool *exact) {
    int64_t i, n;
    char rest;
    *exact = sscanf(text, "%" SCNd64 ":%" SCNd64 "%c", &i, &n, &rest) == 2;
    if (*exact && i >= 0 && n >= 1 && i < runs && n <= runs - i) {
        job->first = i;
        job->count = n;
        return BST_OK;
    }
    if (sscanf(text, "%" SCNd64 "/%" SCNd64 "%c", &i, &n, &rest) != 2 || n < 1 || i < 1 || i > n ||
        n > 1000000000) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "--shard %s: I/N is expected, from 1/N to N/N, such as 3/8, or FIRST:COUNT "
                        "within the study's %" PRId64 " runs",
                        text, runs);
    }
    job->first = (int64_t)((double)runs * (double)(i - 1) / (double)n);
    job->count = (int64_t)((double)runs * (double)i / (double)n) - job->first;
    return BST_OK;
}

static bst_status run_part(bst_ctx *ctx, const bst_study_shard_job *part, bst_shard_worker *worker,
                           bst_results *results, int64_t *done) {
    bst_status status = BST_OK;
    int64_t run = part->first, end = part->first + part->count;
    while (status == BST_OK && run < end) {
        bst_study_shard_job job = {.first = run};
        bst_study_shard_news news;
        while (run < end && results->state[run] == BST_ROW_MISSING && job.count < 5000) {
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

static int run_shard(bst_ctx *ctx, const study_request *r, const bst_study *study,
                     const bst_study_kind *kind, const char *out) {
    bst_study_shard_job part = {0};
    bst_results results;
    int lock = -1;
    int64_t done = 0;
    bool exact;
    if (parse_shard(ctx, r->shard, study->runs, &part, &exact) != BST_OK) {
        return bst_options_misuse(ctx, "study");
    }
    bst_status status = bst_results_create(ctx, study, kind, &results);
    /* a driver that is at work holds the folder's lock, and asks for exact runs */
    if (status == BST_OK && !exact) {
        status = bst_study_folder_open(ctx, study, out, true, true, &lock);
    }
    if (status == BST_OK) {
        status = bst_results_load_folder(ctx, &results, out, part.first, part.count, false);
    }
    if (status == BST_OK) {
        int64_t number = exact ? 0 : strtoll(r->shard, NULL, 10) - 1;
        bst_shard_worker worker = {.study = study,
                                   .kind = kind,
                                   .out = out,
                                   .place = {bst_local_settle(0, 1, (int)r->cores, true),
                                             bst_study_device(&r->devices, number)}};
        status = run_part(ctx, &part, &worker, &results, &done);
        bst_shard_worker_close(&worker);
    }
    if (status != BST_OK) {
        fprintf(stderr, "boresight: %s\n", ctx->message);
    } else {
        printf("runs %" PRId64 " to %" PRId64 ": %" PRId64
               " made; tables when all are there: "
               "boresight study %s --resume\n",
               part.first, part.first + part.count - 1, done, out);
    }
    bst_results_free(&results);
    if (lock >= 0) {
        close(lock);
    }
    return status == BST_OK                ? BST_EXIT_OK
           : status == BST_ERR_INTERRUPTED ? BST_EXIT_INTERRUPTED
                                           : BST_EXIT_FAILED;
}

/* ------------------------------------------------------------------ without execution */

static bst_status emit(bst_ctx *ctx, const study_request *r, const bst_study *study,
                       const bst_study_kind *kind) {
    if (r->emit >= study->runs) {
        return bst_fail(ctx, BST_ERR_NOT_FOUND,
                        "--emit %" PRId64 ": the study has runs 0 to %" PRId64, r->emit,
                        study->runs - 1);
    }
    bst_study_value *values = calloc(BST_STUDY_AXES, sizeof *values);
    cJSON *settings = NULL;
    bst_study_run run = {.study = study, .place = bst_study_place_of(study, r->emit)};
    if (!values) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a run");
    }
    bst_study_values(study, &run.place, values);
    bst_status status =
        bst_study_document(ctx, study, &run.place, values, &run.scenario, &settings);
    run.settings = settings;
    if (status == BST_OK) {
        status = kind->emit(ctx, kind->user, &run, stdout, stderr);
    }
    bst_json_free(run.scenario);
    cJSON_Delete(settings);
    free(values);
    return status;
}

static int print_schema(void) {
    cJSON *node = bst_study_schema();
    char *text = node ? cJSON_Print(node) : NULL;
    cJSON_Delete(node);
    bool ok = text && printf("%s\n", text) > 0 && fflush(stdout) == 0;
    free(text);
    return ok ? BST_EXIT_OK : BST_EXIT_FAILED;
}

static const char help_text[] =
    "usage: boresight study STUDY.json [options]\n"
    "       boresight study FOLDER --resume\n"
    "\n"
    "Goes through the settings of a study (docs/how-to/studies.md), runs each as often as it says, "
    "and\n"
    "makes tables of the results: FOLDER/study.sqlite and CSV files. Runs are executed by worker\n"
    "processes, each on cores of its own. What is done is safe: after Ctrl-C or a crash --resume\n"
    "does the rest, and the tables are the same. Every run can be made again by itself.\n"
    "\n"
    "  boresight study scenarios/studies/pd_trade.json --dry-run\n"
    "  boresight study scenarios/studies/pd_trade.json --out studies/pd\n"
    "  boresight study scenarios/studies/pd_trade.json --emit 17 > run17.json\n"
    "\n"
    "Exit codes: 0 all runs done, 1 some are missing, 4 all done but some failed by themselves,\n"
    "130 interrupted.\n"
    "\n"
    "options:\n";

static bool is_folder(const char *path) {
    struct stat info;
    return stat(path, &info) == 0 && S_ISDIR(info.st_mode);
}

static int command(bst_ctx *ctx, const study_request *r, const char *given) {
    char file[4200], out[4200];
    bst_study study;
    bool folder = is_folder(given);
    snprintf(file, sizeof file, folder ? "%.4000s/study.json" : "%.4000s", given);
    if (bst_study_open(ctx, file, bst_registry_tables(), &study) != BST_OK) {
        fprintf(stderr, "boresight: %s\n", ctx->message);
        return BST_EXIT_FAILED;
    }
    bst_study_plugins plugins = {.count = 0};
    bst_study_kind with_plugins = *bst_study_kind_of(study.config.kind);
    const bst_study_kind *kind = &with_plugins;
    with_plugins.user = &plugins;
    snprintf(out, sizeof out, "%s%.4000s", r->out || folder ? "" : "studies/",
             r->out   ? r->out
             : folder ? given
                      : study.config.name);
    bst_status status = BST_OK;
    int code = BST_EXIT_OK;
    if (r->emit >= 0) {
        status = emit(ctx, r, &study, kind);
    } else {
        snprintf(file, sizeof file, "%.4000s/study.json", out);
        bool checked = r->shard && access(file, F_OK) == 0; /* by who made the folder */
        status = checked ? BST_OK : bst_study_check(ctx, &study, kind);
        study.notes = plugins.notes;
        study.note_count = plugins.count;
        if (status == BST_OK) {
            if (r->dry_run) {
                bst_study_print_plan(&study, kind,
                                     bst_local_workers((int)r->workers, r->devices.count),
                                     bst_study_device(&r->devices, 0), out);
            } else {
                code = r->shard ? run_shard(ctx, r, &study, kind, out)
                                : run_study(ctx, r, &study, kind, out);
            }
        }
    }
    if (status != BST_OK) {
        fprintf(stderr, "boresight: %s\n", ctx->message);
        code = status == BST_ERR_INTERRUPTED ? BST_EXIT_INTERRUPTED : BST_EXIT_FAILED;
    }
    bst_study_plugins_free(&plugins);
    bst_study_close(&study);
    return code;
}

static const bst_option OPTIONS[] = {
    {.name = "out",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(study_request, out),
     .path = BST_PATH_OUTPUT_FOLDER,
     .argument = "FOLDER",
     .doc = "where the results go (default studies/NAME)"},
    {.name = "workers",
     .kind = BST_OPTION_INT,
     .offset = offsetof(study_request, workers),
     .argument = "N",
     .doc = "worker processes (default: one a core, or one for each of --device)",
     .minimum = 1,
     .maximum = 1024},
    {.name = "cores",
     .kind = BST_OPTION_INT,
     .offset = offsetof(study_request, cores),
     .argument = "N",
     .doc = "cores of each worker (default: all, in equal parts)",
     .minimum = 1,
     .maximum = 1024},
    {.name = "device",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(study_request, device),
     .argument = "NAME,...",
     .doc = "OpenCL devices by part of a name or P:D, which the workers take in turn"},
    {.name = "slurm",
     .kind = BST_OPTION_FLAG,
     .offset = offsetof(study_request, slurm),
     .doc = "execute on a cluster, as job arrays of Slurm (docs/how-to/slurm.md)"},
    {.name = "site",
     .needs = "slurm",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(study_request, site),
     .path = BST_PATH_INPUT,
     .argument = "FILE",
     .doc = "what --slurm is to know of the cluster: account, partition, time (default "
            "boresight/slurm.json in the user's configuration folder, where there is one)"},
    {.name = "resume",
     .kind = BST_OPTION_FLAG,
     .offset = offsetof(study_request, resume),
     .doc = "do what is missing of a study that was begun there"},
    {.name = "dry-run",
     .kind = BST_OPTION_FLAG,
     .offset = offsetof(study_request, dry_run),
     .doc = "only check the study, and tell its runs, time and disk"},
    {.name = "emit",
     .kind = BST_OPTION_INT,
     .offset = offsetof(study_request, emit),
     .argument = "N",
     .doc = "write the scenario of run N to the standard output, and how to run it by hand to "
            "the standard error",
     .minimum = 0,
     .maximum = 1e9},
    {.name = "shard",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(study_request, shard),
     .argument = "I/N",
     .doc = "execute part I of N here, for a scheduler of your own (or FIRST:COUNT); then "
            "--resume for the tables"},
    {.name = "shard-runs",
     .kind = BST_OPTION_INT,
     .offset = offsetof(study_request, shard_runs),
     .argument = "N",
     .doc = "runs that a worker does at a time (default: some seconds' worth)",
     .minimum = 1,
     .maximum = 1e6},
    {.name = "unpinned",
     .kind = BST_OPTION_FLAG,
     .offset = offsetof(study_request, unpinned),
     .doc = "do not bind workers to cores"},
    {.name = "schema",
     .kind = BST_OPTION_FLAG,
     .offset = offsetof(study_request, schema),
     .doc = "print the JSON Schema of studies"},
    {.name = "quiet",
     .kind = BST_OPTION_FLAG,
     .offset = offsetof(study_request, quiet),
     .doc = "no progress line"},
    {.name = "help",
     .kind = BST_OPTION_FLAG,
     .offset = offsetof(study_request, help),
     .doc = "print this"},
    {.name = NULL},
};

int bst_cmd_study(int argc, char **argv) {
    study_request r = {.emit = -1};
    bst_option table[sizeof OPTIONS / sizeof *OPTIONS];
    bst_options_bind(OPTIONS, &r, table);
    bst_ctx ctx;
    bst_ctx_init(&ctx, bst_cli_log, NULL, BST_LOG_WARNING);
    int arguments = 0;
    if (bst_options_parse(&ctx, table, argc, argv, &arguments) != BST_OK) {
        return bst_options_misuse(&ctx, "study");
    }
    if (r.help) {
        fputs(help_text, stdout);
        bst_options_print(stdout, table);
        return BST_EXIT_OK;
    }
    const char *const errands[] = {r.schema ? "schema" : NULL, r.emit >= 0 ? "emit" : NULL,
                                   r.dry_run ? "dry-run" : NULL, r.resume ? "resume" : NULL,
                                   r.shard ? "shard" : NULL};
    if (bst_options_one_of(&ctx, errands, sizeof errands / sizeof *errands) != BST_OK) {
        return bst_options_misuse(&ctx, "study");
    }
    if (r.slurm && r.workers > 0) {
        bst_fail(&ctx, BST_ERR_ARGUMENT, "--workers is of this machine, --slurm of a cluster");
        return bst_options_misuse(&ctx, "study");
    }
    if (arguments != !r.schema) {
        bst_fail(&ctx, BST_ERR_ARGUMENT, "%s study file is expected, %d were given",
                 r.schema ? "with --schema no" : "one", arguments);
        return bst_options_misuse(&ctx, "study");
    }
    if (r.schema) {
        return print_schema();
    }
    if (bst_study_devices_read(&ctx, r.device, &r.devices) != BST_OK) {
        return bst_options_misuse(&ctx, "study");
    }
    bst_stop_catch_signals();
    return command(&ctx, &r, argv[1]);
}
