/* Visibility of catalogue objects from a spacecraft's estimated position. */
#include <assert.h>
#include "control/guidance/pointing_feasibility.h"
#include "control/tasking/tasking_internal.h"
#include "sim/optics/streak_image.h"

const char *bst_tasking_reason(int why) {
    static const char *const reasons[BST_WHY_COUNT] = {
        [BST_WHY_NOT] = "visible",
        [BST_WHY_NO_ORBIT] = "without an orbit",
        [BST_WHY_ITSELF] = "the spacecraft itself",
        [BST_WHY_EARTH] = "behind the Earth or near its limb",
        [BST_WHY_SUN] = "near the Sun",
        [BST_WHY_MOON] = "near the Moon",
        [BST_WHY_SHADOW] = "in the Earth's shadow",
        [BST_WHY_FAINT] = "too faint",
        [BST_WHY_RATE] = "too fast",
        [BST_WHY_MOUNT] = "out of the mount's reach"};
    return why >= 0 && why < BST_WHY_COUNT ? reasons[why] : "unknown";
}

static int zones_at(const bst_tasking_config *c, bst_vec3 position_m, bst_vec3 to_sun,
                    bst_vec3 to_moon, bst_keep_out_zone zones[BST_ZONE_KINDS]) {
    bst_keep_out exclusion = {.sun_rad = c->sun_keep_out_deg * BST_DEG_RAD,
                              .moon_rad = c->moon_keep_out_deg * BST_DEG_RAD,
                              .earth = true,
                              .earth_limb_rad = c->earth_limb_keep_out_deg * BST_DEG_RAD,
                              .limb_altitude_m = 1e3 * c->earth_limb_altitude_km};
    return bst_keep_out_zones(&exclusion, position_m, to_sun, to_moon, zones);
}

static void cosines_of(const bst_keep_out_zone *zones, int count, double cosines[BST_ZONE_KINDS]) {
    for (int i = 0; i < count; i++) {
        cosines[i] = cos(zones[i].half_angle_rad);
    }
}

void bst_tasking_telemetry(bst_tasking *t, int sensor, const bst_nav_telemetry *nav,
                           const bst_mount_status *mount) {
    assert(t && sensor >= 0 && sensor < t->sensor_count);
    bst_tasking_sensor *s = &t->sensors[sensor];
    if (nav) {
        s->nav = *nav;
        s->nav_known = true;
        s->zone_count =
            zones_at(&t->config, nav->position_gcrf_m, nav->sun_m, nav->moon_m, s->zones);
        cosines_of(s->zones, s->zone_count, s->zone_cosines);
    }
    if (mount) {
        s->mount = *mount;
        s->mount_known = true;
    }
}

static const bst_tasking_why zone_why[BST_ZONE_KINDS] = {
    [BST_ZONE_SUN] = BST_WHY_SUN, [BST_ZONE_MOON] = BST_WHY_MOON, [BST_ZONE_EARTH] = BST_WHY_EARTH};

static bst_tasking_why zone_reason(const bst_keep_out_zone *zones, const double *cosines, int count,
                                   bst_vec3 direction) {
    bst_tasking_why why = BST_WHY_NOT;
    for (int i = 0; i < count; i++) {
        if (bst_vec3_dot(zones[i].axis, direction) > cosines[i] &&
            (why == BST_WHY_NOT || zone_why[zones[i].kind] < why)) {
            why = zone_why[zones[i].kind];
        }
    }
    return why;
}

bst_tasking_why bst_tasking_glance(const bst_tasking_sensor *s, bst_vec3 place_m,
                                   bst_vec3 *direction) {
    bst_vec3 line = bst_vec3_sub(place_m, s->nav.position_gcrf_m);
    *direction = bst_vec3_unit(line);
    bst_tasking_why why = zone_reason(s->zones, s->zone_cosines, s->zone_count, *direction);
    if (why == BST_WHY_NOT) {
        bst_vec3 sun_m = bst_vec3_add(s->nav.sun_m, s->nav.position_gcrf_m);
        why = bst_astro_sun_fraction(place_m, sun_m, BST_EARTH_POLE_J2000) > 0.5 ? BST_WHY_NOT
                                                                                 : BST_WHY_SHADOW;
    }
    return why;
}

/* Context of the callback of bst_pointing_feasibility_at. */
typedef struct reach_user {
    const bst_tasking *tasking;
    const bst_tasking_sensor *sensor;
    int object;
} reach_user;

