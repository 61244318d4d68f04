/* Populations of a study: objects whose number, orbits and brightness are drawn for each run. */
#include <cjson/cJSON.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "boresight/rng.h"
#include "sim/astro/tle.h"
#include "sim/core/compare.h"
#include "sim/core/text.h"
#include "sim/studies/study_internal.h"

/* separate counter range per object, for redraws */
#define OBJECT_COUNTER(k) ((uint64_t)(k) << 16)
enum { MOST_ATTEMPTS = 1 << 16 };
/* limit of the values in a population's objects */
static const double MOST_VALUES = 8e6;

/* ------------------------------------------------------------------ reading */

static bst_status check_number(bst_ctx *ctx, const bst_study *study,
                               const bst_study_population *p) {
    const bst_study_number_config *n = &p->config.number;
    if (n->distribution == BST_NUMBER_UNIFORM && n->from > n->to) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "%s: %s/number: from %lld to %lld is no range (allowed: \"from\" at most "
                        "\"to\")",
                        study->file, p->where, (long long)n->from, (long long)n->to);
    }
    if (n->distribution == BST_NUMBER_POISSON && n->mean > (double)n->max) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "%s: %s/number/max: less than the mean (found %lld; allowed: %g or more)",
                        study->file, p->where, (long long)n->max, n->mean);
    }
    return BST_OK;
}

static double count_values(const cJSON *node) {
    double count = 1.0;
    for (const cJSON *item = node ? node->child : NULL; item; item = item->next) {
        count += count_values(item);
    }
    return count;
}

static bst_status check_object(bst_ctx *ctx, const bst_study *study,
                               const bst_study_population *p) {
    char path[64];
    snprintf(path, sizeof path, "%s/object", p->where);
    if (p->object && !cJSON_IsObject(p->object)) {
        return bst_config_fail(ctx, study->file, path, p->object, "wrong type",
                               "an object with the keys of /world/objects[] of a scenario");
    }
    if (cJSON_GetObjectItemCaseSensitive(p->object, "name")) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "%s: %s/name: the objects are called %s_1, %s_2 and so on; leave it out",
                        study->file, path, p->config.name, p->config.name);
    }
    double reach[2];
    bst_study_population_reach(p, reach);
    if (reach[1] * count_values(p->object) > MOST_VALUES) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "%s: %s: %.0f objects of %.0f values each (allowed: %.0f values in all)",
                        study->file, p->where, reach[1], count_values(p->object), MOST_VALUES);
    }
    bool orbit = cJSON_GetObjectItemCaseSensitive(p->object, "orbit") != NULL;
    if (orbit == (*p->config.elements_file != '\0')) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "%s: %s: %s (allowed: either \"orbit\" in \"object\", or "
                        "\"elements_file\")",
                        study->file, p->where, orbit ? "two orbits are given" : "without an orbit");
    }
    return BST_OK;
}

static bst_status read_one(bst_ctx *ctx, const bst_study *study, const bst_json *json,
                           const cJSON *node, bst_study_population *out) {
    BST_TRY(bst_config_read(ctx, json, node, out->where, bst_population_table, &out->config));
    out->object = cJSON_GetObjectItemCaseSensitive(node, "object");
    BST_TRY(check_number(ctx, study, out));
    BST_TRY(check_object(ctx, study, out));
    int count = out->config.dispersions.count;
    const bst_study_dispersion_config *list = out->config.dispersions.items;
    out->axes = calloc((size_t)count + 1, sizeof *out->axes);
    if (!out->axes) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the study's populations");
    }
    const cJSON *dispersions = cJSON_GetObjectItemCaseSensitive(node, "dispersions");
    for (int i = 0; i < count; i++) {
        snprintf(out->axes[i].where, sizeof out->axes[i].where, "%s/dispersions/%d", out->where, i);
        BST_TRY(bst_study_read_dispersion(ctx, study, cJSON_GetArrayItem(dispersions, i), &list[i],
                                          &out->axes[i]));
        snprintf(out->axes[i].name, sizeof out->axes[i].name, "%.60s", out->axes[i].path);
        for (int k = 0; k < i; k++) {
            if (strcmp(out->axes[k].path, out->axes[i].path) == 0) {
                return bst_fail(ctx, BST_ERR_CONFIG,
                                "%s: %s/path: \"%s\" is dispersed by %s already", study->file,
                                out->axes[i].where, out->axes[i].path, out->axes[k].where);
            }
        }
    }
    return BST_OK;
}

