/* What the generator makes of streaks, against the laws that it states. */
#include "obsgen/generator_internal.h"
#include "tests/obsgen/generator_scene.h"

/* SNR of the filter for a point over that of the streak's own, by sums over fine pixels. */
static double point_share(double sigma, double length) {
    enum { SUB = 4, REACH = 8 * SUB, PARTS = 40 };
    double both = 0.0, own = 0.0, point = 0.0, s2 = sigma * sigma + 1.0 / 12.0;
    for (int i = -REACH; i <= REACH; i++) { /* across the streak both are the same */
        double x = (double)i / SUB, p = exp(-0.5 * x * x / s2), q = 0.0;
        for (int k = 0; k < PARTS; k++) {
            double d = x - length * ((k + 0.5) / PARTS - 0.5);
            q += exp(-0.5 * d * d / s2) / PARTS;
        }
        both += p * q;
        own += q * q;
        point += p * p;
    }
    return both / sqrt(own * point);
}

/* Noise decides whether a point fits a short streak better: the difference of the squares is that
 * of two filters' outputs, normal with 2 (1 - rho) for outputs of correlation rho. */
static void short_streaks_may_be_points(void **state) {
    (void)state;
    const double length = 2.0, snrs[] = {12.0, 20.0, 40.0};
    scene s;
    open_scene(&s);
    s.frame.streak_dx_px = length;
    start(&s);
    double rho = point_share(s.frame.sigma_px, length);
    for (int k = 0; k < 3; k++) {
        fill(&s, snrs[k]);
        for (int i = 0; i < s.truth->count; i++) {
            s.truth->items[i].x_start_px -= 0.5 * length;
            s.truth->items[i].x_end_px += 0.5 * length;
        }
        double points = 0.0, all = 0.0, snr = 0.0;
        for (int n = 0; n < 3; n++) {
            bst_generator_result r = run(&s, 10 * k + n);
            for (int i = 0; i < r.count; i++) {
                points += !(r.items[i].detection.flags & BST_DETECTION_STREAK);
                snr += r.items[i].detection.snr;
                all += 1.0;
            }
        }
        assert_true(all > 2600.0);
        double asked = 0.5 * erfc(snr / all * sqrt(0.5 * (1.0 - rho)) / sqrt(2.0));
        /* 2700 draws: 0.009; the mean SNR for each one's */
        bst_assert_close(points / all, asked, 0.03);
        assert_true(k > 0 || asked > 0.1);
    }
    close_scene(&s);
}

/* A streak is detected if either filter of the frame exceeds its threshold: normal outputs with the
 * point filter's share of the signal as their correlation. */
static void streaks_are_detected_in_either_filter(void **state) {
    (void)state;
    enum { FRAMES = 24, DRAWS = 400000 };
    const double length = 3.0;
    scene s;
    open_scene(&s);
    s.settings.false_alarms_per_frame = 1.0;
    s.calibration.background_fraction = s.calibration.crowding = 0.0;
    s.frame.streak_dx_px = length;
    start(&s);
    double shared = point_share(s.frame.sigma_px, length), found = 0.0, all = 0.0, noise = 0.0;
    fill(&s, 5.2);
    double electrons = s.truth->items[0].electrons;
    for (int i = 0; i < s.truth->count; i++) {
        s.truth->items[i].x_start_px -= 0.5 * length;
        s.truth->items[i].x_end_px += 0.5 * length;
    }
    bst_generator_filter streak, point;
    for (int n = 0; n < FRAMES; n++) {
        bst_generator_result r = run(&s, n);
        streak = r.filter;
        point = r.point;
        noise = r.noise_e;
        bst_assert_close(r.shared_noise, shared, 1e-3);
        for (int i = 0; i < r.count; i++) {
            found += r.items[i].item >= 0;
        }
        all += s.truth->count;
    }
    bst_crlb_table bound;
    bst_crlb_table_init(&bound, s.frame.sigma_px);
    double snr = electrons * bst_crlb_table_norm(&bound, length) / noise, either = 0.0, one = 0.0;
    double own = sqrt(streak.variance + streak.shot * snr);
    double other = sqrt(point.variance + point.shot * shared * snr);
    bst_rng_key key = bst_rng_make_key(3, 0, "test", "filters");
    for (uint64_t i = 0; i < DRAWS; i++) {
        double z[2];
        bst_rng_normal2(key, 0, i, z);
        bool in_own = snr + own * z[0] > streak.threshold;
        double mixed = shared * z[0] + sqrt(1.0 - shared * shared) * z[1];
        one += in_own ? 1.0 / DRAWS : 0.0;
        either += in_own || shared * snr + other * mixed > point.threshold ? 1.0 / DRAWS : 0.0;
    }
    bst_assert_close(bst_matched_either_above((snr - streak.threshold) / own,
                                              (shared * snr - point.threshold) / other, shared),
                     either, 0.003);
    /* 21600 trials: 0.0034; one filter alone misses 0.015 */
    assert_true(either > one + 0.012);
    bst_assert_close(found / all, either, 0.008);
    close_scene(&s);
}

