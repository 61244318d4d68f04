/* Random scenes of all kinds of motion and PSF, for the test of the tolerance. */
#ifndef BST_TESTS_SCENEGEN_RANDOM_SCENE_H
#define BST_TESTS_SCENEGEN_RANDOM_SCENE_H

#include <string.h>

#include "scenegen/renderer.h"
#include "sim/optics/psf.h"
#include "tests/scenegen/device_fixture.h"
#include "tests/scenegen/scene_support.h"
#include "tests/test_support.h"

static uint64_t seed = 0;
static double jumps_share = 0.1; /* part of the scenes in which the camera jumps */
enum { SCENES_OF_A_SEED = 200 };

typedef enum motion_kind {
    STARE,
    SLEW,
    ROLL_ABOUT_CORNER,
    REVERSAL,
    JITTER,
    ACCELERATION,
    FULL_TURN,
    WIDE_FIELD,
    MOVING_TARGETS,
    MOTIONS
} motion_kind;
static const char *const motion_name[MOTIONS] = {"stare",     "slew",       "roll about a corner",
                                                 "reversal",  "jitter",     "acceleration",
                                                 "full turn", "wide field", "moving targets"};

typedef enum psf_kind { GAUSSIAN, MOFFAT, DIFFRACTION_Q1, DIFFRACTION_Q2, PSF_FILE, PSFS } psf_kind;
static const char *const psf_name[PSFS] = {"Gaussian", "Moffat", "diffraction Q 1",
                                           "diffraction Q 2", "file"};

enum { WIDTH = 128, HEIGHT = 96, MOST_SOURCES = 48, FILE_SIDE = 63, MOST_JUMPS = 3 };

/* A shift of the image at even speed within a part of the exposure, both from 0 to 1. */
typedef struct jump {
    double from, length, x_px, y_px;
} jump;

typedef struct scene {
    bst_rng_key key;
    uint64_t draws;
    jump jumps[MOST_JUMPS];
    int jump_count;
    motion_kind motion;
    psf_kind psf_kind;
    bst_camera camera;
    bst_psf *psf;
    scene_track track;
    bst_window window;
    int binning;
    bst_scene_source sources[MOST_SOURCES];
    bst_scene_source_path paths[MOST_SOURCES];
    int count;
    double background_e, tolerance_sigma;
    double reference; /* tolerance of the reference image, over the peak of each star; 0: by the
                         test */
} scene;

/* Uniform in [low, high). */
static double draw(scene *s, double low, double high) {
    return low + (high - low) * bst_rng_uniform(s->key, s->draws++, 0);
}

static double draw_log(scene *s, double low, double high) {
    return low * pow(high / low, draw(s, 0.0, 1.0));
}

static double draw_sign(scene *s) {
    return draw(s, 0.0, 1.0) < 0.5 ? -1.0 : 1.0;
}

/* A skew, two-lobed image, three samples per pixel. */
static void make_file_psf(fixture *f, scene *s) {
    static float samples[FILE_SIDE * FILE_SIDE];
    double a = draw(s, 0.6, 1.4), b = draw(s, 0.6, 1.4), dx = draw(s, -2.0, 2.0),
           dy = draw(s, -2.0, 2.0), share = draw(s, 0.1, 0.5);
    for (int j = 0; j < FILE_SIDE; j++) {
        for (int i = 0; i < FILE_SIDE; i++) {
            double x = (i - FILE_SIDE / 2) / 3.0, y = (j - FILE_SIDE / 2) / 3.0;
            double main_lobe = exp(-0.5 * (x * x / (a * a) + y * y / (b * b)));
            double side_lobe = exp(-0.5 * ((x - dx) * (x - dx) + (y - dy) * (y - dy)));
            samples[j * FILE_SIDE + i] = (float)(main_lobe + share * side_lobe);
        }
    }
    bst_psf_samples image = {samples, FILE_SIDE, FILE_SIDE, 1, 3.0};
    bst_psf_inputs inputs = {.samples = &image};
    s->camera.optics.psf = BST_PSF_FILE;
    bst_assert_ok(&f->ctx, bst_psf_create_from(&f->ctx, &s->camera, &inputs, &s->psf));
    s->camera.psf = s->psf;
}

