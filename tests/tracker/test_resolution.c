/* The model of the resolution against sums over a grid, Bayes' rule, and 3-D tensors: tracks with
 * slanting, unequal covariances, half a degree apart at declination 80 degrees, where the tangent
 * axes of one are turned against those of the other. */
#include "tests/test_support.h"
#include "tracker/mtt/resolution.h"
#include "tracker/orbit/orbit_track.h"

#define MAS (1e-3 * BST_DEG_RAD)
#define MERGE_RAD (900 * MAS)

/* Components of covariance [11, 12, 22] from the axes at one direction in those at another one, by
 * projection: right to the square of the angle between them. */
static void seen_at(bst_vec3 from, const double c[3], bst_vec3 to, double out[3]) {
    bst_tangent a = bst_tangent_at(from), b = bst_tangent_at(to);
    const bst_vec3 old[2] = {a.e1, a.e2}, new[2] = {b.e1, b.e2};
    for (int i = 0; i < 3; i++) {
        out[i] = 0.0;
        for (int k = 0; k < 2; k++) {
            for (int l = 0; l < 2; l++) {
                out[i] += bst_vec3_dot(new[i / 2], old[k]) *
                          bst_vec3_dot(new[(i + 1) / 2], old[l]) * c[k + l];
            }
        }
    }
}

static bst_mtt_track track(bst_vec3 at, double s1, double s2, double correlation, double v_mag,
                           double existence) {
    bst_mtt_track t = {.v_mag = v_mag, .v_mag_variance = 0.04, .existence = existence};
    t.state.direction = at;
    t.state.covariance[0][0] = s1 * s1;
    t.state.covariance[1][1] = s2 * s2;
    t.state.covariance[0][1] = t.state.covariance[1][0] = correlation * s1 * s2;
    t.state.covariance[2][2] = t.state.covariance[3][3] = 1e-14;
    return t;
}

static bst_vec3 beside(bst_vec3 at, double x, double y) {
    bst_tangent axes = bst_tangent_at(at);
    return bst_tangent_exp(at, bst_tangent_vector(&axes, x, y));
}

/* Offset of b from a in the axes at a, by projection. */
static void offset(bst_vec3 a, bst_vec3 b, double out[2]) {
    bst_tangent axes = bst_tangent_at(a);
    out[0] = bst_vec3_dot(b, axes.e1) / bst_vec3_dot(b, a);
    out[1] = bst_vec3_dot(b, axes.e2) / bst_vec3_dot(b, a);
}

static void covariance_of(const bst_mtt_track *t, double out[3]) {
    out[0] = t->state.covariance[0][0];
    out[1] = t->state.covariance[0][1];
    out[2] = t->state.covariance[1][1];
}

static double chi2_of(const double c[3], const double x[2]) {
    return (c[2] * x[0] * x[0] - 2 * c[1] * x[0] * x[1] + c[0] * x[1] * x[1]) /
           (c[0] * c[2] - c[1] * c[1]);
}

static double density(const double c[3], const double x[2]) {
    return exp(-0.5 * chi2_of(c, x)) / (2 * BST_PI * sqrt(c[0] * c[2] - c[1] * c[1]));
}

static const double UNEQUAL = 0.7; /* correlation of track b */

static bst_mtt_track first(void) {
    return track(bst_vec3_from_radec(1.0, 80 * BST_DEG_RAD), 120 * MAS, 60 * MAS, -0.5, 11.0, 0.9);
}

static bst_mtt_track second(void) {
    return track(beside(first().state.direction, 450 * MAS, 200 * MAS), 40 * MAS, 180 * MAS,
                 UNEQUAL, 11.9, 0.6);
}

/* exp(-d^2 / (2 s^2)), 5 % at merge_rad, summed over a grid of separations. */
static void pairs_are_unresolved(void **state) {
    (void)state;
    bst_mtt_track a = first(), b = second();
    double pa[3], pb[3], own[3], x[2], sum = 0.0;
    covariance_of(&a, pa);
    covariance_of(&b, own);
    seen_at(b.state.direction, own, a.state.direction, pb);
    offset(a.state.direction, b.state.direction, x);
    for (int i = 0; i < 3; i++) {
        pa[i] += pb[i];
    }
    const double step = 12 * MAS;
    for (int i = -120; i <= 120; i++) {
        for (int j = -120; j <= 120; j++) {
            double d[2] = {i * step, j * step}, off[2] = {d[0] - x[0], d[1] - x[1]};
            double d2 = (d[0] * d[0] + d[1] * d[1]) / (MERGE_RAD * MERGE_RAD);
            sum += pow(0.05, d2) * density(pa, off) * step * step;
        }
    }
    /* 3e-4: the curvature of half a degree, and "5 %" to five digits */
    bst_assert_close(bst_mtt_unresolved(MERGE_RAD, &a, &b), sum, 3e-4);
    bst_assert_close(bst_mtt_unresolved(MERGE_RAD, &b, &a), sum, 3e-4);
}