/* Ends along the axis across an edge: from the left, right, top and bottom. */
static void set_ends(bst_truth_item *item, int way, double middle, double half) {
    const bool upright = way / 2, back = way % 2;
    const double last = upright ? 699.0 : SIDE - 1.0;
    const double at[3] = {middle - half, middle, middle + half};
    double *const x[3] = {&item->x_start_px, &item->x_centroid_px, &item->x_end_px};
    double *const y[3] = {&item->y_start_px, &item->y_centroid_px, &item->y_end_px};
    for (int i = 0; i < 3; i++) {
        *(upright ? x : y)[i] = 500.0;
        *(upright ? y : x)[i] = back ? last - at[i] : at[i];
    }
}

/* A streak cut by the frame's edge is fitted with its known path, so that place and flux are those
 * of the whole, from half the light; what lies mostly beyond it is a point on it. */
static void the_edge_cuts(void **state) {
    (void)state;
    for (int way = 0; way < 4; way++) {
        scene s;
        open_scene(&s);
        start(&s);
        s.frame.window.height = 700;
        double light = electrons_of(&s, 400.0), last = way / 2 ? 699.0 : SIDE - 1.0;
        bst_truth_item *item = add_source(&s, 1, 0.0, 500.0, light);
        *(way / 2 ? &s.frame.streak_dy_px : &s.frame.streak_dx_px) = way % 2 ? -40.0 : 40.0;
        set_ends(item, way, 500.0, 20.0); /* in the middle of the frame first */
        bst_generator_result r = run(&s, 0);
        assert_int_equal(r.count, 1);
        double whole = r.items[0].detection.snr;
        set_ends(item, way, 0.0, 20.0);
        r = run(&s, 0);
        assert_int_equal(r.count, 1);
        const bst_detection *d = &r.items[0].detection;
        const double *seen = way / 2 ? &d->y_px : &d->x_px;
        assert_true(d->flags & BST_DETECTION_EDGE);
        assert_true(d->flags & BST_DETECTION_STREAK);
        /* six times the bound of half the light at SNR 400 and 40 px */
        bst_assert_close(*seen, way % 2 ? last : 0.0, 0.2);
        bst_assert_close(d->flux_e, light, 0.05 * light);
        set_ends(item, way, -16.0, 20.0);
        r = run(&s, 0);
        assert_int_equal(r.count, 1);
        d = &r.items[0].detection;
        assert_false(d->flags & BST_DETECTION_STREAK);
        /* 4.5 of 40 px are on the frame, to a sixth of a PSF; the SNR goes by its root */
        bst_assert_close(*seen, way % 2 ? last - 1.75 : 1.75, 1.0);
        bst_assert_close(way / 2 ? d->x_px : d->y_px, 500.0, 0.5);
        bst_assert_close(d->flux_e / light, 4.5 / 40.0, 0.015);
        bst_assert_close(d->snr / whole, sqrt(4.5 / 40.0), 0.03);
        bst_assert_close(d->v_mag, bst_camera_v_mag(&s.camera, d->flux_e / s.frame.exposure_s),
                         1e-9);
        set_ends(item, way, -40.0, 20.0);
        assert_int_equal(run(&s, 0).count, 0);
        s.frame.streak_dx_px = 100.0;
        assert_true(run(&s, 0).smeared);
        close_scene(&s);
    }
}

/* A streak longer than is filtered for is seen in parts: on its path, above the threshold, more of
 * them where the light is near the threshold than where it is far above. */
