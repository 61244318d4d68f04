/* Attitude from stars against its bound, with wrong identities, and where it must say no. */
#include "boresight/rng.h"
#include "sim/core/symmetric.h"
#include "tests/test_support.h"
#include "tracker/attitude/attitude.h"
#include "tracker/attitude/attitude_error.h"

#define AS BST_ARCSEC_RAD
#define MAX_STARS 10000

static bst_camera camera = {.width_px = 1024, .height_px = 1024, .pixel_scale_arcsec = 3.0};
static const bst_attitude_params params = {
    .floor_px = 0.0, .reject_chi2 = 18.4, .max_cross_rad = 6.0 * AS, .max_roll_rad = 600.0 * AS};

typedef struct scene {
    bst_quat q_true;
    bst_attitude_star stars[MAX_STARS];
    int count;
} scene;

static scene work;

/* Stars all over the sensor with centroid errors of 0.1 px (a third of them of 0.3 px); the last
 * `wrong` ones are displaced by 2 to 40 px. */
static scene *make_scene(uint64_t seed, int count, int wrong, double extent_px) {
    bst_rng_key key = bst_rng_make_key(seed, 0, "test", "attitude");
    scene *s = &work;
    double a[2], b[2];
    bst_rng_normal2(key, 0, 0, a);
    bst_rng_normal2(key, 0, 1, b);
    s->q_true = bst_quat_unit((bst_quat){a[0], a[1], b[0], b[1]});
    s->count = count;
    for (int i = 0; i < count; i++) {
        uint64_t n = 10 + 10 * (uint64_t)i;
        double x = 511.5 + extent_px * (bst_rng_uniform(key, 1, n) - 0.5);
        double y = 511.5 + extent_px * (bst_rng_uniform(key, 1, n + 1) - 0.5);
        double sigma = i % 3 == 2 ? 0.3 : 0.1, e[2], angle;
        bst_rng_normal2(key, 1, n + 2, e);
        angle = 2 * BST_PI * bst_rng_uniform(key, 1, n + 3);
        double off = i >= count - wrong ? 2.0 + 38.0 * bst_rng_uniform(key, 1, n + 4) : 0.0;
        s->stars[i] =
            (bst_attitude_star){.apparent_gcrf = bst_quat_rotate(
                                    bst_quat_conj(s->q_true), bst_camera_unproject(&camera, x, y)),
                                .x_px = x + sigma * e[0] + off * cos(angle),
                                .y_px = y + sigma * e[1] + off * sin(angle),
                                .cov_xx = sigma * sigma,
                                .cov_yy = sigma * sigma};
    }
    return s;
}

