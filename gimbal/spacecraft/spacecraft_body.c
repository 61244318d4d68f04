#include "gimbal/spacecraft/spacecraft_body.h"

#include <assert.h>
#include <string.h>

#include "sim/core/invariant.h"

bst_mat3 bst_spacecraft_inertia_matrix(const double i[6]) {
    return (bst_mat3){{{i[0], i[3], i[4]}, {i[3], i[1], i[5]}, {i[4], i[5], i[2]}}};
}

static double element(bst_vec3 v, int i) {
    return i == 0 ? v.x : i == 1 ? v.y : v.z;
}

static void take_away(bst_mat3 *m, double scale, bst_vec3 v) {
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            m->m[i][j] -= scale * element(v, i) * element(v, j);
        }
    }
}

/* Checks that the principal moments (ascending) are physical. */
static bst_status check_inertia(bst_ctx *ctx, const bst_mat3 *inertia) {
    double moment[3];
    bst_dynamics_symmetric_eigen(3, &inertia->m[0][0], moment, NULL);
    if (!(moment[0] > 0.0)) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "inertia_kgm2: not positive definite (its principal moments are %g, %g and "
                        "%g kg m^2); no body has it",
                        moment[0], moment[1], moment[2]);
    }
    /* a flat body has equality, up to rounding in the scenario */
    if (moment[2] > (moment[0] + moment[1]) * (1.0 + 1e-9)) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "inertia_kgm2: the principal moments are %g, %g and %g kg m^2, and the "
                        "largest of a body is at most the sum of the two others",
                        moment[0], moment[1], moment[2]);
    }
    return BST_OK;
}

/* Sets principal axes and moments of the inertia left when wheels and appendages rotate freely. */
static bst_status set_axes(bst_ctx *ctx, bst_spacecraft_body *body) {
    const bst_spacecraft_spec *spec = &body->spec;
    bst_mat3 hub = body->inertia;
    for (int i = 0; i < spec->wheels; i++) {
        take_away(&hub, spec->wheel[i].inertia_kgm2, spec->wheel[i].axis);
    }
    for (int k = 0; k < spec->modes; k++) {
        take_away(&hub, 1.0, spec->mode[k].coupling);
    }
    double moment[3], axes[9], whole[3];
    bst_dynamics_symmetric_eigen(3, &hub.m[0][0], moment, axes);
    bst_dynamics_symmetric_eigen(3, &body->inertia.m[0][0], whole, NULL);
    if (!(moment[0] > 1e-6 * whole[0])) {
        return bst_fail(
            ctx, BST_ERR_CONFIG,
            "inertia_kgm2: without its %d wheels and %d modes nothing of the spacecraft is left to "
            "turn (smallest principal moment %g of %g kg m^2); make the wheels' inertia_kgm2 or "
            "the modes' coupling smaller, or the craft's inertia larger",
            spec->wheels, spec->modes, moment[0], whole[0]);
    }
    bst_mat3 to_principal;
    for (int i = 0; i < 3; i++) {
        body->per_moment[i] = 1.0 / moment[i];
        for (int j = 0; j < 3; j++) {
            to_principal.m[i][j] = axes[j * 3 + i];
        }
    }
    body->q_principal_from_body = bst_quat_from_mat3(&to_principal);
    for (int i = 0; i < spec->wheels; i++) {
        body->wheel_axis[i] = bst_quat_rotate(body->q_principal_from_body, spec->wheel[i].axis);
    }
    for (int k = 0; k < spec->modes; k++) {
        body->coupling[k] = bst_quat_rotate(body->q_principal_from_body, spec->mode[k].coupling);
    }
    return BST_OK;
}

static bst_vec3 by_moments(const bst_spacecraft_body *body, bst_vec3 v) {
    const double *m = body->per_moment;
    return (bst_vec3){m[0] * v.x, m[1] * v.y, m[2] * v.z};
}

