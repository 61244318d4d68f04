/* Creates the world's space objects: the listed ones, constellations, then catalogues of element
 * sets. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/compare.h"
#include "sim/satellite/interreflection.h"
#include "sim/world/external_states.h"
#include "sim/world/object_torque.h"
#include "sim/world/orbit/constellation.h"
#include "sim/world/scene/object_shape.h"
#include "sim/world/world_build.h"

/* An element set of a catalogue that may become an object. */
typedef struct candidate {
    const bst_elements *set;
    const bst_catalogue_config *catalogue;
    double age_s; /* time between the epochs of element set and scenario */
    int catalogue_index, order;
} candidate;

/* Orders element sets by catalogue number, then nearest epoch, then position in the files. */
static int compare_candidates(const void *a, const void *b) {
    const candidate *x = a, *y = b;
    if (x->set->norad != y->set->norad) {
        return x->set->norad < y->set->norad ? -1 : 1;
    }
    if (x->age_s != y->age_s) {
        return x->age_s < y->age_s ? -1 : 1;
    }
    return x->order - y->order;
}

static int compare_order(const void *a, const void *b) {
    return ((const candidate *)a)->order - ((const candidate *)b)->order;
}

/* Allocates the objects of the world and the index of their names. */
static bst_status reserve(const bst_world_builder *b, int capacity) {
    bst_world *world = b->world;
    world->objects = calloc((size_t)capacity + 1, sizeof *world->objects);
    if (!world->objects) {
        return bst_fail(b->ctx, BST_ERR_MEMORY, "out of memory for %d objects", capacity);
    }
    return bst_name_index_create(b->ctx, capacity, &world->object_names);
}

/* Creates the brightness model of an object; the world owns it. */
static bst_status make_brightness(const bst_world_builder *b, const bst_brightness_config *config,
                                  const char *list, int index, const bst_brightness **out) {
    bst_world *world = b->world;
    bst_brightness *made;
    bst_status status = bst_brightness_create(b->ctx, config, b->base_dir, &made);
    if (status != BST_OK) {
        return bst_fail_prefix(b->ctx, status, "%s: /world/%s/%d/brightness", b->scenario, list,
                               index);
    }
    *out = world->brightness[world->brightness_count++] = made;
    return BST_OK;
}

/* Phases of the attitude that continue the one before start from where that one ends. */
static bst_status start_attitude(const bst_world_builder *b, const bst_object_config *config,
                                 const world_object *object, bst_body_attitude *attitude) {
    /* forces on the shape follow from the attitude up to a phase; its own is not yet known */
    double early_s = config->orbit.forces.shape ? 1e-3 : 0.0;
    int phase = 0;
    double seconds;
    while (bst_body_attitude_next_start(attitude, &phase, &seconds)) {
        bst_world_state state;
        bst_sky_rotation sky;
        if (early_s > 0.0 && seconds <= config->orbit.state.at_s) {
            return bst_fail(
                b->ctx, BST_ERR_CONFIG,
                "%d/quaternion: missing: with forces.shape a phase that starts at or "
                "before the time of the orbit's state (found %g s, state at %g s) needs "
                "its attitude",
                phase, seconds, config->orbit.state.at_s);
        }
        BST_TRY(bst_sky_clock_at(b->ctx, b->clock, bst_time_add(b->world->epoch, seconds), &sky));
        BST_TRY(bst_world_orbit_state(b->ctx, &object->orbit, b->clock, b->world->epoch,
                                      seconds - early_s, true, &state));
        state.position_m = bst_vec3_axpy(state.position_m, early_s, state.velocity_mps);
        bst_vec3 sun = bst_vec3_sub(bst_bodies_sunlight_from(&sky.bodies), state.position_m);
        bst_attitude_state body = {state.position_m, state.velocity_mps, bst_vec3_unit(sun),
                                   seconds};
        bst_body_attitude_start(attitude, phase, &body);
    }
    return BST_OK;
}