/* RMS over trials of each axis' error over its Cramer-Rao bound (from the right stars alone). */
static void check_bound(int count, int wrong) {
    enum { TRIALS = 500 };
    double ratio[3] = {0}, nees = 0.0;
    int valid = 0;
    for (uint64_t t = 0; t < TRIALS; t++) {
        scene *s = make_scene(t + 1000, count, wrong, 1000.0);
        bst_rng_key key = bst_rng_make_key(t, 0, "test", "start");
        double shift[2];
        bst_rng_normal2(key, 0, 0, shift);
        /* telemetry off by some 100 px and 0.1 degree of roll */
        bst_vec3 off = {300 * AS * shift[0], 300 * AS * shift[1], 0.002};
        bst_quat start = bst_quat_mul(bst_quat_from_rotvec(off), s->q_true);
        /* the bound, from the closed form of the information of small rotations: a star at tangent
         * coordinates (a, b) has rows (-ab, 1+a^2, -b) and (-(1+b^2), ab, a), per pixel */
        double info[3][3] = {{0}};
        for (int i = 0; i < count - wrong; i++) {
            bst_vec3 v = bst_quat_rotate(s->q_true, s->stars[i].apparent_gcrf);
            double a = v.x / v.z, b = v.y / v.z, f = 1.0 / (3.0 * AS);
            double j[2][3] = {{-a * b * f, (1 + a * a) * f, -b * f},
                              {-(1 + b * b) * f, a * b * f, a * f}};
            for (int k = 0; k < 3; k++) {
                for (int m = 0; m < 3; m++) {
                    info[k][m] += (j[0][k] * j[0][m] + j[1][k] * j[1][m]) / s->stars[i].cov_xx;
                }
            }
        }
        bst_attitude_solution out;
        bst_attitude_solve(&camera, &params, start, s->stars, s->count, &out);
        if (!out.valid) {
            continue;
        }
        valid++;
        bst_vec3 e =
            bst_quat_to_rotvec(bst_quat_mul(out.q_cam_from_gcrf, bst_quat_conj(s->q_true)));
        double x[3] = {e.x, e.y, e.z};
        double det = info[0][0] * (info[1][1] * info[2][2] - info[1][2] * info[2][1]) -
                     info[0][1] * (info[1][0] * info[2][2] - info[1][2] * info[2][0]) +
                     info[0][2] * (info[1][0] * info[2][1] - info[1][1] * info[2][0]);
        for (int k = 0; k < 3; k++) {
            int p = (k + 1) % 3, q = (k + 2) % 3;
            double bound = (info[p][p] * info[q][q] - info[p][q] * info[q][p]) / det;
            ratio[k] += x[k] * x[k] / bound;
            for (int m = 0; m < 3; m++) {
                nees += x[k] * info[k][m] * x[m];
            }
        }
    }
    print_message("%d stars, %d wrong: valid %d, error / bound %.3f %.3f %.3f, NEES/3 %.3f\n",
                  count, wrong, valid, sqrt(ratio[0] / valid), sqrt(ratio[1] / valid),
                  sqrt(ratio[2] / valid), nees / 3.0 / valid);
    assert_true(valid >= TRIALS * 99 / 100);
    for (int k = 0; k < 3; k++) {
        /* the ratio's own 1 sigma over 500 trials is 0.032 */
        assert_true(sqrt(ratio[k] / valid) <= 1.1);
        assert_true(sqrt(ratio[k] / valid) >=
                    0.9); /* better than the bound would be a wrong bound */
    }
}

static void error_meets_the_bound(void **state) {
    (void)state;
    check_bound(3, 0);
    check_bound(10, 0);
    check_bound(100, 0);
    check_bound(10, 1);
    check_bound(100, 10);
}

static void exact_without_noise(void **state) {
    (void)state;
    scene *s = make_scene(5, 2, 0, 900.0);
    for (int i = 0; i < s->count; i++) {
        bst_vec3 v = bst_quat_rotate(s->q_true, s->stars[i].apparent_gcrf);
        assert_true(bst_camera_project(&camera, v, &s->stars[i].x_px, &s->stars[i].y_px));
    }
    /* a start 2 degrees and 5 degrees of roll away */
    bst_quat start = bst_quat_mul(bst_quat_from_rotvec((bst_vec3){0.02, -0.028, 0.087}), s->q_true);
    bst_attitude_solution out;
    bst_attitude_solve(&camera, &params, start, s->stars, s->count, &out);
    assert_true(out.valid);
    bst_vec3 e = bst_quat_to_rotvec(bst_quat_mul(out.q_cam_from_gcrf, bst_quat_conj(s->q_true)));
    /* pixels of 1.5e-5 rad hold 1e-13 of themselves; roll has 450 px of lever */
    bst_assert_close(bst_vec3_norm(e), 0.0, 1e-13);
}

/* Stars whose errors slant, each in its own direction, four times as large along it as across. At
 * the solution the slope of chi-square by each axis is zero, and the covariance is the inverse of
 * half its curvature: (sum of J^T C^-1 J)^-1, with J by turning the camera a little. */