/* d_j . M d_k + (j == k): coupling of p to n. */
static double mobility(const bst_spacecraft_body *body, int j, int k) {
    return (j == k ? 1.0 : 0.0) +
           bst_vec3_dot(body->coupling[j], by_moments(body, body->coupling[k]));
}

static bst_status set_modes(bst_ctx *ctx, bst_spacecraft_body *body) {
    const bst_spacecraft_spec *spec = &body->spec;
    int m = spec->modes;
    if (m == 0) {
        return BST_OK;
    }
    double square[BST_MODES_MOST * BST_MODES_MOST] = {0.0}, squared[BST_MODES_MOST];
    for (int j = 0; j < m; j++) {
        for (int k = 0; k < m; k++) {
            square[j * m + k] = spec->mode[j].frequency_radps * spec->mode[k].frequency_radps *
                                mobility(body, j, k);
        }
    }
    bst_dynamics_symmetric_eigen(m, square, squared, NULL);
    for (int k = 0; k < m; k++) {
        body->free_radps[k] = sqrt(squared[k]);
    }
    double fastest_hz = body->free_radps[m - 1] / (2.0 * BST_PI);
    double longest_s = BST_MODE_STEP_CYCLES / fastest_hz;
    if (spec->dt_s > longest_s * (1.0 + 1e-12)) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "modes: the fastest mode of the free spacecraft is at %.4g Hz, too fast "
                        "for plant steps of %g s; the longest step allowed is %.4g s, %g of its "
                        "period: give the gimbal a rate_hz of at least %.6g",
                        fastest_hz, spec->dt_s, longest_s, BST_MODE_STEP_CYCLES, 1.0 / longest_s);
    }
    int n = 2 * m + 3;
    double a[BST_LINEAR_MOST * BST_LINEAR_MOST] = {0}, e[BST_LINEAR_MOST * BST_LINEAR_MOST];
    double half = 0.5 * spec->dt_s;
    for (int j = 0; j < m; j++) {
        double f = spec->mode[j].frequency_radps, c = 2.0 * spec->mode[j].damping * f;
        for (int k = 0; k < m; k++) {
            a[j * n + m + k] = half * mobility(body, j, k);
            a[(m + j) * n + m + k] = -c * a[j * n + m + k];
        }
        a[(m + j) * n + j] = -half * f * f;
        for (int k = 0; k < 3; k++) {
            a[j * n + 2 * m + k] = -half * element(body->coupling[j], k);
            a[(m + j) * n + 2 * m + k] = -c * a[j * n + 2 * m + k];
        }
    }
    bst_dynamics_matrix_exp(n, a, e);
    for (int i = 0; i < 2 * m; i++) {
        memcpy(body->keep[i], &e[i * n], (size_t)(2 * m) * sizeof(double));
        memcpy(body->drive[i], &e[i * n + 2 * m], 3 * sizeof(double));
    }
    return BST_OK;
}

/* Momentum of the wheels, and below of the modes, in principal axes. */
static bst_vec3 wheels_momentum(const bst_spacecraft_body *body, const double *wheel_momentum) {
    bst_vec3 sum = {0, 0, 0};
    for (int i = 0; i < body->spec.wheels; i++) {
        sum = bst_vec3_axpy(sum, wheel_momentum[i], body->wheel_axis[i]);
    }
    return sum;
}

static bst_vec3 modes_momentum(const bst_spacecraft_body *body, const double *mode_momentum) {
    bst_vec3 sum = {0, 0, 0};
    for (int k = 0; k < body->spec.modes; k++) {
        sum = bst_vec3_axpy(sum, mode_momentum[k], body->coupling[k]);
    }
    return sum;
}

static void set_rate(bst_spacecraft_body *body) {
    bst_vec3 shift = bst_vec3_add(wheels_momentum(body, body->wheel_momentum),
                                  modes_momentum(body, body->mode_momentum));
    bst_vec3 pi = bst_quat_rotate(body->q, body->momentum_gcrf);
    body->rate_principal = by_moments(body, bst_vec3_sub(pi, shift));
}

