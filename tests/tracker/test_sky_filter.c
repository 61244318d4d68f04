/* The filter on the sphere: motion, covariance, consistency, and the places where angles fail. */
#include "boresight/rng.h"
#include "tests/test_support.h"
#include "tracker/mtt/sky_filter.h"

#define AS BST_ARCSEC_RAD

static void cholesky(const double p[4][4], double l[4][4]) {
    memset(l, 0, 16 * sizeof(double));
    for (int i = 0; i < 4; i++) {
        for (int j = 0; j <= i; j++) {
            double v = p[i][j];
            for (int k = 0; k < j; k++) {
                v -= l[i][k] * l[j][k];
            }
            l[i][j] = i == j ? sqrt(fmax(v, 0.0)) : (l[j][j] > 0 ? v / l[j][j] : 0.0);
        }
    }
}

/* A state drawn about `mean` with its covariance. */
static bst_sky_state draw(const bst_sky_state *mean, bst_rng_key key, uint64_t a, uint64_t b) {
    double l[4][4], x[4] = {0}, n[4];
    cholesky(mean->covariance, l);
    bst_rng_normal2(key, a, 2 * b, n);
    bst_rng_normal2(key, a, 2 * b + 1, n + 2);
    for (int i = 0; i < 4; i++) {
        for (int j = 0; j <= i; j++) {
            x[i] += l[i][j] * n[j];
        }
    }
    bst_tangent axes = bst_tangent_at(mean->direction);
    bst_sky_state out = {.direction = mean->direction, .rate_radps = mean->rate_radps};
    bst_sky_shift(&out, bst_tangent_vector(&axes, x[0], x[1]),
                  bst_tangent_vector(&axes, x[2], x[3]));
    return out;
}

/* Mean and covariance of x^T P^-1 x over draws that were moved by closed-form rotation; 4 when the
 * predicted covariance is right. */
static double transported_distance(bst_sky_state start, double dt, uint64_t seed) {
    enum { DRAWS = 2000 };
    bst_rng_key key = bst_rng_make_key(seed, 0, "test", "transport");
    bst_sky_state predicted = start;
    bst_sky_predict(&predicted, dt, 0.0);
    double sum = 0.0;
    for (uint64_t i = 0; i < DRAWS; i++) {
        bst_sky_state s = draw(&start, key, i, 0);
        /* a great circle is a turn about d x r: independent of bst_sky_predict */
        bst_quat q =
            bst_quat_from_rotvec(bst_vec3_scale(bst_vec3_cross(s.direction, s.rate_radps), dt));
        bst_sky_state moved = {.direction = bst_quat_rotate(q, s.direction),
                               .rate_radps = bst_quat_rotate(q, s.rate_radps)};
        sum += bst_sky_distance2(&predicted, &moved);
    }
    return sum / DRAWS;
}

static bst_sky_state make(double ra_deg, double dec_deg, double rate_radps, double heading_rad) {
    bst_sky_state s = {.direction =
                           bst_vec3_from_radec(ra_deg * BST_DEG_RAD, dec_deg * BST_DEG_RAD)};
    bst_tangent axes = bst_tangent_at(s.direction);
    s.rate_radps =
        bst_tangent_vector(&axes, rate_radps * cos(heading_rad), rate_radps * sin(heading_rad));
    const double p[4][4] = {
        {4, 1, 0.5, 0}, {1, 3, 0, -0.4}, {0.5, 0, 0.2, 0.05}, {0, -0.4, 0.05, 0.3}};
    for (int i = 0; i < 4; i++) {
        for (int j = 0; j < 4; j++) {
            s.covariance[i][j] = p[i][j] * AS * AS;
        }
    }
    return s;
}

