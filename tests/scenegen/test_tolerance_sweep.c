/* The tolerance is a bound on the image's error: random scenes of all kinds of motion and PSF.
 *
 * In every scene: measured error <= predicted error <= tolerance. A scene that cannot be drawn to
 * the tolerance, with the nodes that a frame may have or on the grid of the Fourier path, is
 * flagged, and its prediction still holds: at most one in thirty. The median of predicted over
 * measured error of 100 or more scenes is at most 3.5: in seeds to which nothing was adapted it is
 * 2.7 to 3.5 (docs/results/speed_error.md). No scene has more than BST_SCENE_MOST_NODES nodes.
 * Usage: test_tolerance_sweep [slow (200 scenes of two seeds)] [scenes [first [seed [jumps]]]] */
#include "scenegen/reference.h"
#include "scenegen/scene_plan.h"
#include "tests/scenegen/random_scene.h"

/* Scenes of the short form: each motion with a Gaussian, which costs least; a slew, a roll and a
 * reversal with the others. A former failure has diffraction at Q = 2. */
static const int short_form[] = {19, 38, 57, 31, 50, 24, 43, 62, 1, 56, 21};
enum { SHORT = sizeof short_form / sizeof *short_form };
static int scenes = SHORT, first_scene = -1;

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

/* Precision of the reference image, over the peak of each star. 1e-8 is an error of up to 0.06
 * sigma in scenes with the brightest stars and diffraction, of which the short form has none. */
static double reference_part = 1e-8;

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
    bst_assert_ok(
        &f->ctx,
        bst_reference_render(&f->ctx, &s->camera, s->window, &s->track.track, s->sources, s->count,
                             s->reference > 0.0 ? s->reference : reference_part, reference));
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
        const int index = first_scene < 0 ? short_form[i % SHORT] : first_scene + i;
        open_scene(f, &s, index);
        outcome o = render(f, &s);
        assert_true(o.nodes <= BST_SCENE_MOST_NODES + (long long)BST_BLOCK * s.count);
        /* a frame without a source has the rounding of its background */
        double rounded = s.background_e * 0x1p-24 / s.camera.read_noise_e;
        bool bad = !(o.measured <= fmax(o.predicted, rounded)),
             over = !(o.predicted <= s.tolerance_sigma);
        /* below 1e-3 of the tolerance floats round, and there is no light to speak of */
        if (o.measured > 1e-3 * s.tolerance_sigma) {
            ratio[(int)s.psf_kind * scenes + lit[s.psf_kind]++] = o.predicted / o.measured;
            ratio[PSFS * scenes + lit[PSFS]++] = o.predicted / o.measured;
        }
        print_message(
            "%3d %-19s %-15s jumps %d bin %d win %3d tol %5.3f measured %8.5f predicted %8.5f "
            "ratio %6.2f nodes %8lld%s%s\n",
            index, motion_name[s.motion], psf_name[s.psf_kind], s.jump_count, s.binning,
            s.window.width, s.tolerance_sigma, o.measured, o.predicted, o.predicted / o.measured,
            o.nodes, bad ? " MEASURED > PREDICTED" : "", over ? " PREDICTED > TOLERANCE" : "");
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
 * PSF has sharp detail; a Gaussian with jitter, whose error is that of a covariance too large one
 * way and too small across; a target whose path the camera's jumps cut, with the greatest predicted
 * error at nodes that are not those of the greatest bound. */
static void former_failures_are_within_their_prediction(void **state) {
    fixture *f = *state;
    static scene s;
    static const struct {
        int index, seed;
        motion_kind motion;
        psf_kind psf;
        double jumps_share;
    } failed[] = {{99, 1001, STARE, DIFFRACTION_Q1, 0.0},
                  {10, 1001, SLEW, DIFFRACTION_Q2, 0.0},
                  {102, 555, JITTER, GAUSSIAN, 0.0},
                  {26, 9901, MOVING_TARGETS, DIFFRACTION_Q1, 0.1}};
    uint64_t before = seed;
    double share = jumps_share;
    for (size_t i = 0; i < sizeof failed / sizeof *failed; i++) {
        seed = (uint64_t)failed[i].seed;
        jumps_share = failed[i].jumps_share;
        open_scene_of(f, &s, failed[i].index, failed[i].motion, failed[i].psf);
        outcome o = render(f, &s);
        print_message("%3d measured %8.5f predicted %8.5f\n", failed[i].index, o.measured,
                      o.predicted);
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
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
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
                 {DIFFRACTION_Q2, 63.2, 47.9, 1e8, 0.0, 4},
                 {DIFFRACTION_Q1, 120.6, 10.2, 1e8, 0.0, 1}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        scene s = {.motion = SLEW,
                   .count = 1,
                   .binning = cases[i].binning,
                   .tolerance_sigma = 0.05,
                   .reference = 1e-9};
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
    bool slow = argc > next && strcmp(argv[next], "slow") == 0;
    if (slow) {
        scenes = 2 * SCENES_OF_A_SEED;
        first_scene = 0;
        next++;
    }
    if (argc > 1) {
        reference_part = 1e-9;
    }
    if (argc > next) {
        scenes = atoi(argv[next]);
        first_scene = argc > next + 1 ? atoi(argv[next + 1]) : 0;
    }
    seed = argc > next + 2 ? strtoull(argv[next + 2], NULL, 10) : seed;
    jumps_share = argc > next + 3 ? atof(argv[next + 3]) : jumps_share;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(former_failures_are_within_their_prediction),
        cmocka_unit_test(bright_stars_that_hardly_move_are_within_their_prediction),
        cmocka_unit_test(a_speed_that_jumps_is_within_its_prediction),
        cmocka_unit_test(the_tolerance_is_kept)};
    const struct CMUnitTest slow_tests[] = {
        cmocka_unit_test(very_bright_stars_are_within_their_prediction)};
    int failed = cmocka_run_group_tests(tests, open_device, close_device);
    return failed || !slow ? failed : cmocka_run_group_tests(slow_tests, open_device, close_device);
}