bst_status bst_study_populations_read(bst_ctx *ctx, const bst_study *study, const bst_json *json,
                                      bst_study_population_list *out) {
    const cJSON *list = cJSON_GetObjectItemCaseSensitive(bst_json_root(json), "populations");
    *out = (bst_study_population_list){0};
    if (cJSON_GetArraySize(list) == 0) {
        return BST_OK;
    }
    out->items = calloc((size_t)cJSON_GetArraySize(list), sizeof *out->items);
    if (!out->items) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the study's populations");
    }
    for (const cJSON *node = list->child; node; node = node->next) {
        bst_study_population *p = &out->items[out->count];
        snprintf(p->where, sizeof p->where, "/populations/%d", out->count++);
        bst_status status = read_one(ctx, study, json, node, p);
        if (status != BST_OK) {
            bst_study_populations_free(out);
            return status;
        }
    }
    return BST_OK;
}

void bst_study_populations_free(bst_study_population_list *list) {
    for (int i = 0; i < list->count; i++) {
        bst_study_population *p = &list->items[i];
        for (int d = 0; p->axes && d < p->config.dispersions.count; d++) {
            free(p->axes[d].cumulative);
        }
        free(p->axes);
        bst_config_free(bst_population_table, &p->config);
    }
    free(list->items);
    bst_json_free(list->json);
    *list = (bst_study_population_list){0};
}

/* Reads the satellites of a population's file; a relative path starts at the folder of
 * `study_file`. */
static bst_status read_file(bst_ctx *ctx, const bst_study *study, const char *study_file,
                            const bst_study_population *p, bst_study_population_file *out) {
    const char *given = p->config.elements_file, *slash = strrchr(study_file, '/');
    bst_elements *sets = NULL;
    int count = 0;
    if (!*given) {
        return BST_OK;
    }
    size_t folder = *given == '/' || !slash ? 0 : (size_t)(slash + 1 - study_file);
    int n = snprintf(out->file, sizeof out->file, "%.*s%s", (int)folder, study_file, given);
    if (n < 0 || (size_t)n >= sizeof out->file) {
        return bst_fail(ctx, BST_ERR_CONFIG, "%s: %s/elements_file: the path is too long",
                        study->file, p->where);
    }
    bst_status status = bst_elements_load(ctx, out->file, NULL, &sets, &count);
    if (status != BST_OK) {
        return bst_fail_prefix(ctx, status, "%s: %s/elements_file", study->file, p->where);
    }
    out->norad = malloc((size_t)count * sizeof *out->norad);
    for (int i = 0; out->norad && i < count; i++) {
        out->norad[i] = sets[i].norad;
    }
    free(sets);
    if (!out->norad) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the study's populations");
    }
    qsort(out->norad, (size_t)count, sizeof *out->norad, bst_compare_ints);
    for (int i = 0; i < count; i++) {
        if (out->count == 0 || out->norad[out->count - 1] != out->norad[i]) {
            out->norad[out->count++] = out->norad[i];
        }
    }
    return BST_OK;
}

bst_status bst_study_populations_open(bst_ctx *ctx, bst_study *study, const char *study_file) {
    BST_TRY(bst_study_populations_read(ctx, study, study->json, &study->populations));
    int count = study->populations.count;
    study->population_files = calloc((size_t)count + 1, sizeof *study->population_files);
    if (!study->population_files) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the study's populations");
    }
    for (int i = 0; i < count; i++) {
        BST_TRY(read_file(ctx, study, study_file, &study->populations.items[i],
                          &study->population_files[i]));
    }
    for (int a = 0; a < study->axis_count; a++) {
        const bst_study_axis *axis = &study->axes[a];
        bool varies = bst_study_population_pointer(axis->path);
        for (const cJSON *also = axis->linked_paths ? axis->linked_paths->child : NULL; also;
             also = also->next) {
            varies = varies || bst_study_population_pointer(also->valuestring);
        }
        study->populations_vary = study->populations_vary || varies;
    }
    return BST_OK;
}

void bst_study_populations_close(bst_study *study) {
    for (int i = 0; study->population_files && i < study->populations.count; i++) {
        free(study->population_files[i].norad);
    }
    free(study->population_files);
    bst_study_populations_free(&study->populations);
}

