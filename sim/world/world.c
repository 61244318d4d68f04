#include <assert.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/optics/band.h"
#include "sim/optics/ghosts.h"
#include "sim/optics/psf.h"
#include "sim/world/object_torque.h"
#include "sim/world/orbit/constellation.h"
#include "sim/world/orbit/ephemeris.h"
#include "sim/world/scene/object_shape.h"
#include "sim/world/scene/stray.h"
#include "sim/world/scene/stray_map.h"
#include "sim/world/world_build.h"

static bst_status open_stars(const bst_world_builder *b, const char *name, const char *where,
                             bst_stars **out) {
    bool word = strcmp(name, "default") == 0 || strcmp(name, "embedded") == 0;
    bst_world_path file = bst_world_path_join(b, name);
    bst_status status = bst_stars_open(b->ctx, word ? name : file.text, out);
    return status == BST_OK ? BST_OK
                            : bst_fail_prefix(b->ctx, status, "%s: %s", b->scenario, where);
}

/* Copies the list that describes a camera's field, for the world to own. */
static bst_status copy_field(const bst_world_builder *b, bst_camera *camera) {
    bst_config_list *field = &camera->optics.field;
    const void *given = field->items;
    field->items = NULL;
    if (field->count > 0) {
        size_t bytes = (size_t)field->count * sizeof(bst_psf_field_node);
        field->items = malloc(bytes);
        if (!field->items) {
            return bst_fail(b->ctx, BST_ERR_MEMORY, "out of memory for a camera's field");
        }
        memcpy(field->items, given, bytes);
    }
    return BST_OK;
}

/* Creates the PSF of a sensor's camera. A PSF from a file is created later, with the samples of the
 * file. */
static bst_status make_psf(const bst_world_builder *b, bst_camera *camera, int observer,
                           int sensor) {
    camera->psf = NULL;
    if (camera->optics.psf == BST_PSF_FILE) {
        return BST_OK;
    }
    bst_psf *psf;
    bst_status status = bst_psf_create(b->ctx, camera, &psf);
    camera->psf = psf;
    return status == BST_OK ? BST_OK
                            : bst_fail_prefix(b->ctx, status, "%s: /observers/%d/sensors/%d/camera",
                                              b->scenario, observer, sensor);
}

bst_status bst_world_set_psf(bst_ctx *ctx, bst_world *world, int observer, int sensor,
                             const bst_psf_samples *samples) {
    bst_camera *camera = &world->observers[observer].sensors[sensor].config.camera;
    const bst_psf_inputs inputs = {.samples = samples};
    bst_psf *psf;
    BST_TRY(bst_psf_create_from(ctx, camera, &inputs, &psf));
    bst_psf_free((bst_psf *)camera->psf);
    camera->psf = psf;
    return BST_OK;
}

bst_status bst_world_set_stray_map(bst_ctx *ctx, bst_world *world, int observer, int sensor,
                                   int width, int height, float *pixels) {
    bst_camera *camera = &world->observers[observer].sensors[sensor].config.camera;
    bst_stray_map *map;
    BST_TRY(bst_stray_map_create(ctx, camera, width, height, pixels, &map));
    bst_stray_map_free((bst_stray_map *)camera->stray_map);
    camera->stray_map = map;
    return BST_OK;
}

static bst_status make_spectrum(const bst_world_builder *b, bst_camera *camera, int observer,
                                int sensor) {
    bst_band *band;
    bst_status status = bst_band_create(b->ctx, &camera->band, b->base_dir, &band);
    if (status != BST_OK) {
        return bst_fail_prefix(b->ctx, BST_ERR_CONFIG, "%s: /observers/%d/sensors/%d/camera/band",
                               b->scenario, observer, sensor);
    }
    camera->spectrum = band;
    /* the configuration owns the lists */
    camera->band.response = camera->band.transmission = (bst_config_list){0};
    status = bst_camera_resolve_figures(b->ctx, camera);
    return status == BST_OK ? BST_OK
                            : bst_fail_prefix(b->ctx, status, "%s: /observers/%d/sensors/%d/camera",
                                              b->scenario, observer, sensor);
}

