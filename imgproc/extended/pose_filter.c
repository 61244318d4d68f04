#include "imgproc/extended/pose_filter.h"

#include <assert.h>
#include <math.h>
#include <string.h>

#include "sim/core/cholesky.h"

/* Standard deviation of the edges of an outline, px: measured, 0.2 to 0.5. */
static const double EDGE_SIGMA_PX = 0.3;
/* Width of the loss, in standard deviations, for a measured outline within the predicted one and
 * outside of it. */
static const double WITHIN = 3.0, OUTSIDE = 5.0;
/* Independent residuals among the directions: neighbours share corners and edges. */
static const double INDEPENDENT = 12.0;
/* Noise of the rate: spectral density over the cube of the rate, least rate, and that of the
 * approach, 1/s^3. */
static const double RATE_NOISE = 0.1, RATE_LEAST_RADPS = 0.01, APPROACH_NOISE = 1e-6;
/* Standard deviation of an unknown rate and approach. */
static const double RATE_SIGMA_RADPS = 0.03, APPROACH_SIGMA = 0.01;

void bst_pose_filter_start(bst_pose_filter *f, const bst_target_pose *pose, double turn_rad,
                           double depth_share) {
    assert(f && pose && turn_rad > 0.0 && depth_share > 0.0);
    *f = (bst_pose_filter){.pose = *pose};
    const double sigma[BST_POSE_STATES] = {turn_rad,         turn_rad,         turn_rad,
                                           RATE_SIGMA_RADPS, RATE_SIGMA_RADPS, RATE_SIGMA_RADPS,
                                           depth_share,      APPROACH_SIGMA};
    for (int i = 0; i < BST_POSE_STATES; i++) {
        f->covariance[i * BST_POSE_STATES + i] = sigma[i] * sigma[i];
    }
}

void bst_pose_filter_predict(bst_pose_filter *f, double dt) {
    assert(f && dt >= 0.0);
    enum { N = BST_POSE_STATES };
    bst_vec3 turn = bst_vec3_scale(f->rate_radps, dt);
    bst_quat q = f->pose.q_body_from_gcrf;
    f->pose.q_body_from_gcrf = bst_quat_unit(bst_quat_turn_frame(q, turn));
    f->pose.depth_m *= exp(f->approach * dt);
    bst_mat3 turned = bst_quat_to_mat3(bst_quat_turn_frame(BST_QUAT_IDENTITY, turn));
    double a[N * N] = {0.0}, b[N * N];
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++) {
            a[i * N + k] = turned.m[i][k];
        }
        a[i * N + 3 + i] = dt;
        a[(3 + i) * N + 3 + i] = 1.0;
    }
    a[6 * N + 6] = a[7 * N + 7] = 1.0;
    a[6 * N + 7] = dt;
    f->approach -= f->approach * f->approach * dt; /* of a constant velocity */
    for (int i = 0; i < N; i++) {
        for (int k = 0; k < N; k++) {
            b[i * N + k] = 0.0;
            for (int n = 0; n < N; n++) {
                b[i * N + k] += a[i * N + n] * f->covariance[n * N + k];
            }
        }
    }
    for (int i = 0; i < N; i++) {
        for (int k = 0; k < N; k++) {
            double sum = 0.0;
            for (int n = 0; n < N; n++) {
                sum += b[i * N + n] * a[k * N + n];
            }
            f->covariance[i * N + k] = sum;
        }
    }
    double rate = fmax(bst_vec3_norm(f->rate_radps), RATE_LEAST_RADPS);
    for (int i = 0; i < 4; i++) {
        int angle = i < 3 ? i : 6, speed = i < 3 ? 3 + i : 7;
        double q2 = i < 3 ? RATE_NOISE * rate * rate * rate : APPROACH_NOISE;
        f->covariance[angle * N + angle] += q2 * dt * dt * dt / 3.0;
        f->covariance[angle * N + speed] += 0.5 * q2 * dt * dt;
        f->covariance[speed * N + angle] += 0.5 * q2 * dt * dt;
        f->covariance[speed * N + speed] += q2 * dt;
    }
}

double bst_pose_filter_sigma_px(const bst_target_sight *sight) {
    assert(sight);
    return hypot(EDGE_SIGMA_PX, sight->model_sigma * sight->size_px);
}