/* ------------------------------------------------------------------ a run's populations */

bst_status bst_study_populations_of(bst_ctx *ctx, const bst_study *study,
                                    const bst_study_value *values, bst_study_population_list *own,
                                    const bst_study_population_list **out) {
    *own = (bst_study_population_list){0};
    *out = &study->populations;
    if (!study->populations_vary) {
        return BST_OK;
    }
    bst_json *json;
    BST_TRY(bst_json_copy(ctx, study->json, &json));
    bst_status status = bst_study_put_all(ctx, study, values, true, json);
    if (status == BST_OK) {
        status = bst_study_populations_read(ctx, study, json, own);
    }
    if (status != BST_OK) {
        bst_json_free(json);
        return status;
    }
    own->json = json;
    *out = own;
    for (int i = 0; i < own->count && status == BST_OK; i++) {
        const bst_study_population *was = &study->populations.items[i], *now = &own->items[i];
        if (strcmp(now->config.elements_file, was->config.elements_file) != 0 ||
            strcmp(now->config.name, was->config.name) != 0) {
            status = bst_fail(ctx, BST_ERR_CONFIG,
                              "%s: %s: \"name\" and \"elements_file\" cannot be varied; make a "
                              "population of each and vary their numbers",
                              study->file, now->where);
        }
    }
    if (status != BST_OK) {
        bst_study_populations_free(own);
    }
    return status;
}

/* Poisson quantile by inversion: Devroye 1986, Non-Uniform Random Variate Generation, X.3.1. */
static int64_t poisson(double mean, double u) {
    double term = exp(-mean), sum = term, reach = mean + 40.0 * sqrt(mean) + 100.0;
    int64_t k = 0;
    while (u >= sum && (double)k < reach) { /* rounding may keep the sum below u */
        term *= mean / (double)++k;
        sum += term;
    }
    return k;
}

static int64_t draw_number(const bst_study *study, const bst_study_population *p,
                           uint64_t counter) {
    const bst_study_number_config *n = &p->config.number;
    bst_rng_key key = bst_rng_make_key(study->config.seed, 0, p->config.name, "population number");
    double u = bst_rng_uniform(key, counter, 0);
    if (n->distribution == BST_NUMBER_FIXED) {
        return n->count;
    }
    if (n->distribution == BST_NUMBER_UNIFORM) {
        double span = (double)(n->to - n->from + 1);
        return n->from + (int64_t)fmin(floor(u * span), span - 1.0);
    }
    int64_t k = poisson(n->mean, u);
    for (uint64_t b = 1; k > n->max; b++) { /* at least half of the draws are within the limit */
        k = poisson(n->mean, bst_rng_uniform(key, counter, b));
    }
    return k;
}

void bst_study_population_numbers(const bst_study *study, uint64_t counter,
                                  bst_study_value *values) {
    bst_ctx quiet = {0};
    bst_study_population_list own;
    const bst_study_population_list *list;
    int first = study->axis_count - study->populations.count;
    bool read = bst_study_populations_of(&quiet, study, values, &own, &list) == BST_OK;
    for (int i = 0; i < study->populations.count; i++) {
        /* the document reports an unreadable value */
        values[first + i] =
            read ? (bst_study_value){true, true,
                                     (double)draw_number(study, &list->items[i], counter), NULL}
                 : (bst_study_value){.given = false};
    }
    bst_study_populations_free(&own);
}

void bst_study_population_reach(const bst_study_population *p, double ends[2]) {
    const bst_study_number_config *n = &p->config.number;
    bool uniform = n->distribution == BST_NUMBER_UNIFORM;
    ends[0] = (double)(n->distribution == BST_NUMBER_FIXED ? n->count : uniform ? n->from : 0);
    ends[1] = (double)(n->distribution == BST_NUMBER_FIXED ? n->count : uniform ? n->to : n->max);
}

/* ------------------------------------------------------------------ satellites of a file */

/* Catalogue number of an "orbit"; 0: none. */
static int number_of(const cJSON *orbit) {
    const cJSON *norad = cJSON_GetObjectItemCaseSensitive(orbit, "norad");
    const cJSON *line = cJSON_GetObjectItemCaseSensitive(orbit, "tle_line1");
    int number = cJSON_IsNumber(norad) ? norad->valueint : 0;
    if (cJSON_IsString(line) && strlen(line->valuestring) > 6 &&
        !bst_tle_decode_number(line->valuestring + 2, &number)) {
        number = 0;
    }
    return number;
}

