/* Charge that pixels keep from frame to frame, against the differential equation of the traps and
 * the Poisson law of what is read. */
#include "scenegen/detector/fixed_pattern_noise.h"
#include "scenegen/detector/persistence.h"
#include "tests/archive_support.h"
#include "tests/scenegen/scene_support.h"
#include "tests/test_support.h"

enum { SIDE = 192, PIXELS = SIDE * SIDE, KINDS = BST_PERSISTENCE_SPECIES };

static const bst_rng_key PATTERN = {{21, 22}};

typedef struct fixture {
    bst_ctx ctx;
    bst_device *device;
    bst_camera camera;
    bst_renderer *renderer;
} fixture;

/* A camera without read noise, whose digital numbers are electrons. */
static fixture *open_with(void **state) {
    fixture *f = *state;
    f->camera = scene_camera(SIDE, SIDE);
    f->camera.detector.dark_doubling_k = 6.5;
    f->camera.read_noise_e = 0.0;
    f->camera.detector.persistence = (bst_detector_persistence_config){
        {0.05, 0.0, 0.02, 0.01, 0.03}, {0.2, 1.0, 3.0, 40.0, 2000.0}};
    return f;
}

static bst_renderer *make(fixture *f) {
    bst_renderer *r;
    bst_renderer_options options = bst_renderer_default_options();
    options.pattern = PATTERN;
    options.shared_program = true; /* compiled once, not for each effect */
    bst_assert_ok(&f->ctx, bst_renderer_create(&f->ctx, f->device, &f->camera, &options, &r));
    return r;
}

typedef struct shot {
    double start_s, exposure_s, sky_e;
} shot;

/* Frame `id` in electrons from the offset on. */
static void expose(fixture *f, bst_renderer *r, int64_t id, shot s, double *electrons) {
    const double time_s[2] = {0.0, s.exposure_s};
    const bst_quat q[2] = {BST_QUAT_IDENTITY, BST_QUAT_IDENTITY};
    const bst_los_track track = {2, time_s, q};
    const double dark_e = s.exposure_s * bst_camera_dark_e_per_s(&f->camera);
    const bst_render_request request = {.window = {0, 0, SIDE, SIDE},
                                        .track = &track,
                                        .background_e = s.sky_e + dark_e,
                                        .dark_e = dark_e,
                                        .key = {{3, 4}},
                                        .exposure_id = id,
                                        .start_s = s.start_s};
    bst_frame *frame;
    const uint16_t *pixels;
    bst_assert_ok(&f->ctx, bst_renderer_render(&f->ctx, r, &request, &frame));
    bst_assert_ok(&f->ctx, bst_frame_map(frame, &f->ctx, &pixels));
    for (int i = 0; i < PIXELS; i++) {
        electrons[i] = (pixels[i] - f->camera.offset_dn) * f->camera.gain_e_per_dn;
    }
    bst_frame_unmap(frame);
    bst_frame_release(frame);
}

/* dn/dt = (s q - n) / tau by Runge's and Kutta's method of order four, q growing from 0 at `rate`
 * up to the full well: returns n after `time_s`. */
static double integrate(double n, double share, double tau_s, double rate, double full_e,
                        double time_s) {
    double corner_s = rate * time_s > full_e ? full_e / rate : time_s;
    for (int part = 0; part < 2; part++) {
        double begin = part ? corner_s : 0.0, end = part ? time_s : corner_s;
        int steps = 2 + (int)(8.0 * (end - begin) / tau_s);
        double h = (end - begin) / steps;
        for (int i = 0; i < steps; i++) {
            double q[3];
            for (int j = 0; j < 3; j++) {
                q[j] = share * fmin(rate * (begin + (i + 0.5 * j) * h), full_e);
            }
            double a = (q[0] - n) / tau_s, b = (q[1] - n - 0.5 * h * a) / tau_s;
            double c = (q[1] - n - 0.5 * h * b) / tau_s, d = (q[2] - n - h * c) / tau_s;
            n += h * (a + 2.0 * b + 2.0 * c + d) / 6.0;
        }
    }
    return n;
}

/* A bright frame with pixels of all charges up to twice the full well, and darks after it: the
 * mean of each pixel, and the Poisson law about it. */