static void slanting_errors_have_their_weight(void **state) {
    (void)state;
    enum { N = 9 };
    scene *s = make_scene(8, N, 0, 900.0);
    double c_inverse[N][2][2];
    for (int i = 0; i < N; i++) {
        double c = cos(0.7 * i + 0.3), n = sin(0.7 * i + 0.3), along = 0.16,
               across = 0.01; /* px^2 */
        s->stars[i].cov_xx = along * c * c + across * n * n;
        s->stars[i].cov_xy = (along - across) * c * n;
        s->stars[i].cov_yy = along * n * n + across * c * c;
        c_inverse[i][0][0] = c * c / along + n * n / across;
        c_inverse[i][0][1] = c_inverse[i][1][0] = c * n / along - c * n / across;
        c_inverse[i][1][1] = n * n / along + c * c / across;
        s->stars[i].x_px += 0.2 * c * sin(2.0 * i);
        s->stars[i].y_px += 0.2 * n * sin(2.0 * i);
    }
    bst_attitude_solution out;
    bst_attitude_solve(&camera, &params, s->q_true, s->stars, N, &out);
    assert_true(out.valid && out.stars_used == N);
    bst_assert_close(out.excess_px, 0.0, 0.0);
    double half_curve[3][3] = {{0.0}}, slope[3] = {0.0}, want[3][3];
    const double h = 1e-5; /* rad: 0.7 px */
    for (int i = 0; i < N; i++) {
        double j[2][3], at[2];
        for (int k = 0; k < 7; k++) {
            double turn[3] = {0.0}, x, y;
            turn[k / 2 % 3] = k == 6 ? 0.0 : k % 2 ? h : -h;
            bst_quat q = bst_quat_mul(bst_quat_from_rotvec((bst_vec3){turn[0], turn[1], turn[2]}),
                                      out.q_cam_from_gcrf);
            assert_true(
                bst_camera_project(&camera, bst_quat_rotate(q, s->stars[i].apparent_gcrf), &x, &y));
            if (k == 6) {
                at[0] = s->stars[i].x_px - x;
                at[1] = s->stars[i].y_px - y;
            } else if (k % 2 == 0) {
                j[0][k / 2] = -x / (2.0 * h);
                j[1][k / 2] = -y / (2.0 * h);
            } else {
                j[0][k / 2] += x / (2.0 * h);
                j[1][k / 2] += y / (2.0 * h);
            }
        }
        for (int k = 0; k < 12; k++) { /* rows a and b of the products */
            int a = k / 4 % 3, m = k % 4 / 2, n = k % 2;
            slope[a] += j[m][a] * c_inverse[i][m][n] * at[n];
            for (int b = 0; b < 3; b++) {
                half_curve[a][b] += j[m][a] * c_inverse[i][m][n] * j[n][b];
            }
        }
    }
    assert_true(bst_symmetric_invert(3, half_curve[0], want[0]));
    for (int a = 0; a < 3; a++) {
        /* a slope that would move the solution by a thousandth of its standard deviation */
        bst_assert_close(slope[a] * sqrt(want[a][a]), 0.0, 1e-3);
        for (int b = 0; b < 3; b++) {
            bst_assert_close(out.covariance[a][b], want[a][b],
                             1e-6 * sqrt(want[a][a] * want[b][b]));
        }
    }
}

/* Rotation and 10 % of distortion in the corner change nothing in how well the attitude is known.
 */
static void distorted_cameras_are_as_good(void **state) {
    bst_camera plain = camera;
    double corner = 724.0 * bst_camera_scale_rad(&camera);
    camera.rotation_deg = -37.0;
    camera.distortion.k1 = 0.1 / (corner * corner);
    camera.distortion.p1 = 0.003 / corner;
    bst_ctx ctx = {0};
    bst_assert_ok(&ctx, bst_camera_prepare(&ctx, &camera));
    exact_without_noise(state);
    double ratio[3] = {0};
    enum { TRIALS = 300 };
    for (uint64_t t = 0; t < TRIALS; t++) {
        scene *s = make_scene(3000 + t, 30, 0, 1000.0);
        bst_attitude_solution out;
        bst_attitude_solve(&camera, &params, s->q_true, s->stars, s->count, &out);
        assert_true(out.valid);
        bst_vec3 e =
            bst_quat_to_rotvec(bst_quat_mul(out.q_cam_from_gcrf, bst_quat_conj(s->q_true)));
        const double axis[3] = {e.x, e.y, e.z};
        for (int k = 0; k < 3; k++) {
            ratio[k] += axis[k] * axis[k] / out.covariance[k][k] / TRIALS;
        }
    }
    for (int k = 0; k < 3; k++) {
        /* 1 sigma of the mean of 300 squared normals is 0.08, and the covariance is widened by
         * chance misfits */
        bst_assert_close(ratio[k], 1.0, 0.3);
    }
    camera = plain;
}