/* Keeps the starts of the object's burns for joints that follow them. */
static bst_status set_burns(bst_ctx *ctx, const bst_config_list *burns, bst_object_shape *shape) {
    const bst_burn_config *items = burns->items;
    const bst_satellite *s = shape->satellite;
    for (int i = 0; i < s->joint_count; i++) {
        if (s->joints[i].follows == BST_JOINT_BURN && s->joints[i].burn >= burns->count) {
            return bst_fail(ctx, BST_ERR_CONFIG,
                            "shape: /joints/%d/burn: found %d, but the object has %d burns "
                            "(allowed: the number of one of its burns, from 1)",
                            i, s->joints[i].burn + 1, burns->count);
        }
    }
    shape->burn_s = calloc((size_t)burns->count + 1, sizeof *shape->burn_s);
    if (!shape->burn_s) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for burns");
    }
    for (int i = 0; i < burns->count; i++) {
        shape->burn_s[shape->burn_count++] = items[i].time_s;
    }
    return BST_OK;
}

/* The listed object with external_states on which the place of another one depends: itself, or the
 * one that its orbit is relative to, directly or over others. Returned: its index; -1: none. */
static int moved_from_outside(const bst_object_config *all, int index) {
    while (index >= 0 && !all[index].external_states) {
        const bst_orbit_config *orbit = &all[index].orbit;
        if (orbit->source != BST_ORBIT_RELATIVE) {
            return -1;
        }
        do {
            index--; /* references are to earlier ones */
        } while (index >= 0 && strcmp(all[index].name, orbit->reference) != 0);
    }
    return index;
}

/* Builds the shape of a listed object; the world owns it. */
static bst_status make_shape(const bst_world_builder *b, const bst_object_config *all, int index,
                             world_object *object) {
    const bst_object_config *config = &all[index];
    int outside = moved_from_outside(all, index);
    bool wanted = config->brightness.model == BST_BRIGHTNESS_SHAPE;
    bool given = bst_object_shape_is_given(&config->shape);
    if (wanted != given) {
        return bst_fail(b->ctx, BST_ERR_CONFIG, "%s: /world/objects/%d/%s", b->scenario, index,
                        wanted ? "shape: the brightness model shape needs a shape (allowed: file, "
                                 "or materials and parts)"
                               : "brightness/model: the object has a shape (allowed: \"shape\"; or "
                                 "leave out the shape)");
    }
    if (config->brightness.heat_balance != BST_HEAT_NONE && !given) {
        return bst_fail(b->ctx, BST_ERR_CONFIG,
                        "%s: /world/objects/%d/brightness/heat_balance: it needs a shape (allowed: "
                        "none; or the brightness model shape)",
                        b->scenario, index);
    }
    if (config->brightness.heat_balance == BST_HEAT_TRANSIENT && outside >= 0) {
        return bst_fail(b->ctx, BST_ERR_CONFIG,
                        "%s: /world/objects/%d/brightness/heat_balance: transient follows from the "
                        "past of the object, which /world/objects/%d/external_states may change "
                        "(allowed: none, steady)",
                        b->scenario, index, outside);
    }
    if (config->brightness.interreflection && !given) {
        return bst_fail(b->ctx, BST_ERR_CONFIG,
                        "%s: /world/objects/%d/brightness/interreflection: true, but there is no "
                        "shape (allowed: false; or the brightness model shape)",
                        b->scenario, index);
    }
    if (!given) {
        return BST_OK;
    }
    const bst_attitude_source source = {b->base_dir, b->world->epoch, bst_world_updates_attitudes,
                                        b->world};
    bst_object_shape *shape;
    bst_status status =
        bst_object_shape_create(b->ctx, &config->shape, &config->attitude, &source, &shape);
    if (status == BST_OK && config->brightness.interreflection) {
        shape->interreflection = true;
        status = bst_interreflection_check(b->ctx, shape->satellite);
    }
    if (status == BST_OK) {
        status = set_burns(b->ctx, &config->burns, shape);
    }
    if (status != BST_OK) {
        bst_object_shape_free(shape); /* NULL if it was not made */
        return bst_fail_prefix(b->ctx, status, "%s: /world/objects/%d", b->scenario, index);
    }
    shape->index = b->world->shape_count;
    b->world->shapes[b->world->shape_count++] = shape;
    object->info.shape = shape;
    bool torques = bst_body_attitude_has_torques(shape->attitude);
    if (torques && outside >= 0) {
        return bst_fail(b->ctx, BST_ERR_CONFIG,
                        "%s: /world/objects/%d/attitude: torques need a place that is known in "
                        "advance, which /world/objects/%d/external_states may change (allowed: one "
                        "of the two)",
                        b->scenario, index, outside);
    }
    if (config->orbit.forces.shape || torques || config->brightness.heat_balance != BST_HEAT_NONE) {
        bst_satellite_make_surfaces(shape->satellite);
    }
    if (config->orbit.forces.shape && !config->external_states) {
        BST_TRY(bst_shape_forces_create(b->ctx, shape->satellite, shape->attitude, shape->burn_s,
                                        shape->burn_count, &shape->forces));
    }
    return config->external_states ? bst_body_attitude_accept(b->ctx, shape->attitude) : BST_OK;
}

