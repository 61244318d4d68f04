#include "tracker/attitude/sky_of_detection.h"

#include <assert.h>

#include "sim/core/invariant.h"

bst_sky_measurement bst_sky_of_detection(const bst_camera *camera, const bst_detection *item,
                                         double extra_px2, bst_quat q_cam_from_gcrf,
                                         const double covariance_cam[3][3],
                                         const bst_light *light) {
    assert(camera && item && light && bst_is_variance(extra_px2));
    assert(bst_is_unit_quat(q_cam_from_gcrf, BST_LINK_UNIT_TOLERANCE));
    bst_vec3 v = bst_camera_unproject(camera, item->x_px, item->y_px);
    bst_quat back = bst_quat_conj(q_cam_from_gcrf);
    bst_vec3 apparent = bst_quat_rotate(back, v);
    bst_sky_measurement m = {.direction = bst_light_unaberrate(light, apparent)};
    bst_tangent axes = bst_tangent_at(m.direction);
    double scale = bst_camera_scale_rad(camera) * v.z; /* rad per px towards the field's edge */
    /* derivatives of the direction by x, y (px) and by rotation about camera x, y, z */
    bst_vec3 unit[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, columns[5];
    double s[2][2];
    bst_camera_jacobian(camera, v, s);
    double det = s[0][0] * s[1][1] - s[0][1] * s[1][0];
    const bst_vec3 by_px[2] = {{s[1][1] / det, -s[1][0] / det, 0.0},
                               {-s[0][1] / det, s[0][0] / det, 0.0}};
    for (int i = 0; i < 2; i++) {
        columns[i] = bst_vec3_scale(bst_tangent_project(v, by_px[i]), scale);
    }
    for (int i = 0; i < 3; i++) {
        columns[i + 2] = bst_vec3_cross(unit[i], v);
    }
    double j[2][5];
    for (int i = 0; i < 5; i++) {
        bst_vec3 g = bst_quat_rotate(back, columns[i]);
        j[0][i] = bst_vec3_dot(g, axes.e1);
        j[1][i] = bst_vec3_dot(g, axes.e2);
    }
    double c[5][5] = {{item->cov_xx + extra_px2, item->cov_xy},
                      {item->cov_xy, item->cov_yy + extra_px2}};
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++) {
            c[i + 2][k + 2] = covariance_cam[i][k];
        }
    }
    for (int i = 0; i < 5; i++) {
        for (int k = 0; k < 5; k++) {
            m.cov_11 += j[0][i] * c[i][k] * j[0][k];
            m.cov_12 += j[0][i] * c[i][k] * j[1][k];
            m.cov_22 += j[1][i] * c[i][k] * j[1][k];
        }
    }
    return m;
}
