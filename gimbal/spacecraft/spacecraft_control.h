/* Attitude controller of the spacecraft: quaternion feedback with feed-forward and limits. */
#ifndef BST_GIMBAL_SPACECRAFT_SPACECRAFT_CONTROL_H
#define BST_GIMBAL_SPACECRAFT_SPACECRAFT_CONTROL_H

#include "boresight/archive.h"
#include "gimbal/spacecraft/pointing_law.h"

typedef struct bst_spacecraft_attitude_control_spec {
    double natural_radps, damping;
    double integral_radps; /* frequency below which the integral part dominates */
    double rate_limit_radps, accel_limit_radps2; /* of a slew, relative to the wanted motion */
    double dt_s;
    bst_mat3 inertia_kgm2;
} bst_spacecraft_attitude_control_spec;

typedef struct bst_spacecraft_attitude_control {
    bst_spacecraft_attitude_control_spec spec;
    bst_vec3 integral_radps2;
    bst_vec3 error_rad; /* of the previous step, to keep the direction of rotation */
} bst_spacecraft_attitude_control;

/* Initialises the attitude controller at rest; its integrators are zero. */
void bst_spacecraft_attitude_control_init(bst_spacecraft_attitude_control *control,
                                          const bst_spacecraft_attitude_control_spec *spec);

/* Archives the controller's integrals and its last error. */
void bst_spacecraft_attitude_control_archive(bst_spacecraft_attitude_control *control,
                                             bst_archive *archive);

/* Controller step: wanted torque on the body, N m, body axes.
 *
 * Given:     saturated  true: the last torque request was not fulfilled
 * Notes:     e is the rotation vector of the body relative to the wanted attitude, |e| <= pi. A
 *            slew rotates about e at the rate v(|e|): l |e| near the end with l = natural / (2
 *            damping), before that the braking curve of 70 % of the acceleration limit, at most the
 *            rate limit. The wanted acceleration is
 *     a = a_ref + brake - 2 damping natural (w - w_ref + v e / |e|) - integral,
 * clipped to the acceleration limit where it departs from a_ref. The torque is I a + w x (I w + h)
 * with the wheels' momentum h. Near the end this is -natural^2 e - 2 damping natural (w - w_ref).
 * Beyond 0.9 pi the last direction of rotation is kept, so that noise does not reverse a 180 deg
 * slew; at exactly pi it is that of bst_quat_to_rotvec. The integral is active only in the last
 * twentieth of the linear range and while not saturated.
 * Reference: Wie, Space Vehicle Dynamics and Control (2nd edition), section 7.3; Mayhew, Sanfelice
 * and Teel, IEEE TAC 56 (2011) 2555 */
bst_vec3 bst_spacecraft_attitude_control_step(bst_spacecraft_attitude_control *control,
                                              const bst_spacecraft_attitude_reference *reference,
                                              bst_quat q_body_from_gcrf, bst_vec3 rate_radps,
                                              bst_vec3 wheel_momentum_nms, bool saturated);

#endif