/* Prepares the torques on a listed object whose attitude has some. Where the orbit follows from the
 * attitude, torques act where the sphere of its spacecraft would be: an orbit of its own. */
static bst_status make_torque(const bst_world_builder *b, const bst_object_config *config,
                              int index, world_object *object) {
    bst_object_shape *shape =
        object->info.shape ? b->world->shapes[object->info.shape->index] : NULL;
    if (!shape || !bst_body_attitude_has_torques(shape->attitude)) {
        return BST_OK;
    }
    bst_object_torque_setup setup = {.orbit = &object->orbit,
                                     .satellite = shape->satellite,
                                     .burn_s = shape->burn_s,
                                     .burn_count = shape->burn_count,
                                     .drag_coefficient = config->orbit.spacecraft.cd,
                                     .density_scale = config->orbit.forces.density_scale};
    if (shape->forces) {
        char path[64];
        int norad;
        snprintf(path, sizeof path, "/world/objects/%d/orbit", index);
        bst_orbit_config sphere = config->orbit;
        sphere.forces.shape = false;
        bst_world_orbit *own = calloc(1, sizeof *own);
        if (!own) {
            return bst_fail(b->ctx, BST_ERR_MEMORY, "out of memory for an orbit");
        }
        bst_status status =
            bst_world_orbit_build(b, &sphere, &config->burns, path, object->info.name, own, &norad);
        if (status != BST_OK) {
            bst_world_orbit_free(own);
            free(own);
            return status;
        }
        setup.orbit = setup.own = own;
    }
    BST_TRY(bst_object_torque_create(b, &setup, &shape->torque));
    return bst_body_attitude_set_torque(b->ctx, shape->attitude, bst_object_torque_at,
                                        shape->torque);
}

/* Builds the orbit of a listed object; forces may act on its shape. */
static bst_status build_orbit(const bst_world_builder *b, const bst_object_config *config,
                              int index, world_object *object) {
    char path[64];
    snprintf(path, sizeof path, "/world/objects/%d/orbit", index);
    bst_world_builder own = *b;
    double phases[64];
    const bst_attitude_config *attitude = config->attitude.items;
    const bst_object_shape *shape = object->info.shape;
    if (shape && shape->forces) {
        own.surface = bst_shape_forces_surface(shape->forces);
        own.phase_s = phases;
        for (int i = 0; i < config->attitude.count && i < 64; i++) {
            phases[own.phase_count++] = attitude[i].from_s;
        }
    }
    return bst_world_orbit_build(&own, &config->orbit, &config->burns, path, object->info.name,
                                 &object->orbit, &object->info.norad);
}

/* Refuses the brightness model shape where objects have none. */
static bst_status refuse_shape(const bst_world_builder *b, const bst_brightness_config *config,
                               const char *list, int index) {
    return config->model != BST_BRIGHTNESS_SHAPE
               ? BST_OK
               : bst_fail(b->ctx, BST_ERR_CONFIG,
                          "%s: /world/%s/%d/brightness/model: shape (allowed here: sphere, "
                          "standard_magnitude, light_curve); list the object in /world/objects to "
                          "give it a shape",
                          b->scenario, list, index);
}