static void long_streaks_are_seen_in_parts(void **state) {
    (void)state;
    scene s;
    open_scene(&s);
    start(&s);
    int parts[2] = {0, 0};
    for (int bright = 0; bright < 2; bright++) {
        for (int f = 0; f < 20; f++) {
            s.truth->count = 0;
            bst_truth_item *item =
                add_source(&s, 1, 500.0, 500.0, electrons_of(&s, bright ? 8000.0 : 500.0));
            item->x_start_px = 420.0;
            item->x_end_px = 580.0;
            item->y_start_px = 440.0;
            item->y_end_px = 560.0;
            s.frame.streak_dx_px = 160.0;
            s.frame.streak_dy_px = 120.0;
            bst_generator_result r = run(&s, f);
            assert_true(r.smeared);
            for (int i = 0; i < r.count; i++) {
                const bst_detection *d = &r.items[i].detection;
                double along = 0.8 * (d->x_px - 500.0) + 0.6 * (d->y_px - 500.0);
                double across = 0.8 * (d->y_px - 500.0) - 0.6 * (d->x_px - 500.0);
                /* half of 200 px and the PSF; six standard deviations of a place at SNR 5 */
                assert_true(fabs(along) < 105.0 && fabs(across) < 1.5);
                assert_true(d->snr > r.threshold_snr);
            }
            parts[bright] += r.count;
        }
    }
    assert_true(parts[1] >= 20 && parts[0] > parts[1]);
    close_scene(&s);
}

/* While the stars are long streaks a source at rest stands at the top of the filter's output: noise
 * of unit variance has a gradient of 1 / (sqrt(2) sigma), the top a curvature of SNR / (2 sigma^2).
 */
static void tops_at_rest_scatter_evenly(void **state) {
    (void)state;
    scene s;
    open_scene(&s);
    s.frame.streak_dx_px = 160.0;
    s.frame.streak_dy_px = 120.0;
    start(&s);
    fill(&s, 40.0);
    bst_generator_result r = run(&s, 1);
    assert_true(r.smeared && r.count >= 890);
    double sum[2] = {0.0}, square[3] = {0.0}, snr = 0.0, n = r.count;
    for (int i = 0; i < r.count; i++) {
        const bst_detection *d = &r.items[i].detection;
        const bst_truth_item *item = &s.truth->items[r.items[i].item];
        double x = d->x_px - item->x_mid_px, y = d->y_px - item->y_mid_px;
        sum[0] += x / n;
        sum[1] += y / n;
        square[0] += x * x / n;
        square[1] += x * y / n;
        square[2] += y * y / n;
        snr += d->snr / n;
        /* what it says of itself: a pixel, no better; flux by its SNR */
        assert_true(d->cov_xx == 1.0 && d->cov_yy == 1.0);
        double sigma = d->flux_e / d->snr;
        bst_assert_close(d->flux_sigma_e, sqrt(sigma * sigma + d->flux_e), 1e-9 * d->flux_e);
    }
    /* seen on the brightest pixel, which is off the top by up to half a pixel */
    assert_true(snr > 34.0 && snr < 41.0);
    double width = sqrt(s.frame.sigma_px * s.frame.sigma_px + 1.0 / 12.0);
    double sigma = sqrt(2.0) * width / 40.0;
    /* four standard errors of a variance, a mean and a covariance; widths of a Gaussian's: 3 % */
    double error = 4.0 * sqrt(2.0 / n) + 0.06;
    bst_assert_close(square[0] / (sigma * sigma), 1.0, error);
    bst_assert_close(square[2] / (sigma * sigma), 1.0, error);
    bst_assert_close(square[1] / (sigma * sigma), 0.0, 4.0 / sqrt(n));
    bst_assert_close(sum[0] / sigma, 0.0, 4.0 / sqrt(n));
    bst_assert_close(sum[1] / sigma, 0.0, 4.0 / sqrt(n));
    close_scene(&s);
}

/* RMS errors along and across of stars, `snr` as points and about half as streaks, that moved by 8
 * px along x on a path with a bend across it, which telemetry knows, and that trembled. */
