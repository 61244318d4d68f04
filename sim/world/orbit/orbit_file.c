/* Orbits from files of states: ephemerides (OEM) and states per frame. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/astro/kepler.h"
#include "sim/world/world_build.h"

/* Extrapolation beyond both ends of a file: for light time before the first exposure and for the
 * controller's prediction. A free-falling body continues by two-body motion (error 0.1 m at LEO
 * from oblateness). Other bodies, such as ground points, continue with their own acceleration. */
#define MARGIN_S 5.0
/* interval for the acceleration at an end */
#define ACCELERATION_S 1.0
/* Part of MARGIN_S by which per-frame states may start late or end early: their frames begin after
 * the epoch and end before the run. The remainder covers light time and prediction. */
#define IDLE_S 2.5

/* Finds a file that another object has already opened, else adds an empty entry. `key`: the path
 * with the options of reading. NULL: out of memory. */
static bst_world_file *find_file(bst_world *world, const char *key) {
    for (int i = 0; i < world->file_count; i++) {
        if (strcmp(world->files[i].key, key) == 0) {
            return &world->files[i];
        }
    }
    bst_world_file *files = realloc(world->files, ((size_t)world->file_count + 1) * sizeof *files);
    if (!files) {
        return NULL;
    }
    world->files = files;
    bst_world_file *file = &files[world->file_count];
    *file = (bst_world_file){.key = strdup(key)};
    if (!file->key) {
        return NULL;
    }
    world->file_count++;
    return file;
}

/* Opens an orbit from a CCSDS OEM ephemeris file. */
static bst_status open_oem(const bst_world_builder *b, const char *object, bst_world_file *file,
                           const char *path, bst_world_orbit *orbit) {
    if (!file->oem) {
        BST_TRY(bst_oem_load(b->ctx, path, &file->oem));
    }
    orbit->oem = file->oem;
    BST_TRY(bst_oem_find(b->ctx, orbit->oem, object, &orbit->file_object));
    bst_time start, stop;
    bst_oem_span(orbit->oem, orbit->file_object, &start, &stop);
    orbit->from_s = bst_time_diff(start, b->world->epoch);
    orbit->to_s = bst_time_diff(stop, b->world->epoch);
    return BST_OK;
}

/* Opens an orbit from injected states: a state table or frame updates. */
static bst_status open_injected(const bst_world_builder *b, const char *object,
                                bst_world_file *file, const char *path, bst_world_orbit *orbit) {
    size_t length = strlen(path);
    bool json = length > 5 && strcmp(path + length - 5, ".json") == 0;
    if (!file->injected) {
        BST_TRY(json ? bst_world_updates_injected(b, path, &file->injected)
                     : bst_state_table_load(b->ctx, path, b->world->epoch, &file->injected));
    }
    orbit->injected = file->injected;
    BST_TRY(bst_state_table_find(b->ctx, orbit->injected, object, &orbit->file_object));
    bst_state_table_span(orbit->injected, orbit->file_object, &orbit->from_s, &orbit->to_s);
    return BST_OK;
}

bst_status bst_world_orbit_build_file(const bst_world_builder *b, const bst_orbit_config *config,
                                      const char *path, bst_world_orbit *orbit) {
    bool oem = config->source == BST_ORBIT_OEM;
    const char *key = oem ? "oem_file" : "states_file";
    const char *given = oem ? config->oem_file : config->states_file;
    const char *object = oem ? config->oem_object : config->states_object;
    if (!*given) {
        return bst_fail(b->ctx, BST_ERR_CONFIG, "%s: %s: source \"%s\" needs \"%s\"", b->scenario,
                        path, oem ? "oem" : "injected", key);
    }
    bst_world_path full = bst_world_path_join(b, given);
    char name[sizeof full.text + 16];
    snprintf(name, sizeof name, "%s:%s", oem ? "oem" : "injected", full.text);
    bst_world_file *file = find_file(b->world, name);
    if (!file) {
        return bst_fail(b->ctx, BST_ERR_MEMORY, "out of memory for files of states");
    }
    orbit->in_teme = !oem && config->states_frame == BST_STATES_TEME;
    bst_status status = oem ? open_oem(b, object, file, full.text, orbit)
                            : open_injected(b, object, file, full.text, orbit);
    return status == BST_OK
               ? BST_OK
               : bst_fail_prefix(b->ctx, status == BST_ERR_MEMORY ? status : BST_ERR_CONFIG,
                                 "%s: %s/%s", b->scenario, path, key);
}