/* Marks the satellite of an object or observer as used; *left: number of unused satellites. */
static void mark(const cJSON *owner, const bst_study_population_file *file, bool *taken,
                 int *left) {
    int number = number_of(cJSON_GetObjectItemCaseSensitive(owner, "orbit"));
    const int *found =
        bsearch(&number, file->norad, (size_t)file->count, sizeof number, bst_compare_ints);
    if (found && !taken[found - file->norad]) {
        taken[found - file->norad] = true;
        (*left)--;
    }
}

/* Marks the satellites of the file that the scenario already has, including observers; the caller
 * frees the list. */
static bool *mark_all(const bst_json *json, const bst_study_population_file *file, int *left) {
    bool *taken = calloc((size_t)file->count + 1, sizeof *taken);
    const cJSON *lists[] = {bst_study_at(bst_json_root(json), "/world/objects"),
                            bst_study_at(bst_json_root(json), "/observers")};
    *left = file->count;
    for (int l = 0; taken && l < 2; l++) {
        for (const cJSON *item = lists[l] ? lists[l]->child : NULL; item; item = item->next) {
            mark(item, file, taken, left);
        }
    }
    return taken;
}

static int draw_satellite(const bst_study *study, const bst_study_population *p,
                          const bst_study_population_file *file, uint64_t counter, int k,
                          bool *taken) {
    bst_rng_key key =
        bst_rng_make_key(study->config.seed, 0, p->config.name, "population satellite");
    double n = file->count;
    int i = 0;
    for (uint64_t b = 0; b < MOST_ATTEMPTS; b++) {
        i = (int)fmin(bst_rng_uniform(key, counter, OBJECT_COUNTER(k) + b) * n, n - 1.0);
        if (!taken[i]) {
            break;
        }
    }
    while (taken[i]) { /* almost all satellites of a large file are used */
        i = (i + 1) % file->count;
    }
    taken[i] = true;
    return file->norad[i];
}

static cJSON *satellite_orbit(const bst_study_population_file *file, int norad) {
    cJSON *orbit = cJSON_CreateObject();
    cJSON_AddStringToObject(orbit, "source", "sgp4");
    cJSON_AddStringToObject(orbit, "elements_file", file->file);
    cJSON_AddNumberToObject(orbit, "norad", norad);
    return orbit;
}

/* ------------------------------------------------------------------ objects of a run */

/* Value of one dispersion of a population for object k. */
static bst_study_value draw_of(const bst_study *study, const bst_study_population *p,
                               int dispersion, uint64_t counter, int k) {
    const bst_study_axis *axis = &p->axes[dispersion];
    char stream[340];
    snprintf(stream, sizeof stream, "population %s", axis->path);
    bst_rng_key key = bst_rng_make_key(study->config.seed, 0, p->config.name, stream);
    return bst_study_draw(axis, key, counter, OBJECT_COUNTER(k));
}

static bst_status disperse(bst_ctx *ctx, const bst_study *study, const bst_study_population *p,
                           const bst_study_value *drawn, int dispersion, int index,
                           bst_json *json) {
    const bst_study_axis *axis = &p->axes[dispersion];
    const cJSON *also = axis->linked_paths ? axis->linked_paths->child : NULL;
    const char *own = axis->path;
    while (own) {
        char pointer[512];
        int n = snprintf(pointer, sizeof pointer, "/world/objects/%d%s", index, own);
        if (n < 0 || (size_t)n >= sizeof pointer) {
            return bst_fail(ctx, BST_ERR_CONFIG, "%s: %s: a pointer is too long", study->file,
                            axis->where);
        }
        BST_TRY(bst_study_put(ctx, study, axis, drawn, pointer, json));
        own = also ? also->valuestring : NULL;
        also = also ? also->next : NULL;
    }
    return BST_OK;
}

