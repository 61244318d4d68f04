#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "scenegen/reference.h"
#include "scenegen/renderer.h"
#include "sim/app/bench.h"
#include "sim/device/device.h"

/* A rendering scene of the benchmark: what the camera sees and how it moves during the exposure. */
typedef struct scene {
    const char *name;
    int side;          /* of the sensor, px */
    bst_window window; /* width 0: all of it */
    int stars, targets;
    double magnitudes; /* star brightnesses span this, counts growing as 10^(0.4 m) */
    double exposure_s;
    double travel_px; /* of the stars along the diagonal */
    double bend_px;   /* acceleration: the quadratic part */
    double roll_rad;
    double jitter_px; /* RMS per axis, 5 to 200 Hz */
    bool target_at_rest;
    double background_e;
    double tolerance_sigma;
    int error_sources; /* sources whose error is measured, evenly chosen; the reference takes its
                          time */
    double q;          /* wavelength x focal ratio / pixel of a diffraction PSF; 0: the Gaussian */
} scene;

#define WORST(name, tolerance, q) \
    { name, 2048, {0}, 3220, 0, 6, 2.0, 300, 4, 0.0349, 0.15, false, 40, tolerance, 60, q }

static const scene scenes[] = {
    WORST("worst_case", 0.05, 0),
    WORST("worst_case_diffraction_q1", 0.1, 1),
    WORST("worst_case_diffraction_q2", 0.07, 2),
    {"acquisition", 2048, {0}, 500, 3, 6, 0.5, 3, 0, 0, 0.1, false, 10, 0.02, 100, 0},
    {"rate_track_slow", 2048, {0}, 500, 1, 6, 0.5, 10, 0, 0, 0.1, true, 10, 0.02, 100, 0},
    {"rate_track_medium", 2048, {0}, 500, 1, 6, 1.0, 60, 0, 0, 0.1, true, 20, 0.02, 100, 0},
    {"rate_track_fast", 2048, {0}, 500, 1, 6, 2.0, 200, 0, 0, 0.1, true, 40, 0.02, 60, 0},
    {"galactic_core", 2048, {0}, 100000, 0, 8, 0.5, 5, 0, 0, 0, false, 10, 0.05, 200, 0},
    {"window", 2048, {896, 896, 256, 256}, 500, 1, 6, 0.5, 10, 0, 0, 0.1, true, 10, 0.02, 100, 0},
};

enum { MOST_TARGETS = 4, FRAMES = 40, WARM_UP = 3, TONES = 24, SAMPLES_PER_S = 1000 };

static const double BRIGHTEST_E_PER_S = 1e6;

typedef struct scene_state {
    const scene *scene;
    bst_camera camera;
    bst_window window;
    bst_source *sources;
    int count;
    bst_source_path paths[MOST_TARGETS];
    double *time_s;
    bst_quat *q;
    int samples;
} scene_state;

static bst_camera bench_camera(int side) {
    return (bst_camera){.width_px = side,
                        .height_px = side,
                        .pixel_scale_arcsec = 3.0,
                        .aperture_m = 0.15,
                        .throughput = 0.7,
                        .quantum_efficiency = 0.7,
                        .photon_flux_v0_per_s_m2 = 3.6e10,
                        .psf_fwhm_px = 2.0,
                        .background_mag_arcsec2 = 22.0,
                        .read_noise_e = 8.0,
                        .full_well_e = 100000.0,
                        .gain_e_per_dn = 1.6,
                        .offset_dn = 500.0,
                        .bits = 16};
}

/* An aperture of which 35 % of the diameter is obstructed, with defocus, astigmatism, coma and
 * trefoil that together are 0.07 waves RMS at 550 nm, over the visual band. */
static void set_diffraction(bst_camera *camera, double q) {
    static const double sign[6] = {1, -1, 1, 1, -1, 1};
    camera->optics.psf = BST_PSF_DIFFRACTION;
    camera->optics.q = q;
    camera->optics.central_obstruction = 0.35;
    for (int j = 0; j < 6; j++) { /* Noll 4 to 9 */
        camera->optics.zernike_waves.waves[j + 2] = sign[j] * 0.07 / sqrt(6.0);
    }
}

static double jitter(const scene *s, uint64_t frame, int axis, double t) {
    bst_rng_key key = bst_rng_make_key(1, frame, "bench", "jitter");
    double sum = 0.0;
    for (int i = 0; i < TONES && s->jitter_px > 0.0; i++) {
        double f = 5.0 * pow(40.0, (i + 0.5) / TONES);
        double phase = 2.0 * BST_PI * bst_rng_uniform(key, (uint64_t)axis, (uint64_t)i);
        sum += sin(2.0 * BST_PI * f * t + phase);
    }
    return s->jitter_px * sum * sqrt(2.0 / TONES);
}

