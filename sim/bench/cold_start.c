#include <errno.h>
#include <spawn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/types.h>
#include <sys/wait.h>
#include <unistd.h>

#include "sim/bench/bench_scenes.h"
#include "sim/core/compare.h"
#include "sim/device/device.h"

extern char **environ;

/* Steps whose ends the new process reports, in order. */
static const char *const steps[] = {"process", "device", "kernels", "scene", "first_frame"};
enum { STEPS = sizeof steps / sizeof *steps, PROCESSES = 9 };

bst_status bst_bench_first_frame(bst_ctx *ctx, const bst_bench_options *options) {
    double ends[STEPS] = {bst_bench_wall_s()};
    bst_device *device;
    BST_TRY(
        bst_device_open(ctx, options->device ? options->device : "", options->threads, &device));
    ends[1] = bst_bench_wall_s();
    const bst_bench_scene *scene = bst_bench_find_scene("acquisition");
    bst_bench_view view = {.count = 0};
    bst_renderer *renderer = NULL;
    bst_frame *frame = NULL;
    bst_status status = bst_bench_view_open(ctx, scene, &view);
    if (status == BST_OK) {
        bst_renderer_options fidelity = bst_renderer_default_options();
        fidelity.tolerance_sigma = scene->tolerance_sigma;
        status = bst_renderer_create(ctx, device, &view.camera, &fidelity, &renderer);
        status = status == BST_OK ? bst_renderer_prepare(ctx, renderer) : status;
        ends[2] = bst_bench_wall_s();
    }
    if (status == BST_OK) {
        bst_bench_view_set(&view, 0);
        ends[3] = bst_bench_wall_s();
        status = bst_renderer_render(ctx, renderer, &view.request, &frame);
    }
    if (status == BST_OK) {
        const uint16_t *pixels;
        status = bst_frame_map(frame, ctx, &pixels);
        ends[4] = bst_bench_wall_s();
        if (status == BST_OK) {
            bst_frame_unmap(frame);
        }
        bst_frame_release(frame);
    }
    bst_renderer_free(renderer);
    bst_bench_view_close(&view);
    bst_device_close(device);
    for (int i = 0; status == BST_OK && i < STEPS; i++) {
        printf("%.6f\n", ends[i]);
    }
    return status;
}

/* Starts this program in a new process and reads its times. */
static bst_status one_process(bst_ctx *ctx, const bst_bench_options *options, double *start,
                              double ends[STEPS]) {
    char threads[16];
    snprintf(threads, sizeof threads, "%d", options->threads);
    char *arguments[8] = {"boresight", "bench", "--first-frame", "--threads", threads};
    int given = options->threads > 0 ? 5 : 3;
    if (options->device) {
        arguments[given++] = "--device";
        arguments[given++] = (char *)(uintptr_t)options->device;
    }
    arguments[given] = NULL;
    int pipe_ends[2];
    if (pipe(pipe_ends) != 0) {
        return bst_fail(ctx, BST_ERR_IO, "cannot start a fresh process: %s", strerror(errno));
    }
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, pipe_ends[1], STDOUT_FILENO);
    posix_spawn_file_actions_addclose(&actions, pipe_ends[0]);
    posix_spawn_file_actions_addclose(&actions, pipe_ends[1]);
    pid_t child;
    *start = bst_bench_wall_s();
    int failed = posix_spawn(&child, "/proc/self/exe", &actions, NULL, arguments, environ);
    posix_spawn_file_actions_destroy(&actions);
    close(pipe_ends[1]);
    if (failed) {
        close(pipe_ends[0]);
        return bst_fail(ctx, BST_ERR_IO, "cannot start a fresh process: %s", strerror(failed));
    }
    FILE *stream = fdopen(pipe_ends[0], "r");
    int count = 0;
    while (stream && count < STEPS && fscanf(stream, "%lf", &ends[count]) == 1) {
        count++;
    }
    if (stream) {
        fclose(stream);
    } else {
        close(pipe_ends[0]);
    }
    int code = 0;
    while (waitpid(child, &code, 0) < 0 && errno == EINTR) {
    }
    return count == STEPS
               ? BST_OK
               : bst_fail(ctx, BST_ERR_STATE, "a fresh process did not get to its first frame");
}

bst_status bst_bench_cold_start(bst_ctx *ctx, const bst_bench *self,
                                const bst_bench_options *options, bst_bench_result *out) {
    (void)self;
    bst_bench_clock clock = {.count = 0};
    double steps_ms[STEPS][PROCESSES], cpu_ms = 0.0;
    for (int n = -1; n < PROCESSES; n++) { /* the first process fills the kernel cache */
        double start = 0.0, ends[STEPS] = {0};
        struct rusage before, after;
        getrusage(RUSAGE_CHILDREN, &before);
        BST_TRY(one_process(ctx, options, &start, ends));
        getrusage(RUSAGE_CHILDREN, &after);
        if (n < 0) {
            continue;
        }
        for (int i = 0; i < STEPS; i++) {
            steps_ms[i][n] = 1e3 * (ends[i] - (i > 0 ? ends[i - 1] : start));
        }
        clock.ms[clock.count++] = 1e3 * (ends[STEPS - 1] - start);
        cpu_ms += 1e3 * (double)(after.ru_utime.tv_sec - before.ru_utime.tv_sec +
                                 after.ru_stime.tv_sec - before.ru_stime.tv_sec) +
                  1e-3 * (double)(after.ru_utime.tv_usec - before.ru_utime.tv_usec +
                                  after.ru_stime.tv_usec - before.ru_stime.tv_usec);
        out->peak_rss_mib = (double)after.ru_maxrss / 1024.0;
    }
    clock.cpu_total_ms = cpu_ms;
    bst_bench_summarise(&clock, out);
    out->phase_count = STEPS;
    for (int i = 0; i < STEPS; i++) {
        qsort(steps_ms[i], PROCESSES, sizeof steps_ms[i][0], bst_compare_doubles);
        snprintf(out->phases[i].name, sizeof out->phases[i].name, "%s", steps[i]);
        out->phases[i].ms = steps_ms[i][PROCESSES / 2];
    }
    return BST_OK;
}
