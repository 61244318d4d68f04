#include "sim/world/frame_updates.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cjson/cJSON.h>

enum { FORMAT_VERSION = 1, LAST_FRAME = 10000000 };

/* tolerance of a quaternion's norm: files have six digits */
#define NORM_SLACK 1e-5
/* tolerance of the first and last time of a pointing history */
#define TIME_SLACK_S 1e-6

struct bst_frame_updates {
    char *name;
    bst_frame_update *items;
    int count;
    bst_world_pointing_node *nodes;
    int64_t node_count, node_capacity;
    bst_frame_object *objects;
    int64_t object_count, object_capacity;
};

typedef struct root_config {
    int64_t boresight_frame_updates;
} root_config;

static const bst_config_desc root_table[] = {
    BST_INT(root_config, boresight_frame_updates, "", FORMAT_VERSION, FORMAT_VERSION, NULL,
            "Version of the format."),
    {.key = "frames", .type = BST_CONFIG_RAW, .doc = "An object per frame."},
    BST_CONFIG_END};

typedef struct node_config {
    double time_s, q_cam_from_gcrf[4];
} node_config;

static const bst_config_desc node_table[] = {
    BST_REAL(node_config, time_s, "s", 0, 3600, NULL, "Time after the exposure's start."),
    BST_REALS(node_config, q_cam_from_gcrf, "", -1.001, 1.001, NULL, "Attitude then."),
    BST_CONFIG_END};

typedef struct object_config {
    char object[64];
    double start_position_m[3], start_velocity_mps[3], end_position_m[3], end_velocity_mps[3];
    double start_q_body_from_gcrf[4], end_q_body_from_gcrf[4];
} object_config;

static const bst_config_desc object_table[] = {
    BST_STRING(object_config, object, NULL, "Name that orbits call it by (states_object)."),
    BST_REALS(object_config, start_position_m, "m", -1e12, 1e12, "[0, 0, 0]",
              "Geocentric place at the exposure's start."),
    BST_REALS(object_config, start_velocity_mps, "m/s", -1e6, 1e6, "[0, 0, 0]", "Velocity then."),
    BST_REALS(object_config, end_position_m, "m", -1e12, 1e12, "[0, 0, 0]",
              "Geocentric place at the exposure's end."),
    BST_REALS(object_config, end_velocity_mps, "m/s", -1e6, 1e6, "[0, 0, 0]", "Velocity then."),
    BST_REALS(object_config, start_q_body_from_gcrf, "", -1.001, 1.001, "[0, 0, 0, 0]",
              "Attitude of its shape at the exposure's start."),
    BST_REALS(object_config, end_q_body_from_gcrf, "", -1.001, 1.001, "[0, 0, 0, 0]",
              "Attitude of its shape at the exposure's end."),
    BST_CONFIG_END};

typedef struct frame_config {
    int64_t frame;
    double q_cam_from_gcrf_start[4], q_cam_from_gcrf_end[4];
    bst_config_list pointing; /* node_config */
    double exposure_s, period_s, pixel_scale_arcsec;
    double window_px[4];
    int64_t binning;
    bst_config_list objects; /* object_config */
} frame_config;

/* A key that a frame omits is found by lookup in the JSON: the defaults here are unused. */
static const bst_config_desc frame_table[] = {
    BST_INT(frame_config, frame, "", 0, LAST_FRAME, NULL, "Number of the exposure, from 0."),
    BST_REALS(frame_config, q_cam_from_gcrf_start, "", -1.001, 1.001, "[0, 0, 0, 1]",
              "Attitude at the exposure's start."),
    BST_REALS(frame_config, q_cam_from_gcrf_end, "", -1.001, 1.001, "[0, 0, 0, 1]",
              "Attitude at the exposure's end."),
    BST_LIST(frame_config, pointing, node_config, node_table, 0, 100000, "[]",
             "Attitude at times of the exposure."),
    BST_REAL(frame_config, exposure_s, "s", 0, 3600, "0", "Exposure time."),
    BST_REAL(frame_config, period_s, "s", 1e-3, 1e5, "1", "Time to the next exposure's start."),
    BST_REAL(frame_config, pixel_scale_arcsec, "arcsec/px", 1e-3, 600, "1", "Field of view."),
    BST_REALS(frame_config, window_px, "px", 0, 65536, "[0, 0, 0, 0]", "Window."),
    BST_INT(frame_config, binning, "px", 1, 8, "1", "Sensor pixels per side of a frame's pixel."),
    BST_LIST(frame_config, objects, object_config, object_table, 0, 10000, "[]", "Objects."),
    BST_CONFIG_END};