static void thousands_of_stars(void **state) {
    (void)state;
    scene *s = make_scene(6, MAX_STARS, MAX_STARS / 5, 1000.0);
    bst_attitude_solution out;
    bst_attitude_solve(&camera, &params, s->q_true, s->stars, s->count, &out);
    assert_true(out.valid);
    assert_true(out.stars_used >= MAX_STARS * 79 / 100 && out.stars_used <= MAX_STARS * 81 / 100);
    bst_vec3 e = bst_quat_to_rotvec(bst_quat_mul(out.q_cam_from_gcrf, bst_quat_conj(s->q_true)));
    assert_true(fabs(e.x) < 4.5 * sqrt(out.covariance[0][0]));
    assert_true(fabs(e.y) < 4.5 * sqrt(out.covariance[1][1]));
    assert_true(fabs(e.z) < 4.5 * sqrt(out.covariance[2][2]));
}

/* Centroids three times worse than they say: the stars still count, the covariance knows. */
static void optimistic_variances(void **state) {
    (void)state;
    double nees = 0.0;
    for (uint64_t seed = 0; seed < 200; seed++) {
        scene *s = make_scene(seed, 40, 4, 1000.0);
        for (int i = 0; i < s->count; i++) {
            s->stars[i].cov_xx /= 9.0;
            s->stars[i].cov_yy /= 9.0;
        }
        bst_attitude_solution out;
        bst_attitude_solve(&camera, &params, s->q_true, s->stars, s->count, &out);
        assert_true(out.valid);
        assert_true(out.stars_used >= 33);
        bst_vec3 e =
            bst_quat_to_rotvec(bst_quat_mul(out.q_cam_from_gcrf, bst_quat_conj(s->q_true)));
        nees += (e.x * e.x / out.covariance[0][0] + e.y * e.y / out.covariance[1][1]) / 400.0;
    }
    /* mean of 400 squared normals: 1 sigma 0.07; dof of about 70 spread the factor by 0.17 */
    bst_assert_close(nees, 1.0, 0.35);
}

/* Stars of 0.004 to 0.1 px whose catalogue places are wrong by 0.03 px per axis, which their
 * covariances do not say: the error stays within 1.1 of the bound that knows it, and what is stated
 * is true. The same stars in a right catalogue are not weighed down. */
