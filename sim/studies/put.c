/* Inserts the values of a run at their JSON pointers in the scenario. */
#include <cjson/cJSON.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/studies/study_internal.h"

bool bst_study_population_pointer(const char *pointer) {
    return strncmp(pointer, "/populations/", strlen("/populations/")) == 0;
}

static bst_status fail_axis(bst_ctx *ctx, const bst_study *study, const bst_study_axis *axis,
                            bst_status status) {
    return bst_fail_prefix(ctx, status == BST_ERR_MEMORY ? status : BST_ERR_CONFIG, "%s: %s",
                           study->file, axis->where);
}

const cJSON *bst_study_at(const cJSON *node, const char *pointer) {
    char part[256];
    while (node && *pointer == '/') {
        pointer += strspn(pointer, "/");
        size_t n = strcspn(pointer, "/");
        if (n == 0 || n >= sizeof part) {
            return n == 0 ? node : NULL;
        }
        snprintf(part, sizeof part, "%.*s", (int)n, pointer);
        node = cJSON_IsArray(node) && strspn(part, "0123456789") == n && n < 10
                   ? cJSON_GetArrayItem(node, (int)strtol(part, NULL, 10))
                   : cJSON_GetObjectItemCaseSensitive(node, part);
        pointer += n;
    }
    return node;
}

/* Reads the present number at a pointer. */
static bst_status present_number(bst_ctx *ctx, const bst_study *study, const bst_study_axis *axis,
                                 const bst_json *json, const char *pointer, double *out) {
    const cJSON *node = bst_study_at(bst_json_root(json), pointer);
    if (!cJSON_IsNumber(node)) {
        bst_fail(ctx, BST_ERR_CONFIG,
                 "%s has no number that could be %s: it is %s in %s; state it in the scenario or "
                 "in \"set\"",
                 pointer, axis->dispersion->apply == BST_APPLY_ADD ? "added to" : "multiplied",
                 node ? "something else" : "not given", bst_json_name(json));
        return fail_axis(ctx, study, axis, BST_ERR_CONFIG);
    }
    *out = node->valuedouble;
    return BST_OK;
}

bst_status bst_study_put(bst_ctx *ctx, const bst_study *study, const bst_study_axis *axis,
                         const bst_study_value *value, const char *pointer, bst_json *json) {
    cJSON *node;
    if (value->is_number) {
        double number = value->number;
        if (axis->dispersion && axis->dispersion->apply != BST_APPLY_SET) {
            double present = 0.0;
            BST_TRY(present_number(ctx, study, axis, json, pointer, &present));
            number = axis->dispersion->apply == BST_APPLY_ADD ? present + number : present * number;
        }
        if (axis->dispersion && axis->dispersion->integer) {
            number = round(number);
        }
        node = cJSON_CreateNumber(number);
    } else {
        node = cJSON_Duplicate(value->json, 1);
    }
    bst_status status = bst_json_assign(ctx, json, pointer, node);
    return status == BST_OK ? BST_OK : fail_axis(ctx, study, axis, status);
}

bst_status bst_study_put_all(bst_ctx *ctx, const bst_study *study, const bst_study_value *values,
                             bool populations, bst_json *json) {
    for (int a = 0; a < study->axis_count - study->populations.count; a++) {
        const bst_study_axis *axis = &study->axes[a];
        if (!values[a].given) {
            continue;
        }
        if (bst_study_population_pointer(axis->path) == populations) {
            BST_TRY(bst_study_put(ctx, study, axis, &values[a], axis->path, json));
        }
        for (const cJSON *also = axis->linked_paths ? axis->linked_paths->child : NULL; also;
             also = also->next) {
            if (bst_study_population_pointer(also->valuestring) == populations) {
                BST_TRY(bst_study_put(ctx, study, axis, &values[a], also->valuestring, json));
            }
        }
    }
    return BST_OK;
}