static void errors_of(scene *s, double snr, double bend, double tremble, double rms[2]) {
    enum { STEPS = 400 };
    double x[STEPS + 1], y[STEPS + 1], sum[2] = {0.0, 0.0}, mean[2], count = 0.0;
    for (int k = 0; k <= STEPS; k++) {
        double u = 2.0 * k / STEPS - 1.0, phase = 2.0 * BST_PI * k / STEPS;
        x[k] = 4.0 * u + sqrt(2.0) * tremble * sin(37.0 * phase);
        y[k] = 0.5 * bend * (3.0 * u * u - 1.0) + sqrt(2.0) * tremble * cos(53.0 * phase);
    }
    s->frame.streak_dx_px = 8.0;
    s->frame.bend_y_px = bend;
    s->frame.path_x_px = x;
    s->frame.path_y_px = y;
    s->frame.path_count = STEPS + 1;
    fill(s, snr);
    for (int i = 0; i < s->truth->count; i++) {
        s->truth->items[i].x_start_px -= 4.0;
        s->truth->items[i].x_end_px += 4.0;
    }
    for (int n = 0; n < 6; n++) {
        bst_generator_result r = run(s, n);
        double more[2] = {0.0, 0.0}, all = 0.0;
        mean[0] = mean[1] = 0.0;
        for (int pass = 0; pass < 2; pass++) { /* what all have in common is no part of it */
            for (int i = 0; i < r.count; i++) {
                const bst_truth_item *t = &s->truth->items[r.items[i].item];
                double dx = r.items[i].detection.x_px - t->x_centroid_px;
                double dy = r.items[i].detection.y_px - t->y_centroid_px;
                if (pass == 0) {
                    mean[0] += dx / r.count;
                    mean[1] += dy / r.count;
                } else {
                    more[0] += (dx - mean[0]) * (dx - mean[0]);
                    more[1] += (dy - mean[1]) * (dy - mean[1]);
                    all += 1.0;
                }
            }
        }
        sum[0] += more[0];
        sum[1] += more[1];
        count += all;
    }
    assert_true(count > 5000.0);
    rms[0] = sqrt(sum[0] / count);
    rms[1] = sqrt(sum[1] / count);
}

/* A faint star streak beside something at rest moves its place by the light of each part of the
 * streak: to the maximum of the filter's output. */
static void what_rests_is_drawn_by_the_streak_beside_it(void **state) {
    (void)state;
    enum { FRAMES = 600 };
    const double length = 6.0, beside = 1.8;
    scene s;
    open_scene(&s);
    s.settings.false_alarms_per_frame = 1e-3;
    s.calibration.background_fraction = s.calibration.crowding = 0.0;
    s.frame.streak_dx_px = length;
    start(&s);
    double sigma2 = s.frame.sigma_px * s.frame.sigma_px + 1.0 / 12.0;
    /* fainter than what images fit as a streak of its own */
    double bright = electrons_of(&s, 8.5), faint = 0.6 * bright;
    double at[2] = {0.0, 0.0}, seen[2] = {0.0, 0.0};
    add_source(&s, 1, 500.0, 500.0, bright)->kind = BST_SOURCE_OBJECT;
    bst_truth_item *t = add_source(&s, 2, 500.0 + 0.5 * length, 500.0 + beside, faint);
    t->x_start_px -= 0.5 * length;
    t->x_end_px += 0.5 * length;
    for (int round = 0; round < 50; round++) { /* mean shift over fine parts */
        double sum = bright * exp(-0.25 * (at[0] * at[0] + at[1] * at[1]) / sigma2);
        double pull[2] = {0.0, 0.0};
        for (int k = 0; k < 80; k++) {
            double x = length * (k + 0.5) / 80.0, dx = x - at[0], dy = beside - at[1];
            double w = faint / 80.0 * exp(-0.25 * (dx * dx + dy * dy) / sigma2);
            sum += w;
            pull[0] += w * x;
            pull[1] += w * beside;
        }
        at[0] = pull[0] / sum;
        at[1] = pull[1] / sum;
    }
    int count = 0;
    for (int n = 0; n < FRAMES; n++) {
        bst_generator_result r = run(&s, n);
        for (int i = 0; i < r.count; i++) {
            if (r.items[i].item == 0) {
                seen[0] += r.items[i].detection.x_px - 500.0;
                seen[1] += r.items[i].detection.y_px - 500.0;
                count++;
            }
        }
    }
    assert_true(count > FRAMES / 2);
    /* mean of 500 errors of 0.15 px; counted light adds a fifth to the weight of the streak */
    assert_true(at[0] > 0.05);
    bst_assert_close(seen[0] / count, 1.2 * at[0], 0.3 * at[0]);
    bst_assert_close(seen[1] / count, 1.2 * at[1], 0.3 * at[1]);
    close_scene(&s);
}

/* A bend that telemetry knows is drawn by what is fitted and makes no place worse; trembling, which
 * it does not know, widens the image on both axes. */
