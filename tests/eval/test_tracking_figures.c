/* Chi-square bounds, the posterior bound and GOSPA against tables, closed forms and brute force. */
#include "boresight/rng.h"
#include "boresight/vec.h"
#include "sim/eval/consistency.h"
#include "sim/eval/gospa.h"
#include "sim/eval/ospa2.h"
#include "sim/eval/track_bound.h"
#include "sim/eval/track_metrics.h"
#include "tests/test_support.h"

static void quantiles_of_the_tables(void **state) {
    (void)state;
    /* Abramowitz and Stegun, table 26.8 */
    const double table[][3] = {{0.95, 1, 3.84146},    {0.95, 2, 5.99146},   {0.95, 10, 18.3070},
                               {0.95, 100, 124.342},  {0.025, 50, 32.3574}, {0.975, 50, 71.4202},
                               {0.001, 3, 0.0242976}, {0.999, 20, 45.3147}};
    for (size_t i = 0; i < sizeof table / sizeof *table; i++) {
        double q = bst_eval_chi2_quantile(table[i][0], table[i][1]);
        bst_assert_close(q / table[i][2], 1.0, 5e-6); /* six digits are printed */
        bst_assert_close(bst_eval_chi2_cdf(q, table[i][1]), table[i][0], 1e-12);
    }
    /* two degrees of freedom: exp(-x/2) */
    bst_assert_close(bst_eval_chi2_cdf(7.0, 2.0), 1.0 - exp(-3.5), 1e-15);
    bst_assert_close(bst_eval_chi2_cdf(1e4, 1e4), 0.50188, 1e-5); /* 1/2 + 2 / (3 sqrt(4 pi 1e4)) */
    assert_true(isnan(bst_eval_chi2_quantile(0.0, 2.0)));
    assert_true(isnan(bst_eval_chi2_quantile(1.0, 2.0)));
    assert_true(isnan(bst_eval_chi2_quantile(0.5, 0.0)));
}

static void true_covariances_are_inside(void **state) {
    (void)state;
    enum { RUNS = 200, STEPS = 400 };
    static double values[RUNS * STEPS];
    bst_rng_key key = bst_rng_make_key(1, 0, "test", "chi2");
    const double scale[3] = {1.0, 1.2, 0.8};
    for (int s = 0; s < 3; s++) {
        for (uint64_t i = 0; i < RUNS * STEPS; i++) {
            double n[4];
            bst_rng_normal2(key, i, 0, n);
            bst_rng_normal2(key, i, 1, n + 2);
            values[i] = scale[s] * (n[0] * n[0] + n[1] * n[1] + n[2] * n[2] + n[3] * n[3]);
            if (i % 10 == 3 || i % STEPS == 5) {
                values[i] = NAN;
            }
        }
        bst_consistency c;
        bst_consistency_check(values, RUNS, STEPS, 4, 0.95, &c);
        /* steps of which i % 10 is 3 have no value at all (400 is a multiple of 10), nor has step 5
         */
        assert_int_equal(c.steps_judged, STEPS - STEPS / 10 - 1);
        /* 72000 values of standard deviation sqrt(2/4): 0.003 */
        bst_assert_close(c.mean_over_dof, scale[s], 0.012 * scale[s]);
        if (s == 0) {
            bst_assert_close(c.inside, 0.95, 0.035); /* 359 steps: 0.0115 */
        } else {
            /* 0.2 is 4 sigma of sqrt(2 / 800) = 0.05 */
            assert_true(c.inside < 0.15);
            assert_true(s == 1 ? c.below == 0.0 : c.above == 0.0);
        }
    }
}

/* A line through n points: variance of its end and of its slope (Bar-Shalom, Li and Kirubarajan
 * 2001, section 3.5). */