/* Geometry of an object for bst_pointing_feasibility_at (callback). */
static bst_status reach_look(void *user, bst_ctx *ctx, double seconds,
                             bst_pointing_feasibility_look *out) {
    const reach_user *r = user;
    bst_world_state eye;
    bst_bodies bodies;
    bst_world_sight sight;
    BST_TRY(bst_knowledge_eye_at(ctx, r->sensor->view, seconds, &eye, &bodies));
    BST_TRY(bst_knowledge_sight_at(ctx, r->sensor->view, r->object, seconds, &sight));
    double dt = seconds - (double)r->sensor->mount.tick / r->tasking->tick_rate_hz;
    bst_quat turn = bst_quat_from_rotvec(bst_vec3_scale(r->sensor->mount.rate_body_radps, -dt));
    *out = (bst_pointing_feasibility_look){
        .valid = true,
        .direction_gcrf = sight.apparent,
        .position_m = eye.position_m,
        .q_body_from_gcrf = bst_quat_unit(bst_quat_mul(turn, r->sensor->mount.q_body_from_gcrf))};
    return BST_OK;
}

static bst_status mount_reaches(bst_ctx *ctx, const bst_tasking *t, const bst_tasking_sensor *s,
                                int object, double seconds, bool *reached) {
    *reached = true;
    if (!s->mount_known || s->mount.axes == 0) {
        return BST_OK;
    }
    reach_user user = {t, s, object};
    bst_pointing_feasibility_problem problem = {
        .look = reach_look, .user = &user, .mount = &s->mount, .limit_fraction = 0.9};
    bst_pointing_feasibility reach;
    BST_TRY(bst_pointing_feasibility_at(ctx, &problem, seconds, &reach));
    *reached = reach == BST_REACH_OK;
    return BST_OK;
}

bst_status bst_tasking_look(bst_ctx *ctx, const bst_tasking *t, int sensor, int object,
                            double seconds, bst_tasking_visibility *out) {
    assert(t && out && sensor >= 0 && sensor < t->sensor_count);
    const bst_tasking_sensor *s = &t->sensors[sensor];
    const double step_s = 1.0; /* interval of the rate difference */
    bst_ctx quiet = {0};       /* an orbit that has ended is no error here */
    bst_world_sight now;
    bst_vec3 later;
    bst_world_state eye;
    bst_bodies bodies;
    out->snr = 0.0;
    if (bst_knowledge_is_itself(s->knowledge, object)) {
        out->why = BST_WHY_ITSELF;
        return BST_OK;
    }
    BST_TRY(bst_knowledge_eye_at(ctx, s->view, seconds, &eye, &bodies));
    if (bst_knowledge_sight_at(&quiet, s->view, object, seconds, &now) != BST_OK) {
        out->why = BST_WHY_NO_ORBIT;
        return BST_OK;
    }
    out->sight = now;
    bst_keep_out_zone zones[BST_ZONE_KINDS];
    int count = zones_at(&t->config, eye.position_m, bst_vec3_sub(bodies.sun_m, eye.position_m),
                         bst_vec3_sub(bodies.moon_m, eye.position_m), zones);
    double cosines[BST_ZONE_KINDS];
    cosines_of(zones, count, cosines);
    bst_tasking_why why = zone_reason(zones, cosines, count, now.apparent);
    why = now.occulted && why == BST_WHY_NOT ? BST_WHY_EARTH : why;
    why = why == BST_WHY_NOT && now.sunlit_fraction < 0.5 ? BST_WHY_SHADOW : why;
    out->why = why;
    if (why != BST_WHY_NOT) {
        return BST_OK;
    }
    const bst_camera *camera = bst_knowledge_camera(s->knowledge);
    double electrons = bst_scene_glow_electrons_per_s(camera, &now.glow, NULL) * s->exposure_s;
    out->snr = electrons / (s->noise_e * sqrt(s->pixels));
    bool reached = true;
    if (out->snr < t->config.min_snr) {
        out->why = BST_WHY_FAINT;
    } else if (bst_knowledge_direction_at(&quiet, s->view, object, seconds + step_s, &later) !=
               BST_OK) {
        out->why = BST_WHY_NO_ORBIT;
    } else if (bst_vec3_angle(now.geometric, later) >
               t->config.max_rate_arcsec_per_s * BST_ARCSEC_RAD * step_s) {
        out->why = BST_WHY_RATE;
    } else {
        BST_TRY(mount_reaches(ctx, t, s, object, seconds, &reached));
        out->why = reached ? BST_WHY_NOT : BST_WHY_MOUNT;
    }
    return BST_OK;
}

void bst_tasking_noise(bst_tasking_sensor *s) {
    const bst_camera *camera = bst_knowledge_camera(s->knowledge);
    double sigma2 = bst_camera_psf_sigma_px(camera) * bst_camera_psf_sigma_px(camera) + 1.0 / 12.0;
    s->noise_e = bst_camera_noise_e(camera, bst_camera_background_e_per_s(camera) * s->exposure_s,
                                    s->exposure_s);
    s->pixels = 1.0 / bst_optics_image_squared(sqrt(sigma2), sqrt(sigma2), 0.0);
}

/* Error of a tabulated position, m: 4 s at 11.2 km/s, the speed of escape at the ground, and 1 km.
 */
