#include "sim/astro/belt.h"

bst_vec3 bst_belt_place(double longitude_rad, double latitude_rad, const bst_mat3 *itrf_from_gcrf) {
    bst_vec3 itrf = {BST_BELT_RADIUS_M * cos(latitude_rad) * cos(longitude_rad),
                     BST_BELT_RADIUS_M * cos(latitude_rad) * sin(longitude_rad),
                     BST_BELT_RADIUS_M * sin(latitude_rad)};
    return bst_mat3_transpose_mul_vec(itrf_from_gcrf, itrf);
}

bool bst_belt_motion(const bst_belt_eye *eye, bst_vec3 direction, bst_vec3 *rate_radps,
                     double *range_m, double *range_rate_mps) {
    double along = bst_vec3_dot(eye->position_m, direction);
    double inside = BST_BELT_RADIUS_M * BST_BELT_RADIUS_M -
                    bst_vec3_dot(eye->position_m, eye->position_m) + along * along;
    double range = inside >= 0.0 ? sqrt(inside) - along : -1.0;
    if (!(range > 0.0)) {
        return false;
    }
    bst_vec3 place = bst_vec3_axpy(eye->position_m, range, direction);
    bst_vec3 moves = bst_vec3_sub(bst_vec3_cross(eye->earth_radps, place), eye->velocity_mps);
    *range_m = range;
    *range_rate_mps = bst_vec3_dot(moves, direction);
    *rate_radps = bst_vec3_scale(bst_vec3_axpy(moves, -*range_rate_mps, direction), 1.0 / range);
    return true;
}