static void motion_is_a_great_circle(void **state) {
    (void)state;
    const double rates[] = {0.0, 1e-12, 50 * AS, 5 * BST_DEG_RAD};
    const double decs[] = {0.0, -60.0, 89.9999999, 90.0, -90.0};
    for (int r = 0; r < 4; r++) {
        for (int k = 0; k < 5; k++) {
            for (int h = 0; h < 8; h++) {
                bst_sky_state s = make(359.999, decs[k], rates[r], h * BST_PI / 4);
                bst_quat q = bst_quat_from_rotvec(
                    bst_vec3_scale(bst_vec3_cross(s.direction, s.rate_radps), 30.0));
                bst_vec3 d = bst_quat_rotate(q, s.direction), v = bst_quat_rotate(q, s.rate_radps);
                bst_sky_predict(&s, 30.0, 0.0);
                /* a few roundings of numbers of size 1 */
                bst_assert_close(bst_vec3_norm(bst_vec3_sub(s.direction, d)), 0.0, 2e-15);
                bst_assert_close(bst_vec3_norm(bst_vec3_sub(s.rate_radps, v)), 0.0, 1e-15);
                bst_assert_close(bst_vec3_dot(s.direction, s.rate_radps), 0.0, 1e-16);
            }
        }
    }
}

static void covariance_moves_with_the_state(void **state) {
    (void)state;
    const double hour = 3600.0;
    const struct {
        bst_sky_state start;
        double dt;
    } cases[] = {
        {make(10, 20, 50 * AS, 0.7), 1.0},
        {make(10, 20, 0.0, 0.0), 10.0},
        {make(359.9, 0, 5 * BST_DEG_RAD, 0.0), 10.0},       /* RA wrap, half a radian */
        {make(40, 89.99, 50 * AS, 1.4), 2.0},               /* past the pole */
        {make(40, 80, 5 * BST_DEG_RAD, 1.5707), 4.0},       /* over the pole */
        {make(0, 90, 5 * BST_DEG_RAD, 0.3), 3.0},           /* from the pole */
        {make(200, -89.9999, 1 * BST_DEG_RAD, -1.57), 1.0}, /* over the south pole */
        {make(100, 30, 50 * AS, 2.0), hour},                /* 50 degrees away */
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        bst_sky_state start = cases[i].start;
        if (cases[i].dt == hour) {
            /* known 100 times better, so that an hour later the motion is still linear in it */
            for (int j = 0; j < 16; j++) {
                start.covariance[j / 4][j % 4] *= 1e-4;
            }
        }
        /* mean of 2000 chi-square(4): 1 sigma 0.063 */
        bst_assert_close(transported_distance(start, cases[i].dt, i), 4.0, 0.25);
    }
}

static void there_and_back(void **state) {
    (void)state;
    bst_sky_state s = make(123, 89.5, 2 * BST_DEG_RAD, 1.2), start = s;
    bst_sky_predict(&s, 7.0, 0.0);
    bst_sky_predict(&s, -7.0, 0.0);
    bst_assert_close(bst_vec3_norm(bst_vec3_sub(s.direction, start.direction)), 0.0, 1e-15);
    for (int i = 0; i < 4; i++) {
        for (int j = 0; j < 4; j++) {
            /* relative to the largest element on the way (dt^2 P_rr): 1e-15 */
            bst_assert_close(s.covariance[i][j] / (AS * AS), start.covariance[i][j] / (AS * AS),
                             1e-12);
        }
    }
}

typedef struct consistency {
    double nees, nis; /* means per degree of freedom */
    double inside;    /* fraction of steps whose ensemble NEES lies in its 95 % bounds */
} consistency;

