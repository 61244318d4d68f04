#include "gimbal/nav.h"

bst_status bst_gimbal_nav(bst_ctx *ctx, bst_view *view, int observer, int sensor, int64_t tick,
                          double seconds, bst_nav_telemetry *out) {
    bst_state state;
    bst_bodies bodies;
    BST_TRY(bst_view_believed(ctx, view, observer, sensor, seconds, &state, &bodies));
    bst_light light = bst_light_at(&bodies, state.position_m, state.velocity_mps);
    out->tick = tick;
    out->position_gcrf_m = state.position_m;
    out->velocity_gcrf_mps = state.velocity_mps;
    out->velocity_bary_mps = light.velocity_mps;
    out->sun_m = light.sun_m;
    out->moon_m = bst_vec3_sub(bodies.moon_m, state.position_m);
    return BST_OK;
}