/* State of reading a frame-updates file. */
typedef struct reader {
    bst_ctx *ctx;
    const bst_json *json;
    bst_frame_updates *out;
    const bst_camera *camera;
    double exposure_s; /* current values, as the next two */
    bst_window window;
    int binning;
    const cJSON *node; /* of the current frame */
    char path[80];     /* "/frames/3 (frame 7)" */
} reader;

/* Reports a wrong key of a frame with file, path and allowed values. */
static bst_status fail_key(const reader *r, const char *key, const char *what,
                           const char *allowed) {
    char path[160];
    const cJSON *value = cJSON_GetObjectItemCaseSensitive(r->node, key);
    snprintf(path, sizeof path, "%s/%s", r->path, key);
    if (!value) {
        return bst_fail(r->ctx, BST_ERR_CONFIG, "%s: %s: %s (allowed: %s)", bst_json_name(r->json),
                        path, what, allowed);
    }
    return bst_config_fail(r->ctx, bst_json_name(r->json), path, value, what, allowed);
}

static bool has(const reader *r, const char *key) {
    return cJSON_GetObjectItemCaseSensitive(r->node, key) != NULL;
}

/* Grows an array by one item if it is full. */
static void *grow(void *items, int64_t count, int64_t *capacity, size_t bytes) {
    if (count < *capacity) {
        return items;
    }
    int64_t more = *capacity ? 2 * *capacity : 256;
    void *larger = realloc(items, (size_t)more * bytes);
    if (larger) {
        *capacity = more;
    }
    return larger;
}

/* Adds an attitude of the camera to the frame updates; it must be a unit quaternion. */
static bst_status add_node(reader *r, const char *key, double time_s, const double q[4]) {
    bst_frame_updates *u = r->out;
    double norm = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    if (!(fabs(norm - 1.0) <= NORM_SLACK)) {
        return fail_key(r, key, "not a unit quaternion",
                        "[x, y, z, w] with the scalar w last and a norm of 1 to 1e-5");
    }
    bst_world_pointing_node *nodes =
        grow(u->nodes, u->node_count, &u->node_capacity, sizeof *u->nodes);
    if (!nodes) {
        return bst_fail(r->ctx, BST_ERR_MEMORY, "%s: no memory for its attitudes", u->name);
    }
    u->nodes = nodes;
    u->nodes[u->node_count++] =
        (bst_world_pointing_node){time_s, {q[0] / norm, q[1] / norm, q[2] / norm, q[3] / norm}};
    return BST_OK;
}

/* Reads the pointing of a frame: its history, or the attitudes at start and end. */
static bst_status read_pointing(reader *r, const frame_config *c) {
    static const char start_key[] = "q_cam_from_gcrf_start", end_key[] = "q_cam_from_gcrf_end";
    bool start = has(r, start_key), end = has(r, end_key), history = has(r, "pointing");
    if (history && (start || end)) {
        return fail_key(r, start ? start_key : end_key, "the frame has a pointing history too",
                        "either pointing, or start and end");
    }
    if (start != end) {
        return fail_key(r, start ? end_key : start_key, "missing",
                        "q_cam_from_gcrf_start and q_cam_from_gcrf_end, both or none");
    }
    if (start) {
        BST_TRY(add_node(r, start_key, 0.0, c->q_cam_from_gcrf_start));
        return add_node(r, end_key, r->exposure_s, c->q_cam_from_gcrf_end);
    }
    const node_config *nodes = c->pointing.items;
    int count = c->pointing.count;
    char allowed[120];
    snprintf(allowed, sizeof allowed, "times that ascend from 0 to the exposure of %.15g s",
             r->exposure_s);
    if (history && (count < 2 || fabs(nodes[0].time_s) > TIME_SLACK_S ||
                    fabs(nodes[count - 1].time_s - r->exposure_s) > TIME_SLACK_S)) {
        return fail_key(r, "pointing", "the history does not cover the exposure", allowed);
    }
    for (int i = 0; i < count; i++) {
        if (i > 0 && !(nodes[i].time_s > nodes[i - 1].time_s) && r->exposure_s > 0.0) {
            return fail_key(r, "pointing", "the times do not ascend", allowed);
        }
        double time_s = i == 0 ? 0.0 : i == count - 1 ? r->exposure_s : nodes[i].time_s;
        BST_TRY(add_node(r, "pointing", time_s, nodes[i].q_cam_from_gcrf));
    }
    return BST_OK;
}

