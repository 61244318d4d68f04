/* Rules of a group of path points: what nodes keep of its moments, and the stated errors,
 * against sums over points and a rotated star. No device. */
#include "boresight/rng.h"
#include "boresight/vec.h"
#include "scenegen/smear/motion.h"
#include "scenegen/smear/smear_quadrature_internal.h"
#include "tests/test_support.h"

enum { POINTS = 60 };

static const double SIGMA2 = 0.7;

/* Moments of equally likely points, by their definition. */
static void moments_of(const double p[POINTS][3], bst_smear_moments *g) {
    memset(g, 0, sizeof *g);
    for (int n = 0; n < POINTS; n++) {
        for (int i = 0; i < 3; i++) {
            g->mean[i] += p[n][i] / POINTS;
        }
    }
    for (int n = 0; n < POINTS; n++) {
        for (int i = 0; i < 9; i++) {
            g->covariance[i / 3][i % 3] +=
                (p[n][i / 3] - g->mean[i / 3]) * (p[n][i % 3] - g->mean[i % 3]) / POINTS;
        }
    }
    bst_smear_nodes_main_axis(g->covariance, g->axis);
    for (int n = 0; n < POINTS; n++) {
        double d[3], x = 0.0, y2 = 0.0;
        for (int i = 0; i < 3; i++) {
            d[i] = p[n][i] - g->mean[i];
            x += d[i] * g->axis[i];
        }
        for (int i = 0; i < 3; i++) {
            d[i] -= x * g->axis[i];
            y2 += d[i] * d[i];
        }
        for (int k = 0; k <= 6; k++) {
            g->along[k] += pow(x, k) / POINTS;
        }
        for (int i = 0; i < 3; i++) {
            g->bend[i] += x * x * d[i] / POINTS;
            g->lean[i] += y2 * d[i] / POINTS;
            g->twist[i] += x * x * x * d[i] / POINTS;
        }
        g->drift += x * y2 / POINTS;
        g->mixed += x * x * y2 / POINTS;
        g->across += y2 / POINTS;
    }
}

/* Points of a skew cloud, `thin` of its length across, on a curve. */
static void make_points(int trial, double thin, double p[POINTS][3]) {
    bst_rng_key key = bst_rng_make_key(5, (uint64_t)trial, "test", "smear rule");
    const double axis[3] = {0.48, 0.6, 0.64}, side[3] = {0.8, -0.6, -0.0375};
    for (uint64_t n = 0; n < POINTS; n++) {
        double u = bst_rng_uniform(key, n, 0), x = 0.9 * (u + 0.4 * u * u);
        for (int i = 0; i < 3; i++) {
            p[n][i] = 3.0 * i + x * axis[i] + thin * (2.0 * x * x * side[i]) +
                      thin * (bst_rng_uniform(key, n, (uint64_t)i + 1) - 0.5);
        }
    }
}

static bst_smear_maker maker_of(double wide_field) {
    return (bst_smear_maker){.variance = SIGMA2,
                             .tolerance = 1.0,
                             .widen = true,
                             .widest = 0.5 * SIGMA2,
                             .wide_field = wide_field,
                             .pixel_part = {0.8, 0.7, 0.6},
                             .image_share = (2.0 + 3.0 / (wide_field * wide_field)) / 5.0};
}

/* Nodes on a line keep its moments: one the mean, two up to the third, three up to the fifth; what
 * is missed is the next even one, over 24 / 3 and 720 / 15. */
