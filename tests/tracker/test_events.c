/* Events reported from innovations, and tracks that are places of the sensor: statistics by closed
 * forms, with correlated innovations and places that differ in x and y. */
#include "tests/tracker/sky_bench.h"
#include "tracker/mtt/multitarget_internal.h"

/* The sum of n innovations of one covariance S has n S: (sum nu)^T S^-1 (sum nu) / n. */
static double statistic_of(const double (*nu)[2], int n, const double s[3]) {
    double a = 0.0, b = 0.0, det = s[0] * s[2] - s[1] * s[1];
    for (int i = 0; i < n; i++) {
        a += nu[i][0];
        b += nu[i][1];
    }
    return (s[2] * a * a - 2.0 * s[1] * a * b + s[0] * b * b) / det / n;
}

/* Windows of 1, 2, 4 and 8 hits share the rate of false events: each has a quarter of it. */
static void a_manoeuvre_is_told_at_its_rate(void **state) {
    (void)state;
    const double s[3] = {4.0, 1.5, 9.0};
    const double nu[8][2] = {{0.5, -1.0}, {-1.5, 2.0}, {1.0, 1.0},  {2.0, -0.5},
                             {1.5, 2.5},  {2.5, 1.0},  {3.0, -1.0}, {2.0, 3.0}};
    for (int hits = 1; hits <= 8; hits++) {
        /* the latest window of hits that stands out most, all windows */
        double most = 0.0;
        for (int n = 1; n <= hits; n *= 2) {
            most = fmax(most, statistic_of(&nu[hits - n], n, s));
        }
        /* half a probability at the most is allowed */
        for (int reported = 0; reported < 2 && exp(-0.5 * most) < 0.45; reported++) {
            bst_mtt_params params = defaults();
            const double dt = 2.5;
            params.event_window = 8;
            /* a false one with the probability of its statistic, four tests a hit */
            double rate = exp(-0.5 * most) * 4.0 * 3600.0 / dt;
            bst_mtt_track track = {.id = 1};
            bool event = false;
            double statistic = 0.0;
            for (int i = 0; i < hits; i++) {
                params.false_events_per_hour =
                    i + 1 < hits ? 1e-30 : (reported ? 1.001 : 0.999) * rate;
                bst_sky_innovation innovation = {.nu = {nu[i][0], nu[i][1]},
                                                 .s = {s[0], s[1], s[2]}};
                assert_false(event);
                event = bst_mtt_note_innovation(&params, &track, &innovation, dt, &statistic);
            }
            assert_int_equal(event, reported);
            assert_int_equal(track.innovation_count, reported ? 0 : hits);
            if (reported) {
                bst_assert_close(statistic, most, 1e-9 * most); /* rounding */
            }
        }
    }
    bst_mtt_params params = defaults();
    bst_mtt_track track = {.id = 1};
    bst_sky_innovation far = {.nu = {100.0, 100.0}, .s = {1.0, 0.0, 1.0}};
    double statistic;
    params.false_events_per_hour = 0.0; /* none are reported */
    assert_false(bst_mtt_note_innovation(&params, &track, &far, 1.0, &statistic));
    assert_false(bst_mtt_note_brightness(&params, &track, 100.0, 1.0, &statistic));
    params.false_events_per_hour = 1e9;
    params.event_window = 0;
    assert_false(bst_mtt_note_innovation(&params, &track, &far, 1.0, &statistic));
    assert_false(bst_mtt_note_brightness(&params, &track, 100.0, 1.0, &statistic));
    /* however many are allowed, what is likelier than not is no event: exp(-x / 2) = 0.55, 0.45 */
    params.event_window = 1;
    for (int rare = 0; rare < 2; rare++) {
        bst_sky_innovation one = {.nu = {sqrt(-2.0 * log(rare ? 0.45 : 0.55)), 0.0},
                                  .s = {1.0, 0.0, 1.0}};
        assert_int_equal(bst_mtt_note_innovation(&params, &track, &one, 1.0, &statistic), rare);
    }
}

/* The same with one dimension: the tail of a normal distribution on both sides. */
static void a_change_of_brightness_is_told_at_its_rate(void **state) {
    (void)state;
    const double z[5] = {0.3, -0.8, 1.1, 1.4, 1.2};
    for (int hits = 1; hits <= 5; hits++) {
        for (int sign = -1; sign <= 1; sign += 2) {
            double most = 0.0;
            for (int n = 1; n <= hits && n <= 4; n *= 2) {
                double sum = 0.0;
                for (int i = hits - n; i < hits; i++) {
                    sum += z[i];
                }
                most = fmax(most, sum * sum / n);
            }
            for (int reported = 0; reported < 2; reported++) {
                bst_mtt_params params = defaults();
                params.event_window = 4; /* windows of 1, 2, 4 */
                const double dt = 0.5;
                /* half a probability at the most is allowed */
                double allowed = erfc(sqrt(0.5 * most));
                if (allowed > 0.45) {
                    continue;
                }
                double rate = allowed * 3.0 * 3600.0 / dt, statistic = 0.0;
                bst_mtt_track track = {.id = 1};
                bool event = false;
                for (int i = 0; i < hits; i++) {
                    params.false_events_per_hour =
                        i + 1 < hits ? 1e-30 : (reported ? 1.001 : 0.999) * rate;
                    event = bst_mtt_note_brightness(&params, &track, sign * z[i], dt, &statistic);
                }
                assert_int_equal(event, reported);
                assert_int_equal(track.brightness_count, reported ? 0 : hits);
                if (reported) {
                    bst_assert_close(statistic, most, 1e-12);
                }
            }
        }
    }
}

