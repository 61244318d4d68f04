/* Tracks on orbits: consistent while they are seen, and over gaps in which a constant rate is lost.
 */
#include "boresight/rng.h"
#include "sim/astro/kepler.h"
#include "tests/test_support.h"
#include "tests/tracker/geo_look.h"
#include "tracker/mtt/multitarget.h"
#include "tracker/orbit/orbit_track.h"

#define AS BST_ARCSEC_RAD
#define SIGMA (0.3 * AS)

static bst_od_state low(void) {
    return from_elements(7160e3, 1e-3, 98.5, 120.0, 30.0, -40.0);
}

static bst_sky_measurement measure(bst_vec3 d, bst_rng_key key, uint64_t n) {
    double e[2];
    bst_rng_normal2(key, 3, n, e);
    bst_tangent axes = bst_tangent_at(d);
    return (bst_sky_measurement){
        .direction = bst_tangent_exp(d, bst_tangent_vector(&axes, SIGMA * e[0], SIGMA * e[1])),
        .cov_11 = SIGMA * SIGMA,
        .cov_22 = SIGMA * SIGMA};
}

/* Chi-square of a true direction against a state's, 2 degrees of freedom. */
static double misfit(const bst_sky_state *s, bst_vec3 truth) {
    bst_tangent axes = bst_tangent_at(s->direction);
    bst_vec3 off = bst_tangent_log(s->direction, truth);
    double x = bst_vec3_dot(off, axes.e1), y = bst_vec3_dot(off, axes.e2);
    double a = s->covariance[0][0], b = s->covariance[0][1], c = s->covariance[1][1];
    return (c * x * x - 2 * b * x * y + a * y * y) / (a * c - b * b);
}

/* 100 runs: ten minutes at 1 Hz with the range known to 2 %, then nothing for an hour. The place is
 * where the covariance says while it is seen (mean chi-square of 2 degrees of freedom: 2, standard
 * error 0.2) and after the gap, and known to a fraction of a degree; a constant rate, with the
 * acceleration noise that it needs while the object is seen, is degrees off and does not know. */
static void the_gap_of_an_hour(void **state) {
    (void)state;
    enum { RUNS = 100, SEEN = 600 };
    double seen = 0.0, after = 0.0, sigma = 0.0, constant = 0.0, off = 0.0;
    for (uint64_t run = 0; run < RUNS; run++) {
        bst_rng_key key = bst_rng_make_key(run, 0, "test", "orbit_track");
        bst_orbit_track orbit = {.valid = false};
        bst_sky_state sky = {.covariance = {{0}}}, plain = sky;
        bst_sky_measurement first = {.cov_11 = 0.0};
        bst_od_observer eye;
        bst_vec3 d;
        double range, before, later;
        for (int k = 0; k < SEEN; k++) {
            look(k, 0.0, &eye, &d, &range);
            bst_sky_measurement m = measure(d, key, (uint64_t)k);
            bst_sky_innovation v;
            if (k < 2) {
                if (k == 1) {
                    double n[2];
                    bst_rng_normal2(key, 4, 0, n);
                    bst_sky_from_pair(&first, &m, 1.0, 0.0, &sky);
                    bst_od_observer a, b;
                    bst_vec3 unused;
                    look(0.5, 0.0, &a, &unused, &before);
                    look(1.5, 0.0, &b, &unused, &later);
                    bst_orbit_range known = {range * (1.0 + 0.02 * n[0]), 0.02 * range,
                                             later - before + 50.0 * n[1], 50.0};
                    bst_orbit_track_start(&sky, &eye, &known, &orbit);
                    plain = sky;
                }
                first = m;
                continue;
            }
            assert_true(bst_orbit_track_predict(&orbit, 1e-12, &eye));
            sky = orbit.sky;
            assert_true(bst_sky_innovate(&sky, &m, NULL, &v));
            bst_sky_update(&sky, &v);
            assert_true(bst_orbit_track_update(&orbit, &sky));
            bst_sky_predict(&plain, 1.0, pow(0.02 * AS, 2));
            assert_true(bst_sky_innovate(&plain, &m, NULL, &v));
            bst_sky_update(&plain, &v);
        }
        seen += misfit(&sky, d) / RUNS;
        look(SEEN + 3600.0, 0.0, &eye, &d, &range);
        assert_true(bst_orbit_track_predict(&orbit, 1e-12, &eye));
        after += misfit(&orbit.sky, d) / RUNS;
        sigma += sqrt(orbit.sky.covariance[0][0] + orbit.sky.covariance[1][1]) / RUNS;
        bst_sky_predict(&plain, 3601.0, pow(0.02 * AS, 2));
        constant += misfit(&plain, d) / RUNS;
        off += bst_vec3_angle(plain.direction, d) / RUNS;
    }
    print_message(
        "chi-square of 2: seen %.2f, after an hour %.2f (sigma %.3f deg); constant rate "
        "%.0f (off by %.1f deg)\n",
        seen, after, sigma / BST_DEG_RAD, constant, off / BST_DEG_RAD);
    bst_assert_close(seen, 2.0, 0.7);
    bst_assert_close(after, 2.0, 0.7);
    assert_true(sigma < 0.2 * BST_DEG_RAD);
    assert_true(constant > 18.4 && off > 1.0 * BST_DEG_RAD);
}

