/* Makes the scenario document of a run from its values, and the JSON of the study. */
#include <cjson/cJSON.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/studies/study_internal.h"

/* Block of the study with the settings of its kind; NULL: none. */
static const char *block_name(const bst_study *study) {
    return study->config.kind == BST_STUDY_PD      ? "pd"
           : study->config.kind == BST_STUDY_CUBES ? "cubes"
                                                   : NULL;
}

/* ------------------------------------------------------------------ the scenarios */

/* Applies "set" of the study, with the syntax of "set" in scenarios. */
static bst_status apply_set(bst_ctx *ctx, const bst_study *study, bst_json *json) {
    const cJSON *set = cJSON_GetObjectItemCaseSensitive(bst_json_root(study->json), "set");
    if (set && !cJSON_IsObject(set)) {
        return bst_config_fail(ctx, study->file, "/set", set, "wrong type",
                               "an object of values by JSON pointer");
    }
    for (const cJSON *item = set ? set->child : NULL; item; item = item->next) {
        const char *p = item->string;
        if (*p != '/' || strlen(p) == strspn(p, "/")) {
            return bst_fail(ctx, BST_ERR_CONFIG, "%s: /set: \"%.60s\" is no JSON pointer",
                            study->file, p);
        }
        bst_status status = bst_json_assign(ctx, json, p, cJSON_Duplicate(item, 1));
        if (status != BST_OK) {
            return bst_fail_prefix(ctx, status == BST_ERR_MEMORY ? status : BST_ERR_CONFIG,
                                   "%s: /set/%.200s", study->file, p);
        }
    }
    return BST_OK;
}

static bst_status read_base(bst_ctx *ctx, const bst_study *study, const char *study_file,
                            const bst_study_scenario *config, bst_study_base *base) {
    const char *slash = strrchr(study_file, '/');
    size_t folder = config->file[0] == '/' || !slash ? 0 : (size_t)(slash + 1 - study_file);
    int n =
        snprintf(base->file, sizeof base->file, "%.*s%s", (int)folder, study_file, config->file);
    if (n < 0 || (size_t)n >= sizeof base->file) {
        return bst_fail(ctx, BST_ERR_CONFIG, "%s: the path is too long", config->file);
    }
    BST_TRY(bst_json_load_described(ctx, base->file, study->tables, &base->json));
    if (!cJSON_IsObject(bst_json_root(base->json))) {
        return bst_fail(ctx, BST_ERR_CONFIG, "%s: is no scenario", base->file);
    }
    BST_TRY(apply_set(ctx, study, base->json));
    const cJSON *name = cJSON_GetObjectItemCaseSensitive(bst_json_root(base->json), "name");
    snprintf(base->name, sizeof base->name, "%s",
             *config->name          ? config->name
             : cJSON_IsString(name) ? name->valuestring
                                    : "scenario");
    base->text = cJSON_PrintUnformatted(bst_json_root(base->json));
    return base->text ? BST_OK : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for scenarios");
}

bst_status bst_study_read_bases(bst_ctx *ctx, bst_study *study, const char *file) {
    const bst_study_scenario *list = study->config.scenarios.items;
    study->bases = calloc((size_t)study->config.scenarios.count, sizeof *study->bases);
    if (!study->bases) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for scenarios");
    }
    for (int i = 0; i < study->config.scenarios.count; i++) {
        study->base_count++;
        bst_status status = read_base(ctx, study, file, &list[i], &study->bases[i]);
        if (status != BST_OK) {
            return bst_fail_prefix(ctx, status, "%s: /scenarios/%d/file", study->file, i);
        }
    }
    return BST_OK;
}

/* ------------------------------------------------------------------ a run */

static bst_status make_document(bst_ctx *ctx, const bst_study *study, const bst_study_place *place,
                                const bst_study_value *values,
                                const bst_study_population_probe *probe, bst_json *json) {
    const char *block = block_name(study);
    char seed[24];
    if (block) {
        const cJSON *own = cJSON_GetObjectItemCaseSensitive(bst_json_root(study->json), block);
        char pointer[16];
        snprintf(pointer, sizeof pointer, "/%s", block);
        BST_TRY(bst_json_assign(ctx, json, pointer,
                                own ? cJSON_Duplicate(own, 1) : cJSON_CreateObject()));
    }
    snprintf(seed, sizeof seed, "0x%" PRIX64, study->config.seed);
    BST_TRY(bst_json_assign(ctx, json, "/seed", cJSON_CreateString(seed)));
    BST_TRY(bst_json_assign(ctx, json, "/run", cJSON_CreateNumber((double)place->run_number)));
    if (study->config.keep == BST_KEEP_TABLES) {
        BST_TRY(bst_json_assign(ctx, json, "/record/frames", cJSON_CreateString("none")));
    }
    BST_TRY(bst_study_put_all(ctx, study, values, false, json));
    return bst_study_populations_add(ctx, study, place, values, probe, json);
}

