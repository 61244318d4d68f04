/* The generator where frames are cut, binned, smeared or noisy in rows and columns, and where the
 * filter was made for another PSF: against numbers that the test makes itself. */
#include "obsgen/generator_internal.h"
#include "sim/optics/column_level.h"
#include "tests/obsgen/generator_scene.h"

static double above(double z) {
    return 0.5 * erfc(z / sqrt(2.0));
}

static double pixel_share(double from, double sigma) {
    double s = sigma * sqrt(2.0);
    return 0.5 * (erf((from + 0.5) / s) - erf((from - 0.5) / s));
}

/* Places and covariances are those of the sensor, whatever part of it is read and however binned.
 */
static void places_are_those_of_the_sensor(void **state) {
    (void)state;
    const bst_window windows[] = {{0, 0, SIDE, SIDE}, {160, 96, 512, 320}};
    const double x = 301.3, y = 207.8;
    double variance[2][3];
    for (int w = 0; w < 2; w++) {
        for (int binning = 1; binning <= 4; binning *= 2) {
            scene s;
            open_scene(&s);
            s.settings.false_alarms_per_frame = 1e-6;
            s.frame.window = windows[w];
            s.frame.binning = binning;
            start(&s);
            enum { FRAMES = 250 };
            double sum[2] = {0.0}, square[2] = {0.0}, stated = 0.0;
            for (int f = 0; f < FRAMES; f++) {
                s.truth->count = 0;
                add_source(&s, 1, x, y, 4e4);
                add_source(&s, 2, 100.0, 207.8, 4e4); /* beside the second window */
                bst_generator_result r = run(&s, f);
                assert_int_equal(r.count, 2 - w);
                const bst_obsgen_generated *seen = &r.items[r.items[0].item == 0 ? 0 : r.count - 1];
                const bst_detection *d = &seen->detection;
                sum[0] += d->x_px / FRAMES;
                sum[1] += d->y_px / FRAMES;
                square[0] += (d->x_px - x) * (d->x_px - x) / FRAMES;
                square[1] += (d->y_px - y) * (d->y_px - y) / FRAMES;
                stated += 0.5 * (d->cov_xx + d->cov_yy) / FRAMES;
            }
            /* five standard deviations of the mean */
            bst_assert_close(sum[0], x, 5.0 * sqrt(square[0] / FRAMES));
            bst_assert_close(sum[1], y, 5.0 * sqrt(square[1] / FRAMES));
            /* its own covariance is the scatter: four standard deviations of a mean square */
            bst_assert_close(0.5 * (square[0] + square[1]) / stated, 1.0, 4.0 / sqrt(FRAMES));
            variance[w][binning / 2] = stated;
            close_scene(&s);
        }
        /* coarse pixels tell a place of 2 px FWHM worse */
        assert_true(variance[w][0] < variance[w][1] && variance[w][1] < variance[w][2]);
    }
    bst_assert_close(variance[0][1], variance[1][1], 1e-3 * variance[0][1]);
}

/* Of a source on the frame's edge half of its light is there, and half of the squares: the filter,
 * whose norm image processing takes from what is on the frame, gives sqrt(1/2) of its SNR. */
static void half_of_the_light_gives_its_root(void **state) {
    (void)state;
    scene s;
    open_scene(&s);
    s.calibration.crowding = s.calibration.background_fraction = 0.0;
    start(&s);
    const double snr = 7.3, electrons = electrons_of(&s, snr);
    int found = 0, trials = 0;
    bst_generator_result r = {0};
    for (int f = 0; f < 60; f++) {
        s.truth->count = 0;
        for (int i = 0; i < 25; i++) {
            add_source(&s, (uint32_t)i + 1, i % 2 ? -0.5 : SIDE - 0.5, 40.0 * i + 20.0, electrons);
        }
        r = run(&s, f);
        found += r.count;
        trials += 25;
    }
    double seen = snr * sqrt(0.5);
    double pd = above((r.filter.threshold - seen) / sqrt(1.0 + r.filter.shot * seen));
    /* four standard deviations; with the share itself in the place of its root 0.03 were found */
    bst_assert_close((double)found / trials, pd, 4.0 * sqrt(pd * (1.0 - pd) / trials));
    close_scene(&s);
}