static void traps_follow_their_equation(void **state) {
    static const shot shots[] = {{10.0, 0.5, 30000.0}, {10.5, 0.5, 10.0}, {11.7, 4.0, 10.0},
                                 {80.0, 3.0, 200.0},   {110.0, 0.0, 0.0}, {111.0, 3.0, 0.0}};
    static float gain[PIXELS];
    static double frame[PIXELS], trapped[KINDS][PIXELS];
    fixture *f = open_with(state);
    const bst_detector_persistence_config *c = &f->camera.detector.persistence;
    f->camera.full_well_e = 40000.0;
    f->camera.dark_current_e_per_s = 3.0;
    f->camera.detector.prnu_rms = 0.5;
    bst_renderer *r = make(f);
    bst_assert_ok(&f->ctx,
                  bst_fixed_pattern_noise_gain(&f->ctx, &f->camera, PATTERN, NULL, SIDE, gain));
    memset(trapped, 0, sizeof trapped);
    double end_s = 0.0;
    for (int k = 0; k < (int)(sizeof shots / sizeof *shots); k++) {
        const shot *s = &shots[k];
        expose(f, r, k, *s, frame);
        double chi2 = 0.0, excess = 0.0, all = 0.0, gap_s = s->start_s - end_s;
        int counted = 0, full = 0;
        for (int i = 0; i < PIXELS; i++) {
            double light = s->sky_e * (double)gain[i] + 3.0 * s->exposure_s, mean = light;
            for (int j = 0; j < KINDS; j++) {
                if (c->trapped_share[j] == 0.0) {
                    continue;
                }
                double n = trapped[j][i] * exp(-gap_s / c->time_constant_s[j]);
                trapped[j][i] = integrate(n, c->trapped_share[j], c->time_constant_s[j],
                                          s->exposure_s > 0.0 ? light / s->exposure_s : 0.0,
                                          40000.0, s->exposure_s);
                mean += n - trapped[j][i];
            }
            if (mean > 40000.0 - 6.0 * sqrt(mean)) {
                full += frame[i] > 40000.0 - 12.0 * sqrt(mean);
                counted--;
            } else if (mean > 0.0) {
                chi2 += (frame[i] - mean) * (frame[i] - mean) / mean;
                excess += frame[i] - mean;
                all += mean;
            } else {
                assert_true(frame[i] == 0.0);
                counted--;
            }
            counted++;
        }
        assert_true(k > 0 || (full > 1000 && counted > PIXELS / 2));
        end_s = s->start_s + s->exposure_s;
        if (counted > 0) {
            /* chi-square: as in test_charge_effects.c; floats of 3e4 e-: 0.004 e- in each pixel */
            bst_assert_close(chi2 / counted, 1.0, 5.0 * sqrt(2.1 / counted));
            bst_assert_close(excess, 0.0, 4.0 * sqrt(all) + 0.004 * counted);
        }
    }
    bst_renderer_free(r);
}

/* 1 - (1 - e^-x) / x on both sides of the series' limit, by its integral form. */
static void ramps_fill_in_closed_form(void **state) {
    (void)state;
    bst_assert_close(bst_persistence_fill(0.0), 0.0, 0.0);
    bst_assert_close(bst_persistence_fill(2.0), 0.5 + 0.5 * exp(-2.0), 1e-15);
    for (double x = 1e-4; x < 1e-2; x *= 1.3) {
        double series = 0.0, term = 1.0;
        for (int n = 1; n < 8; n++) {
            term *= x / (n + 1.0);
            series += n % 2 ? term : -term;
        }
        /* relative: 1e-16 / x^2 where the closed form cancels */
        bst_assert_close(bst_persistence_fill(x) / series, 1.0, 1e-9);
    }
    bst_assert_close(bst_persistence_fill(1e6), 1.0, 1.1e-6);
}

/* A hit fills traps as light does: charge of the same hits without traps, and the darks after it.
 */
