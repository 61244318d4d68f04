#define _XOPEN_SOURCE 700 /* realpath */
#include "sim/studies/study.h"

#include <cjson/cJSON.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "boresight/version.h"
#include "sim/core/fnv.h"
#include "sim/core/text.h"
#include "sim/studies/study_internal.h"

static const double MOST_RUNS = 1e9;

/* Makes a column name from the last parts of a JSON pointer. */
static void name_of_pointer(const char *pointer, int parts, char *out, size_t bytes) {
    const char *from = pointer + strlen(pointer);
    while (from > pointer && parts > 0) {
        from--;
        parts -= *from == '/';
    }
    from += *from == '/';
    snprintf(out, bytes, "%s", from);
}

static bool is_word(const char *text) {
    return *text &&
           strspn(text, "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_") ==
               strlen(text);
}

static bool same_word(const char *a, const char *b) {
    for (; *a && *b; a++, b++) {
        int x = *a >= 'A' && *a <= 'Z' ? *a + 32 : *a, y = *b >= 'A' && *b <= 'Z' ? *b + 32 : *b;
        if (x != y) {
            return false;
        }
    }
    return *a == *b;
}

static bool taken(const bst_study *study, const char *name) {
    static const char *const own[] = {"run",    "setting", "replicate", "scenario",
                                      "status", "error",   "seed",      "run_number"};
    for (size_t i = 0; i < sizeof own / sizeof *own; i++) {
        if (same_word(name, own[i])) {
            return true;
        }
    }
    for (int a = 0; a < study->axis_count; a++) {
        if (same_word(name, study->axes[a].name)) {
            return true;
        }
    }
    return false;
}

static bst_status name_axis(bst_ctx *ctx, const bst_study *study, const char *given,
                            const char *suffix, bst_study_axis *axis) {
    char path[96];
    if (*given) {
        snprintf(path, sizeof path, "%s/name", axis->where);
        if (!is_word(given) || taken(study, given)) {
            return bst_fail(ctx, BST_ERR_CONFIG,
                            "%s: %s: %s (found \"%.60s\"; allowed: letters, digits and "
                            "underscores, each name once, not that of a column of every study)",
                            study->file, path, is_word(given) ? "in use" : "no name of a column",
                            given);
        }
        snprintf(axis->name, sizeof axis->name, "%s", given);
        return BST_OK;
    }
    char name[256];
    for (int parts = 1; parts <= 8; parts++) {
        name_of_pointer(axis->path, parts, name, sizeof name);
        if (*name >= '0' && *name <= '9') {
            continue; /* an index is meaningless without the name of its list */
        }
        for (char *c = name; *c; c++) {
            *c = is_word((char[]){*c, '\0'}) ? *c : '_';
        }
        snprintf(axis->name, sizeof axis->name, "%.50s%s", name, suffix);
        if (!taken(study, axis->name)) {
            return BST_OK;
        }
    }
    snprintf(axis->name, sizeof axis->name, "axis_%d", study->axis_count);
    return BST_OK;
}

static bst_status next_axis(bst_ctx *ctx, bst_study *study, const char *where,
                            bst_study_axis **out) {
    *out = &study->axes[study->axis_count];
    if (study->axis_count == BST_STUDY_AXES) {
        return bst_fail(ctx, BST_ERR_CONFIG, "%s: more than %d axes, dispersions and populations",
                        study->file, BST_STUDY_AXES);
    }
    snprintf((*out)->where, sizeof(*out)->where, "%s", where);
    return BST_OK;
}

static bst_status add_swept_axis(bst_ctx *ctx, bst_study *study, const cJSON *node,
                                 const char *where, const bst_study_axis_config *config,
                                 bool counted) {
    bst_study_axis *axis;
    BST_TRY(next_axis(ctx, study, where, &axis));
    BST_TRY(bst_study_read_axis(ctx, study, node, axis));
    BST_TRY(name_axis(ctx, study, config->name, "", axis));
    study->axis_count++;
    axis->axis = config;
    bool range = config->from != config->to || config->count > 0;
    if (axis->values ? range : !range) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "%s: %s: give either a list of \"values\" or a range, \"from\" and "
                        "\"to\"%s",
                        study->file, where, counted ? " with a \"count\"" : "");
    }
    if (axis->values) {
        return BST_OK;
    }
    if (counted && config->count < 2) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "%s: %s/count: a range needs at least 2 values (found %" PRId64 ")",
                        study->file, where, config->count);
    }
    if (!counted && config->count > 0) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "%s: %s/count: not for this design, which has \"points\" or \"levels\" of "
                        "the sweep",
                        study->file, where);
    }
    return bst_study_check_range(ctx, study, where, config->from, config->to,
                                 config->spacing == BST_SPACING_LOG, true);
}

static bst_status add_factor(bst_ctx *ctx, bst_study *study, const bst_study_factor *factor) {
    bst_study_factor *list =
        realloc(study->factors, ((size_t)study->factor_count + 1) * sizeof *list);
    if (!list) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the study");
    }
    study->factors = list;
    list[study->factor_count++] = *factor;
    return BST_OK;
}