static bst_status make_pst(const bst_world_builder *b, bst_camera *camera, int observer,
                           int sensor) {
    bst_scene_pst *pst;
    double own_um = camera->pixel_pitch_um > 0.0 ? camera->pixel_pitch_um : 0.0; /* NAN: unknown */
    double pixel_pitch_um =
        camera->optics.pixel_pitch_um > 0.0 ? camera->optics.pixel_pitch_um : own_um;
    bst_status status =
        bst_scene_pst_create(b->ctx, &camera->background, pixel_pitch_um, b->base_dir, &pst);
    if (status != BST_OK) {
        return bst_fail_prefix(b->ctx, BST_ERR_CONFIG,
                               "%s: /observers/%d/sensors/%d/camera/background", b->scenario,
                               observer, sensor);
    }
    camera->pst = pst;
    camera->background.pst = (bst_config_list){0}; /* the configuration owns it */
    return BST_OK;
}

static bst_status make_ghosts(const bst_world_builder *b, bst_camera *camera, int observer,
                              int sensor) {
    bst_ghosts *ghosts;
    bst_status status = bst_ghosts_create(b->ctx, camera, b->base_dir, &ghosts);
    if (status != BST_OK) {
        return bst_fail_prefix(b->ctx, BST_ERR_CONFIG, "%s: /observers/%d/sensors/%d/camera",
                               b->scenario, observer, sensor);
    }
    camera->ghost_images = ghosts;
    camera->ghosts = (bst_config_list){0}; /* the configuration owns it */
    return BST_OK;
}

/* Index of the object that an observer in a constellation is; -1: none. */
static int own_object(const bst_world_builder *b, const bst_orbit_config *orbit) {
    const bst_constellation_config *list = b->constellations->items;
    char name[64];
    for (int i = 0; i < b->constellations->count; i++) {
        if (orbit->source == BST_ORBIT_CONSTELLATION &&
            strcmp(list[i].name, orbit->constellation) == 0) {
            bst_constellation_name(&list[i], (int)orbit->member[0], (int)orbit->member[1], name);
            return bst_world_find_object(b->world, name);
        }
    }
    return -1;
}

static bst_status make_observers(const bst_world_builder *b, const bst_config_list *list) {
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
        BST_TRY(bst_world_orbit_build(b, &config->orbit, &config->burns, path, observer->name,
                                      &observer->orbit, &observer->norad));
        observer->own_object = own_object(b, &config->orbit);
        observer->sensor_count = config->sensors.count;
        observer->sensors = calloc((size_t)config->sensors.count + 1, sizeof *observer->sensors);
        if (!observer->sensors) {
            return bst_fail(b->ctx, BST_ERR_MEMORY, "out of memory for sensors");
        }
        for (int s = 0; s < config->sensors.count; s++) {
            observer->sensors[s].config = ((const bst_sensor_config *)config->sensors.items)[s];
            BST_TRY(copy_field(b, &observer->sensors[s].config.camera));
            bst_status status = bst_camera_prepare(b->ctx, &observer->sensors[s].config.camera);
            if (status != BST_OK) {
                return bst_fail_prefix(b->ctx, status,
                                       "%s: /observers/%d/sensors/%d/camera/distortion",
                                       b->scenario, i, s);
            }
            BST_TRY(make_spectrum(b, &observer->sensors[s].config.camera, i, s));
            BST_TRY(make_pst(b, &observer->sensors[s].config.camera, i, s));
            BST_TRY(make_ghosts(b, &observer->sensors[s].config.camera, i, s));
            BST_TRY(make_psf(b, &observer->sensors[s].config.camera, i, s));
        }
    }
    return BST_OK;
}

