#include "sim/world/scene/object_shape.h"

#include <stdlib.h>

#include "sim/astro/bodies.h"
#include "sim/optics/band.h"
#include "sim/satellite/interreflection.h"

bool bst_object_shape_is_given(const bst_satellite_config *config) {
    return *config->file || config->parts.count > 0 || config->joints.count > 0 ||
           config->materials.count > 0;
}

void bst_object_shape_free(bst_object_shape *shape) {
    if (shape) {
        bst_shape_forces_free(shape->forces);
        bst_satellite_free(shape->satellite);
        bst_body_attitude_free(shape->attitude);
        free(shape->burn_s);
        free(shape);
    }
}

bst_status bst_object_shape_create(bst_ctx *ctx, const bst_satellite_config *config,
                                   const bst_config_list *attitude,
                                   const bst_attitude_source *source, bst_object_shape **out) {
    bst_object_shape *shape = *out = calloc(1, sizeof *shape);
    if (!shape) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the shape of an object");
    }
    bst_status status = bst_satellite_create(ctx, config, source->base_dir, &shape->satellite);
    if (status != BST_OK) {
        status = bst_fail_prefix(ctx, BST_ERR_CONFIG, "shape");
    } else {
        shape->glint_count = bst_glint_surfaces(shape->satellite, shape->glints);
        status = bst_body_attitude_create(ctx, attitude, source, &shape->attitude);
        status = status == BST_OK ? BST_OK : bst_fail_prefix(ctx, status, "attitude");
    }
    if (status != BST_OK) {
        bst_object_shape_free(shape);
        *out = NULL;
    }
    return status;
}

double bst_object_shape_temperature_k(const bst_brightness_config *b, double sunlit_fraction) {
    double warm = sunlit_fraction * pow(b->temperature_k, 4.0) +
                  (1.0 - sunlit_fraction) * pow(b->shadow_temperature_k, 4.0);
    return sqrt(sqrt(warm));
}

/* Light per wavelength over that in V, and magnitude, from the model's flux. */
static void make_glow(const bst_satellite_flux *flux, const bst_scene_lighting *l, double range_m,
                      bst_scene_glow *out) {
    double sun_m = bst_vec3_norm(bst_vec3_sub(l->sun_m, l->object_m));
    double au2 = sun_m * sun_m / (BST_AU_M * BST_AU_M);
    double sunlight = l->sunlight ? l->sunlight->light[BST_SUNLIGHT_V] : l->sunlit_fraction;
    double sun = flux->sun[BST_SUNLIGHT_V] * sunlight / au2, earth = flux->earth[BST_SUNLIGHT_V];
    earth /= bst_vec3_dot(l->sun_m, l->sun_m) / (BST_AU_M * BST_AU_M);
    double all = (sun + earth) / (range_m * range_m);
    out->v_mag = all > 0.0 ? BST_SUN_V_MAG - 2.5 * log10(all) : (double)INFINITY;
    out->earth_share = sun + earth > 0.0 ? earth / (sun + earth) : 0.0;
    for (int k = 0; k < BST_SUNLIGHT_COLOURS; k++) {
        double red = l->sunlight && sunlight > 0.0 ? l->sunlight->light[k] / sunlight : 1.0;
        double own =
            flux->sun[BST_SUNLIGHT_V] > 0.0 ? flux->sun[k] / flux->sun[BST_SUNLIGHT_V] : 1.0;
        out->redness[k] = red * own;
    }
}

void bst_object_shape_aspect(const bst_object_shape *shape, const bst_scene_lighting *l,
                             bst_vec3 velocity_mps, bst_object_aspect *out) {
    bst_vec3 to_eye = bst_vec3_sub(l->eye_m, l->object_m);
    bst_vec3 to_sun = bst_vec3_sub(l->sun_m, l->object_m);
    bst_attitude_state state = {l->object_m, velocity_mps, bst_vec3_unit(to_sun), l->seconds};
    bst_quat q = out->q_body_from_gcrf = bst_body_attitude_at(shape->attitude, &state);
    out->aim = (bst_satellite_aim){
        .sun = bst_quat_rotate(q, state.sun),
        .earth = bst_quat_rotate(q, bst_vec3_unit(bst_vec3_scale(l->object_m, -1.0))),
        .target = bst_quat_rotate(q, bst_vec3_unit(to_eye)),
        .seconds = l->seconds};
    out->sun_radius_rad = BST_SUN_RADIUS_M / bst_vec3_norm(to_sun);
}

