#include "sim/bench/bench_scenes.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/device/device.h"

#define WORST(name, tolerance, q, plain) \
    { name, 2048, {0}, 3220, 0, 6, 2.0, 300, 4, 0.0349, 0.15, false, 40, tolerance, 60, q, plain }
#define ACQUISITION(name, plain) \
    { name, 2048, {0}, 500, 3, 6, 0.5, 3, 0, 0, 0.1, false, 10, 0.02, 100, 0, plain }

static const bst_bench_scene scenes[] = {
    WORST("worst_case", 0.05, 0, false),
    WORST("worst_case_plain", 0.05, 0, true),
    WORST("worst_case_diffraction_q1", 0.1, 1, false),
    WORST("worst_case_diffraction_q2", 0.07, 2, false),
    ACQUISITION("acquisition", false),
    ACQUISITION("acquisition_plain", true),
    {"rate_track_slow", 2048, {0}, 500, 1, 6, 0.5, 10, 0, 0, 0.1, true, 10, 0.02, 100, 0, false},
    {"rate_track_medium", 2048, {0}, 500, 1, 6, 1.0, 60, 0, 0, 0.1, true, 20, 0.02, 100, 0, false},
    {"rate_track_fast", 2048, {0}, 500, 1, 6, 2.0, 200, 0, 0, 0.1, true, 40, 0.02, 60, 0, false},
    {"galactic_core", 2048, {0}, 100000, 0, 8, 0.5, 5, 0, 0, 0, false, 10, 0.05, 200, 0, false},
    {"window",
     2048,
     {896, 896, 256, 256},
     500,
     1,
     6,
     0.5,
     10,
     0,
     0,
     0.1,
     true,
     10,
     0.02,
     100,
     0,
     false},
    {"small", 256, {0}, 30, 1, 4, 0.1, 20, 1, 0.01, 0.1, true, 10, 0.05, 10, 0, false},
};
enum { SCENES = sizeof scenes / sizeof *scenes };

enum { WARM_UP = 3, FRAMES = 40, SMALL_FRAMES = 400, TONES = 24, SAMPLES_PER_S = 1000 };
/* limit of small frames, of which more are timed, pixels */
enum { SMALL_PX = 512 * 512 };

static const double BRIGHTEST_E_PER_S = 1e6;

const bst_bench_scene *bst_bench_find_scene(const char *name) {
    for (int i = 0; i < SCENES; i++) {
        if (strcmp(scenes[i].name, name) == 0) {
            return &scenes[i];
        }
    }
    return NULL;
}

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

/* Enables every detector effect that combines with the others; off: blooming, frame transfer,
 * rolling shutter, codes. */
static void set_detector(bst_camera *camera) {
    camera->detector = (bst_detector_config){.temperature_c = -10.0,
                                             .reference_temperature_c = 20.0,
                                             .dark_doubling_k = 6.5,
                                             .prnu_rms = 0.01,
                                             .dsnu_rms = 0.2,
                                             .hot_fraction = 1e-4,
                                             .hot_median_e_per_s = 200.0,
                                             .hot_spread_dex = 0.5,
                                             .dead_fraction = 1e-4,
                                             .bad_columns = 2,
                                             .fixed_pattern_seed = 1,
                                             .column_offset_rms_e = 1.0,
                                             .row_offset_rms_e = 1.0,
                                             .row_noise_e = 0.5,
                                             .telegraph_noise_fraction = 0.01,
                                             .telegraph_noise_rms_e = 12.0,
                                             .nonlinearity = {-0.005, 0.001, 0.0},
                                             .cosmic_rays = {.rate_per_cm2_s = 5.0,
                                                             .pixel_pitch_um = 10.0,
                                                             .depth_um = 20.0,
                                                             .e_per_um = 80.0,
                                                             .straggling = 0.2}};
    camera->dark_current_e_per_s = 0.05;
}

/* Sets an aperture with 35 % obstruction by diameter, and defocus, astigmatism, coma and trefoil of
 * together 0.07 waves RMS at 550 nm, in the visual band. */