static void bound_of_a_straight_line(void **state) {
    (void)state;
    const double s2 = 4e-14, dt = 0.5, r[3] = {s2, 0.0, s2};
    bst_track_bound b;
    double p[4][4];
    assert_true(bst_track_bound_start(&b, r, r, dt, 0.0));
    for (int n = 3; n <= 100; n++) {
        assert_true(bst_track_bound_step(&b, dt, 0.0, 0.0, r, 1.0));
        assert_true(bst_track_bound_covariance(&b, p));
        for (int i = 0; i < 2; i++) {
            /* 100 inversions of condition up to 1e4 */
            bst_assert_close(p[i][i] / (s2 * 2.0 * (2.0 * n - 1.0) / (n * (n + 1.0))), 1.0, 1e-9);
            bst_assert_close(p[i + 2][i + 2] / (12.0 * s2 / (dt * dt * n * (n * n - 1.0))), 1.0,
                             1e-9);
        }
    }
    /* a step that brings nothing adds noise alone: q dt^3/3, q dt */
    double before = p[2][2], q = 1e-16;
    assert_true(bst_track_bound_step(&b, dt, 0.0, q, r, 0.0));
    assert_true(bst_track_bound_covariance(&b, p));
    bst_assert_close(p[2][2] / (before + q * dt), 1.0, 1e-9);
    /* a quarter turn: across the track what was rate is place now */
    bst_track_bound turn;
    assert_true(bst_track_bound_start(&turn, r, r, dt, 0.0));
    double was[4][4], w = 0.1;
    assert_true(bst_track_bound_covariance(&turn, was));
    assert_true(bst_track_bound_step(&turn, 0.5 * BST_PI / w, w, 0.0, r, 0.0));
    assert_true(bst_track_bound_covariance(&turn, p));
    bst_assert_close(p[1][1] / (was[3][3] / (w * w)), 1.0, 1e-9);
    bst_assert_close(p[3][3] / (was[1][1] * w * w), 1.0, 1e-9);
    const double none[3] = {0.0, 0.0, 0.0};
    assert_false(bst_track_bound_step(&b, dt, 0.0, 0.0, none, 1.0));
    assert_false(bst_track_bound_start(&b, none, none, dt, 0.0));
}

static double log_likelihood(double pd, double density, double x, const double (*z)[2], int n) {
    double sum = 1.0 - pd;
    for (int i = 0; i < n; i++) {
        double dx = z[i][0] - x, dy = z[i][1];
        sum += pd / (2.0 * BST_PI * density) * exp(-0.5 * (dx * dx + dy * dy));
    }
    return log(sum);
}

/* The same information from the curvature of the likelihood, with other draws. */
static double factor_by_curvature(double pd, double density) {
    bst_rng_key key = bst_rng_make_key(2, 0, "test", "curvature");
    enum { DRAWS = 100000 };
    double sum = 0.0;
    const double h = 1e-3, half = 7.0;
    for (uint64_t i = 0; i < DRAWS; i++) {
        double z[200][2];
        int n = 0;
        uint64_t draw = 0;
        if (bst_rng_uniform(key, i, draw++) < pd) {
            bst_rng_normal2(key, i, draw++, z[n++]);
        }
        for (double t = -log(bst_rng_uniform(key, i, draw++)); t < density * 4 * half * half;
             t -= log(bst_rng_uniform(key, i, draw++))) {
            z[n][0] = half * (2 * bst_rng_uniform(key, i, draw++) - 1);
            z[n++][1] = half * (2 * bst_rng_uniform(key, i, draw++) - 1);
        }
        sum -= (log_likelihood(pd, density, h, z, n) - 2 * log_likelihood(pd, density, 0, z, n) +
                log_likelihood(pd, density, -h, z, n)) /
               (h * h);
    }
    return sum / DRAWS;
}

static void information_left_in_clutter(void **state) {
    (void)state;
    bst_assert_close(bst_eval_information_factor(1.0, 0.0), 1.0, 0.0);
    bst_assert_close(bst_eval_information_factor(0.7, 0.0), 0.7, 0.0);
    bst_assert_close(bst_eval_information_factor(0.9, 1e-9), 0.9, 0.01); /* 3 sigma of 2e5 draws */
    const double cases[][2] = {{0.9, 0.003}, {0.9, 0.02}, {1.0, 0.05}, {0.6, 0.01}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        double a = bst_eval_information_factor(cases[i][0], cases[i][1]);
        double b = factor_by_curvature(cases[i][0], cases[i][1]);
        print_message("Pd %.1f, %.3f false alarms per sigma^2: factor %.4f, by curvature %.4f\n",
                      cases[i][0], cases[i][1], a, b);
        bst_assert_close(a, b, 0.02); /* 1 sigma of either is about 0.003 */
        assert_true(a < cases[i][0]);
    }
    double last = 0.9;
    for (double density = 0.01; density < 0.5; density *= 4) {
        double f = bst_eval_information_factor(0.9, density);
        assert_true(f < last);
        last = f;
    }
}

