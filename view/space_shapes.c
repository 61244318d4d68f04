#include "view/space_shapes.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/analysis/shape/turntable.h"
#include "sim/astro/bodies.h"
#include "sim/core/json_member.h"
#include "sim/satellite/pose.h"
#include "sim/world/scene/object_shape.h"
#include "view/recorded_run_internal.h"
#include "view/space_scene.h"

/* Difference of times at which an attitude is that of an exposure, s. */
static const double SAME_TIME_S = 1e-6;

static int triangle_count(const bst_satellite *s) {
    int count = 0;
    for (int f = 0; f < s->facet_count; f++) {
        count += s->facets[f].count - 2;
    }
    return count;
}

/* ------------------------------------------------------------------ what there is */

/* A number of a scenario's echo, whose numbers are text with all digits. */
static double echo_number(const cJSON *node, const char *key) {
    const cJSON *item = bst_json_member(node, key);
    return cJSON_IsRaw(item) ? strtod(item->valuestring, NULL) : bst_json_member_number(node, key);
}

/* Adds what a sensor's controller keeps away from. `modules`: of the sensor, with all defaults. */
static void add_keep_out(const cJSON *modules, cJSON *node) {
    const cJSON *guidance = bst_json_member(bst_json_member(modules, "control"), "guidance");
    const double sun = echo_number(guidance, "sun_keep_out_deg"),
                 moon = echo_number(guidance, "moon_keep_out_deg");
    const bool earth = cJSON_IsTrue(bst_json_member(guidance, "earth_keep_out"));
    if (!(sun > 0.0) && !(moon > 0.0) && !earth) {
        return;
    }
    cJSON *out = cJSON_AddObjectToObject(node, "keep_out");
    cJSON_AddNumberToObject(out, "sun_deg", sun > 0.0 ? sun : 0.0);
    cJSON_AddNumberToObject(out, "moon_deg", moon > 0.0 ? moon : 0.0);
    cJSON_AddBoolToObject(out, "earth", earth);
    cJSON_AddNumberToObject(out, "earth_limb_deg",
                            echo_number(guidance, "earth_limb_keep_out_deg"));
    cJSON_AddNumberToObject(out, "earth_limb_altitude_km",
                            echo_number(guidance, "earth_limb_altitude_km"));
}

void bst_view_space_add_shapes(const bst_view_run *run, cJSON *scene) {
    const bst_world *world = run->scene->world;
    const int objects = cJSON_GetArraySize(bst_json_member(scene, "objects"));
    cJSON *list = cJSON_AddArrayToObject(scene, "shapes");
    for (int i = 0; i < objects; i++) {
        const bst_object_shape *shape = bst_world_object(world, i)->shape;
        if (shape) {
            cJSON *one = cJSON_CreateObject();
            cJSON_AddNumberToObject(one, "object", i);
            cJSON_AddNumberToObject(one, "radius_m", shape->satellite->radius_m);
            cJSON_AddNumberToObject(one, "triangles", triangle_count(shape->satellite));
            cJSON_AddItemToArray(list, one);
        }
    }
    cJSON *echo = bst_scenario_echo(&run->scene->scenario), *node;
    const cJSON *observers = bst_json_member(echo, "observers");
    int k = 0;
    cJSON_ArrayForEach(node, bst_json_member(scene, "sensors")) {
        bst_ctx ignored = {0};
        int observer, sensor;
        if (bst_run_scene_find(&ignored, run->scene, &run->sensor[k++].sensor, &observer,
                               &sensor) == BST_OK) {
            const cJSON *of = bst_json_member(cJSON_GetArrayItem(observers, observer), "sensors");
            add_keep_out(bst_json_member(cJSON_GetArrayItem(of, sensor), "modules"), node);
        }
    }
    cJSON_Delete(echo);
}

/* ------------------------------------------------------------------ triangles */

static bst_status find_shape(bst_ctx *ctx, const bst_view_run *run, int64_t object,
                             const bst_object_shape **out) {
    const int count = bst_world_object_count(run->scene->world);
    *out = object >= 0 && object < count ? bst_world_object(run->scene->world, (int)object)->shape
                                         : NULL;
    return *out ? BST_OK
                : bst_fail(ctx, BST_ERR_NOT_FOUND, "object %lld: there is none, or it has no shape",
                           (long long)object);
}

static bst_status triangles(bst_ctx *ctx, bst_view_run *run, bst_view_exchange *x) {
    const bst_object_shape *shape;
    BST_TRY(find_shape(ctx, run, x->object, &shape));
    const bst_satellite *s = shape->satellite;
    const int count = triangle_count(s);
    const size_t numbers = BST_VIEW_SHAPE_HEAD + (size_t)count * BST_VIEW_SHAPE_TRIANGLE;
    double *at = malloc(numbers * sizeof *at);
    if (!at) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %d triangles", count);
    }
    x->bytes = (bst_view_bytes){.data = at, .bytes = numbers * sizeof *at};
    *at++ = s->joint_count;
    *at++ = count;
    for (int f = 0; f < s->facet_count; f++) {
        const bst_facet *facet = &s->facets[f];
        const int *corner = s->corner + facet->first;
        for (int i = 2; i < facet->count; i++) {
            *at++ = facet->joint;
            bst_turntable_colour(&s->materials[facet->material], at);
            at = bst_view_put(at + 3, s->vertices[corner[0]]);
            at = bst_view_put(bst_view_put(at, s->vertices[corner[i - 1]]), s->vertices[corner[i]]);
        }
    }
    return BST_OK;
}

