/* Onboard navigation: the observer's orbit and clock with the errors that the scenario sets. */
#include "sim/world/world_internal.h"

static const bst_knowledge_config *knowledge_of(const bst_world *world, int observer, int sensor) {
    return &world->observers[observer].sensors[sensor].config.knowledge;
}

double bst_world_nav_seconds(const bst_world *world, int observer, int sensor, double seconds) {
    return seconds + knowledge_of(world, observer, sensor)->clock_offset_s;
}

void bst_world_nav_estimate(const bst_world *world, int observer, int sensor, double believed_s,
                            bst_world_state *state) {
    const bst_orbit_error_config *error = &knowledge_of(world, observer, sensor)->orbit;
    const double *p = error->position_rtn_m, *v = error->velocity_rtn_mps;
    double along = p[1] + error->along_track_drift_mps * believed_s;
    if (p[0] == 0.0 && along == 0.0 && p[2] == 0.0 && v[0] == 0.0 && v[1] == 0.0 && v[2] == 0.0) {
        return;
    }
    bst_vec3 r = bst_vec3_unit(state->position_m);
    bst_vec3 n = bst_vec3_unit(bst_vec3_cross(state->position_m, state->velocity_mps));
    const bst_vec3 axes[3] = {r, bst_vec3_cross(n, r), n};
    const double position[3] = {p[0], along, p[2]};
    for (int i = 0; i < 3; i++) {
        state->position_m = bst_vec3_axpy(state->position_m, position[i], axes[i]);
        state->velocity_mps = bst_vec3_axpy(state->velocity_mps, v[i], axes[i]);
    }
}