static bst_status read_window(const reader *r, const double w[4], bst_window *out) {
    char allowed[160];
    const long long width = r->camera->width_px, height = r->camera->height_px;
    snprintf(allowed, sizeof allowed,
             "[x0, y0, width, height] in whole pixels, inside the sensor of %lld x %lld", width,
             height);
    for (int i = 0; i < 4; i++) {
        if (w[i] != floor(w[i])) {
            return fail_key(r, "window_px", "not whole pixels", allowed);
        }
    }
    if (w[2] < 1.0 || w[3] < 1.0 || w[0] + w[2] > (double)width || w[1] + w[3] > (double)height) {
        return fail_key(r, "window_px", "not a window of the sensor", allowed);
    }
    *out = (bst_window){(int)w[0], (int)w[1], (int)w[2], (int)w[3]};
    return BST_OK;
}

static bst_vec3 vector(const double v[3]) {
    return (bst_vec3){v[0], v[1], v[2]};
}

/* Reports keys of an object that are missing. */
static bst_status fail_object(const reader *r, int index, const char *key, const char *problem) {
    return bst_fail(r->ctx, BST_ERR_CONFIG, "%s: %s/objects/%d/%s: %s", bst_json_name(r->json),
                    r->path, index, key, problem);
}

/* Which keys an object of a frame gives. All four of its states, both of its attitudes. */
static bst_status check_object(const reader *r, int index, bst_frame_object *o,
                               const object_config *c) {
    static const char *const keys[] = {"start_position_m",       "start_velocity_mps",
                                       "end_position_m",         "end_velocity_mps",
                                       "start_q_body_from_gcrf", "end_q_body_from_gcrf"};
    const cJSON *list = cJSON_GetObjectItemCaseSensitive(r->node, "objects");
    const cJSON *node = cJSON_GetArrayItem(list, index);
    bool given[6];
    for (int i = 0; i < 6; i++) {
        given[i] = cJSON_GetObjectItemCaseSensitive(node, keys[i]) != NULL;
    }
    o->has_attitudes = given[4] || given[5];
    o->has_states = given[0] || given[1] || given[2] || given[3] || !o->has_attitudes;
    for (int i = 0; i < 6; i++) {
        if (!given[i] && (i < 4 ? o->has_states : o->has_attitudes)) {
            return fail_object(r, index, keys[i],
                               i < 4 ? "required (an object has four keys of its states, two of "
                                       "its attitudes, or all six)"
                                     : "required with the other key of the attitudes");
        }
    }
    const double *const q[] = {c->start_q_body_from_gcrf, c->end_q_body_from_gcrf};
    bst_quat *const to[] = {&o->start_q_body_from_gcrf, &o->end_q_body_from_gcrf};
    for (int i = 0; i < 2 && o->has_attitudes; i++) {
        double norm =
            sqrt(q[i][0] * q[i][0] + q[i][1] * q[i][1] + q[i][2] * q[i][2] + q[i][3] * q[i][3]);
        if (!(fabs(norm - 1.0) <= NORM_SLACK)) {
            return fail_object(r, index, keys[4 + i],
                               "not a unit quaternion (allowed: [x, y, z, w] with the scalar w "
                               "last and a norm of 1 to 1e-5)");
        }
        *to[i] = bst_quat_unit((bst_quat){q[i][0], q[i][1], q[i][2], q[i][3]});
    }
    return BST_OK;
}

