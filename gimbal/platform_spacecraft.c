#include <stdlib.h>

#include "gimbal/platform.h"
#include "sim/onboard/knowledge.h"
#include "sim/world/world.h"

/* World and onboard knowledge of a spacecraft. */
typedef struct bst_platform_sky {
    bst_world_view *view;
    bst_knowledge_view *knowledge; /* NULL: the pointing law needs no target */
    int observer, sensor;
} bst_platform_sky;

static bst_status sky_at(void *user, bst_ctx *ctx, double seconds, bst_spacecraft_sky *out) {
    bst_platform_sky *sky = user;
    bst_world_state state;
    bst_bodies bodies;
    BST_TRY(bst_world_view_observer_state(ctx, sky->view, sky->observer, seconds, &state));
    BST_TRY(bst_world_view_bodies(ctx, sky->view, seconds, &bodies));
    out->position_m = state.position_m;
    out->velocity_mps = state.velocity_mps;
    out->sun_m = bst_vec3_sub(bodies.sun_m, state.position_m);
    out->sunlit =
        bst_astro_sun_fraction(state.position_m, bst_bodies_sunlight_from(&bodies), bodies.pole);

    BST_TRY(
        bst_world_view_nav(ctx, sky->view, sky->observer, sky->sensor, seconds, &state, &bodies));
    bst_light light = bst_light_at(&bodies, state.position_m, state.velocity_mps);
    out->known = (bst_spacecraft_law_inputs){
        .position_m = state.position_m, .velocity_mps = state.velocity_mps, .sun_m = light.sun_m};
    if (sky->knowledge) {
        bool valid;
        bst_vec3 direction;
        BST_TRY(bst_knowledge_cue_direction_at(ctx, sky->knowledge, seconds, &valid, &direction));
        if (valid) {
            out->known.target = bst_light_aberrate(&light, direction);
        }
    }
    return BST_OK;
}

static void free_sky(bst_platform_sky *sky) {
    if (sky) {
        bst_knowledge_view_free(sky->knowledge);
        bst_world_view_free(sky->view);
        free(sky);
    }
}

bst_status bst_platform_equip(const bst_module_env *env, bst_platform *platform,
                              const bst_platform_config *config, double dt_s) {
    if (config->spacecraft.type == BST_CRAFT_INERTIAL) {
        return BST_OK;
    }
    bst_platform_sky *sky = calloc(1, sizeof *sky);
    if (!sky) {
        return bst_fail(env->ctx, BST_ERR_MEMORY, "out of memory for a spacecraft");
    }
    platform->sky = sky;
    sky->observer = env->observer;
    sky->sensor = env->sensor;
    BST_TRY(bst_world_view_create(env->ctx, env->world, &sky->view));
    if (config->spacecraft.attitude.law == BST_LAW_TARGET) {
        BST_TRY(bst_knowledge_view_create(env->ctx, env->knowledge, &sky->knowledge));
    }
    bst_spacecraft_setup setup = {.dt_s = dt_s,
                                  .q_nominal = platform->q_nominal_from_gcrf,
                                  .sky_at = sky_at,
                                  .user = sky,
                                  .seed = env->seed,
                                  .run = env->run,
                                  .instance = env->instance};
    return bst_spacecraft_create(env->ctx, &config->spacecraft, &setup, &platform->spacecraft);
}

bst_status bst_platform_check_mount(bst_ctx *ctx, const bst_platform *platform,
                                    const double mount_kgm2[6]) {
    if (!platform->spacecraft) {
        return BST_OK;
    }
    bst_mat3 mount = bst_spacecraft_inertia_matrix(mount_kgm2);
    const bst_spacecraft_body *body = bst_spacecraft_dynamics(platform->spacecraft);
    double heaviest[3], lightest = INFINITY;
    bst_dynamics_symmetric_eigen(3, &mount.m[0][0], heaviest, NULL);
    for (int i = 0; i < 3; i++) {
        lightest = fmin(lightest, 1.0 / body->per_moment[i]);
    }
    if (heaviest[2] > 0.5 * lightest) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "platform/spacecraft/inertia_kgm2: the smallest principal moment, without "
                        "wheels and appendages, is %g kg m^2, and the mount's largest is %g, more "
                        "than half of it; make the spacecraft heavier (its inertia is without the "
                        "mount's) or the mount lighter",
                        lightest, heaviest[2]);
    }
    return BST_OK;
}

void bst_platform_archive(bst_platform *platform, bst_archive *archive) {
    BST_ARCHIVE(archive, platform->q_believed_from_gcrf);
    BST_ARCHIVE(archive, platform->rate_believed_radps);
    BST_ARCHIVE(archive, platform->body);
    BST_ARCHIVE(archive, platform->unresolved_rad2);
    bst_archive_bool(archive, &platform->wheels_saturated);
    bst_archive_bool(archive, &platform->trackers_blind);
    if (platform->sky && platform->sky->knowledge) {
        bst_knowledge_view_archive(platform->sky->knowledge, archive);
    }
    if (platform->spacecraft) {
        bst_spacecraft_archive(platform->spacecraft, archive);
    }
}

void bst_platform_free(bst_platform *platform) {
    bst_spacecraft_free(platform->spacecraft);
    free_sky(platform->sky);
    bst_jitter_free(&platform->jitter);
    platform->spacecraft = NULL;
    platform->sky = NULL;
}