static int64_t levels_of(const bst_study_axis *axis) {
    return axis->values ? axis->value_count : axis->axis->count;
}

static bst_status add_sweep(bst_ctx *ctx, bst_study *study, const cJSON *node, int index) {
    const bst_study_sweep_config *sweep =
        (const bst_study_sweep_config *)study->config.sweeps.items + index;
    const cJSON *axes = cJSON_GetObjectItemCaseSensitive(node, "axes");
    bool placed = sweep->design == BST_SWEEP_LATIN_HYPERCUBE || sweep->design == BST_SWEEP_MORRIS;
    bst_study_factor factor = {
        .design = sweep->design, .sweep = index, .first_axis = study->axis_count};
    if (sweep->design == BST_SWEEP_LATIN_HYPERCUBE ? sweep->points < 2 : sweep->points > 0) {
        return bst_fail(
            ctx, BST_ERR_CONFIG, "%s: /sweeps/%d/points: %s (found %" PRId64 ")", study->file,
            index,
            sweep->points ? "only for a latin_hypercube" : "a latin_hypercube needs at least 2",
            sweep->points);
    }
    for (int a = 0; a < sweep->axes.count; a++) {
        char where[64];
        snprintf(where, sizeof where, "/sweeps/%d/axes/%d", index, a);
        BST_TRY(add_swept_axis(ctx, study, cJSON_GetArrayItem(axes, a), where,
                               (const bst_study_axis_config *)sweep->axes.items + a, !placed));
        const bst_study_axis *axis = &study->axes[study->axis_count - 1];
        if (sweep->design == BST_SWEEP_GRID) {
            factor.first_axis = study->axis_count - 1;
            factor.axis_count = 1;
            factor.levels = levels_of(axis);
            BST_TRY(add_factor(ctx, study, &factor));
        } else if (sweep->design == BST_SWEEP_LIST && a > 0 && levels_of(axis) != factor.levels) {
            return bst_fail(ctx, BST_ERR_CONFIG,
                            "%s: %s: the axes of a list go side by side: %" PRId64
                            " values here, %" PRId64 " on the first",
                            study->file, where, levels_of(axis), factor.levels);
        } else if (sweep->design == BST_SWEEP_LIST) {
            factor.levels = levels_of(axis);
        } else if (sweep->design == BST_SWEEP_ONE_AT_A_TIME) {
            factor.levels += levels_of(axis);
        }
    }
    if (sweep->design == BST_SWEEP_GRID) {
        return BST_OK;
    }
    factor.axis_count = sweep->axes.count;
    factor.levels += sweep->design == BST_SWEEP_ONE_AT_A_TIME;
    if (placed) {
        BST_TRY(bst_study_place_points(ctx, study, sweep, &factor));
    }
    bst_status status = add_factor(ctx, study, &factor);
    if (status != BST_OK) {
        free(factor.unit);
    }
    return status;
}

static bst_status add_dispersion(bst_ctx *ctx, bst_study *study, const cJSON *node, int index) {
    const bst_study_dispersion_config *c =
        (const bst_study_dispersion_config *)study->config.dispersions.items + index;
    static const char *const suffixes[] = {"", "_offset", "_factor"};
    bst_study_axis *axis;
    char where[64];
    snprintf(where, sizeof where, "/dispersions/%d", index);
    BST_TRY(next_axis(ctx, study, where, &axis));
    BST_TRY(bst_study_read_dispersion(ctx, study, node, c, axis));
    BST_TRY(name_axis(ctx, study, c->name, suffixes[c->apply], axis));
    study->axis_count++;
    for (int a = study->swept_count; a < study->axis_count - 1; a++) {
        if (strcmp(study->axes[a].path, axis->path) == 0) {
            return bst_fail(ctx, BST_ERR_CONFIG, "%s: %s/path: \"%s\" is dispersed by %s already",
                            study->file, where, axis->path, study->axes[a].where);
        }
    }
    return BST_OK;
}

/* Adds the number of objects of each population as a value of a run. */
static bst_status add_populations(bst_ctx *ctx, bst_study *study, const char *file) {
    BST_TRY(bst_study_populations_open(ctx, study, file));
    for (int i = 0; i < study->populations.count; i++) {
        const bst_study_population *p = &study->populations.items[i];
        bst_study_axis *axis;
        BST_TRY(next_axis(ctx, study, p->where, &axis));
        if (!is_word(p->config.name)) {
            return bst_fail(ctx, BST_ERR_CONFIG,
                            "%s: %s/name: no name of a column (found \"%.60s\"; allowed: letters, "
                            "digits and underscores)",
                            study->file, p->where, p->config.name);
        }
        BST_TRY(name_axis(ctx, study, p->config.name, "", axis));
        axis->path = "/world/objects";
        axis->population = i + 1;
        study->axis_count++;
    }
    return BST_OK;
}