/* Builds the objects that the scenario lists. */
static bst_status build_listed(const bst_world_builder *b, const bst_config_list *list) {
    bst_world *world = b->world;
    const bst_object_config *configs = list->items;
    for (int i = 0; i < list->count; i++) {
        const bst_object_config *config = &configs[i];
        world_object *object = &world->objects[i];
        int same = bst_world_find_object(world, config->name);
        if (same >= 0) {
            return bst_fail(
                b->ctx, BST_ERR_CONFIG,
                "%s: /world/objects/%d/name: \"%s\" is the name of /world/objects/%d too",
                b->scenario, i, config->name, same);
        }
        memcpy(object->info.name, config->name, sizeof object->info.name);
        object->info.area_m2 = config->area_m2;
        object->info.albedo = config->albedo;
        BST_TRY(make_brightness(b, &config->brightness, "objects", i, &object->info.brightness));
        world->object_count = i + 1;
        if (config->occults) {
            world->occulters[world->occulter_count++] = i;
        }
        BST_TRY(make_shape(b, configs, i, object));
        BST_TRY(make_torque(b, config, i, object));
        BST_TRY(build_orbit(b, config, i, object));
        if (config->external_states) {
            BST_TRY(bst_external_states_create(b->ctx, &object->orbit.external));
        }
        if (object->info.shape &&
            start_attitude(b, config, object, object->info.shape->attitude) != BST_OK) {
            return bst_fail_prefix(b->ctx, BST_ERR_CONFIG, "%s: /world/objects/%d/attitude",
                                   b->scenario, i);
        }
        bst_name_index_add(world->object_names, object->info.name, i);
    }
    return BST_OK;
}

/* Names a catalogue object as in its file; adds the catalogue number if the name is empty or
 * taken. */
static void name_object(const bst_world *world, const bst_elements *set,
                        bst_world_object_info *info) {
    snprintf(info->name, sizeof info->name, "%s", set->name);
    if (!*info->name || bst_world_find_object(world, info->name) >= 0) {
        snprintf(info->name, sizeof info->name, "%s %d", *set->name ? set->name : "NORAD",
                 set->norad);
    }
}

/* Creates objects from element sets. Element sets that SGP4 rejects are counted and skipped: large
 * catalogues contain some. */
static bst_status build_candidates(const bst_world_builder *b, const candidate *list, int count,
                                   int first_brightness) {
    bst_world *world = b->world;
    int unusable = 0, example = 0;
    for (int i = 0; i < count; i++) {
        world_object *object = &world->objects[world->object_count];
        name_object(world, list[i].set, &object->info);
        if (bst_world_find_object(world, object->info.name) >= 0) {
            return bst_fail(b->ctx, BST_ERR_CONFIG,
                            "%s: /world/catalogues/%d: \"%s\" is the name of another object",
                            b->scenario, list[i].catalogue_index, object->info.name);
        }
        bst_status status =
            bst_world_orbit_build_sgp4(b, list[i].set, object->info.name, &object->orbit);
        if (status == BST_ERR_NUMERIC || status == BST_ERR_ARGUMENT) {
            example = unusable++ ? example : list[i].set->norad;
            memset(object, 0, sizeof *object);
            continue;
        }
        world->object_count++;
        BST_TRY(status);
        object->catalogued = true;
        object->info.norad = list[i].set->norad;
        object->info.area_m2 = list[i].catalogue->area_m2;
        object->info.albedo = list[i].catalogue->albedo;
        object->info.brightness = world->brightness[first_brightness + list[i].catalogue_index];
        bst_name_index_add(world->object_names, object->info.name, world->object_count - 1);
    }
    if (unusable > 0) {
        bst_log(b->ctx, BST_LOG_WARNING,
                "%s: /world/catalogues: %d element sets cannot be propagated and are left out "
                "(the first: satellite %d)",
                b->scenario, unusable, example);
    }
    return BST_OK;
}