static void set_diffraction(bst_camera *camera, double q) {
    static const double sign[6] = {1, -1, 1, 1, -1, 1};
    camera->optics.psf = BST_PSF_DIFFRACTION;
    camera->optics.q = q;
    camera->optics.central_obstruction = 0.35;
    for (int j = 0; j < 6; j++) { /* Noll 4 to 9 */
        camera->optics.zernike_waves.waves[j + 2] = sign[j] * 0.07 / sqrt(6.0);
    }
}

typedef struct tones {
    double rate_radps[TONES], phase[2][TONES], amplitude_px;
} tones;

static tones tones_of(const bst_bench_scene *s, int frame) {
    bst_rng_key key = bst_rng_make_key(1, (uint64_t)frame, "bench", "jitter");
    tones out = {.amplitude_px = s->jitter_px * sqrt(2.0 / TONES)};
    for (int i = 0; i < TONES; i++) {
        out.rate_radps[i] = 2.0 * BST_PI * 5.0 * pow(40.0, (i + 0.5) / TONES);
        for (int a = 0; a < 2; a++) {
            out.phase[a][i] = 2.0 * BST_PI * bst_rng_uniform(key, (uint64_t)a, (uint64_t)i);
        }
    }
    return out;
}

static double jitter(const tones *t, int axis, double time_s) {
    double sum = 0.0;
    for (int i = 0; i < TONES && t->amplitude_px > 0.0; i++) {
        sum += sin(t->rate_radps[i] * time_s + t->phase[axis][i]);
    }
    return t->amplitude_px * sum;
}

/* Sets the attitudes of one frame; the pointing differs by up to a pixel between frames. */
static void move(bst_bench_view *v, int frame) {
    const bst_bench_scene *s = &v->scene;
    double scale = bst_camera_scale_rad(&v->camera), diagonal = s->travel_px / sqrt(2.0), start[2];
    bst_rng_key key = bst_rng_make_key(1, 0, "bench", "pointing");
    tones t = tones_of(s, frame);
    for (int a = 0; a < 2; a++) {
        start[a] = bst_rng_uniform(key, (uint64_t)frame, (uint64_t)a) - 0.5;
    }
    for (int k = 0; k < v->track.count; k++) {
        double u = (double)k / (v->track.count - 1), time_s = u * s->exposure_s,
               bend = s->bend_px * 4.0 * (u - 0.5) * (u - 0.5);
        double x = start[0] + diagonal * (u - 0.5) + jitter(&t, 0, time_s);
        double y = start[1] + diagonal * (u - 0.5) + bend + jitter(&t, 1, time_s);
        v->time_s[k] = time_s;
        v->q[k] = bst_quat_from_rotvec((bst_vec3){-y * scale, x * scale, s->roll_rad * (u - 0.5)});
    }
}

static bst_scene_source place(const bst_camera *camera, int kind, double x, double y, double rate) {
    bst_vec3 v = bst_camera_unproject(camera, x, y);
    return (bst_scene_source){.kind = kind, .apparent_mid = v, .electrons_per_s = rate};
}

static void make_stars(bst_bench_view *v) {
    const bst_bench_scene *s = &v->scene;
    bst_rng_key key = bst_rng_make_key(1, 0, "bench", "stars");
    double top = pow(10.0, 0.4 * s->magnitudes);
    for (int i = 0; i < s->stars; i++) {
        double x = bst_rng_uniform(key, (uint64_t)i, 0) * s->side,
               y = bst_rng_uniform(key, (uint64_t)i, 1) * s->side;
        double flux =
            BRIGHTEST_E_PER_S / (1.0 + bst_rng_uniform(key, (uint64_t)i, 2) * (top - 1.0));
        v->sources[i] = place(&v->camera, BST_SOURCE_STAR, x, y, flux);
    }
}