/* Attitudes of one frame: the pointing of each frame differs by up to a pixel. */
static void move(scene_state *st, uint64_t frame, double centre_px[2]) {
    const scene *s = st->scene;
    double scale = bst_camera_scale_rad(&st->camera), diagonal = s->travel_px / sqrt(2.0);
    bst_rng_key key = bst_rng_make_key(1, 0, "bench", "pointing");
    for (int a = 0; a < 2; a++) {
        centre_px[a] = bst_rng_uniform(key, frame, (uint64_t)a) - 0.5;
    }
    for (int k = 0; k < st->samples; k++) {
        double u = (double)k / (st->samples - 1), t = u * s->exposure_s,
               bend = s->bend_px * 4.0 * (u - 0.5) * (u - 0.5);
        double x = centre_px[0] + diagonal * (u - 0.5) + jitter(s, frame, 0, t);
        double y = centre_px[1] + diagonal * (u - 0.5) + bend + jitter(s, frame, 1, t);
        st->time_s[k] = t;
        st->q[k] = bst_quat_from_rotvec((bst_vec3){-y * scale, x * scale, s->roll_rad * (u - 0.5)});
    }
}

static bst_source place(const bst_camera *camera, int kind, double x, double y, double rate) {
    bst_vec3 v = bst_camera_unproject(camera, x, y);
    return (bst_source){.kind = kind, .apparent_mid = v, .electrons_per_s = rate};
}

static void make_sources(scene_state *st) {
    const scene *s = st->scene;
    bst_rng_key key = bst_rng_make_key(1, 0, "bench", "stars");
    double top = pow(10.0, 0.4 * s->magnitudes);
    for (int i = 0; i < s->stars; i++) {
        double x = bst_rng_uniform(key, (uint64_t)i, 0) * s->side,
               y = bst_rng_uniform(key, (uint64_t)i, 1) * s->side;
        double flux =
            BRIGHTEST_E_PER_S / (1.0 + bst_rng_uniform(key, (uint64_t)i, 2) * (top - 1.0));
        st->sources[i] = place(&st->camera, BST_SOURCE_STAR, x, y, flux);
    }
    st->count = s->stars + s->targets;
}

/* Targets are elsewhere in every frame; those at rest move against the stars so that they stay in
 * their pixel. */
static void place_targets(scene_state *st, uint64_t frame) {
    const scene *s = st->scene;
    bst_rng_key key = bst_rng_make_key(1, 0, "bench", "targets");
    double half = s->target_at_rest ? 0.5 * s->travel_px / sqrt(2.0) : 0.0;
    for (int i = 0; i < s->targets; i++) {
        double x = 0.5 * s->side + 200.0 * (bst_rng_uniform(key, frame, (uint64_t)(2 * i)) - 0.5);
        double y =
            0.5 * s->side + 200.0 * (bst_rng_uniform(key, frame, (uint64_t)(2 * i + 1)) - 0.5);
        bst_source *t = &st->sources[s->stars + i];
        *t = place(&st->camera, BST_SOURCE_OBJECT, x, y, 2000.0);
        st->paths[i] = bst_source_path_through(
            bst_camera_unproject(&st->camera, x + half, y + half), t->apparent_mid,
            bst_camera_unproject(&st->camera, x - half, y - half));
        t->path = &st->paths[i];
    }
}

static bst_status open_scene(bst_ctx *ctx, const scene *s, scene_state *st) {
    *st = (scene_state){.scene = s, .camera = bench_camera(s->side)};
    if (s->q > 0.0) {
        set_diffraction(&st->camera, s->q);
    }
    st->window = s->window.width > 0 ? s->window : (bst_window){0, 0, s->side, s->side};
    st->samples = (int)(s->exposure_s * SAMPLES_PER_S) + 1;
    st->time_s = malloc((size_t)st->samples * sizeof *st->time_s);
    st->q = malloc((size_t)st->samples * sizeof *st->q);
    st->sources = malloc((size_t)(s->stars + s->targets) * sizeof *st->sources);
    if (!st->time_s || !st->q || !st->sources) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the scene %s", s->name);
    }
    make_sources(st);
    return BST_OK;
}

static void close_scene(scene_state *st) {
    free(st->time_s);
    free(st->q);
    free(st->sources);
}