static void gospa_by_hand(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_gospa_result g;
    /* objects at 0 and 10, a track at 1: 1^2 + 4^2/2 */
    const double one[] = {1.0, 9.0};
    int pair[5];
    bst_assert_ok(&ctx, bst_gospa(&ctx, one, 2, 1, 4.0, 2.0, pair, &g));
    bst_assert_close(g.gospa, 3.0, 1e-15);
    bst_assert_close(g.localisation, 1.0, 1e-15);
    bst_assert_close(g.missed, 8.0, 1e-15);
    assert_int_equal(g.missed_count, 1);
    assert_int_equal(g.false_count, 0);
    assert_int_equal(pair[0], 0);
    assert_int_equal(pair[1], -1);
    /* farther than the cutoff: one missed and one false, c^p in all */
    const double far[] = {100.0};
    bst_assert_ok(&ctx, bst_gospa(&ctx, far, 1, 1, 5.0, 1.0, pair, &g));
    bst_assert_close(g.gospa, 5.0, 1e-15);
    assert_int_equal(g.missed_count, 1);
    assert_int_equal(g.false_count, 1);
    assert_int_equal(pair[0], -1);
    /* nothing, and nothing on one side: (n c^p / 2)^(1/p) */
    bst_assert_ok(&ctx, bst_gospa(&ctx, NULL, 0, 0, 5.0, 2.0, NULL, &g));
    bst_assert_close(g.gospa, 0.0, 0.0);
    bst_assert_ok(&ctx, bst_gospa(&ctx, NULL, 0, 3, 2.0, 2.0, NULL, &g));
    bst_assert_close(g.gospa, sqrt(6.0), 1e-15);
    /* the nearest pair first would leave 1 + 8; the best is 3 + 2 */
    const double crossed[] = {3.0, 1.0, 8.0, 2.0};
    bst_assert_ok(&ctx, bst_gospa(&ctx, crossed, 2, 2, 10.0, 1.0, pair, &g));
    bst_assert_close(g.gospa, 5.0, 1e-15);
    assert_int_equal(bst_gospa(&ctx, far, 1, 1, 0.0, 2.0, NULL, &g), BST_ERR_ARGUMENT);
    assert_int_equal(bst_gospa(&ctx, far, 1, 1, 1.0, 0.5, NULL, &g), BST_ERR_ARGUMENT);
    const double bad[] = {NAN};
    assert_int_equal(bst_gospa(&ctx, bad, 1, 1, 1.0, 2.0, NULL, &g), BST_ERR_ARGUMENT);
}

/* The least over all assignments, each object taking one of the free tracks or none. */
static double exhaustive(const double *d, int n, int m, double c, double p, int i, unsigned taken) {
    if (i == n) {
        int free_tracks = m;
        for (int j = 0; j < m; j++) {
            free_tracks -= (int)(taken >> j & 1u);
        }
        return 0.5 * pow(c, p) * free_tracks;
    }
    double best = 0.5 * pow(c, p) + exhaustive(d, n, m, c, p, i + 1, taken);
    for (int j = 0; j < m; j++) {
        if (!(taken >> j & 1u)) {
            best = fmin(best,
                        pow(d[i * m + j], p) + exhaustive(d, n, m, c, p, i + 1, taken | 1u << j));
        }
    }
    return best;
}

static void gospa_is_the_least_and_a_metric(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_rng_key key = bst_rng_make_key(3, 0, "test", "gospa");
    for (uint64_t t = 0; t < 500; t++) {
        uint64_t u = 0;
        int n[3];
        double set[3][5][2];
        for (int k = 0; k < 3; k++) {
            n[k] = (int)(6 * bst_rng_uniform(key, t, u++));
            for (int i = 0; i < n[k]; i++) {
                set[k][i][0] = 10 * bst_rng_uniform(key, t, u++);
                set[k][i][1] = 10 * bst_rng_uniform(key, t, u++);
            }
        }
        double c = 1 + 6 * bst_rng_uniform(key, t, u++), p = 1 + (double)(t % 3), g[3];
        for (int k = 0; k < 3; k++) {
            int a = k, b = (k + 1) % 3;
            double d[25];
            for (int i = 0; i < n[a]; i++) {
                for (int j = 0; j < n[b]; j++) {
                    d[i * n[b] + j] =
                        hypot(set[a][i][0] - set[b][j][0], set[a][i][1] - set[b][j][1]);
                }
            }
            bst_gospa_result out;
            bst_assert_ok(&ctx, bst_gospa(&ctx, d, n[a], n[b], c, p, NULL, &out));
            g[k] = out.gospa;
            double least = exhaustive(d, n[a], n[b], c, p, 0, 0);
            bst_assert_close(pow(out.gospa, p), least, 1e-9 * (1 + least)); /* roundings of pow */
        }
        /* the triangle of three sets */
        for (int k = 0; k < 3; k++) {
            assert_true(g[k] <= g[(k + 1) % 3] + g[(k + 2) % 3] + 1e-9);
        }
    }
}