/* Moves the targets for a frame; targets at rest move against the stars to stay in their pixel. */
static void place_targets(bst_bench_view *v, int frame) {
    const bst_bench_scene *s = &v->scene;
    bst_rng_key key = bst_rng_make_key(1, 0, "bench", "targets");
    double half = s->target_at_rest ? 0.5 * s->travel_px / sqrt(2.0) : 0.0;
    double field = fmin(200.0, 0.5 * s->side), n = (double)frame;
    for (int i = 0; i < s->targets; i++) {
        double xy[2];
        for (int a = 0; a < 2; a++) {
            xy[a] = 0.5 * s->side +
                    field * (bst_rng_uniform(key, (uint64_t)n, (uint64_t)(2 * i + a)) - 0.5);
        }
        bst_scene_source *t = &v->sources[s->stars + i];
        *t = place(&v->camera, BST_SOURCE_OBJECT, xy[0], xy[1], 2000.0);
        v->paths[i] = bst_scene_source_path_through(
            bst_camera_unproject(&v->camera, xy[0] + half, xy[1] + half), t->apparent_mid,
            bst_camera_unproject(&v->camera, xy[0] - half, xy[1] - half));
        t->path = &v->paths[i];
    }
}

bst_status bst_bench_view_open(bst_ctx *ctx, const bst_bench_scene *s, bst_bench_view *v) {
    int samples = (int)(s->exposure_s * SAMPLES_PER_S) + 1;
    samples = samples < 2 ? 2 : samples;
    *v = (bst_bench_view){.scene = *s, .camera = bench_camera(s->side)};
    if (!s->plain) {
        set_detector(&v->camera);
    }
    if (s->q > 0.0) {
        set_diffraction(&v->camera, s->q);
    }
    v->window = s->window.width > 0 ? s->window : (bst_window){0, 0, s->side, s->side};
    v->time_s = malloc((size_t)samples * sizeof *v->time_s);
    v->q = malloc((size_t)samples * sizeof *v->q);
    v->count = s->stars + s->targets;
    v->sources = malloc((size_t)v->count * sizeof *v->sources);
    if (!v->time_s || !v->q || !v->sources) {
        bst_bench_view_close(v);
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the scene %s", s->name);
    }
    v->track = (bst_los_track){samples, v->time_s, v->q};
    make_stars(v);
    return BST_OK;
}

void bst_bench_view_close(bst_bench_view *v) {
    free(v->time_s);
    free(v->q);
    free(v->sources);
    *v = (bst_bench_view){.count = 0};
}

void bst_bench_view_set(bst_bench_view *v, int frame) {
    move(v, frame);
    place_targets(v, frame);
    v->request = (bst_render_request){.window = v->window,
                                      .track = &v->track,
                                      .sources = v->sources,
                                      .count = v->count,
                                      .background_e = v->scene.background_e,
                                      .key = bst_rng_make_key(1, 0, "bench", "noise"),
                                      .exposure_id = frame};
}

/* Per-frame inputs of a view, prepared before timing. */
typedef struct pose {
    bst_quat *q;
    bst_scene_source targets[BST_BENCH_TARGETS];
    bst_scene_source_path paths[BST_BENCH_TARGETS];
    bst_render_request request;
} pose;

static void keep_pose(const bst_bench_view *v, pose *p) {
    const bst_bench_scene *s = &v->scene;
    memcpy(p->q, v->q, (size_t)v->track.count * sizeof *p->q);
    for (int i = 0; i < s->targets; i++) {
        p->targets[i] = v->sources[s->stars + i];
        p->paths[i] = v->paths[i];
        p->targets[i].path = &p->paths[i];
    }
    p->request = v->request;
}

static void take_pose(bst_bench_view *v, const pose *p) {
    v->track.q_cam_from_gcrf = p->q;
    if (v->scene.targets > 0) {
        memcpy(&v->sources[v->scene.stars], p->targets,
               (size_t)v->scene.targets * sizeof *p->targets);
    }
    v->request = p->request;
}

bst_status bst_bench_map_and_release(bst_ctx *ctx, bst_frame *frame) {
    const uint16_t *pixels;
    bst_status status = bst_frame_map(frame, ctx, &pixels);
    if (status == BST_OK) {
        bst_frame_unmap(frame);
    }
    bst_frame_release(frame);
    return status;
}

/* number of consecutive frame times that are averaged, because scheduling makes single ones vary */
enum { TOGETHER = 4 };