static void nodes_keep_the_moments_along_a_line(void **state) {
    (void)state;
    for (int trial = 0; trial < 6; trial++) {
        double p[POINTS][3];
        bst_smear_moments g;
        make_points(trial, 0.0, p);
        moments_of(p, &g);
        bst_smear_maker m = maker_of(1.0);
        for (int n = 1; n <= 3; n++) {
            bst_smear_rule r;
            bst_smear_try_rule(&m, &g, n, false, false, INFINITY, &r);
            assert_int_equal(r.nodes, n);
            double sum[7] = {0.0};
            for (int k = 0; k < n; k++) {
                assert_true(r.weight[k] > 0.0);
                for (int power = 0; power <= 6; power++) {
                    sum[power] += r.weight[k] * pow(r.node[k], power);
                }
            }
            for (int power = 0; power < 2 * n; power++) {
                bst_assert_close(sum[power], g.along[power], 1e-12); /* rounding of roots */
            }
            double missed = fabs(g.along[2 * n] - sum[2 * n]);
            double want = n == 1   ? 0.0
                          : n == 2 ? 0.7 * missed * 3.0 / 24.0 / (SIGMA2 * SIGMA2)
                                   : 0.6 * missed * 15.0 / 720.0 / (SIGMA2 * SIGMA2 * SIGMA2);
            bst_assert_close(r.missed, 1.08 * want, 1e-9); /* 1.08: measured, with its margin */
            assert_true(n == 1 || r.error < 1e-3 + r.missed);
            /* one node in the place of a line along (0.48, 0.6, 0.64): its covariance, of tilts at
             * the boresight and with roll at the corners, and its skewness */
            if (n == 1) {
                double v = g.along[2], worst = 0.0;
                for (int corner = 0; corner < 5; corner++) {
                    double x = corner == 0 ? 0.0 : (corner % 2 ? 1.0 : -1.0) * sqrt(0.5);
                    double y = corner == 0 ? 0.0 : (corner < 3 ? 1.0 : -1.0) * sqrt(0.5);
                    double dx = g.axis[1] - y * g.axis[2], dy = -g.axis[0] + x * g.axis[2];
                    worst = fmax(worst, 0.5 * v * (dx * dx + dy * dy) + 0.37 * v * fabs(dx * dy));
                }
                double skew = 1.3 * 0.8 * 0.23 * fabs(g.along[3]) / pow(SIGMA2, 1.5);
                bst_assert_close(r.error, skew + 0.8 * worst / SIGMA2, 1e-9);
                assert_true(r.fixed == 0.0);
            }
        }
    }
}

/* Three nodes of a curved cloud: placed across the axis so that E[y x^2] is kept, with the widening
 * taken out of the moments along the axis and put back by the nodes' own width. */
static void three_nodes_follow_a_bend(void **state) {
    (void)state;
    for (int trial = 0; trial < 6; trial++) {
        for (int widen = 0; widen < 2; widen++) {
            double p[POINTS][3];
            bst_smear_moments g;
            make_points(trial, 0.12, p);
            moments_of(p, &g);
            bst_smear_maker m = maker_of(1.0);
            bst_smear_rule r;
            bst_smear_try_rule(&m, &g, 3, widen, false, INFINITY, &r);
            assert_int_equal(r.nodes, 3);
            assert_true((r.widening > 0.0) == (widen == 1));
            double u = r.widening, sum[6] = {0.0}, bend[3] = {0.0}, still[3] = {0.0};
            for (int k = 0; k < 3; k++) {
                double x = r.node[k], w = r.weight[k];
                /* moments of a Gaussian of variance u about x */
                const double power[6] = {1.0,
                                         x,
                                         x * x + u,
                                         x * x * x + 3.0 * x * u,
                                         pow(x, 4) + 6.0 * x * x * u + 3.0 * u * u,
                                         pow(x, 5) + 10.0 * x * x * x * u + 15.0 * x * u * u};
                for (int i = 0; i < 6; i++) {
                    sum[i] += w * power[i];
                }
                for (int i = 0; i < 3; i++) {
                    bend[i] += w * r.curve[k] * r.bend[i] * x * x;
                    still[i] += w * r.curve[k] * r.bend[i];
                }
            }
            for (int i = 0; i < 6; i++) {
                bst_assert_close(sum[i], g.along[i], 1e-12);
            }
            for (int i = 0; i < 3; i++) {
                /* halving of an interval 14 times where it is widened */
                double error = widen ? 2e-3 * fabs(g.bend[i]) + 1e-9 : 1e-12;
                bst_assert_close(bend[i], g.bend[i], error);
                bst_assert_close(still[i], 0.0, 1e-12);
            }
            if (widen) {
                /* isotropic: half of the trace of tilts that neither axis nor bend represents, for
                 * an axis that is partly roll */
                double tilt = g.axis[0] * g.axis[0] + g.axis[1] * g.axis[1], trace = 0.0;
                double norm = 0.0;
                for (int k = 0; k < 3; k++) {
                    norm += r.weight[k] * r.curve[k] * r.curve[k];
                }
                for (int i = 0; i < 2; i++) {
                    trace += g.covariance[i][i] - g.along[2] * g.axis[i] * g.axis[i] -
                             g.bend[i] * g.bend[i] / norm;
                }
                bst_assert_close(u, trace / (2.0 - tilt), 0.01 * u);
            }
        }
    }
}