/* SNR that the filter for a Gaussian of `filter` px gives of one of `source` px, per electron. */
static double snr_by_sums(double source, double filter, double noise_e) {
    enum { PHASES = 8, REACH = 9 };
    double both = 0.0, own = 0.0;
    for (int k = 0; k < PHASES; k++) {
        double at = (k + 0.5) / PHASES - 0.5;
        for (int x = -REACH; x <= REACH; x++) {
            double q = pixel_share(x - at, filter);
            both += pixel_share(x - at, source) * q / PHASES;
            own += q * q / PHASES;
        }
    }
    return both * both / sqrt(own * own) / noise_e;
}

/* Jitter that the onboard side does not know of costs what the filter for the narrower PSF gives of
 * the wider image; what it knows costs nothing beside the image's own width. */
static void unknown_jitter_costs_what_the_filter_misses(void **state) {
    (void)state;
    const double psf = 2.0 / 2.3548200450309493, jitter = 1.0;
    for (int known = 0; known < 2; known++) {
        scene s;
        open_scene(&s);
        s.calibration.crowding = s.calibration.background_fraction = 0.0;
        s.settings.jitter_px = known ? jitter : 0.0;
        s.frame.sigma_px = hypot(psf, jitter);
        start(&s);
        int found = 0, trials = 0;
        bst_generator_result r = {0};
        double electrons = electrons_of(&s, 5.4);
        for (int f = 0; f < 6; f++) {
            fill(&s, 5.4);
            r = run(&s, f);
            found += r.count;
            trials += s.truth->count;
        }
        double filter = known ? s.frame.sigma_px : psf;
        double seen = electrons * snr_by_sums(s.frame.sigma_px, filter, r.noise_e);
        double pd = above((r.filter.threshold - seen) / sqrt(1.0 + r.filter.shot * seen));
        /* four standard deviations, and 0.01 for 1/12 px^2 in the place of the pixel; the loss is
         * 0.16 */
        bst_assert_close((double)found / trials, pd, 4.0 * sqrt(pd * (1.0 - pd) / trials) + 0.01);
        bst_assert_close(r.filter.efficiency, known ? 1.0 : 0.923, 0.003);
        close_scene(&s);
    }
}

/* Maxima above a threshold in filtered noise of unit variance per pixel, a part of which whole
 * columns have in common. */
static double maxima_in_noise(double columns, double threshold, double sigma) {
    enum { N = 256, FIELDS = 10, REACH = 4 };
    static double field[N][N], smooth[N][N];
    double kernel[2 * REACH + 1], square = 0.0, count = 0.0;
    for (int k = -REACH; k <= REACH; k++) {
        kernel[k + REACH] = pixel_share(k, sigma);
        square += kernel[k + REACH] * kernel[k + REACH];
    }
    bst_rng_key key = bst_rng_make_key(5, 0, "test", "columns");
    for (int n = 0; n < FIELDS; n++) {
        for (int x = 0; x < N; x++) {
            double column = sqrt(columns) * bst_rng_normal(key, (uint64_t)n, (uint64_t)x << 32);
            for (int y = 0; y < N; y++) {
                field[y][x] =
                    column + sqrt(1.0 - columns) *
                                 bst_rng_normal(key, (uint64_t)n, 1 + (uint64_t)(y * N + x));
            }
        }
        for (int pass = 0; pass < 2; pass++) {
            for (int y = 0; y < N; y++) {
                for (int x = 0; x < N; x++) {
                    double sum = 0.0;
                    for (int k = -REACH; k <= REACH; k++) {
                        int u = pass ? x : (x + k + N) % N, v = pass ? (y + k + N) % N : y;
                        sum += kernel[k + REACH] * (pass ? smooth[v][u] : field[v][u]);
                    }
                    (pass ? field : smooth)[y][x] = sum / sqrt(square);
                }
            }
        }
        for (int y = 1; y + 1 < N; y++) {
            for (int x = 1; x + 1 < N; x++) {
                bool top = field[y][x] > threshold;
                for (int k = 0; k < 9 && top; k++) {
                    top = k == 4 || field[y][x] > field[y + k / 3 - 1][x + k % 3 - 1];
                }
                count += top;
            }
        }
    }
    return count;
}