/* Ten minutes of a low orbit in steps of 0.1 s, and in one of them, against the integration of
 * gravity to degree 20 (EGM2008): two bodies are 4 km off, oblateness leaves what the other
 * harmonics move, which are a thousand times smaller (measured: 9 m). */
static void low_orbits_are_oblate(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_gravity *gravity;
    bst_assert_ok(&ctx, bst_gravity_builtin(&ctx, 20, 20, &gravity));
    const bst_force_model forces = {.gravity = gravity};
    bst_od_motion motion = {.forces = &forces};
    bst_assert_ok(&ctx, bst_time_from_utc(&ctx, "2022-06-16T22:10:00Z", &motion.epoch));
    bst_od_path *path;
    bst_od_state truth, plain = low();
    bst_assert_ok(&ctx, bst_od_path_create(&ctx, &motion, &plain, &path));
    bst_assert_ok(&ctx, bst_od_path_state(&ctx, path, 600.0, &truth));
    bst_od_path_free(path);
    bst_gravity_free(gravity);
    for (int steps = 1; steps <= 6000; steps *= 6000) {
        bst_orbit_track orbit = {.valid = true, .state = low()};
        for (int i = 0; i < 6; i++) {
            orbit.covariance[i][i] = i < 3 ? 1e4 : 1.0;
        }
        for (int k = 1; k <= steps; k++) {
            bst_od_observer eye = {.time_s = 600.0 * k / steps, .position_m = {8000e3, 0, 0}};
            assert_true(bst_orbit_track_predict(&orbit, 0.0, &eye));
        }
        double off = bst_vec3_norm(bst_vec3_sub(orbit.state.position_m, truth.position_m));
        print_message("%d steps: off by %.1f m\n", steps, off);
        assert_true(off < 80.0);
    }
    bst_assert_ok(
        &ctx, bst_kepler_propagate(&ctx, BST_EARTH_MU_M3PS2, plain.position_m, plain.velocity_mps,
                                   600.0, &plain.position_m, &plain.velocity_mps));
    double off = bst_vec3_norm(bst_vec3_sub(plain.position_m, truth.position_m));
    print_message("two bodies: off by %.0f m\n", off);
    assert_true(off > 1000.0);
}

/* The range of a track and its standard deviation. */
static double range_with_sigma(const bst_orbit_track *t, bst_vec3 eye_m, double *sigma_m) {
    bst_vec3 way = bst_vec3_sub(t->state.position_m, eye_m), u = bst_vec3_unit(way);
    const double along[3] = {u.x, u.y, u.z};
    double variance = 0.0;
    for (int i = 0; i < 9; i++) {
        variance += along[i / 3] * along[i % 3] * t->covariance[i / 3][i % 3];
    }
    *sigma_m = sqrt(variance);
    return bst_vec3_norm(way);
}

/* One range: the update of two Gaussians, and one 6 sigma off is not used. */
static void one_range(void **state) {
    (void)state;
    const bst_od_observer eye = {.position_m = {7000e3, 300e3, 0.0}};
    bst_orbit_track t = {
        .valid = true,
        .state = {.position_m = {7000e3, 500e3, 0.0}, .velocity_mps = {0.0, 0.0, 7500.0}}};
    for (int i = 0; i < 6; i++) {
        t.covariance[i][i] = i < 3 ? 40e3 * 40e3 : 1.0;
    }
    bst_orbit_measured_range z = {170e3, 30e3, 3600.0};
    double sigma_m;
    assert_true(bst_orbit_track_range(&t, &eye, &z));
    bst_assert_close(range_with_sigma(&t, eye.position_m, &sigma_m), (200e3 * 9 + 170e3 * 16) / 25,
                     1e-3);
    bst_assert_close(sigma_m, 24e3, 1e-3);
    bst_assert_close(t.covariance[0][0], 40e3 * 40e3, 1.0); /* across: nothing is learnt */
    z.range_m = 180.8e3 + 6.0 * hypot(24e3, 30e3);
    assert_false(bst_orbit_track_range(&t, &eye, &z));
    bst_assert_close(range_with_sigma(&t, eye.position_m, &sigma_m), 180.8e3, 100.0);
}

