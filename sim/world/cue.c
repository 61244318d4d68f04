#include "sim/astro/belt.h"
#include "sim/world/world_internal.h"

bst_status bst_world_object_nominal_line(bst_ctx *ctx, const bst_world *world, int object,
                                         bst_sky_clock *clock, double seconds,
                                         const bst_world_state *eye, bst_vec3 *line_m) {
    bst_sky_rotation sky;
    BST_TRY(bst_sky_clock_at(ctx, clock, bst_time_add(world->epoch, seconds), &sky));
    bst_world_state target;
    double emission_s;
    const bst_world_reception at = {eye, clock, world->epoch, &sky.bodies, seconds};
    return bst_world_orbit_line_of_sight(ctx, &world->objects[object].orbit, &at, false, line_m,
                                         &target, &emission_s);
}

bst_status bst_world_cue_nominal_line(bst_ctx *ctx, const bst_world *world,
                                      const bst_world_cue_at *at, bst_vec3 *line_m) {
    int object = world->observers[at->observer].sensors[at->sensor].cue_object;
    *line_m = (bst_vec3){0, 0, 0};
    return object < 0 ? BST_OK
                      : bst_world_object_nominal_line(ctx, world, object, at->clock, at->seconds,
                                                      at->eye, line_m);
}

bst_status bst_world_cue_nominal_direction(bst_ctx *ctx, const bst_world *world,
                                           const bst_world_cue_at *at, bst_vec3 *out) {
    const world_sensor *s = &world->observers[at->observer].sensors[at->sensor];
    if (s->config.cue.region.kind != BST_REGION_NONE) {
        return bst_world_region_place(ctx, world, at, 0.0, 0.0, out);
    }
    if (s->cue_object < 0) {
        const double *radec = s->config.cue.direction_radec_deg;
        *out = bst_vec3_from_radec(radec[0] * BST_DEG_RAD, radec[1] * BST_DEG_RAD);
        return BST_OK;
    }
    bst_vec3 line;
    BST_TRY(bst_world_cue_nominal_line(ctx, world, at, &line));
    *out = bst_vec3_unit(line);
    return BST_OK;
}

double bst_world_region_half_length_rad(const bst_region_config *region) {
    const double *ends = region->arc_radec_deg;
    switch (region->kind) {
        case BST_REGION_ARC:
            return 0.5 * bst_vec3_angle(
                             bst_vec3_from_radec(ends[0] * BST_DEG_RAD, ends[1] * BST_DEG_RAD),
                             bst_vec3_from_radec(ends[2] * BST_DEG_RAD, ends[3] * BST_DEG_RAD));
        case BST_REGION_GEOSTATIONARY:
            return 0.5 * (region->longitude_deg[1] - region->longitude_deg[0]) * BST_DEG_RAD;
        default:
            return 0.0;
    }
}

/* Direction in a cue's region by angles along and across the great circle between its ends, from
 * its centre. */
static bst_vec3 on_arc(const double ends_deg[4], double along_rad, double across_rad) {
    bst_vec3 a = bst_vec3_from_radec(ends_deg[0] * BST_DEG_RAD, ends_deg[1] * BST_DEG_RAD);
    bst_vec3 b = bst_vec3_from_radec(ends_deg[2] * BST_DEG_RAD, ends_deg[3] * BST_DEG_RAD);
    bst_vec3 pole = bst_vec3_cross(a, b);
    pole = bst_vec3_norm(pole) > 1e-12 ? bst_vec3_unit(pole) : bst_vec3_perpendicular(a);
    bst_vec3 middle = bst_vec3_unit(bst_vec3_add(a, b));
    bst_vec3 ahead = bst_vec3_cross(pole, middle);
    bst_vec3 on = bst_vec3_axpy(bst_vec3_scale(middle, cos(along_rad)), sin(along_rad), ahead);
    return bst_vec3_axpy(bst_vec3_scale(on, cos(across_rad)), sin(across_rad), pole);
}