/* Two objects over 11 frames of 360 s by hand: the first has track 1, then 3 after a gap of one
 * frame; the second is visible from frame 2 on and has track 2 from frame 4 on, which strays to the
 * first in the last frame; track 9 belongs to no object for 5 frames. */
static void track_metrics_by_hand(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_track_metrics *m;
    const double cutoff = 1e-4;
    bst_assert_ok(&ctx, bst_track_metrics_create(&ctx, 2, cutoff, &m));
    const bst_vec3 a = bst_vec3_from_radec(0.0, 0.0), b = bst_vec3_from_radec(0.1, 0.0),
                   far = bst_vec3_from_radec(0.2, 0.3), near_a = bst_vec3_from_radec(3e-5, 0.0);
    const bst_vec3 truth[2] = {a, b};
    const int64_t objects[2] = {0, 1};
    double gospa2 = 0.0;
    for (int k = 0; k < 11; k++) {
        int64_t ids[3];
        bst_vec3 d[3];
        int n = 0, missed = 0;
        if (k != 5 && k != 10) {
            ids[n] = k < 5 ? 1 : 3;
            d[n++] = near_a;
        }
        missed += k == 5;
        if (k >= 4) {
            ids[n] = 2;
            d[n++] = k == 10 ? near_a : b;
        }
        missed += (k >= 2 && k < 4) || k == 10;
        if (k < 5) {
            ids[n] = 9;
            d[n++] = far;
        }
        gospa2 += (k == 5 ? 0.0 : 9e-10) + 0.5 * cutoff * cutoff * (missed + (k < 5));
        const bst_track_frame frame = {360.0 * k, objects, truth, k >= 2 ? 2 : 1, ids, d, n};
        bst_assert_ok(&ctx, bst_track_metrics_frame(&ctx, m, &frame));
    }
    bst_track_figures f;
    bst_track_metrics_figures(m, &f);
    assert_int_equal(f.frames, 11);
    bst_assert_close(f.hours, 1.0, 1e-12);
    bst_assert_close(f.gospa_rms / sqrt(gospa2 / 11.0), 1.0, 1e-9); /* angles of 1e-5 hold 1e-11 */
    bst_assert_close(f.coverage, 16.0 / 20.0, 1e-15);               /* 10 of 11, 6 of 9 */
    bst_assert_close(f.time_to_confirm_s, 0.5 * (0.0 + 720.0), 1e-9);
    assert_int_equal(f.objects_seen, 2);
    assert_int_equal(f.objects_tracked, 2);
    assert_int_equal(f.breaks, 2);                  /* 1 to 3, 3 to 2 */
    bst_assert_close(f.purity, 15.0 / 16.0, 1e-15); /* track 2 was with the other one once */
    assert_int_equal(f.tracks, 4);
    assert_int_equal(f.false_tracks, 1);
    assert_int_equal(f.ghosts, 1); /* track 9, for five frames */
    bst_assert_close(f.false_tracks_per_hour, 1.0, 1e-12);
    const int64_t unknown = 2;
    const bst_track_frame wrong = {9e3, &unknown, truth, 1, NULL, NULL, 0};
    assert_int_equal(bst_track_metrics_frame(&ctx, m, &wrong), BST_ERR_ARGUMENT);
    bst_track_metrics_free(m);
}

/* Tracks of four objects, near them (N) or not (F): a ghost is alone for more than three frames in
 * a row, a false track in more than half of its frames. */
