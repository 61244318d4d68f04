#define _GNU_SOURCE /* processor affinity */
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <sched.h>
#include <spawn.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/types.h>
#include <sys/wait.h>
#include <unistd.h>

#include "sim/bench/bench.h"
#include "sim/cli/shipped.h"

extern char **environ;

enum { ROUNDS = 3, SHORT_S = 1, LONG_S = 61, PATH_BYTES = 4096 };

/* Pipelined; serial with all processors; serial with one processor. */
typedef enum kind { OVERLAPPED, SERIAL, ONE_PROCESSOR, KINDS } kind;

/* Times of one complete run. */
typedef struct run_time {
    double wall_ms, cpu_ms;
} run_time;

static double children_cpu_ms(void) {
    struct rusage usage;
    getrusage(RUSAGE_CHILDREN, &usage);
    return 1e3 * (double)(usage.ru_utime.tv_sec + usage.ru_stime.tv_sec) +
           1e-3 * (double)(usage.ru_utime.tv_usec + usage.ru_stime.tv_usec);
}

/* Restricts this process and its children to the first available processor; `all`: previous set. */
static bool hold_one_processor(cpu_set_t *all, cpu_set_t *one) {
    if (sched_getaffinity(0, sizeof *all, all) != 0) {
        return false;
    }
    CPU_ZERO(one);
    for (size_t cpu = 0; cpu < CPU_SETSIZE && CPU_COUNT(one) == 0; cpu++) {
        if (CPU_ISSET(cpu, all)) {
            CPU_SET(cpu, one);
        }
    }
    return sched_setaffinity(0, sizeof *one, one) == 0;
}

/* Executes `boresight run` for that many seconds in a child process. */
static bst_status one_run(bst_ctx *ctx, const bst_bench_options *options, const char *folder,
                          kind of, int seconds, run_time *out) {
    char duration[16], threads[16];
    snprintf(duration, sizeof duration, "%d", seconds);
    snprintf(threads, sizeof threads, "%d", options->threads);
    char file[4096];
    bst_cli_shipped_file("scenarios/neossat_geo_rate_open.json", file, sizeof file);
    const char *arguments[16] = {"boresight",   "run",     file,         "--out", folder,
                                 "--overwrite", "--quiet", "--duration", duration};
    int n = 9;
    if (of != OVERLAPPED) {
        arguments[n++] = "--serial";
    }
    if (options->threads > 0) {
        arguments[n++] = "--threads";
        arguments[n++] = threads;
    }
    if (options->device) {
        arguments[n++] = "--device";
        arguments[n++] = options->device;
    }
    posix_spawn_file_actions_t quiet;
    posix_spawn_file_actions_init(&quiet);
    posix_spawn_file_actions_addopen(&quiet, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
    double cpu = children_cpu_ms(), start = bst_bench_wall_s();
    pid_t child;
    cpu_set_t all, one;
    bool held = of == ONE_PROCESSOR && hold_one_processor(&all, &one);
    int failed = posix_spawn(&child, "/proc/self/exe", &quiet, NULL,
                             (char *const *)(uintptr_t)arguments, environ);
    if (held) {
        sched_setaffinity(0, sizeof all, &all);
    }
    posix_spawn_file_actions_destroy(&quiet);
    int code = 0;
    while (!failed && waitpid(child, &code, 0) < 0 && errno == EINTR) {
    }
    *out = (run_time){1e3 * (bst_bench_wall_s() - start), children_cpu_ms() - cpu};
    return !failed && WIFEXITED(code) && WEXITSTATUS(code) == 0
               ? BST_OK
               : bst_fail(ctx, BST_ERR_STATE, "a run of %s did not end well", arguments[2]);
}

/* Removes a run's folder, which has no subfolders, and its parent. */
static void clear(const char *folder, const char *run) {
    DIR *dir = opendir(run);
    for (struct dirent *e; dir && (e = readdir(dir));) {
        if (e->d_name[0] != '.') {
            unlinkat(dirfd(dir), e->d_name, 0);
        }
    }
    if (dir) {
        closedir(dir);
    }
    rmdir(run);
    rmdir(folder);
}

static bst_status measure(bst_ctx *ctx, const bst_bench_options *options, const char *run,
                          bst_bench_result *out) {
    const double frames = LONG_S - SHORT_S;
    double ms[KINDS][ROUNDS], cpu_ms[KINDS][ROUNDS], ends_ms = INFINITY;
    run_time first; /* it may have to build the kernels */
    BST_TRY(one_run(ctx, options, run, OVERLAPPED, SHORT_S, &first));
    for (int n = 0; n < ROUNDS; n++) {
        for (int k = 0; k < KINDS; k++) {
            run_time brief, full;
            BST_TRY(one_run(ctx, options, run, (kind)k, SHORT_S, &brief));
            BST_TRY(one_run(ctx, options, run, (kind)k, LONG_S, &full));
            ms[k][n] = (full.wall_ms - brief.wall_ms) / frames;
            cpu_ms[k][n] = (full.cpu_ms - brief.cpu_ms) / frames;
            ends_ms = fmin(ends_ms, brief.wall_ms);
        }
    }
    static const char *const names[KINDS][2] = {{"overlapped", "overlapped_least"},
                                                {"serial", "serial_least"},
                                                {"one_processor", "one_processor_least"}};
    int at = 0;
    for (int k = 0; k < KINDS; k++) {
        double median = bst_bench_median(ms[k], ROUNDS); /* sorts the times */
        double times_ms[2] = {median, ms[k][0]};
        for (int i = 0; i < 2; i++, at++) {
            snprintf(out->phases[at].name, sizeof out->phases[at].name, "%s", names[k][i]);
            out->phases[at].ms = times_ms[i];
        }
    }
    out->ms_median = out->phases[0].ms;
    out->ms_min = ms[OVERLAPPED][0];
    out->frames_per_s = 1e3 / out->ms_median;
    out->cpu_ms = bst_bench_median(cpu_ms[OVERLAPPED], ROUNDS);
    out->phases[at++] =
        (struct bst_bench_phase){"serial_cpu", bst_bench_median(cpu_ms[SERIAL], ROUNDS)};
    out->phases[at++] = (struct bst_bench_phase){"start_and_end", ends_ms};
    out->phase_count = at;
    struct rusage usage;
    getrusage(RUSAGE_CHILDREN, &usage);
    out->peak_rss_mib = (double)usage.ru_maxrss / 1024.0;
    return BST_OK;
}

bst_status bst_bench_open_loop(bst_ctx *ctx, const bst_bench *self,
                               const bst_bench_options *options, bst_bench_result *out) {
    (void)self;
    const char *place = getenv("TMPDIR");
    char folder[PATH_BYTES], run[PATH_BYTES + 8];
    snprintf(folder, sizeof folder, "%.3000s/boresight-bench-XXXXXX",
             place && *place ? place : "/tmp");
    if (!mkdtemp(folder)) {
        return bst_fail(ctx, BST_ERR_IO, "%s: %s", folder, strerror(errno));
    }
    snprintf(run, sizeof run, "%s/run", folder);
    bst_status status = measure(ctx, options, run, out);
    clear(folder, run);
    return status;
}
