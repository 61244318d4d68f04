#include "view/space.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/astro/bodies.h"
#include "sim/core/file.h"
#include "sim/core/json_number.h"
#include "sim/world/world_config.h"
#include "view/recorded_run_internal.h"
#include "view/space_scene.h"
#include "view/space_shapes.h"

/* Longest file of a coastline. */
enum { COAST_BYTES = 16 << 20 };

static int listed_objects(const bst_world *world) {
    int count = bst_world_object_count(world),
        room = BST_VIEW_SPACE_BODIES - bst_world_observer_count(world);
    return count < room ? count : room;
}

/* ------------------------------------------------------------------ what there is */

/* Adds the directions of the field's corners: first the first row, from left to right. */
static void add_corners(const bst_camera *camera, cJSON *node) {
    const double right = (double)camera->width_px - 0.5, last = (double)camera->height_px - 0.5;
    const double px[][2] = {{-0.5, -0.5}, {right, -0.5}, {right, last}, {-0.5, last}};
    cJSON *list = cJSON_AddArrayToObject(node, "corners");
    for (size_t i = 0; i < sizeof px / sizeof *px; i++) {
        bst_vec3 ray = bst_camera_unproject(camera, px[i][0], px[i][1]);
        const double numbers[3] = {ray.x, ray.y, ray.z};
        cJSON_AddItemToArray(list, cJSON_CreateDoubleArray(numbers, 3));
    }
}

/* Adds a sensor; one that the scenario lacks has no corners. */
static void add_sensor(const bst_run_scene *scene, const bst_run_sensor *sensor, cJSON *list) {
    bst_ctx ignored = {0};
    int observer = -1, number = 0;
    cJSON *node = cJSON_CreateObject();
    cJSON_AddItemToArray(list, node);
    bool known = bst_run_scene_find(&ignored, scene, sensor, &observer, &number) == BST_OK;
    const bst_camera *camera = known ? bst_world_camera(scene->world, observer, number) : NULL;
    int object = bst_world_find_object(scene->world, sensor->target);
    cJSON_AddNumberToObject(node, "observer", observer);
    cJSON_AddStringToObject(node, "name", sensor->name);
    cJSON_AddNumberToObject(node, "object", object < listed_objects(scene->world) ? object : -1);
    if (camera) {
        add_corners(camera, node);
    }
}

static bst_status describe(bst_ctx *ctx, bst_view_run *run, bst_view_exchange *x) {
    (void)ctx;
    const bst_world *world = run->scene->world;
    x->json = cJSON_CreateObject();
    bst_json_add_number(x->json, "span_s", run->scene->scenario.duration_s);
    cJSON *observers = cJSON_AddArrayToObject(x->json, "observers");
    for (int i = 0; i < bst_world_observer_count(world); i++) {
        cJSON_AddItemToArray(observers, cJSON_CreateString(bst_world_observer_name(world, i)));
    }
    cJSON *objects = cJSON_AddArrayToObject(x->json, "objects");
    for (int i = 0; i < listed_objects(world); i++) {
        cJSON_AddItemToArray(objects, cJSON_CreateString(bst_world_object(world, i)->name));
    }
    cJSON_AddNumberToObject(x->json, "total", bst_world_object_count(world));
    cJSON *sensors = cJSON_AddArrayToObject(x->json, "sensors");
    for (int i = 0; i < run->sensors; i++) {
        add_sensor(run->scene, &run->sensor[i].sensor, sensors);
    }
    bst_view_space_add_shapes(run, x->json);
    return BST_OK;
}

bst_status bst_view_route_space_scene(bst_ctx *ctx, bst_view_exchange *x) {
    return bst_view_with_scene(ctx, x, describe);
}

/* ------------------------------------------------------------------ states */

static bst_status put_sky(bst_ctx *ctx, bst_world_view *view, double time_s, double *at) {
    bst_bodies bodies;
    bst_astro_earth_frames frames;
    BST_TRY(bst_world_view_bodies(ctx, view, time_s, &bodies));
    BST_TRY(bst_world_view_earth_frames(ctx, view, time_s, &frames));
    at = bst_view_put(bst_view_put(at, bodies.sun_m), bodies.moon_m);
    memcpy(at, frames.itrf_from_gcrf.m, sizeof frames.itrf_from_gcrf.m);
    return BST_OK;
}