static void offsets_of_columns_make_alarms(void **state) {
    (void)state;
    double counts[2], thresholds[2], share = 0.0;
    for (int with = 0; with < 2; with++) {
        scene s;
        open_scene(&s);
        s.settings.false_alarms_per_frame = 250.0;
        s.settings.column_correction = BST_COLUMN_LEVEL_OFF;
        s.camera.detector.column_offset_rms_e = with ? 4.0 : 0.0;
        start(&s);
        counts[with] = 0.0;
        for (int f = 0; f < 8; f++) {
            bst_generator_result r = run(&s, f);
            counts[with] += r.count;
            thresholds[with] = r.threshold_snr;
            share = 16.0 / (r.noise_e * r.noise_e);
        }
        close_scene(&s);
    }
    bst_assert_close(thresholds[0], thresholds[1], 0.0); /* image processing knows nothing of it */
    double sigma = 2.0 / 2.3548200450309493;
    double even = maxima_in_noise(0.0, thresholds[0], sigma);
    double uneven = maxima_in_noise(share, thresholds[0], sigma);
    double expected = uneven / even, sigma_of = expected * sqrt(1.0 / even + 1.0 / uneven);
    assert_true(even > 50.0 && expected > 1.3);
    /* three standard deviations of the counts in noise, and a tenth for maxima of pixels */
    bst_assert_close(counts[1] / counts[0], expected, 3.0 * sigma_of + 0.1 * expected);
}

/* Where image processing takes the columns' levels off, their offsets are no part of the noise and
 * make no alarms: the mean over 1024 rows is known to 0.1 % of a pixel's variance. */
static void levelled_columns_are_even(void **state) {
    (void)state;
    double counts[2], noises[2];
    for (int with = 0; with < 2; with++) {
        scene s;
        open_scene(&s);
        s.settings.false_alarms_per_frame = 250.0;
        s.settings.column_correction = BST_COLUMN_LEVEL_AUTO;
        /* half of the read noise: auto takes it off */
        s.camera.detector.column_offset_rms_e = with ? 4.0 : 0.0;
        start(&s);
        counts[with] = 0.0;
        for (int f = 0; f < 8; f++) {
            bst_generator_result r = run(&s, f);
            counts[with] += r.count;
            noises[with] = r.noise_e;
        }
        close_scene(&s);
    }
    bst_assert_close(noises[1], noises[0], 1e-9);
    /* 2000 alarms each, 4 sigma; offsets that are left in make 1.5 times as many */
    bst_assert_close(counts[1] / counts[0], 1.0, 4.0 * sqrt(2.0 / counts[0]));
}

/* In a frame whose stars are longer than is filtered for, an object at rest is where the top of the
 * filter's output is, between the pixels; one beside it draws that. */
static void smeared_frames_place_objects_between_pixels(void **state) {
    (void)state;
    const double distances[] = {40.0, 4.0};
    for (int k = 0; k < 2; k++) {
        scene s;
        open_scene(&s);
        start(&s);
        enum { FRAMES = 100 };
        double square = 0.0, mean = 0.0, light = electrons_of(&s, 100.0);
        for (int f = 0; f < FRAMES; f++) {
            s.truth->count = 0;
            double at = 500.0 + 0.01 * f;
            for (uint32_t i = 0; i < 2; i++) {
                bst_truth_item *item =
                    add_source(&s, i + 1, at + i * distances[k], 512.4, i ? 0.75 * light : light);
                item->kind = BST_SOURCE_OBJECT;
            }
            s.frame.streak_dx_px = 200.0;
            bst_generator_result r = run(&s, f);
            assert_true(r.smeared);
            int near = 0;
            for (int i = 0; i < r.count; i++) {
                if (r.items[i].item == 0) {
                    mean += (r.items[i].detection.x_px - at) / FRAMES;
                    square += pow(r.items[i].detection.y_px - 512.4, 2.0) / FRAMES;
                }
                near += r.items[i].item >= 0;
            }
            assert_int_equal(near, 2);
        }
        /* a place at SNR 100 is good to sqrt(2) S / 100; a whole pixel to 0.29 */
        double s2 = s.frame.sigma_px * s.frame.sigma_px + 1.0 / 12.0;
        assert_true(sqrt(square) < 1.5 * sqrt(2.0 * s2) / 100.0);
        /* top of two Gaussians of 2 S^2: to first order the other one's slope over the curvature */
        double d = distances[k], pull = 0.75 * d * exp(-d * d / (4.0 * s2));
        bst_assert_close(mean, pull, 0.01 + 0.2 * pull);
        close_scene(&s);
    }
}