#define TABLE_ERROR_M (4.0 * 11200.0 + 1000.0)
/* more than aberration and light time, rad */
#define APPARENT_RAD 3e-4

/* Reason that holds wherever the object is within the error of its tabulated position, and the
 * spacecraft within its motion in `age_s` since the latest navigation message. BST_WHY_NOT: the
 * table does not decide. */
static bst_tasking_why sure_rejection(const bst_tasking_config *c, const bst_tasking_sensor *s,
                                      bst_vec3 place_m, double age_s) {
    const bst_vec3 line = bst_vec3_sub(place_m, s->nav.position_gcrf_m);
    const double range = bst_vec3_norm(line), radius = bst_vec3_norm(s->nav.position_gcrf_m);
    const double own_m = fabs(age_s) * bst_vec3_norm(s->nav.velocity_gcrf_mps);
    const double error_m = TABLE_ERROR_M + own_m;
    if (!(range > error_m)) {
        return BST_WHY_NOT;
    }
    /* the limb of the Earth moves by up to four times the own motion over the radius */
    const double margin = asin(error_m / range) + 4.0 * own_m / radius + APPARENT_RAD;
    bst_tasking_why sure = BST_WHY_COUNT, unsure = BST_WHY_COUNT;
    for (int i = 0; i < s->zone_count; i++) {
        const double off = bst_vec3_angle(s->zones[i].axis, line) - s->zones[i].half_angle_rad;
        const bst_tasking_why why = zone_why[s->zones[i].kind];
        if (off < -margin && why < sure) {
            sure = why;
        } else if (fabs(off) <= margin && why < unsure) {
            unsure = why;
        }
    }
    if (sure != BST_WHY_COUNT || unsure != BST_WHY_COUNT) {
        return sure < unsure ? sure : BST_WHY_NOT;
    }
    if (c->earth_limb_keep_out_deg < 0.0) {
        return BST_WHY_NOT; /* it may be behind the Earth, outside of the zone */
    }
    /* in the shadow even if it is farther from the axis */
    const bst_vec3 sun_m = bst_vec3_add(s->nav.sun_m, s->nav.position_gcrf_m);
    const bst_vec3 axis = bst_vec3_unit(sun_m);
    const bst_vec3 across = bst_vec3_axpy(place_m, -bst_vec3_dot(place_m, axis), axis);
    const double across_m = bst_vec3_norm(across);
    if (!(across_m > 0.0)) {
        return BST_WHY_NOT;
    }
    const bst_vec3 outer = bst_vec3_axpy(place_m, TABLE_ERROR_M / across_m, across);
    return bst_astro_sun_fraction(outer, sun_m, BST_EARTH_POLE_J2000) < 0.5 ? BST_WHY_SHADOW
                                                                            : BST_WHY_NOT;
}

bst_status bst_tasking_survey_look(bst_ctx *ctx, const bst_tasking *t, int sensor, int object,
                                   double seconds, bst_tasking_why *why) {
    const bst_tasking_sensor *s = &t->sensors[sensor];
    const bst_vec3 place = {t->place_m[0][object], t->place_m[1][object], t->place_m[2][object]};
    *why = BST_WHY_NOT;
    if (bst_knowledge_is_itself(s->knowledge, object)) {
        *why = BST_WHY_ITSELF;
    } else if (bst_vec3_norm(place) == 0.0) {
        *why = BST_WHY_NO_ORBIT;
    } else if (s->nav_known && !isnan(place.x)) {
        *why =
            sure_rejection(&t->config, s, place, seconds - (double)s->nav.tick / t->tick_rate_hz);
    }
    if (*why == BST_WHY_NOT) {
        bst_tasking_visibility seen;
        BST_TRY(bst_tasking_look(ctx, t, sensor, object, seconds, &seen));
        *why = seen.why;
    }
    return BST_OK;
}

bst_status bst_tasking_survey(bst_ctx *ctx, bst_tasking *t, double seconds,
                              bst_tasking_report *out) {
    *out = (bst_tasking_report){.targets = 0};
    t->places_s = bst_knowledge_places(t->sensors[0].knowledge, seconds, t->place_m[0],
                                       t->place_m[1], t->place_m[2]);
    for (int i = 0; i < t->object_count; i++) {
        if (t->line[i] < 0) {
            continue;
        }
        out->targets++;
        out->seen += t->seen_s[i] >= 0.0;
        bst_tasking_why best = BST_WHY_COUNT;
        for (int s = 0; s < t->sensor_count && best != BST_WHY_NOT; s++) {
            bst_tasking_why why;
            BST_TRY(bst_tasking_survey_look(ctx, t, s, i, seconds, &why));
            /* the reason nearest to visibility */
            best = why == BST_WHY_NOT || best == BST_WHY_COUNT || why > best ? why : best;
        }
        if (best == BST_WHY_NOT) {
            out->visible++;
        } else if (best < BST_WHY_COUNT) {
            out->why[best]++;
        }
    }
    return BST_OK;
}