/* 400 runs of ten minutes at 1 Hz, of an object at rest before the observer: ranges have one error
 * in common, which lasts, and another one that changes in half a minute, as a size does that is
 * known to 20 % and seen at changing attitudes. With a time constant of an hour the normalised
 * error is right (mean square 1, standard error 0.07); as if all were independent it is not. */
static void ranges_with_errors_that_last(void **state) {
    (void)state;
    enum { RUNS = 400, STEPS = 600 };
    const bst_vec3 eye_m = {7000e3, 300e3, 0.0};
    const double truth_m = 200e3, common_m = 24e3, changing_m = 18e3, decay = exp(-1.0 / 30.0);
    double chi2[2] = {0.0, 0.0};
    for (int kind = 0; kind < 2; kind++) {
        for (uint64_t run = 0; run < RUNS; run++) {
            bst_rng_key key = bst_rng_make_key(run, 0, "test", "size_ranges");
            double n[2], sigma_m;
            bst_rng_normal2(key, 3, 0, n);
            double common = common_m * n[0], changing = changing_m * n[1];
            bst_orbit_track t = {
                .valid = true,
                .state = {.position_m = {7000e3, 500e3, 0.0}, .velocity_mps = {0.0, 0.0, 7500.0}}};
            bst_rng_normal2(key, 4, 0, n);
            t.state.position_m.y += 60e3 * n[0];
            for (int i = 0; i < 6; i++) {
                t.covariance[i][i] = i < 3 ? 60e3 * 60e3 : 1.0;
            }
            for (int k = 0; k < STEPS; k++) {
                bst_rng_normal2(key, 5, (uint64_t)k, n);
                changing = decay * changing + sqrt(1.0 - decay * decay) * changing_m * n[0];
                const bst_od_observer eye = {.time_s = k, .position_m = eye_m};
                const bst_orbit_measured_range z = {truth_m + common + changing,
                                                    hypot(common_m, changing_m),
                                                    kind == 0 ? 3600.0 : 0.0};
                t.state.time_s = k;
                (void)bst_orbit_track_range(&t, &eye, &z);
            }
            double off = range_with_sigma(&t, eye_m, &sigma_m) - truth_m;
            chi2[kind] += off * off / (sigma_m * sigma_m) / RUNS;
        }
    }
    print_message("mean square of the normalised error: %.2f, as independent %.0f\n", chi2[0],
                  chi2[1]);
    assert_true(chi2[0] > 0.6 && chi2[0] < 1.2);
    assert_true(chi2[1] > 20.0);
}

typedef struct bench {
    double range_m, range_rate_mps;
} bench;

static bool range_of(const void *user, const bst_mtt_track *track, bst_orbit_range *out) {
    const bench *b = user;
    (void)track;
    *out = (bst_orbit_range){b->range_m, 0.02 * b->range_m, b->range_rate_mps, 50.0};
    return true;
}

/* Parameters of a tracker of one object. */
static bst_mtt_params gap_params(bool orbits) {
    return (bst_mtt_params){.max_tracks = 50,
                            .max_detections = 50,
                            .association = BST_MTT_MIXTURE,
                            .noise_rad2ps3 = pow(0.02 * AS, 2),
                            .orbits = orbits,
                            .orbit_noise_m2ps3 = 1e-12,
                            .gate_chi2 = 16,
                            .detection_probability = 0.95,
                            .false_alarms_per_frame = 1,
                            .field_sr = pow(3000 * AS, 2),
                            .confirm_hits = 3,
                            .confirm_frames = 5,
                            .confirm_score = 12,
                            .max_rate_radps = 120 * AS,
                            .initiation_gap_s = 5,
                            .max_misses = 12,
                            .max_coast_s = 120,
                            .max_sigma_rad = 60 * AS,
                            .max_dormant_tracks = 16,
                            .max_dormant_s = 7200,
                            .max_dormant_sigma_rad = BST_DEG_RAD,
                            .dormant_gate_chi2 = 18.5};
}

/* The multi-target tracker over the same gap: with orbits the object is known again, by its number,
 * when it comes back; with a constant rate it is a new one. */
