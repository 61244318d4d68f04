/* Body attitude and keep-out cones from guidance's latest inputs. */
#include "control/guidance/guidance.h"

int bst_guidance_zones(const bst_guidance *g, const bst_nav_telemetry *nav,
                       bst_keep_out_zone zones[BST_ZONE_KINDS]) {
    const bst_guidance_config *c = &g->config;
    const bst_keep_out exclusion = {.sun_rad = c->sun_keep_out_deg * BST_DEG_RAD,
                                    .moon_rad = c->moon_keep_out_deg * BST_DEG_RAD,
                                    .earth = c->earth_keep_out,
                                    .earth_limb_rad = c->earth_limb_keep_out_deg * BST_DEG_RAD,
                                    .limb_altitude_m = 1e3 * c->earth_limb_altitude_km};
    return bst_keep_out_zones(&exclusion, nav->position_gcrf_m, nav->sun_m, nav->moon_m, zones);
}

bst_quat bst_guidance_body(const bst_guidance *g, int64_t tick) {
    double dt = (double)(tick - g->mount.tick) / g->env.tick_rate_hz;
    if (g->roll_given) {
        return bst_guidance_rolled(g, dt, g->roll_rad);
    }
    bst_vec3 turn = bst_vec3_scale(g->mount.rate_body_radps, -dt);
    return bst_quat_mul(bst_quat_from_rotvec(turn), g->mount.q_body_from_gcrf);
}