/* Square of a residual in widths of the loss. */
static double squared_width(double residual_px, double sigma_px, double scale) {
    double width = scale * sigma_px * (residual_px < 0.0 ? WITHIN : OUTSIDE);
    return residual_px * residual_px / (width * width);
}

double bst_pose_filter_weight(double residual_px, double sigma_px, double scale) {
    double u = 1.0 + squared_width(residual_px, sigma_px, scale);
    return INDEPENDENT / BST_TARGET_DIRECTIONS / (sigma_px * sigma_px * u * u);
}

double bst_pose_filter_cost(const bst_target_sight *sight, const bst_target_outline *o,
                            double scale, double *inside) {
    assert(sight && o);
    double sigma = bst_pose_filter_sigma_px(sight), sum = 0.0;
    int near = 0;
    for (int k = 0; k < BST_TARGET_DIRECTIONS; k++) {
        double r = sight->support_px[k] - o->support_px[k];
        sum += r * r / (sigma * sigma) / (1.0 + squared_width(r, sigma, scale));
        near += fabs(r) < 2.0 * sigma;
    }
    if (inside) {
        *inside = (double)near / BST_TARGET_DIRECTIONS;
    }
    return sum * INDEPENDENT / BST_TARGET_DIRECTIONS;
}

/* Change of the support along a direction with turn, depth and centre. */
static void slopes(const bst_target_sight *s, const bst_target_outline *o, int k,
                   double slope[BST_POSE_UNKNOWNS]) {
    double angle = 2.0 * BST_PI * k / BST_TARGET_DIRECTIONS;
    bst_vec3 p = o->point_m[k];
    bst_vec3 at = bst_vec3_add(bst_mat3_mul_vec(&o->local_from_body, p), o->centre_m);
    double scale = 1.0 / (at.z * s->scale_rad);
    bst_vec3 g = {scale * cos(angle), scale * sin(angle), -o->support_px[k] / at.z};
    bst_vec3 turn = bst_vec3_cross(p, bst_mat3_transpose_mul_vec(&o->local_from_body, g));
    memset(slope, 0, BST_POSE_UNKNOWNS * sizeof *slope);
    slope[0] = turn.x;
    slope[1] = turn.y;
    slope[2] = turn.z;
    slope[6] = bst_vec3_dot(g, o->centre_m);
    slope[8] = g.x * o->centre_m.z * s->scale_rad;
    slope[9] = g.y * o->centre_m.z * s->scale_rad;
}

/* Differences of the states from those of the prediction. */
static void differences(const bst_pose_filter *f, const bst_pose_filter *prior,
                        double change[BST_POSE_STATES]) {
    bst_quat q =
        bst_quat_mul(f->pose.q_body_from_gcrf, bst_quat_conj(prior->pose.q_body_from_gcrf));
    bst_vec3 turn = bst_vec3_scale(bst_quat_to_rotvec(q), -1.0);
    bst_vec3 rate = bst_vec3_sub(f->rate_radps, prior->rate_radps);
    change[0] = turn.x;
    change[1] = turn.y;
    change[2] = turn.z;
    change[3] = rate.x;
    change[4] = rate.y;
    change[5] = rate.z;
    change[6] = log(f->pose.depth_m / prior->pose.depth_m);
    change[7] = f->approach - prior->approach;
}

/* Moves the unknowns by a step. */
static void move(bst_pose_filter *f, const double step[BST_POSE_UNKNOWNS]) {
    bst_vec3 turn = {step[0], step[1], step[2]};
    double angle = bst_vec3_norm(turn);
    turn = angle > 0.3 ? bst_vec3_scale(turn, 0.3 / angle) : turn;
    bst_quat q = f->pose.q_body_from_gcrf;
    f->pose.q_body_from_gcrf = bst_quat_unit(bst_quat_turn_frame(q, turn));
    f->rate_radps = bst_vec3_add(f->rate_radps, bst_vec3_make(step[3], step[4], step[5]));
    f->pose.depth_m *= exp(fmin(fmax(step[6], -0.3), 0.3));
    f->approach += step[7];
    f->pose.x_px += step[8];
    f->pose.y_px += step[9];
}