static void hits_fill_traps(void **state) {
    static double plain[PIXELS], frame[PIXELS];
    fixture *f = open_with(state);
    f->camera.full_well_e = 1e6;
    f->camera.gain_e_per_dn = 2.0;
    f->camera.detector.cosmic_rays = (bst_detector_cosmic_ray_config){3000.0, 13, 15, 75, 0.15, 0};
    const bst_detector_persistence_config traps = f->camera.detector.persistence;
    f->camera.detector.persistence = (bst_detector_persistence_config){{0}, {1, 1, 1, 1, 1}};
    bst_renderer *r = make(f);
    expose(f, r, 7, (shot){0.0, 0.5, 0.0}, plain);
    bst_renderer_free(r);
    f->camera.detector.persistence = traps;
    r = make(f);
    expose(f, r, 7, (shot){0.0, 0.5, 0.0}, frame);
    double kept = 0.0;
    int struck = 0;
    for (int k = 0; k < KINDS; k++) {
        kept += integrate(0.0, traps.trapped_share[k], traps.time_constant_s[k], 2.0, 1e9, 0.5);
    }
    for (int i = 0; i < PIXELS; i++) {
        struck += plain[i] > 0.0;
        /* half of a digital number in both, and the rounding of `plain` times `kept` */
        bst_assert_close(frame[i], plain[i] * (1.0 - kept), 2.05);
    }
    assert_true(struck > 300);
    bst_renderer_free(r);
}

/* Other noise, light and states do not disturb each other: a state that is restored, and a renderer
 * that takes over, go on to the bit; what is saved is not below 0. */
static bst_status archive(void *self, bst_archive *a) {
    return bst_renderer_archive(self, a);
}

static void charge_is_saved_and_handed_over(void **state) {
    static double first[PIXELS], next[PIXELS], again[PIXELS], fresh[PIXELS];
    fixture *f = open_with(state);
    const shot bright = {0.0, 1.0, 50000.0}, dark = {1.0, 5.0, 20.0};
    bst_renderer *r = make(f), *other = make(f);
    expose(f, r, 0, bright, first);
    test_saved saved = test_save(archive, r);
    expose(f, r, 1, dark, next);
    expose(f, other, 1, dark, fresh);
    assert_memory_not_equal(fresh, next, sizeof next);
    bst_assert_ok(&f->ctx, test_restore(&f->ctx, archive, other, saved));
    expose(f, other, 1, dark, again);
    assert_memory_equal(again, next, sizeof next);
    bst_assert_ok(&f->ctx, test_restore(&f->ctx, archive, r, saved));
    bst_renderer_inherit(other, r);
    expose(f, other, 1, dark, again);
    assert_memory_equal(again, next, sizeof next);
    /* nothing is left where it came from */
    expose(f, r, 1, dark, again);
    assert_memory_equal(again, fresh, sizeof next);
    memset(saved.bytes + saved.size / 2, 0xBF, 16); /* -1.5 at any alignment */
    assert_int_equal(test_restore(&f->ctx, archive, other, saved), BST_ERR_FORMAT);
    free(saved.bytes);
    bst_renderer_free(other);
    bst_renderer_free(r);
}

static void impossible_traps_are_refused(void **state) {
    fixture *f = *state;
    bst_detector_config d = {.persistence = {{0.5, 0.5, 0.1, 0, 0}, {1, 1, 1, 1, 1}}};
    assert_int_equal(bst_detector_config_check(&f->ctx, &d), BST_ERR_CONFIG);
    assert_non_null(
        strstr(f->ctx.message, "persistence/trapped_share: all species together trap 1.1"));
    d.persistence.trapped_share[2] = 0.0;
    bst_assert_ok(&f->ctx, bst_detector_config_check(&f->ctx, &d));
    d.row_time_s = 1e-4;
    assert_int_equal(bst_detector_config_check(&f->ctx, &d), BST_ERR_CONFIG);
    assert_non_null(strstr(f->ctx.message, "persistence"));
}

static int open_device(void **state) {
    fixture *f = calloc(1, sizeof *f);
    *state = f;
    return f && bst_device_open(&f->ctx, "", 0, &f->device) == BST_OK ? 0 : -1;
}

static int close_device(void **state) {
    fixture *f = *state;
    bst_device_close(f->device);
    free(f);
    return 0;
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(traps_follow_their_equation),
        cmocka_unit_test(ramps_fill_in_closed_form),
        cmocka_unit_test(hits_fill_traps),
        cmocka_unit_test(charge_is_saved_and_handed_over),
        cmocka_unit_test(impossible_traps_are_refused),
    };
    return cmocka_run_group_tests(tests, open_device, close_device);
}
