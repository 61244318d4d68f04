/* What the generator makes of streaks, against the laws that it states. */
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

/* A streak cut by the frame's edge is fitted with its known path, so that place and flux are those
 * of the whole, from half the light; what lies mostly beyond the edge is a point on it; one beside
 * the frame shows nothing. */
static void the_edge_cuts(void **state) {
    (void)state;
    scene s;
    open_scene(&s);
    start(&s);
    double light = electrons_of(&s, 400.0);
    bst_truth_item *item = add_source(&s, 1, 0.0, 500.0, light);
    item->x_start_px = -20.0;
    item->x_centroid_px = 0.0;
    item->x_end_px = 20.0;
    s.frame.streak_dx_px = 40.0;
    bst_generator_result r = run(&s, 0);
    assert_int_equal(r.count, 1);
    const bst_detection *d = &r.items[0].detection;
    assert_true(d->flags & BST_DETECTION_EDGE);
    assert_true(d->flags & BST_DETECTION_STREAK);
    /* six times the bound of half the light at SNR 400 and 40 px */
    bst_assert_close(d->x_px, 0.0, 0.2);
    bst_assert_close(d->flux_e, light, 0.05 * light);
    item->x_start_px = -36.0;
    item->x_centroid_px = -16.0;
    item->x_end_px = 4.0;
    r = run(&s, 0);
    assert_int_equal(r.count, 1);
    d = &r.items[0].detection;
    assert_false(d->flags & BST_DETECTION_STREAK);
    /* -0.5 to 4 are on the frame */
    bst_assert_close(d->x_px, 1.75, 1.0);
    item->x_start_px = -60.0;
    item->x_centroid_px = -40.0;
    item->x_end_px = -20.0;
    assert_int_equal(run(&s, 0).count, 0);
    s.frame.streak_dx_px = 100.0;
    assert_true(run(&s, 0).smeared);
    close_scene(&s);
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

/* RMS errors along and across of stars of SNR 30 that moved by 8 px along x on a path with a bend
 * across it, which telemetry knows, and that trembled. */
static void errors_of(scene *s, double bend, double tremble, double rms[2]) {
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
    fill(s, 60.0);
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

/* A bend that telemetry knows is drawn by what is fitted and makes no place worse; trembling, which
 * it does not know, widens the image on both axes. */
static void places_widen_by_what_is_not_known_of_the_path(void **state) {
    (void)state;
    scene s;
    open_scene(&s);
    start(&s);
    double straight[2], bent[2], trembling[2], rms = 0.4;
    errors_of(&s, 0.0, 0.0, straight);
    errors_of(&s, 1.5, 0.0, bent);
    errors_of(&s, 0.0, rms, trembling);
    double sigma2 = s.frame.sigma_px * s.frame.sigma_px + 1.0 / 12.0;
    double wider = sqrt((sigma2 + rms * rms) / sigma2);
    /* 5400 errors each: 1 % */
    bst_assert_close(bent[0] / straight[0], 1.0, 0.04);
    bst_assert_close(bent[1] / straight[1], 1.0, 0.04);
    /* of a line in noise: along by its ends, the product of both widths; across by the width of its
     * flank and the noise in it, the 3/2 power; counted light makes it less */
    bst_assert_close(trembling[0] / straight[0], wider, 0.06);
    bst_assert_close(trembling[1] / straight[1], pow(wider, 1.5), 0.06);
    close_scene(&s);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(places_widen_by_what_is_not_known_of_the_path),
        cmocka_unit_test(short_streaks_may_be_points),
        cmocka_unit_test(the_edge_cuts),
        cmocka_unit_test(long_streaks_are_seen_in_parts),
        cmocka_unit_test(tops_at_rest_scatter_evenly),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