/* A pair on either side of each node: the largest variance that is left, in both directions. */
static void pairs_keep_what_is_left(void **state) {
    (void)state;
    double p[POINTS][3];
    bst_smear_moments g;
    make_points(2, 0.4, p);
    moments_of(p, &g);
    bst_smear_maker m = maker_of(1.0);
    bst_smear_rule r;
    bst_smear_try_rule(&m, &g, 2, false, true, INFINITY, &r);
    double rest[3][3], length2 = 0.0, most = 0.0;
    for (int i = 0; i < 9; i++) {
        rest[i / 3][i % 3] =
            g.covariance[i / 3][i % 3] - g.along[2] * g.axis[i / 3] * g.axis[i % 3];
    }
    for (int i = 0; i < 3; i++) {
        length2 += r.pair[i] * r.pair[i];
    }
    for (int i = 0; i < 3; i++) { /* an eigenvector of what is left, its length the deviation */
        double to = 0.0;
        for (int j = 0; j < 3; j++) {
            to += rest[i][j] * r.pair[j];
        }
        bst_assert_close(to, length2 * r.pair[i], 1e-6);
    }
    for (int k = 0; k < 400; k++) { /* and no direction has more */
        double a = 0.31 * k, b = acos(1.0 - 2.0 * (k + 0.5) / 400.0), v = 0.0;
        const double d[3] = {sin(b) * cos(a), sin(b) * sin(a), cos(b)};
        for (int i = 0; i < 9; i++) {
            v += d[i / 3] * rest[i / 3][i % 3] * d[i % 3];
        }
        most = fmax(most, v);
    }
    assert_true(length2 > 0.01);
    bst_assert_close(most / length2, 1.0, 0.03); /* 400 directions */
}

/* Image motion of a star at tangents (x, y) by small rotations about the three axes, by
 * differences of its place. */
static void image_motion(double x, double y, double out[2][3]) {
    const double h = 1e-6;
    for (int k = 0; k < 3; k++) {
        double at[2][2];
        for (int side = 0; side < 2; side++) {
            double a = side ? -h : h, v[3] = {x, y, 1.0}, r[3];
            int i = (k + 1) % 3, j = (k + 2) % 3;
            r[k] = v[k];
            r[i] = v[i] * cos(a) - v[j] * sin(a);
            r[j] = v[i] * sin(a) + v[j] * cos(a);
            at[side][0] = r[0] / r[2];
            at[side][1] = r[1] / r[2];
        }
        out[0][k] = (at[0][0] - at[1][0]) / (2.0 * h);
        out[1][k] = (at[0][1] - at[1][1]) / (2.0 * h);
    }
}

/* The error by a covariance that one node leaves out, in a field so wide that its corners move by
 * 1 + t^2 = 1.25 of what the boresight does: tilts are px in the corners, roll px there. */