/* A fit as a point does not draw the bend of the camera's path: the place is less certain by it,
 * also where the source is so long that it is reported as a streak. */
static void what_is_fitted_as_a_point_has_the_bend(void **state) {
    (void)state;
    scene s;
    open_scene(&s);
    start(&s);
    double variance[2][2];
    for (int bent = 0; bent < 2; bent++) {
        s.truth->count = 0;
        for (uint32_t i = 0; i < 2; i++) {
            bst_truth_item *item =
                add_source(&s, i + 1, 300.0 + 300.0 * i, 400.0, electrons_of(&s, 200.0));
            item->kind = i ? BST_SOURCE_OBJECT : BST_SOURCE_STAR;
            item->x_start_px -= i ? 0.0 : 10.0;
            item->x_end_px += i ? 0.0 : 10.0;
            item->y_start_px -= i ? 2.5 : 0.0; /* of its own, across the stars' */
            item->y_end_px += i ? 2.5 : 0.0;
        }
        s.frame.streak_dx_px = 20.0;
        s.frame.bend_y_px = bent ? 1.0 : 0.0;
        bst_generator_result r = run(&s, 3);
        assert_int_equal(r.count, 2);
        for (int i = 0; i < 2; i++) {
            assert_true(r.items[i].detection.flags & BST_DETECTION_STREAK);
            variance[bent][r.items[i].item] = r.items[i].detection.cov_yy;
        }
    }
    /* half a bend of 1 px, and the twentieth that is left of one that is drawn */
    bst_assert_close(variance[1][0] - variance[0][0], 0.0, 0.01);
    assert_true(variance[1][1] - variance[0][1] > 0.1);
    close_scene(&s);
}

/* What is seen, from the middle of the window. */
typedef struct seen_case {
    double x, y, dx, dy; /* middle and path, sensor px from the window's middle */
    double tremble;      /* of the path's ends, along (1, 2), px */
    int binning;
    bool star; /* the stars' path is its own, else they are at rest */
} seen_case;

/* A case with everything turned or mirrored by t, and the window with it. */
static bst_detection see_turned(const scene *of, const seen_case *c, const double t[2][2],
                                double electrons, int *count) {
    scene s = *of;
    s.truth->count = 0;
    bool upright = t[0][0] != 0.0;
    int width = upright ? 400 : 240, height = upright ? 240 : 400;
    s.frame.window = (bst_window){96, 160, width, height};
    s.frame.binning = c->binning;
    double x0 = 96 + 0.5 * (width - 1), y0 = 160 + 0.5 * (height - 1);
    double x = x0 + t[0][0] * c->x + t[0][1] * c->y, y = y0 + t[1][0] * c->x + t[1][1] * c->y;
    double dx = t[0][0] * c->dx + t[0][1] * c->dy, dy = t[1][0] * c->dx + t[1][1] * c->dy;
    double ex = c->tremble * (t[0][0] + 2.0 * t[0][1]);
    double ey = c->tremble * (t[1][0] + 2.0 * t[1][1]);
    bst_truth_item *item = add_source(&s, 7, x, y, electrons);
    item->kind = c->star ? BST_SOURCE_STAR : BST_SOURCE_OBJECT;
    item->x_start_px = x - 0.5 * (dx + ex);
    item->y_start_px = y - 0.5 * (dy + ey);
    item->x_end_px = x + 0.5 * (dx + ex);
    item->y_end_px = y + 0.5 * (dy + ey);
    double path_x[5], path_y[5];
    if (c->star) {
        s.frame.streak_dx_px = dx;
        s.frame.streak_dy_px = dy;
    }
    for (int k = 0; k < 5; k++) {
        static const double swing[5] = {-0.6, 0.4, -0.1, -0.1, 0.4}; /* of mean 0 */
        double end = swing[k];
        path_x[k] = (k / 4.0 - 0.5) * s.frame.streak_dx_px + end * ex;
        path_y[k] = (k / 4.0 - 0.5) * s.frame.streak_dy_px + end * ey;
    }
    s.frame.path_x_px = path_x;
    s.frame.path_y_px = path_y;
    s.frame.path_count = c->tremble != 0.0 ? 5 : 0;
    bst_generator_result r = run(&s, 3);
    bst_detection d = {0};
    *count = r.count;
    if (r.count > 0) {
        d = r.items[0].detection;
        d.x_px -= x0;
        d.y_px -= y0;
    }
    return d;
}