bst_status bst_study_document(bst_ctx *ctx, const bst_study *study, const bst_study_place *place,
                              const bst_study_value *values, bst_json **scenario,
                              cJSON **settings) {
    return bst_study_document_probed(ctx, study, place, values, NULL, scenario, settings);
}

bst_status bst_study_document_probed(bst_ctx *ctx, const bst_study *study,
                                     const bst_study_place *place, const bst_study_value *values,
                                     const bst_study_population_probe *probe, bst_json **scenario,
                                     cJSON **settings) {
    const bst_study_base *base = &study->bases[place->base];
    const char *block = block_name(study);
    *settings = NULL;
    BST_TRY(bst_json_copy(ctx, base->json, scenario));
    bst_status status = make_document(ctx, study, place, values, probe, *scenario);
    if (status != BST_OK) {
        bst_json_free(*scenario);
        *scenario = NULL;
        return status;
    }
    if (block) {
        *settings = cJSON_DetachItemFromObjectCaseSensitive(bst_json_root(*scenario), block);
    }
    return BST_OK;
}

/* ------------------------------------------------------------------ the study */

/* Replaces numbers by raw text that is recovered exactly, which cJSON does not guarantee. */
static void make_exact(cJSON *node) {
    for (cJSON *item = node ? node->child : NULL; item;) {
        cJSON *next = item->next;
        if (cJSON_IsNumber(item)) {
            char text[40];
            bst_study_number_text(item->valuedouble, text);
            cJSON *raw = cJSON_CreateRaw(text);
            if (raw && item->string) {
                raw->string = strdup(item->string);
            }
            cJSON_ReplaceItemViaPointer(node, item, raw);
        } else {
            make_exact(item);
        }
        item = next;
    }
}

void bst_study_number_text(double value, char text[40]) {
    for (int digits = 15; digits <= 17; digits++) {
        snprintf(text, 40, "%.*g", digits, value);
        if (strtod(text, NULL) == value) {
            return;
        }
    }
}

/* Adds values that the configuration tables do not store to the echoed study. */
static void add_raw(const bst_config_desc *table, const cJSON *given, cJSON *echo) {
    int index = 0;
    for (const bst_config_desc *d = table; d->key; d++) {
        const cJSON *own = cJSON_GetObjectItemCaseSensitive(given, d->key);
        cJSON *out = cJSON_GetObjectItemCaseSensitive(echo, d->key);
        if (d->type == BST_CONFIG_RAW) {
            cJSON *copy = own ? cJSON_Duplicate(own, 1) : cJSON_Parse(d->fallback);
            make_exact(copy);
            cJSON_AddItemToObject(echo, d->key, copy);
        } else if (d->type == BST_CONFIG_OBJECT) {
            add_raw(d->children, own, out);
        } else if (d->type == BST_CONFIG_LIST) {
            index = 0;
            for (cJSON *item = out ? out->child : NULL; item; item = item->next) {
                add_raw(d->children, cJSON_GetArrayItem(own, index++), item);
            }
        }
    }
}

cJSON *bst_study_echo(const bst_study *study) {
    cJSON *echo = bst_config_echo(bst_study_table, &study->config);
    if (!echo) {
        return NULL;
    }
    add_raw(bst_study_table, bst_json_root(study->json), echo);
    cJSON *scenarios = cJSON_GetObjectItemCaseSensitive(echo, "scenarios");
    for (int i = 0; i < study->base_count; i++) {
        cJSON_ReplaceItemInObjectCaseSensitive(cJSON_GetArrayItem(scenarios, i), "file",
                                               cJSON_CreateString(study->bases[i].file));
    }
    cJSON *populations = cJSON_GetObjectItemCaseSensitive(echo, "populations");
    for (int i = 0; i < study->populations.count; i++) {
        cJSON_ReplaceItemInObjectCaseSensitive(cJSON_GetArrayItem(populations, i), "elements_file",
                                               cJSON_CreateString(study->population_files[i].file));
    }
    const char *block = block_name(study);
    static const char *const blocks[] = {"pd", "cubes"};
    for (int i = 0; i < 2; i++) {
        if (!block || strcmp(block, blocks[i]) != 0) {
            cJSON_DeleteItemFromObjectCaseSensitive(echo, blocks[i]);
        }
    }
    return echo;
}

cJSON *bst_study_schema(void) {
    cJSON *root = cJSON_CreateObject();
    cJSON_AddStringToObject(root, "$schema", "https://json-schema.org/draft/2020-12/schema");
    cJSON_AddStringToObject(root, "title", "Boresight study");
    cJSON *body = bst_config_schema(bst_study_table);
    while (body && body->child) {
        cJSON *item = cJSON_DetachItemViaPointer(body, body->child);
        cJSON_AddItemToObject(root, item->string, item);
    }
    cJSON_Delete(body);
    cJSON *properties = cJSON_GetObjectItemCaseSensitive(root, "properties");
    cJSON_AddStringToObject(cJSON_AddObjectToObject(properties, "$schema"), "type", "string");
    return root;
}