static void limits_of_ghosts_and_false_tracks(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    static const struct {
        const char *frames;
        int ghost, wrong;
    } track[4] = {{"NFFFNNNN", 0, 0}, {"NFFFFNNN", 1, 0}, {"FFFNFFFN", 0, 1}, {"NNFFNFFF", 0, 1}};
    const int64_t numbers[4] = {0, 1, 2, 3};
    for (int k = 0; k < 4; k++) { /* each alone, and all together */
        for (int all = 0; all < 2; all++) {
            bst_track_metrics *m;
            bst_track_figures f;
            int first = all ? 0 : k, end = all ? 4 : k + 1, ghosts = 0, wrong = 0;
            bst_assert_ok(&ctx, bst_track_metrics_create(&ctx, 4, 1e-4, &m));
            for (int n = 0; n < 8; n++) {
                bst_vec3 truth[4], at[4];
                for (int i = first; i < end; i++) {
                    truth[i] = bst_vec3_from_radec(0.1 * i, 0.0);
                    at[i] = bst_vec3_from_radec(0.1 * i, track[i].frames[n] == 'N' ? 0.0 : 0.1);
                }
                const bst_track_frame frame = {10.0 * n,    numbers + first, truth + first,
                                               end - first, numbers + first, at + first,
                                               end - first};
                bst_assert_ok(&ctx, bst_track_metrics_frame(&ctx, m, &frame));
            }
            for (int i = first; i < end; i++) {
                ghosts += track[i].ghost;
                wrong += track[i].wrong;
            }
            bst_track_metrics_figures(m, &f);
            assert_int_equal(f.ghosts, ghosts);
            assert_int_equal(f.false_tracks, wrong);
            bst_track_metrics_free(m);
        }
    }
}

/* Two correlated measurements of a place that moves evenly but for noise of acceleration: the
 * second is the place, their difference over dt the rate, whose variance has q dt^3 / 3 of the
 * first one's way back in it. */
static void bound_of_two_correlated_measurements(void **state) {
    (void)state;
    const double dt = 0.5, q = 3e-13;
    const double r1[3] = {4e-14, -1e-14, 1e-14}, r2[3] = {1e-14, 2e-14, 9e-14};
    const double sum[2][2] = {{5e-14, 1e-14}, {1e-14, 10e-14}}; /* r1 + r2 */
    const double second[2][2] = {{1e-14, 2e-14}, {2e-14, 9e-14}};
    bst_track_bound b;
    double p[4][4];
    assert_true(bst_track_bound_start(&b, r1, r2, dt, q));
    assert_true(bst_track_bound_covariance(&b, p));
    for (int i = 0; i < 2; i++) {
        for (int j = 0; j < 2; j++) {
            double noise = i == j ? q * dt * dt * dt / 3.0 : 0.0;
            /* two inversions of condition 100 */
            bst_assert_close(p[i][j] / second[i][j], 1.0, 1e-10);
            bst_assert_close(p[i][j + 2] / (second[i][j] / dt), 1.0, 1e-10);
            bst_assert_close(p[i + 2][j] / (second[i][j] / dt), 1.0, 1e-10);
            bst_assert_close(p[i + 2][j + 2] / ((sum[i][j] + noise) / (dt * dt)), 1.0, 1e-10);
        }
    }
}

/* out = f p f^T */
static void carried(const double f[4][4], const double p[4][4], double out[4][4]) {
    for (int i = 0; i < 4; i++) {
        for (int j = 0; j < 4; j++) {
            out[i][j] = 0.0;
            for (int k = 0; k < 4; k++) {
                for (int l = 0; l < 4; l++) {
                    out[i][j] += f[i][k] * p[k][l] * f[j][l];
                }
            }
        }
    }
}

/* A step from a full covariance along a great circle. Along it the deviation x obeys x'' = 0,
 * across it x'' = -w^2 x: the transition by the exponential series of [[0, 1], [-w^2, 0]] dt. The
 * update by Kalman's formula for the covariance, of the noise of which `factor` is the
 * information's share. */