/* The centre of light z = w_a a + w_b b + noise: what it says of each, and its likelihood. */
static void merged_measurements_are_linear(void **state) {
    (void)state;
    const bst_mtt_track t[2] = {first(), second()};
    const double floor_rad = 30 * MAS;
    /* 0.9 mag apart */
    const double w[2] = {1 / (1 + pow(10, -0.36)), 1 / (1 + pow(10, 0.36))};
    bst_sky_measurement z = {.direction = beside(t[0].state.direction, 260 * MAS, -70 * MAS),
                             .cov_11 = pow(70 * MAS, 2),
                             .cov_12 = -0.6 * 70 * 45 * MAS * MAS,
                             .cov_22 = pow(45 * MAS, 2)};
    bst_assert_close(bst_mtt_light_share(&t[0], &t[1]), w[0], 1e-12);
    bst_mtt_merged fit;
    assert_true(bst_mtt_merge(&t[0], &t[1], &z, floor_rad, &fit));
    const double noise[3] = {z.cov_11, z.cov_12, z.cov_22};
    for (int k = 0; k < 2; k++) {
        const bst_mtt_track *own = &t[k], *other = &t[1 - k];
        const bst_sky_measurement *found = k == 0 ? &fit.of_a : &fit.of_b;
        bst_vec3 at = own->state.direction;
        double r[3], p[3], q[3], c[3], s[3], to[2], nu[2], implied[2];
        seen_at(z.direction, noise, at, r);
        covariance_of(own, p);
        covariance_of(other, c);
        seen_at(other->state.direction, c, at, q);
        offset(at, other->state.direction, to);
        offset(at, z.direction, nu);
        for (int i = 0; i < 3; i++) {
            double floor2 = i == 1 ? 0.0 : floor_rad * floor_rad;
            r[i] = r[i] + floor2 + w[1 - k] * w[1 - k] * q[i];
            s[i] = r[i] + w[k] * w[k] * p[i];
            c[i] = r[i] / (w[k] * w[k]);
        }
        for (int i = 0; i < 2; i++) {
            implied[i] = (nu[i] - w[1 - k] * to[i]) / w[k];
            nu[i] -= w[1 - k] * to[i];
        }
        double place[2], turned[3];
        offset(at, found->direction, place);
        /* 0.3 mdeg: projection of angles of half a degree */
        bst_assert_close(place[0], implied[0], 0.3 * MAS);
        bst_assert_close(place[1], implied[1], 0.3 * MAS);
        seen_at(at, c, found->direction, turned);
        const double got[3] = {found->cov_11, found->cov_12, found->cov_22};
        for (int i = 0; i < 3; i++) {
            bst_assert_close(got[i] / (turned[0] + turned[2]), turned[i] / (turned[0] + turned[2]),
                             1e-3);
        }
        /* the likelihood that is kept is that of a */
        if (k == 0) {
            bst_assert_close(fit.log_likelihood, log(density(s, nu)), 2e-3);
            bst_assert_close(fit.chi2, chi2_of(s, nu), 2e-3);
        }
    }
}

/* Mean and covariance of two hypotheses of one direction, by their moments in the axes at `at`. */
static void assert_mixed(bst_vec3 at, const bst_mtt_doubtful *found, double p, const double one[2],
                         const double c1[3], const double two[2], const double c2[3]) {
    double mean[2], place[2], step[2], cov[3], turned[3];
    for (int i = 0; i < 2; i++) {
        mean[i] = (1 - p) * one[i] + p * two[i];
        step[i] = two[i] - one[i];
    }
    for (int i = 0; i < 3; i++) {
        cov[i] = (1 - p) * c1[i] + p * c2[i] + p * (1 - p) * step[i / 2] * step[(i + 1) / 2];
    }
    bst_assert_close(found->merged, p, 1e-3);
    offset(at, found->sky.direction, place);
    bst_assert_close(place[0], mean[0], 0.5 * MAS);
    bst_assert_close(place[1], mean[1], 0.5 * MAS);
    seen_at(at, cov, found->sky.direction, turned);
    const double got[3] = {found->sky.cov_11, found->sky.cov_12, found->sky.cov_22};
    for (int i = 0; i < 3; i++) {
        bst_assert_close(got[i] / (turned[0] + turned[2]), turned[i] / (turned[0] + turned[2]),
                         2e-3);
    }
}