static consistency monte_carlo(double dec_deg, double rate_radps, double gap_every_s) {
    enum { RUNS = 250, STEPS = 40 };
    const double q = pow(0.05 * AS, 2), sigma = 0.3 * AS;
    bst_rng_key key = bst_rng_make_key(7, 0, "test", "nees");
    double nees[STEPS] = {0};
    consistency c = {0};
    int updates = 0;
    for (uint64_t run = 0; run < RUNS; run++) {
        bst_sky_state truth = make(359.99, dec_deg, rate_radps, 0.4 + (double)run), estimate;
        memset(truth.covariance, 0, sizeof truth.covariance);
        bst_sky_measurement last = {.cov_11 = 0.0};
        for (int k = 0; k < STEPS; k++) {
            double dt = gap_every_s > 0.0 && k % 10 == 9 ? gap_every_s : 1.0;
            bst_sky_state moved = truth;
            memset(moved.covariance, 0, sizeof moved.covariance);
            bst_sky_predict(&moved, dt, q); /* its covariance is now that of the noise */
            truth = draw(&moved, key, run, (uint64_t)k);
            double n[2], u = bst_rng_uniform(key, run, 1000 + (uint64_t)k);
            bst_rng_normal2(key, run, 2000 + (uint64_t)k, n);
            /* uneven, tilted measurement noise */
            double s1 = sigma, s2 = sigma * (0.5 + u), co = cos(6.0 * u), si = sin(6.0 * u);
            bst_tangent axes = bst_tangent_at(truth.direction);
            double a = co * s1 * n[0] - si * s2 * n[1], b = si * s1 * n[0] + co * s2 * n[1];
            bst_sky_measurement z = {
                .direction = bst_tangent_exp(truth.direction, bst_tangent_vector(&axes, a, b)),
                .cov_11 = co * co * s1 * s1 + si * si * s2 * s2,
                .cov_12 = co * si * (s1 * s1 - s2 * s2),
                .cov_22 = si * si * s1 * s1 + co * co * s2 * s2};
            if (k == 1) {
                bst_sky_from_pair(&last, &z, dt, q, &estimate);
            } else if (k > 1) {
                bst_sky_innovation innovation;
                bst_sky_predict(&estimate, dt, q);
                assert_true(bst_sky_innovate(&estimate, &z, NULL, &innovation));
                c.nis += innovation.chi2;
                updates++;
                bst_sky_update(&estimate, &innovation);
            }
            if (k >= 1) {
                bst_sky_state exact = truth;
                memset(exact.covariance, 0, sizeof exact.covariance);
                nees[k] += bst_sky_distance2(&estimate, &exact);
            }
            last = z;
        }
    }
    for (int k = 1; k < STEPS; k++) {
        double mean = nees[k] / RUNS;
        c.nees += mean / 4.0 / (STEPS - 1);
        /* 95 % of the mean of 250 chi-square(4): +- 1.96 sqrt(8 / 250) */
        c.inside += (fabs(mean - 4.0) < 1.96 * sqrt(8.0 / RUNS)) / (double)(STEPS - 1);
    }
    c.nis /= 2.0 * updates;
    return c;
}

static void estimates_are_consistent(void **state) {
    (void)state;
    const double cases[][3] = {{10, 50 * AS, 0},
                               {0, 0, 0},
                               {89.999, 50 * AS, 0},
                               {40, 5 * BST_DEG_RAD, 0},
                               {-30, 50 * AS, 3600}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        consistency c = monte_carlo(cases[i][0], cases[i][1], cases[i][2]);
        print_message(
            "dec %g deg rate %g arcsec/s gap %g s: NEES/4 %.3f, NIS/2 %.3f, inside %.2f\n",
            cases[i][0], cases[i][1] / AS, cases[i][2], c.nees, c.nis, c.inside);
        /* measures.md: 0.9 to 1.1; 1 sigma here is about 0.02 */
        bst_assert_close(c.nees, 1.0, 0.1);
        bst_assert_close(c.nis, 1.0, 0.1);
        assert_true(c.inside >= 0.85); /* 0.95 expected; steps of one run are correlated */
    }
}

/* Smallest eigenvalue of P scaled to unit diagonal, by bisection of a shifted Cholesky. */
static bool is_psd(const double p[4][4]) {
    double l[4][4];
    for (int i = 0; i < 4; i++) {
        if (!(p[i][i] > 0.0)) {
            return false;
        }
        for (int j = 0; j <= i; j++) {
            double v = p[i][j] / sqrt(p[i][i] * p[j][j]) + (i == j ? 1e-9 : 0.0);
            for (int k = 0; k < j; k++) {
                v -= l[i][k] * l[j][k];
            }
            if (i == j && !(v > 0.0)) {
                return false;
            }
            l[i][j] = i == j ? sqrt(v) : v / l[j][j];
        }
    }
    return true;
}

