#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/world/world_internal.h"

typedef struct builder {
    bst_ctx *ctx;
    const char *scenario;
    const char *base_dir;
    bst_world *world;
    bst_sky_clock *clock;
} builder;

/* A path that may be relative to the scenario's folder. */
typedef struct full_path {
    char text[1100];
} full_path;

static full_path join(const builder *b, const char *path) {
    full_path full;
    bool as_it_is = path[0] == '/' || !*path || !*b->base_dir;
    snprintf(full.text, sizeof full.text, "%s%s%s", as_it_is ? "" : b->base_dir,
             as_it_is ? "" : "/", path);
    return full;
}

static bst_status open_stars(const builder *b, const char *name, const char *where,
                             bst_stars **out) {
    bool word = strcmp(name, "default") == 0 || strcmp(name, "embedded") == 0;
    full_path file = join(b, name);
    bst_status status = bst_stars_open(b->ctx, word ? name : file.text, out);
    return status == BST_OK ? BST_OK
                            : bst_fail_prefix(b->ctx, status, "%s: %s", b->scenario, where);
}

static bst_status make_sgp4(const builder *b, const bst_orbit_config *config, const char *path,
                            bst_orbit *orbit, int *norad) {
    if (!*config->tle_file || config->norad == 0) {
        return bst_fail(b->ctx, BST_ERR_CONFIG,
                        "%s: %s: source \"sgp4\" needs \"tle_file\" and \"norad\"", b->scenario,
                        path);
    }
    full_path file = join(b, config->tle_file);
    bst_elements *sets = NULL;
    int count = 0;
    bst_tle_options options = {.norad = (int)config->norad};
    if (bst_tle_load(b->ctx, file.text, &options, &sets, &count) != BST_OK) {
        return bst_fail_prefix(b->ctx, BST_ERR_CONFIG, "%s: %s/tle_file", b->scenario, path);
    }
    /* of several sets the one whose epoch is nearest to the scenario's */
    int best = 0;
    double best_offset = INFINITY;
    bst_status status = BST_OK;
    for (int i = 0; i < count && status == BST_OK; i++) {
        bst_time epoch;
        status = bst_time_from_utc_jd(b->ctx, sets[i].epoch_utc_jd1, sets[i].epoch_utc_jd2, &epoch);
        if (status == BST_OK) {
            double offset = bst_time_diff(b->world->epoch, epoch);
            if (fabs(offset) < fabs(best_offset)) {
                best_offset = offset;
                best = i;
            }
        }
    }
    if (status == BST_OK) {
        orbit->epoch_offset_s = best_offset;
        *norad = sets[best].norad;
        status =
            bst_sgp4_create(b->ctx, &sets[best], BST_SGP4_WGS72, BST_SGP4_IMPROVED, &orbit->sgp4);
    }
    free(sets);
    return status == BST_OK ? BST_OK : bst_fail_prefix(b->ctx, status, "%s: %s", b->scenario, path);
}

/* objects_done: how many objects a relative orbit may refer to. */
static bst_status make_orbit(const builder *b, const bst_orbit_config *config, const char *path,
                             const char *name, int objects_done, bst_orbit *orbit, int *norad) {
    orbit->name = name;
    if (config->source == BST_ORBIT_SGP4) {
        return make_sgp4(b, config, path, orbit, norad);
    }
    for (int i = 0; i < objects_done; i++) {
        if (strcmp(b->world->objects[i].info.name, config->reference) == 0) {
            orbit->reference = &b->world->objects[i].orbit;
            orbit->at_s = config->at_s;
            const double *o = config->offset_rtn_m, *r = config->rate_rtn_mps;
            orbit->offset_rtn_m = (bst_vec3){o[0], o[1], o[2]};
            orbit->rate_rtn_mps = (bst_vec3){r[0], r[1], r[2]};
            return BST_OK;
        }
    }
    return bst_fail(b->ctx, BST_ERR_CONFIG,
                    "%s: %s/reference: no object \"%s\" before this one in /world/objects",
                    b->scenario, path, config->reference);
}

static bst_status make_objects(const builder *b, const bst_config_list *list) {
    bst_world *world = b->world;
    world->objects = calloc((size_t)list->count + 1, sizeof *world->objects);
    if (!world->objects) {
        return bst_fail(b->ctx, BST_ERR_MEMORY, "out of memory for %d objects", list->count);
    }
    world->object_count = list->count;
    const bst_object_config *configs = list->items;
    for (int i = 0; i < list->count; i++) {
        const bst_object_config *config = &configs[i];
        world_object *object = &world->objects[i];
        char path[64];
        snprintf(path, sizeof path, "/world/objects/%d", i);
        for (int k = 0; k < i; k++) {
            if (strcmp(configs[k].name, config->name) == 0) {
                return bst_fail(b->ctx, BST_ERR_CONFIG,
                                "%s: %s/name: \"%s\" is the name of /world/objects/%d too",
                                b->scenario, path, config->name, k);
            }
        }
        memcpy(object->info.name, config->name, sizeof object->info.name);
        object->info.area_m2 = config->area_m2;
        object->info.albedo = config->albedo;
        snprintf(path, sizeof path, "/world/objects/%d/orbit", i);
        BST_TRY(make_orbit(b, &config->orbit, path, object->info.name, i, &object->orbit,
                           &object->info.norad));
        if (config->burns.count > 0) {
            const bst_burn_config *burns = config->burns.items;
            for (int k = 1; k < config->burns.count; k++) {
                if (burns[k].time_s < burns[k - 1].time_s) {
                    return bst_fail(
                        b->ctx, BST_ERR_CONFIG,
                        "%s: /world/objects/%d/burns/%d/time_s: burns must be in the order of time",
                        b->scenario, i, k);
                }
            }
            if (bst_orbit_set_burns(b->ctx, &object->orbit, b->clock, world->epoch, burns,
                                    config->burns.count) != BST_OK) {
                return bst_fail_prefix(b->ctx, BST_ERR_CONFIG, "%s: /world/objects/%d/burns",
                                       b->scenario, i);
            }
        }
    }
    return BST_OK;
}