bst_status bst_spacecraft_body_init(bst_ctx *ctx, bst_spacecraft_body *body,
                                    const bst_spacecraft_spec *spec, bst_quat q_body_from_gcrf,
                                    bst_vec3 rate_radps, const double *wheel_radps) {
    assert(body && spec && bst_is_unit_quat(q_body_from_gcrf, BST_UNIT_TOLERANCE));
    *body = (bst_spacecraft_body){.spec = *spec,
                                  .inertia = bst_spacecraft_inertia_matrix(spec->inertia_kgm2)};
    BST_TRY(check_inertia(ctx, &body->inertia));
    BST_TRY(set_axes(ctx, body));
    BST_TRY(set_modes(ctx, body));
    body->q = bst_quat_unit(bst_quat_mul(body->q_principal_from_body, q_body_from_gcrf));
    bst_vec3 pi = bst_mat3_mul_vec(&body->inertia, rate_radps);
    for (int i = 0; i < spec->wheels; i++) {
        double j = spec->wheel[i].inertia_kgm2;
        bst_vec3 axis = body->spec.wheel[i].axis;
        body->wheel_momentum[i] = j * (wheel_radps[i] + bst_vec3_dot(axis, rate_radps));
        pi = bst_vec3_axpy(pi, j * wheel_radps[i], axis);
    }
    for (int k = 0; k < spec->modes; k++) {
        body->mode_momentum[k] = bst_vec3_dot(spec->mode[k].coupling, rate_radps);
    }
    body->momentum_gcrf = bst_quat_rotate(bst_quat_conj(q_body_from_gcrf), pi);
    body->rate_principal = bst_quat_rotate(body->q_principal_from_body, rate_radps);
    return BST_OK;
}

void bst_spacecraft_body_archive(bst_spacecraft_body *body, bst_archive *archive) {
    BST_ARCHIVE(archive, body->q);
    BST_ARCHIVE(archive, body->momentum_gcrf);
    BST_ARCHIVE(archive, body->wheel_momentum);
    BST_ARCHIVE(archive, body->mode_place);
    BST_ARCHIVE(archive, body->mode_momentum);
    BST_ARCHIVE(archive, body->rate_principal);
}

/* Steps the modes over half a step with the body's momentum held. */
static void step_modes(bst_spacecraft_body *body, bst_vec3 pi_without_wheels) {
    int m = body->spec.modes;
    if (m == 0) {
        return;
    }
    bst_vec3 w = by_moments(body, pi_without_wheels);
    double x[2 * BST_MODES_MOST];
    for (int k = 0; k < m; k++) {
        x[k] = body->mode_place[k];
        x[m + k] = body->mode_momentum[k];
    }
    for (int i = 0; i < 2 * m; i++) {
        const double *keep = body->keep[i], *drive = body->drive[i];
        double sum = drive[0] * w.x + drive[1] * w.y + drive[2] * w.z;
        for (int k = 0; k < 2 * m; k++) {
            sum += keep[k] * x[k];
        }
        if (i < m) {
            body->mode_place[i] = sum;
        } else {
            body->mode_momentum[i - m] = sum;
        }
    }
}