static void places_widen_by_what_is_not_known_of_the_path(void **state) {
    (void)state;
    scene s;
    open_scene(&s);
    start(&s);
    double straight[2], bent[2], trembling[2], rms = 0.4;
    errors_of(&s, 60.0, 0.0, 0.0, straight);
    errors_of(&s, 60.0, 1.5, 0.0, bent);
    errors_of(&s, 60.0, 0.0, rms, trembling);
    double sigma2 = s.frame.sigma_px * s.frame.sigma_px + 1.0 / 12.0;
    double wider = sqrt((sigma2 + rms * rms) / sigma2);
    /* 5400 errors each: 1 % */
    bst_assert_close(bent[0] / straight[0], 1.0, 0.04);
    bst_assert_close(bent[1] / straight[1], 1.0, 0.04);
    /* of a line in noise: along by its ends, the product of both widths; across by the width of its
     * flank and the noise in it, the 3/2 power; counted light makes it less */
    bst_assert_close(trembling[0] / straight[0], wider, 0.06);
    bst_assert_close(trembling[1] / straight[1], pow(wider, 1.5), 0.06);
    /* places of faint streaks, drawn from the output of the filters, widen alike */
    double faint[2], shaken[2];
    errors_of(&s, 21.0, 0.0, 0.0, faint);
    errors_of(&s, 21.0, 0.0, rms, shaken);
    bst_assert_close(shaken[1] / faint[1], pow(wider, 1.5), 0.08);
    assert_true(shaken[0] / faint[0] > 1.05);
    close_scene(&s);
}

/* Places of streaks scatter by the bound along the path and across it, turned to x and y: with
 * c and s the direction, xx = c^2 a + s^2 b, xy = c s (a - b), yy = s^2 a + c^2 b, and what is
 * stated is that. Also of binned pixels, in sensor pixels. */
static void slanting_streaks_scatter_as_stated(void **state) {
    (void)state;
    const double paths[2][2] = {{12.0, 5.0}, {-8.0, 15.0}};
    scene s;
    open_scene(&s);
    s.settings.capacity = 1000;
    for (int i = 0; i < BST_OBSGEN_SNRS; i++) {
        s.calibration.across_factor[i] = s.calibration.along_factor[i] = 1.0;
    }
    s.calibration.phase_bias_px = 0.0;
    start(&s);
    for (int k = 0; k < 4; k++) {
        const double *path = paths[k % 2], length = hypot(path[0], path[1]);
        const int b = 1 + k / 2;
        static bst_crlb_table bound;
        bst_crlb_table_init(&bound, s.frame.sigma_px / b);
        s.frame.binning = b;
        s.frame.streak_dx_px = path[0];
        s.frame.streak_dy_px = path[1];
        fill(&s, 150.0);
        for (int i = 0; i < s.truth->count; i++) {
            s.truth->items[i].x_start_px -= 0.5 * path[0];
            s.truth->items[i].x_end_px += 0.5 * path[0];
            s.truth->items[i].y_start_px -= 0.5 * path[1];
            s.truth->items[i].y_end_px += 0.5 * path[1];
        }
        double got[3] = {0.0}, reported[3] = {0.0}, noise = 0.0, n = 0.0;
        for (int f = 0; f < 6; f++) {
            bst_generator_result r = run(&s, 10 * k + f);
            noise = r.noise_e;
            bst_assert_close(r.streak_px, length, 1e-9);
            for (int i = 0; i < r.count; i++, n += 1.0) {
                const bst_detection *d = &r.items[i].detection;
                const bst_truth_item *t = &s.truth->items[r.items[i].item];
                double x = d->x_px - t->x_centroid_px, y = d->y_px - t->y_centroid_px;
                const double now[3] = {x * x, x * y, y * y};
                const double says[3] = {d->cov_xx, d->cov_xy, d->cov_yy};
                for (int a = 0; a < 3; a++) {
                    got[a] += now[a];
                    reported[a] += says[a];
                }
                /* FWHM of the even path's variance and the PSF's; its direction */
                double wide = 2.3548200450309493 *
                              sqrt(s.frame.sigma_px * s.frame.sigma_px + length * length / 12.0);
                bst_assert_close(d->length_px, wide, 1e-9);
                bst_assert_close(sin(d->angle_rad) * path[0] - cos(d->angle_rad) * path[1], 0.0,
                                 1e-9);
            }
        }
        assert_true(n > 5300.0);
        double flux = s.truth->items[0].electrons, c = path[0] / length, e = path[1] / length;
        bst_crlb_table_at at = bst_crlb_table_of(&bound, flux, noise, length / b);
        double along = b * b * at.var_along_px2, across = b * b * at.var_across_px2;
        assert_true(along > 2.0 * across);
        const double want[3] = {c * c * along + e * e * across, c * e * (along - across),
                                e * e * along + c * c * across};
        double product = want[0] * want[2];
        const double error[3] = {want[0] * sqrt(2.0 / n), sqrt((product + want[1] * want[1]) / n),
                                 want[2] * sqrt(2.0 / n)};
        for (int a = 0; a < 3; a++) {
            /* four standard errors of moments of normal deviates; stated for the measured flux */
            bst_assert_close(got[a] / n, want[a], 4.0 * error[a]);
            bst_assert_close(reported[a] / n, want[a], 0.02 * sqrt(product));
        }
    }
    close_scene(&s);
}