static bst_status make_observers(const builder *b, const bst_config_list *list) {
    bst_world *world = b->world;
    world->observers = calloc((size_t)list->count + 1, sizeof *world->observers);
    if (!world->observers) {
        return bst_fail(b->ctx, BST_ERR_MEMORY, "out of memory for %d observers", list->count);
    }
    world->observer_count = list->count;
    const bst_observer_config *configs = list->items;
    for (int i = 0; i < list->count; i++) {
        const bst_observer_config *config = &configs[i];
        world_observer *observer = &world->observers[i];
        char path[64];
        snprintf(path, sizeof path, "/observers/%d/orbit", i);
        memcpy(observer->name, config->name, sizeof observer->name);
        int norad = 0;
        BST_TRY(make_orbit(b, &config->orbit, path, observer->name, world->object_count,
                           &observer->orbit, &norad));
        observer->sensor_count = config->sensors.count;
        observer->sensors = calloc((size_t)config->sensors.count + 1, sizeof *observer->sensors);
        if (!observer->sensors) {
            return bst_fail(b->ctx, BST_ERR_MEMORY, "out of memory for sensors");
        }
        for (int s = 0; s < config->sensors.count; s++) {
            observer->sensors[s].config = ((const bst_sensor_config *)config->sensors.items)[s];
            bst_status status = bst_camera_prepare(b->ctx, &observer->sensors[s].config.camera);
            if (status != BST_OK) {
                return bst_fail_prefix(b->ctx, status,
                                       "%s: /observers/%d/sensors/%d/camera/distortion",
                                       b->scenario, i, s);
            }
        }
    }
    return BST_OK;
}

static bst_status build(builder *b, const bst_world_config *config,
                        const bst_config_list *observers) {
    bst_world *world = b->world;
    bool builtin = strcmp(config->earth_orientation, "builtin") == 0;
    full_path eop_file = join(b, config->earth_orientation);
    bst_status status = builtin ? bst_eop_builtin(b->ctx, &world->eop)
                                : bst_eop_load(b->ctx, eop_file.text, &world->eop);
    if (status != BST_OK) {
        return bst_fail_prefix(b->ctx, status, "%s: /world/earth_orientation", b->scenario);
    }
    bst_eop_values values;
    status = bst_eop_at(b->ctx, world->eop, world->epoch, &values);
    if (status != BST_OK) {
        return bst_fail_prefix(b->ctx, status, "%s: /epoch_utc", b->scenario);
    }
    BST_TRY(open_stars(b, config->star_catalogue, "/world/star_catalogue", &world->stars));
    BST_TRY(bst_sky_clock_create(b->ctx, world->eop, &b->clock));
    BST_TRY(make_objects(b, &config->objects));
    BST_TRY(make_observers(b, observers));
    for (int i = 0; i < world->observer_count; i++) {
        for (int k = 0; k < world->observers[i].sensor_count; k++) {
            BST_TRY(bst_cue_resolve(b->ctx, b->scenario, world, i, k, b->clock));
        }
    }
    return BST_OK;
}

bst_status bst_world_create(bst_ctx *ctx, const char *scenario, const bst_world_config *config,
                            const bst_config_list *observers, const char *base_dir, bst_time epoch,
                            bst_world **out) {
    *out = NULL;
    bst_world *world = calloc(1, sizeof *world);
    if (!world) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the world");
    }
    world->epoch = epoch;
    builder b = {ctx, scenario, base_dir, world, NULL};
    bst_status status = build(&b, config, observers);
    bst_sky_clock_free(b.clock);
    if (status != BST_OK) {
        bst_world_free(world);
        return status;
    }
    *out = world;
    return BST_OK;
}

static void free_orbit(bst_orbit *orbit) {
    bst_sgp4_free(orbit->sgp4);
    free(orbit->burns);
}

void bst_world_free(bst_world *world) {
    if (!world) {
        return;
    }
    for (int i = 0; world->objects && i < world->object_count; i++) {
        free_orbit(&world->objects[i].orbit);
    }
    for (int i = 0; world->observers && i < world->observer_count; i++) {
        free_orbit(&world->observers[i].orbit);
        free(world->observers[i].sensors);
    }
    free(world->objects);
    free(world->observers);
    bst_stars_close(world->stars);
    bst_eop_free(world->eop);
    free(world);
}

bst_time bst_world_time(const bst_world *world, double seconds) {
    return bst_time_add(world->epoch, seconds);
}
const bst_stars *bst_world_stars(const bst_world *world) {
    return world->stars;
}
int bst_world_object_count(const bst_world *world) {
    return world->object_count;
}
const bst_object_info *bst_world_object(const bst_world *world, int object) {
    return &world->objects[object].info;
}
int bst_world_observer_count(const bst_world *world) {
    return world->observer_count;
}
const char *bst_world_observer_name(const bst_world *world, int observer) {
    return world->observers[observer].name;
}

int bst_world_find_object(const bst_world *world, const char *name) {
    for (int i = 0; i < world->object_count; i++) {
        if (strcmp(world->objects[i].info.name, name) == 0) {
            return i;
        }
    }
    return -1;
}

const bst_camera *bst_world_camera(const bst_world *world, int observer, int sensor) {
    return &world->observers[observer].sensors[sensor].config.camera;
}

bst_quat bst_world_body_attitude(const bst_world *world, int observer, int sensor) {
    return world->observers[observer].sensors[sensor].body_attitude;
}