static void make_psf(fixture *f, scene *s) {
    bst_optics_config *o = &s->camera.optics;
    switch (s->psf_kind) {
        case GAUSSIAN:
            s->camera.psf_fwhm_px = draw_log(s, 0.8, 6.0);
            break;
        case MOFFAT:
            s->camera.psf_fwhm_px = draw_log(s, 1.2, 4.0);
            o->psf = BST_PSF_MOFFAT;
            o->moffat_beta = draw(s, 2.2, 4.5);
            break;
        case PSF_FILE:
            make_file_psf(f, s);
            break;
        default:
            o->psf = BST_PSF_DIFFRACTION;
            o->q = s->psf_kind == DIFFRACTION_Q1 ? 1.0 : 2.0;
            o->central_obstruction = draw(s, 0.0, 0.4);
            o->wavelengths = 1;
            for (int j = 0; j < 6; j++) { /* Noll 4 to 9 */
                o->zernike_waves.waves[j + 2] = draw(s, -0.05, 0.05);
            }
            break;
    }
    if (!s->psf) { /* one for the renderer and the reference */
        bst_assert_ok(&f->ctx, bst_psf_create(&f->ctx, &s->camera, &s->psf));
        s->camera.psf = s->psf;
    }
}

/* Motion of the camera at u in [-1/2, 1/2] of the exposure. */
typedef struct camera_motion {
    double direction, travel_px, acceleration, roll_rad, pivot[2], phase;
    scene_motion jitter;
} camera_motion;

/* Image motion at the boresight for the kinds that move it along a line. */
static double along_line(const scene *s, const camera_motion *m, double u) {
    switch (s->motion) {
        case REVERSAL:
            return 0.5 * m->travel_px * sin(2.0 * BST_PI * m->acceleration * u + m->phase);
        case ACCELERATION:
            return m->travel_px * (u + m->acceleration * u * u);
        default:
            return m->travel_px * u;
    }
}

static bst_quat attitude(const scene *s, const camera_motion *m, double u) {
    double a = bst_camera_scale_rad(&s->camera), d = along_line(s, m, u);
    double t = (u + 0.5) * m->jitter.duration_s;
    double x = d * cos(m->direction) + scene_jitter(&m->jitter, 0, t);
    double y = d * sin(m->direction) + scene_jitter(&m->jitter, 1, t);
    for (int k = 0; k < s->jump_count; k++) {
        const jump *j = &s->jumps[k];
        double part = fmin(fmax((u + 0.5 - j->from) / j->length, 0.0), 1.0);
        x += part * j->x_px;
        y += part * j->y_px;
    }
    bst_quat tilt = bst_quat_from_rotvec((bst_vec3){-y * a, x * a, 0.0});
    bst_vec3 pivot = bst_camera_unproject(&s->camera, m->pivot[0], m->pivot[1]);
    bst_quat roll = bst_quat_from_rotvec(bst_vec3_scale(pivot, m->roll_rad * u));
    return bst_quat_mul(tilt, roll);
}

