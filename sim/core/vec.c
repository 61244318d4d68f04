#include "boresight/vec.h"

bst_quat bst_quat_from_mat3(const bst_mat3 *a) {
    const double(*m)[3] = a->m;
    double trace = m[0][0] + m[1][1] + m[2][2];
    double candidates[4] = {1 + 2 * m[0][0] - trace, 1 + 2 * m[1][1] - trace,
                            1 + 2 * m[2][2] - trace, 1 + trace}; /* 4 x^2, 4 y^2, 4 z^2, 4 w^2 */
    int best = 0;
    for (int i = 1; i < 4; i++) {
        if (candidates[i] > candidates[best]) {
            best = i;
        }
    }
    double big = 0.5 * sqrt(candidates[best]);
    double f = 0.25 / big;
    bst_quat q;
    switch (best) {
        case 0:
            q = (bst_quat){big, f * (m[0][1] + m[1][0]), f * (m[0][2] + m[2][0]),
                           f * (m[2][1] - m[1][2])};
            break;
        case 1:
            q = (bst_quat){f * (m[0][1] + m[1][0]), big, f * (m[1][2] + m[2][1]),
                           f * (m[0][2] - m[2][0])};
            break;
        case 2:
            q = (bst_quat){f * (m[0][2] + m[2][0]), f * (m[1][2] + m[2][1]), big,
                           f * (m[1][0] - m[0][1])};
            break;
        default:
            q = (bst_quat){f * (m[2][1] - m[1][2]), f * (m[0][2] - m[2][0]),
                           f * (m[1][0] - m[0][1]), big};
            break;
    }
    return bst_quat_unit(q);
}

bst_quat bst_quat_from_large_rotvec(bst_vec3 r) {
    double half = 0.5 * bst_vec3_norm(r), s = 0.5 * sin(half) / half;
    return (bst_quat){s * r.x, s * r.y, s * r.z, cos(half)};
}

bst_vec3 bst_quat_to_rotvec(bst_quat q) {
    double sign = q.w < 0.0 ? -1.0 : 1.0;
    bst_vec3 v = {sign * q.x, sign * q.y, sign * q.z};
    double n2 = bst_vec3_dot(v, v);
    double w = sign * q.w;
    double scale;
    if (n2 < 1e-4 * w * w) {
        /* series of the arc tangent, accurate to rounding for the usual small rotations */
        double inverse = 1.0 / w, t2 = n2 * inverse * inverse;
        scale = 2.0 * inverse *
                (1.0 - t2 * (1.0 / 3.0 - t2 * (0.2 - t2 * (1.0 / 7.0 - t2 * (1.0 / 9.0)))));
    } else {
        double n = bst_vec3_norm(v);
        scale = n > 0.0 ? 2.0 * atan2(n, w) / n : 2.0;
    }
    return bst_vec3_scale(v, scale);
}

bst_quat bst_quat_slerp(bst_quat a, bst_quat b, double s) {
    bst_vec3 r = bst_quat_to_rotvec(bst_quat_mul(b, bst_quat_conj(a)));
    return bst_quat_unit(bst_quat_mul(bst_quat_from_rotvec(bst_vec3_scale(r, s)), a));
}

bst_quat bst_quat_look(bst_vec3 boresight_ref, bst_vec3 x_hint_ref) {
    bst_vec3 z = bst_vec3_unit(boresight_ref);
    bst_vec3 hint = bst_vec3_unit(x_hint_ref);
    bst_vec3 x = bst_vec3_axpy(hint, -bst_vec3_dot(hint, z), z);
    x = bst_vec3_norm(x) > 1e-9 ? bst_vec3_unit(x) : bst_vec3_perpendicular(z);
    bst_vec3 y = bst_vec3_cross(z, x);
    bst_mat3 rows = {{{x.x, x.y, x.z}, {y.x, y.y, y.z}, {z.x, z.y, z.z}}};
    return bst_quat_from_mat3(&rows);
}