/* State of an object from its orbit file in GCRF. */
static bst_status state_within(bst_ctx *ctx, const bst_world_orbit *orbit, bst_sky_clock *clock,
                               bst_time epoch, double seconds, bst_world_state *out) {
    if (orbit->source == BST_ORBIT_OEM) {
        return bst_oem_state(ctx, orbit->oem, orbit->file_object, clock,
                             bst_time_add(epoch, seconds), &out->position_m, &out->velocity_mps);
    }
    BST_TRY(bst_state_table_state(ctx, orbit->injected, orbit->file_object, seconds,
                                  &out->position_m, &out->velocity_mps));
    if (orbit->in_teme) {
        bst_sky_rotation sky;
        BST_TRY(bst_sky_clock_at(ctx, clock, bst_time_add(epoch, seconds), &sky));
        out->position_m = bst_mat3_mul_vec(&sky.frames.gcrf_from_teme, out->position_m);
        out->velocity_mps = bst_mat3_mul_vec(&sky.frames.gcrf_from_teme, out->velocity_mps);
    }
    return BST_OK;
}

/* Extrapolates `end`, the state at the nearer end of the file, by `beyond_s`. */
static bst_status extrapolate(bst_ctx *ctx, const bst_world_orbit *orbit, bst_sky_clock *clock,
                              bst_time epoch, const bst_world_state *end, double beyond_s,
                              bst_world_state *out) {
    double end_s = beyond_s > 0.0 ? orbit->to_s : orbit->from_s;
    double step = fmin(ACCELERATION_S, orbit->to_s - orbit->from_s) * (beyond_s > 0.0 ? -1.0 : 1.0);
    double r = bst_vec3_norm(end->position_m);
    bst_vec3 gravity = bst_vec3_scale(end->position_m, -BST_EARTH_MU_M3PS2 / (r * r * r));
    bst_vec3 acceleration = gravity;
    if (fabs(step) > 1e-3 * ACCELERATION_S) {
        bst_world_state inner;
        BST_TRY(state_within(ctx, orbit, clock, epoch, end_s + step, &inner));
        acceleration =
            bst_vec3_scale(bst_vec3_sub(inner.velocity_mps, end->velocity_mps), 1.0 / step);
    }
    double other = bst_vec3_norm(bst_vec3_sub(acceleration, gravity));
    bst_ctx quiet = {0};
    if (other < 0.5 * bst_vec3_norm(gravity) &&
        bst_kepler_propagate(&quiet, BST_EARTH_MU_M3PS2, end->position_m, end->velocity_mps,
                             beyond_s, &out->position_m, &out->velocity_mps) == BST_OK) {
        return BST_OK;
    }
    out->position_m = bst_vec3_axpy(bst_vec3_axpy(end->position_m, beyond_s, end->velocity_mps),
                                    0.5 * beyond_s * beyond_s, acceleration);
    out->velocity_mps = bst_vec3_axpy(end->velocity_mps, beyond_s, acceleration);
    return BST_OK;
}

bst_status bst_world_orbit_file_state(bst_ctx *ctx, const bst_world_orbit *orbit,
                                      bst_sky_clock *clock, bst_time epoch, double seconds,
                                      bst_world_state *out) {
    double end_s = fmax(orbit->from_s, fmin(orbit->to_s, seconds));
    double beyond_s = seconds - end_s;
    if (!(fabs(beyond_s) <= MARGIN_S)) {
        end_s = seconds; /* the reader produces its own error message */
        beyond_s = 0.0;
    }
    bst_status status = state_within(ctx, orbit, clock, epoch, end_s, out);
    if (status == BST_OK && beyond_s != 0.0) {
        bst_world_state end = *out;
        status = extrapolate(ctx, orbit, clock, epoch, &end, beyond_s, out);
    }
    return status == BST_OK ? BST_OK : bst_fail_prefix(ctx, status, "orbit of %s", orbit->name);
}

/* Checks that the file of an orbit, or of its reference orbit, covers the run, also by a clock that
 * is clock_offset_s ahead. */