void bst_object_shape_glow(const bst_object_shape *shape, bst_satellite_pose *pose,
                           const bst_brightness_config *b, const bst_scene_lighting *l,
                           bst_vec3 velocity_mps, bst_scene_glow *out) {
    double range_m = bst_vec3_norm(bst_vec3_sub(l->eye_m, l->object_m));
    bst_object_aspect aspect;
    bst_object_shape_aspect(shape, l, velocity_mps, &aspect);
    bst_earthlight earthlight;
    if (b->earthshine) {
        bst_earth_surface surface = {.diffuse = b->earth_albedo, .fineness = 1};
        bst_earthlight_at(&surface, l->object_m, bst_vec3_unit(l->sun_m), &earthlight);
        bst_earthlight_turn(aspect.q_body_from_gcrf, &earthlight);
    }
    bst_satellite_light light = {
        .sun = aspect.aim.sun,
        .observer = aspect.aim.target,
        .sun_radius_rad = aspect.sun_radius_rad,
        .sunlit = l->sunlight ? l->sunlight->light[BST_SUNLIGHT_V] : l->sunlit_fraction,
        .earthlight = b->earthshine ? &earthlight : NULL,
        .emission = !l->reflected_only};
    bst_satellite_flux flux;
    bst_satellite_pose_set(pose, &aspect.aim);
    bst_satellite_flux_at(pose, &light, &flux);
    if (pose->interreflection && light.sunlit > 0.0) {
        bst_interreflection_add(pose->interreflection, pose, &light, &flux);
    }
    *out = (bst_scene_glow){.resolved = b->resolved};
    make_glow(&flux, l, range_m, out);
    out->emission_sr = flux.emission_m2 / (range_m * range_m);
    out->temperature_k = bst_object_shape_temperature_k(b, l->sunlit_fraction);
    out->thermal_reflection =
        flux.visible_m2 > 0.0 ? 1.0 - flux.emission_m2 / flux.visible_m2 : 1.0;
}

/* Largest rate of a joint about a time, apart from what follows the orbit. */
static double joint_rate_radps(const bst_joint *j, double seconds) {
    if (j->follows != BST_JOINT_TABLE) {
        bool turns = j->follows == BST_JOINT_SPIN || j->follows == BST_JOINT_BURN;
        return turns ? fabs(j->rate_radps) : 0.0;
    }
    double most = 0.0;
    for (int i = 1; i < j->table.count; i++) {
        double from = j->table.x[i - 1], to = j->table.x[i];
        if (to > seconds - 60.0 && from < seconds + 60.0) {
            most = fmax(most, fabs(j->table.y[i] - j->table.y[i - 1]) / (to - from));
        }
    }
    return most * BST_DEG_RAD;
}

/* Largest angle by which a surface turns during an exposure, without the motion on the orbit. */
static double turn_rad(const bst_object_shape *shape, double seconds, double exposure_s) {
    const bst_satellite *s = shape->satellite;
    double rate = bst_body_attitude_rate_radps(shape->attitude, seconds);
    for (int i = 0; i < s->joint_count; i++) {
        rate += joint_rate_radps(&s->joints[i], seconds);
    }
    return rate * exposure_s;
}

int bst_object_shape_samples(const bst_object_shape *shape, double seconds, double exposure_s) {
    enum { FEWEST = 16, MOST = 64 };
    int samples = (int)fmin(
        fmax(ceil(2.0 * turn_rad(shape, seconds, exposure_s) / BST_GLINT_WIDEST_RAD), FEWEST),
        MOST);
    return samples + samples % 2;
}

/* Context of bst_object_shape_glints. */
typedef struct glint_search {
    const bst_object_shape *shape;
    bst_satellite_pose *pose;
    void (*aspect)(void *user, double u, bst_object_aspect *out);
    void *user;
} glint_search;

static void glint_offsets(void *user, double u, double *offsets) {
    const glint_search *s = user;
    bst_object_aspect at;
    s->aspect(s->user, u, &at);
    bst_satellite_pose_turn(s->pose, &at.aim);
    bst_vec3 half = bst_vec3_unit(bst_vec3_add(at.aim.sun, at.aim.target));
    for (int i = 0; i < s->shape->glint_count; i++) {
        offsets[i] = bst_glint_offset(&s->shape->glints[i], s->pose, half);
    }
}

int bst_object_shape_glints(const bst_object_shape *shape, bst_satellite_pose *pose, double seconds,
                            double exposure_s,
                            void (*aspect)(void *user, double u, bst_object_aspect *out),
                            void *user, double *times, int most) {
    /* STEP_RAD: of the first scan; at most a sixteenth of the exposure, for motion on the orbit */
    static const double STEP_RAD = 0.15;
    enum { FEWEST = 16, MOST = 4096 };
    if (shape->glint_count == 0) {
        return 0;
    }
    bst_object_aspect middle;
    aspect(user, 0.5, &middle);
    glint_search search = {shape, pose, aspect, user};
    int steps =
        (int)fmin(fmax(ceil(turn_rad(shape, seconds, exposure_s) / STEP_RAD), FEWEST), MOST);
    /* the Sun's disc widens the lobe of the half vector by half its radius */
    return bst_glint_times(shape->glints, shape->glint_count, 0.5 * middle.sun_radius_rad, steps,
                           glint_offsets, &search, times, most);
}
