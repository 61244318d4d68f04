/* The motion that image processing measures on streaks, of a path that differs from the telemetry's
 * along it, across it and in its bend: all of it on bright stars, a share of it by the errors of
 * both on faint ones. */
#include <stdlib.h>

#include "boresight/rng.h"
#include "boresight/vec.h"
#include "obsgen/generator_internal.h"
#include "tests/test_support.h"

enum { NODES = 65, EXPOSURES = 4000 };

typedef struct bench {
    bst_generator g;
    bst_camera camera;
    bst_truth *truth;
    bst_generator_frame frame;
    double x[NODES], y[NODES];
} bench;

static const double LENGTH = 26.0, DIRECTION = 0.7, BEND = 0.3; /* telemetry's, px */

/* A path that is longer by `along`, farther to the side by `across`, and bends by `bend` more than
 * telemetry says. */
static void set_path(bench *b, double along, double across, double bend) {
    double c = cos(DIRECTION), s = sin(DIRECTION);
    for (int k = 0; k < NODES; k++) {
        double u = (double)k / (NODES - 1) - 0.5, bow = 6.0 * u * u - 0.5;
        double p = u * (LENGTH + along) + bow * (BEND + bend), q = u * across;
        b->x[k] = p * c - q * s;
        b->y[k] = p * s + q * c;
    }
}

static bench *make(int binning, double snr) {
    bench *b = calloc(1, sizeof *b);
    assert_non_null(b);
    bst_generator *g = &b->g;
    b->camera = (bst_camera){.read_noise_e = 7.0};
    b->truth = calloc(1, sizeof *b->truth + sizeof b->truth->items[0]);
    assert_non_null(b->truth);
    b->truth->background_e = 12.0;
    b->truth->dark_e = 3.0;
    b->truth->count = 1;
    b->truth->items[0] = (bst_truth_item){
        .kind = BST_SOURCE_STAR, .flags = BST_TRUTH_IN_FIELD, .snr = snr, .electrons = 40.0 * snr};
    g->camera = &b->camera;
    g->binning = binning;
    g->settings.jitter_px = 4.8; /* a bend of 0.36 px, with the next one 0.6 px */
    g->settings.motion_bend_px = 0.48;
    g->key = bst_rng_make_key(5, 0, "test", "motion");
    g->total_sigma = 0.9;
    g->fitted_sigma = 0.85;
    g->image_sigma = g->filter_sigma = 0.9;
    g->bias_sigma = 1.27;
    bst_crlb_table_init(&g->bound, 0.85);
    g->streak = LENGTH;
    g->star_path = (bst_obsgen_path_px){LENGTH * cos(DIRECTION), LENGTH * sin(DIRECTION)};
    g->bend_x = BEND * cos(DIRECTION);
    g->bend_y = BEND * sin(DIRECTION);
    g->path = (bst_star_trail_path){b->x, b->y, NODES};
    g->path_x = b->x;
    g->path_y = b->y;
    b->frame = (bst_generator_frame){.truth = b->truth, .bend_sigma_px = 0.5};
    return b;
}

static void drop(bench *b) {
    free(b->truth);
    free(b);
}

/* What is measured beyond telemetry, along, across and of the bend: means, and the bend's standard
 * deviation. */
static void measure(bench *b, double mean[3], double *scatter) {
    double c = cos(DIRECTION), s = sin(DIRECTION), sum[3] = {0.0}, square = 0.0;
    for (int i = 0; i < EXPOSURES; i++) {
        b->truth->exposure_id = i;
        bst_generator_measure_motion(&b->g, &b->frame);
        double dx = b->g.fit_path.dx - b->g.star_path.dx, dy = b->g.fit_path.dy - b->g.star_path.dy;
        /* the streaks that are fitted follow what is measured, on either axis */
        const bst_streak_model fitted = bst_generator_streak_model(&b->g);
        bst_assert_close(fitted.path.dx, b->g.fit_path.dx, 0.0);
        bst_assert_close(fitted.path.dy, b->g.fit_path.dy, 0.0);
        bst_assert_close(fitted.bend.dx, b->g.fit_bend_x, 0.0);
        bst_assert_close(fitted.bend.dy, b->g.fit_bend_y, 0.0);
        double bx = b->g.fit_bend_x - b->g.bend_x, by = b->g.fit_bend_y - b->g.bend_y;
        sum[0] += dx * c + dy * s;
        sum[1] += dy * c - dx * s;
        sum[2] += bx * c + by * s;
        square += pow(bx * c + by * s, 2);
        bst_assert_close(by * c - bx * s, 0.0, 1e-12); /* along the path */
    }
    for (int k = 0; k < 3; k++) {
        mean[k] = sum[k] / EXPOSURES;
    }
    *scatter = sqrt(square / EXPOSURES - mean[2] * mean[2]);
}

/* With the squared SNR Q of a star with the noise of its own brightest pixel, of a streak of length
 * L and width S: variances L^2 / (12 Q) of the bend and 8 S L / Q of length and direction, against
 * (0.075 jitter)^2 + motion_bend_px^2 + sigma^2 of the telemetry's bend and 1 px^2 of its length.
 */