static double normal_cost(double off, double variance) {
    return exp(-0.5 * fmin(off * off / variance, 9.0));
}

static void doubts_of_a_pair(void **state) {
    (void)state;
    const double pd = 0.8;
    bst_vec3 at = bst_vec3_from_radec(4.0, -80 * BST_DEG_RAD);
    const bst_mtt_detection single = {.sky = {.direction = at,
                                              .cov_11 = pow(50 * MAS, 2),
                                              .cov_12 = 0.5 * 50 * 90 * MAS * MAS,
                                              .cov_22 = pow(90 * MAS, 2)},
                                      .v_mag = 10.6,
                                      .v_mag_sigma = 0.3};
    bst_vec3 before = beside(at, 300 * MAS, -500 * MAS);
    const bst_mtt_detection own = {.sky = {.direction = before}, .v_mag = 11.0, .v_mag_sigma = 0.1};
    const bst_mtt_detection companion = {
        .sky = {.direction = beside(before, -250 * MAS, 350 * MAS)},
        .v_mag = 11.4,
        .v_mag_sigma = 0.2};
    double share = 1 / (1 + pow(10, -0.16));
    bst_assert_close(bst_mtt_detection_share(&own, &companion), share, 1e-12);
    double unresolved =
        pow(0.05, (250.0 * 250 + 350.0 * 350) * MAS * MAS / (MERGE_RAD * MERGE_RAD));
    double both = -2.5 * log10(pow(10, -0.4 * 11.0) + pow(10, -0.4 * 11.4));
    double variance = 0.09 + 0.1 * 0.1 + 0.3 * 0.3;
    double merged = unresolved * normal_cost(10.6 - both, variance),
           missed = (1 - unresolved) * (1 - pd) * normal_cost(10.6 - 11.0, variance);
    bst_mtt_doubtful found = bst_mtt_doubt_of_pair(MERGE_RAD, pd, &single, &own, &companion);
    /* the axes at `own` seen from `single`: 0.58 degrees at 80 degrees of declination */
    bst_tangent there = bst_tangent_at(before), here = bst_tangent_at(at);
    bst_vec3 to = bst_tangent_vector(&there, -250 * MAS, 350 * MAS);
    const double two[2] = {-(1 - share) * bst_vec3_dot(to, here.e1),
                           -(1 - share) * bst_vec3_dot(to, here.e2)};
    const double none[2] = {0, 0},
                 c1[3] = {single.sky.cov_11, single.sky.cov_12, single.sky.cov_22};
    const double c2[3] = {c1[0] + 0.25 * two[0] * two[0], c1[1] + 0.25 * two[0] * two[1],
                          c1[2] + 0.25 * two[1] * two[1]};
    assert_mixed(at, &found, merged / (merged + missed), none, c1, two, c2);
}

static void doubts_of_a_track(void **state) {
    (void)state;
    const bst_mtt_track a = first(), b = second();
    bst_vec3 at = a.state.direction;
    const bst_mtt_detection z = {.sky = {.direction = beside(at, 120 * MAS, 60 * MAS),
                                         .cov_11 = pow(70 * MAS, 2),
                                         .cov_12 = 0.4 * 70 * 45 * MAS * MAS,
                                         .cov_22 = pow(45 * MAS, 2)},
                                 .v_mag = 10.9,
                                 .v_mag_sigma = 0.2};
    const bst_mtt_params params = {.merge_rad = MERGE_RAD, .merge_floor_rad = 30 * MAS};
    bst_mtt_merged fit;
    assert_true(bst_mtt_merge(&a, &b, &z.sky, params.merge_floor_rad, &fit));
    double both = -2.5 * log10(pow(10, -0.4 * a.v_mag) + pow(10, -0.4 * b.v_mag));
    double light = normal_cost(10.9 - both, 0.04 + 0.09 + 0.2 * 0.2);
    bst_assert_close(exp(-bst_mtt_merged_brightness_cost(&a, &b, &z)), light, 1e-12);
    double unresolved = bst_mtt_unresolved(MERGE_RAD, &a, &b), exists = 0.6 / 0.9;
    const double alone_density = 0.5 * exp(fit.log_likelihood) * light;
    double merged = exists * unresolved * exp(fit.log_likelihood) * light;
    double single = ((1 - exists) + exists * (1 - unresolved) * (1 - 0.8)) * alone_density;
    bst_mtt_doubtful found = bst_mtt_doubt_of_track(&params, &a, &b, &z, 0.8, log(alone_density));
    double one[2], two[2], c1[3], c2[3];
    const double of_z[3] = {z.sky.cov_11, z.sky.cov_12, z.sky.cov_22},
                 of_a[3] = {fit.of_a.cov_11, fit.of_a.cov_12, fit.of_a.cov_22};
    offset(at, z.sky.direction, one);
    offset(at, fit.of_a.direction, two);
    seen_at(z.sky.direction, of_z, at, c1);
    seen_at(fit.of_a.direction, of_a, at, c2);
    assert_mixed(at, &found, merged / (merged + single), one, c1, two, c2);
}

