#include "gimbal/spacecraft/pointing_law.h"

#include <stddef.h>

const char *const bst_law_names[] = {"inertial", "nadir", "sun", "target", "free", NULL};

bst_quat bst_pointing_law_attitude(const bst_pointing_law *law,
                                   const bst_spacecraft_law_inputs *inputs) {
    bst_vec3 towards = {0, 0, 0};
    /* second axis in the nominal attitude */
    bst_vec3 second = bst_quat_rotate(bst_quat_conj(law->q_nominal), law->second_axis);
    switch (law->law) {
        case BST_LAW_NADIR:
            towards = bst_vec3_scale(inputs->position_m, -1.0);
            second = inputs->velocity_mps;
            break;
        case BST_LAW_SUN:
            towards = inputs->sun_m;
            break;
        case BST_LAW_TARGET:
            towards = inputs->target;
            break;
        case BST_LAW_INERTIAL:
        case BST_LAW_FREE:
            break;
    }
    bst_quat q = law->q_nominal;
    if (bst_vec3_norm(towards) > 0.0) {
        bst_quat q_law_from_body = bst_quat_look(law->axis, law->second_axis);
        q = bst_quat_mul(bst_quat_conj(q_law_from_body), bst_quat_look(towards, second));
    }
    return bst_quat_unit(bst_quat_turn_frame(q, bst_vec3_scale(law->axis, law->roll_rad)));
}

bst_spacecraft_attitude_reference bst_spacecraft_attitude_reference_at(const bst_quat node[4],
                                                                       double step_s,
                                                                       double place) {
    bst_vec3 r[4];
    bool jump = false;
    for (int k = 0; k < 4; k++) {
        r[k] =
            bst_vec3_scale(bst_quat_to_rotvec(bst_quat_mul(node[k], bst_quat_conj(node[1]))), -1.0);
        jump =
            jump || (k > 0 && bst_vec3_norm(bst_vec3_sub(r[k], r[k - 1])) > BST_REFERENCE_JUMP_RAD);
    }
    if (jump) {
        int nearest = (int)fmin(3.0, fmax(0.0, floor(place + 0.5)));
        return (bst_spacecraft_attitude_reference){.q_body_from_gcrf = node[nearest]};
    }
    /* Lagrange polynomials of the nodes 0 to 3, and their first two derivatives */
    double a = place, b = place - 1.0, c = place - 2.0, d = place - 3.0;
    const double w[4] = {-b * c * d / 6.0, a * c * d / 2.0, -a * b * d / 2.0, a * b * c / 6.0};
    const double w1[4] = {-(b * c + b * d + c * d) / 6.0, (a * c + a * d + c * d) / 2.0,
                          -(a * b + a * d + b * d) / 2.0, (a * b + a * c + b * c) / 6.0};
    const double w2[4] = {-(b + c + d) / 3.0, a + c + d, -(a + b + d), (a + b + c) / 3.0};
    bst_vec3 turn = {0, 0, 0}, rate = turn, accel = turn;
    for (int k = 0; k < 4; k++) {
        turn = bst_vec3_axpy(turn, w[k], r[k]);
        rate = bst_vec3_axpy(rate, w1[k] / step_s, r[k]);
        accel = bst_vec3_axpy(accel, w2[k] / (step_s * step_s), r[k]);
    }
    /* w = r' - r x r' / 2 + ..., in the rotated axes */
    rate = bst_vec3_axpy(rate, -0.5, bst_vec3_cross(turn, rate));
    accel = bst_vec3_axpy(accel, -0.5, bst_vec3_cross(turn, accel));
    return (bst_spacecraft_attitude_reference){bst_quat_unit(bst_quat_turn_frame(node[1], turn)),
                                               rate, accel};
}

bst_spacecraft_attitude_reference bst_spacecraft_attitude_reference_rolled(
    const bst_spacecraft_attitude_reference *reference, bst_vec3 axis, double roll_rad,
    double roll_radps) {
    bst_quat step = bst_quat_from_rotvec(bst_vec3_scale(axis, -roll_rad));
    bst_vec3 spin = bst_vec3_scale(axis, roll_radps);
    bst_vec3 carried = bst_quat_rotate(step, reference->rate_radps);
    bst_spacecraft_attitude_reference out;
    out.q_body_from_gcrf = bst_quat_unit(bst_quat_mul(step, reference->q_body_from_gcrf));
    out.rate_radps = bst_vec3_add(carried, spin);
    /* the transported rate rotates backwards in rolling axes */
    out.accel_radps2 =
        bst_vec3_sub(bst_quat_rotate(step, reference->accel_radps2), bst_vec3_cross(spin, carried));
    return out;
}