/* Deviation of a place along x that is fitted by the gradient of a Gaussian of variance m where the
 * image has variances x2 and y2, over that with the image's own gradient: by sums over a fine grid,
 * sqrt(sum m'^2 sum q'^2) / sum m' q'. */
static double wrong_gradient(double m, double x2, double y2) {
    double mm = 0.0, qq = 0.0, mq = 0.0;
    for (int i = -60; i <= 60; i++) {
        for (int j = -60; j <= 60; j++) {
            double x = 0.1 * i, y = 0.1 * j;
            double a = x / m * exp(-0.5 * (x * x + y * y) / m);
            double b = x / x2 * exp(-0.5 * (x * x / x2 + y * y / y2));
            mm += a * a;
            qq += b * b;
            mq += a * b;
        }
    }
    return sqrt(mm * qq) / mq;
}

/* An object that moves by 3 px while the stars are at rest is too short to be fitted as a streak.
 * The gradient of a point finds it worse than the bound of its image says, most along the path. */
static void short_paths_are_placed_with_a_points_gradient(void **state) {
    (void)state;
    const double length = 3.0, c = 0.6, e = 0.8;
    scene s;
    open_scene(&s);
    for (int i = 0; i < BST_OBSGEN_SNRS; i++) {
        s.calibration.across_factor[i] = s.calibration.along_factor[i] = 1.0;
    }
    s.calibration.phase_bias_px = 0.0;
    start(&s);
    static bst_crlb_table bound;
    bst_crlb_table_init(&bound, s.frame.sigma_px);
    fill(&s, 150.0);
    for (int i = 0; i < s.truth->count; i++) {
        bst_truth_item *item = &s.truth->items[i];
        item->kind = BST_SOURCE_OBJECT;
        item->x_start_px -= 0.5 * length * c;
        item->x_end_px += 0.5 * length * c;
        item->y_start_px -= 0.5 * length * e;
        item->y_end_px += 0.5 * length * e;
    }
    double along = 0.0, across = 0.0, noise = 0.0, n = 0.0;
    for (int f = 0; f < 8; f++) {
        bst_generator_result r = run(&s, f);
        noise = r.noise_e;
        for (int i = 0; i < r.count; i++, n += 1.0) {
            const bst_detection *d = &r.items[i].detection;
            const bst_truth_item *t = &s.truth->items[r.items[i].item];
            double x = d->x_px - t->x_centroid_px, y = d->y_px - t->y_centroid_px;
            along += (c * x + e * y) * (c * x + e * y);
            across += (c * y - e * x) * (c * y - e * x);
        }
    }
    assert_true(n > 7000.0);
    bst_crlb_table_at at = bst_crlb_table_of(&bound, s.truth->items[0].electrons, noise, length);
    double point = s.frame.sigma_px * s.frame.sigma_px + 1.0 / 12.0;
    double path = point + length * length / 12.0;
    const double ratio[2] = {
        sqrt(along / n / at.var_along_px2) / wrong_gradient(point, path, point),
        sqrt(across / n / at.var_across_px2) / wrong_gradient(point, point, path)};
    /* four standard deviations of a root mean square of 7200, 3.3 %, and of both */
    bst_assert_close(ratio[0], 1.0, 0.033);
    bst_assert_close(ratio[1], 1.0, 0.033);
    bst_assert_close(0.5 * (ratio[0] + ratio[1]), 1.0, 0.023);
    close_scene(&s);
}