bst_status bst_world_region_place(bst_ctx *ctx, const bst_world *world, const bst_world_cue_at *at,
                                  double along_rad, double across_rad, bst_vec3 *out) {
    const bst_region_config *region =
        &world->observers[at->observer].sensors[at->sensor].config.cue.region;
    if (region->kind == BST_REGION_ARC) {
        *out = on_arc(region->arc_radec_deg, along_rad, across_rad);
        return BST_OK;
    }
    bst_sky_rotation sky;
    BST_TRY(bst_sky_clock_at(ctx, at->clock, bst_time_add(world->epoch, at->seconds), &sky));
    double middle = 0.5 * (region->longitude_deg[0] + region->longitude_deg[1]) * BST_DEG_RAD;
    bst_vec3 place = bst_belt_place(middle + along_rad, across_rad, &sky.frames.itrf_from_gcrf);
    *out = bst_vec3_unit(bst_vec3_sub(place, at->eye->position_m));
    return BST_OK;
}

/* Rejects cue regions whose arc has no length or no unique centre. */
static bst_status check_region(bst_ctx *ctx, const char *scenario, int observer, int sensor,
                               const bst_region_config *region) {
    double half = bst_world_region_half_length_rad(region);
    if (region->kind == BST_REGION_NONE || (half > 0.0 && half < 0.49 * BST_PI)) {
        return BST_OK;
    }
    return bst_fail(ctx, BST_ERR_CONFIG,
                    "%s: /observers/%d/sensors/%d/cue/region/%s: the region is %g deg long "
                    "(allowed: more than 0, less than 176, from the first end to the second)",
                    scenario, observer, sensor,
                    region->kind == BST_REGION_ARC ? "arc_radec_deg" : "longitude_deg",
                    2.0 * half / BST_DEG_RAD);
}

bst_status bst_world_cue_resolve(bst_ctx *ctx, const char *scenario, bst_world *world, int observer,
                                 int sensor, bst_sky_clock *clock) {
    world_sensor *s = &world->observers[observer].sensors[sensor];
    const bst_cue_config *cue = &s->config.cue;
    s->cue_object = *cue->object ? bst_world_find_object(world, cue->object) : -1;
    if (*cue->object && s->cue_object < 0) {
        return bst_fail(
            ctx, BST_ERR_CONFIG,
            "%s: /observers/%d/sensors/%d/cue/object: there is no object \"%s\" in /world/objects",
            scenario, observer, sensor, cue->object);
    }
    BST_TRY(check_region(ctx, scenario, observer, sensor, &cue->region));
    /* direction by the onboard clock, orbit estimate and catalogued target orbit */
    bst_vec3 nominal;
    bst_world_state eye;
    double now_s = bst_world_nav_seconds(world, observer, sensor, 0.0);
    bst_status status = bst_world_orbit_state(ctx, &world->observers[observer].orbit, clock,
                                              world->epoch, now_s, true, &eye);
    if (status == BST_OK) {
        bst_world_nav_estimate(world, observer, sensor, now_s, &eye);
        const bst_world_cue_at at = {observer, sensor, clock, now_s, &eye};
        status = bst_world_cue_nominal_direction(ctx, world, &at, &nominal);
    }
    if (status != BST_OK) {
        return bst_fail_prefix(ctx, status == BST_ERR_NUMERIC ? BST_ERR_CONFIG : status,
                               "%s: /observers/%d/sensors/%d/cue", scenario, observer, sensor);
    }
    /* The cue error is a rotation about the image axis perpendicular to the offset axis. */
    const double *x = s->config.x_axis_gcrf;
    bst_vec3 hint = {x[0], x[1], x[2]};
    if (!(bst_vec3_norm(hint) > 0.0)) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "%s: /observers/%d/sensors/%d/x_axis_gcrf: a direction of length zero "
                        "(found [0, 0, 0]; allowed: any other)",
                        scenario, observer, sensor);
    }
    bst_quat gcrf_from_cam = bst_quat_conj(bst_quat_look(nominal, hint));
    static const double axes[4][3] = {
        {0, 1, 0}, {0, -1, 0}, {-1, 0, 0}, {1, 0, 0}}; /* x, -x, y, -y */
    const double *a = axes[cue->offset_axis];
    bst_vec3 axis = {a[0], a[1], a[2]};
    if (cue->offset_angle_deg != 0.0) {
        axis = bst_quat_rotate(
            bst_quat_from_rotvec((bst_vec3){0, 0, cue->offset_angle_deg * BST_DEG_RAD}), axis);
    }
    s->cue_rotation =
        bst_quat_rotate(gcrf_from_cam, bst_vec3_scale(axis, cue->offset_deg * BST_DEG_RAD));
    s->body_attitude =
        bst_quat_look(bst_quat_rotate(bst_quat_from_rotvec(s->cue_rotation), nominal), hint);
    return BST_OK;
}
