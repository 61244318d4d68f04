#include "gimbal/mount/mount_geometry.h"

/* Distance from the pole, rad, below which the outer angle is too ill-defined to follow. */
#define POLE_RAD 1e-9

/* Body vector in the base frame (1, 2, 3) with the boresight at +3 for zero angles; bst_mount_swap
 * has it at +3 (azimuth_elevation) or -3 (cross_elevation). */
static bst_vec3 to_base_frame(int type, bst_vec3 body) {
    bst_vec3 v = bst_mount_swap(type, body);
    return type == BST_MOUNT_AZIMUTH_ELEVATION ? v : bst_vec3_scale(v, -1.0);
}

bst_vec3 bst_mount_axis_body(int type, int axis) {
    return bst_mount_swap(type, axis == 1 ? (bst_vec3){0, 1, 0} : (bst_vec3){1, 0, 0});
}

bst_quat bst_mount_attitude(int type, const double angle_rad[BST_MOUNT_MOST]) {
    double s1 = sin(0.5 * angle_rad[0]), c1 = cos(0.5 * angle_rad[0]);
    double s2 = sin(0.5 * angle_rad[1]), c2 = cos(0.5 * angle_rad[1]);
    /* rotation about 1, then about the rotated 2: (s1 c2, c1 s2, s1 s2, c1 c2) */
    bst_quat q = {s1 * c2, c1 * s2, s1 * s2, c1 * c2};
    if (angle_rad[2] != 0.0) {
        double s3 = sin(0.5 * angle_rad[2]), c3 = cos(0.5 * angle_rad[2]);
        q = (bst_quat){q.x * c3 + q.w * s3, q.y * c3 + q.z * s3, q.z * c3 - q.y * s3,
                       q.w * c3 - q.x * s3};
    }
    bst_vec3 v = bst_mount_swap(type, (bst_vec3){q.x, q.y, q.z});
    return (bst_quat){-v.x, -v.y, -v.z, q.w};
}

bst_mount_pose bst_mount_solve(int type, bst_vec3 direction, bst_vec3 rate,
                               double outer_at_pole_rad) {
    bst_vec3 b = to_base_frame(type, direction), r = to_base_frame(type, rate);
    double h2 = b.y * b.y + b.z * b.z, h = sqrt(h2);
    bst_mount_pose pose = {{outer_at_pole_rad, atan2(b.x, h), 0.0}, {0.0, 0.0, 0.0}};
    if (h >= POLE_RAD) {
        pose.angle_rad[0] = atan2(-b.y, b.z);
        pose.rate_radps[0] = (b.y * r.z - b.z * r.y) / h2;
        pose.rate_radps[1] = r.x / h;
    }
    return pose;
}

bst_mount_pose bst_mount_solve_rest(int type, bst_vec3 direction, bst_vec3 rate, double outer_rad,
                                    double outer_radps) {
    bst_vec3 b = to_base_frame(type, direction), r = to_base_frame(type, rate);
    double s = sin(outer_rad), c = cos(outer_rad);
    /* in the outer stage's frame, which rotates about 1 */
    b = (bst_vec3){b.x, c * b.y + s * b.z, c * b.z - s * b.y};
    r = (bst_vec3){r.x, c * r.y + s * r.z + outer_radps * b.z,
                   c * r.z - s * r.y - outer_radps * b.y};
    double h2 = b.x * b.x + b.z * b.z, h = sqrt(h2);
    bst_mount_pose pose = {{outer_rad, 0.0, atan2(-b.y, h)}, {outer_radps, 0.0, 0.0}};
    if (h >= POLE_RAD) {
        pose.angle_rad[1] = atan2(b.x, b.z);
        pose.rate_radps[1] = (b.z * r.x - b.x * r.z) / h2;
        pose.rate_radps[2] = -r.y / h;
    }
    return pose;
}

void bst_mount_pass_pole(int type, bst_vec3 direction, bst_vec3 rate, double rate_limit_radps,
                         const bst_mount_pose *pose, double *outer_rad, double *outer_radps) {
    bst_vec3 b = to_base_frame(type, direction), r = to_base_frame(type, rate);
    *outer_rad = pose->angle_rad[0];
    *outer_radps = pose->rate_radps[0];
    double w = bst_vec3_norm(r);
    double sin_r = w > 0.0 ? fabs(bst_vec3_cross(b, r).x) / w : 1.0;
    if (w <= rate_limit_radps * sin_r || fabs(b.x) < 0.5 || hypot(b.y, b.z) < POLE_RAD) {
        return;
    }
    double cos_r = sqrt(1.0 - sin_r * sin_r);
    double phase = atan2(-copysign(1.0, b.x) * r.x / (w * cos_r), fabs(b.x) / cos_r);
    /* relative to the azimuth of closest approach */
    double azimuth = atan2(sin(phase), cos(phase) * sin_r);
    double reach = rate_limit_radps * fabs(phase) / w;
    if (reach < fabs(azimuth)) {
        double sense = pose->rate_radps[0] < 0.0 ? -1.0 : 1.0;
        *outer_rad += sense * (copysign(reach, phase) - azimuth);
        *outer_radps = sense * rate_limit_radps;
    }
}