static void covariance_left_out_in_a_wide_field(void **state) {
    (void)state;
    const double t = 0.5, wide = 1.0 + t * t;
    const double cases[][6] = {/* xx yy zz xy xz yz */
                               {0.02, 0.01, 0.0, 0.005, 0.0, 0.0},
                               {0.0, 0.0, 0.03, 0.0, 0.0, 0.0},
                               {0.02, 0.01, 0.03, 0.0, 0.01, -0.01},
                               {0.01, 0.03, 0.02, -0.01, 0, 0},
                               {0.01, 0.01, 0.01, 0.0, 0.0, 0.005}};
    for (int widen = 0; widen < 2; widen++) {
        for (size_t n = 0; n < sizeof cases / sizeof *cases; n++) {
            const double *c = cases[n];
            const double d[3][3] = {{c[0], c[3], c[4]}, {c[3], c[1], c[5]}, {c[4], c[5], c[2]}};
            bst_smear_moments g = {.axis = {1.0, 0.0, 0.0}, .along = {1.0}};
            memcpy(g.covariance, d, sizeof d);
            bst_smear_maker m = maker_of(wide);
            double u = widen ? 0.5 * (c[0] + c[1]) : 0.0; /* px in the corners */
            double worst = 0.0;
            for (int corner = 0; corner < 5; corner++) {
                double x = corner == 0 ? 0.0 : (corner % 2 ? t : -t) * sqrt(0.5);
                double y = corner == 0 ? 0.0 : (corner < 3 ? t : -t) * sqrt(0.5);
                double j[2][3], image[3] = {0.0, 0.0, 0.0};
                image_motion(x, y, j);
                for (int i = 0; i < 2; i++) { /* px of a tilt: 1 / wide at the boresight */
                    j[i][0] /= wide;
                    j[i][1] /= wide;
                    j[i][2] /= t;
                }
                for (int a = 0; a < 3; a++) {
                    for (int b = 0; b < 3; b++) {
                        image[0] += j[0][a] * d[a][b] * j[0][b];
                        image[1] += j[0][a] * d[a][b] * j[1][b];
                        image[2] += j[1][a] * d[a][b] * j[1][b];
                    }
                }
                double share = (2.0 + 3.0 / (wide * wide)) / 5.0; /* mean of the five places */
                worst = fmax(worst, 0.5 * fabs(image[0] - share * u) +
                                        0.5 * fabs(image[2] - share * u) + 0.37 * fabs(image[1]));
            }
            bst_smear_rule r;
            bst_smear_try_rule(&m, &g, 1, widen, false, INFINITY, &r);
            bst_assert_close(r.widening, u, 1e-15);
            /* what becomes a Gaussian: fourth cumulant of a uniform distribution, 1.2 u^2 3 / 4! */
            double fourth = 1.3 * 0.8 * 0.15 * u * u / (SIGMA2 * SIGMA2);
            bst_assert_close(r.error, fourth + 0.8 * worst / SIGMA2, 1e-9);
            bst_assert_close(r.fixed, widen && u > 0.0 ? 0.8 * worst / SIGMA2 : 0.0, 1e-9);
        }
    }
    /* no wider than is allowed */
    bst_smear_moments g = {.axis = {1.0, 0.0, 0.0}, .along = {1.0}};
    g.covariance[0][0] = g.covariance[1][1] = SIGMA2;
    bst_smear_maker m = maker_of(1.0);
    bst_smear_rule r;
    bst_smear_try_rule(&m, &g, 1, true, false, INFINITY, &r);
    bst_assert_close(r.widening, 0.5 * SIGMA2, 1e-15);
}