/* One Newton step for the norm, which rounding changes by 1e-16 per step. */
static bst_quat renormalised(bst_quat q) {
    double f = 1.5 - 0.5 * (q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
    return (bst_quat){q.x * f, q.y * f, q.z * f, q.w * f};
}

static void step_split(bst_spacecraft_body *body, bst_vec3 torque, const double *wheel_torque) {
    double dt = body->spec.dt_s, half = 0.5 * dt;
    int wheels = body->spec.wheels;
    bst_vec3 start_torque = bst_quat_rotate(bst_quat_conj(body->q), torque);
    body->momentum_gcrf = bst_vec3_axpy(body->momentum_gcrf, half, start_torque);
    for (int i = 0; i < wheels; i++) {
        body->wheel_momentum[i] += half * wheel_torque[i];
    }
    bst_vec3 pi = bst_quat_rotate(body->q, body->momentum_gcrf);
    bst_vec3 wheel_shift = wheels_momentum(body, body->wheel_momentum);
    step_modes(body, bst_vec3_sub(pi, wheel_shift));

    bst_vec3 shift = bst_vec3_add(wheel_shift, modes_momentum(body, body->mode_momentum));
    bst_dynamics_free_body rigid = {{body->per_moment[0], body->per_moment[1], body->per_moment[2]},
                                    {shift.x, shift.y, shift.z}};
    double turned[3] = {pi.x, pi.y, pi.z};
    if (body->spec.integrator == BST_INTEGRATE_SYMPLECTIC4) {
        bst_dynamics_turn_free_body4(&rigid, dt, &body->q, turned);
    } else {
        bst_dynamics_turn_free_body(&rigid, dt, &body->q, turned);
    }
    body->q = renormalised(body->q);

    pi = (bst_vec3){turned[0], turned[1], turned[2]};
    step_modes(body, bst_vec3_sub(pi, wheel_shift));
    bst_vec3 end_torque = bst_quat_rotate(bst_quat_conj(body->q), torque);
    body->momentum_gcrf = bst_vec3_axpy(body->momentum_gcrf, half, end_torque);
    for (int i = 0; i < wheels; i++) {
        body->wheel_momentum[i] += half * wheel_torque[i];
    }
}

/* RK4 state: q, momentum in GCRF, wheels, mode coordinates, mode momenta. */
typedef struct held {
    const bst_spacecraft_body *body;
    bst_vec3 torque;
    const double *wheel_torque;
} held;

static void slopes(const void *user, const double *y, double *out) {
    const held *h = user;
    const bst_spacecraft_body *body = h->body;
    int wheels = body->spec.wheels, m = body->spec.modes;
    const double *place = y + 7 + wheels, *momentum = place + m;
    bst_quat q = {y[0], y[1], y[2], y[3]};
    bst_vec3 shift = bst_vec3_add(wheels_momentum(body, y + 7), modes_momentum(body, momentum));
    bst_vec3 pi = bst_quat_rotate(bst_quat_unit(q), (bst_vec3){y[4], y[5], y[6]});
    bst_vec3 w = by_moments(body, bst_vec3_sub(pi, shift));
    bst_quat dq = bst_quat_mul((bst_quat){-0.5 * w.x, -0.5 * w.y, -0.5 * w.z, 0.0}, q);
    bst_vec3 force = bst_quat_rotate(bst_quat_conj(bst_quat_unit(q)), h->torque);
    out[0] = dq.x, out[1] = dq.y, out[2] = dq.z, out[3] = dq.w;
    out[4] = force.x, out[5] = force.y, out[6] = force.z;
    for (int i = 0; i < wheels; i++) {
        out[7 + i] = h->wheel_torque[i];
    }
    for (int k = 0; k < m; k++) {
        double f = body->spec.mode[k].frequency_radps;
        double speed = momentum[k] - bst_vec3_dot(body->coupling[k], w);
        out[7 + wheels + k] = speed;
        out[7 + wheels + m + k] = -f * (2.0 * body->spec.mode[k].damping * speed + f * place[k]);
    }
}

static void step_rk4(bst_spacecraft_body *body, bst_vec3 torque, const double *wheel_torque) {
    int wheels = body->spec.wheels, m = body->spec.modes;
    double y[BST_RK4_MOST] = {body->q.x,
                              body->q.y,
                              body->q.z,
                              body->q.w,
                              body->momentum_gcrf.x,
                              body->momentum_gcrf.y,
                              body->momentum_gcrf.z};
    memcpy(y + 7, body->wheel_momentum, (size_t)wheels * sizeof *y);
    memcpy(y + 7 + wheels, body->mode_place, (size_t)m * sizeof *y);
    memcpy(y + 7 + wheels + m, body->mode_momentum, (size_t)m * sizeof *y);
    held h = {body, torque, wheel_torque};
    bst_dynamics_rk4_step(slopes, &h, 7 + wheels + 2 * m, body->spec.dt_s, y);
    body->q = bst_quat_unit((bst_quat){y[0], y[1], y[2], y[3]});
    body->momentum_gcrf = (bst_vec3){y[4], y[5], y[6]};
    memcpy(body->wheel_momentum, y + 7, (size_t)wheels * sizeof *y);
    memcpy(body->mode_place, y + 7 + wheels, (size_t)m * sizeof *y);
    memcpy(body->mode_momentum, y + 7 + wheels + m, (size_t)m * sizeof *y);
}

void bst_spacecraft_body_step(bst_spacecraft_body *body, bst_vec3 torque_nm,
                              const double *wheel_torque_nm) {
    assert(body && bst_is_finite_vec3(torque_nm));
    bst_vec3 torque = bst_quat_rotate(body->q_principal_from_body, torque_nm);
    if (body->spec.integrator == BST_INTEGRATE_RK4) {
        step_rk4(body, torque, wheel_torque_nm);
    } else {
        step_split(body, torque, wheel_torque_nm);
    }
    set_rate(body);
}

bst_quat bst_spacecraft_body_attitude(const bst_spacecraft_body *body) {
    return bst_quat_mul(bst_quat_conj(body->q_principal_from_body), body->q);
}

bst_vec3 bst_spacecraft_body_rate(const bst_spacecraft_body *body) {
    return bst_quat_rotate(bst_quat_conj(body->q_principal_from_body), body->rate_principal);
}

double bst_spacecraft_body_wheel_radps(const bst_spacecraft_body *body, int wheel) {
    return body->wheel_momentum[wheel] / body->spec.wheel[wheel].inertia_kgm2 -
           bst_vec3_dot(body->wheel_axis[wheel], body->rate_principal);
}

double bst_spacecraft_body_wheel_load_kgm2(const bst_spacecraft_body *body, int wheel) {
    bst_vec3 axis = body->wheel_axis[wheel];
    return 1.0 / (1.0 / body->spec.wheel[wheel].inertia_kgm2 +
                  bst_vec3_dot(axis, by_moments(body, axis)));
}

bst_vec3 bst_spacecraft_body_momentum(const bst_spacecraft_body *body) {
    bst_vec3 rate = bst_spacecraft_body_rate(body), pi = bst_mat3_mul_vec(&body->inertia, rate);
    for (int i = 0; i < body->spec.wheels; i++) {
        pi = bst_vec3_axpy(
            pi, body->spec.wheel[i].inertia_kgm2 * bst_spacecraft_body_wheel_radps(body, i),
            body->spec.wheel[i].axis);
    }
    for (int k = 0; k < body->spec.modes; k++) {
        bst_vec3 d = body->spec.mode[k].coupling;
        pi = bst_vec3_axpy(pi, body->mode_momentum[k] - bst_vec3_dot(d, rate), d);
    }
    return bst_quat_rotate(bst_quat_conj(bst_spacecraft_body_attitude(body)), pi);
}

double bst_spacecraft_body_energy(const bst_spacecraft_body *body) {
    bst_vec3 w = body->rate_principal;
    double sum = w.x * w.x / body->per_moment[0] + w.y * w.y / body->per_moment[1] +
                 w.z * w.z / body->per_moment[2];
    for (int i = 0; i < body->spec.wheels; i++) {
        double g = body->wheel_momentum[i];
        sum += g * g / body->spec.wheel[i].inertia_kgm2;
    }
    for (int k = 0; k < body->spec.modes; k++) {
        double p = body->mode_momentum[k],
               e = body->spec.mode[k].frequency_radps * body->mode_place[k];
        sum += p * p + e * e;
    }
    return 0.5 * sum;
}