static void invert(double a[4][8]) { /* [A | 1] to [1 | A^-1] */
    for (int i = 0; i < 4; i++) {
        double pivot = a[i][i];
        for (int j = 0; j < 8; j++) {
            a[i][j] /= pivot;
        }
        for (int k = 0; k < 4; k++) {
            double f = a[k][i];
            for (int j = 0; k != i && j < 8; j++) {
                a[k][j] -= f * a[i][j];
            }
        }
    }
}

/* Two estimates with all covariances: (A^-1 + B^-1)^-1, and the mean weighted by the inverses. */
static void estimates_are_fused(void **state) {
    (void)state;
    bst_sky_state s[2] = {{.direction = bst_vec3_from_radec(2.0, 0.1)},
                          {.direction = bst_vec3_from_radec(2.0, 0.1)}};
    const double unit[4] = {1e-6, 2e-6, 3e-8, 1e-8}, off[4] = {0.7e-6, -1.1e-6, 2e-8, -1.5e-8};
    s[1].direction = beside(s[1].direction, off[0], off[1]);
    bst_tangent axes = bst_tangent_at(s[1].direction), first_axes = bst_tangent_at(s[0].direction);
    s[0].rate_radps = bst_tangent_vector(&first_axes, 5e-6, 3e-6);
    s[1].rate_radps = bst_tangent_vector(&axes, 5e-6 + off[2], 3e-6 + off[3]);
    double inverse[2][4][8] = {{{0}}}, sum[4][8] = {{0}}, mean[4] = {0};
    for (int k = 0; k < 2; k++) {
        for (int i = 0; i < 4; i++) {
            for (int j = 0; j < 4; j++) { /* positive definite, nothing equal */
                double c = i == j ? 1.0 + 0.3 * i * (k == 0) + 0.5 * (3 - i) * k
                                  : 0.4 * cos(1.0 + i * j + i + j + 3 * k);
                s[k].covariance[i][j] = c * unit[i] * unit[j];
                inverse[k][i][j] = c;
            }
            inverse[k][i][4 + i] = 1.0;
        }
        invert(inverse[k]);
    }
    for (int i = 0; i < 4; i++) {
        for (int j = 0; j < 4; j++) {
            sum[i][j] = inverse[0][i][4 + j] + inverse[1][i][4 + j];
            mean[i] += inverse[1][i][4 + j] * off[j] / unit[j];
        }
        sum[i][4 + i] = 1.0;
    }
    invert(sum);
    bst_sky_state fused = s[0];
    assert_true(bst_sky_fuse(&fused, &s[1]));
    double found[4];
    bst_sky_difference(&s[0], &fused, found);
    for (int i = 0; i < 4; i++) {
        double expected = 0.0;
        for (int j = 0; j < 4; j++) {
            expected += sum[i][4 + j] * mean[j];
            /* 1e-4: the axes turn by 1e-7 and transported rates by 1e-11 rad/s of 1e-8 */
            bst_assert_close(fused.covariance[i][j] / (unit[i] * unit[j]), sum[i][4 + j], 1e-4);
        }
        bst_assert_close(found[i] / unit[i], expected, 1e-3);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(pairs_are_unresolved), cmocka_unit_test(merged_measurements_are_linear),
        cmocka_unit_test(doubts_of_a_pair),     cmocka_unit_test(doubts_of_a_track),
        cmocka_unit_test(estimates_are_fused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