static bst_status read_objects(reader *r, const bst_config_list *list) {
    bst_frame_updates *u = r->out;
    const object_config *configs = list->items;
    int64_t first = u->object_count;
    if (list->count > 0 && !(r->exposure_s > 0.0)) {
        return fail_key(r, "objects", "the frame's exposure has no length",
                        "objects in frames with an exposure_s above 0");
    }
    for (int i = 0; i < list->count; i++) {
        const object_config *c = &configs[i];
        char what[160];
        if (!*c->object) {
            return fail_key(r, "objects", "an object has no name", "1 to 63 bytes");
        }
        for (int64_t k = first; k < u->object_count; k++) {
            if (strcmp(u->objects[k].name, c->object) == 0) {
                snprintf(what, sizeof what, "\"%s\" comes twice", c->object);
                return fail_key(r, "objects", what, "each object once");
            }
        }
        bst_frame_object *objects =
            grow(u->objects, u->object_count, &u->object_capacity, sizeof *u->objects);
        if (!objects) {
            return bst_fail(r->ctx, BST_ERR_MEMORY, "%s: no memory for its objects", u->name);
        }
        u->objects = objects;
        bst_frame_object *o = &u->objects[u->object_count++];
        *o = (bst_frame_object){.start_position_m = vector(c->start_position_m),
                                .start_velocity_mps = vector(c->start_velocity_mps),
                                .end_position_m = vector(c->end_position_m),
                                .end_velocity_mps = vector(c->end_velocity_mps)};
        memcpy(o->name, c->object, sizeof o->name);
        BST_TRY(check_object(r, i, o, c));
    }
    return BST_OK;
}

/* Reads all keys of one frame into an update. */
static bst_status take_frame(reader *r, const frame_config *c, bst_frame_update *update) {
    *update = (bst_frame_update){.frame = c->frame, .exposure_s = -1.0};
    if (has(r, "exposure_s")) {
        update->exposure_s = r->exposure_s = c->exposure_s;
    }
    if (has(r, "period_s")) {
        update->period_s = c->period_s;
    }
    if (has(r, "window_px")) {
        BST_TRY(read_window(r, c->window_px, &update->window));
        r->window = update->window;
    }
    if (has(r, "binning")) {
        update->binning = r->binning = (int)c->binning;
    }
    if (r->binning > r->window.width || r->binning > r->window.height) {
        char allowed[120];
        snprintf(allowed, sizeof allowed,
                 "a binning that fits the window of %d x %d pixels; it is %d here", r->window.width,
                 r->window.height, r->binning);
        return fail_key(r, has(r, "binning") ? "binning" : "window_px", "no pixel is left",
                        allowed);
    }
    if (has(r, "pixel_scale_arcsec")) {
        bst_camera camera;
        update->pixel_scale_arcsec = c->pixel_scale_arcsec;
        if (bst_world_camera_at_scale(r->ctx, r->camera, c->pixel_scale_arcsec, &camera) !=
            BST_OK) {
            return bst_fail_prefix(r->ctx, BST_ERR_CONFIG, "%s: %s/pixel_scale_arcsec",
                                   bst_json_name(r->json), r->path);
        }
    }
    int64_t nodes = r->out->node_count, objects = r->out->object_count;
    BST_TRY(read_pointing(r, c));
    BST_TRY(read_objects(r, &c->objects));
    update->node_count = (int)(r->out->node_count - nodes);
    update->object_count = (int)(r->out->object_count - objects);
    return BST_OK;
}

static bst_status read_frame(reader *r, const cJSON *node, int index) {
    bst_frame_updates *u = r->out;
    const cJSON *number =
        cJSON_IsObject(node) ? cJSON_GetObjectItemCaseSensitive(node, "frame") : NULL;
    r->node = node;
    snprintf(r->path, sizeof r->path, "/frames/%d", index);
    if (cJSON_IsNumber(number)) {
        snprintf(r->path, sizeof r->path, "/frames/%d (frame %.15g)", index, number->valuedouble);
    }
    frame_config config;
    BST_TRY(bst_config_read(r->ctx, r->json, node, r->path, frame_table, &config));
    bst_status status = BST_OK;
    if (index > 0 && config.frame <= u->items[index - 1].frame) {
        char allowed[80];
        snprintf(allowed, sizeof allowed, "frames in ascending order: %lld or more",
                 (long long)u->items[index - 1].frame + 1);
        status = fail_key(
            r, "frame",
            config.frame == u->items[index - 1].frame ? "the frame comes twice" : "out of order",
            allowed);
    }
    if (status == BST_OK) {
        status = take_frame(r, &config, &u->items[index]);
    }
    bst_config_free(frame_table, &config);
    return status;
}