static void bound_of_a_step_with_everything(void **state) {
    (void)state;
    const double dt = 2.0, w = 0.4, q = 2e-15, factor = 0.6;
    const double r1[3] = {4e-14, -1e-14, 1e-14}, r2[3] = {1e-14, 2e-14, 9e-14};
    const double r[3] = {3e-14, 1e-14, 1e-14};
    bst_track_bound b;
    double was[4][4], got[4][4], p[4][4], f[4][4] = {{0}}, rate[2] = {0.0, w};
    assert_true(bst_track_bound_start(&b, r1, r2, 1.0, 0.0));
    assert_true(bst_track_bound_covariance(&b, was));
    for (int axis = 0; axis < 2; axis++) {
        double a[2][2] = {{0.0, dt}, {-rate[axis] * rate[axis] * dt, 0.0}};
        double term[2][2] = {{1, 0}, {0, 1}}, sum[2][2] = {{1, 0}, {0, 1}};
        for (int n = 1; n <= 30; n++) { /* 0.8^30 / 30! is nothing */
            double next[2][2];
            for (int i = 0; i < 2; i++) {
                for (int j = 0; j < 2; j++) {
                    next[i][j] = (term[i][0] * a[0][j] + term[i][1] * a[1][j]) / n;
                    sum[i][j] += next[i][j];
                }
            }
            memcpy(term, next, sizeof term);
        }
        for (int i = 0; i < 2; i++) {
            for (int j = 0; j < 2; j++) {
                f[axis + 2 * i][axis + 2 * j] = sum[i][j];
            }
        }
    }
    carried((const double(*)[4])f, (const double(*)[4])was, p);
    for (int i = 0; i < 2; i++) {
        p[i][i] += q * dt * dt * dt / 3.0;
        p[i][i + 2] += q * dt * dt / 2.0;
        p[i + 2][i] += q * dt * dt / 2.0;
        p[i + 2][i + 2] += q * dt;
    }
    double s[3] = {p[0][0] + r[0] / factor, p[0][1] + r[1] / factor, p[1][1] + r[2] / factor};
    double det = s[0] * s[2] - s[1] * s[1];
    double inverse[2][2] = {{s[2] / det, -s[1] / det}, {-s[1] / det, s[0] / det}};
    assert_true(bst_track_bound_step(&b, dt, w, q, r, factor));
    for (int i = 0; i < 4; i++) {
        for (int j = 0; j < i; j++) {
            assert_true(b.information[i][j] == b.information[j][i]);
        }
    }
    assert_true(bst_track_bound_covariance(&b, got));
    for (int i = 0; i < 4; i++) {
        for (int j = 0; j < 4; j++) {
            double want = p[i][j];
            for (int k = 0; k < 2; k++) {
                for (int l = 0; l < 2; l++) {
                    want -= p[i][k] * inverse[k][l] * p[l][j];
                }
            }
            /* inversions of condition 1e3 */
            bst_assert_close(got[i][j], want, 1e-10 * sqrt(p[i][i] * p[j][j]));
        }
    }
}

/* Steps with fewer runs have bounds of their own. chi-square of two degrees of freedom: -2
 * ln(0.975) = 0.0506 and -2 ln(0.025) = 7.378; of four: 0.484 and 11.143 (Abramowitz and
 * Stegun, 26.8). */
static void fewer_runs_have_wider_bounds(void **state) {
    (void)state;
    enum { RUNS = 2, STEPS = 6 };
    const double values[RUNS * STEPS] = {0.3, 8.0,         2.0, 6.0, 0.2, NAN, /* first run */
                                         NAN, (double)NAN, 1.0, 2.0, 0.2, NAN};
    bst_consistency c;
    bst_consistency_check(values, RUNS, STEPS, 2, 0.95, &c);
    assert_int_equal(c.runs, 2);
    assert_int_equal(c.steps, 6);
    assert_int_equal(c.steps_judged, 5);
    bst_assert_close(c.inside, 3.0 / 5.0, 1e-15); /* 0.3 of two, 3 and 8 of four */
    bst_assert_close(c.above, 1.0 / 5.0, 1e-15);  /* 8 of two */
    bst_assert_close(c.below, 1.0 / 5.0, 1e-15);  /* 0.4 of four */
    bst_assert_close(c.mean_over_dof, (0.3 + 8.0 + 3.0 + 8.0 + 0.4) / 8.0 / 2.0, 1e-15);
}

