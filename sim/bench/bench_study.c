/* Benchmark of a study with 100,000 runs that only record their summary: expansion into documents,
 * shard rows, aggregation; a run draws a few random numbers. */
#include <dirent.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "boresight/rng.h"
#include "sim/bench/bench.h"
#include "sim/core/wall_clock.h"
#include "sim/io/manifest.h"
#include "sim/studies/results.h"
#include "sim/studies/shard_run.h"
#include "sim/studies/tables.h"
#include "sim/study_kinds/study_kinds.h"

enum { RUNS = 100000, SHARD = 5000 };

static const char study_text[] =
    "{\"boresight_study\": 1, \"name\": \"bench\", \"scenarios\": [{\"file\": \"%s\"}], "
    "\"sweeps\": [{\"axes\": [{\"path\": \"/observers/0/sensors/0/camera/read_noise_e\", \"from\": "
    "1, \"to\": 20, \"count\": 100}]}, {\"design\": \"latin_hypercube\", \"points\": 10, \"axes\": "
    "[{\"path\": \"/observers/0/sensors/0/camera/aperture_m\", \"from\": 0.1, \"to\": 1}]}], "
    "\"dispersions\": [{\"path\": \"/observers/0/sensors/0/camera/throughput\", \"distribution\": "
    "\"normal\", \"mean\": 1, \"sigma\": 0.05, \"apply\": \"multiply\"}], \"replicates\": 100}";

static bst_status run_nothing(bst_ctx *ctx, void *worker, const bst_study_run *run,
                              bst_study_result *out) {
    (void)ctx;
    (void)worker;
    bst_rng_key key = bst_rng_make_key(1, 0, "bench", "study");
    for (int m = 0; m < 20; m++) {
        out->metrics[m] = bst_rng_uniform(key, (uint64_t)run->place.run, (uint64_t)m);
    }
    return BST_OK;
}

static void take_away(const char *folder) {
    DIR *dir = opendir(folder);
    for (struct dirent *entry; dir && (entry = readdir(dir));) {
        char below[1024];
        struct stat info;
        if (strcmp(entry->d_name, ".") == 0 || strcmp(entry->d_name, "..") == 0) {
            continue;
        }
        snprintf(below, sizeof below, "%.600s/%.300s", folder, entry->d_name);
        if (lstat(below, &info) == 0 && S_ISDIR(info.st_mode)) {
            take_away(below);
        } else {
            unlink(below);
        }
    }
    if (dir) {
        closedir(dir);
    }
    rmdir(folder);
}

static bst_status make_rows(bst_ctx *ctx, const bst_study *study, const bst_study_kind *kind,
                            const char *folder) {
    bst_shard_worker worker = {.study = study, .kind = kind, .out = folder, .place = {1, ""}};
    bst_status status = BST_OK;
    for (int64_t first = 0; first < RUNS && status == BST_OK; first += SHARD) {
        const bst_study_shard_job job = {.first = first, .count = SHARD};
        bst_study_shard_news news;
        status = bst_shard_execute(ctx, &worker, &job, NULL, NULL, &news);
    }
    bst_shard_worker_close(&worker);
    return status;
}

static bst_status measure(bst_ctx *ctx, const char *folder, const char *file,
                          bst_bench_result *out) {
    bst_study study;
    bst_results results;
    bst_study_kind kind = bst_study_loop_kind;
    kind.run = run_nothing;
    kind.series_count = 0;
    double started = bst_wall_seconds();
    BST_TRY(bst_study_open(ctx, file, NULL, &study));
    bst_status status = bst_results_create(ctx, &study, &kind, &results);
    if (status == BST_OK) {
        status = make_rows(ctx, &study, &kind, folder);
        double expanded = bst_wall_seconds(), loaded = expanded;
        if (status == BST_OK) {
            status = bst_results_load_folder(ctx, &results, folder, 0, RUNS, false);
            loaded = bst_wall_seconds();
        }
        if (status == BST_OK) {
            status = bst_study_write_tables(ctx, &results, folder);
        }
        double ended = bst_wall_seconds();
        out->setup_s = ended - started;
        out->frames_per_s = RUNS / (ended - started);
        out->ms_median = out->ms_min = 1e3 * (ended - started) / RUNS;
        out->phases[0] =
            (struct bst_bench_phase){"runs to rows", 1e3 * (expanded - started) / RUNS};
        out->phases[1] = (struct bst_bench_phase){"rows read", 1e3 * (loaded - expanded) / RUNS};
        out->phases[2] = (struct bst_bench_phase){"tables", 1e3 * (ended - loaded) / RUNS};
        out->phase_count = 3;
        bst_results_free(&results);
    }
    bst_study_close(&study);
    return status;
}

bst_status bst_bench_study(bst_ctx *ctx, const bst_bench *self, const bst_bench_options *options,
                           bst_bench_result *out) {
    char folder[256], path[400], scenario[4096], text[8192];
    const char *base = getenv("TMPDIR");
    (void)self;
    snprintf(folder, sizeof folder, "%.200s/boresight_bench_XXXXXX", base && *base ? base : "/tmp");
    if (!getcwd(scenario, sizeof scenario - 512) || !mkdtemp(folder)) {
        return bst_fail(ctx, BST_ERR_IO, "%s: cannot be made: %s", folder, strerror(errno));
    }
    size_t used = strlen(scenario);
    snprintf(scenario + used, sizeof scenario - used, "/%.500s", options->scenario);
    snprintf(text, sizeof text, study_text,
             *options->scenario == '/' ? options->scenario : scenario);
    snprintf(path, sizeof path, "%s/shards", folder);
    bst_status status = mkdir(path, 0777) == 0
                            ? BST_OK
                            : bst_fail(ctx, BST_ERR_IO, "%s: %s", path, strerror(errno));
    snprintf(path, sizeof path, "%s/bench.json", folder);
    if (status == BST_OK) {
        status = bst_io_write_file_atomic(ctx, path, text, strlen(text));
    }
    if (status == BST_OK) {
        status = measure(ctx, folder, path, out);
    }
    take_away(folder);
    return status;
}