static bst_status add_axes(bst_ctx *ctx, bst_study *study, const char *file) {
    const cJSON *root = bst_json_root(study->json);
    const cJSON *sweeps = cJSON_GetObjectItemCaseSensitive(root, "sweeps");
    const cJSON *dispersions = cJSON_GetObjectItemCaseSensitive(root, "dispersions");
    study->axes = calloc(BST_STUDY_AXES, sizeof *study->axes);
    if (!study->axes) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the study");
    }
    BST_TRY(add_factor(ctx, study, &(bst_study_factor){.design = -1, .levels = study->base_count}));
    for (int i = 0; i < study->config.sweeps.count; i++) {
        BST_TRY(add_sweep(ctx, study, cJSON_GetArrayItem(sweeps, i), i));
    }
    study->swept_count = study->axis_count;
    for (int i = 0; i < study->config.dispersions.count; i++) {
        BST_TRY(add_dispersion(ctx, study, cJSON_GetArrayItem(dispersions, i), i));
    }
    BST_TRY(add_populations(ctx, study, file));
    double runs = (double)study->config.replicates;
    study->settings = 1;
    for (int f = 0; f < study->factor_count; f++) {
        runs *= (double)study->factors[f].levels;
        if (runs > MOST_RUNS) {
            return bst_fail(ctx, BST_ERR_CONFIG,
                            "%s: the study has more than %.0f runs; take fewer values, points or "
                            "replicates",
                            study->file, MOST_RUNS);
        }
        study->settings *= study->factors[f].levels;
    }
    study->runs = study->settings * study->config.replicates;
    return BST_OK;
}

/* Hashes a text with a terminating byte that no text contains. */
static uint64_t hash_text(uint64_t h, const char *text) {
    return bst_fnv(bst_fnv(h, text, strlen(text)), "\xff", 1);
}

/* Hashes everything that affects the rows, but not output options or file locations. */
static bst_status set_digest(bst_ctx *ctx, bst_study *study) {
    static const char *const without[] = {"scenarios", "metrics", "resamples", "keep", "name"};
    uint64_t h = hash_text(BST_FNV_START, bst_version());
    cJSON *echo = bst_study_echo(study);
    for (size_t i = 0; echo && i < sizeof without / sizeof *without; i++) {
        cJSON_DeleteItemFromObjectCaseSensitive(echo, without[i]);
    }
    cJSON *populations = cJSON_GetObjectItemCaseSensitive(echo, "populations");
    for (int i = 0; i < study->populations.count; i++) {
        cJSON_DeleteItemFromObjectCaseSensitive(cJSON_GetArrayItem(populations, i),
                                                "elements_file");
    }
    char *text = echo ? cJSON_PrintUnformatted(echo) : NULL;
    cJSON_Delete(echo);
    if (!text) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the study");
    }
    h = hash_text(h, text);
    free(text);
    for (int i = 0; i < study->base_count; i++) {
        h = hash_text(h, study->bases[i].text);
    }
    for (int i = 0; i < study->populations.count; i++) {
        const bst_study_population_file *of = &study->population_files[i];
        h = bst_fnv(h, of->norad, (size_t)of->count * sizeof *of->norad);
    }
    snprintf(study->digest, sizeof study->digest, "%016" PRIx64, h);
    return BST_OK;
}

static bst_status open_study(bst_ctx *ctx, const char *file, bst_study *study) {
    snprintf(study->file, sizeof study->file, "%s", file);
    BST_TRY(bst_json_load(ctx, file, &study->json));
    BST_TRY(bst_study_rename(ctx, study));
    BST_TRY(bst_config_read(ctx, study->json, bst_json_root(study->json), "", bst_study_table,
                            &study->config));
    if (!bst_text_is_file_name(study->config.name) || strchr(study->config.name, ' ')) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "%s: /name: \"%s\" cannot be the name of a folder (allowed: 1 to 63 bytes "
                        "without blanks, \"/\" and control characters, not beginning with \".\")",
                        file, study->config.name);
    }
    char *full = realpath(file, NULL);
    bst_status status = bst_study_read_bases(ctx, study, full ? full : file);
    if (status == BST_OK) {
        status = add_axes(ctx, study, full ? full : file);
    }
    free(full);
    return status == BST_OK ? set_digest(ctx, study) : status;
}

bst_status bst_study_open(bst_ctx *ctx, const char *file, const bst_document_tables *tables,
                          bst_study *out) {
    memset(out, 0, sizeof *out);
    out->tables = tables;
    bst_status status = open_study(ctx, file, out);
    if (status != BST_OK) {
        bst_study_close(out);
    }
    return status;
}

void bst_study_close(bst_study *study) {
    for (int i = 0; i < study->base_count; i++) {
        bst_json_free(study->bases[i].json);
        free(study->bases[i].text);
    }
    free(study->bases);
    bst_study_populations_close(study);
    for (int i = 0; study->axes && i < BST_STUDY_AXES; i++) {
        free(study->axes[i].cumulative);
    }
    free(study->axes);
    for (int i = 0; i < study->factor_count; i++) {
        free(study->factors[i].unit);
    }
    free(study->factors);
    bst_config_free(bst_study_table, &study->config);
    bst_json_free(study->json);
    memset(study, 0, sizeof *study);
}