static void identity_over_the_gap(void **state) {
    (void)state;
    for (int orbits = 0; orbits < 2; orbits++) {
        int kept = 0;
        enum { RUNS = 8 };
        for (uint64_t run = 0; run < RUNS; run++) {
            bst_ctx ctx = {0};
            bst_mtt_params params = gap_params(orbits);
            bst_mtt *mtt;
            bst_assert_ok(&ctx, bst_mtt_create(&ctx, &params, &mtt));
            bst_rng_key key = bst_rng_make_key(run, 1, "test", "orbit_track");
            int64_t before = -1, after = -2;
            for (int k = 0; k < 4240; k++) {
                bool hidden = k >= 600 && k < 4200;
                if (hidden && k % 60 != 0) {
                    continue; /* a frame a minute in the gap */
                }
                bst_od_observer eye, side;
                bst_vec3 d, unused;
                double range, from, to;
                look(k, 0.0, &eye, &d, &range);
                look(k - 0.5, 0.0, &side, &unused, &from);
                look(k + 0.5, 0.0, &side, &unused, &to);
                bench b = {range, to - from};
                bst_mtt_detection own = {.sky = measure(d, key, (uint64_t)k),
                                         .v_mag = 12.0,
                                         .v_mag_sigma = 0.1,
                                         .snr = 20.0};
                bst_mtt_frame f = {.tick = k,
                                   .seconds = k,
                                   .detections = &own,
                                   .count = hidden ? 0 : 1,
                                   .observer = &eye,
                                   .range = range_of,
                                   .user = &b};
                bst_mtt_step(mtt, &f);
                int n;
                const bst_mtt_track *tracks = bst_mtt_tracks(mtt, &n);
                for (int i = 0; i < n; i++) {
                    if (tracks[i].status != BST_TRACK_TENTATIVE && !hidden) {
                        *(k < 600 ? &before : &after) = tracks[i].id;
                    }
                }
            }
            kept += before == after;
            bst_mtt_free(mtt);
        }
        print_message("%s: %d of %d known again\n", orbits ? "orbits" : "constant rate", kept,
                      RUNS);
        assert_true(orbits ? kept == RUNS : kept == 0);
    }
}

/* Without a prior an orbit starts from the range of its detections, which is 10 % off and
 * known to 20 %; they are not used with a time constant of 0. */
static void ranges_of_detections(void **state) {
    (void)state;
    for (int used = 0; used < 2; used++) {
        bst_ctx ctx = {0};
        bst_mtt_params params = gap_params(true);
        params.range_correlation_s = used ? 3600.0 : 0.0;
        bst_mtt *mtt;
        bst_assert_ok(&ctx, bst_mtt_create(&ctx, &params, &mtt));
        bst_rng_key key = bst_rng_make_key(1, 1, "test", "size_ranges");
        double range, sigma_m;
        bst_od_observer eye;
        for (int k = 0; k < 20; k++) {
            bst_vec3 d;
            look(k, 0.0, &eye, &d, &range);
            bst_mtt_detection own = {.sky = measure(d, key, (uint64_t)k),
                                     .v_mag = 12.0,
                                     .v_mag_sigma = 0.1,
                                     .snr = 20.0,
                                     .range_m = 1.1 * range,
                                     .range_sigma_m = 0.2 * 1.1 * range};
            bst_mtt_frame f = {
                .tick = k, .seconds = k, .detections = &own, .count = 1, .observer = &eye};
            bst_mtt_step(mtt, &f);
        }
        int n;
        const bst_mtt_track *tracks = bst_mtt_tracks(mtt, &n);
        assert_int_equal(n, 1);
        assert_int_equal(tracks[0].orbit.valid, used);
        if (used) {
            double found = range_with_sigma(&tracks[0].orbit, eye.position_m, &sigma_m);
            /* the motion determines the range, too: it is nearer to the truth */
            assert_true(fabs(found - range) < 0.1 * range);
            assert_true(sigma_m > 0.1 * range && sigma_m < 0.22 * range);
        }
        bst_mtt_free(mtt);
    }
}

static void not_with_imm(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_mtt *mtt;
    bst_mtt_params params = {.max_tracks = 5,
                             .max_detections = 5,
                             .filter = BST_FILTER_IMM,
                             .orbits = true,
                             .gate_chi2 = 16,
                             .detection_probability = 0.9,
                             .false_alarms_per_frame = 1,
                             .field_sr = 1e-4,
                             .confirm_hits = 3,
                             .confirm_frames = 5,
                             .manoeuvre_sojourn_s = 1,
                             .quiescent_sojourn_s = 1};
    assert_int_equal(bst_mtt_create(&ctx, &params, &mtt), BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "ekf"));
}