static void errors_of_the_catalogue(void **state) {
    (void)state;
    enum { TRIALS = 400, COUNT = 25 };
    for (int wrong = 0; wrong < 2; wrong++) {
        double ratio = 0.0, nees = 0.0, excess = 0.0;
        int found = 0;
        for (uint64_t t = 0; t < TRIALS; t++) {
            scene *s = make_scene(t + 5000, COUNT, 0, 1000.0);
            bst_rng_key key = bst_rng_make_key(t, 0, "test", "errors_of_the_catalogue");
            double error = wrong ? 0.03 : 0.0, info = 0.0;
            for (int i = 0; i < COUNT; i++) {
                bst_attitude_star *star = &s->stars[i];
                double e[2], c[2], x, y, sigma = 0.004 * pow(25.0, i / (COUNT - 1.0));
                bst_rng_normal2(key, 0, (uint64_t)i, e);
                bst_rng_normal2(key, 1, (uint64_t)i, c);
                assert_true(bst_camera_project(
                    &camera, bst_quat_rotate(s->q_true, star->apparent_gcrf), &x, &y));
                star->x_px = x + sigma * e[0] + error * c[0];
                star->y_px = y + sigma * e[1] + error * c[1];
                star->cov_xx = star->cov_yy = sigma * sigma;
                info += 1.0 / (sigma * sigma + error * error);
            }
            bst_attitude_solution out;
            bst_attitude_solve(&camera, &params, s->q_true, s->stars, COUNT, &out);
            assert_true(out.valid);
            bst_vec3 e =
                bst_quat_to_rotvec(bst_quat_mul(out.q_cam_from_gcrf, bst_quat_conj(s->q_true)));
            /* about the middle of the field, where roll has no part: stars all over it */
            ratio += (e.x * e.x + e.y * e.y) * info / (2.0 * 9.0 * AS * AS);
            nees += e.x * e.x / out.covariance[0][0] + e.y * e.y / out.covariance[1][1];
            excess += out.excess_px;
            found += out.excess_px > 0.0;
        }
        ratio = sqrt(ratio / TRIALS);
        nees /= 2.0 * TRIALS;
        print_message(
            "catalogue wrong by %.2f px: error / bound %.3f, NEES %.3f, excess %.4f px "
            "(%d of %d)\n",
            wrong ? 0.03 : 0.0, ratio, nees, excess / TRIALS, found, TRIALS);
        /* the bound leaves out the roll, which costs some 4 %; 800 draws are good to 2.5 % */
        assert_true(ratio < (wrong ? 1.12 : 1.1));
        /* a variance found from 47 residuals of unequal weight is itself uncertain */
        bst_assert_close(nees, 1.0, wrong ? 0.3 : 0.15);
        if (wrong) {
            bst_assert_close(excess / TRIALS, 0.03, 0.003);
        } else {
            assert_true(found < TRIALS / 50);
        }
    }
}

static void says_no(void **state) {
    (void)state;
    bst_attitude_solution out;
    scene *s = make_scene(7, 1, 0, 900.0);
    bst_attitude_solve(&camera, &params, s->q_true, s->stars, 0, &out);
    assert_false(out.valid);
    bst_attitude_solve(&camera, &params, s->q_true, s->stars, 1, &out);
    assert_false(out.valid);
    /* two stars a few px apart tell no roll */
    s = make_scene(8, 2, 0, 4.0);
    bst_attitude_solve(&camera, &params, s->q_true, s->stars, 2, &out);
    assert_false(out.valid);
    /* one star twice */
    s->stars[1] = s->stars[0];
    bst_attitude_solve(&camera, &params, s->q_true, s->stars, 2, &out);
    assert_false(out.valid);
    /* two stars whose separation is wrong, and three of which one is wrong: which one cannot be
     * decided
     */
    for (uint64_t seed = 0; seed < 50; seed++) {
        s = make_scene(seed, 2, 0, 900.0);
        bst_vec3 along = {s->stars[1].x_px - s->stars[0].x_px, s->stars[1].y_px - s->stars[0].y_px,
                          0};
        along = bst_vec3_unit(along);
        s->stars[1].x_px += 3.0 * along.x;
        s->stars[1].y_px += 3.0 * along.y;
        bst_attitude_solve(&camera, &params, s->q_true, s->stars, 2, &out);
        assert_false(out.valid);
    }
    /* half of the identities wrong, each in its own way */
    int accepted = 0;
    for (uint64_t seed = 0; seed < 50; seed++) {
        s = make_scene(seed, 10, 5, 900.0);
        bst_attitude_solve(&camera, &params, s->q_true, s->stars, 10, &out);
        accepted += out.valid;
    }
    assert_int_equal(accepted, 0);
    /* a star behind the camera and covariances that are none */
    s = make_scene(9, 3, 0, 900.0);
    s->stars[0].apparent_gcrf = bst_vec3_scale(s->stars[0].apparent_gcrf, -1.0);
    s->stars[1].cov_xx = -1.0;
    s->stars[2].x_px = NAN;
    bst_attitude_solve(&camera, &params, s->q_true, s->stars, 3, &out);
    assert_false(out.valid);
}