static void choose_motion(scene *s, camera_motion *m) {
    m->direction = draw(s, 0.0, 2.0 * BST_PI);
    m->pivot[0] = 0.5 * (WIDTH - 1);
    m->pivot[1] = 0.5 * (HEIGHT - 1);
    switch (s->motion) {
        case STARE:
        case MOVING_TARGETS:
            m->travel_px = draw(s, 0.0, 1.0) < 0.5 ? 0.0 : draw_log(s, 0.5, 60.0);
            m->travel_px = s->motion == STARE ? 0.0 : m->travel_px;
            break;
        case SLEW:
            m->travel_px = draw_log(s, 0.5, 200.0);
            break;
        case ROLL_ABOUT_CORNER:
            m->roll_rad = draw_sign(s) * draw_log(s, 0.02, 0.6);
            m->pivot[0] = draw(s, 0.0, 1.0) < 0.5 ? -0.5 : WIDTH - 0.5;
            m->pivot[1] = draw(s, 0.0, 1.0) < 0.5 ? -0.5 : HEIGHT - 0.5;
            break;
        case REVERSAL:
            m->travel_px = draw_log(s, 1.0, 80.0);
            m->acceleration = draw(s, 0.4, 2.5); /* turns back so many times */
            m->phase = draw(s, 0.0, 2.0 * BST_PI);
            break;
        case JITTER:
            m->travel_px = draw(s, 0.0, 1.0) < 0.5 ? 0.0 : draw_log(s, 0.5, 60.0);
            m->jitter.jitter_px = draw_log(s, 0.05, 1.5);
            break;
        case ACCELERATION:
            m->travel_px = draw_log(s, 2.0, 150.0);
            m->acceleration = draw(s, -1.0, 1.0);
            m->roll_rad = draw(s, -0.05, 0.05);
            break;
        case FULL_TURN:
            m->roll_rad = draw_sign(s) * draw(s, BST_PI, 2.0 * BST_PI);
            break;
        default: /* WIDE_FIELD */
            s->camera.pixel_scale_arcsec =
                2.0 * tan(draw(s, 5.0, 45.0) * BST_DEG_RAD) / WIDTH / BST_ARCSEC_RAD;
            m->travel_px = draw_log(s, 0.5, 60.0);
            m->roll_rad = draw(s, -0.2, 0.2);
            break;
    }
}

