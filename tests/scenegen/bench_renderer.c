/* Prints what rendering costs and how far it is from the reference, for two scenes. Arguments:
 * "quick" leaves the error of the large scene out; a file name writes the first frame as PGM. */
#include <stdio.h>
#include <string.h>
#include <time.h>

#include "scenegen/reference.h"
#include "tests/scenegen/scene_support.h"

static double now_ms(clockid_t clock) {
    struct timespec t;
    clock_gettime(clock, &t);
    return 1e3 * (double)t.tv_sec + 1e-6 * (double)t.tv_nsec;
}

static int failed(bst_ctx *ctx, bst_status status) {
    if (status != BST_OK) {
        fprintf(stderr, "%s: %s\n", bst_status_name(status), ctx->message);
    }
    return status != BST_OK;
}

static int write_pgm(const char *path, const uint16_t *p, int width, int height) {
    FILE *f = fopen(path, "wb");
    if (!f) {
        return 1;
    }
    fprintf(f, "P5\n%d %d\n255\n", width, height);
    for (int i = 0; i < width * height; i++) {
        double v = 4.0 * sqrt(fmax((double)p[i] - 85.0, 0.0));
        fputc((int)fmin(v, 255.0), f);
    }
    return fclose(f);
}

/* Errors on an evenly strided choice of at most `most` of the sources. */
static int measure(bst_ctx *ctx, bst_renderer *r, const bst_camera *c, bst_render_request q,
                   int most, double *max_sigma, double *rms_sigma, double *flux) {
    size_t pixels = (size_t)c->width_px * (size_t)c->height_px;
    float *fast = malloc(pixels * sizeof *fast);
    double *reference = calloc(pixels, sizeof *reference);
    bst_source *chosen = malloc((size_t)q.count * sizeof *chosen);
    int stride = (q.count + most - 1) / most, n = 0, bad = !fast || !reference || !chosen;
    for (int i = 0; !bad && i < q.count; i += stride) {
        chosen[n++] = q.sources[i];
    }
    q.sources = chosen;
    q.count = n;
    bad = bad || failed(ctx, bst_renderer_render_noise_free(ctx, r, &q, fast)) ||
          failed(ctx, bst_reference_render(ctx, c, q.window, q.track, chosen, n, 1e-9, reference));
    double sum2 = 0.0, sum_fast = 0.0, sum_reference = 0.0;
    *max_sigma = 0.0;
    for (size_t i = 0; !bad && i < pixels; i++) {
        double sigma = sqrt(reference[i] + q.background_e + c->read_noise_e * c->read_noise_e);
        double e = fabs(fast[i] - q.background_e - reference[i]) / sigma;
        *max_sigma = fmax(*max_sigma, e);
        sum2 += e * e;
        sum_fast += fast[i] - q.background_e;
        sum_reference += reference[i];
    }
    *rms_sigma = sqrt(sum2 / (double)pixels);
    *flux = fabs(sum_fast / sum_reference - 1.0);
    free(fast);
    free(reference);
    free(chosen);
    return bad;
}

static int scene(bst_ctx *ctx, bst_device *device, const char *name, int side, int stars,
                 double brightest, double magnitudes, scene_motion motion, double background_e,
                 int compare, const char *pgm) {
    bst_camera camera = scene_camera(side, side);
    bst_renderer *r = NULL;
    if (failed(ctx, bst_renderer_create(ctx, device, &camera, NULL, &r))) {
        return 1;
    }
    bst_source *list = scene_stars(&camera, stars, brightest, magnitudes, 5);
    double best = 1e9, best_cpu = 1e9, total = 0.0;
    enum { FRAMES = 30 };
    bst_render_request q = {.window = {0, 0, side, side},
                            .sources = list,
                            .count = stars,
                            .background_e = background_e,
                            .key = {{1, 2}}};
    for (int f = 0; f < FRAMES; f++) {
        motion.seed = (uint64_t)f;
        scene_track track = scene_track_make(&camera, &motion);
        q.track = &track.track;
        q.exposure_id = f;
        double start = now_ms(CLOCK_MONOTONIC), start_cpu = now_ms(CLOCK_PROCESS_CPUTIME_ID);
        bst_frame *frame = NULL;
        const uint16_t *pixels;
        if (failed(ctx, bst_renderer_render(ctx, r, &q, &frame)) ||
            failed(ctx, bst_frame_map(frame, ctx, &pixels))) {
            return 1;
        }
        double ms = now_ms(CLOCK_MONOTONIC) - start;
        best_cpu = fmin(best_cpu, now_ms(CLOCK_PROCESS_CPUTIME_ID) - start_cpu);
        best = fmin(best, ms);
        total += ms;
        if (f == 0 && pgm) {
            write_pgm(pgm, pixels, side, side);
        }
        bst_frame_unmap(frame);
        bst_frame_release(frame);
        scene_track_free(&track);
    }
    bst_render_stats stats;
    bst_renderer_get_stats(r, &stats);
    scene_track track = scene_track_make(&camera, &motion);
    q.track = &track.track;
    double max_sigma = NAN, rms = NAN, flux = NAN;
    int bad = compare > 0 && measure(ctx, r, &camera, q, compare, &max_sigma, &rms, &flux);
    printf(
        "%s: ms_min %.2f ms_mean %.2f cpu_ms %.2f nodes %lld predicted_sigma %.3f error_sigma_max "
        "%.4f "
        "error_sigma_rms %.5f flux_error_rel %.1e\n",
        name, best, total / FRAMES, best_cpu, stats.nodes, stats.predicted_sigma, max_sigma, rms,
        flux);
    scene_track_free(&track);
    free(list);
    bst_renderer_free(r);
    return bad;
}

int main(int argc, char **argv) {
    int quick = argc > 1 && strcmp(argv[1], "quick") == 0;
    const char *pgm = argc > 2 ? argv[2] : NULL;
    bst_ctx ctx = {0};
    bst_device *device;
    if (failed(&ctx, bst_device_open(&ctx, "", 0, &device))) {
        return 1;
    }
    printf("%s\n", bst_device_description(device));
    scene_motion demo = {.x_px = 7.5,
                         .y_px = 2.5,
                         .bend_px = 0.05,
                         .roll_rad = 1e-4,
                         .jitter_px = 0.2,
                         .duration_s = 0.5,
                         .samples = 501};
    scene_motion worst = {.x_px = 290.0,
                          .y_px = 75.0,
                          .bend_px = 4.0,
                          .roll_rad = 0.0349,
                          .jitter_px = 0.15,
                          .duration_s = 2.0,
                          .samples = 2001};
    scene_motion still = demo;
    still.x_px = still.y_px = 0.0;
    int bad = scene(&ctx, device, "demo_like", 1024, 100, 1e6, 6.0, demo, 1.0, 100, pgm);
    bad |= scene(&ctx, device, "jitter_only", 1024, 100, 1e6, 6.0, still, 1.0, 100, NULL);
    bad |= scene(&ctx, device, "worst_case_like", 2048, 3220, 1e6, 6.0, worst, 40.0,
                 quick ? 0 : 100, NULL);
    bst_device_close(device);
    return bad;
}
