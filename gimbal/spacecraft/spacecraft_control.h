/* The spacecraft's attitude controller: quaternion feedback with feed-forward and limits. */
#ifndef BST_GIMBAL_SPACECRAFT_SPACECRAFT_CONTROL_H
#define BST_GIMBAL_SPACECRAFT_SPACECRAFT_CONTROL_H

#include "gimbal/spacecraft/pointing_law.h"

typedef struct bst_spacecraft_attitude_control_spec {
    double natural_radps, damping;
    double integral_radps; /* below this frequency the integral part is the larger */
    double rate_limit_radps, accel_limit_radps2; /* of a slew, against the wanted motion */
    double dt_s;
    bst_mat3 inertia_kgm2;
} bst_spacecraft_attitude_control_spec;

typedef struct bst_spacecraft_attitude_control {
    bst_spacecraft_attitude_control_spec spec;
    bst_vec3 integral_radps2;
    bst_vec3 error_rad; /* of the step before: which way round was taken */
} bst_spacecraft_attitude_control;

/* Initialises the attitude controller at rest; its integrators are zero. */
void bst_spacecraft_attitude_control_init(bst_spacecraft_attitude_control *control,
                                          const bst_spacecraft_attitude_control_spec *spec);

/* Torque (N m, body axes) wanted on the body. With e the rotation vector by which the body is
 * turned from the wanted attitude, |e| <= pi, a slew goes about e at the rate v(|e|) = l |e| near
 * the end, l = natural / (2 damping), before that the braking curve of 70 % of the acceleration
 * limit, at most the rate limit; the wanted acceleration is
 *     a = a_ref + brake - 2 damping natural (w - w_ref + v e / |e|) - integral,
 * clipped to the acceleration limit where it departs from a_ref, and the torque I a + w x (I w + h)
 * with the wheels' momentum h. Near the end that is -natural^2 e - 2 damping natural (w - w_ref).
 * Beyond 0.9 pi the way round taken last is kept, so that noise does not turn a slew of 180 deg
 * back; at exactly pi it is that of bst_quat_to_rotvec. The integral moves only in the last
 * twentieth of the range in which the law is linear, and with `saturated` false (what was asked
 * last came). Wie, Space Vehicle Dynamics and Control (2nd edition), section 7.3; Mayhew, Sanfelice
 * and Teel, IEEE TAC 56 (2011) 2555. */
bst_vec3 bst_spacecraft_attitude_control_step(bst_spacecraft_attitude_control *control,
                                              const bst_spacecraft_attitude_reference *reference,
                                              bst_quat q_body_from_gcrf, bst_vec3 rate_radps,
                                              bst_vec3 wheel_momentum_nms, bool saturated);

#endif