/* Keeps one element set per satellite, without satellites that are listed, in the order of the
 * files. */
static int choose(candidate *list, int count, const int *listed, int listed_count) {
    qsort(list, (size_t)count, sizeof *list, compare_candidates);
    int kept = 0;
    for (int i = 0; i < count; i++) {
        int norad = list[i].set->norad;
        bool again = kept > 0 && list[kept - 1].set->norad == norad;
        if (!again &&
            !bsearch(&norad, listed, (size_t)listed_count, sizeof norad, bst_compare_ints)) {
            list[kept++] = list[i];
        }
    }
    qsort(list, (size_t)kept, sizeof *list, compare_order);
    return kept;
}

/* The element sets of the catalogue files. */
typedef struct catalogue_sets {
    bst_elements *sets[16];
    int count[16];
    int catalogues, total;
} catalogue_sets;

/* Loads the element sets of the scenario's catalogues. */
static bst_status load_sets(const bst_world_builder *b, const bst_config_list *catalogues,
                            catalogue_sets *out) {
    const bst_catalogue_config *configs = catalogues->items;
    for (int i = 0; i < catalogues->count; i++) {
        bst_world_path file = bst_world_path_join(b, configs[i].elements_file);
        bst_elements_options options = {.norad = 0};
        bst_status status =
            bst_elements_load(b->ctx, file.text, &options, &out->sets[i], &out->count[i]);
        out->catalogues = i + 1;
        if (status != BST_OK) {
            return bst_fail_prefix(b->ctx, BST_ERR_CONFIG, "%s: /world/catalogues/%d/elements_file",
                                   b->scenario, i);
        }
        out->total += out->count[i];
    }
    return BST_OK;
}

/* Lists the element sets of all catalogues with their age at the epoch. */
static bst_status list_candidates(const bst_world_builder *b, const bst_config_list *catalogues,
                                  const catalogue_sets *loaded, candidate *list) {
    int n = 0;
    for (int i = 0; i < loaded->catalogues; i++) {
        for (int k = 0; k < loaded->count[i]; k++, n++) {
            const bst_elements *set = &loaded->sets[i][k];
            bst_time epoch;
            BST_TRY(bst_time_from_utc_jd(b->ctx, set->epoch_utc_jd1, set->epoch_utc_jd2, &epoch));
            list[n] = (candidate){.set = set,
                                  .catalogue = (const bst_catalogue_config *)catalogues->items + i,
                                  .age_s = fabs(bst_time_diff(b->world->epoch, epoch)),
                                  .catalogue_index = i,
                                  .order = n};
        }
    }
    return BST_OK;
}

/* Number of satellites in all constellations. */
static int members_of(const bst_config_list *constellations) {
    const bst_constellation_config *list = constellations->items;
    int64_t count = 0;
    for (int i = 0; i < constellations->count; i++) {
        count += list[i].satellites;
    }
    return (int)count;
}

static bst_status build_member(const bst_world_builder *b, const bst_constellation_config *config,
                               int plane, int slot, const bst_brightness *brightness) {
    bst_world *world = b->world;
    world_object *object = &world->objects[world->object_count];
    bst_constellation_name(config, plane, slot, object->info.name);
    if (bst_world_find_object(world, object->info.name) >= 0) {
        return bst_fail(b->ctx, BST_ERR_CONFIG, "name: \"%s\" is the name of another object",
                        object->info.name);
    }
    const bst_elements set = bst_constellation_elements(config, world->epoch, plane, slot);
    world->object_count++;
    object->info.area_m2 = config->area_m2;
    object->info.albedo = config->albedo;
    object->info.brightness = brightness;
    BST_TRY(bst_world_orbit_build_sgp4(b, &set, object->info.name, &object->orbit));
    bst_name_index_add(world->object_names, object->info.name, world->object_count - 1);
    return BST_OK;
}