/* Error of an even choice of the scene's sources against the double-precision reference, by the
 * very renderer that was timed. */
static bst_status measure_error(bst_ctx *ctx, bst_renderer *renderer, scene_state *st,
                                const bst_render_request *timed, bst_bench_result *out) {
    size_t pixels = (size_t)st->window.width * (size_t)st->window.height;
    float *fast = malloc(pixels * sizeof *fast);
    double *reference = calloc(pixels, sizeof *reference);
    bst_source *chosen = malloc((size_t)st->count * sizeof *chosen);
    bst_status status = fast && reference && chosen
                            ? BST_OK
                            : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the error's images");
    int n = 0, stride = (st->count + st->scene->error_sources - 1) / st->scene->error_sources;
    for (int i = 0; status == BST_OK && i < st->count; i += stride) {
        chosen[n++] = st->sources[i];
    }
    bst_render_request request = *timed;
    request.sources = chosen;
    request.count = n;
    if (status == BST_OK) {
        status = bst_renderer_render_noise_free(ctx, renderer, &request, fast);
    }
    if (status == BST_OK) {
        status = bst_reference_render(ctx, &st->camera, st->window, request.track, chosen, n, 1e-9,
                                      reference);
    }
    double sum2 = 0.0, sum_fast = 0.0, sum_reference = 0.0, worst = 0.0;
    for (size_t i = 0; status == BST_OK && i < pixels; i++) {
        double read = st->camera.read_noise_e;
        double error = (double)fast[i] - request.background_e - reference[i];
        double in_sigma = fabs(error) / sqrt(reference[i] + request.background_e + read * read);
        worst = fmax(worst, in_sigma);
        sum2 += in_sigma * in_sigma;
        sum_fast += (double)fast[i] - request.background_e;
        sum_reference += reference[i];
    }
    out->error_sources = n;
    out->error_sigma_max = worst;
    out->error_sigma_rms = sqrt(sum2 / (double)pixels);
    out->flux_error_rel = sum_reference > 0.0 ? fabs(sum_fast / sum_reference - 1.0) : NAN;
    free(fast);
    free(reference);
    free(chosen);
    return status;
}

static bst_status render_frames(bst_ctx *ctx, bst_renderer *renderer, scene_state *st,
                                bst_bench_result *out) {
    bst_bench_clock clock = {.count = 0};
    bst_los_track track = {st->samples, st->time_s, st->q};
    bst_render_request request = {.window = st->window,
                                  .track = &track,
                                  .sources = st->sources,
                                  .count = st->count,
                                  .background_e = st->scene->background_e,
                                  .key = bst_rng_make_key(1, 0, "bench", "noise")};
    for (int f = 0; f < FRAMES + WARM_UP; f++) {
        double centre_px[2];
        move(st, (uint64_t)f, centre_px);
        place_targets(st, (uint64_t)f);
        request.exposure_id = f;
        bst_frame *frame = NULL;
        const uint16_t *pixels;
        bst_bench_start(&clock);
        BST_TRY(bst_renderer_render(ctx, renderer, &request, &frame));
        BST_TRY(bst_frame_map(frame, ctx, &pixels));
        bst_bench_stop(&clock, 1);
        bst_frame_unmap(frame);
        bst_frame_release(frame);
        if (f + 1 == WARM_UP) {
            clock.count = 0;
            clock.cpu_total_ms = 0.0;
        }
    }
    bst_bench_summarise(&clock, out);
    return measure_error(ctx, renderer, st, &request, out);
}

bst_status bst_bench_scene(bst_ctx *ctx, const bst_bench *self, const bst_bench_options *options,
                           bst_bench_result *out) {
    const scene *s = scenes;
    while (strcmp(s->name, self->name) != 0) {
        s++; /* the table of benchmarks names only scenes of this table */
    }
    scene_state st = {0};
    bst_device *device = NULL;
    bst_renderer *renderer = NULL;
    bst_status status =
        bst_device_open(ctx, options->device ? options->device : "", options->threads, &device);
    if (status == BST_OK) {
        status = open_scene(ctx, s, &st);
    }
    if (status == BST_OK) {
        bst_renderer_options fidelity = bst_renderer_default_options();
        fidelity.tolerance_sigma = s->tolerance_sigma;
        status = bst_renderer_create(ctx, device, &st.camera, &fidelity, &renderer);
    }
    if (status == BST_OK) {
        status = render_frames(ctx, renderer, &st, out);
    }
    bst_renderer_free(renderer);
    close_scene(&st);
    bst_device_close(device);
    return status;
}
