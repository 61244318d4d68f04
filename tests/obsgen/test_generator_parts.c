/* Parts of the generator on their own: widths of images, errors of false alarms, and when stars
 * that are merged look like a streak. */
#include "boresight/vec.h"
#include "obsgen/generator_internal.h"
#include "obsgen/model/false_alarms.h"
#include "tests/test_support.h"

#define FWHM 2.3548200450309493 /* per sigma */

static bst_generator generator;

/* A frame binned by two that begins at (60, 20) on the sensor. */
static bst_generator *make(double sigma) {
    bst_generator *g = &generator;
    *g = (bst_generator){.binning = 2,
                         .width = 90,
                         .height = 70,
                         .origin_x = 60.5,
                         .origin_y = 20.5,
                         .exposure_s = 0.8,
                         .electrons_per_s_v0 = 1e9,
                         .noise_e = 5.0,
                         .sigma = sigma,
                         .total_sigma = sqrt(sigma * sigma + 1.0 / 12.0),
                         .fitted_sigma = sigma};
    g->filter_sigma = g->total_sigma;
    g->response.source.across_px = g->response.source.along_px = g->total_sigma;
    bst_crlb_table_init(&g->bound, sigma);
    g->key = bst_rng_make_key(3, 0, "test", "parts");
    return g;
}

/* Length, width and angle are those of a covariance, in pixels of the sensor. */
static void expect_extent(const bst_detection *d, double xx, double xy, double yy) {
    double a = pow(d->length_px / 2.0 / FWHM, 2.0), b = pow(d->width_px / 2.0 / FWHM, 2.0);
    double c = cos(d->angle_rad), s = sin(d->angle_rad);
    bst_assert_close(c * c * a + s * s * b, xx, 1e-9);
    bst_assert_close(c * s * (a - b), xy, 1e-9);
    bst_assert_close(s * s * a + c * c * b, yy, 1e-9);
}

/* Light of a shape, in square pixels of the sensor, widens the image by its covariance in those
 * that are read. */
static void widths_of_shapes(void **state) {
    (void)state;
    bst_generator *g = make(0.9);
    const bst_truth_shape shapes[] = {{.item = 3, .light_xx_px2 = 90.0, .snr_ratio = 0.1},
                                      {.item = 7,
                                       .light_xx_px2 = 24.0,
                                       .light_xy_px2 = -10.0,
                                       .light_yy_px2 = 8.0,
                                       .snr_ratio = 0.6,
                                       .filter_ratio = 0.4}};
    bst_truth *truth = calloc(1, sizeof *truth);
    assert_non_null(truth);
    truth->shape_count = 2;
    memcpy(truth->shapes, shapes, sizeof shapes);
    generator_source s = {.item = 7, .length = 5.0, .path = {.dx = -3.0, .dy = 4.0}},
                     point = {.item = 9};
    bst_generator_set_image(g, truth, &s);
    bst_generator_set_image(g, truth, &point);
    bst_assert_close(s.snr_ratio, 0.6, 0.0);
    bst_assert_close(s.filter_ratio, 0.4, 0.0);
    bst_assert_close(s.shape_xx, 6.0, 1e-12);
    bst_assert_close(s.shape_xy, -2.5, 1e-12);
    bst_assert_close(s.shape_yy, 2.0, 1e-12);
    bst_assert_close(point.snr_ratio * point.filter_ratio, 1.0, 0.0);
    bst_assert_close(point.shape_xx + point.shape_yy, 0.0, 0.0);
    /* along (c, n) the variance is that of the sum */
    double c = cos(0.7), n = sin(0.7), psf2 = 0.9 * 0.9 + 1.0 / 12.0;
    double wide2 = c * c * 6.0 - 2.0 * c * n * 2.5 + n * n * 2.0;
    bst_assert_close(bst_generator_image_factor(g, &s, c, n), sqrt((psf2 + wide2) / psf2) / 0.6,
                     1e-9);
    bst_assert_close(bst_generator_image_factor(g, &point, c, n), 1.0, 1e-12);
    bst_detection d = {0};
    double path2 = 6.0 * 6.0 / 12.0; /* 6 px along (-3, 4) / 5 */
    bst_generator_set_image_extent(g, &s, 6.0, &d);
    expect_extent(&d, 0.81 + 6.0 + 0.36 * path2, -2.5 - 0.48 * path2, 0.81 + 2.0 + 0.64 * path2);
    s.length = 0.0;
    bst_generator_set_image_extent(g, &s, 0.0, &d);
    expect_extent(&d, 0.81 + 6.0, -2.5, 0.81 + 2.0);
    free(truth);
}

/* A false alarm is a point or a streak of the stars' path, with its bound's errors along and
 * across, and cut where half of it reaches over an edge. */