/* Draws go by names, so that a scene that is turned by right angles or mirrored shows the same,
 * turned or mirrored: no axis and no side of the window differs from the others. */
static void no_side_differs_from_the_others(void **state) {
    (void)state;
    const seen_case cases[] = {
        {0, 113, 14, 2, 0, 1, true}, /* beside an edge, along it */
        {10.3, 20.6, 0, 0, 0, 1, true}, {-40, 31, 9, 4, 0, 1, true},
        {150, 118.5, 9, 4, 0, 1, true}, {199.7, 60, 0, 0, 0, 1, true}, /* on the right edge */
        {196, 50, 14, 6, 0, 1, true},                                  /* cut by it */
        {203, 50, 14, 6, 0, 1, true},                                  /* its middle is outside */
        {60, -123, 5, 14, 0, 1, true},  {-40, 31, 9, 4, 0.9, 1, true},
        {-40, 31, 9, 4, 0, 1, false},   {-40, 31, 2.5, -1.5, 0, 1, false},
        {10.3, 20.6, 0, 0, 0, 2, true}, {30, -119, 0, 0, 0, 2, true},
        {-40, 31, 18, -8, 0, 2, true},  {-40, 31, 18, -8, 0.9, 2, true},
        {60, -123, 6, 28, 0, 2, true},
    };
    const double turns[8][2][2] = {{{1, 0}, {0, 1}},  {{0, -1}, {1, 0}}, {{-1, 0}, {0, -1}},
                                   {{0, 1}, {-1, 0}}, {{-1, 0}, {0, 1}}, {{1, 0}, {0, -1}},
                                   {{0, 1}, {1, 0}},  {{0, -1}, {-1, 0}}};
    scene s;
    open_scene(&s);
    s.calibration.phase_bias_px = 0.0;
    start(&s);
    const double electrons = electrons_of(&s, 120.0);
    for (size_t n = 0; n < sizeof cases / sizeof *cases; n++) {
        int found, now;
        const bst_detection a = see_turned(&s, &cases[n], turns[0], electrons, &found);
        assert_int_equal(found, 1);
        for (int k = 1; k < 8; k++) {
            const double(*t)[2] = turns[k];
            const bst_detection b = see_turned(&s, &cases[n], t, electrons, &now);
            assert_int_equal(now, 1);
            /* rounding; the table of the bound is in single precision */
            bst_assert_close(b.snr / a.snr, 1.0, 1e-6);
            bst_assert_close(b.flux_e / a.flux_e, 1.0, 1e-6);
            bst_assert_close(b.flux_sigma_e / a.flux_sigma_e, 1.0, 1e-6);
            bst_assert_close(b.v_mag, a.v_mag, 1e-6);
            bst_assert_close(b.length_px, a.length_px, 1e-6);
            bst_assert_close(b.width_px, a.width_px, 1e-6);
            assert_int_equal(b.flags, a.flags);
            assert_int_equal(b.label, a.label);
            double size = a.cov_xx + a.cov_yy;
            double xx = t[0][0] * t[0][0] * a.cov_xx + t[0][1] * t[0][1] * a.cov_yy;
            double yy = t[1][0] * t[1][0] * a.cov_xx + t[1][1] * t[1][1] * a.cov_yy;
            double xy = (t[0][0] * t[1][1] + t[0][1] * t[1][0]) * a.cov_xy;
            bst_assert_close(b.cov_xx, xx, 1e-6 * size);
            bst_assert_close(b.cov_yy, yy, 1e-6 * size);
            bst_assert_close(b.cov_xy, xy, 1e-6 * size);
            double c = t[0][0] * cos(a.angle_rad) + t[0][1] * sin(a.angle_rad);
            double e = t[1][0] * cos(a.angle_rad) + t[1][1] * sin(a.angle_rad);
            if (cases[n].dx != 0.0) { /* a direction, either way */
                bst_assert_close(sin(b.angle_rad) * c - cos(b.angle_rad) * e, 0.0, 1e-9);
            }
            if (k < 4 && cases[n].dx != 0.0) { /* errors are drawn along and across the path */
                bst_assert_close(b.x_px, t[0][0] * a.x_px + t[0][1] * a.y_px, 1e-5);
                bst_assert_close(b.y_px, t[1][0] * a.x_px + t[1][1] * a.y_px, 1e-5);
            }
        }
    }
    close_scene(&s);
}