static void a_million_ill_conditioned_updates(void **state) {
    (void)state;
    bst_rng_key key = bst_rng_make_key(3, 0, "test", "psd");
    bst_sky_state s = make(10, 89.9, 50 * AS, 0.3);
    for (uint64_t k = 0; k < 1000000; k++) {
        /* precise in one axis, worthless in the other, the axes turning; gaps now and then */
        double angle = 0.1 * (double)k, c = cos(angle), si = sin(angle);
        double good = pow(1e-3 * AS, 2), bad = pow(1e3 * AS, 2);
        double n = bst_rng_normal(key, k, 0);
        bst_sky_predict(&s, k % 1000 == 999 ? 600.0 : 0.01, pow(1e-3 * AS, 2));
        bst_tangent axes = bst_tangent_at(s.direction);
        bst_sky_measurement z = {
            .direction = bst_tangent_exp(
                s.direction, bst_tangent_vector(&axes, 1e-3 * AS * n * c, 1e-3 * AS * n * si)),
            .cov_11 = c * c * good + si * si * bad,
            .cov_12 = c * si * (good - bad),
            .cov_22 = si * si * good + c * c * bad};
        bst_sky_innovation innovation;
        if (bst_sky_innovate(&s, &z, NULL, &innovation)) {
            bst_sky_update(&s, &innovation);
        }
        if (k % 97 == 0 || k % 1000 < 2) {
            assert_true(is_psd(s.covariance));
            for (int i = 0; i < 4; i++) {
                for (int j = 0; j < 4; j++) {
                    assert_true(s.covariance[i][j] == s.covariance[j][i]);
                }
            }
        }
    }
    bst_assert_close(bst_vec3_norm(s.direction), 1.0, 1e-15);
    bst_assert_close(bst_vec3_dot(s.direction, s.rate_radps), 0.0, 1e-18);
}

static void invert(double a[4][4], double out[4][4]) {
    /* Gauss-Jordan without pivots: the matrices here are positive definite */
    for (int i = 0; i < 4; i++) {
        for (int j = 0; j < 4; j++) {
            out[i][j] = i == j;
        }
    }
    for (int k = 0; k < 4; k++) {
        double pivot = a[k][k];
        for (int j = 0; j < 4; j++) {
            a[k][j] /= pivot;
            out[k][j] /= pivot;
        }
        for (int i = 0; i < 4; i++) {
            double factor = a[i][k];
            for (int j = 0; i != k && j < 4; j++) {
                a[i][j] -= factor * a[k][j];
                out[i][j] -= factor * out[k][j];
            }
        }
    }
}

/* Covariance of a vector in space that a 2x2 covariance in the axes at a direction stands for. */
static void tensor_of(bst_vec3 direction, const double c[3], double out[3][3]) {
    bst_tangent axes = bst_tangent_at(direction);
    const double e[2][3] = {{axes.e1.x, axes.e1.y, axes.e1.z}, {axes.e2.x, axes.e2.y, axes.e2.z}};
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            out[i][j] = c[0] * e[0][i] * e[0][j] + c[2] * e[1][i] * e[1][j] +
                        c[1] * (e[0][i] * e[1][j] + e[1][i] * e[0][j]);
        }
    }
}

/* The same covariance in the axes at another direction, 11, 12, 22. */
static void in_axes_at(bst_vec3 direction, const double tensor[3][3], double out[3]) {
    bst_tangent axes = bst_tangent_at(direction);
    const double e[2][3] = {{axes.e1.x, axes.e1.y, axes.e1.z}, {axes.e2.x, axes.e2.y, axes.e2.z}};
    for (int k = 0; k < 3; k++) {
        const double *a = e[k == 2], *b = e[k > 0];
        out[k] = 0.0;
        for (int i = 0; i < 3; i++) {
            for (int j = 0; j < 3; j++) {
                out[k] += a[i] * tensor[i][j] * b[j];
            }
        }
    }
}

/* White acceleration of density q: P(t) = q [[t^3/3, t^2/2], [t^2/2, t]] on each axis (Bar-Shalom,
 * Li, Kirubarajan 2001, section 6.2.2). Back in time position and rate are correlated the other
 * way. */