static void errors_of_false_alarms(void **state) {
    (void)state;
    bst_generator *g = make(1.1);
    g->star_path = (bst_obsgen_path_px){.dx = -8.0, .dy = 6.0};
    g->streak = 10.0;
    for (int k = 0; k < 2; k++) {
        double length = 10.0 * k, norm = bst_crlb_table_norm(&g->bound, length);
        bst_detection d = bst_false_alarms_point(g, 41.0, 33.0, 6.5, length);
        bst_assert_close(d.x_px, 60.5 + 82.0, 1e-12);
        bst_assert_close(d.y_px, 20.5 + 66.0, 1e-12);
        bst_assert_close(d.flux_e, 6.5 * 5.0 / norm, 1e-9);
        bst_assert_close(d.snr, 6.5, 0.0);
        bst_assert_close(d.v_mag, -2.5 * log10(d.flux_e / 0.8 / 1e9), 1e-9);
        bst_crlb_table_at bound = bst_crlb_table_of(&g->bound, d.flux_e, 5.0, length);
        double along = 4.0 * bound.var_along_px2, across = 4.0 * bound.var_across_px2;
        double c = k ? -0.8 : 1.0, s = k ? 0.6 : 0.0;
        bst_assert_close(d.cov_xx, c * c * along + s * s * across, 1e-9 * along);
        bst_assert_close(d.cov_xy, c * s * (along - across), 1e-9 * along);
        bst_assert_close(d.cov_yy, s * s * along + c * c * across, 1e-9 * along);
        bst_assert_close(d.flux_sigma_e, sqrt(bound.flux_variance), 1e-9);
        double path2 = length * length / 12.0;
        expect_extent(&d, 1.21 + c * c * path2, c * s * path2, 1.21 + s * s * path2);
        bst_assert_close(d.angle_rad, k ? atan(-0.75) : 0.0, 1e-12);
        assert_int_equal(d.flags, k ? BST_DETECTION_STREAK : 0);
        /* 2 sigma and half of the streak on each axis */
        double x = 2.2 + 0.4 * length, y = 2.2 + 0.3 * length;
        for (int side = 0; side < 8; side++) {
            double in = side % 2 ? 0.01 : -0.01; /* from the limit, just inside or outside */
            double at_x = side / 2 == 0 ? x - 0.5 + in : side / 2 == 1 ? 89.5 - x - in : 45.0;
            double at_y = side / 2 == 2 ? y - 0.5 + in : side / 2 == 3 ? 69.5 - y - in : 35.0;
            d = bst_false_alarms_point(g, at_x, at_y, 6.5, length);
            assert_int_equal((d.flags & BST_DETECTION_EDGE) != 0, side % 2 == 0);
        }
    }
}

/* ---- merged stars ---- */

typedef struct light {
    double x, y, dx, dy, flux;
} light;

/* Larger principal second moment of lights about a place under a Gaussian window of this variance,
 * by sums over fine pixels; the window is removed by adding inverse covariances, and the pixel's
 * own variance taken off. */
static double moment_of(const light *lights, int count, const double about[2], double image2,
                        double window) {
    double sum = 0.0, m[3] = {0};
    for (int j = -60; j <= 60; j++) {
        for (int i = -60; i <= 60; i++) {
            double x = 0.25 * i, y = 0.25 * j, value = 0.0;
            for (int k = 0; k < count; k++) {
                const light *l = &lights[k];
                /* a Gaussian of the path's variance, as the generator takes it */
                double xx = image2 + l->dx * l->dx / 12.0, yy = image2 + l->dy * l->dy / 12.0;
                double xy = l->dx * l->dy / 12.0, det = xx * yy - xy * xy;
                double u = x + about[0] - l->x, v = y + about[1] - l->y;
                value += l->flux / sqrt(det) *
                         exp(-0.5 * (yy * u * u - 2.0 * xy * u * v + xx * v * v) / det);
            }
            value *= exp(-0.5 * (x * x + y * y) / window);
            sum += value;
            m[0] += value * x * x;
            m[1] += value * x * y;
            m[2] += value * y * y;
        }
    }
    double xx = m[0] / sum, xy = m[1] / sum, yy = m[2] / sum, det = xx * yy - xy * xy;
    double a = yy / det - 1.0 / window, b = -xy / det, c = xx / det - 1.0 / window;
    det = a * c - b * b;
    xx = c / det;
    xy = -b / det;
    yy = a / det;
    return 0.5 * (xx + yy) + hypot(0.5 * (xx - yy), xy) - 1.0 / 12.0;
}

enum { LIGHTS = 5 };

/* A bright star, two others on its line, one far along it, and one of another detection beside. */
static void place(double apart, double angle_rad, light l[LIGHTS]) {
    double c = cos(angle_rad), s = sin(angle_rad);
    l[0] = (light){40.2, 30.3, 1.5 * c, 1.5 * s, 1e9};
    l[1] = (light){40.2 + apart * c, 30.3 + apart * s, 0.0, 0.0, 6e8};
    l[2] = (light){40.2 - 1.3 * c, 30.3 - 1.3 * s, -0.4, 0.9, 3e8};
    l[3] = (light){40.2 + 4.8 * c, 30.3 + 4.8 * s, 0.0, 0.0, 2e8};
    l[4] = (light){41.0, 29.0, 0.0, 0.0, 8e8};
}