/* Drift of 5 arcsec/s, fixes with 0.1 px error, 20 % of them missing. */
static void telemetry_error_is_followed(void **state) {
    (void)state;
    const bst_attitude_error_params p = {.rate_sigma_radps = 20 * AS,
                                         .noise_rad2ps3 = pow(0.3 * AS, 2),
                                         .jitter_rad = 0.6 * AS,
                                         .gate_chi2 = 30,
                                         .gate_patience = 3,
                                         .telemetry_sigma_rad = 60 * AS};
    bst_attitude_error f = {0};
    bst_rng_key key = bst_rng_make_key(2, 0, "test", "drift");
    bst_vec3 drift = {3 * AS, -4 * AS, 1 * AS}, error, rate;
    double cov[3][3];
    bst_attitude_error_get(&f, &p, BST_QUAT_IDENTITY, &error, &rate, cov);
    bst_assert_close(sqrt(cov[0][0]), hypot(60, 0.6) * AS, 1e-12); /* closed form */
    double chi2 = 0.0;
    int n = 0;
    for (int k = 0; k < 400; k++) {
        /* the camera turns by 0.02 rad a frame; the error keeps its inertial direction */
        bst_quat q = bst_quat_from_rotvec((bst_vec3){0.01 * k, 0.02 * k, 0.0});
        bst_vec3 true_error = bst_quat_rotate(q, bst_vec3_scale(drift, k));
        bst_attitude_error_predict(&f, &p, 1.0);
        bst_attitude_error_get(&f, &p, q, &error, &rate, cov);
        if (k > 5) {
            bst_vec3 off = bst_vec3_sub(error, true_error);
            chi2 += off.x * off.x / cov[0][0];
            n++;
        }
        if (bst_rng_uniform(key, (uint64_t)k, 9) < 0.2) {
            continue;
        }
        double e[2], g[2];
        bst_rng_normal2(key, (uint64_t)k, 0, e);
        bst_rng_normal2(key, (uint64_t)k, 1, g);
        bst_vec3 z = bst_vec3_add(true_error,
                                  (bst_vec3){0.67 * AS * e[0], 0.67 * AS * e[1], 60 * AS * g[0]});
        const double r[3][3] = {
            {0.09 * AS * AS, 0, 0}, {0, 0.09 * AS * AS, 0}, {0, 0, 3600 * AS * AS}};
        assert_true(bst_attitude_error_update(&f, &p, q, z, r));
    }
    print_message("predicted telemetry error: chi2 of x %.2f\n", chi2 / n);
    assert_true(chi2 / n < 1.2); /* the model allows more drift noise than there is */
    bst_vec3 in_camera = bst_quat_rotate(bst_quat_from_rotvec((bst_vec3){3.99, 7.98, 0.0}), drift);
    bst_assert_close(bst_vec3_norm(bst_vec3_sub(rate, in_camera)), 0.0, 2 * AS);
    /* a jump of the telemetry: refused twice, then believed */
    bst_vec3 z = {4000 * AS, 0, 0};
    const double r[3][3] = {{1e-12, 0, 0}, {0, 1e-12, 0}, {0, 0, 1e-12}};
    assert_false(bst_attitude_error_update(&f, &p, BST_QUAT_IDENTITY, z, r));
    assert_false(bst_attitude_error_update(&f, &p, BST_QUAT_IDENTITY, z, r));
    assert_true(bst_attitude_error_update(&f, &p, BST_QUAT_IDENTITY, z, r));
    bst_attitude_error_get(&f, &p, BST_QUAT_IDENTITY, &error, &rate, NULL);
    bst_assert_close(error.x, 4000 * AS, 1e-12);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(error_meets_the_bound),
                                       cmocka_unit_test(exact_without_noise),
                                       cmocka_unit_test(slanting_errors_have_their_weight),
                                       cmocka_unit_test(distorted_cameras_are_as_good),
                                       cmocka_unit_test(thousands_of_stars),
                                       cmocka_unit_test(optimistic_variances),
                                       cmocka_unit_test(errors_of_the_catalogue),
                                       cmocka_unit_test(says_no),
                                       cmocka_unit_test(telemetry_error_is_followed)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
