#include <stdlib.h>

#include "sim/astro/kepler.h"
#include "sim/world/external_states.h"
#include "sim/world/world_internal.h"

/* Radial, transverse and normal axes of an orbit state, in GCRF. */
static void rtn_axes(const bst_world_state *s, bst_vec3 *r, bst_vec3 *t, bst_vec3 *n) {
    *r = bst_vec3_unit(s->position_m);
    *n = bst_vec3_unit(bst_vec3_cross(s->position_m, s->velocity_mps));
    *t = bst_vec3_cross(*n, *r);
}

/* Converts a vector from the radial, transverse, normal frame of an orbit. */
static bst_vec3 from_rtn(bst_vec3 r, bst_vec3 t, bst_vec3 n, bst_vec3 v) {
    return bst_vec3_axpy(bst_vec3_axpy(bst_vec3_scale(r, v.x), v.y, t), v.z, n);
}

/* State of an SGP4 orbit in GCRF. */
static bst_status sgp4_state(bst_ctx *ctx, const bst_world_orbit *orbit, bst_sky_clock *clock,
                             bst_time epoch, double seconds, bst_world_state *out) {
    double r_km[3], v_kmps[3];
    bst_sgp4_error error =
        bst_sgp4_propagate(orbit->sgp4, (orbit->epoch_offset_s + seconds) / 60.0, r_km, v_kmps);
    if (error != BST_SGP4_OK) {
        return bst_fail(ctx, BST_ERR_NUMERIC, "orbit of %s, %.3f s after the epoch: %s",
                        orbit->name, seconds, bst_sgp4_error_text(error));
    }
    bst_sky_rotation sky;
    BST_TRY(bst_sky_clock_at(ctx, clock, bst_time_add(epoch, seconds), &sky));
    const bst_mat3 *m = &sky.frames.gcrf_from_teme;
    out->position_m =
        bst_vec3_scale(bst_mat3_mul_vec(m, (bst_vec3){r_km[0], r_km[1], r_km[2]}), 1000.0);
    out->velocity_mps =
        bst_vec3_scale(bst_mat3_mul_vec(m, (bst_vec3){v_kmps[0], v_kmps[1], v_kmps[2]}), 1000.0);
    return BST_OK;
}

/* State of a numerically propagated orbit in GCRF. */
static bst_status numerical_state(bst_ctx *ctx, const bst_world_orbit *orbit, double seconds,
                                  bool with_burns, bst_world_state *out) {
    const bst_trajectory *path = with_burns && orbit->burnt ? orbit->burnt : orbit->unburnt;
    bst_status status =
        bst_trajectory_state(ctx, path, seconds, &out->position_m, &out->velocity_mps);
    return status == BST_OK ? BST_OK : bst_fail_prefix(ctx, status, "orbit of %s", orbit->name);
}

/* State of an object on a relative orbit about its chief. */
static bst_status relative_state(bst_ctx *ctx, const bst_world_orbit *orbit, bst_sky_clock *clock,
                                 bst_time epoch, double seconds, bool with_burns,
                                 bst_world_state *out) {
    bst_world_state ref;
    BST_TRY(bst_world_orbit_state(ctx, orbit->reference, clock, epoch, seconds, with_burns, &ref));
    bst_vec3 r, t, n;
    rtn_axes(&ref, &r, &t, &n);
    bst_vec3 offset = from_rtn(
        r, t, n, bst_vec3_axpy(orbit->offset_rtn_m, seconds - orbit->at_s, orbit->rate_rtn_mps));
    bst_vec3 rate = from_rtn(r, t, n, orbit->rate_rtn_mps);
    /* the axes rotate with the orbit: h / r^2 about the normal */
    double radius2 = bst_vec3_dot(ref.position_m, ref.position_m);
    bst_vec3 spin = bst_vec3_scale(bst_vec3_cross(ref.position_m, ref.velocity_mps), 1.0 / radius2);
    out->position_m = bst_vec3_add(ref.position_m, offset);
    out->velocity_mps =
        bst_vec3_add(ref.velocity_mps, bst_vec3_add(rate, bst_vec3_cross(spin, offset)));
    return BST_OK;
}

/* Deviation of a manoeuvred orbit from the catalogued orbit at `seconds`, not before `burn`. It is
 * the difference of two two-body orbits from the burn, so that the catalogued orbit keeps its
 * perturbations (Encke's method). The neglected difference of perturbations is below 1 m per km of
 * separation in an hour at GEO. */
