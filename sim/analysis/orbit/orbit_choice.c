#include "sim/analysis/orbit/orbit_choice.h"

#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "sim/run/track_files.h"

/* Keeps the track with the most observations, of the target if possible. */
static bst_status consider(void *user, bst_ctx *ctx, const bst_run_track *track) {
    bst_orbit_choice *c = user;
    const bst_run_track *best = &c->track;
    if (c->items && (best->target > track->target ||
                     (best->target == track->target && best->count >= track->count))) {
        return BST_OK;
    }
    size_t bytes = (size_t)track->count * sizeof *c->items;
    bst_run_observation *items = realloc(c->items, bytes);
    if (!items) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a track's observations");
    }
    memcpy(items, track->items, bytes);
    c->items = items;
    c->sensor = *track->sensor;
    c->track = *track;
    c->track.items = items;
    c->track.sensor = &c->sensor;
    return BST_OK;
}

/* Selects the track of a run for orbit determination. */
static bst_status choose(bst_ctx *ctx, const bst_orbit_request *q, bst_run_scene *scene,
                         bst_orbit_choice *out) {
    bst_run_sensor sensors[BST_EXPORT_SENSORS];
    int count;
    BST_TRY(bst_run_sensors(ctx, scene->run, q->sensor, sensors, &count));
    for (int i = 0; i < count; i++) {
        BST_TRY(bst_run_observations(ctx, scene, &sensors[i], q->track, false, consider, out));
    }
    if (!out->items && q->track) {
        return bst_fail(ctx, BST_ERR_NOT_FOUND,
                        "%s: holds no confirmed track %" PRId64
                        " with an attitude from stars; its tracks: boresight export RUN --table "
                        "csv --tables tracks",
                        bst_run_reader_folder(scene->run), q->track);
    }
    return out->items ? BST_OK
                      : bst_fail(ctx, BST_ERR_NOT_FOUND,
                                 "%s: holds no confirmed track with an attitude from stars",
                                 bst_run_reader_folder(scene->run));
}

/* Motion law of the track's object. A track without object gets the common law if all objects have
 * element sets. */
static bst_world_motion_law motion_of(const bst_world *world, int object) {
    if (object >= 0) {
        return bst_world_object_motion(world, object);
    }
    bst_world_motion_law all = {.sgp4 = bst_world_object_count(world) > 0};
    for (int i = 0; i < bst_world_object_count(world); i++) {
        all.sgp4 = all.sgp4 && bst_world_object_motion(world, i).sgp4;
    }
    return all;
}

static bst_status choose_in_run(bst_ctx *ctx, const bst_orbit_request *q, const char *path,
                                bst_orbit_choice *out) {
    char object[96];
    BST_TRY(bst_run_reader_open(ctx, path, &out->run));
    BST_TRY(bst_run_scene_open(ctx, out->run, &out->scene));
    BST_TRY(choose(ctx, q, &out->scene, out));
    bst_track_object(&out->track, object, sizeof object);
    int index = bst_world_find_object(out->scene.world, object);
    if (index >= 0) {
        out->norad = bst_world_object(out->scene.world, index)->norad;
        out->area_m2 = bst_world_object(out->scene.world, index)->area_m2;
    }
    out->motion = motion_of(out->scene.world, index);
    out->epoch = out->scene.scenario.epoch;
    return BST_OK;
}

static bst_status choose_in_tdm(bst_ctx *ctx, const bst_orbit_request *q, const char *path,
                                bst_orbit_choice *out) {
    bst_tdm_request of = q->angles;
    of.path = path;
    int64_t count;
    BST_TRY(bst_tdm_observations(ctx, &of, &out->sensor, &out->items, &count));
    out->epoch = out->items[0].time;
    out->track = (bst_run_track){.sensor = &out->sensor,
                                 .target = true,
                                 .exposure_s = NAN,
                                 .items = out->items,
                                 .count = count};
    return BST_OK;
}

bst_status bst_orbit_choose(bst_ctx *ctx, const bst_orbit_request *request, const char *path,
                            bst_orbit_choice *out) {
    struct stat info;
    bool file = stat(path, &info) == 0 && S_ISREG(info.st_mode);
    return (file ? choose_in_tdm : choose_in_run)(ctx, request, path, out);
}

void bst_orbit_choice_free(bst_orbit_choice *choice) {
    free(choice->items);
    bst_run_scene_close(&choice->scene);
    bst_run_reader_close(choice->run);
}