/* Inverse of a positive definite matrix by Gauss and Jordan. */
static void inverse_of(const double from[4][4], double out[4][4]) {
    double a[4][4];
    memcpy(a, from, sizeof a);
    for (int i = 0; i < 16; i++) {
        out[i / 4][i % 4] = i / 4 == i % 4;
    }
    for (int p = 0; p < 4; p++) {
        double pivot = a[p][p];
        for (int k = 0; k < 4; k++) {
            a[p][k] /= pivot;
            out[p][k] /= pivot;
        }
        for (int i = 0; i < 4; i++) {
            double f = a[i][p];
            for (int k = 0; k < 4 && i != p; k++) {
                a[i][k] -= f * a[p][k];
                out[i][k] -= f * out[p][k];
            }
        }
    }
}

/* Two estimates of one direction with other rates and slanting errors: the information of both adds
 * up, and the mean is weighed by it, whichever comes first. */
static void fused_by_information(void **state) {
    (void)state;
    const double unit[4] = {2e-6, 5e-6, 3e-7, 1e-7}; /* rad, rad/s */
    bst_sky_state s[2] = {{.direction = bst_vec3_unit((bst_vec3){0.4, -0.7, 0.5})}};
    double information[2][4][4], sum[4][4], expected[4][4], right[4] = {0}, x[4] = {0};
    const bst_tangent axes = bst_tangent_at(s[0].direction);
    s[1].direction = s[0].direction;
    s[0].rate_radps = bst_tangent_vector(&axes, 4e-6, -3e-6);
    s[1].rate_radps = bst_tangent_vector(&axes, 4.3e-6, -3.2e-6);
    for (int n = 0; n < 2; n++) {
        for (int i = 0; i < 16; i++) {
            int a = i / 4, b = i % 4, swap = n ? 3 - abs(a - b) : abs(a - b);
            double r = a == b ? 1.0 + 0.4 * n * a : 0.6 * cos(1.0 + 2.0 * swap + n) / (1 + swap);
            s[n].covariance[a][b] = r * unit[a] * unit[b];
        }
        inverse_of((const double(*)[4])s[n].covariance, information[n]);
    }
    for (int i = 0; i < 16; i++) {
        sum[i / 4][i % 4] = information[0][i / 4][i % 4] + information[1][i / 4][i % 4];
    }
    inverse_of((const double(*)[4])sum, expected);
    for (int first = 0; first < 2; first++) {
        bst_sky_state fused = s[first];
        const double d[4] = {0.0, 0.0, first ? -0.3e-6 : 0.3e-6, first ? 0.2e-6 : -0.2e-6};
        for (int i = 0; i < 4; i++) {
            right[i] = x[i] = 0.0;
            for (int k = 0; k < 4; k++) {
                right[i] += information[1 - first][i][k] * d[k];
            }
        }
        for (int i = 0; i < 16; i++) {
            x[i / 4] += expected[i / 4][i % 4] * right[i % 4];
        }
        assert_true(bst_sky_fuse(&fused, &s[1 - first]));
        bst_vec3 moved = bst_vec3_sub(fused.direction, s[first].direction);
        bst_vec3 rate = bst_vec3_sub(fused.rate_radps, s[first].rate_radps);
        /* to first order in angles of 1e-6 */
        bst_assert_close(bst_vec3_dot(moved, axes.e1), x[0], 1e-4 * unit[0]);
        bst_assert_close(bst_vec3_dot(moved, axes.e2), x[1], 1e-4 * unit[1]);
        bst_assert_close(bst_vec3_dot(rate, axes.e1), x[2], 1e-4 * unit[2]);
        bst_assert_close(bst_vec3_dot(rate, axes.e2), x[3], 1e-4 * unit[3]);
        for (int i = 0; i < 16; i++) {
            int a = i / 4, b = i % 4;
            bst_assert_close(fused.covariance[a][b], expected[a][b], 1e-4 * unit[a] * unit[b]);
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(the_gap_of_an_hour),
                                       cmocka_unit_test(low_orbits_are_oblate),
                                       cmocka_unit_test(identity_over_the_gap),
                                       cmocka_unit_test(not_with_imm),
                                       cmocka_unit_test(one_range),
                                       cmocka_unit_test(fused_by_information),
                                       cmocka_unit_test(ranges_of_detections),
                                       cmocka_unit_test(ranges_with_errors_that_last)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