/* Missed third and fourth moments: each term by itself. */
static void higher_moments_one_by_one(void **state) {
    (void)state;
    const double v15 = pow(SIGMA2, 1.5), v2 = SIGMA2 * SIGMA2, part = 1.3 * 0.8;
    bst_smear_maker m = maker_of(1.0);
    bst_smear_rule r;
    bst_smear_moments line = {.axis = {0.0, 1.0, 0.0}, .along = {1.0, 0.0, 0.04, 0.0, 0.004}};
    line.covariance[1][1] = 0.04;
    bst_smear_try_rule(&m, &line, 2, false, false, INFINITY, &r);
    double plain = r.error;
    bst_smear_moments g = line;
    g.drift = -0.002;
    bst_smear_try_rule(&m, &g, 2, false, false, INFINITY, &r);
    bst_assert_close(r.error - plain, part * 0.3 * 0.002 / v15, 1e-12);
    g = line;
    g.lean[0] = 0.003;
    g.lean[2] = -0.004;
    bst_smear_try_rule(&m, &g, 2, false, false, INFINITY, &r);
    bst_assert_close(r.error - plain, part * 0.23 * 0.005 / v15, 1e-12);
    g = line;
    g.bend[0] = 0.0006;
    g.bend[2] = 0.0008;
    bst_smear_try_rule(&m, &g, 2, false, false, INFINITY, &r);
    bst_assert_close(r.error - plain, part * 0.3 * 0.001 / v15, 1e-12);
    g = line;
    g.twist[0] = 0.0006;
    g.twist[2] = 0.0008;
    bst_smear_try_rule(&m, &g, 2, false, false, INFINITY, &r);
    bst_assert_close(r.error - plain, part * 0.14 * 0.001 / v2, 1e-12);
    g = line;
    g.mixed = 0.0009; /* more than the product 0.04 x 0.01 by 0.0005 */
    g.across = 0.01;
    bst_smear_try_rule(&m, &g, 2, false, false, INFINITY, &r);
    bst_assert_close(r.error - plain, part * 0.25 * 0.0005 / v2, 1e-12);
    /* the mean of a curved motion: half its second derivative times the variance, at 0.607 / sigma
     */
    m.curvature = 0.02;
    g.mixed = 0.0004;
    bst_smear_try_rule(&m, &g, 2, false, false, INFINITY, &r);
    bst_assert_close(r.error - plain, 0.304 * 0.02 * 0.01 / sqrt(SIGMA2), 1e-12);
    bst_smear_rule one;
    m.curvature = 0.0;
    bst_smear_try_rule(&m, &g, 1, false, false, INFINITY, &r);
    m.curvature = 0.02;
    bst_smear_try_rule(&m, &g, 1, false, false, INFINITY, &one);
    bst_assert_close(one.error - r.error, 0.304 * 0.02 * (0.04 + 0.01) / sqrt(SIGMA2), 1e-12);
    bst_smear_try_rule(&m, &g, 2, false, false, 1e-9, &r); /* an error beyond the limit is none */
    assert_true(isinf(r.error));
}

/* Three nodes on a bend have higher moments of their own: only the difference from the group's is
 * an error, on either side of them. */
static void moments_of_nodes_on_a_bend_are_no_error(void **state) {
    (void)state;
    const double v15 = pow(SIGMA2, 1.5), v2 = SIGMA2 * SIGMA2, part = 1.3 * 0.8;
    bst_smear_moments g;
    bst_smear_rule r;
    for (int trial = 0; trial < 6; trial++) {
        double p[POINTS][3];
        bst_smear_maker m = maker_of(1.0);
        make_points(trial, 0.12, p), moments_of(p, &g);
        bst_smear_try_rule(&m, &g, 3, false, false, INFINITY, &r);
        double b2 = r.bend[0] * r.bend[0] + r.bend[1] * r.bend[1] + r.bend[2] * r.bend[2];
        g.drift = 0.0, g.mixed = g.along[2] * g.across;
        memset(g.twist, 0, sizeof g.twist), memset(g.lean, 0, sizeof g.lean);
        for (int k = 0; k < 3; k++) { /* sums over the nodes */
            const double x = r.node[k], c = r.curve[k], w = r.weight[k];
            g.drift += w * x * b2 * c * c;
            g.mixed += w * (x * x - g.along[2]) * b2 * c * c;
            for (int i = 0; i < 3; i++) {
                g.twist[i] += w * x * x * x * c * r.bend[i];
                g.lean[i] += w * b2 * c * c * c * r.bend[i];
            }
        }
        bst_smear_try_rule(&m, &g, 3, false, false, INFINITY, &r);
        const double least = r.error, term[4] = {0.3 / v15, 0.25 / v2, 0.14 / v2, 0.23 / v15};
        double *moment[4] = {&g.drift, &g.mixed, &g.twist[1], &g.lean[1]};
        for (int k = 0; k < 8; k++) {
            const double by = k % 2 ? 1e-3 : -1e-3;
            *moment[k / 2] += by;
            bst_smear_try_rule(&m, &g, 3, false, false, INFINITY, &r);
            bst_assert_close(r.error - least, part * term[k / 2] * 1e-3, 1e-10);
            *moment[k / 2] -= by;
        }
    }
}

