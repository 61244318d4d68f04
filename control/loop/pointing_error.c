#include "control/loop/pointing_error.h"

#include <assert.h>

#include "sim/core/invariant.h"

#define GATE_SIGMA 8.0
#define REJECT_MAX 3

void bst_pointing_error_init(bst_pointing_error *e, double disturbance_rms_rad,
                             double disturbance_cutoff_hz, double sigma_floor_rad,
                             double initial_sigma_rad, double initial_rate_sigma_radps) {
    assert(e && bst_is_variance(disturbance_rms_rad) && bst_is_variance(sigma_floor_rad));
    assert(bst_is_variance(initial_sigma_rad) && bst_is_variance(initial_rate_sigma_radps));
    double w = 2.0 * BST_PI * disturbance_cutoff_hz;
    *e = (bst_pointing_error){
        .density = disturbance_rms_rad * disturbance_rms_rad / 2.0 * w * w * w / 4.0,
        .sigma_floor_rad = sigma_floor_rad,
        .initial_sigma_rad = initial_sigma_rad,
        .initial_rate_sigma_radps = initial_rate_sigma_radps,
        .error = BST_QUAT_IDENTITY};
}

void bst_pointing_error_archive(bst_pointing_error *e, bst_archive *archive) {
    bst_archive_bool(archive, &e->started);
    BST_ARCHIVE(archive, e->tick);
    BST_ARCHIVE(archive, e->error);
    BST_ARCHIVE(archive, e->rate_gcrf_radps);
    BST_ARCHIVE(archive, e->p_ee);
    BST_ARCHIVE(archive, e->p_er);
    BST_ARCHIVE(archive, e->p_rr);
    BST_ARCHIVE(archive, e->taken);
    BST_ARCHIVE(archive, e->rejected);
}

static bst_quat predicted(const bst_pointing_error *e, double dt) {
    return bst_quat_mul(bst_quat_from_rotvec(bst_vec3_scale(e->rate_gcrf_radps, dt)), e->error);
}

static void restart(bst_pointing_error *e, int64_t tick, bst_quat error) {
    e->started = true;
    e->tick = tick;
    e->error = error;
    e->rate_gcrf_radps = (bst_vec3){0.0, 0.0, 0.0};
    e->p_ee = e->initial_sigma_rad * e->initial_sigma_rad;
    e->p_er = 0.0;
    e->p_rr = e->initial_rate_sigma_radps * e->initial_rate_sigma_radps;
    e->taken = 1;
    e->rejected = 0;
}

bool bst_pointing_error_update(bst_pointing_error *e, const bst_attitude_fix *fix,
                               double tick_rate_hz) {
    assert(e && fix && tick_rate_hz > 0.0);
    if (!fix->valid || (e->started && fix->tick < e->tick)) {
        return false;
    }
    /* q_stars = from_rotvec(e_cam) q_telemetry = q_telemetry from_rotvec(e_gcrf); e_cam is equal in
     * the star and telemetry camera frames */
    bst_quat measured = bst_quat_from_rotvec(
        bst_quat_rotate(bst_quat_conj(fix->q_cam_from_gcrf), fix->error_cam_rad));
    double sigma =
        fmax(hypot(fix->sigma_rad[0], fix->sigma_rad[1]) / sqrt(2.0), e->sigma_floor_rad);
    double r = sigma * sigma;
    if (!e->started) {
        restart(e, fix->tick, measured);
        e->p_ee = r;
        return true;
    }
    double dt = (double)(fix->tick - e->tick) / tick_rate_hz;
    bst_quat prior = predicted(e, dt);
    double p_ee = e->p_ee + dt * (2.0 * e->p_er + dt * e->p_rr) + e->density * dt * dt * dt / 3.0;
    double p_er = e->p_er + dt * e->p_rr + e->density * dt * dt / 2.0;
    double p_rr = e->p_rr + e->density * dt;
    bst_vec3 innovation = bst_quat_to_rotvec(bst_quat_mul(measured, bst_quat_conj(prior)));
    /* across the boresight only: stars determine the roll much less accurately */
    bst_vec3 boresight = bst_quat_rotate(bst_quat_conj(fix->q_cam_from_gcrf), (bst_vec3){0, 0, 1});
    double across = bst_vec3_norm(bst_vec3_cross(innovation, boresight));
    double s = p_ee + r;
    if (across * across > 2.0 * GATE_SIGMA * GATE_SIGMA * s) {
        int32_t patience = e->taken - 2 < REJECT_MAX ? e->taken - 2 : REJECT_MAX;
        if (++e->rejected <= patience) {
            return false;
        }
        restart(e, fix->tick, measured);
        e->p_ee = r;
        return true;
    }
    double alpha = p_ee / s, beta = p_er / s;
    e->error =
        bst_quat_unit(bst_quat_mul(bst_quat_from_rotvec(bst_vec3_scale(innovation, alpha)), prior));
    e->rate_gcrf_radps = bst_vec3_axpy(e->rate_gcrf_radps, beta, innovation);
    e->p_ee = p_ee * (1.0 - alpha);
    e->p_er = p_er * (1.0 - alpha);
    e->p_rr = p_rr - beta * p_er;
    e->tick = fix->tick;
    e->taken += e->taken < REJECT_MAX + 2;
    e->rejected = 0;
    return true;
}

bst_quat bst_pointing_error_at(const bst_pointing_error *e, int64_t tick, double tick_rate_hz) {
    return e->started ? predicted(e, (double)(tick - e->tick) / tick_rate_hz) : e->error;
}

void bst_pointing_error_uncorrect(const bst_quat correction[3], const bst_vec3 corrected[3],
                                  double half_s, bst_vec3 *direction, bst_vec3 *rate_radps) {
    bst_vec3 d[3];
    for (int i = 0; i < 3; i++) {
        d[i] = bst_quat_rotate(bst_quat_conj(bst_quat_unit(correction[i])), corrected[i]);
    }
    *direction = d[0];
    *rate_radps = bst_vec3_scale(bst_vec3_sub(d[1], d[2]), 0.5 / half_s);
}
