/* Hypotheses of a target's pose: their prediction against the motion itself, their loss against
 * derivatives, the covariance of a fit against derivatives of predicted outlines, and their mean.
 */
#include "imgproc/extended/pose_bank.h"
#include "tests/test_support.h"

enum { N = BST_POSE_STATES, M = BST_POSE_UNKNOWNS };

static const double SCALE = 4e-4; /* rad per px */

/* Coordinates of a fixed vector in a body that has turned by `turn` (Rodrigues). */
static bst_vec3 seen_from(bst_vec3 v, bst_vec3 turn) {
    double angle = bst_vec3_norm(turn);
    if (!(angle > 0.0)) {
        return v;
    }
    bst_vec3 e = bst_vec3_scale(turn, 1.0 / angle);
    bst_vec3 out = bst_vec3_scale(v, cos(angle));
    out = bst_vec3_axpy(out, -sin(angle), bst_vec3_cross(e, v));
    return bst_vec3_axpy(out, (1.0 - cos(angle)) * bst_vec3_dot(e, v), e);
}

static bst_pose_filter a_filter(const double sigma[N], double slant) {
    bst_pose_filter f = {
        .pose = {.q_body_from_gcrf = bst_quat_from_rotvec((bst_vec3){0.5, -1.2, 0.8}),
                 .depth_m = 300.0},
        .rate_radps = {0.004, -0.011, 0.006},
        .approach = -0.002};
    for (int i = 0; i < N; i++) {
        for (int k = 0; k < N; k++) {
            double r = i == k ? 1.0 : slant * cos(1.7 * (i + k)) / (1.0 + abs(i - k));
            f.covariance[i * N + k] = r * sigma[i] * sigma[k];
        }
    }
    return f;
}