/* Normal equations of prior and outline: lower triangle and right-hand side. */
static void normal_equations(const bst_target_sight *s, const bst_target_outline *o,
                             const double *information, const double *change, double scale,
                             double *a, double *b) {
    enum { N = BST_POSE_UNKNOWNS };
    double sigma = bst_pose_filter_sigma_px(s);
    memset(a, 0, N * N * sizeof *a);
    memset(b, 0, N * sizeof *b);
    for (int i = 0; i < BST_POSE_STATES; i++) {
        for (int k = 0; k < BST_POSE_STATES; k++) {
            a[i * N + k] = information[i * BST_POSE_STATES + k];
            b[i] -= information[i * BST_POSE_STATES + k] * change[k];
        }
    }
    a[8 * N + 8] = a[9 * N + 9] = 1.0 / (s->size_px * s->size_px);
    for (int k = 0; k < BST_TARGET_DIRECTIONS; k++) {
        double slope[N], r = s->support_px[k] - o->support_px[k];
        double w = bst_pose_filter_weight(r, sigma, scale);
        slopes(s, o, k, slope);
        for (int i = 0; i < N; i++) {
            for (int j = 0; j <= i; j++) {
                a[i * N + j] += w * slope[i] * slope[j];
            }
            b[i] += w * slope[i] * r;
        }
    }
}

/* Inverse of a matrix whose Cholesky factor is given. */
static void invert(const double *factor, int n, double *out) {
    for (int i = 0; i < n; i++) {
        double column[BST_POSE_UNKNOWNS] = {0.0};
        column[i] = 1.0;
        bst_cholesky_solve(factor, n, n, column);
        for (int k = 0; k < n; k++) {
            out[k * n + i] = column[k];
        }
    }
}

/* Takes over the covariance of the last normal equations. */
static void take_covariance(bst_pose_filter *f, const double *factor) {
    enum { N = BST_POSE_UNKNOWNS };
    double all[N * N];
    invert(factor, N, all);
    for (int i = 0; i < BST_POSE_STATES; i++) {
        for (int k = 0; k < BST_POSE_STATES; k++) {
            f->covariance[i * BST_POSE_STATES + k] = 0.5 * (all[i * N + k] + all[k * N + i]);
        }
    }
    f->centre_xx = all[8 * N + 8];
    f->centre_xy = all[9 * N + 8];
    f->centre_yy = all[9 * N + 9];
}

/* Cost of the changes from the prior. */
static double prior_cost(const double *information, const double *change) {
    double cost = 0.0;
    for (int i = 0; i < BST_POSE_STATES; i++) {
        for (int k = 0; k < BST_POSE_STATES; k++) {
            cost += change[i] * information[i * BST_POSE_STATES + k] * change[k];
        }
    }
    return cost;
}

bool bst_pose_filter_update(bst_pose_filter *filter, bst_target_model *model,
                            const bst_target_sight *sight, const bst_target_pose *start,
                            int rounds) {
    assert(filter && model && sight && start && rounds > 0);
    enum { M = BST_POSE_STATES, N = BST_POSE_UNKNOWNS };
    bst_pose_filter f = *filter, best = {.cost = INFINITY};
    bst_target_outline outline;
    double factor[M * M], information[M * M], a[N * N], b[N], change[M];
    memcpy(factor, f.covariance, sizeof factor);
    if (!bst_cholesky_factor(factor, M, M, 0.0)) {
        return false;
    }
    invert(factor, M, information);
    f.pose = *start;
    for (int round = 0; round <= rounds; round++) {
        if (!bst_target_model_predict(model, sight, &f.pose, &outline)) {
            break;
        }
        differences(&f, filter, change);
        f.cost =
            bst_pose_filter_cost(sight, &outline, 1.0, &f.inside) + prior_cost(information, change);
        normal_equations(sight, &outline, information, change, 1.0, a, b);
        if (!bst_cholesky_factor(a, N, N, 0.0)) {
            break;
        }
        if (f.cost < best.cost) {
            best = f;
            take_covariance(&best, a);
        }
        double scale = fmax(2.0 - round, 1.0);
        if (scale > 1.0) {
            normal_equations(sight, &outline, information, change, scale, a, b);
            if (!bst_cholesky_factor(a, N, N, 0.0)) {
                break;
            }
        }
        bst_cholesky_solve(a, N, N, b);
        move(&f, b);
    }
    if (!isfinite(best.cost)) {
        return false;
    }
    best.frames++;
    *filter = best;
    return true;
}
