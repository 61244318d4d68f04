/* Joints of a pose: how far each is turned. */
#include "sim/satellite/pose.h"

/* Rotation about a unit axis that brings `from` as close to `to` as possible, rad. */
static double angle_about(bst_vec3 axis, bst_vec3 from, bst_vec3 to) {
    return atan2(bst_vec3_dot(axis, bst_vec3_cross(from, to)),
                 bst_vec3_dot(from, to) - bst_vec3_dot(axis, from) * bst_vec3_dot(axis, to));
}

/* Turn of a joint about its first axis, rad, without regard to what is in a direction. */
static double turn_at(const bst_satellite_pose *p, const bst_joint *j, double seconds) {
    switch (j->follows) {
        case BST_JOINT_SPIN:
            return j->offset_rad + j->rate_radps * seconds;
        case BST_JOINT_TABLE:
            return j->offset_rad + bst_curve_at(&j->table, seconds) * BST_DEG_RAD;
        case BST_JOINT_BURN: {
            double since = j->burn < p->burn_count ? seconds - p->burn_s[j->burn] : -1.0;
            double done = since < 0.0            ? 0.0
                          : j->rate_radps == 0.0 ? fabs(j->turn_rad)
                                                 : fabs(j->rate_radps) * since;
            return j->offset_rad + copysign(fmin(done, fabs(j->turn_rad)), j->turn_rad);
        }
        default:
            return j->offset_rad;
    }
}

/* Rotation of a joint: its parent's frame from its own. `to`: what it follows, parent's frame. */
static bst_mat3 joint_rotation(const bst_satellite_pose *p, const bst_joint *j, bst_vec3 to,
                               double seconds) {
    bool aimed = j->follows == BST_JOINT_SUN || j->follows == BST_JOINT_EARTH ||
                 j->follows == BST_JOINT_TARGET;
    double turn = turn_at(p, j, seconds);
    if (aimed) {
        turn += fmin(fmax(angle_about(j->axis, j->normal, to), j->limit_rad[0]), j->limit_rad[1]);
    }
    bst_quat q = bst_quat_from_rotvec(bst_vec3_scale(j->axis, bst_wrap_angle(turn)));
    if (j->axes == 2 && aimed) {
        bst_vec3 now = bst_quat_rotate(q, j->normal);
        bst_vec3 second = bst_vec3_unit(bst_vec3_cross(bst_quat_rotate(q, j->axis), now));
        double tilt = angle_about(second, now, to);
        q = bst_quat_mul(bst_quat_from_rotvec(bst_vec3_scale(second, tilt)), q);
    }
    return bst_quat_to_mat3(q);
}

void bst_satellite_pose_turn(bst_satellite_pose *p, const bst_satellite_aim *aim) {
    const bst_satellite *s = p->satellite;
    for (int i = 0; i < s->joint_count; i++) {
        const bst_joint *j = &s->joints[i];
        bst_vec3 to = j->follows == BST_JOINT_SUN     ? aim->sun
                      : j->follows == BST_JOINT_EARTH ? aim->earth
                                                      : aim->target;
        if (j->parent >= 0) {
            to = bst_mat3_transpose_mul_vec(&p->rotation[j->parent], to);
        }
        p->rotation[i] = joint_rotation(p, j, to, aim->seconds);
        p->origin[i] = j->position_m;
        if (j->parent >= 0) {
            const bst_mat3 *r = &p->rotation[j->parent];
            p->origin[i] = bst_vec3_add(p->origin[j->parent], bst_mat3_mul_vec(r, j->position_m));
            p->rotation[i] = bst_mat3_mul(r, &p->rotation[i]);
        }
    }
}