/* What the generator makes of them about a place; true: a streak. */
static bool merge(bst_generator *g, const light l[LIGHTS], const double about[2], double scale,
                  uint64_t name, generator_blend *out) {
    static generator_source sources[LIGHTS];
    for (int k = 0; k < LIGHTS; k++) {
        sources[k] = (generator_source){.x = l[k].x,
                                        .y = l[k].y,
                                        .path = {.dx = l[k].dx, .dy = l[k].dy},
                                        .flux_e = scale * l[k].flux,
                                        .item = k,
                                        .head = k == 4 ? 4 : -1,
                                        .peak = 15.0,
                                        .name = name};
    }
    g->sources = sources;
    *out = (generator_blend){.flux_e = scale * 2e9, .x = about[0], .y = about[1]};
    bst_generator_fit_merged(g, &sources[0], &sources[1], LIGHTS - 1, out);
    return out->x != about[0];
}

/* Without noise, a merged detection becomes a streak where its larger moment is 2.25 times the
 * PSF's; then it is the centroid of the light within the streak's length. Light that belongs to
 * another detection does not count. */
static void merged_stars(void **state) {
    (void)state;
    bst_generator *g = make(1.0);
    g->noise_e = 1e-3;
    double image2 = 1.0 + 1.0 / 12.0, window = 2.0 * image2;
    for (int way = 0; way < 6; way++) {
        const double about[2] = {40.2 + 0.25 * cos(0.5 * way), 30.3 + 0.25 * sin(0.5 * way)};
        light l[LIGHTS];
        generator_blend out;
        double low = 0.5, high = 3.5;
        for (int i = 0; i < 20; i++) {
            double middle = 0.5 * (low + high);
            place(middle, 0.5 * way, l);
            *(merge(g, l, about, 1.0, 1, &out) ? &high : &low) = middle;
        }
        place(high, 0.5 * way, l);
        assert_true(merge(g, l, about, 1.0, 1, &out));
        bst_assert_close(moment_of(l, LIGHTS - 1, about, image2, window), 2.25, 0.003);
        double length = sqrt(12.0 * (2.25 - 1.0)), sum = 0.0, x = 0.0, y = 0.0;
        for (int k = 0; k < LIGHTS - 1; k++) {
            if (hypot(l[k].x - about[0], l[k].y - about[1]) <= length) {
                sum += l[k].flux;
                x += l[k].flux * l[k].x;
                y += l[k].flux * l[k].y;
            }
        }
        assert_true(sum < 2e9); /* without the far one */
        bst_assert_close(out.flux_e, sum, 1.0);
        bst_assert_close(out.x, x / sum, 1e-9);
        bst_assert_close(out.y, y / sum, 1e-9);
    }
}

/* With noise, how often it is a streak is the probability that the moment exceeds the limit by its
 * standard deviation: that of sum(w d u^2) / sum(w d) for pixels of unit area, times the square of
 * moment over windowed moment. */
static void noise_of_the_moment(void **state) {
    (void)state;
    enum { DRAWS = 4000 };
    const double image2 = 1.0 + 1.0 / 12.0, window = 2.0 * image2, scale = 3e-6;
    bst_generator *g = make(1.0);
    const double about[2] = {40.45, 30.3};
    light l[LIGHTS];
    generator_blend out;
    for (int k = 0; k < 2; k++) {
        g->noise_e = k ? 5.0 : 60.0; /* of the pixels, of the light */
        place(k ? 1.35 : 1.55, 0.0, l);
        double moment = moment_of(l, LIGHTS - 1, about, image2, window);
        /* a Gaussian of both moments stands for the light; the other axis is nearly the PSF's */
        double along = moment + 1.0 / 12.0, across = image2 + 0.02;
        double windowed = along * window / (along + window), sum = 0.0, variance = 0.0;
        for (int i = -60; i <= 60; i++) {
            for (int j = -60; j <= 60; j++) {
                double u = 0.2 * i, v = 0.2 * j, w = exp(-0.5 * (u * u + v * v) / window);
                double d = scale * 2e9 * 0.04 / (2.0 * BST_PI * sqrt(along * across)) *
                           exp(-0.5 * (u * u / along + v * v / across));
                double error = w * (u * u - windowed);
                sum += w * d;
                variance += error * error * (g->noise_e * g->noise_e * 0.04 + d);
            }
        }
        double gain = along / windowed, sigma = gain * gain * sqrt(variance) / sum;
        int streaks = 0;
        for (uint64_t n = 0; n < DRAWS; n++) {
            streaks += merge(g, l, about, scale, n, &out);
        }
        double expected = 0.5 * erfc((2.25 - moment) / sigma / sqrt(2.0));
        print_message("moment %.3f, sigma %.3f: %.3f of %.3f\n", moment, sigma,
                      (double)streaks / DRAWS, expected);
        assert_true(expected > 0.02 && expected < 0.98);
        bst_assert_close((double)streaks / DRAWS, expected, 0.03);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(widths_of_shapes),
        cmocka_unit_test(errors_of_false_alarms),
        cmocka_unit_test(merged_stars),
        cmocka_unit_test(noise_of_the_moment),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
