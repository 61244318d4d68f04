#include "sim/world/object_torque.h"

#include <pthread.h>
#include <stdlib.h>

#include "sim/astro/gravity.h"
#include "sim/world/surface_torque.h"

struct bst_object_torque {
    pthread_mutex_t lock; /* of clock and surface */
    const bst_world *world;
    const bst_world_orbit *orbit;
    bst_world_orbit *own; /* NULL: the object's */
    bst_sky_clock *clock;
    bst_surface_torque *surface;
    double density_scale;
};

static void free_orbit(bst_world_orbit *own) {
    if (own) {
        bst_world_orbit_free(own);
        free(own);
    }
}

bst_status bst_object_torque_create(const bst_world_builder *b,
                                    const bst_object_torque_setup *setup, bst_object_torque **out) {
    bst_object_torque *t = *out = calloc(1, sizeof *t);
    if (!t) {
        free_orbit(setup->own);
        return bst_fail(b->ctx, BST_ERR_MEMORY, "no memory for the torques on an object");
    }
    pthread_mutex_init(&t->lock, NULL);
    t->world = b->world;
    t->orbit = setup->orbit;
    t->own = setup->own;
    t->density_scale = setup->density_scale;
    bst_status status = bst_sky_clock_create_on(b->ctx, b->world->sky_grid, &t->clock);
    if (status == BST_OK) {
        const bst_vec3 centre = {0.0, 0.0, 0.0};
        status = bst_surface_torque_create_on(b->ctx, setup->satellite, centre,
                                              setup->drag_coefficient, &t->surface);
    }
    if (status == BST_OK) {
        bst_surface_torque_set_burns(t->surface, setup->burn_s, setup->burn_count);
    } else {
        bst_object_torque_free(t);
        *out = NULL;
    }
    return status;
}

void bst_object_torque_free(bst_object_torque *t) {
    if (t) {
        pthread_mutex_destroy(&t->lock);
        bst_surface_torque_free(t->surface);
        bst_sky_clock_free(t->clock);
        free_orbit(t->own);
        free(t);
    }
}

/* The object among what acts on its surface; false: it has no place then. */
static bool state_at(bst_object_torque *t, const bst_attitude_torques *which, double seconds,
                     bst_surface_state *out) {
    bst_ctx ctx = {0};
    bst_sky_rotation sky;
    bst_world_state place;
    bst_time epoch = t->world->epoch;
    if (bst_sky_clock_at(&ctx, t->clock, bst_time_add(epoch, seconds), &sky) != BST_OK ||
        bst_world_orbit_state(&ctx, t->orbit, t->clock, epoch, seconds, true, &place) != BST_OK) {
        return false;
    }
    bst_vec3 light = bst_bodies_sunlight_from(&sky.bodies);
    out->position_m = place.position_m;
    out->velocity_mps = place.velocity_mps;
    out->sun_m = bst_vec3_sub(light, place.position_m);
    out->sunlit = which->solar_pressure
                      ? bst_astro_sun_fraction(place.position_m, light, sky.bodies.pole)
                      : 0.0;
    out->density_scale = which->drag ? t->density_scale : 0.0;
    out->seconds = seconds;
    return true;
}

bool bst_object_torque_at(void *user, const bst_attitude_config *phase, double seconds,
                          bst_quat q_body_from_gcrf, bst_vec3 *torque_nm) {
    bst_object_torque *t = user;
    const bst_attitude_torques *which = &phase->torques;
    bst_surface_state state = {.q_body_from_gcrf = q_body_from_gcrf};
    bst_vec3 sum = {0.0, 0.0, 0.0};
    pthread_mutex_lock(&t->lock);
    bool known = state_at(t, which, seconds, &state);
    if (known && (state.sunlit > 0.0 || state.density_scale > 0.0)) {
        sum = bst_surface_torque_at(t->surface, &state);
    }
    pthread_mutex_unlock(&t->lock);
    if (known && which->gravity_gradient) {
        const double *i = phase->inertia_kg_m2;
        const bst_mat3 inertia = {{{i[0], 0.0, 0.0}, {0.0, i[1], 0.0}, {0.0, 0.0, i[2]}}};
        sum = bst_vec3_add(
            sum, bst_gravity_gradient_torque(&inertia, q_body_from_gcrf, state.position_m));
    }
    *torque_nm = sum;
    return known;
}