/* The fewest nodes that meet the tolerance; where none do, the best. */
static void the_fewest_nodes_are_chosen(void **state) {
    (void)state;
    double p[POINTS][3], error[4];
    bst_smear_moments g;
    make_points(1, 0.0, p);
    moments_of(p, &g);
    bst_smear_maker m = maker_of(1.0);
    m.widen = false;
    for (int n = 1; n <= 3; n++) {
        bst_smear_rule r;
        bst_smear_try_rule(&m, &g, n, false, false, INFINITY, &r);
        error[n] = r.error;
    }
    assert_true(error[1] > 2.0 * error[2] && error[2] > 2.0 * error[3]);
    for (int n = 1; n <= 3; n++) {
        bst_smear_rule best = {.error = INFINITY};
        m.tolerance = 1.01 * error[n];
        bst_smear_choose_rule(&m, &g, m.tolerance, &best);
        assert_int_equal(best.nodes, n);
        bst_assert_close(best.error, error[n], 0.0);
    }
    bst_smear_rule best = {.error = INFINITY};
    m.tolerance = 0.5 * error[3];
    bst_smear_choose_rule(&m, &g, m.tolerance, &best);
    assert_int_equal(best.nodes, 3);
}

/* Groups of a path in three dimensions: weight, mean, covariance and E[y x^2] of its one group of
 * three nodes are those of the path, by sums over it. */
static void a_curved_path_keeps_its_moments(void **state) {
    (void)state;
    enum { COUNT = 41, STEPS = 200 };
    bst_ctx ctx = {0};
    bst_smear_path_point path[COUNT];
    for (int k = 0; k < COUNT; k++) {
        double u = (double)k / (COUNT - 1), x = 1.1 * u + 0.5 * u * u;
        path[k] = (bst_smear_path_point){
            {2.0 + 0.48 * x + 0.16 * x * x, 0.6 * x - 0.12 * x * x, -1.0 + 0.64 * x},
            0.1 + 0.7 * u};
    }
    const bst_smear_node_aim aim = {.psf_sigma_px = 0.85, .tolerance = 0.015};
    bst_smear_node_list list = {0};
    bst_assert_ok(&ctx, bst_smear_nodes_from_path(&ctx, path, COUNT, &aim, &list));
    assert_int_equal(list.count, 3);
    double first[2][3] = {{0.0}}, second[2][3][3] = {{{0.0}}}, third[2] = {0.0}, weight = 0.0;
    for (int n = 0; n < 3; n++) {
        weight += list.items[n].weight;
    }
    bst_assert_close(weight, 1.0, 1e-12);
    for (int pass = 0; pass < 2; pass++) {
        for (int side = 0; side < 2; side++) { /* the path, and its nodes */
            int count = side ? 3 : (COUNT - 1) * STEPS;
            for (int n = 0; n < count; n++) {
                double q[3], w = side ? list.items[n].weight : 1.0 / count;
                double v = (n % STEPS + 0.5) / STEPS, y2 = 0.0, x = 0.0;
                int k = n / STEPS;
                for (int i = 0; i < 3; i++) {
                    q[i] = side ? list.items[n].p[i]
                                : path[k].p[i] + v * (path[k + 1].p[i] - path[k].p[i]);
                    q[i] -= pass ? first[0][i] : 0.0;
                    first[side][i] += pass ? 0.0 : w * q[i];
                }
                for (int i = 0; i < 9 && pass; i++) {
                    second[side][i / 3][i % 3] += w * q[i / 3] * q[i % 3];
                }
                const double axis[3] = {0.48, 0.6, 0.64}, bow[3] = {0.8, -0.6, 0.0};
                for (int i = 0; i < 3; i++) {
                    x += q[i] * axis[i];
                    y2 += q[i] * bow[i];
                }
                third[side] += pass ? w * x * x * y2 : 0.0;
            }
        }
    }
    for (int i = 0; i < 3; i++) {
        bst_assert_close(first[1][i], first[0][i], 1e-6); /* midpoints of 1/200 of a stretch */
        for (int j = 0; j < 3; j++) {
            /* what the bend leaves over, under the tolerance of 2 x 0.02 x 0.7 by much */
            bst_assert_close(second[1][i][j], second[0][i][j], 3e-4);
        }
    }
    bst_assert_close(third[1] / third[0], 1.0, 0.03);
    free(list.items);
}