static void noise_is_that_of_white_acceleration(void **state) {
    (void)state;
    const double q = 3.0 * AS * AS, steps[] = {0.5, 2.0, -2.0};
    for (int k = 0; k < 3; k++) {
        double dt = steps[k], t = fabs(dt);
        bst_sky_state s = make(50, 35, 0.0, 0.0);
        memset(s.covariance, 0, sizeof s.covariance);
        bst_sky_predict(&s, dt, q);
        for (int i = 0; i < 4; i++) {
            for (int j = 0; j < 4; j++) {
                double expected = i % 2 != j % 2   ? 0.0
                                  : i / 2 != j / 2 ? q * t * dt / 2.0
                                  : i < 2          ? q * t * t * t / 3.0
                                                   : q * t;
                bst_assert_close(s.covariance[i][j] / q, expected / q, 1e-12); /* rounding */
            }
        }
    }
    /* two steps are one, also along a curved path with an uneven prior */
    bst_sky_state one = make(50, 35, 50 * AS, 0.7), two = one;
    bst_sky_predict(&one, 3.0, q);
    bst_sky_predict(&two, 1.2, q);
    bst_sky_predict(&two, 1.8, q);
    for (int i = 0; i < 4; i++) {
        for (int j = 0; j < 4; j++) {
            /* the curvature over 150 arcsec acts on the noise: relative (150 arcsec)^2 */
            bst_assert_close(two.covariance[i][j] / (AS * AS), one.covariance[i][j] / (AS * AS),
                             1e-5);
        }
    }
}

/* Near the pole the axes of two directions 20 arcsec apart differ by tens of degrees. */
static void innovations_are_seen_in_the_axes_of_the_state(void **state) {
    (void)state;
    const double decs[] = {10.0, 89.99, -89.995};
    for (int k = 0; k < 3; k++) {
        bst_sky_state s = make(20, decs[k], 0.0, 0.0);
        bst_tangent axes = bst_tangent_at(s.direction);
        const double step[2] = {14 * AS, -9 * AS}, cov[3] = {5 * AS * AS, 2 * AS * AS, 3 * AS * AS};
        const double extra[3] = {0.5 * AS * AS, -0.25 * AS * AS, 0.75 * AS * AS};
        bst_sky_measurement z = {
            .direction = bst_tangent_exp(s.direction, bst_tangent_vector(&axes, step[0], step[1])),
            .cov_11 = cov[0],
            .cov_12 = cov[1],
            .cov_22 = cov[2]};
        double tensor[3][3], r[3];
        tensor_of(z.direction, cov, tensor);
        in_axes_at(s.direction, tensor, r);
        bst_sky_innovation innovation;
        assert_true(bst_sky_innovate(&s, &z, extra, &innovation));
        double expected[3];
        for (int i = 0; i < 3; i++) {
            expected[i] = r[i] + extra[i];
            /* projection shortens by the square of 20 arcsec; rounding of 1 in 1e-5 */
            bst_assert_close(innovation.r[i] / (AS * AS), expected[i] / (AS * AS), 1e-6);
            expected[i] += s.covariance[i == 2][i > 0];
            bst_assert_close(innovation.s[i] / (AS * AS), expected[i] / (AS * AS), 1e-6);
        }
        bst_assert_close(innovation.nu[0] / AS, step[0] / AS, 1e-7);
        bst_assert_close(innovation.nu[1] / AS, step[1] / AS, 1e-7);
        double det = expected[0] * expected[2] - expected[1] * expected[1];
        double chi2 = (expected[2] * step[0] * step[0] - 2 * expected[1] * step[0] * step[1] +
                       expected[0] * step[1] * step[1]) /
                      det;
        bst_assert_close(innovation.chi2, chi2, 1e-5 * chi2);
        bst_assert_close(innovation.log_det_s, log(det), 1e-5);
    }
}

