#include "sim/world/scene/source_body.h"

#include "sim/optics/band.h"

void bst_source_body_at(const bst_scene_source *source, double u, bst_source_body_state *out,
                        bst_earthlight *earthlight) {
    const bst_scene_source_body *b = source->body;
    double v = source->body_u[0] + u * (source->body_u[1] - source->body_u[0]);
    double place = fmin(fmax(v, 0.0), 1.0) * (b->times - 1);
    int k = b->times > 1 ? (int)fmin(floor(place), b->times - 2.0) : 0;
    out->q_body_from_gcrf =
        b->times > 1 ? bst_quat_slerp(b->q_body_from_gcrf[k], b->q_body_from_gcrf[k + 1], place - k)
                     : b->q_body_from_gcrf[0];
    bst_quat q = out->q_body_from_gcrf;
    out->apparent = bst_vec3_unit(bst_scene_source_direction(source, u));
    out->range_m =
        source->path ? bst_vec3_norm(bst_scene_source_place(source->path, u)) : source->range_m;
    bst_vec3 way = bst_vec3_sub(b->object_m[1], b->object_m[0]);
    bst_vec3 object_m = bst_vec3_axpy(b->object_m[0], v, way);
    bst_vec3 to_sun = bst_vec3_sub(b->sun_m, object_m);
    out->sun_radius_rad = BST_SUN_RADIUS_M / bst_vec3_norm(to_sun);
    out->aim = (bst_satellite_aim){
        .sun = bst_quat_rotate(q, bst_vec3_unit(to_sun)),
        .earth = bst_quat_rotate(q, bst_vec3_unit(bst_vec3_scale(object_m, -1.0))),
        .target = bst_quat_rotate(q, bst_vec3_scale(out->apparent, -1.0)),
        .seconds = b->seconds[0] + v * (b->seconds[1] - b->seconds[0])};
    out->earth = b->earthshine;
    if (b->earthshine && earthlight) {
        bst_earth_surface surface = {.diffuse = b->earth_albedo, .fineness = 1};
        bst_earthlight_at(&surface, object_m, bst_vec3_unit(b->sun_m), earthlight);
        bst_earthlight_turn(q, earthlight);
    }
}

void bst_source_body_set_pose(const bst_scene_source *source, const bst_source_body_state *state,
                              bst_satellite_pose *pose) {
    pose->burn_s = source->body->burn_s;
    pose->burn_count = source->body->burn_count;
    bst_satellite_pose_set(pose, &state->aim);
}

void bst_source_body_set_gain(const bst_camera *camera, const bst_brightness_config *brightness,
                              const bst_scene_lighting *l, bst_scene_source_body *body) {
    bool thermal = camera->spectrum && bst_band_is_thermal(camera->spectrum);
    bst_vec3 to_sun = bst_vec3_sub(l->sun_m, l->object_m);
    double au2 = bst_vec3_dot(to_sun, to_sun) / (BST_AU_M * BST_AU_M);
    double earth_au2 = bst_vec3_dot(l->sun_m, l->sun_m) / (BST_AU_M * BST_AU_M);
    double sunlight = l->sunlight ? l->sunlight->light[BST_SUNLIGHT_V] : l->sunlit_fraction;
    double at_1_au = bst_camera_electrons_per_s(camera, BST_SUN_V_MAG);
    double warm = bst_object_shape_temperature_k(brightness, l->sunlit_fraction);
    double emission = bst_camera_thermal_electrons_per_s(camera, warm, 1.0);
    for (int m = 0; m < body->satellite->material_count; m++) {
        const bst_material *material = &body->satellite->materials[m];
        double redness[BST_SUNLIGHT_COLOURS], own = material->colour[BST_SUNLIGHT_V];
        for (int k = 0; k < BST_SUNLIGHT_COLOURS; k++) {
            redness[k] = l->sunlight && sunlight > 0.0 ? l->sunlight->light[k] / sunlight : 1.0;
            redness[k] *= material->colour[k];
        }
        double red = camera->spectrum ? bst_band_reddened_sun(camera->spectrum, redness) : own;
        double part = thermal ? 1.0 - material->emissivity : 1.0;
        body->gain[m] = (bst_resolved_gain){
            .sun = at_1_au * sunlight / au2 * red * part,
            .earth = brightness->earthshine ? at_1_au / earth_au2 * own * part : 0.0,
            .emission = emission * material->emissivity};
    }
}