/* Errors of images that move by 2^(-7/2) to 2^(1/2) of a straight path: with the square of the
 * scale where one node leaves a variance out, and with the cube beyond the path's own; with the
 * fourth and sixth power of the moments that two and three nodes miss. */
static void errors_go_with_powers_of_the_scale(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    const double lengths[] = {0.3, 1.2, 2.6};
    for (int n = 1; n <= 3; n++) {
        double c = 0.6 * lengths[n - 1], e = 0.8 * lengths[n - 1];
        const bst_smear_path_point path[] = {{{1.0, 2.0, 0.0}, 0.0},
                                             {{1.0 + c, 2.0 + e, 0.0}, 1.0}};
        const bst_smear_node_aim aim = {.psf_sigma_px = 0.85, .tolerance = 0.03};
        bst_smear_node_list list = {0};
        bst_assert_ok(&ctx, bst_smear_nodes_from_path(&ctx, path, 2, &aim, &list));
        assert_int_equal(list.count, n);
        double whole = list.error[BST_NODE_SCALES - 2];
        assert_true(whole > 1e-4 && whole < 0.03);
        for (int k = 0; k < BST_NODE_SCALES; k++) {
            double scale = pow(2.0, 0.5 * (k - BST_NODE_SCALES + 2));
            double power = n > 1 ? 2.0 * n : scale > 1.0 ? 3.0 : 2.0;
            bst_assert_close(list.error[k] / whole / pow(scale, power), 1.0, 1e-6);
        }
        free(list.items);
    }
}

/* An ellipse as fast jitter has it, xx = 0.045 and yy = 0.03125 px^2: one node, widened by their
 * mean. Half their difference is wrong whatever moves less than the path; where nodes must not be
 * widened they are pairs. */
static void round_jitter_widens_or_splits(void **state) {
    (void)state;
    enum { STEPS = 400 };
    bst_ctx ctx = {0};
    static bst_smear_path_point path[STEPS + 1];
    const double sigma2 = 0.85 * 0.85, xx = 0.045, yy = 0.03125;
    for (int large = 0; large < 2; large++) {
        double size = large ? 1.6 : 1.0;
        for (int k = 0; k <= STEPS; k++) {
            double a = 2.0 * BST_PI * k / STEPS;
            path[k] = (bst_smear_path_point){
                {size * sqrt(2.0 * xx) * cos(a), size * sqrt(2.0 * yy) * sin(a), 0.0},
                (double)k / STEPS};
        }
        const bst_smear_node_aim aim = {
            .psf_sigma_px = 0.85, .tolerance = 0.03, .widest = large ? 0.0 : 0.5};
        bst_smear_node_list list = {0};
        bst_assert_ok(&ctx, bst_smear_nodes_from_path(&ctx, path, STEPS + 1, &aim, &list));
        double wide = list.items[0].variance, v[3] = {wide, 0.0, wide};
        for (int n = 0; n < list.count; n++) {
            const bst_smear_node *p = &list.items[n];
            v[0] += p->weight * p->p[0] * p->p[0];
            v[1] += p->weight * p->p[0] * p->p[1];
            v[2] += p->weight * p->p[1] * p->p[1];
        }
        if (!large) {
            assert_int_equal(list.count, 1);
            bst_assert_close(wide, 0.5 * (xx + yy), 1e-5); /* chords of a circle: 4e-5 */
            double fixed = 0.5 * (xx - yy) / sigma2;
            double rest = list.error[BST_NODE_SCALES - 2] - fixed;
            /* E[x^2 y^2] is half of xx yy, and the widening becomes a Gaussian */
            double u = 0.5 * (xx + yy), fourth = 0.25 * 0.5 * xx * yy + 0.15 * u * u;
            bst_assert_close(rest, 1.3 * fourth / (sigma2 * sigma2), 0.02 * rest);
            for (int k = 0; k < BST_NODE_SCALES - 1; k++) {
                double square = pow(2.0, k - BST_NODE_SCALES + 2);
                bst_assert_close(list.error[k], fixed + rest * square, 1e-3 * fixed);
            }
        }
        if (large) {
            assert_int_equal(list.count, 4);
            bst_assert_close(v[0], 2.56 * xx, 1e-4);
            bst_assert_close(v[1], 0.0, 1e-9);
            bst_assert_close(v[2], 2.56 * yy, 1e-4);
        }
        free(list.items);
    }
}