/* P+ = (P^-1 + H^T R^-1 H)^-1, x+ = P+ H^T R^-1 z: the information form of the same update. */
static void an_update_is_that_of_the_information_form(void **state) {
    (void)state;
    bst_sky_state s = make(20, 10, 0.0, 0.0), prior = s;
    bst_tangent axes = bst_tangent_at(s.direction);
    const double z[2] = {1.5 * AS, -2.5 * AS}, r[3] = {2 * AS * AS, 0.7 * AS * AS, 1 * AS * AS};
    bst_sky_measurement measured = {
        .direction = bst_tangent_exp(s.direction, bst_tangent_vector(&axes, z[0], z[1])),
        .cov_11 = r[0],
        .cov_12 = r[1],
        .cov_22 = r[2]};
    bst_sky_innovation innovation;
    assert_true(bst_sky_innovate(&s, &measured, NULL, &innovation));
    bst_sky_update(&s, &innovation);
    double p[4][4], information[4][4], expected[4][4], det = r[0] * r[2] - r[1] * r[1];
    const double w[2][2] = {{r[2] / det, -r[1] / det}, {-r[1] / det, r[0] / det}};
    memcpy(p, prior.covariance, sizeof p);
    invert(p, information);
    for (int i = 0; i < 2; i++) {
        for (int j = 0; j < 2; j++) {
            information[i][j] += w[i][j];
        }
    }
    invert(information, expected);
    double mean[4];
    for (int i = 0; i < 4; i++) {
        mean[i] = 0.0;
        for (int j = 0; j < 2; j++) {
            mean[i] += expected[i][j] * (w[j][0] * z[0] + w[j][1] * z[1]);
        }
    }
    bst_vec3 moved = bst_tangent_log(prior.direction, s.direction);
    bst_vec3 rate = bst_tangent_carry(s.direction, prior.direction, s.rate_radps);
    /* axes at 10 degrees turn by 3 arcsec x tan(10 degrees): 3e-6 */
    bst_assert_close(bst_vec3_dot(moved, axes.e1) / AS, mean[0] / AS, 1e-5);
    bst_assert_close(bst_vec3_dot(moved, axes.e2) / AS, mean[1] / AS, 1e-5);
    bst_assert_close(bst_vec3_dot(rate, axes.e1) / AS, mean[2] / AS, 1e-5);
    bst_assert_close(bst_vec3_dot(rate, axes.e2) / AS, mean[3] / AS, 1e-5);
    for (int i = 0; i < 4; i++) {
        for (int j = 0; j < 4; j++) {
            bst_assert_close(s.covariance[i][j] / (AS * AS), expected[i][j] / (AS * AS), 2e-5);
        }
    }
}

/* Position of the second, rate (second - first) / dt: covariances B, B / dt, (A + B) / dt^2, and
 * what white acceleration adds to a mean rate, q dt / 3. */
static void a_pair_has_the_covariance_of_its_differences(void **state) {
    (void)state;
    const double dt = 4.0, q = 0.02 * AS * AS, a[3] = {5 * AS * AS, -2 * AS * AS, 3 * AS * AS},
                 b[3] = {2 * AS * AS, 0.5 * AS * AS, 4 * AS * AS};
    bst_vec3 second = bst_vec3_from_radec(0.3, 89.99 * BST_DEG_RAD);
    bst_tangent axes = bst_tangent_at(second);
    bst_vec3 first = bst_tangent_exp(second, bst_tangent_vector(&axes, -12 * AS, 20 * AS));
    bst_sky_measurement one = {first, a[0], a[1], a[2]}, two = {second, b[0], b[1], b[2]};
    bst_sky_state s;
    bst_sky_from_pair(&one, &two, dt, q, &s);
    bst_assert_close(bst_vec3_dot(s.rate_radps, axes.e1) / AS, 3.0, 1e-6);
    bst_assert_close(bst_vec3_dot(s.rate_radps, axes.e2) / AS, -5.0, 1e-6);
    double tensor[3][3], turned[3];
    tensor_of(first, a, tensor);
    in_axes_at(second, tensor, turned);
    for (int i = 0; i < 2; i++) {
        for (int j = 0; j < 2; j++) {
            double noise = i == j ? q * dt / 3.0 : 0.0;
            bst_assert_close(s.covariance[i][j] / (AS * AS), b[i + j] / (AS * AS), 1e-12);
            bst_assert_close(s.covariance[i][j + 2] / (AS * AS), b[i + j] / dt / (AS * AS), 1e-12);
            bst_assert_close(s.covariance[i + 2][j] / (AS * AS), b[i + j] / dt / (AS * AS), 1e-12);
            bst_assert_close(s.covariance[i + 2][j + 2] / (AS * AS),
                             ((turned[i + j] + b[i + j]) / (dt * dt) + noise) / (AS * AS), 1e-6);
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(motion_is_a_great_circle),
        cmocka_unit_test(covariance_moves_with_the_state),
        cmocka_unit_test(there_and_back),
        cmocka_unit_test(noise_is_that_of_white_acceleration),
        cmocka_unit_test(innovations_are_seen_in_the_axes_of_the_state),
        cmocka_unit_test(an_update_is_that_of_the_information_form),
        cmocka_unit_test(a_pair_has_the_covariance_of_its_differences),
        cmocka_unit_test(estimates_are_consistent),
        cmocka_unit_test(a_million_ill_conditioned_updates)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