/* True if a camera's background includes stars that are not rendered. */
static bool needs_starlight(const bst_config_list *observers) {
    const bst_observer_config *configs = observers->items;
    for (int i = 0; i < observers->count; i++) {
        const bst_sensor_config *sensors = configs[i].sensors.items;
        for (int s = 0; s < configs[i].sensors.count; s++) {
            const bst_background_config *c = &sensors[s].camera.background;
            if (c->model == BST_BACKGROUND_SKY && c->starlight) {
                return true;
            }
        }
    }
    return false;
}

static bst_status build(bst_world_builder *b, const bst_world_config *config,
                        const bst_config_list *observers) {
    bst_world *world = b->world;
    bool builtin = strcmp(config->earth_orientation, "builtin") == 0;
    bst_world_path eop_file = bst_world_path_join(b, config->earth_orientation);
    bst_status status = builtin ? bst_astro_eop_builtin(b->ctx, &world->eop)
                                : bst_astro_eop_load(b->ctx, eop_file.text, &world->eop);
    if (status != BST_OK) {
        return bst_fail_prefix(b->ctx, status, "%s: /world/earth_orientation", b->scenario);
    }
    bst_astro_eop_values values;
    status = bst_astro_eop_at(b->ctx, world->eop, world->epoch, &values);
    if (status != BST_OK) {
        return bst_fail_prefix(b->ctx, status, "%s: /epoch_utc", b->scenario);
    }
    if (config->opened_stars) {
        BST_TRY(bst_stars_share(b->ctx, config->opened_stars, &world->stars));
    } else {
        BST_TRY(open_stars(b, config->star_catalogue, "/world/star_catalogue", &world->stars));
    }
    world->shadow_atmosphere = config->shadow_atmosphere;
    world->faint_limit_v_mag =
        config->faint_stars == BST_FAINT_STATISTICAL ? config->faint_limit_v_mag : -INFINITY;
    if (config->faint_stars == BST_FAINT_STATISTICAL || needs_starlight(observers)) {
        BST_TRY(bst_faint_sky_create(b->ctx, world->stars, config->faint_seed, &world->faint));
    }
    BST_TRY(bst_sky_clock_grid_create(b->ctx, world->eop, &world->sky_grid));
    BST_TRY(bst_sky_clock_create_on(b->ctx, world->sky_grid, &b->clock));
    BST_TRY(bst_world_load_updates(b, observers));
    BST_TRY(bst_world_build_objects(b, config));
    BST_TRY(make_observers(b, observers));
    for (int i = 0; i < world->observer_count; i++) {
        for (int k = 0; k < world->observers[i].sensor_count; k++) {
            BST_TRY(bst_world_cue_resolve(b->ctx, b->scenario, world, i, k, b->clock));
        }
    }
    return bst_ephemeris_create(b->ctx, world, &world->ephemeris);
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
    bst_world_builder b = {.ctx = ctx,
                           .scenario = scenario,
                           .base_dir = base_dir,
                           .world = world,
                           .constellations = &config->constellations};
    bst_status status = build(&b, config, observers);
    bst_sky_clock_free(b.clock);
    if (status != BST_OK) {
        bst_world_free(world);
        return status;
    }
    *out = world;
    return BST_OK;
}