/* Finds the list of objects in a scenario; creates it if necessary. */
static bst_status find_objects(bst_ctx *ctx, const bst_study *study, const bst_study_population *p,
                               bst_json *json, cJSON **out) {
    const cJSON *found = bst_study_at(bst_json_root(json), "/world/objects");
    if (!found) {
        BST_TRY(bst_json_assign(ctx, json, "/world/objects", cJSON_CreateArray()));
        found = bst_study_at(bst_json_root(json), "/world/objects");
    }
    *out = (cJSON *)found; /* the caller may change the document */
    return cJSON_IsArray(found)
               ? BST_OK
               : bst_fail(ctx, BST_ERR_CONFIG, "%s: %s: /world/objects of %s is no list",
                          study->file, p->where, bst_json_name(json));
}

static bst_status add_object(bst_ctx *ctx, const bst_study_population *p, const cJSON *orbit, int k,
                             cJSON *objects) {
    char name[64];
    cJSON *object = p->object ? cJSON_Duplicate(p->object, 1) : cJSON_CreateObject();
    snprintf(name, sizeof name, "%s_%d", p->config.name, k + 1);
    if (!object || !cJSON_AddStringToObject(object, "name", name) ||
        (orbit && !cJSON_AddItemToObject(object, "orbit", cJSON_Duplicate(orbit, 1)))) {
        cJSON_Delete(object);
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the objects of a run");
    }
    cJSON_AddItemToArray(objects, object);
    return BST_OK;
}

/* A population of a run and its number of objects. */
typedef struct wanted {
    const bst_study_population *population;
    const bst_study_population_file *file;
    int number;
    uint64_t counter;                        /* counter of the random numbers: the run number */
    const bst_study_population_probe *probe; /* NULL: none */
} wanted;

static bst_status add_population(bst_ctx *ctx, const bst_study *study, const wanted *w,
                                 bst_json *json) {
    const bst_study_population *p = w->population;
    const bst_study_population_file *file = w->file;
    const bst_study_population_probe *probe = w->probe;
    int number = w->number;
    uint64_t counter = w->counter;
    cJSON *objects;
    int left = 0;
    BST_TRY(find_objects(ctx, study, p, json, &objects));
    bool *taken = *file->file ? mark_all(json, file, &left) : NULL;
    int first = cJSON_GetArraySize(objects);
    bst_status status = BST_OK;
    if (*file->file && (!taken || left < number)) {
        status = taken ? bst_fail(ctx, BST_ERR_CONFIG,
                                  "%s: %s/number: %s of the %d satellites in %s, of which the "
                                  "scenario has %d already",
                                  study->file, p->where,
                                  bst_text_of_count((char[BST_COUNT_TEXT]){0}, number, "object",
                                                    "objects"),
                                  file->count, file->file, file->count - left)
                       : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the objects of a run");
    }
    for (int k = 0; k < number && status == BST_OK; k++) {
        cJSON *orbit =
            taken ? satellite_orbit(file, draw_satellite(study, p, file, counter, k, taken)) : NULL;
        status = add_object(ctx, p, orbit, k, objects);
        cJSON_Delete(orbit);
        for (int d = 0; d < p->config.dispersions.count && status == BST_OK; d++) {
            bool probed = probe && k == 0;
            if (probed && d != probe->dispersion) {
                continue; /* only the probe shall cause errors */
            }
            bst_study_value drawn = probed ? probe->value : draw_of(study, p, d, counter, k);
            status = disperse(ctx, study, p, &drawn, d, first + k, json);
        }
    }
    free(taken);
    return status;
}

bst_status bst_study_populations_add(bst_ctx *ctx, const bst_study *study,
                                     const bst_study_place *place, const bst_study_value *values,
                                     const bst_study_population_probe *probe, bst_json *json) {
    bst_study_population_list own;
    const bst_study_population_list *list;
    int first = study->axis_count - study->populations.count;
    BST_TRY(bst_study_populations_of(ctx, study, values, &own, &list));
    bst_status status = BST_OK;
    for (int i = 0; i < list->count && status == BST_OK; i++) {
        const bst_study_value *number = &values[first + i];
        const bst_study_population_probe *own_probe =
            probe && probe->population == i ? probe : NULL;
        int count = number->given ? (int)number->number : 0;
        count = own_probe && count == 0 ? 1 : count;
        const wanted w = {&list->items[i], &study->population_files[i], count, place->run_number,
                          own_probe};
        status = count > 0 ? add_population(ctx, study, &w, json) : BST_OK;
    }
    bst_study_populations_free(&own);
    return status;
}
