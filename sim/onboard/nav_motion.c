#include "sim/onboard/nav_motion.h"

#include "sim/astro/kepler.h"

void bst_nav_state_after(const bst_nav_telemetry *nav, double dt_s, bst_vec3 *position_m,
                         bst_vec3 *velocity_mps) {
    bst_ctx quiet = {0}; /* invalid telemetry is no failure of the run */
    if (bst_kepler_propagate(&quiet, BST_EARTH_MU_M3PS2, nav->position_gcrf_m,
                             nav->velocity_gcrf_mps, dt_s, position_m, velocity_mps) != BST_OK) {
        *position_m = bst_vec3_axpy(nav->position_gcrf_m, dt_s, nav->velocity_gcrf_mps);
        *velocity_mps = nav->velocity_gcrf_mps;
    }
}

bst_light bst_nav_light_after(const bst_nav_telemetry *nav, double dt_s) {
    bst_vec3 position_m, velocity_mps;
    bst_nav_state_after(nav, dt_s, &position_m, &velocity_mps);
    bst_vec3 gained_mps = bst_vec3_sub(velocity_mps, nav->velocity_gcrf_mps);
    return (bst_light){.velocity_mps = bst_vec3_add(nav->velocity_bary_mps, gained_mps),
                       .sun_m = nav->sun_m};
}