static bst_status read_json(reader *r) {
    bst_frame_updates *u = r->out;
    const cJSON *root = bst_json_root(r->json);
    root_config head;
    BST_TRY(bst_config_read(r->ctx, r->json, root, "", root_table, &head));
    const cJSON *frames = cJSON_GetObjectItemCaseSensitive(root, "frames");
    int count = cJSON_GetArraySize(frames);
    if (!frames || !cJSON_IsArray(frames) || count < 1) {
        return bst_fail(r->ctx, BST_ERR_CONFIG,
                        "%s: /frames: %s (allowed: an array of at least one frame)",
                        bst_json_name(r->json), frames ? "holds no frames" : "missing");
    }
    u->name = strdup(bst_json_name(r->json));
    u->items = calloc((size_t)count, sizeof *u->items);
    if (!u->name || !u->items) {
        return bst_fail(r->ctx, BST_ERR_MEMORY, "%s: no memory for %d frames",
                        bst_json_name(r->json), count);
    }
    for (const cJSON *node = frames->child; node; node = node->next) {
        BST_TRY(read_frame(r, node, u->count));
        u->count++;
    }
    /* the arrays are complete; their addresses are final */
    const bst_world_pointing_node *node = u->nodes;
    const bst_frame_object *object = u->objects;
    for (int i = 0; i < count; i++) {
        u->items[i].nodes = node;
        u->items[i].objects = object;
        node = u->items[i].node_count ? node + u->items[i].node_count : node;
        object = u->items[i].object_count ? object + u->items[i].object_count : object;
    }
    return BST_OK;
}

/* Reads the frame updates of a sensor (boresight, window, object states per frame). */
static bst_status make(bst_ctx *ctx, const bst_json *json, const bst_camera *camera,
                       const bst_exposure_config *exposure, bst_frame_updates **out) {
    reader r = {.ctx = ctx,
                .json = json,
                .out = calloc(1, sizeof *r.out),
                .camera = camera,
                .exposure_s = exposure->exposure_s,
                .binning = exposure->binning > 1 ? (int)exposure->binning : 1};
    bst_status status =
        bst_exposure_window(ctx, exposure, camera->width_px, camera->height_px, &r.window);
    if (status == BST_OK) {
        status =
            r.out ? read_json(&r) : bst_fail(ctx, BST_ERR_MEMORY, "no memory for frame updates");
    }
    if (status != BST_OK) {
        bst_frame_updates_free(r.out);
        return status;
    }
    *out = r.out;
    return BST_OK;
}

bst_status bst_frame_updates_parse(bst_ctx *ctx, const char *name, const char *text, size_t bytes,
                                   const bst_camera *camera, const bst_exposure_config *exposure,
                                   bst_frame_updates **out) {
    bst_json *json;
    *out = NULL;
    BST_TRY(bst_json_parse(ctx, name, text, bytes, &json));
    bst_status status = make(ctx, json, camera, exposure, out);
    bst_json_free(json);
    return status;
}

bst_status bst_frame_updates_load(bst_ctx *ctx, const char *path, const bst_camera *camera,
                                  const bst_exposure_config *exposure, bst_frame_updates **out) {
    bst_json *json;
    *out = NULL;
    BST_TRY(bst_json_load(ctx, path, &json));
    bst_status status = make(ctx, json, camera, exposure, out);
    bst_json_free(json);
    return status;
}

void bst_frame_updates_free(bst_frame_updates *updates) {
    if (updates) {
        free(updates->name);
        free(updates->items);
        free(updates->nodes);
        free(updates->objects);
        free(updates);
    }
}

const char *bst_frame_updates_name(const bst_frame_updates *updates) {
    return updates->name;
}
int bst_frame_updates_count(const bst_frame_updates *updates) {
    return updates->count;
}
const bst_frame_update *bst_frame_updates_item(const bst_frame_updates *updates, int index) {
    assert(updates && index >= 0 && index < updates->count);
    return &updates->items[index];
}

/* Engine tick of a time. */
static int64_t ticks(const bst_frame_cursor *cursor, double seconds) {
    return (int64_t)floor(seconds * cursor->tick_rate_hz + 0.5);
}

