/* Parts of the generator on their own: widths of images, errors of false alarms, and when stars
 * that are merged look like a streak. Then all of it: one scene seen in many ways. */
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
                         .excess = 1.0,
                         .norm_ratio = {1.0, 1.0},
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

/* A pixel of the frame is saturated by its converter, above the offset, or from 98 % of the wells
 * of its four pixels on. */
static void saturation_of_binned_pixels(void **state) {
    (void)state;
    bst_camera camera = {
        .bits = 12, .offset_dn = 90.0, .gain_e_per_dn = 4.0, .full_well_e = 50000.0};
    bst_generator *g = make(0.9);
    g->camera = &camera;
    g->background_e = 120.0;
    bst_assert_close(bst_generator_saturation_e(g), (4095.0 - 90.0) * 4.0 - 120.0, 1e-9);
    camera.bits = 16;
    bst_assert_close(bst_generator_saturation_e(g), 0.98 * 4 * 50000.0 - 120.0, 1e-9);
    g->binning = 1;
    bst_assert_close(bst_generator_saturation_e(g), 0.98 * 50000.0 - 120.0, 1e-9);
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
                                        .snr_ratio = 1.0,
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

/* ---- one scene turned, mirrored, windowed and binned ---- */

enum { WIDE = 320, HIGH = 200, SOURCES = 48, STEPS = 33 };

/* How a scene lies on the sensor. */
typedef struct view {
    bool flip_x, flip_y, transpose; /* in this order */
    int binning, left, top;         /* of the window */
    double angle;                   /* turned about the middle before all that */
} view;

static void placed(const view *v, double x, double y, double *u, double *w) {
    double dx = x - 0.5 * (WIDE - 1), dy = y - 0.5 * (HIGH - 1);
    x = 0.5 * (WIDE - 1) + dx * cos(v->angle) - dy * sin(v->angle);
    y = 0.5 * (HIGH - 1) + dy * cos(v->angle) + dx * sin(v->angle);
    x = v->flip_x ? WIDE - 1 - x : x;
    y = v->flip_y ? HIGH - 1 - y : y;
    double half = 0.5 * (v->binning - 1);
    *u = v->binning * (v->transpose ? y : x) + half + v->left;
    *w = v->binning * (v->transpose ? x : y) + half + v->top;
}

static void turned(const view *v, double x, double y, double *u, double *w) {
    double dx = x * cos(v->angle) - y * sin(v->angle), dy = y * cos(v->angle) + x * sin(v->angle);
    dx = v->flip_x ? -dx : dx;
    dy = v->flip_y ? -dy : dy;
    *u = v->binning * (v->transpose ? dy : dx);
    *w = v->binning * (v->transpose ? dx : dy);
}

/* A star or a target about (x, y) whose path is (dx, dy), in binned pixels of the unturned scene.
 */
static void add(bst_truth *t, const view *v, const double at[2], const double path[2],
                double electrons) {
    bst_truth_item *item = &t->items[t->count];
    double dx, dy;
    *item = (bst_truth_item){.id = (uint32_t)t->count + 1,
                             .kind = t->count % 3 ? BST_SOURCE_STAR : BST_SOURCE_OBJECT,
                             .flags = BST_TRUTH_IN_FIELD,
                             .electrons = electrons};
    t->count++;
    placed(v, at[0], at[1], &item->x_centroid_px, &item->y_centroid_px);
    turned(v, path[0], path[1], &dx, &dy);
    item->x_mid_px = item->x_centroid_px;
    item->y_mid_px = item->y_centroid_px;
    item->x_start_px = item->x_mid_px - 0.5 * dx;
    item->y_start_px = item->y_mid_px - 0.5 * dy;
    item->x_end_px = item->x_mid_px + 0.5 * dx;
    item->y_end_px = item->y_mid_px + 0.5 * dy;
}

typedef struct seen_scene {
    bst_detection of[SOURCES]; /* by item */
    bool found[SOURCES];
    int count;
    double x_px, y_px; /* sums of all detections */
    double snr, length_px;
    double noise_e, threshold, streak_px;
    bst_generator_filter filter[2];
} seen_scene;

/* Sources on a grid and beyond all four edges; pairs; one with an image of its own. */
static void fill_scene(bst_truth *t, const view *v, const double star[2]) {
    t->count = 0;
    for (int i = 0; i < 28; i++) {
        double own[2] = {star[0] * (i % 2) + 1.2 * cos(i), star[1] * (i % 2) + 1.9 * sin(i)};
        const double at[2] = {25.0 + 43.0 * (i % 7) + 0.37 * (i % 5),
                              28.0 + 45.0 * floor(i / 7.0) + 0.29 * (i % 3)};
        add(t, v, at, i % 3 == 1 ? star : own, 3e3 * (1 + i % 4));
    }
    const double edge[8][2] = {{-1.6, 70.3},        {-0.1, 120.8},      {WIDE + 0.9, 60.2},
                               {WIDE - 1.2, 90.0},  {200.2, -0.7},      {101.4, 0.2},
                               {222.0, HIGH + 0.3}, {120.3, HIGH - 1.0}};
    for (int i = 0; i < 8; i++) {
        const double slow[2] = {0.3, 0.5 - 0.1 * i};
        add(t, v, edge[i], slow, 4e4);
    }
    for (int i = 0; i < 6; i++) { /* merged pairs */
        const double beside[2] = {25.7 + 43.0 * i + 1.1 * cos(1.0 + i), 28.4 + 1.1 * sin(1.0 + i)};
        add(t, v, beside, star, 5e3);
    }
    const double cut[2] = {1.2, 95.0}, whole[2] = {150.0, 95.0};
    add(t, v, cut, star, 2e4);
    add(t, v, whole, star, 2e4);
    double c = cos(v->angle), n = sin(v->angle), square = v->binning * v->binning;
    double xx = 11.0 * c * c - 8.0 * c * n + 5.0 * n * n;
    double yy = 11.0 * n * n + 8.0 * c * n + 5.0 * c * c;
    double xy = 6.0 * c * n + 4.0 * (c * c - n * n);
    xy *= v->flip_x != v->flip_y ? -1.0 : 1.0;
    t->shape_count = 1;
    t->shapes[0] = (bst_truth_shape){.item = 9,
                                     .light_xx_px2 = square * (v->transpose ? yy : xx),
                                     .light_xy_px2 = square * xy,
                                     .light_yy_px2 = square * (v->transpose ? xx : yy),
                                     .snr_ratio = 0.6,
                                     .filter_ratio = 0.5};
}

/* Stars along (dx, dy) with a bend, both in binned pixels of the unturned scene; few: only those in
 * the middle that are alone. */
static void look(const view *v, double dx, double dy, bool bent, bool few, seen_scene *out) {
    static double path_x[STEPS], path_y[STEPS];
    bst_ctx ctx = {0};
    const double star[2] = {dx, dy};
    int b = v->binning, width = b * (v->transpose ? HIGH : WIDE),
        height = b * (v->transpose ? WIDE : HIGH);
    bst_camera camera = {.width_px = width + 2 * v->left,
                         .height_px = height + 3 * v->top,
                         .pixel_scale_arcsec = 3.0 / b,
                         .aperture_m = 0.15,
                         .throughput = 0.7,
                         .quantum_efficiency = 0.7,
                         .photon_flux_v0_per_s_m2 = 3.6e10,
                         .psf_fwhm_px = 2.0 * b,
                         .read_noise_e = 8.0,
                         .full_well_e = 1e6,
                         .gain_e_per_dn = 1.6,
                         .bits = 16,
                         .detector.cosmic_rays = {.rate_per_cm2_s = 40.0,
                                                  .pixel_pitch_um = 15.0 / b,
                                                  .depth_um = 50.0,
                                                  .e_per_um = 60.0,
                                                  .straggling = 0.1,
                                                  .readout_s = 0.4}};
    bst_generator_settings settings = {.capacity = 256,
                                       .false_alarms_per_frame = 12.0,
                                       .streak_min_px = 1.5,
                                       .streak_max_px = 64.0};
    bst_obsgen_calibration calibration;
    bst_obsgen_calibration_theory(&calibration);
    bst_truth *t = calloc(1, sizeof *t + SOURCES * sizeof t->items[0]);
    bst_generator *g;
    bst_generator_result result;
    assert_non_null(t);
    fill_scene(t, v, star);
    for (int i = 0; i < SOURCES; i++) {
        const bool alone[SOURCES] = {
            [9] = true, [10] = true, [11] = true, [16] = true, [17] = true, [18] = true};
        t->items[i].electrons *= few && !alone[i] ? 0.0 : 1.0;
    }
    t->background_e = 36.0 / (b * b);
    t->exposure_id = 4;
    bst_generator_frame frame = {.truth = t,
                                 .window = {v->left, v->top, width, height},
                                 .binning = b,
                                 .exposure_s = 0.5,
                                 .sigma_px = b * 2.0 / FWHM};
    turned(v, dx, dy, &frame.streak_dx_px, &frame.streak_dy_px);
    if (bent) {
        turned(v, -1.4, 2.1, &frame.bend_x_px, &frame.bend_y_px);
        for (int k = 0; k < STEPS; k++) {
            double u = 2.0 * k / (STEPS - 1) - 1.0, bend = 0.5 * (3.0 * u * u - 1.0);
            path_x[k] = 0.5 * u * frame.streak_dx_px + bend * frame.bend_x_px;
            path_y[k] = 0.5 * u * frame.streak_dy_px + bend * frame.bend_y_px;
        }
        frame.path_x_px = path_x;
        frame.path_y_px = path_y;
        frame.path_count = STEPS;
    }
    bst_assert_ok(&ctx,
                  bst_generator_create(&ctx, &camera, &camera, &settings, &calibration,
                                       bst_rng_make_key(7, 0, "a/b/obsgen", "observations"), &g));
    bst_assert_ok(&ctx, bst_generator_run(&ctx, g, &frame, &result));
    *out = (seen_scene){.noise_e = result.noise_e,
                        .threshold = result.threshold_snr,
                        .streak_px = result.streak_px / b,
                        .filter = {result.point, result.filter}};
    out->count = result.count;
    for (int i = 0; i < result.count; i++) {
        int item = result.items[i].item;
        const bst_detection *d = &result.items[i].detection;
        out->x_px += (d->x_px - v->left - 0.5 * (b - 1)) / b;
        out->y_px += (d->y_px - v->top - 0.5 * (b - 1)) / b;
        out->snr += d->snr;
        out->length_px += d->length_px / b;
        if (item >= 0 && !out->found[item]) {
            out->found[item] = true;
            out->of[item] = *d;
        }
    }
    bst_generator_free(g);
    free(t);
}

/* A source is seen as in the unturned scene. Errors are drawn along and across each source's path:
 * a mirrored scene has those across it reversed. */
static void expect_alike(const view *v, const bst_detection *d, const bst_detection *a,
                         bool own_image) {
    double x, y, b = v->binning;
    placed(v, a->x_px, a->y_px, &x, &y);
    double off[2] = {(d->x_px - x) / b, (d->y_px - y) / b}, c, n;
    bool mirrored = (v->flip_x + v->flip_y + v->transpose) % 2;
    turned(v, cos(a->angle_rad), sin(a->angle_rad), &c, &n);
    if (a->length_px > a->width_px) {
        bst_assert_close(cos(2.0 * d->angle_rad), (c * c - n * n) / (b * b), 1e-9);
        bst_assert_close(sin(2.0 * d->angle_rad), 2.0 * c * n / (b * b), 1e-9);
    }
    if (!mirrored) {
        bst_assert_close(off[0], 0.0, 1e-6);
        bst_assert_close(off[1], 0.0, 1e-6);
    } else if (!own_image && a->length_px > 1.05 * a->width_px) {
        bst_assert_close((off[0] * c + off[1] * n) / b, 0.0, 1e-6);
    }
    double to_x[2], to_y[2]; /* images of the axes */
    turned(v, 1.0, 0.0, &to_x[0], &to_x[1]);
    turned(v, 0.0, 1.0, &to_y[0], &to_y[1]);
    double cov[3] = {d->cov_xx, d->cov_xy, d->cov_yy}, want[3];
    for (int i = 0; i < 3; i++) {
        int p = i / 2, q = (i + 1) / 2;
        want[i] = to_x[p] * to_x[q] * a->cov_xx + to_y[p] * to_y[q] * a->cov_yy +
                  (to_x[p] * to_y[q] + to_y[p] * to_x[q]) * a->cov_xy;
        bst_assert_close(cov[i], want[i], 1e-9 * b * b);
    }
    bst_assert_close(d->length_px / b, a->length_px, 1e-9);
    bst_assert_close(d->width_px / b, a->width_px, 1e-9);
    bst_assert_close(d->snr, a->snr, 1e-6);
    bst_assert_close(d->flux_e, a->flux_e, 1e-4);
    assert_int_equal(d->flags, a->flags);
    assert_int_equal(d->label, a->label);
}

/* The left edge cuts off a third of a streak: its place along comes from the one end that is left,
 * that across from the light that is left. */
static void expect_cut_streak(const bst_detection *cut, const bst_detection *whole, double dx,
                              double dy) {
    double c = dx / hypot(dx, dy), n = dy / hypot(dx, dy);
    const bst_detection *d[2] = {cut, whole};
    double along[2], across[2];
    for (int k = 0; k < 2; k++) {
        double cross = 2.0 * c * n * d[k]->cov_xy;
        along[k] = c * c * d[k]->cov_xx + n * n * d[k]->cov_yy + cross;
        across[k] = n * n * d[k]->cov_xx + c * c * d[k]->cov_yy - cross;
    }
    bst_assert_close(along[0] / along[1], 2.0, 0.1); /* the bound goes with the drawn flux */
    bst_assert_close(across[0] / across[1], dx / (1.2 + 0.5 + 0.5 * dx), 0.1);
}

/* At rest, along a streak, along a bent one, and along one beyond what is filtered for; the last as
 * windows and binned only, where the false alarms too are the same. */
static void one_scene_in_many_ways(void **state) {
    (void)state;
    const view views[] = {{.binning = 1},
                          {.binning = 1, .left = 64, .top = 24},
                          {.binning = 2},
                          {.binning = 3, .left = 30, .top = 93},
                          {.binning = 1, .flip_x = true, .flip_y = true},
                          {.binning = 1, .flip_x = true, .transpose = true, .left = 12, .top = 8},
                          {.binning = 2, .flip_y = true, .transpose = true, .left = 10, .top = 4},
                          {.binning = 1, .flip_x = true},
                          {.binning = 1, .transpose = true},
                          {.binning = 1, .angle = 0.6},
                          {.binning = 2, .left = 8, .flip_x = true, .angle = -1.1}};
    const double stars[4][2] = {{0.7, 0.4}, {9.0, -5.0}, {9.0, -5.0}, {70.0, -45.0}};
    for (int motion = 0; motion < 4; motion++) {
        seen_scene first, other;
        look(&views[0], stars[motion][0], stars[motion][1], motion == 2, false, &first);
        if (motion == 1) {
            expect_cut_streak(&first.of[42], &first.of[43], stars[1][0], stars[1][1]);
        }
        for (size_t k = 1; k < (motion < 3 ? sizeof views / sizeof *views : 4); k++) {
            bool few = views[k].angle != 0.0; /* others leave the frame, or are parted by pixels */
            if (few) {
                look(&views[0], stars[motion][0], stars[motion][1], motion == 2, true, &first);
            }
            look(&views[k], stars[motion][0], stars[motion][1], motion == 2, few, &other);
            bst_assert_close(other.noise_e, first.noise_e, 1e-9);
            bst_assert_close(other.threshold, first.threshold, 1e-9);
            bst_assert_close(other.streak_px, first.streak_px, 1e-9);
            int found = 0;
            for (int f = 0; f < 2; f++) {
                const bst_generator_filter *a = &first.filter[f], *d = &other.filter[f];
                bst_assert_close(d->threshold, a->threshold, 1e-9);
                bst_assert_close(d->variance, a->variance, 1e-9);
                bst_assert_close(d->shot, a->shot, 1e-9);
                bst_assert_close(d->efficiency, a->efficiency, 1e-9);
            }
            for (int i = 0; i < SOURCES; i++) {
                assert_int_equal(other.found[i], first.found[i]);
                if (first.found[i]) {
                    expect_alike(&views[k], &other.of[i], &first.of[i], i == 9);
                    found++;
                }
            }
            assert_true(found > (motion == 3 ? 2 : few ? 4 : 30));
            if (k < 4) {
                assert_int_equal(other.count, first.count);
                assert_true(first.count > found + 4);
                bst_assert_close(other.x_px, first.x_px, 1e-6);
                bst_assert_close(other.y_px, first.y_px, 1e-6);
                bst_assert_close(other.snr, first.snr, 1e-5);
                bst_assert_close(other.length_px, first.length_px, 1e-6);
            }
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(saturation_of_binned_pixels), cmocka_unit_test(widths_of_shapes),
        cmocka_unit_test(errors_of_false_alarms),      cmocka_unit_test(merged_stars),
        cmocka_unit_test(noise_of_the_moment),         cmocka_unit_test(one_scene_in_many_ways),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