bst_status bst_view_route_space_shape(bst_ctx *ctx, bst_view_exchange *x) {
    return bst_view_with_scene(ctx, x, triangles);
}

/* ------------------------------------------------------------------ pose */

/* Reads the recorded attitude of an object in an exposure. False: there is none. */
static bool read_attitude(const bst_view_run *run, const bst_view_sensor *s, int64_t exposure,
                          int64_t object, bst_quat *out) {
    bst_ctx ignored = {0};
    bst_io_rows *rows;
    bool more, found = false;
    if (bst_view_open_from(&ignored, run, s->sensor.index, "shapes",
                           "id, q_body_from_gcrf_x, q_body_from_gcrf_y, q_body_from_gcrf_z, "
                           "q_body_from_gcrf_w",
                           exposure, &rows) != BST_OK) {
        return false;
    }
    while (!found && bst_io_rows_next(&ignored, rows, &more) == BST_OK && more &&
           bst_io_rows_int(rows, 0) == exposure) {
        if (bst_io_rows_int(rows, 1) == object) {
            *out = (bst_quat){bst_io_rows_real(rows, 2), bst_io_rows_real(rows, 3),
                              bst_io_rows_real(rows, 4), bst_io_rows_real(rows, 5)};
            const double norm =
                out->x * out->x + out->y * out->y + out->z * out->z + out->w * out->w;
            found = fabs(norm - 1.0) < 1e-6; /* a damaged table may have others */
        }
    }
    bst_io_rows_close(rows);
    return found;
}

/* Recorded attitude at a time, if an exposure of the sensor has its middle then. */
static bool recorded_attitude(const bst_view_run *run, const bst_view_sensor *s, int64_t object,
                              double time_s, bst_quat *out) {
    size_t low = 0, high = s->count;
    while (low < high) {
        const size_t middle = (low + high) / 2;
        if (s->exposures[middle].mid_s < time_s - SAME_TIME_S) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    return low < s->count && s->exposures[low].mid_s <= time_s + SAME_TIME_S &&
           read_attitude(run, s, s->exposures[low].id, object, out);
}

/* Where light and observer of an object are. */
static bst_status find_lighting(bst_ctx *ctx, const bst_view_run *run, const bst_view_sensor *s,
                                const bst_view_exchange *x, bst_scene_lighting *out,
                                bst_vec3 *velocity_mps) {
    const bst_run_scene *scene = run->scene;
    bst_ctx ignored = {0};
    bst_world_state object, eye = {.position_m = {0, 0, 0}};
    bst_bodies bodies;
    bst_astro_sunlight sunlight;
    int observer, number;
    BST_TRY(bst_world_view_object_state(ctx, scene->view, (int)x->object, x->from_s, &object));
    BST_TRY(bst_world_view_bodies(ctx, scene->view, x->from_s, &bodies));
    if (bst_run_scene_find(&ignored, scene, &s->sensor, &observer, &number) == BST_OK) {
        BST_TRY(bst_world_view_observer_state(ctx, scene->view, observer, x->from_s, &eye));
    }
    bst_astro_sunlight_at(object.position_m, bst_bodies_sunlight_from(&bodies), bodies.pole, false,
                          &sunlight);
    *velocity_mps = object.velocity_mps;
    *out = (bst_scene_lighting){.object_m = object.position_m,
                                .eye_m = eye.position_m,
                                .sun_m = bodies.sun_m,
                                .seconds = x->from_s,
                                .sunlit_fraction = sunlight.disc};
    return BST_OK;
}

static bst_status pose(bst_ctx *ctx, bst_view_run *run, bst_view_exchange *x) {
    const bst_object_shape *shape;
    bst_view_sensor *s;
    bst_satellite_pose *turned;
    bst_scene_lighting lighting;
    bst_object_aspect aspect;
    bst_vec3 velocity;
    bst_quat recorded = {0};
    BST_TRY(bst_view_space_check_time(ctx, x->from_s));
    BST_TRY(find_shape(ctx, run, x->object, &shape));
    BST_TRY(bst_view_find_sensor(ctx, run, x->sensor, &s));
    BST_TRY(find_lighting(ctx, run, s, x, &lighting, &velocity));
    bst_object_shape_aspect(shape, &lighting, velocity, &aspect);
    const bool was_recorded = recorded_attitude(run, s, x->object, x->from_s, &recorded);
    const int joints = shape->satellite->joint_count;
    const size_t numbers = BST_VIEW_POSE_HEAD + (size_t)joints * BST_VIEW_POSE_JOINT;
    BST_TRY(bst_satellite_pose_create(ctx, shape->satellite, &turned));
    turned->burn_s = shape->burn_s;
    turned->burn_count = shape->burn_count;
    bst_satellite_pose_turn(turned, &aspect.aim);
    double *at = malloc(numbers * sizeof *at);
    if (at) {
        const bst_quat q = was_recorded ? recorded : aspect.q_body_from_gcrf;
        x->bytes = (bst_view_bytes){.data = at, .bytes = numbers * sizeof *at};
        at = bst_view_put(at, (bst_vec3){q.x, q.y, q.z});
        *at++ = q.w;
        *at++ = lighting.sunlit_fraction;
        *at++ = was_recorded;
        for (int j = 0; j < joints; j++) {
            memcpy(at, turned->rotation[j].m, sizeof turned->rotation[j].m);
            at = bst_view_put(at + 9, turned->origin[j]);
        }
    }
    bst_satellite_pose_free(turned);
    return x->bytes.data ? BST_OK : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a pose");
}

bst_status bst_view_route_space_pose(bst_ctx *ctx, bst_view_exchange *x) {
    return bst_view_with_scene(ctx, x, pose);
}