static bst_status states(bst_ctx *ctx, bst_view_run *run, bst_view_exchange *x) {
    const bst_run_scene *scene = run->scene;
    int observers = bst_world_observer_count(scene->world), objects = listed_objects(scene->world);
    size_t count = BST_VIEW_SPACE_HEAD + (size_t)(observers + objects) * BST_VIEW_SPACE_BODY;
    BST_TRY(bst_view_space_check_time(ctx, x->from_s));
    double *numbers = malloc(count * sizeof *numbers), *at = numbers;
    if (!numbers) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the states of %d bodies",
                        observers + objects);
    }
    x->bytes = (bst_view_bytes){.data = numbers, .bytes = count * sizeof *numbers};
    BST_TRY(put_sky(ctx, scene->view, x->from_s, at));
    at += BST_VIEW_SPACE_HEAD;
    for (int i = 0; i < observers + objects; i++) {
        bst_ctx ignored = {0};
        bst_world_state state;
        bst_status status =
            i < observers
                ? bst_world_view_observer_state(&ignored, scene->view, i, x->from_s, &state)
                : bst_world_view_object_state(&ignored, scene->view, i - observers, x->from_s,
                                              &state);
        if (status != BST_OK) {
            state.position_m = state.velocity_mps = (bst_vec3){NAN, NAN, NAN};
        }
        at = bst_view_put(bst_view_put(at, state.position_m), state.velocity_mps);
    }
    return BST_OK;
}

bst_status bst_view_route_space_states(bst_ctx *ctx, bst_view_exchange *x) {
    return bst_view_with_scene(ctx, x, states);
}

/* ------------------------------------------------------------------ attitudes */

static bst_status read_poses(bst_ctx *ctx, const bst_view_run *run, int64_t sensor,
                             bst_view_bytes *out) {
    static const char from[] =
        "SELECT mid_s, q_cam_from_gcrf_mid_x, q_cam_from_gcrf_mid_y, "
        "q_cam_from_gcrf_mid_z, q_cam_from_gcrf_mid_w FROM exposures WHERE "
        "sensor = ?1 ORDER BY exposure_id";
    bst_ctx ignored = {0};
    bst_io_rows *rows;
    bool more;
    int64_t total = bst_run_reader_int(
        run->reader, "SELECT count(*) FROM exposures WHERE sensor = ?1", sensor, 0);
    int64_t every = 1 + total / BST_VIEW_SPACE_POSES, room = total / every + 1, count = 0, n = 0;
    double *numbers = malloc((size_t)room * BST_VIEW_SPACE_POSE * sizeof *numbers);
    if (!numbers) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for attitudes");
    }
    out->data = numbers;
    if (bst_io_rows_open(&ignored, run->reader, from, sensor, 0, &rows) != BST_OK) {
        return BST_OK; /* not recorded */
    }
    bst_status status;
    for (; (status = bst_io_rows_next(ctx, rows, &more)) == BST_OK && more; n++) {
        if (n % every == 0 && count < room) {
            for (int k = 0; k < BST_VIEW_SPACE_POSE; k++) {
                numbers[count * BST_VIEW_SPACE_POSE + k] = bst_io_rows_real(rows, k);
            }
            count++;
        }
    }
    bst_io_rows_close(rows);
    out->bytes = (size_t)count * BST_VIEW_SPACE_POSE * sizeof *numbers;
    return status;
}

static bst_status poses(bst_ctx *ctx, bst_view_run *run, bst_view_exchange *x) {
    bst_view_sensor *s;
    BST_TRY(bst_view_find_sensor(ctx, run, x->sensor, &s));
    return read_poses(ctx, run, s->sensor.index, &x->bytes);
}

bst_status bst_view_route_space_poses(bst_ctx *ctx, bst_view_exchange *x) {
    return bst_view_with_scene(ctx, x, poses);
}

/* ------------------------------------------------------------------ coastline */

bst_status bst_view_route_space_coast(bst_ctx *ctx, bst_view_exchange *x) {
    static const char debian[] = "/usr/share/cartopy/data/shapefiles/gshhs/c/GSHHS_c_L1.shp";
    const char *named = getenv("BORESIGHT_COASTLINE");
    char *data = NULL;
    size_t bytes = 0;
    bst_ctx missing = {0};
    bst_status status = bst_file_read(&missing, named && *named ? named : debian, COAST_BYTES,
                                      "a shapefile of coastlines", &data, &bytes);
    if (status != BST_OK && (status != BST_ERR_NOT_FOUND || (named && *named))) {
        return bst_fail(ctx, status, "%s", missing.message);
    }
    x->bytes = (bst_view_bytes){.data = data, .bytes = bytes};
    return BST_OK;
}