/* Change of the states after dt by a small change before, of the motion itself. */
static void flow(const bst_pose_filter *f, double dt, double jacobian[N][N]) {
    const double h = 1e-6;
    const bst_vec3 axes[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    memset(jacobian, 0, N * sizeof jacobian[0]);
    for (int k = 0; k < 6; k++) {
        bst_vec3 moved[3], plain[3];
        bst_vec3 by = bst_vec3_scale(axes[k % 3], h);
        bst_vec3 turn = bst_vec3_scale(f->rate_radps, dt);
        bst_vec3 other = k < 3 ? turn : bst_vec3_axpy(turn, dt, by);
        for (int n = 0; n < 3; n++) {
            plain[n] = seen_from(axes[n], turn);
            moved[n] = seen_from(k < 3 ? seen_from(axes[n], by) : axes[n], other);
        }
        /* moved = plain - e x plain: e from the sum of plain x (moved - plain), -2 e */
        bst_vec3 sum = {0, 0, 0};
        for (int n = 0; n < 3; n++) {
            sum = bst_vec3_add(sum, bst_vec3_cross(plain[n], bst_vec3_sub(moved[n], plain[n])));
        }
        jacobian[0][k] = -0.5 * sum.x / h;
        jacobian[1][k] = -0.5 * sum.y / h;
        jacobian[2][k] = -0.5 * sum.z / h;
    }
    for (int k = 3; k < N; k++) {
        jacobian[k][k] = 1.0;
    }
    jacobian[6][7] = dt;
}

/* The body's axes turn with it, the depth grows as its rate says; errors move as the motion moves
 * them, where turns of 0.03 rad change what a rate adds by half of that. */
static void prediction(void **state) {
    (void)state;
    const double dt = 2.5;
    static const double sigmas[3][N] = {{0.3, 0.1, 0.02, 1e-6, 1e-6, 1e-6, 0.05, 1e-6},
                                        {1e-3, 1e-3, 1e-3, 0.1, 0.12, 0.09, 1e-3, 0.2},
                                        {0.2, 0.3, 0.25, 0.1, 0.12, 0.08, 0.1, 0.03}};
    static const double tolerance[3] = {1e-3, 0.03, 0.03};
    for (int n = 0; n < 3; n++) {
        bst_pose_filter before = a_filter(sigmas[n], 0.6), after = before;
        bst_pose_filter_predict(&after, dt);
        const bst_vec3 turn = bst_vec3_scale(before.rate_radps, dt), v = {0.3, -0.8, 0.5};
        bst_vec3 is = bst_quat_rotate(after.pose.q_body_from_gcrf, v);
        bst_vec3 to = seen_from(bst_quat_rotate(before.pose.q_body_from_gcrf, v), turn);
        bst_assert_close(bst_vec3_norm(bst_vec3_sub(is, to)), 0.0, 1e-14);
        bst_assert_close(after.pose.depth_m, 300.0 * exp(-0.002 * dt), 1e-10);
        /* at a constant velocity r = r0 (1 + a t), so that the rate is a / (1 + a t) */
        bst_assert_close(after.approach, -0.002 / (1.0 - 0.002 * dt), 1e-7);
        double j[N][N], expected[N][N] = {{0}};
        flow(&before, dt, j);
        for (int i = 0; i < N * N * N * N; i++) {
            int a = i % N, b = i / N % N, c = i / N / N % N, d = i / N / N / N;
            expected[a][b] += j[a][c] * before.covariance[c * N + d] * j[b][d];
        }
        for (int a = 0; a < N; a++) {
            for (int b = 0; b < N; b++) {
                bst_assert_close(after.covariance[a * N + b], expected[a][b],
                                 tolerance[n] * sqrt(expected[a][a] * expected[b][b]) + 1e-5);
            }
        }
    }
}

/* White noise of a rate that is integrated once and twice: q dt, q dt^2 / 2, q dt^3 / 3, with a
 * tenth of the cube of the rate, and of no less than 0.01 rad/s. */
static void noise_of_the_rate(void **state) {
    (void)state;
    static const double none[N] = {0};
    for (int k = 0; k < 2; k++) {
        const double dt = 1.7, rate = k ? 0.03 : 0.002;
        bst_pose_filter f = a_filter(none, 0.0);
        f.rate_radps = bst_vec3_scale(bst_vec3_unit((bst_vec3){2, -1, 3}), rate);
        bst_pose_filter_predict(&f, dt);
        const double q = 0.1 * pow(k ? 0.03 : 0.01, 3);
        for (int i = 0; i < 3; i++) {
            for (int n = 0; n < N; n++) {
                double turn = n == i ? q * dt * dt * dt / 3.0 : n == 3 + i ? q * dt * dt / 2.0 : 0;
                double speed = n == i ? q * dt * dt / 2.0 : n == 3 + i ? q * dt : 0.0;
                bst_assert_close(f.covariance[i * N + n], turn, 1e-12 * q);
                bst_assert_close(f.covariance[(3 + i) * N + n], speed, 1e-12 * q);
            }
        }
        const double of_depth = f.covariance[7 * N + 7] / dt;
        assert_true(of_depth > 0.0);
        bst_assert_close(f.covariance[6 * N + 7], of_depth * dt * dt / 2.0, 1e-15);
        bst_assert_close(f.covariance[7 * N + 6], of_depth * dt * dt / 2.0, 1e-15);
        bst_assert_close(f.covariance[6 * N + 6], of_depth * dt * dt * dt / 3.0, 1e-15);
    }
}

static const bst_target_outline nothing;

/* The weight of a residual is half the slope of the cost over the residual, on both sides and for
 * both widths of the loss; the loss ends at the square of its width. */
static void loss(void **state) {
    (void)state;
    bst_target_sight sight = {.size_px = 150.0, .model_sigma = 0.004};
    const double sigma = bst_pose_filter_sigma_px(&sight), h = 1e-4;
    bst_assert_close(sigma, sqrt(0.3 * 0.3 + 0.6 * 0.6), 1e-12);
    for (int side = -1; side <= 1; side += 2) {
        for (double r = 0.2; r < 9.0; r += 1.1) {
            for (int wide = 1; wide <= 2; wide++) {
                double cost[2], inside;
                for (int k = 0; k < 2; k++) {
                    bst_target_outline o = nothing;
                    o.support_px[7] = -side * (r + (k ? h : -h));
                    cost[k] = bst_pose_filter_cost(&sight, &o, wide, &inside);
                }
                double slope = (cost[1] - cost[0]) / (2.0 * h);
                double w = bst_pose_filter_weight(side * r, sigma, wide);
                bst_assert_close(w / (0.5 * slope / r), 1.0, 1e-5);
                bst_assert_close(inside, r < 2.0 * sigma ? 1.0 : 35.0 / 36.0, 1e-12);
            }
        }
        bst_target_outline far = nothing;
        far.support_px[3] = -side * 1e6;
        /* twelve of the 36 directions count as independent */
        bst_assert_close(bst_pose_filter_cost(&sight, &far, 1.0, NULL),
                         (side < 0 ? 9.0 : 25.0) / 3.0, 1e-6);
    }
}

static void turned(bst_target_pose *pose, int k, double by) {
    const bst_vec3 turn = {k == 0 ? by : 0.0, k == 1 ? by : 0.0, k == 2 ? by : 0.0};
    pose->q_body_from_gcrf =
        bst_quat_mul(bst_quat_from_rotvec(bst_vec3_scale(turn, -1.0)), pose->q_body_from_gcrf);
    pose->depth_m *= k == 6 ? exp(by) : 1.0;
    pose->x_px += k == 8 ? by : 0.0;
    pose->y_px += k == 9 ? by : 0.0;
}

/* Inverse by Gauss and Jordan. */
static void invert(double a[M][M], double out[M][M]) {
    for (int i = 0; i < M; i++) {
        for (int k = 0; k < M; k++) {
            out[i][k] = i == k;
        }
    }
    for (int p = 0; p < M; p++) {
        double pivot = a[p][p];
        for (int k = 0; k < M; k++) {
            a[p][k] /= pivot;
            out[p][k] /= pivot;
        }
        for (int i = 0; i < M; i++) {
            double f = a[i][p];
            for (int k = 0; k < M && i != p; k++) {
                a[i][k] -= f * a[p][k];
                out[i][k] -= f * out[p][k];
            }
        }
    }
}

/* The outline of the hypothesis itself: the covariance is the inverse of the prior's information
 * and that of the directions, with slopes by differences of outlines. From a start beside it the
 * fit comes back. */
static void covariance_of_a_fit(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_target_model *model;
    bst_assert_ok(
        &ctx, bst_target_model_load(&ctx, "scenarios/satellites/inspection_client.json", &model));
    static const double sigma[N] = {0.2, 0.1, 0.3, 0.01, 0.02, 0.015, 0.06, 0.01};
    bst_pose_filter f = a_filter(sigma, 0.3);
    f.pose.depth_m = 90.0;
    f.pose.x_px = 7.0;
    f.pose.y_px = -4.0;
    bst_target_sight sight = {.q_local_from_gcrf = bst_quat_from_rotvec((bst_vec3){-0.4, 0.9, 0.2}),
                              .sun_local = bst_vec3_unit((bst_vec3){0.3, -0.2, -0.9}),
                              .scale_rad = SCALE,
                              .full_e = 1e5,
                              .least_e = 10.0,
                              .size_px = 120.0,
                              .model_sigma = 0.002};
    bst_target_outline o, side[2];
    assert_true(bst_target_model_predict(model, &sight, &f.pose, &o));
    memcpy(sight.support_px, o.support_px, sizeof sight.support_px);
    double a[M][M] = {{0}}, prior[M][M] = {{0}}, inverse[M][M], slope[M][BST_TARGET_DIRECTIONS];
    for (int i = 0; i < M; i++) {
        for (int k = 0; k < M; k++) {
            prior[i][k] = i < N && k < N ? f.covariance[i * N + k] : i == k ? 120.0 * 120.0 : 0.0;
        }
        const double h = i < N ? 1e-6 : 1e-4;
        bst_target_pose moved[2] = {f.pose, f.pose};
        turned(&moved[0], i, h);
        turned(&moved[1], i, -h);
        for (int k = 0; k < 2; k++) {
            assert_true(bst_target_model_predict(model, &sight, &moved[k], &side[k]));
        }
        for (int k = 0; k < BST_TARGET_DIRECTIONS; k++) {
            slope[i][k] = (side[0].support_px[k] - side[1].support_px[k]) / (2.0 * h);
        }
    }
    invert(prior, a);
    const double weight = 12.0 / 36.0 / (0.3 * 0.3 + 0.24 * 0.24);
    for (int i = 0; i < M * M * BST_TARGET_DIRECTIONS; i++) {
        int p = i % M, q = i / M % M, k = i / M / M;
        a[p][q] += weight * slope[p][k] * slope[q][k];
    }
    invert(a, inverse);
    bst_pose_filter fitted = f;
    assert_true(bst_pose_filter_update(&fitted, model, &sight, &f.pose, 1));
    assert_int_equal(fitted.frames, 1);
    bst_assert_close(fitted.cost, 0.0, 1e-9);
    for (int i = 0; i < N; i++) {
        assert_true(inverse[i][i] < 0.9 * sigma[i] * sigma[i] || (i > 2 && i != 6));
        for (int k = 0; k < N; k++) {
            bst_assert_close(fitted.covariance[i * N + k], inverse[i][k],
                             1e-4 * sqrt(inverse[i][i] * inverse[k][k]));
        }
    }
    bst_assert_close(fitted.centre_xx, inverse[8][8], 1e-4 * inverse[8][8]);
    bst_assert_close(fitted.centre_xy, inverse[8][9], 1e-4 * sqrt(inverse[8][8] * inverse[9][9]));
    bst_assert_close(fitted.centre_yy, inverse[9][9], 1e-4 * inverse[9][9]);
    static const double beside[M] = {0.02, -0.03, 0.025, 0, 0, 0, 0.01, 0, 0.6, -0.9};
    bst_target_pose start = f.pose;
    for (int i = 0; i < M; i++) {
        turned(&start, i, beside[i]);
    }
    fitted = f;
    assert_true(bst_pose_filter_update(&fitted, model, &sight, &start, 12));
    bst_assert_close(fitted.pose.x_px, 7.0, 0.02); /* a tenth of the standard deviation */
    bst_assert_close(fitted.pose.y_px, -4.0, 0.02);
    bst_assert_close(fitted.pose.depth_m, 90.0, 0.1);
    bst_vec3 off = bst_quat_to_rotvec(
        bst_quat_mul(fitted.pose.q_body_from_gcrf, bst_quat_conj(f.pose.q_body_from_gcrf)));
    bst_assert_close(bst_vec3_norm(off), 0.0, 1e-3);
    bst_target_model_free(model);
}

/* The estimate is the mean of the hypotheses with the weights of their scores, and its covariance
 * is theirs about it, those of a cost above its six degrees of freedom widened. Outlines are the
 * model's own, of a body that tumbles, and the place found is right. */
static void mean_of_hypotheses(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_target_model *model;
    bst_assert_ok(
        &ctx, bst_target_model_load(&ctx, "scenarios/satellites/inspection_client.json", &model));
    static bst_pose_bank bank;
    memset(&bank, 0, sizeof bank);
    int mixed = 0, last = -1;
    for (int frame = 0; frame < 14; frame++) {
        bst_target_sight sight = {.q_local_from_gcrf = BST_QUAT_IDENTITY,
                                  .sun_local = bst_vec3_unit((bst_vec3){0.2, -0.1, -0.95}),
                                  .scale_rad = SCALE,
                                  .full_e = 1e5,
                                  .least_e = 10.0,
                                  .model_sigma = 0.002};
        const bst_target_pose truth = {
            .q_body_from_gcrf = bst_quat_from_rotvec((bst_vec3){0.3 + 0.04 * frame, -0.9, 0.7}),
            .x_px = 5.0,
            .y_px = -8.0,
            .depth_m = 80.0 - 0.3 * frame};
        bst_target_outline o;
        assert_true(bst_target_model_predict(model, &sight, &truth, &o));
        for (int k = 0; k < BST_TARGET_DIRECTIONS; k++) { /* frames with larger errors as well */
            sight.support_px[k] = o.support_px[k] + 0.4 * (frame % 3) * sin(7.0 * k + frame);
        }
        for (int k = 0; k < BST_TARGET_DIRECTIONS / 2; k++) {
            sight.size_px =
                fmax(sight.size_px, o.support_px[k] + o.support_px[k + BST_TARGET_DIRECTIONS / 2]);
        }
        bst_pose_estimate e;
        last = bst_pose_bank_step(&bank, model, &sight, 2.0 * frame, 70.0, &e);
        assert_true(bank.count > 0);
        double sum = 0.0, mean[3] = {0}, c[3] = {0}, depth = 0.0, best = INFINITY;
        for (int i = 0; i < bank.count; i++) {
            best = fmin(best, bank.filter[i].score);
        }
        bst_assert_close(bank.filter[0].score, best, 0.0); /* the best first */
        for (int pass = 0; pass < 2; pass++) {
            for (int i = 0; i < bank.count; i++) {
                const bst_pose_filter *f = &bank.filter[i];
                double w = exp(-0.5 * (f->score - best)), log_depth = log(f->pose.depth_m);
                double more = fmax(f->cost / 6.0, 1.0);
                if (pass == 0) {
                    sum += w;
                    mean[0] += w * f->pose.x_px;
                    mean[1] += w * f->pose.y_px;
                    mean[2] += w * log_depth;
                    continue;
                }
                double dx = f->pose.x_px - mean[0], dy = f->pose.y_px - mean[1];
                c[0] += w / sum * (more * f->centre_xx + dx * dx);
                c[1] += w / sum * (more * f->centre_xy + dx * dy);
                c[2] += w / sum * (more * f->centre_yy + dy * dy);
                depth += w / sum * (f->covariance[6 * N + 6] + pow(log_depth - mean[2], 2));
            }
            for (int k = 0; k < 3 && pass == 0; k++) {
                mean[k] /= sum;
            }
        }
        mixed += sum > 1.01;
        bst_assert_close(e.x_px, mean[0], 1e-9); /* rounding of squares of 10 px */
        bst_assert_close(e.y_px, mean[1], 1e-9);
        bst_assert_close(log(e.depth_m), mean[2], 1e-9);
        bst_assert_close(e.cov_xx, c[0], 1e-9 * (1.0 + c[0]));
        bst_assert_close(e.cov_xy, c[1], 1e-9 * (1.0 + c[0]));
        bst_assert_close(e.cov_yy, c[2], 1e-9 * (1.0 + c[2]));
        bst_assert_close(e.depth_sigma_share, sqrt(depth), 1e-7);
        if (frame >= 10) {
            assert_true(hypot(e.x_px - 5.0, e.y_px + 8.0) < 0.5); /* of a body of 90 px */
            bst_assert_close(e.depth_m / truth.depth_m, 1.0, 0.01);
        }
    }
    assert_true(last == 1 && mixed >= 2);
    bst_target_model_free(model);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(prediction), cmocka_unit_test(noise_of_the_rate), cmocka_unit_test(loss),
        cmocka_unit_test(covariance_of_a_fit), cmocka_unit_test(mean_of_hypotheses)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