#define PIXEL (3.0 * AS)

static bst_mtt_detection at(double x, double y, double width, double sigma_px) {
    return (bst_mtt_detection){
        .sky = {.cov_11 = 0.5 * pow(sigma_px * PIXEL, 2), .cov_22 = 1.5 * pow(sigma_px * PIXEL, 2)},
        .x_px = x,
        .y_px = y,
        .width_px = width};
}

static double normal(double dx, double dy, double variance) {
    return exp(-0.5 * (dx * dx + dy * dy) / variance) / (2.0 * BST_PI * variance);
}

/* Of a defect's detections 85 % scatter about its place, 5 % about the one before, 10 % lie within
 * 1.5 FWHM; beside them the false alarms. A motion counts as no more than the peak of the first. */
static void a_place_of_the_sensor_is_weighed(void **state) {
    (void)state;
    bst_mtt_params params = defaults();
    params.pixel_rad = PIXEL;
    bench *b = start(1, &params);
    b->mtt->clutter_density = 0.01 / (PIXEL * PIXEL); /* per px^2 */
    bst_mtt_track track = {.id = 1};
    bst_mtt_detection d = at(100.0, 200.0, 2.0, 0.1);
    bst_mtt_start_fixed(b->mtt, &d, &track);
    const double r2 = 0.1 * 0.1 + 0.5 * 0.5; /* stated, and a quarter of 2 px */
    bst_assert_close(track.fixed.now.x_px, 100.0, 0.0);
    bst_assert_close(track.fixed.now.y_px, 200.0, 0.0);
    bst_assert_close(track.fixed.now.variance_px2, r2, 1e-12);
    /* near it, a motion that expects it less: density 0.02 per px^2 */
    d = at(100.4, 199.3, 2.0, 0.1);
    bst_mtt_note_fixed(b->mtt, &d, log(0.02 / (PIXEL * PIXEL)), &track);
    double density = 0.01 + 0.9 * normal(0.4, 0.7, 2.0 * r2) + 0.1 / (BST_PI * 9.0);
    double odds = log(0.02) - log(density);
    bst_assert_close(track.fixed.log_odds, odds, 1e-9); /* rounding */
    /* half way, twice as well known */
    bst_assert_close(track.fixed.now.x_px, 100.2, 1e-9);
    bst_assert_close(track.fixed.now.y_px, 199.65, 1e-9);
    bst_assert_close(track.fixed.now.variance_px2, 0.5 * r2, 1e-12);
    bst_assert_close(track.fixed.before.x_px, 100.0, 0.0);
    /* far away, in an image of 3 px, where the motion predicts it better than a defect scatters */
    double r3 = 0.04 + 0.75 * 0.75;
    d = at(103.0, 204.5, 3.0, 0.2);
    bst_mtt_note_fixed(b->mtt, &d, log(100.0 / (PIXEL * PIXEL)), &track);
    density = 0.01 + 0.85 * normal(2.8, 4.85, 0.5 * r2 + r3) + 0.05 * normal(3.0, 4.5, r2 + r3);
    odds += log(0.85 / (2.0 * BST_PI * r3)) - log(density);
    bst_assert_close(track.fixed.log_odds, odds, 1e-9);
    bst_assert_close(track.fixed.now.x_px, 103.0, 0.0);
    bst_assert_close(track.fixed.now.y_px, 204.5, 0.0);
    bst_assert_close(track.fixed.now.variance_px2, r3, 1e-12);
    bst_assert_close(track.fixed.before.x_px, 100.2, 1e-9);
    bst_assert_close(track.fixed.before.y_px, 199.65, 1e-9);
    /* and back, in an image whose width is not known: 1 px */
    double r1 = 0.01 + 0.0625;
    d = at(100.5, 199.9, 0.0, 0.1);
    bst_mtt_note_fixed(b->mtt, &d, log(0.001 / (PIXEL * PIXEL)), &track);
    density = 0.01 + 0.85 * normal(2.5, 4.6, r3 + r1) + 0.05 * normal(0.3, 0.25, 0.5 * r2 + r1);
    odds += log(0.001) - log(density);
    bst_assert_close(track.fixed.log_odds, odds, 1e-9);
    double gain = 0.5 * r2 / (0.5 * r2 + r1);
    bst_assert_close(track.fixed.now.x_px, 100.2 + 0.3 * gain, 1e-9);
    bst_assert_close(track.fixed.now.y_px, 199.65 + 0.25 * gain, 1e-9);
    bst_assert_close(track.fixed.now.variance_px2, 0.5 * r2 * (1.0 - gain), 1e-12);
    bst_assert_close(track.fixed.before.y_px, 204.5, 0.0);
    /* as likely as not, for so many bad pixels */
    track.fixed.log_odds = 3.0;
    b->mtt->bad_pixels = 21; /* exp(3) = 20.1 */
    assert_true(bst_mtt_may_be_fixed(b->mtt, &track));
    b->mtt->bad_pixels = 20;
    assert_false(bst_mtt_may_be_fixed(b->mtt, &track));
    track.fixed.log_odds = -3.0;
    assert_true(bst_mtt_may_be_fixed(b->mtt, &track));
    b->mtt->bad_pixels = 0;
    assert_false(bst_mtt_may_be_fixed(b->mtt, &track));
    b->mtt->bad_pixels = 20;
    b->mtt->params.pixel_rad = 0.0; /* not asked */
    assert_false(bst_mtt_may_be_fixed(b->mtt, &track));
    bst_mtt_note_fixed(b->mtt, &d, 0.0, &track);
    assert_true(track.fixed.log_odds == -3.0);
    bst_mtt_free(b->mtt);
}