static int ascending(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Jumps in a tenth of the scenes, with draws of their own: as by a camera that is knocked, or by
 * poses of another program. */
static void choose_jumps(scene *s) {
    bst_rng_key key = s->key;
    uint64_t draws = s->draws;
    s->key = bst_rng_make_key(s->key.k[0], s->key.k[1], "test", "jumps");
    s->draws = 0;
    s->jump_count = draw(s, 0.0, 1.0) < jumps_share ? 1 + (int)draw(s, 0.0, MOST_JUMPS) : 0;
    for (int k = 0; k < s->jump_count; k++) {
        double size = draw_log(s, 0.5, 60.0), angle = draw(s, 0.0, 2.0 * BST_PI);
        s->jumps[k] =
            (jump){draw(s, 0.0, 0.9), draw_log(s, 1e-5, 0.1), size * cos(angle), size * sin(angle)};
    }
    s->key = key;
    s->draws = draws;
}

/* Path points at even times, and where jumps begin and end. Returns their number. */
static int make_times(const scene *s, int even, double *time_s) {
    int n = 0, kept = 1;
    for (int k = 0; k < even; k++) {
        time_s[n++] = (double)k / (even - 1);
    }
    for (int k = 0; k < s->jump_count; k++) {
        time_s[n++] = s->jumps[k].from;
        time_s[n++] = s->jumps[k].from + s->jumps[k].length;
    }
    qsort(time_s, (size_t)n, sizeof *time_s, ascending);
    for (int k = 1; k < n; k++) {
        time_s[kept] = time_s[k];
        kept += time_s[k] > time_s[kept - 1];
    }
    return kept;
}

static void make_track(scene *s) {
    static const int samples[] = {51, 101, 201, 501};
    camera_motion m = {.jitter = {.duration_s = 1.0, .seed = s->key.k[0]}};
    choose_motion(s, &m);
    bool straight = s->motion == STARE || s->motion == SLEW || s->motion == MOVING_TARGETS;
    int n = straight && draw(s, 0.0, 1.0) < 0.3 ? 2 : samples[(int)draw(s, 0.0, 4.0)];
    n = s->motion == JITTER || s->motion == FULL_TURN ? 501 : n;
    size_t most = (size_t)n + 2 * MOST_JUMPS;
    s->track = (scene_track){
        {n, NULL, NULL}, malloc(most * sizeof(double)), malloc(most * sizeof(bst_quat))};
    s->track.track.count = n = make_times(s, n, s->track.time_s);
    for (int k = 0; k < n; k++) {
        s->track.q[k] = attitude(s, &m, s->track.time_s[k] - 0.5);
        s->track.time_s[k] *= m.jitter.duration_s;
    }
    s->track.track.time_s = s->track.time_s;
    s->track.track.q_cam_from_gcrf = s->track.q;
}

static void make_sources(scene *s) {
    double brightest = draw_log(s, 1e3, 1e6), top = pow(10.0, 0.4 * draw(s, 1.0, 7.0));
    s->count = (int)draw_log(s, 3.0, MOST_SOURCES);
    for (int i = 0; i < s->count; i++) {
        double x = draw(s, -20.0, WIDTH + 20.0), y = draw(s, -20.0, HEIGHT + 20.0);
        double light = i == 0 ? brightest : brightest / (1.0 + draw(s, 0.0, 1.0) * (top - 1.0));
        x = i == 0 ? draw(s, 5.0, WIDTH - 5.0) : x;
        y = i == 0 ? draw(s, 5.0, HEIGHT - 5.0) : y;
        s->sources[i] = scene_star(&s->camera, x, y, light);
        if (s->motion == MOVING_TARGETS && i % 2 == 0) {
            double length = draw_log(s, 0.5, 80.0), angle = draw(s, 0.0, 2.0 * BST_PI);
            double dx = 0.5 * length * cos(angle), dy = 0.5 * length * sin(angle);
            double bend = 0.1 * length * draw(s, -1.0, 1.0);
            s->paths[i] = bst_scene_source_path_through(
                bst_camera_unproject(&s->camera, x - dx, y - dy),
                bst_camera_unproject(&s->camera, x - bend * sin(angle), y + bend * cos(angle)),
                bst_camera_unproject(&s->camera, x + dx, y + dy));
            s->sources[i].kind = BST_SOURCE_OBJECT;
            s->sources[i].path = &s->paths[i];
            s->sources[i].apparent_mid = bst_vec3_unit(bst_scene_source_place(&s->paths[i], 0.5));
        }
    }
}

static void open_scene_of(fixture *f, scene *s, int index, motion_kind motion, psf_kind psf) {
    static const double tolerances[] = {0.02, 0.05, 0.05, 0.2};
    memset(s, 0, sizeof *s);
    uint64_t own_seed = seed + (uint64_t)(index / SCENES_OF_A_SEED);
    index %= SCENES_OF_A_SEED;
    s->key = bst_rng_make_key((uint64_t)index, own_seed, "test", "tolerance sweep");
    s->motion = motion;
    s->psf_kind = psf;
    s->camera = scene_camera(WIDTH, HEIGHT);
    s->camera.read_noise_e = draw_log(s, 2.0, 15.0);
    s->background_e = draw_log(s, 0.5, 300.0);
    s->tolerance_sigma = tolerances[(int)draw(s, 0.0, 4.0)];
    make_psf(f, s);
    choose_jumps(s);
    make_track(s);
    make_sources(s);
    s->window = (bst_window){0, 0, WIDTH, HEIGHT};
    if (draw(s, 0.0, 1.0) < 0.2) {
        int x0 = (int)draw(s, 0.0, WIDTH - 48), y0 = (int)draw(s, 0.0, HEIGHT - 40);
        s->window = (bst_window){x0, y0, 48, 40};
    }
    s->binning = draw(s, 0.0, 1.0) < 0.2 ? 2 : 1;
}

static void open_scene(fixture *f, scene *s, int index) {
    int k = index % SCENES_OF_A_SEED;
    open_scene_of(f, s, index, (motion_kind)(k % MOTIONS),
                  (psf_kind)((k / MOTIONS * 2 + k % MOTIONS) % PSFS));
}

static void close_scene(scene *s) {
    scene_track_free(&s->track);
    bst_psf_free(s->psf);
}

#endif