static bst_status build_constellation(const bst_world_builder *b, int index) {
    const bst_constellation_config *config =
        (const bst_constellation_config *)b->constellations->items + index;
    const bst_brightness *brightness = NULL;
    BST_TRY(refuse_shape(b, &config->brightness, "constellations", index));
    BST_TRY(make_brightness(b, &config->brightness, "constellations", index, &brightness));
    bst_status status = bst_constellation_check(b->ctx, config);
    int slots = (int)(config->satellites / config->planes);
    for (int plane = 1; plane <= config->planes && status == BST_OK; plane++) {
        for (int slot = 1; slot <= slots && status == BST_OK; slot++) {
            status = build_member(b, config, plane, slot, brightness);
        }
    }
    return status == BST_OK ? BST_OK
                            : bst_fail_prefix(b->ctx, BST_ERR_CONFIG,
                                              "%s: /world/constellations/%d", b->scenario, index);
}

/* Builds listed objects, catalogue objects and constellations. */
static bst_status build_all(const bst_world_builder *b, const bst_world_config *config,
                            const catalogue_sets *loaded, candidate *list, int *listed) {
    BST_TRY(
        reserve(b, config->objects.count + loaded->total + members_of(&config->constellations)));
    b->world->brightness = calloc((size_t)config->objects.count + (size_t)config->catalogues.count +
                                      (size_t)config->constellations.count + 1,
                                  sizeof(bst_brightness *));
    b->world->shapes = calloc((size_t)config->objects.count + 1, sizeof(bst_object_shape *));
    b->world->occulters = calloc((size_t)config->objects.count + 1, sizeof(int));
    if (!b->world->brightness || !b->world->shapes || !b->world->occulters) {
        return bst_fail(b->ctx, BST_ERR_MEMORY, "out of memory for %d objects",
                        config->objects.count);
    }
    BST_TRY(build_listed(b, &config->objects));
    int first_brightness = b->world->brightness_count;
    const bst_catalogue_config *catalogues = config->catalogues.items;
    for (int i = 0; i < config->catalogues.count; i++) {
        const bst_brightness *made;
        BST_TRY(refuse_shape(b, &catalogues[i].brightness, "catalogues", i));
        BST_TRY(make_brightness(b, &catalogues[i].brightness, "catalogues", i, &made));
    }
    for (int i = 0; i < b->world->object_count; i++) {
        listed[i] = b->world->objects[i].info.norad;
    }
    qsort(listed, (size_t)b->world->object_count, sizeof *listed, bst_compare_ints);
    BST_TRY(list_candidates(b, &config->catalogues, loaded, list));
    int count = choose(list, loaded->total, listed, b->world->object_count);
    BST_TRY(build_candidates(b, list, count, first_brightness));
    for (int i = 0; i < config->constellations.count; i++) {
        BST_TRY(build_constellation(b, i));
    }
    return BST_OK;
}

bst_status bst_world_build_objects(const bst_world_builder *b, const bst_world_config *config) {
    catalogue_sets loaded = {.total = 0};
    bst_status status = load_sets(b, &config->catalogues, &loaded);
    if (status == BST_OK) {
        candidate *list = calloc((size_t)loaded.total + 1, sizeof *list);
        int *listed = calloc((size_t)config->objects.count + 1, sizeof *listed);
        status = list && listed ? build_all(b, config, &loaded, list, listed)
                                : bst_fail(b->ctx, BST_ERR_MEMORY,
                                           "out of memory for %d element sets", loaded.total);
        free(list);
        free(listed);
    }
    for (int i = 0; i < loaded.catalogues; i++) {
        free(loaded.sets[i]);
    }
    return status;
}

bst_world_motion_law bst_world_object_motion(const bst_world *world, int object) {
    const bst_world_orbit *orbit = &world->objects[object].orbit;
    while (orbit->source == BST_ORBIT_RELATIVE) {
        orbit = orbit->reference;
    }
    return (bst_world_motion_law){
        .sgp4 = orbit->source == BST_ORBIT_SGP4,
        .bstar = orbit->bstar,
        .forces = orbit->source == BST_ORBIT_NUMERICAL ? &orbit->forces : NULL};
}