/* Output of a filter at a distance along the path, relative to its largest: integral of a Gaussian
 * over the image (of length `a`) and the filter (of length `b`), both lines. */
static double output_along(double distance, double a, double b, double sigma2) {
    enum { PARTS = 200 };
    double sum = 0.0, top = 0.0;
    for (int i = 0; i < PARTS; i++) {
        for (int k = 0; k < PARTS; k++) {
            double d = a * ((i + 0.5) / PARTS - 0.5) - b * ((k + 0.5) / PARTS - 0.5);
            sum += exp(-0.25 * (d - distance) * (d - distance) / sigma2);
            top += exp(-0.25 * d * d / sigma2);
        }
    }
    return sum / top;
}

/* A streak in whose line another source lies: the output between both does not fall by 3 below the
 * lower maximum, so that images see one (imgproc/detect/candidates.c). The other one is a bright
 * streak that has no light at the faint maximum, or a point beside the streak's end. */
static void what_lies_in_line_joins(void **state) {
    (void)state;
    enum { FRAMES = 40 };
    const double length = 12.0;
    scene s;
    open_scene(&s);
    s.settings.false_alarms_per_frame = 1e-3;
    s.calibration.background_fraction = s.calibration.crowding = 0.0;
    s.frame.streak_dx_px = length;
    start(&s);
    double sigma2 = s.frame.sigma_px * s.frame.sigma_px + 1.0 / 12.0;
    for (int point = 0; point < 2; point++) {
        double levels[2] = {9.0, point ? 9.0 : 600.0}; /* of the streak and of the other */
        double apart = point ? 0.75 * length : length + 3.6 * sqrt(2.0 * sigma2);
        double electrons[2] = {1000.0, 1000.0}, share = 0.0, lowest = INFINITY;
        for (int round = 0; round < 2; round++) { /* the light for these outputs */
            s.truth->count = 0;
            for (uint32_t k = 0; k < 2; k++) {
                bst_truth_item *t = add_source(&s, 1 + k, 500.0 + k * apart, 500.0, electrons[k]);
                t->kind = k == 1 && point ? BST_SOURCE_OBJECT : BST_SOURCE_STAR;
                double half = k == 1 && point ? 0.0 : 0.5 * length;
                t->x_start_px -= half;
                t->x_end_px += half;
            }
            (void)run(&s, 0);
            for (int i = 0; i < s.generator->source_count; i++) {
                const generator_source *o = &s.generator->sources[i];
                electrons[o->item] *= levels[o->item] / o->unraised;
                share = o->other;
            }
        }
        for (double x = 1.0; x < apart; x += 1.0) {
            double other = apart - x, both[2] = {0.0, 0.0};
            both[1] = levels[0] * output_along(x, length, length, sigma2);
            both[0] = levels[0] * share * output_along(x, length, 1e-3, sigma2);
            both[1] += levels[1] * (point ? share * output_along(other, 1e-3, length, sigma2)
                                          : output_along(other, length, length, sigma2));
            both[0] += point ? levels[1] * output_along(other, 1e-3, 1e-3, sigma2) : 0.0;
            lowest = fmin(lowest, fmax(both[0], both[1]));
        }
        assert_true(lowest > levels[0] - 2.0);
        assert_true(levels[1] * output_along(apart, length, length, sigma2) < 0.01 || point);
        int two = 0;
        for (int n = 1; n <= FRAMES; n++) {
            two += run(&s, n).count > 1;
        }
        printf("lowest output between %.1f and %.1f: %.2f, seen as two in %d of %d\n", levels[0],
               levels[1], lowest, two, FRAMES);
        assert_true(two <= FRAMES / 2); /* by noise between the maxima */
    }
    close_scene(&s);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(places_widen_by_what_is_not_known_of_the_path),
        cmocka_unit_test(short_paths_are_placed_with_a_points_gradient),
        cmocka_unit_test(slanting_streaks_scatter_as_stated),
        cmocka_unit_test(short_streaks_may_be_points),
        cmocka_unit_test(streaks_are_detected_in_either_filter),
        cmocka_unit_test(what_rests_is_drawn_by_the_streak_beside_it),
        cmocka_unit_test(what_lies_in_line_joins),
        cmocka_unit_test(the_edge_cuts),
        cmocka_unit_test(long_streaks_are_seen_in_parts),
        cmocka_unit_test(tops_at_rest_scatter_evenly),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
