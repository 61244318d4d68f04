/* Creates the orbits of objects and observers from their configuration. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/astro/tle.h"
#include "sim/world/external_states.h"
#include "sim/world/orbit/constellation.h"
#include "sim/world/world_build.h"

bst_status bst_world_orbit_build_sgp4(const bst_world_builder *b, const bst_elements *set,
                                      const char *name, bst_world_orbit *orbit) {
    bst_time epoch;
    BST_TRY(bst_time_from_utc_jd(b->ctx, set->epoch_utc_jd1, set->epoch_utc_jd2, &epoch));
    orbit->source = BST_ORBIT_SGP4;
    orbit->name = name;
    /* SGP4 counts uniform days of UTC: leap seconds since the element epoch do not count */
    double jd1, jd2, seconds = bst_time_diff(b->world->epoch, epoch);
    bst_time_utc(b->world->epoch, &jd1, &jd2);
    double uniform = (jd1 - set->epoch_utc_jd1 + (jd2 - set->epoch_utc_jd2)) * BST_DAY_S;
    orbit->epoch_offset_s = seconds - round(seconds - uniform);
    orbit->bstar = set->bstar;
    orbit->elements = *set;
    return bst_sgp4_create(b->ctx, set, BST_SGP4_WGS72, BST_SGP4_IMPROVED, &orbit->sgp4);
}

/* Reads the element set from the two TLE lines in the scenario. */
static bst_status build_lines(const bst_world_builder *b, const bst_orbit_config *config,
                              const char *path, const char *name, bst_world_orbit *orbit,
                              int *norad) {
    bst_elements set;
    bst_status status = bst_tle_parse(b->ctx, config->tle_line1, config->tle_line2, &set);
    if (status == BST_OK) {
        *norad = set.norad;
        status = bst_world_orbit_build_sgp4(b, &set, name, orbit);
    }
    return status == BST_OK ? BST_OK
                            : bst_fail_prefix(b->ctx, BST_ERR_CONFIG, "%s: %s", b->scenario, path);
}

static bst_status build_sgp4(const bst_world_builder *b, const bst_orbit_config *config,
                             const char *path, const char *name, bst_world_orbit *orbit,
                             int *norad) {
    bool lines = *config->tle_line1 || *config->tle_line2;
    bool file_given = *config->elements_file || config->norad != 0;
    if (lines && !file_given) {
        return build_lines(b, config, path, name, orbit, norad);
    }
    if (lines || !*config->elements_file || config->norad == 0) {
        return bst_fail(b->ctx, BST_ERR_CONFIG,
                        "%s: %s: source \"sgp4\" needs either \"elements_file\" and \"norad\", or "
                        "\"tle_line1\" and \"tle_line2\"%s",
                        b->scenario, path, lines ? "; both are given" : "");
    }
    bst_world_path file = bst_world_path_join(b, config->elements_file);
    bst_elements *sets = NULL;
    int count = 0;
    bst_elements_options options = {.norad = (int)config->norad};
    if (bst_elements_load(b->ctx, file.text, &options, &sets, &count) != BST_OK) {
        return bst_fail_prefix(b->ctx, BST_ERR_CONFIG, "%s: %s/elements_file", b->scenario, path);
    }
    /* of several element sets, the one with the nearest epoch */
    int best = 0;
    double best_offset = INFINITY;
    bst_status status = BST_OK;
    for (int i = 0; i < count && status == BST_OK; i++) {
        bst_time epoch;
        status = bst_time_from_utc_jd(b->ctx, sets[i].epoch_utc_jd1, sets[i].epoch_utc_jd2, &epoch);
        if (status == BST_OK && fabs(bst_time_diff(b->world->epoch, epoch)) < best_offset) {
            best_offset = fabs(bst_time_diff(b->world->epoch, epoch));
            best = i;
        }
    }
    if (status == BST_OK) {
        *norad = sets[best].norad;
        status = bst_world_orbit_build_sgp4(b, &sets[best], name, orbit);
    }
    free(sets);
    return status == BST_OK ? BST_OK : bst_fail_prefix(b->ctx, status, "%s: %s", b->scenario, path);
}

static bst_status build_relative(const bst_world_builder *b, const bst_orbit_config *config,
                                 const char *path, bst_world_orbit *orbit) {
    int reference = bst_world_find_object(b->world, config->reference);
    if (reference < 0) {
        return bst_fail(b->ctx, BST_ERR_CONFIG,
                        "%s: %s/reference: no object \"%s\" before this one in /world/objects",
                        b->scenario, path, config->reference);
    }
    orbit->reference = &b->world->objects[reference].orbit;
    orbit->at_s = config->at_s;
    const double *o = config->offset_rtn_m, *r = config->rate_rtn_mps;
    orbit->offset_rtn_m = (bst_vec3){o[0], o[1], o[2]};
    orbit->rate_rtn_mps = (bst_vec3){r[0], r[1], r[2]};
    return BST_OK;
}