/* Applies the update of the cursor's frame to the exposure settings. */
static void apply(bst_frame_cursor *c) {
    const bst_frame_updates *u = c->updates;
    c->update = u && c->next < u->count && u->items[c->next].frame == c->frame
                    ? &u->items[c->next++]
                    : NULL;
    if (c->update) {
        const bst_frame_update *update = c->update;
        c->exposure_s = update->exposure_s >= 0.0 ? update->exposure_s : c->exposure_s;
        c->period_s = update->period_s > 0.0 ? update->period_s : c->period_s;
        c->window = update->window.width > 0 ? update->window : c->window;
        c->binning = update->binning > 0 ? update->binning : c->binning;
        c->pixel_scale_arcsec =
            update->pixel_scale_arcsec > 0.0 ? update->pixel_scale_arcsec : c->pixel_scale_arcsec;
    }
    c->exposure_ticks = ticks(c, c->exposure_s);
    c->period_ticks = ticks(c, c->period_s);
}

bst_frame_cursor bst_frame_cursor_begin(const bst_frame_updates *updates, const bst_camera *camera,
                                        const bst_exposure_config *exposure, double tick_rate_hz) {
    bst_frame_cursor c = {.updates = updates,
                          .tick_rate_hz = tick_rate_hz,
                          .start_s = exposure->first_s,
                          .exposure_s = exposure->exposure_s,
                          .period_s = exposure->period_s,
                          .binning = exposure->binning > 1 ? (int)exposure->binning : 1,
                          .pixel_scale_arcsec = camera->pixel_scale_arcsec};
    bst_ctx quiet = {0};
    if (bst_exposure_window(&quiet, exposure, camera->width_px, camera->height_px, &c.window) !=
        BST_OK) {
        /* the exposure clock reports the window in use */
        c.window = (bst_window){0, 0, (int)camera->width_px, (int)camera->height_px};
    }
    c.start_tick = ticks(&c, c.start_s);
    apply(&c);
    return c;
}

void bst_frame_cursor_next(bst_frame_cursor *c) {
    c->start_s += fmax(c->exposure_s, c->period_s);
    c->start_tick += c->exposure_ticks > c->period_ticks ? c->exposure_ticks : c->period_ticks;
    c->frame++;
    apply(c);
}

void bst_frame_cursor_archive(bst_frame_cursor *c, bst_archive *archive) {
    const int count = c->updates ? c->updates->count : 0;
    int update = c->update ? (int)(c->update - c->updates->items) : -1;
    c->next = bst_archive_count(archive, c->next, count);
    update = (int)bst_archive_integer(archive, update, -1, count - 1);
    c->update = update >= 0 ? &c->updates->items[update] : NULL;
    BST_ARCHIVE(archive, c->frame);
    BST_ARCHIVE(archive, c->start_s);
    BST_ARCHIVE(archive, c->exposure_s);
    BST_ARCHIVE(archive, c->period_s);
    BST_ARCHIVE(archive, c->start_tick);
    BST_ARCHIVE(archive, c->exposure_ticks);
    BST_ARCHIVE(archive, c->period_ticks);
    BST_ARCHIVE(archive, c->window);
    BST_ARCHIVE(archive, c->binning);
    BST_ARCHIVE(archive, c->pixel_scale_arcsec);
}

void bst_frame_updates_limits(const bst_frame_updates *updates, const bst_camera *camera,
                              const bst_exposure_config *exposure, double *longest_exposure_s,
                              double *shortest_cycle_s) {
    bst_frame_cursor c = bst_frame_cursor_begin(updates, camera, exposure, 0.0);
    *longest_exposure_s = 0.0;
    *shortest_cycle_s = INFINITY;
    int64_t last = updates->items[updates->count - 1].frame;
    for (;; bst_frame_cursor_next(&c)) {
        *longest_exposure_s = fmax(*longest_exposure_s, c.exposure_s);
        *shortest_cycle_s = fmin(*shortest_cycle_s, fmax(c.exposure_s, c.period_s));
        if (c.frame >= last) {
            break;
        }
    }
    *longest_exposure_s += 2.0 * bst_detector_lead_s(&camera->detector, (int)camera->height_px);
}

bst_status bst_world_camera_at_scale(bst_ctx *ctx, const bst_camera *camera,
                                     double pixel_scale_arcsec, bst_camera *out) {
    *out = *camera;
    out->pixel_scale_arcsec = pixel_scale_arcsec;
    return bst_camera_prepare(ctx, out);
}