/* A long straight path is cut into equal parts of three nodes: a uniform part of variance v misses
 * 0.617 v^3 of the sixth moment, over 48 sigma^6 and with the pixel's part of the derivative. */
static void long_paths_have_as_many_parts_as_they_need(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    const bst_smear_path_point path[] = {{{30.0, -20.0, 5.0}, 0.25}, {{170.0, 85.0, 5.0}, 0.75}};
    for (double tolerance = 0.03; tolerance > 1e-5; tolerance *= 0.2) {
        for (int k = 0; k < 2; k++) {
            const bst_smear_node_aim aim = {.psf_sigma_px = 0.85,
                                            .tolerance = tolerance,
                                            .pixel_part = {0.7, 0.5, k ? 0.3 : 0.0}};
            bst_smear_node_list list = {0};
            bst_assert_ok(&ctx, bst_smear_nodes_from_path(&ctx, path, 2, &aim, &list));
            double v = 0.95 * 0.85 * 0.85 * cbrt(48.0 * tolerance / (k ? 0.3 : 1.0) / 0.617);
            int parts = (int)ceil(175.0 / sqrt(12.0 * v));
            assert_int_equal(list.count, 3 * parts);
            for (int n = 0; n < list.count; n++) { /* Gauss-Legendre in each part */
                double u = (n / 3 + 0.5 + (n % 3 - 1) * 0.5 * sqrt(0.6)) / parts;
                double to = 1e9;
                for (int i = 0; i < list.count; i++) {
                    const double *p = list.items[i].p;
                    to = fmin(to, hypot(p[0] - 30.0 - 140.0 * u, p[1] + 20.0 - 105.0 * u));
                    bst_assert_close(p[2], 5.0, 1e-9);
                }
                bst_assert_close(to, 0.0, 1e-6);
            }
            /* light of the middle of a long line in the pixel on it */
            double line = erf(0.5 / (0.85 * sqrt(2.0)));
            double share = line * line * 0.85 * sqrt(2.0 * BST_PI) / 175.0;
            bst_assert_close(bst_smear_nodes_peak_share(list.items, list.count, 0.85) / share, 1.0,
                             0.1); /* nodes up to 1.5 px apart */
            free(list.items);
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(nodes_keep_the_moments_along_a_line),
        cmocka_unit_test(three_nodes_follow_a_bend),
        cmocka_unit_test(pairs_keep_what_is_left),
        cmocka_unit_test(covariance_left_out_in_a_wide_field),
        cmocka_unit_test(higher_moments_one_by_one),
        cmocka_unit_test(moments_of_nodes_on_a_bend_are_no_error),
        cmocka_unit_test(the_fewest_nodes_are_chosen),
        cmocka_unit_test(errors_go_with_powers_of_the_scale),
        cmocka_unit_test(round_jitter_widens_or_splits),
        cmocka_unit_test(long_paths_have_as_many_parts_as_they_need),
        cmocka_unit_test(a_curved_path_keeps_its_moments),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
