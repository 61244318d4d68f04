/* Loads the frame-updates files of all sensors of a world. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/world/frame_updates.h"
#include "sim/world/world_build.h"

static bst_status load_one(const bst_world_builder *b, int observer, int sensor,
                           const bst_sensor_config *config, world_updates *out) {
    bst_world_path path = bst_world_path_join(b, config->frame_updates_file);
    *out = (world_updates){.observer = observer,
                           .sensor = sensor,
                           .camera = config->camera,
                           .exposure = config->exposure};
    bst_status status =
        bst_frame_updates_load(b->ctx, path.text, &out->camera, &out->exposure, &out->file);
    return status == BST_OK
               ? BST_OK
               : bst_fail_prefix(b->ctx, status == BST_ERR_MEMORY ? status : BST_ERR_CONFIG,
                                 "%s: /observers/%d/sensors/%d/frame_updates_file", b->scenario,
                                 observer, sensor);
}

bst_status bst_world_load_updates(const bst_world_builder *b, const bst_config_list *observers) {
    bst_world *world = b->world;
    const bst_observer_config *configs = observers->items;
    int total = 0;
    for (int i = 0; i < observers->count; i++) {
        total += configs[i].sensors.count;
    }
    world->updates = calloc((size_t)total + 1, sizeof *world->updates);
    if (!world->updates) {
        return bst_fail(b->ctx, BST_ERR_MEMORY, "out of memory for sensors");
    }
    for (int i = 0; i < observers->count; i++) {
        const bst_sensor_config *sensors = configs[i].sensors.items;
        for (int k = 0; k < configs[i].sensors.count; k++) {
            if (*sensors[k].frame_updates_file) {
                BST_TRY(load_one(b, i, k, &sensors[k], &world->updates[world->updates_count]));
                world->updates_count++;
            }
        }
    }
    return BST_OK;
}

void bst_world_updates_free(bst_world *world) {
    for (int i = 0; i < world->updates_count; i++) {
        bst_frame_updates_free(world->updates[i].file);
    }
    free(world->updates);
}

const bst_frame_updates *bst_world_frame_updates(const bst_world *world, int observer, int sensor) {
    for (int i = 0; i < world->updates_count; i++) {
        if (world->updates[i].observer == observer && world->updates[i].sensor == sensor) {
            return world->updates[i].file;
        }
    }
    return NULL;
}

/* The sensor whose frame updates a file is. */
static bst_status find_updates(bst_ctx *ctx, const bst_world *world, const char *path,
                               const char *other, const world_updates **out) {
    *out = NULL;
    for (int i = 0; i < world->updates_count && !*out; i++) {
        if (strcmp(bst_frame_updates_name(world->updates[i].file), path) == 0) {
            *out = &world->updates[i];
        }
    }
    return *out ? BST_OK
                : bst_fail(ctx, BST_ERR_CONFIG,
                           "%s: is no sensor's frame_updates_file, so that its frames have no "
                           "times (allowed: %s, or the frame_updates_file of a sensor)",
                           path, other);
}

/* Number of objects in all frames. */
static int64_t count_objects(const bst_frame_updates *updates) {
    int64_t total = 0;
    for (int i = 0; i < bst_frame_updates_count(updates); i++) {
        total += bst_frame_updates_item(updates, i)->object_count;
    }
    return total;
}

bst_status bst_world_updates_injected(const bst_world_builder *b, const char *path,
                                      bst_state_table **out) {
    const world_updates *from;
    BST_TRY(find_updates(b->ctx, b->world, path, "a .csv file of states", &from));
    int64_t total = count_objects(from->file), n = 0, kept = 0;
    bst_state_table_frame *frames = calloc((size_t)total + 1, sizeof *frames);
    if (!frames) {
        return bst_fail(b->ctx, BST_ERR_MEMORY, "%s: no memory for its states", path);
    }
    bst_frame_cursor c = bst_frame_cursor_begin(from->file, &from->camera, &from->exposure, 0.0);
    for (; n < total; bst_frame_cursor_next(&c)) {
        for (int k = 0; c.update && k < c.update->object_count; k++, n++) {
            const bst_frame_object *o = &c.update->objects[k];
            if (!o->has_states) {
                continue;
            }
            frames[kept++] = (bst_state_table_frame){.object = o->name,
                                                     .number = c.frame,
                                                     .start_s = c.start_s,
                                                     .end_s = c.start_s + c.exposure_s,
                                                     .start_position_m = o->start_position_m,
                                                     .start_velocity_mps = o->start_velocity_mps,
                                                     .end_position_m = o->end_position_m,
                                                     .end_velocity_mps = o->end_velocity_mps};
        }
    }
    bst_status status = bst_state_table_create(b->ctx, path, frames, kept, out);
    free(frames);
    return status;
}

/* Name of the only object with attitudes; NULL: there are several. */
static const char *only_object(const bst_frame_updates *updates) {
    const char *only = "";
    for (int i = 0; i < bst_frame_updates_count(updates); i++) {
        const bst_frame_update *update = bst_frame_updates_item(updates, i);
        for (int k = 0; k < update->object_count; k++) {
            const bst_frame_object *o = &update->objects[k];
            if (o->has_attitudes && *only && strcmp(only, o->name) != 0) {
                return NULL;
            }
            only = o->has_attitudes ? o->name : only;
        }
    }
    return only;
}

bst_status bst_world_updates_attitudes(bst_ctx *ctx, const void *world, const char *path,
                                       const char *object, bst_attitude_row **rows, int *count) {
    const world_updates *from;
    *rows = NULL;
    *count = 0;
    BST_TRY(find_updates(ctx, world, path, "CSV, CCSDS AEM", &from));
    const char *name = *object ? object : only_object(from->file);
    if (!name) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "%s: attitudes of several objects; give \"object\", the name of one", path);
    }
    int64_t total = count_objects(from->file), n = 0;
    if (total > INT32_MAX / 2 || !(*rows = calloc(2 * (size_t)total + 1, sizeof **rows))) {
        return bst_fail(ctx, BST_ERR_MEMORY, "%s: no memory for its attitudes", path);
    }
    bst_frame_cursor c = bst_frame_cursor_begin(from->file, &from->camera, &from->exposure, 0.0);
    for (; n < total; bst_frame_cursor_next(&c)) {
        for (int k = 0; c.update && k < c.update->object_count; k++, n++) {
            const bst_frame_object *o = &c.update->objects[k];
            if (o->has_attitudes && strcmp(o->name, name) == 0) {
                (*rows)[(*count)++] = (bst_attitude_row){c.start_s, o->start_q_body_from_gcrf};
                (*rows)[(*count)++] =
                    (bst_attitude_row){c.start_s + c.exposure_s, o->end_q_body_from_gcrf};
            }
        }
    }
    if (*count == 0) {
        free(*rows);
        *rows = NULL;
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "%s: no attitudes of an object \"%.64s\" (allowed: an object with "
                        "start_q_body_from_gcrf and end_q_body_from_gcrf)",
                        path, name);
    }
    return BST_OK;
}