static bst_status deviation_at(bst_ctx *ctx, const bst_world_burn *burn, double seconds,
                               bst_world_state *out) {
    bst_world_state base, moved;
    double dt = seconds - burn->time_s;
    BST_TRY(bst_kepler_propagate(ctx, BST_EARTH_MU_M3PS2, burn->base.position_m,
                                 burn->base.velocity_mps, dt, &base.position_m,
                                 &base.velocity_mps));
    BST_TRY(bst_kepler_propagate(
        ctx, BST_EARTH_MU_M3PS2, bst_vec3_add(burn->base.position_m, burn->deviation.position_m),
        bst_vec3_add(burn->base.velocity_mps, burn->deviation.velocity_mps), dt, &moved.position_m,
        &moved.velocity_mps));
    out->position_m = bst_vec3_sub(moved.position_m, base.position_m);
    out->velocity_mps = bst_vec3_sub(moved.velocity_mps, base.velocity_mps);
    return BST_OK;
}

static void add_state(bst_world_state *to, const bst_world_state *what) {
    to->position_m = bst_vec3_add(to->position_m, what->position_m);
    to->velocity_mps = bst_vec3_add(to->velocity_mps, what->velocity_mps);
}

bst_status bst_world_orbit_set_burns(bst_ctx *ctx, bst_world_orbit *orbit, bst_sky_clock *clock,
                                     bst_time epoch, const bst_burn_config *burns, int count) {
    orbit->burns = calloc((size_t)count + 1, sizeof *orbit->burns);
    if (!orbit->burns) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for burns");
    }
    for (int i = 0; i < count; i++) {
        bst_world_burn *burn = &orbit->burns[i];
        burn->time_s = burns[i].time_s;
        BST_TRY(bst_world_orbit_state(ctx, orbit, clock, epoch, burn->time_s, false, &burn->base));
        if (i > 0) {
            BST_TRY(deviation_at(ctx, burn - 1, burn->time_s, &burn->deviation));
        }
        bst_world_state before = burn->base;
        add_state(&before, &burn->deviation);
        bst_vec3 r, t, n;
        rtn_axes(&before, &r, &t, &n);
        const double *dv = burns[i].dv_rtn_mps;
        burn->deviation.velocity_mps = bst_vec3_add(
            burn->deviation.velocity_mps, from_rtn(r, t, n, (bst_vec3){dv[0], dv[1], dv[2]}));
        orbit->burn_count = i + 1;
    }
    return BST_OK;
}

bst_status bst_world_orbit_state(bst_ctx *ctx, const bst_world_orbit *orbit, bst_sky_clock *clock,
                                 bst_time epoch, double seconds, bool with_burns,
                                 bst_world_state *out) {
    bool steered = false;
    if (with_burns && orbit->external) {
        BST_TRY(bst_external_states_state(ctx, orbit->external, seconds, &steered, out));
    }
    if (steered) {
        return BST_OK;
    }
    switch (orbit->source) {
        case BST_ORBIT_SGP4:
            BST_TRY(sgp4_state(ctx, orbit, clock, epoch, seconds, out));
            break;
        case BST_ORBIT_OEM:
        case BST_ORBIT_INJECTED:
            BST_TRY(bst_world_orbit_file_state(ctx, orbit, clock, epoch, seconds, out));
            break;
        case BST_ORBIT_NUMERICAL:
            return numerical_state(ctx, orbit, seconds, with_burns, out);
        default:
            BST_TRY(relative_state(ctx, orbit, clock, epoch, seconds, with_burns, out));
    }
    int burn = with_burns ? orbit->burn_count - 1 : -1;
    while (burn >= 0 && orbit->burns[burn].time_s > seconds) {
        burn--;
    }
    if (burn >= 0) {
        bst_world_state deviation;
        BST_TRY(deviation_at(ctx, &orbit->burns[burn], seconds, &deviation));
        add_state(out, &deviation);
    }
    return BST_OK;
}

bst_status bst_world_orbit_line_of_sight(bst_ctx *ctx, const bst_world_orbit *object,
                                         const bst_world_reception *at, bool with_burns,
                                         bst_vec3 *geometric_m, bst_world_state *object_state,
                                         double *emission_s) {
    /* Barycentric light time: the Earth moves by v_earth * tau between emission and reception, and
     * the observer's aberration is taken with its barycentric velocity. Omitting either causes an
     * error of 20 arcsec. Three iterations reduce the error by (v/c)^3. */
    double tau = 0.0;
    for (int i = 0; i < 3; i++) {
        BST_TRY(bst_world_orbit_state(ctx, object, at->clock, at->epoch, at->seconds - tau,
                                      with_burns, object_state));
        bst_vec3 d = bst_vec3_sub(object_state->position_m, at->observer->position_m);
        *geometric_m = bst_vec3_axpy(d, -tau, at->bodies->earth_bary_mps);
        tau = bst_vec3_norm(*geometric_m) / BST_LIGHT_SPEED_MPS;
    }
    *emission_s = at->seconds - tau;
    return BST_OK;
}
