#include "gimbal/spacecraft/spacecraft_control.h"

#include <assert.h>

#include "gimbal/spacecraft/attitude_filter.h"
#include "sim/core/invariant.h"

/* Share of the acceleration limit used by a slew's braking curve; the remainder is for feedback. */
#define BRAKE_SHARE 0.7
/* Share of the linear range, near the end of a slew, in which the integral is active; integrating
 * during the slew would decay slowly. */
#define INTEGRAL_SHARE 0.05

void bst_spacecraft_attitude_control_init(bst_spacecraft_attitude_control *control,
                                          const bst_spacecraft_attitude_control_spec *spec) {
    *control = (bst_spacecraft_attitude_control){.spec = *spec};
}

void bst_spacecraft_attitude_control_archive(bst_spacecraft_attitude_control *control,
                                             bst_archive *archive) {
    BST_ARCHIVE(archive, control->integral_radps2);
    BST_ARCHIVE(archive, control->error_rad);
}

/* Rotation from the wanted attitude, in the direction taken last if both are similarly long. */
static bst_vec3 error_of(bst_spacecraft_attitude_control *control, bst_quat q, bst_quat wanted) {
    bst_vec3 e = bst_attitude_filter_error(q, wanted);
    double angle = bst_vec3_norm(e);
    if (angle > 0.9 * BST_PI && bst_vec3_dot(e, control->error_rad) < 0.0) {
        e = bst_vec3_scale(e, 1.0 - 2.0 * BST_PI / angle);
    }
    control->error_rad = e;
    return e;
}

static bst_vec3 clipped(bst_vec3 v, double limit) {
    double size = bst_vec3_norm(v);
    return size > limit ? bst_vec3_scale(v, limit / size) : v;
}

bst_vec3 bst_spacecraft_attitude_control_step(bst_spacecraft_attitude_control *control,
                                              const bst_spacecraft_attitude_reference *reference,
                                              bst_quat q_body_from_gcrf, bst_vec3 rate_radps,
                                              bst_vec3 wheel_momentum_nms, bool saturated) {
    assert(control && reference && bst_is_unit_quat(q_body_from_gcrf, BST_UNIT_TOLERANCE));
    const bst_spacecraft_attitude_control_spec *spec = &control->spec;
    bst_quat q_body_from_wanted =
        bst_quat_mul(q_body_from_gcrf, bst_quat_conj(reference->q_body_from_gcrf));
    bst_vec3 wanted_rate = bst_quat_rotate(q_body_from_wanted, reference->rate_radps);
    bst_vec3 wanted_accel = bst_quat_rotate(q_body_from_wanted, reference->accel_radps2);

    bst_vec3 e = error_of(control, q_body_from_gcrf, reference->q_body_from_gcrf);
    double angle = bst_vec3_norm(e), slope = spec->natural_radps / (2.0 * spec->damping);
    double brake = BRAKE_SHARE * spec->accel_limit_radps2;
    double linear = fmin(brake / (slope * slope), spec->rate_limit_radps / slope);
    double speed = slope * angle, feed = 0.0;
    if (angle > linear) {
        /* continues the linear part in value and slope where it meets the braking curve */
        double curve = sqrt(slope * slope * linear * linear + 2.0 * brake * (angle - linear));
        speed = fmin(curve, spec->rate_limit_radps);
        feed = curve < spec->rate_limit_radps ? brake : 0.0;
    }
    bst_vec3 along = angle > 0.0 ? bst_vec3_scale(e, 1.0 / angle) : (bst_vec3){0, 0, 0};
    bst_vec3 rate_error = bst_vec3_axpy(bst_vec3_sub(rate_radps, wanted_rate), speed, along);

    bst_vec3 more = bst_vec3_scale(along, feed);
    more = bst_vec3_axpy(more, -2.0 * spec->damping * spec->natural_radps, rate_error);
    if (angle <= INTEGRAL_SHARE * linear && !saturated) {
        control->integral_radps2 = bst_vec3_axpy(
            control->integral_radps2,
            spec->dt_s * spec->integral_radps * spec->natural_radps * spec->natural_radps, e);
        control->integral_radps2 = clipped(control->integral_radps2, spec->accel_limit_radps2);
    }
    more = bst_vec3_sub(more, control->integral_radps2);
    bst_vec3 accel = bst_vec3_add(wanted_accel, clipped(more, spec->accel_limit_radps2));
    bst_vec3 momentum =
        bst_vec3_add(bst_mat3_mul_vec(&spec->inertia_kgm2, rate_radps), wheel_momentum_nms);
    return bst_vec3_add(bst_mat3_mul_vec(&spec->inertia_kgm2, accel),
                        bst_vec3_cross(rate_radps, momentum));
}