/* What each hit adds to a track, at uneven times and with errors that differ along the axes: the
 * magnitude by weights of both variances, chi-square, and the logarithm of the likelihood over that
 * of an alarm, with det S = det(R)^2 / det(R - P) of the updated P. */
static void what_a_hit_adds(void **state) {
    (void)state;
    bst_mtt_params params = defaults();
    params.brightness_systematic_mag = 0.05;
    params.brightness_random_walk_mag = 0.08;
    params.noise_rad2ps3 = pow(0.2 * AS, 2);
    bst_ctx ctx = {0};
    bst_mtt *mtt;
    bst_assert_ok(&ctx, bst_mtt_create(&ctx, &params, &mtt));
    const double times[] = {0, 1, 2, 3.5, 4.5, 7, 8, 11},
                 mags[] = {11, 11.4, 10.9, 11.2, 10.7, 11.1, 11.5, 10.8};
    bst_mtt_track before = {.id = 0};
    for (int i = 0; i < 8; i++) {
        double v1 = pow((0.3 + 0.1 * (i % 3)) * AS, 2), v2 = pow(0.5 * AS, 2),
               off = i % 2 ? 0.3 : -0.4;
        double sigma = 0.1 + 0.05 * (i % 2);
        bst_vec3 centre = bst_vec3_from_radec(1.0 + 20 * AS * times[i], 0.2);
        bst_tangent axes = bst_tangent_at(centre);
        const bst_mtt_detection one = {
            .sky = {.direction = bst_tangent_exp(
                        centre, bst_tangent_vector(&axes, off * AS, -0.5 * off * AS)),
                    .cov_11 = v1,
                    .cov_22 = v2},
            .x_px = 100.5 + i,
            .y_px = 200.5 - i,
            .v_mag = mags[i],
            .v_mag_sigma = sigma,
            .snr = 20 + i};
        const bst_mtt_frame f = {
            .tick = llround(1000 * times[i]), .seconds = times[i], .detections = &one, .count = 1};
        bst_mtt_step(mtt, &f);
        int count;
        const bst_mtt_track *track = bst_mtt_tracks(mtt, &count);
        assert_true(count == (i > 0));
        if (i > 1) {
            double r = 0.05 * 0.05 + sigma * sigma, p = before.v_mag_variance + 0.08 * 0.08;
            bst_assert_close(1.0 / track->v_mag_variance, 1.0 / p + 1.0 / r, 1e-9);
            bst_assert_close(track->v_mag, track->v_mag_variance * (before.v_mag / p + mags[i] / r),
                             1e-9);
            double a = v1 - track->state.covariance[0][0], b = -track->state.covariance[0][1];
            double c = v2 - track->state.covariance[1][1];
            double log_s = 2.0 * log(v1 * v2) - log(a * c - b * b);
            double chi2 = track->chi2 - before.chi2;
            bst_assert_close(track->last_chi2, chi2, 1e-9);
            double alarms = mtt->clutter_density;
            bst_assert_close(track->score - before.score,
                             log(0.9 / alarms) - log(2.0 * BST_PI) - 0.5 * log_s - 0.5 * chi2,
                             0.02);
            assert_int_equal(track->hits, before.hits + 1);
            bst_assert_close(track->last_update_s, times[i], 0.0);
            bst_assert_close(track->x_px, 100.5 + i, 0.0);
            bst_assert_close(track->y_px, 200.5 - i, 0.0);
            bst_assert_close(track->snr, 20 + i, 0.0);
        }
        if (count) {
            before = *track;
        }
    }
    bst_mtt_free(mtt);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_manoeuvre_is_told_at_its_rate),
        cmocka_unit_test(a_change_of_brightness_is_told_at_its_rate),
        cmocka_unit_test(a_place_of_the_sensor_is_weighed),
        cmocka_unit_test(what_a_hit_adds),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
