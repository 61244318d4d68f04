#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <math.h>
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

#include "sim/app/bench.h"

extern char **environ;

enum { ROUNDS = 3, SHORT_S = 1, LONG_S = 61, PATH_BYTES = 4096 };

/* Of one run as a whole. */
typedef struct run_time {
    double wall_ms, cpu_ms;
} run_time;

static double children_cpu_ms(void) {
    struct rusage usage;
    getrusage(RUSAGE_CHILDREN, &usage);
    return 1e3 * (double)(usage.ru_utime.tv_sec + usage.ru_stime.tv_sec) +
           1e-3 * (double)(usage.ru_utime.tv_usec + usage.ru_stime.tv_usec);
}

/* `boresight run` of so many seconds in a process of its own. */
static bst_status one_run(bst_ctx *ctx, const bst_bench_options *options, const char *folder,
                          bool serial, int seconds, run_time *out) {
    char duration[16], threads[16];
    snprintf(duration, sizeof duration, "%d", seconds);
    snprintf(threads, sizeof threads, "%d", options->threads);
    const char *arguments[16] = {"boresight", "run",        "scenarios/neossat_geo_rate_open.json",
                                 "--out",     folder,       "--overwrite",
                                 "--quiet",   "--duration", duration};
    int n = 9;
    if (serial) {
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
    int failed = posix_spawn(&child, "/proc/self/exe", &quiet, NULL,
                             (char *const *)(uintptr_t)arguments, environ);
    posix_spawn_file_actions_destroy(&quiet);
    int code = 0;
    while (!failed && waitpid(child, &code, 0) < 0 && errno == EINTR) {
    }
    *out = (run_time){1e3 * (bst_bench_wall_s() - start), children_cpu_ms() - cpu};
    return !failed && WIFEXITED(code) && WEXITSTATUS(code) == 0
               ? BST_OK
               : bst_fail(ctx, BST_ERR_STATE,
                          "a run of %s did not end well (start the benchmark where scenarios/ is)",
                          arguments[2]);
}

/* Removes a run's folder, which has no folders in it, and the one it is in. */
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
    double ms[2][ROUNDS], cpu_ms[2][ROUNDS], ends_ms = INFINITY;
    run_time first; /* may have to build the kernels */
    BST_TRY(one_run(ctx, options, run, false, SHORT_S, &first));
    for (int n = 0; n < ROUNDS; n++) {
        for (int serial = 0; serial < 2; serial++) {
            run_time brief, full;
            BST_TRY(one_run(ctx, options, run, serial, SHORT_S, &brief));
            BST_TRY(one_run(ctx, options, run, serial, LONG_S, &full));
            ms[serial][n] = (full.wall_ms - brief.wall_ms) / frames;
            cpu_ms[serial][n] = (full.cpu_ms - brief.cpu_ms) / frames;
            ends_ms = fmin(ends_ms, brief.wall_ms);
        }
    }
    out->ms_median = bst_bench_median(ms[0], ROUNDS);
    out->ms_min = ms[0][0];
    out->frames_per_s = 1e3 / out->ms_median;
    out->cpu_ms = bst_bench_median(cpu_ms[0], ROUNDS);
    double serial_ms = bst_bench_median(ms[1], ROUNDS);
    out->phases[0] = (struct bst_bench_phase){"overlapped", out->ms_median};
    out->phases[1] = (struct bst_bench_phase){"overlapped_least", out->ms_min};
    out->phases[2] = (struct bst_bench_phase){"serial", serial_ms};
    out->phases[3] = (struct bst_bench_phase){"serial_least", ms[1][0]};
    out->phases[4] = (struct bst_bench_phase){"serial_cpu", bst_bench_median(cpu_ms[1], ROUNDS)};
    out->phases[5] = (struct bst_bench_phase){"start_and_end", ends_ms};
    out->phase_count = 6;
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
    snprintf(folder, sizeof folder, "%.3000s/boresight-bench-%ld", place ? place : "/tmp",
             (long)getpid());
    snprintf(run, sizeof run, "%s/run", folder);
    bst_status status = measure(ctx, options, run, out);
    clear(folder, run);
    return status;
}