static bst_status check_span(bst_ctx *ctx, const char *scenario, const bst_world *world,
                             const bst_world_orbit *orbit, double duration_s, double clock_offset_s,
                             const char *path) {
    while (orbit->reference) {
        orbit = orbit->reference;
    }
    bool oem = orbit->source == BST_ORBIT_OEM;
    if (!oem && orbit->source != BST_ORBIT_INJECTED) {
        return BST_OK;
    }
    double from_s = fmin(0.0, clock_offset_s), to_s = duration_s + fmax(0.0, clock_offset_s);
    bool covers =
        oem ? bst_oem_covers(orbit->oem, orbit->file_object, bst_time_add(world->epoch, from_s),
                             bst_time_add(world->epoch, to_s))
            : orbit->from_s <= from_s + IDLE_S && orbit->to_s >= to_s - IDLE_S;
    if (covers) {
        return BST_OK;
    }
    bool gap = orbit->from_s <= from_s && orbit->to_s >= to_s;
    return bst_fail(ctx, BST_ERR_CONFIG,
                    "%s: %s: the states of \"%s\" do not cover the run (found %.6g s to %.6g s "
                    "after the epoch%s; needed: %.6g s to %.6g s%s)",
                    scenario, path, orbit->name, orbit->from_s, orbit->to_s,
                    gap ? ", with a gap" : "", from_s, to_s,
                    clock_offset_s != 0.0 ? ", with the onboard clock's offset" : "");
}

/* Rejects an onboard orbit error in RTN axes if the states of a file define no such axes: bodies at
 * rest or in vertical motion. */
static bst_status check_axes(bst_ctx *ctx, const char *scenario, const bst_world *world,
                             int observer, int sensor) {
    const bst_world_orbit *orbit = &world->observers[observer].orbit;
    const bst_orbit_error_config *e =
        &world->observers[observer].sensors[sensor].config.knowledge.orbit;
    bool across = e->position_rtn_m[1] != 0.0 || e->position_rtn_m[2] != 0.0 ||
                  e->velocity_rtn_mps[1] != 0.0 || e->velocity_rtn_mps[2] != 0.0 ||
                  e->along_track_drift_mps != 0.0;
    if (!across || (orbit->source != BST_ORBIT_OEM && orbit->source != BST_ORBIT_INJECTED)) {
        return BST_OK;
    }
    bst_sky_clock *clock;
    bst_world_state at = {0};
    BST_TRY(bst_sky_clock_create_on(ctx, world->sky_grid, &clock));
    bst_status status = bst_world_orbit_file_state(ctx, orbit, clock, world->epoch, 0.0, &at);
    bst_sky_clock_free(clock);
    BST_TRY(status);
    double h = bst_vec3_norm(bst_vec3_cross(at.position_m, at.velocity_mps));
    if (h > 1e-9 * bst_vec3_norm(at.position_m) * bst_vec3_norm(at.velocity_mps)) {
        return BST_OK;
    }
    return bst_fail(
        ctx, BST_ERR_CONFIG,
        "%s: /observers/%d/sensors/%d/knowledge/orbit: an error along the transverse or "
        "normal axis needs an orbit, but \"%s\" is at rest or moves along its radius at "
        "the epoch; give radial errors alone, or states of an orbit",
        scenario, observer, sensor, orbit->name);
}

bst_status bst_world_check_spans(bst_ctx *ctx, const char *scenario, const bst_world *world,
                                 double duration_s) {
    char path[96];
    for (int i = 0; i < world->observer_count; i++) {
        const world_observer *observer = &world->observers[i];
        for (int s = 0; s < observer->sensor_count; s++) {
            int cue = observer->sensors[s].cue_object;
            double offset_s = observer->sensors[s].config.knowledge.clock_offset_s;
            snprintf(path, sizeof path, "/observers/%d/orbit", i);
            BST_TRY(check_span(ctx, scenario, world, &observer->orbit, duration_s, offset_s, path));
            BST_TRY(check_axes(ctx, scenario, world, i, s));
            snprintf(path, sizeof path, "/observers/%d/sensors/%d/cue/object", i, s);
            if (cue >= 0) {
                BST_TRY(check_span(ctx, scenario, world, &world->objects[cue].orbit, duration_s,
                                   offset_s, path));
            }
        }
    }
    return BST_OK;
}

void bst_world_files_free(bst_world *world) {
    for (int i = 0; i < world->file_count; i++) {
        free(world->files[i].key);
        bst_oem_free(world->files[i].oem);
        bst_state_table_free(world->files[i].injected);
    }
    free(world->files);
}