/* False alarms lie evenly on a window that is no square, of binned pixels; each says of itself what
 * the bound says of its shape: along and across the stars' path where it was found by their filter.
 */
static void false_alarms_fill_the_window(void **state) {
    (void)state;
    const double path[2] = {18.0, -8.0}, length = hypot(path[0], path[1]);
    const double c = path[0] / length, e = path[1] / length;
    const int b = 2;
    scene s;
    open_scene(&s);
    s.settings.false_alarms_per_frame = 400.0;
    s.frame.window = (bst_window){96, 160, 400, 240};
    s.frame.binning = b;
    s.frame.streak_dx_px = path[0];
    s.frame.streak_dy_px = path[1];
    start(&s);
    static bst_crlb_table bound;
    double sigma = s.frame.sigma_px / b;
    bst_crlb_table_init(&bound, sigma);
    double n = 0.0, drawn = 0.0, sum[5] = {0.0};
    for (int f = 0; f < 10; f++) {
        bst_generator_result r = run(&s, f);
        for (int i = 0; i < r.count; i++, n += 1.0) {
            const bst_detection *d = &r.items[i].detection;
            double u = (d->x_px - 95.5) / 400.0, v = (d->y_px - 159.5) / 240.0;
            assert_true(u >= 0.0 && u <= 1.0 && v >= 0.0 && v <= 1.0);
            const double terms[5] = {u - 0.5, v - 0.5, (u - 0.5) * (u - 0.5), (v - 0.5) * (v - 0.5),
                                     (u - 0.5) * (v - 0.5)};
            for (int k = 0; k < 5; k++) {
                sum[k] += terms[k];
            }
            bool streak = (d->flags & BST_DETECTION_STREAK) != 0;
            double own = streak ? length / b : 0.0;
            drawn += streak;
            bst_crlb_table_at at = bst_crlb_table_of(&bound, d->flux_e, r.noise_e, own);
            double along = b * b * at.var_along_px2, across = b * b * at.var_across_px2;
            double xx = streak ? c * c * along + e * e * across : along;
            double yy = streak ? e * e * along + c * c * across : across;
            double xy = streak ? c * e * (along - across) : 0.0;
            /* rounding */
            bst_assert_close(d->cov_xx, xx, 1e-9 * along);
            bst_assert_close(d->cov_yy, yy, 1e-9 * along);
            bst_assert_close(d->cov_xy, xy, 1e-9 * along);
            bst_assert_close(d->flux_e * at.norm / r.noise_e, d->snr, 1e-9 * d->snr);
            double fwhm = 2.3548200450309493 * b;
            bst_assert_close(d->width_px, fwhm * sigma, 1e-9);
            bst_assert_close(d->length_px, fwhm * sqrt(sigma * sigma + own * own / 12.0), 1e-9);
            bst_assert_close(d->angle_rad, streak ? atan2(path[1], path[0]) : 0.0, 1e-9);
            /* within two sigmas and half its own extent of a side */
            double near_x = b * (2.0 * sigma + (streak ? 0.5 * own * fabs(c) : 0.0));
            double near_y = b * (2.0 * sigma + (streak ? 0.5 * own * fabs(e) : 0.0));
            double to_x = 400.0 * fmin(u, 1.0 - u), to_y = 240.0 * fmin(v, 1.0 - v);
            bool edge = to_x < near_x || to_y < near_y;
            assert_true(((d->flags & BST_DETECTION_EDGE) != 0) == edge);
        }
    }
    assert_true(n > 1000.0 && drawn > 100.0 && drawn < n - 100.0);
    /* of a uniform number: variance 1/12, that of its square's 1/180; four standard deviations */
    bst_assert_close(sum[0] / n, 0.0, 4.0 * sqrt(1.0 / 12.0 / n));
    bst_assert_close(sum[1] / n, 0.0, 4.0 * sqrt(1.0 / 12.0 / n));
    bst_assert_close(sum[2] / n, 1.0 / 12.0, 4.0 * sqrt(1.0 / 180.0 / n));
    bst_assert_close(sum[3] / n, 1.0 / 12.0, 4.0 * sqrt(1.0 / 180.0 / n));
    bst_assert_close(sum[4] / n, 0.0, 4.0 / 12.0 / sqrt(n));
    close_scene(&s);
}