void bst_world_free(bst_world *world) {
    if (!world) {
        return;
    }
    bst_ephemeris_free(world->ephemeris);
    for (int i = 0; world->objects && i < world->object_count; i++) {
        bst_world_orbit_free(&world->objects[i].orbit);
    }
    for (int i = 0; world->observers && i < world->observer_count; i++) {
        world_observer *observer = &world->observers[i];
        bst_world_orbit_free(&observer->orbit);
        for (int k = 0; observer->sensors && k < observer->sensor_count; k++) {
            bst_camera *camera = &observer->sensors[k].config.camera;
            bst_psf_free((bst_psf *)camera->psf);
            bst_band_free((bst_band *)camera->spectrum);
            bst_scene_pst_free((bst_scene_pst *)camera->pst);
            bst_stray_map_free((bst_stray_map *)camera->stray_map);
            bst_ghosts_free((bst_ghosts *)camera->ghost_images);
            free(camera->optics.field.items);
        }
        free(observer->sensors);
    }
    for (int i = 0; i < world->brightness_count; i++) {
        bst_brightness_free(world->brightness[i]);
    }
    free(world->brightness);
    for (int i = 0; i < world->shape_count; i++) {
        bst_object_torque_free(world->shapes[i]->torque);
        bst_object_shape_free(world->shapes[i]);
    }
    free(world->occulters);
    free(world->shapes);
    bst_world_files_free(world);
    bst_world_updates_free(world);
    bst_name_index_free(world->object_names);
    free(world->objects);
    free(world->observers);
    bst_faint_sky_free(world->faint);
    bst_stars_close(world->stars);
    bst_sky_clock_grid_free(world->sky_grid);
    bst_astro_eop_free(world->eop);
    free(world);
}

bst_status bst_world_prepare(bst_ctx *ctx, bst_world *world, int threads) {
    return bst_ephemeris_prepare(ctx, world->ephemeris, threads);
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
const bst_world_object_info *bst_world_object(const bst_world *world, int object) {
    assert(world && object >= 0 && object < bst_world_object_count(world));
    return &world->objects[object].info;
}
int bst_world_first_part(const bst_world *world, int object) {
    int number = 1;
    for (int i = 0; i < object; i++) {
        const bst_object_shape *shape = bst_world_object(world, i)->shape;
        number += shape ? shape->satellite->part_count : 0;
    }
    return number;
}
int bst_world_observer_count(const bst_world *world) {
    return world->observer_count;
}
int bst_world_sensor_count(const bst_world *world, int observer) {
    return world->observers[observer].sensor_count;
}
const char *bst_world_observer_name(const bst_world *world, int observer) {
    return world->observers[observer].name;
}

bool bst_world_element_age(const bst_world *world, int body, double *seconds) {
    const bst_world_orbit *orbit = body < world->object_count
                                       ? &world->objects[body].orbit
                                       : &world->observers[body - world->object_count].orbit;
    *seconds = orbit->epoch_offset_s;
    return orbit->source == BST_ORBIT_SGP4;
}

const bst_elements *bst_world_elements(const bst_world *world, int object, double *epoch_offset_s) {
    assert(world && object >= 0 && object < world->object_count);
    const bst_world_orbit *orbit = &world->objects[object].orbit;
    *epoch_offset_s = orbit->epoch_offset_s;
    bool alone = orbit->source == BST_ORBIT_SGP4 && orbit->burn_count == 0 && !orbit->external;
    return alone ? &orbit->elements : NULL;
}

double bst_world_places(const bst_world *world, double seconds, double *x_m, double *y_m,
                        double *z_m) {
    return bst_ephemeris_places(world->ephemeris, seconds, x_m, y_m, z_m);
}

const bst_camera *bst_world_camera(const bst_world *world, int observer, int sensor) {
    assert(world && observer >= 0 && observer < bst_world_observer_count(world) && sensor >= 0);
    return &world->observers[observer].sensors[sensor].config.camera;
}

const bst_exposure_config *bst_world_exposure(const bst_world *world, int observer, int sensor) {
    return &world->observers[observer].sensors[sensor].config.exposure;
}

bst_quat bst_world_body_attitude(const bst_world *world, int observer, int sensor) {
    return world->observers[observer].sensors[sensor].body_attitude;
}

const bst_astro_eop *bst_world_earth_orientation(const bst_world *world) {
    return world->eop;
}

void bst_world_warn_earth_orientation(bst_ctx *ctx, const char *scenario, const bst_world *world,
                                      double duration_s) {
    char where[600];
    snprintf(where, sizeof where, "%.500s: /world/earth_orientation: ", scenario);
    bst_astro_eop_warn(ctx, world->eop, bst_world_time(world, duration_s), where);
}