static void shares_of_a_path(void **state) {
    (void)state;
    for (int binning = 1; binning <= 2; binning++) {
        for (double snr = 25.0; snr < 2e4; snr *= 5.0) {
            bench *b = make(binning, snr);
            double mean[3], scatter;
            set_path(b, 1.3, -0.9, 0.25);
            measure(b, mean, &scatter);
            double norm = bst_crlb_table_norm(&b->g.bound, LENGTH),
                   variance = binning * binning * 15.0 + 49.0;
            double q = snr * snr / (1.0 + sqrt(2.0) * 40.0 * snr * norm * norm / variance);
            double bend2 = LENGTH * LENGTH / (12.0 * q),
                   prior2 = (0.36 + 0.25) / (binning * binning);
            double ends2 = 8.0 * 0.9 * LENGTH / q, drift2 = 1.0 / (binning * binning);
            double whole = drift2 / (drift2 + ends2), share = prior2 / (prior2 + bend2);
            /* nodes of the path are weighted as a trapezoid: 1 / 64^2 */
            bst_assert_close(mean[0], 1.3 * whole, 5e-3);
            bst_assert_close(mean[1], -0.9 * whole, 5e-3);
            double sigma = share * sqrt(bend2);
            bst_assert_close(mean[2], 0.25 * share, 4.5 * sigma / sqrt(EXPOSURES) + 1e-3);
            bst_assert_close(scatter / sigma, 1.0, 0.06); /* five standard errors */
            drop(b);
        }
    }
}

/* No stars, frames with too long a streak, short and strongly bent paths: telemetry's motion stays.
 */
static void motion_that_is_not_measured(void **state) {
    (void)state;
    for (int k = 0; k < 5; k++) {
        bench *b = make(1, 500.0);
        set_path(b, 1.0, 1.0, 0.2);
        b->g.smeared = k == 0;
        b->truth->items[0].snr = k == 1 ? 19.0 : 500.0;
        b->truth->items[0].flags |= k == 2 ? BST_TRUTH_SATURATED : 0u;
        b->g.fitted_sigma = k == 3 ? 0.26 * LENGTH : 0.85;
        b->g.bend_x *= k == 4 ? 0.51 * LENGTH / BEND : 1.0;
        b->g.bend_y *= k == 4 ? 0.51 * LENGTH / BEND : 1.0;
        bst_generator_measure_motion(&b->g, &b->frame);
        bst_assert_close(b->g.fit_path.dx, b->g.star_path.dx, 0.0);
        bst_assert_close(b->g.fit_path.dy, b->g.star_path.dy, 0.0);
        bst_assert_close(b->g.fit_bend_x, b->g.bend_x, 0.0);
        bst_assert_close(b->g.fit_bend_y, b->g.bend_y, 0.0);
        drop(b);
    }
}

/* Paths with a third of their length as bend, and in uneven frames paths of 3 sigma of the PSF, are
 * measured, as image processing does (sim/onboard/measured_path.h): the variance of their ends is
 * that of the light of both, 8 S L / Q, with the telemetry's. */
static void bent_and_short_paths(void **state) {
    (void)state;
    for (int k = 0; k < 4; k++) {
        const bool bent = k < 2, measured = bent || k == 3;
        bench *b = make(2, 2e4);
        set_path(b, 1.3, -0.9, 0.25);
        b->g.bend_x *= bent ? 0.33 * LENGTH / BEND : 1.0;
        b->g.bend_y *= bent ? 0.33 * LENGTH / BEND : 1.0;
        b->g.fitted_sigma = bent ? 0.85 : LENGTH / 3.0;
        b->g.followed = k % 2;
        bst_generator_measure_motion(&b->g, &b->frame);
        const double norm = bst_crlb_table_norm(&b->g.bound, LENGTH);
        const double q = 4e8 / (1.0 + sqrt(2.0) * 8e5 * norm * norm / (4 * 15.0 + 49.0));
        const double ends2 = 8.0 * 0.9 * LENGTH / q;
        assert_int_equal(b->g.fit_path.dx != b->g.star_path.dx, measured);
        assert_int_equal(b->g.bend_after < b->g.bend_before, measured);
        bst_assert_close(b->g.ends_after, measured ? sqrt(ends2 / (1.0 + 4.0 * ends2)) : 0.0, 1e-9);
        drop(b);
    }
}

/* A path that rests at its end for nine tenths of the exposure is a point to the filters: images
 * have no streak to measure the motion on. */
static void paths_that_dwell(void **state) {
    (void)state;
    for (int k = 0; k < 2; k++) {
        bench *b = make(1, 2e4);
        for (int n = 0; n < NODES; n++) {
            const double u = (double)n / (NODES - 1), rest = k ? 0.1 : 1.0;
            const double at = LENGTH * (u < rest ? u / rest - 1.0 + 0.5 * rest : 0.5 * rest);
            b->x[n] = at * cos(DIRECTION);
            b->y[n] = at * sin(DIRECTION);
        }
        b->g.followed = true;
        bst_generator_measure_motion(&b->g, &b->frame);
        assert_int_equal(b->g.bend_after < b->g.bend_before, k == 0);
        drop(b);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(shares_of_a_path),
        cmocka_unit_test(motion_that_is_not_measured),
        cmocka_unit_test(bent_and_short_paths),
        cmocka_unit_test(paths_that_dwell),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