/* A track is false when it is with an object in less than half of its frames. */
static void half_of_its_frames_make_a_track_true(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_track_metrics *m;
    bst_assert_ok(&ctx, bst_track_metrics_create(&ctx, 1, 1e-4, &m));
    const bst_vec3 truth = bst_vec3_from_radec(0.0, 0.0), far = bst_vec3_from_radec(0.2, 0.3);
    const int64_t object = 0;
    /* of six frames, track 1 has the object in two, 2 in three: 1 is false */
    for (int k = 0; k < 6; k++) {
        const int64_t ids[2] = {1, 2};
        const bst_vec3 d[2] = {k < 2 ? truth : far, k >= 3 ? truth : far};
        const bst_track_frame frame = {k, &object, &truth, 1, ids, d, 2};
        bst_assert_ok(&ctx, bst_track_metrics_frame(&ctx, m, &frame));
    }
    bst_track_figures f;
    bst_track_metrics_figures(m, &f);
    assert_int_equal(f.tracks, 2);
    assert_int_equal(f.false_tracks, 1);
    bst_track_metrics_free(m);
}

/* A window of two frames. An object at 0.2 from its track, whose identity changes in the second
 * frame: each identity has 0.2 in one frame and the cutoff 1 in the other, and one of the two has
 * no object: (0.6 + 1)/2. A third frame without the first identity has 0.2 again; one without a
 * track (0.2 + 1)/2. */
static void ospa2_by_hand(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_ospa2 *ospa2;
    const bst_ospa2_params params = {2, 1.0, 1.0}, empty = {0, 1.0, 1.0};
    bst_assert_ok(&ctx, bst_ospa2_create(&ctx, &params, &ospa2));
    const double expected[4] = {0.2, 0.8, 0.2, 0.6};
    const bst_gospa_pair pair = {0, 0, 0.2};
    const int tracks[4] = {1, 1, 1, 0};
    const int64_t object = 7, ids[4] = {1, 2, 2, 0};
    for (int k = 0; k < 4; k++) {
        double value;
        const bst_ospa2_input frame = {&object, 1, &ids[k], tracks[k], &pair, tracks[k]};
        bst_assert_ok(&ctx, bst_ospa2_frame(&ctx, ospa2, &frame, &value));
        bst_assert_close(value, expected[k], 1e-15);
    }
    bst_ospa2_free(ospa2);
    assert_int_equal(bst_ospa2_create(&ctx, &empty, &ospa2), BST_ERR_ARGUMENT);
}

/* Distances that change from frame to frame: each frame of the window has its own, also where the
 * window has gone round several times. One object and one track, which meets it in two of three
 * frames. */
static void ospa2_of_changing_distances(void **state) {
    (void)state;
    enum { FRAMES = 23, WINDOW = 5 };
    bst_ctx ctx = {0};
    bst_ospa2 *ospa2;
    const bst_ospa2_params params = {WINDOW, 1.0, 2.0};
    bst_assert_ok(&ctx, bst_ospa2_create(&ctx, &params, &ospa2));
    const int64_t object = 7, track = 4;
    double distance[FRAMES];
    for (int k = 0; k < FRAMES; k++) {
        double value, sum = 0.0;
        int frames = k + 1 < WINDOW ? k + 1 : WINDOW;
        distance[k] = k % 3 == 2 ? 1.0 : 0.03 * k; /* 1: the cutoff */
        const bst_gospa_pair pair = {0, 0, distance[k]};
        const bst_ospa2_input frame = {&object, 1, &track, 1, &pair, k % 3 == 2 ? 0 : 1};
        bst_assert_ok(&ctx, bst_ospa2_frame(&ctx, ospa2, &frame, &value));
        for (int n = k; n > k - frames; n--) {
            sum += distance[n];
        }
        bst_assert_close(value, sum / frames, 1e-14); /* rounding of five terms */
    }
    bst_ospa2_free(ospa2);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(ospa2_by_hand),
                                       cmocka_unit_test(ospa2_of_changing_distances),
                                       cmocka_unit_test(bound_of_two_correlated_measurements),
                                       cmocka_unit_test(bound_of_a_step_with_everything),
                                       cmocka_unit_test(fewer_runs_have_wider_bounds),
                                       cmocka_unit_test(half_of_its_frames_make_a_track_true),
                                       cmocka_unit_test(quantiles_of_the_tables),
                                       cmocka_unit_test(true_covariances_are_inside),
                                       cmocka_unit_test(bound_of_a_straight_line),
                                       cmocka_unit_test(information_left_in_clutter),
                                       cmocka_unit_test(gospa_by_hand),
                                       cmocka_unit_test(gospa_is_the_least_and_a_metric),
                                       cmocka_unit_test(track_metrics_by_hand),
                                       cmocka_unit_test(limits_of_ghosts_and_false_tracks)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
