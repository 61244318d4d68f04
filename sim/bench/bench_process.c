#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/types.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "sim/bench/bench.h"
#include "sim/core/compare.h"

bst_bench_result bst_bench_nothing(const char *name) {
    return (bst_bench_result){.name = name,
                              .frames_per_s = NAN,
                              .ms_median = NAN,
                              .ms_min = NAN,
                              .cpu_ms = NAN,
                              .latency_ms = NAN,
                              .error_sigma_max = NAN,
                              .error_sigma_rms = NAN,
                              .error_peak_max = NAN,
                              .flux_error_rel = NAN,
                              .centroid_error_px = NAN,
                              .predicted_error_sigma = NAN,
                              .peak_rss_mib = NAN,
                              .setup_s = NAN,
                              .ms_max = NAN,
                              .error_px = NAN,
                              .error_m = NAN,
                              .detections = NAN,
                              .detections_lost = NAN};
}

static double clock_ms(clockid_t id) {
    struct timespec now;
    clock_gettime(id, &now);
    return 1e3 * (double)now.tv_sec + 1e-6 * (double)now.tv_nsec;
}

double bst_bench_wall_s(void) {
    return 1e-3 * clock_ms(CLOCK_MONOTONIC);
}

void bst_bench_start(bst_bench_clock *clock) {
    clock->cpu_started_ms = clock_ms(CLOCK_PROCESS_CPUTIME_ID);
    clock->started_ms = clock_ms(CLOCK_MONOTONIC);
}

void bst_bench_stop(bst_bench_clock *clock, int calls) {
    double ms = clock_ms(CLOCK_MONOTONIC) - clock->started_ms;
    clock->cpu_total_ms += (clock_ms(CLOCK_PROCESS_CPUTIME_ID) - clock->cpu_started_ms) / calls;
    if (clock->count < BST_BENCH_TIMES) {
        clock->ms[clock->count++] = ms / calls;
    }
}

double bst_bench_median(double *times, int count) {
    qsort(times, (size_t)count, sizeof *times, bst_compare_doubles);
    return 0.5 * (times[(count - 1) / 2] + times[count / 2]);
}

void bst_bench_summarise(bst_bench_clock *clock, bst_bench_result *out) {
    if (clock->count == 0) {
        return;
    }
    out->ms_median = bst_bench_median(clock->ms, clock->count);
    out->ms_min = clock->ms[0];
    out->frames_per_s = 1e3 / out->ms_median;
    out->cpu_ms = clock->cpu_total_ms / clock->count;
}

double bst_bench_peak_rss_mib(void) {
    struct rusage usage;
    getrusage(RUSAGE_SELF, &usage);
    return (double)usage.ru_maxrss / 1024.0;
}

/* Header in the pipe before the data of the task. */
typedef struct outcome {
    bst_status status;
    char message[sizeof((bst_ctx *)0)->message];
} outcome;

static bool write_all(int fd, const void *data, size_t bytes) {
    const char *p = data;
    while (bytes > 0) {
        ssize_t n = write(fd, p, bytes);
        if (n < 0 && errno != EINTR) {
            return false;
        }
        p += n > 0 ? n : 0;
        bytes -= n > 0 ? (size_t)n : 0;
    }
    return true;
}

static bool read_all(int fd, void *data, size_t bytes) {
    char *p = data;
    while (bytes > 0) {
        ssize_t n = read(fd, p, bytes);
        if (n == 0 || (n < 0 && errno != EINTR)) {
            return false;
        }
        p += n > 0 ? n : 0;
        bytes -= n > 0 ? (size_t)n : 0;
    }
    return true;
}

bst_status bst_bench_apart(bst_ctx *ctx, bst_bench_task task, void *user, void *out, size_t bytes) {
    int ends[2];
    fflush(NULL);
    if (pipe(ends) != 0) {
        return bst_fail(ctx, BST_ERR_IO, "cannot start a process to measure in: %s",
                        strerror(errno));
    }
    pid_t child = fork();
    if (child < 0) {
        close(ends[0]);
        close(ends[1]);
        return bst_fail(ctx, BST_ERR_IO, "cannot start a process to measure in: %s",
                        strerror(errno));
    }
    outcome end = {.status = BST_OK};
    if (child == 0) {
        close(ends[0]);
        end.status = task(ctx, user, out);
        memcpy(end.message, ctx->message, sizeof end.message);
        bool ok = write_all(ends[1], &end, sizeof end) && write_all(ends[1], out, bytes);
        fflush(NULL);
        _exit(ok ? 0 : 1);
    }
    close(ends[1]);
    bool ok = read_all(ends[0], &end, sizeof end) && read_all(ends[0], out, bytes);
    close(ends[0]);
    int code = 0;
    while (waitpid(child, &code, 0) < 0 && errno == EINTR) {
    }
    if (!ok) {
        return WIFSIGNALED(code)
                   ? bst_fail(ctx, BST_ERR_STATE, "the measuring process died of signal %d",
                              WTERMSIG(code))
                   : bst_fail(ctx, BST_ERR_STATE, "the measuring process ended early");
    }
    return end.status == BST_OK ? BST_OK : bst_fail(ctx, end.status, "%s", end.message);
}