static bst_status build_member(const bst_world_builder *b, const bst_orbit_config *config,
                               const char *path, const char *name, bst_world_orbit *orbit) {
    const bst_constellation_config *list = b->constellations->items, *found = NULL;
    for (int i = 0; i < b->constellations->count && !found; i++) {
        found = strcmp(list[i].name, config->constellation) == 0 ? &list[i] : NULL;
    }
    if (!found) {
        return bst_fail(b->ctx, BST_ERR_CONFIG,
                        "%s: %s/constellation: there is no \"%s\" in /world/constellations",
                        b->scenario, path, config->constellation);
    }
    double plane = config->member[0], slot = config->member[1];
    int64_t slots = found->satellites / found->planes;
    if (plane != floor(plane) || slot != floor(slot) || plane > (double)found->planes ||
        slot > (double)slots) {
        return bst_fail(b->ctx, BST_ERR_CONFIG,
                        "%s: %s/member: %s has no satellite %.6g-%.6g (allowed: planes 1 to %lld, "
                        "slots 1 to %lld, whole numbers)",
                        b->scenario, path, found->name, plane, slot, (long long)found->planes,
                        (long long)slots);
    }
    const bst_elements set =
        bst_constellation_elements(found, b->world->epoch, (int)plane, (int)slot);
    bst_status status = bst_world_orbit_build_sgp4(b, &set, name, orbit);
    return status == BST_OK ? BST_OK : bst_fail_prefix(b->ctx, status, "%s: %s", b->scenario, path);
}

/* Initial state of a numerical orbit from an orbit of another source. */
static bst_status state_of_other(const bst_world_builder *b, const bst_orbit_config *config,
                                 const char *path, const char *name, bst_world_state *out,
                                 int *norad) {
    const bst_initial_state_config *s = &config->state;
    bst_orbit_config other = *config;
    other.source = s->source == BST_STATE_ELEMENT_SET ? BST_ORBIT_SGP4 : BST_ORBIT_RELATIVE;
    other.at_s = s->at_s;
    const bst_config_list no_burns = {NULL, 0};
    bst_world_orbit orbit = {0};
    bst_status status = bst_world_orbit_build(b, &other, &no_burns, path, name, &orbit, norad);
    if (status == BST_OK && bst_world_orbit_state(b->ctx, &orbit, b->clock, b->world->epoch,
                                                  s->at_s, true, out) != BST_OK) {
        status = bst_fail_prefix(b->ctx, BST_ERR_CONFIG, "%s: %s/state", b->scenario, path);
    }
    bst_world_orbit_free(&orbit);
    return status;
}

static bst_status build_numerical(const bst_world_builder *b, const bst_orbit_config *config,
                                  const bst_config_list *burns, const char *path, const char *name,
                                  bst_world_orbit *orbit, int *norad) {
    bst_world_state other = {.position_m = {.x = 0.0}};
    int32_t from = config->state.source;
    BST_TRY(bst_world_orbit_make_gravity(b, &config->forces, path, &orbit->gravity));
    if (from != BST_STATE_CARTESIAN && from != BST_STATE_KEPLERIAN) {
        BST_TRY(state_of_other(b, config, path, name, &other, norad));
    }
    return bst_world_orbit_build_numerical(b, config, burns, &other, path, orbit);
}

/* Checks the burns of an orbit. `path`: "OWNER/orbit"; the burns are at "OWNER/burns". */
static bst_status check_burns(const bst_world_builder *b, const bst_config_list *list, int source,
                              const char *path) {
    const bst_burn_config *burns = list->items;
    for (int k = 0; k < list->count; k++) {
        if (burns[k].duration_s > 0.0 && source != BST_ORBIT_NUMERICAL) {
            return bst_fail(b->ctx, BST_ERR_CONFIG,
                            "%s: %.*s/burns/%d/duration_s: a burn that lasts needs an orbit of "
                            "source \"numerical\" (found %g; allowed: 0)",
                            b->scenario, (int)(strlen(path) - strlen("/orbit")), path, k,
                            burns[k].duration_s);
        }
        if (k > 0 && burns[k].time_s < burns[k - 1].time_s) {
            return bst_fail(b->ctx, BST_ERR_CONFIG,
                            "%s: %.*s/burns/%d/time_s: burns must be in the order of time "
                            "(found %g after %g)",
                            b->scenario, (int)(strlen(path) - strlen("/orbit")), path, k,
                            burns[k].time_s, burns[k - 1].time_s);
        }
    }
    return BST_OK;
}

bst_status bst_world_orbit_build(const bst_world_builder *b, const bst_orbit_config *config,
                                 const bst_config_list *burns, const char *path, const char *name,
                                 bst_world_orbit *orbit, int *norad) {
    orbit->source = config->source;
    orbit->name = name;
    *norad = 0;
    BST_TRY(check_burns(b, burns, config->source, path));
    switch (config->source) {
        case BST_ORBIT_SGP4:
            BST_TRY(build_sgp4(b, config, path, name, orbit, norad));
            break;
        case BST_ORBIT_OEM:
        case BST_ORBIT_INJECTED:
            BST_TRY(bst_world_orbit_build_file(b, config, path, orbit));
            break;
        case BST_ORBIT_CONSTELLATION:
            BST_TRY(build_member(b, config, path, name, orbit));
            break;
        case BST_ORBIT_NUMERICAL:
            return build_numerical(b, config, burns, path, name, orbit, norad);
        default:
            BST_TRY(build_relative(b, config, path, orbit));
    }
    if (burns->count > 0 && bst_world_orbit_set_burns(b->ctx, orbit, b->clock, b->world->epoch,
                                                      burns->items, burns->count) != BST_OK) {
        return bst_fail_prefix(b->ctx, BST_ERR_CONFIG, "%s: %.*s/burns", b->scenario,
                               (int)(strlen(path) - strlen("/orbit")), path);
    }
    return BST_OK;
}

void bst_world_orbit_free(bst_world_orbit *orbit) {
    bst_sgp4_free(orbit->sgp4);
    bst_trajectory_free(orbit->unburnt);
    bst_trajectory_free(orbit->burnt);
    bst_gravity_free(orbit->gravity);
    bst_external_states_free(orbit->external);
    free(orbit->burns);
}
