/* The tolerance is a bound on the image's error: random scenes of all kinds of motion and PSF.
 *
 * In every scene: measured error <= predicted error <= tolerance. A scene that cannot be drawn to
 * the tolerance, with the nodes that a frame may have or on the grid of the Fourier path, is
 * flagged, and its prediction still holds: at most one in thirty. The median of predicted over
 * measured error of 100 or more scenes is at most 3.5: in seeds to which nothing was adapted it is
 * 2.7 to 3.5 (docs/results/speed_error.md). No scene has more than BST_SCENE_MOST_NODES nodes.
 * Usage: test_tolerance_sweep [slow (200 scenes of two seeds)] [scenes [first [seed [jumps]]]] */
#include <string.h>

#include "scenegen/reference.h"
#include "scenegen/renderer.h"
#include "scenegen/scene_plan.h"
#include "sim/optics/psf.h"
#include "tests/scenegen/device_fixture.h"
#include "tests/scenegen/scene_support.h"
#include "tests/test_support.h"

static int scenes = 9, first_scene = 0, stride = 7; /* all motions and PSFs */
static uint64_t seed = 0;
static double jumps_share = 0.1;
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

static void open_scene(fixture *f, scene *s, int index) {
    static const double tolerances[] = {0.02, 0.05, 0.05, 0.2};
    memset(s, 0, sizeof *s);
    uint64_t own_seed = seed + (uint64_t)(index / SCENES_OF_A_SEED);
    index %= SCENES_OF_A_SEED;
    s->key = bst_rng_make_key((uint64_t)index, own_seed, "test", "tolerance sweep");
    s->motion = (motion_kind)(index % MOTIONS);
    s->psf_kind = (psf_kind)(index / MOTIONS * 2 + index % MOTIONS) % PSFS;
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

static void close_scene(scene *s) {
    scene_track_free(&s->track);
    bst_psf_free(s->psf);
}

/* Largest error in sigma of a pixel that is read: the sum of binning x binning of the sensor's. */
static double largest_error(const scene *s, const float *fast, const double *reference) {
    double worst = 0.0, read = s->camera.read_noise_e;
    int b = s->binning, width = s->window.width;
    for (int y = 0; y + b <= s->window.height; y += b) {
        for (int x = 0; x + b <= width; x += b) {
            double error = 0.0, light = 0.0;
            for (int k = 0; k < b * b; k++) {
                size_t at = (size_t)(y + k / b) * (size_t)width + (size_t)(x + k % b);
                assert_true(isfinite(fast[at]));
                error += (double)fast[at] - s->background_e - reference[at];
                light += fmax(reference[at], 0.0) + s->background_e;
            }
            worst = fmax(worst, fabs(error) / sqrt(light + read * read));
        }
    }
    return worst;
}

typedef struct outcome {
    double measured, predicted;
    long long nodes;
    bool missed, bounded;
} outcome;

static outcome render(fixture *f, scene *s) {
    bst_renderer_options options = bst_renderer_default_options();
    options.tolerance_sigma = s->tolerance_sigma;
    bst_renderer *r;
    bst_assert_ok(&f->ctx, bst_renderer_create(&f->ctx, f->device, &s->camera, &options, &r));
    bst_render_request q = {.window = s->window,
                            .track = &s->track.track,
                            .sources = s->sources,
                            .count = s->count,
                            .background_e = s->background_e,
                            .binning = s->binning};
    size_t pixels = (size_t)s->window.width * (size_t)s->window.height;
    float *fast = malloc(pixels * sizeof *fast);
    double *reference = calloc(pixels, sizeof *reference);
    bst_assert_ok(&f->ctx, bst_renderer_render_noise_free(&f->ctx, r, &q, fast));
    bst_assert_ok(&f->ctx, bst_reference_render(&f->ctx, &s->camera, s->window, &s->track.track,
                                                s->sources, s->count, 1e-9, reference));
    bst_render_stats stats;
    bst_renderer_get_stats(r, &stats);
    outcome o = {.measured = largest_error(s, fast, reference),
                 .predicted = stats.predicted_sigma,
                 .nodes = stats.nodes,
                 .missed = stats.tolerance_missed,
                 .bounded = stats.nodes_bounded};
    free(fast);
    free(reference);
    bst_renderer_free(r);
    return o;
}

/* Sorts predicted over measured errors and prints their range. */
static void print_ratios(const char *name, double *ratio, int count) {
    qsort(ratio, (size_t)count, sizeof *ratio, ascending);
    if (count > 0) {
        print_message("%-15s %3d scenes: predicted / measured %.2f to %.2f, median %.2f\n", name,
                      count, ratio[0], ratio[count - 1], ratio[count / 2]);
    }
}

static void the_tolerance_is_kept(void **state) {
    fixture *f = *state;
    static scene s;
    /* [PSFS + 1][scenes], the last row of all scenes */
    double *ratio = malloc((PSFS + 1) * (size_t)scenes * sizeof *ratio);
    int broken = 0, above = 0, missed = 0, lit[PSFS + 1] = {0};
    for (int i = 0; i < scenes; i++) {
        open_scene(f, &s, first_scene + i * stride);
        outcome o = render(f, &s);
        assert_true(o.nodes <= BST_SCENE_MOST_NODES + (long long)BST_BLOCK * s.count);
        bool bad = !(o.measured <= o.predicted), over = !(o.predicted <= s.tolerance_sigma);
        /* below 1e-3 of the tolerance floats round, and there is no light to speak of */
        if (o.measured > 1e-3 * s.tolerance_sigma) {
            ratio[(int)s.psf_kind * scenes + lit[s.psf_kind]++] = o.predicted / o.measured;
            ratio[PSFS * scenes + lit[PSFS]++] = o.predicted / o.measured;
        }
        print_message(
            "%3d %-19s %-15s jumps %d bin %d win %3d tol %5.3f measured %8.5f predicted %8.5f "
            "ratio %6.2f nodes %8lld%s%s\n",
            first_scene + i * stride, motion_name[s.motion], psf_name[s.psf_kind], s.jump_count,
            s.binning, s.window.width, s.tolerance_sigma, o.measured, o.predicted,
            o.predicted / o.measured, o.nodes, bad ? " MEASURED > PREDICTED" : "",
            over ? " PREDICTED > TOLERANCE" : "");
        broken += bad;
        /* only the grid and the bound of nodes excuse it */
        above += over && !(o.missed && (o.bounded || s.psf_kind != GAUSSIAN));
        missed += o.missed;
        close_scene(&s);
    }
    for (int k = 0; k <= PSFS; k++) {
        print_ratios(k < PSFS ? psf_name[k] : "all", ratio + k * scenes, lit[k]);
    }
    print_message("above the prediction %d, tolerance %d; flagged %d\n", broken, above, missed);
    assert_int_equal(broken, 0);
    assert_int_equal(above, 0);
    assert_true(30 * missed <= scenes);
    assert_true(scenes < 100 || ratio[PSFS * scenes + lit[PSFS] / 2] <= 3.5);
    free(ratio);
}

/* Scenes whose error exceeded a prediction: positions on the Fourier path's grid in single
 * precision (a star at rest); a streak of equal groups of nodes, whose ripples add up where the
 * PSF has sharp detail. */
static void former_failures_are_within_their_prediction(void **state) {
    fixture *f = *state;
    static scene s;
    static const int failed[] = {99, 10};
    uint64_t before = seed;
    double share = jumps_share;
    seed = 1001;
    jumps_share = 0.0;
    for (size_t i = 0; i < sizeof failed / sizeof *failed; i++) {
        open_scene(f, &s, failed[i]);
        outcome o = render(f, &s);
        print_message("%3d measured %8.5f predicted %8.5f\n", failed[i], o.measured, o.predicted);
        assert_true(o.measured <= o.predicted && o.predicted <= s.tolerance_sigma);
        close_scene(&s);
    }
    seed = before;
    jumps_share = share;
}

/* Bright stars that move by about a sigma of the PSF: where there is little light beside the peak,
 * in pixels wider than the PSF above all, errors are larger in sigma than at the peak. */
static void bright_stars_that_hardly_move_are_within_their_prediction(void **state) {
    static const struct {
        double fwhm_px, travel_sigmas, electrons, read_noise_e, background_e, tolerance_sigma;
    } cases[] = {{0.8437, 1.06, 1.94e5, 1.12, 0.224, 0.197},
                 {0.8437, 0.9, 4e5, 1.12, 0.224, 0.197}};
    fixture *f = *state;
    const size_t step = scenes >= SCENES_OF_A_SEED ? 1 : 3;
    for (size_t i = step / 3; i < sizeof cases / sizeof *cases; i += step) {
        scene s = {.motion = SLEW, .psf_kind = GAUSSIAN, .count = 1, .binning = 1};
        camera_motion m = {.pivot = {0.5 * (WIDTH - 1), 0.5 * (HEIGHT - 1)}};
        s.camera = scene_camera(WIDTH, HEIGHT);
        s.camera.psf_fwhm_px = cases[i].fwhm_px;
        s.camera.read_noise_e = cases[i].read_noise_e;
        s.background_e = cases[i].background_e;
        s.tolerance_sigma = cases[i].tolerance_sigma;
        m.travel_px = cases[i].travel_sigmas * cases[i].fwhm_px / 2.354820045;
        double time_s[2] = {0.0, 1.0};
        bst_quat q[2] = {attitude(&s, &m, -0.5), attitude(&s, &m, 0.5)};
        s.track.track = (bst_los_track){2, time_s, q};
        s.sources[0] = scene_star(&s.camera, 63.74, 48.075, cases[i].electrons);
        s.window = (bst_window){0, 0, WIDTH, HEIGHT};
        outcome o = render(f, &s);
        print_message("%zu measured %8.5f predicted %8.5f\n", i, o.measured, o.predicted);
        assert_true(o.measured <= o.predicted && o.predicted <= s.tolerance_sigma);
    }
}

/* A path of straight parts whose speeds differ by far, each of up to PIECES samples. */
enum { PARTS = 6, PIECES = 8 };
typedef struct straight_parts {
    int count;
    double length_px[PARTS], long_s[PARTS], turn_rad[PARTS];
    int pieces[PARTS];
} straight_parts;

/* A star that drifts, jumps and drifts again; the others are random. */
static void choose_parts(scene *s, int index, straight_parts *p, double *electrons) {
    static const straight_parts known = {
        3, {0.4, 20.0, 0.4}, {0.495, 0.01, 0.495}, {0.0}, {2, 5, 2}};
    if (index == 0) {
        s->camera.psf_fwhm_px = 2.0;
        s->camera.read_noise_e = 2.0;
        s->background_e = 0.5;
        *electrons = 3.8e5;
        *p = known;
        return;
    }
    s->camera.psf_fwhm_px = draw_log(s, 1.0, 4.0);
    s->camera.read_noise_e = draw_log(s, 1.0, 15.0);
    s->background_e = draw_log(s, 0.1, 100.0);
    *electrons = draw_log(s, 1e4, 1e6);
    p->count = 2 + (int)draw(s, 0.0, PARTS - 1.0);
    for (int k = 0; k < p->count; k++) {
        p->length_px[k] = draw_log(s, 0.02, 20.0) * draw_sign(s);
        p->long_s[k] = draw_log(s, 1e-5, 1.0);
        p->turn_rad[k] = draw(s, -0.3, 0.3);
        p->pieces[k] = 1 + (int)draw(s, 0.0, PIECES);
    }
}

/* Along a jump there is little light, so that an error there is large in sigma, which is small
 * beside the noise of the peak. */
static void a_speed_that_jumps_is_within_its_prediction(void **state) {
    fixture *f = *state;
    int cases = scenes >= SCENES_OF_A_SEED ? 600 : 12;
    double worst = INFINITY;
    for (int i = 0; i < cases; i++) {
        scene s = {.count = 1, .binning = 1, .tolerance_sigma = 0.05};
        straight_parts p;
        double electrons, time_s[PARTS * PIECES + 1] = {0.0};
        bst_quat q[PARTS * PIECES + 1];
        s.key = bst_rng_make_key((uint64_t)i, seed, "test", "speed jumps");
        s.camera = scene_camera(WIDTH, HEIGHT);
        choose_parts(&s, i, &p, &electrons);
        camera_motion m = {.pivot = {0.5 * (WIDTH - 1), 0.5 * (HEIGHT - 1)}, .travel_px = -12.0};
        int n = 0;
        q[0] = attitude(&s, &m, 1.0);
        for (int k = 0; k < p.count; k++) {
            m.direction += p.turn_rad[k];
            for (int j = 0; j < p.pieces[k]; j++, n++) {
                m.travel_px += p.length_px[k] / p.pieces[k];
                time_s[n + 1] = time_s[n] + p.long_s[k] / p.pieces[k];
                q[n + 1] = attitude(&s, &m, 1.0);
            }
        }
        s.track.track = (bst_los_track){n + 1, time_s, q};
        s.sources[0] = scene_star(&s.camera, 63.74, 48.075, electrons / time_s[n]);
        s.window = (bst_window){0, 0, WIDTH, HEIGHT};
        outcome o = render(f, &s);
        worst = fmin(worst, o.predicted / o.measured);
        if (i == 0 || !(o.measured <= o.predicted && o.predicted <= s.tolerance_sigma)) {
            print_message("path %d: measured %.5f predicted %.5f sigma, %g electrons\n", i,
                          o.measured, o.predicted, electrons);
        }
        assert_true(o.measured <= o.predicted && o.predicted <= s.tolerance_sigma);
    }
    print_message("%d paths: predicted / measured at least %.2f\n", cases, worst);
}

/* Far wings of a bright star: the periods of the Fourier path's grid and rounding of single
 * precision show on dark pixels. */
static void very_bright_stars_are_within_their_prediction(void **state) {
    fixture *f = *state;
    static const struct {
        psf_kind psf;
        double x_px, y_px, electrons, travel_px;
        int binning;
    } cases[] = {{DIFFRACTION_Q2, 63.2, 47.9, 1e8, 0.0, 1},
                 {DIFFRACTION_Q2, 3.4, 90.7, 1e8, 0.0, 1},
                 {DIFFRACTION_Q2, 20.3, 30.1, 3e7, 30.0, 1},
                 {DIFFRACTION_Q1, 120.6, 10.2, 1e8, 0.0, 1},
                 {DIFFRACTION_Q2, 63.2, 47.9, 1e8, 0.0, 4}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        scene s = {
            .motion = SLEW, .count = 1, .binning = cases[i].binning, .tolerance_sigma = 0.05};
        s.key = bst_rng_make_key(i, 0, "test", "very bright stars");
        s.psf_kind = cases[i].psf;
        s.camera = scene_camera(WIDTH, HEIGHT);
        s.camera.read_noise_e = 2.0;
        s.background_e = 0.5;
        make_psf(f, &s);
        camera_motion m = {.pivot = {0.5 * (WIDTH - 1), 0.5 * (HEIGHT - 1)},
                           .travel_px = cases[i].travel_px};
        double time_s[2] = {0.0, 1.0};
        bst_quat q[2] = {attitude(&s, &m, -0.5), attitude(&s, &m, 0.5)};
        s.track.track = (bst_los_track){2, time_s, q};
        s.sources[0] = scene_star(&s.camera, cases[i].x_px, cases[i].y_px, cases[i].electrons);
        s.window = (bst_window){0, 0, WIDTH, HEIGHT};
        outcome o = render(f, &s);
        print_message("%zu measured %8.5f predicted %8.5f\n", i, o.measured, o.predicted);
        assert_true(o.measured <= o.predicted);
        bst_psf_free(s.psf);
    }
}

int main(int argc, char **argv) {
    int next = 1;
    if (argc > next && strcmp(argv[next], "slow") == 0) {
        scenes = 2 * SCENES_OF_A_SEED;
        stride = 1;
        next++;
    }
    scenes = argc > next ? atoi(argv[next]) : scenes;
    first_scene = argc > next + 1 ? atoi(argv[next + 1]) : first_scene;
    seed = argc > next + 2 ? strtoull(argv[next + 2], NULL, 10) : seed;
    jumps_share = argc > next + 3 ? atof(argv[next + 3]) : jumps_share;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(former_failures_are_within_their_prediction),
        cmocka_unit_test(bright_stars_that_hardly_move_are_within_their_prediction),
        cmocka_unit_test(very_bright_stars_are_within_their_prediction),
        cmocka_unit_test(a_speed_that_jumps_is_within_its_prediction),
        cmocka_unit_test(the_tolerance_is_kept)};
    return cmocka_run_group_tests(tests, open_device, close_device);
}