static bst_status time_poses(bst_ctx *ctx, bst_renderer *renderer, bst_bench_view *v,
                             const pose *poses, int count, bool ahead, bst_bench_result *out) {
    bst_bench_clock clock = {.count = 0};
    bst_frame *frames[2] = {NULL, NULL};
    double asked_s[2], latency_ms[BST_BENCH_TIMES];
    int together = ahead ? TOGETHER : 1, latencies = 0;
    bst_status status = BST_OK;
    for (int f = 0; f < count && status == BST_OK; f++) {
        int n = ahead ? f - 1 : f; /* the frame to wait for */
        take_pose(v, &poses[f]);
        asked_s[f % 2] = bst_bench_wall_s();
        status = bst_renderer_render(ctx, renderer, &v->request, &frames[f % 2]);
        if (n < 0 || status != BST_OK) {
            continue;
        }
        status = bst_bench_map_and_release(ctx, frames[n % 2]);
        frames[n % 2] = NULL;
        if (n >= WARM_UP && latencies < BST_BENCH_TIMES) {
            latency_ms[latencies++] = 1e3 * (bst_bench_wall_s() - asked_s[n % 2]);
        }
        if (n >= WARM_UP && (n - WARM_UP + 1) % together == 0) {
            bst_bench_stop(&clock, together);
        }
        if (n + 1 >= WARM_UP && (n - WARM_UP + 1) % together == 0) {
            bst_bench_start(&clock);
        }
    }
    for (int i = 0; i < 2; i++) {
        if (frames[i]) {
            bst_frame_release(frames[i]);
        }
    }
    if (status == BST_OK && latencies > 0) {
        out->latency_ms = bst_bench_median(latency_ms, latencies);
        bst_bench_summarise(&clock, out);
    }
    return status;
}

bst_status bst_bench_view_time(bst_ctx *ctx, bst_renderer *renderer, bst_bench_view *v, int frames,
                               bool ahead, bst_bench_result *out) {
    int count = frames + WARM_UP + ahead;
    size_t samples = (size_t)v->track.count;
    const bst_quat *own = v->track.q_cam_from_gcrf;
    pose *poses = malloc((size_t)count * sizeof *poses);
    bst_quat *turns = malloc((size_t)count * samples * sizeof *turns);
    bst_status status = BST_OK;
    if (poses && turns) {
        for (int f = 0; f < count; f++) {
            bst_bench_view_set(v, f);
            poses[f].q = turns + (size_t)f * samples;
            keep_pose(v, &poses[f]);
        }
        status = time_poses(ctx, renderer, v, poses, count, ahead, out);
        v->track.q_cam_from_gcrf = own;
        bst_bench_view_set(v, count - 1);
    } else {
        status = bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the frames of a scene");
    }
    free(poses);
    free(turns);
    return status;
}

bst_status bst_bench_scene_run(bst_ctx *ctx, const bst_bench *self,
                               const bst_bench_options *options, bst_bench_result *out) {
    const bst_bench_scene *s = bst_bench_find_scene(self->name);
    bst_bench_view view = {.count = 0};
    bst_bench_truth truth = {.count = 0};
    bst_device *device = NULL;
    bst_renderer *renderer = NULL;
    bst_status status =
        s ? bst_device_open(ctx, options->device ? options->device : "", options->threads, &device)
          : bst_fail(ctx, BST_ERR_ARGUMENT, "there is no scene \"%s\"", self->name);
    if (status == BST_OK) {
        status = bst_bench_view_open(ctx, s, &view);
    }
    if (status == BST_OK) {
        bst_renderer_options fidelity = bst_renderer_default_options();
        fidelity.tolerance_sigma = s->tolerance_sigma;
        status = bst_renderer_create(ctx, device, &view.camera, &fidelity, &renderer);
    }
    if (status == BST_OK) {
        bool small = view.window.width * view.window.height <= SMALL_PX;
        status =
            bst_bench_view_time(ctx, renderer, &view, small ? SMALL_FRAMES : FRAMES, true, out);
    }
    if (status == BST_OK) {
        /* before the reference allocates its memory */
        out->peak_rss_mib = bst_bench_peak_rss_mib();
        status = bst_bench_truth_make(ctx, &view, &truth);
    }
    if (status == BST_OK) {
        status = bst_bench_truth_compare(ctx, renderer, &truth, 0.0, out);
    }
    bst_renderer_free(renderer);
    bst_bench_truth_free(&truth);
    bst_bench_view_close(&view);
    bst_device_close(device);
    return status;
}