/* The truth's SNR of a source depends on the sharpness of its image. One from what the PSF alone on
 * the mean background gives, sqrt(b^2 (background + dark) + read noise^2) a pixel, changes nothing;
 * half of it widens the errors by two. */
static void a_plain_image_is_as_sharp_as_it_says(void **state) {
    (void)state;
    for (int b = 1; b <= 2; b++) {
        scene s;
        open_scene(&s);
        s.calibration.phase_bias_px = 0.0;
        s.truth->dark_e = 14.0;
        s.frame.binning = b;
        start(&s);
        static bst_crlb_table bound;
        bst_crlb_table_init(&bound, s.frame.sigma_px / b);
        double electrons = electrons_of(&s, 120.0), off[3];
        double noise = sqrt(b * b * (36.0 + 14.0) + 8.0 * 8.0);
        for (int k = 0; k < 3; k++) {
            s.truth->count = 0;
            bst_truth_item *item = add_source(&s, 3, 300.3, 201.6, electrons);
            double plain = electrons * bst_crlb_table_norm(&bound, 0.0) / noise;
            item->snr = k == 0 ? 0.0 : k == 1 ? plain : 0.5 * plain;
            bst_generator_result r = run(&s, 4);
            assert_int_equal(r.count, 1);
            off[k] = r.items[0].detection.x_px - 300.3;
        }
        bst_assert_close(off[1] / off[0], 1.0, 1e-6); /* the bound's table is in floats */
        bst_assert_close(off[2] / off[0], 2.0, 1e-6);
        close_scene(&s);
    }
}

/* Light of a Gaussian whose middle is beyond one side of the frame, or two: share and centroid of
 * its part on the frame, by sums. */
static void light_cut_by_the_edges(void **state) {
    (void)state;
    bst_generator *g = test_calloc(1, sizeof *g);
    g->width = 90;
    g->height = 70;
    g->total_sigma = 0.95;
    const double places[][2] = {{-1.4, 30.0}, {90.3, 30.0},  {40.0, -0.9}, {40.0, 71.2},
                                {-0.7, 70.1}, {91.0, -1.25}, {40.0, 30.0}};
    const double step = 0.01;
    for (size_t k = 0; k < sizeof places / sizeof *places; k++) {
        generator_source cut = {.x = places[k][0], .y = places[k][1], .flux_e = 7.0};
        bst_generator_cut_light(g, &cut);
        double share = 1.0, want[2];
        for (int axis = 0; axis < 2; axis++) {
            double at = places[k][axis], last = (axis ? g->height : g->width) - 0.5;
            double sum = 0.0, first = 0.0;
            for (double u = -0.5 + 0.5 * step; u < last; u += step) {
                double w = exp(-0.5 * pow((u - at) / g->total_sigma, 2.0)) * step;
                sum += w;
                first += w * u;
            }
            bool beyond = at < -0.5 || at > last;
            share *= beyond ? sum / (g->total_sigma * sqrt(2.0 * BST_PI)) : 1.0;
            want[axis] = beyond ? first / sum : at;
        }
        bst_assert_close(cut.flux_e / (7.0 * share), 1.0, 2e-4); /* steps */
        bst_assert_close(cut.x, want[0], 2e-4);
        bst_assert_close(cut.y, want[1], 2e-4);
    }
    test_free(g);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_plain_image_is_as_sharp_as_it_says),
        cmocka_unit_test(false_alarms_fill_the_window),
        cmocka_unit_test(no_side_differs_from_the_others),
        cmocka_unit_test(places_are_those_of_the_sensor),
        cmocka_unit_test(half_of_the_light_gives_its_root),
        cmocka_unit_test(unknown_jitter_costs_what_the_filter_misses),
        cmocka_unit_test(offsets_of_columns_make_alarms),
        cmocka_unit_test(levelled_columns_are_even),
        cmocka_unit_test(smeared_frames_place_objects_between_pixels),
        cmocka_unit_test(what_is_fitted_as_a_point_has_the_bend),
        cmocka_unit_test(light_cut_by_the_edges),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
