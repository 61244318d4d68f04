/* Reads the axes and dispersions of a study file: pointers, values, ranges, weights. */
#include <cjson/cJSON.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/studies/study_internal.h"

static bst_status read_raw_array(bst_ctx *ctx, const bst_study *study, const cJSON *node,
                                 const char *where, const char *key, const char *allowed,
                                 const cJSON **out) {
    const cJSON *value = cJSON_GetObjectItemCaseSensitive(node, key);
    char path[96];
    *out = NULL;
    if (value && !cJSON_IsArray(value)) {
        snprintf(path, sizeof path, "%s/%s", where, key);
        return bst_config_fail(ctx, study->file, path, value, "wrong type", allowed);
    }
    *out = cJSON_GetArraySize(value) > 0 ? value : NULL;
    return BST_OK;
}

static bst_status check_pointer(bst_ctx *ctx, const bst_study *study, const char *where,
                                const cJSON *value) {
    const char *allowed =
        bst_study_population_pointer(where)
            ? "a JSON pointer into the object, such as \"/brightness/standard_v_mag\""
            : "a JSON pointer into the scenario, such as "
              "\"/observers/0/sensors/0/camera/read_noise_e\"";
    if (!cJSON_IsString(value)) {
        return bst_config_fail(ctx, study->file, where, value, "wrong type", allowed);
    }
    const char *p = value->valuestring;
    if (*p != '/' || strlen(p) == strspn(p, "/") || p[strlen(p) - 1] == '/') {
        return bst_config_fail(ctx, study->file, where, value, "no JSON pointer", allowed);
    }
    if (strcmp(p, "/seed") == 0 || strcmp(p, "/run") == 0) {
        return bst_config_fail(ctx, study->file, where, value, "set by the study itself",
                               "other pointers; \"seed\" and \"replicates\" of the study");
    }
    return BST_OK;
}

bst_status bst_study_read_axis(bst_ctx *ctx, const bst_study *study, const cJSON *node,
                               bst_study_axis *axis) {
    char path[96];
    snprintf(path, sizeof path, "%s/path", axis->where);
    const cJSON *pointer = cJSON_GetObjectItemCaseSensitive(node, "path");
    BST_TRY(check_pointer(ctx, study, path, pointer));
    axis->path = pointer->valuestring;
    BST_TRY(read_raw_array(ctx, study, node, axis->where, "linked_paths",
                           "an array of JSON pointers", &axis->linked_paths));
    int i = 0;
    for (const cJSON *item = axis->linked_paths ? axis->linked_paths->child : NULL; item;
         item = item->next) {
        snprintf(path, sizeof path, "%s/linked_paths/%d", axis->where, i++);
        BST_TRY(check_pointer(ctx, study, path, item));
    }
    BST_TRY(read_raw_array(ctx, study, node, axis->where, "values", "an array of values",
                           &axis->values));
    axis->value_count = cJSON_GetArraySize(axis->values);
    return BST_OK;
}

bst_status bst_study_check_range(bst_ctx *ctx, const bst_study *study, const char *where,
                                 double from, double to, bool log, bool down) {
    if (!(from < to) && !(down && from > to)) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "%s: %s: from %g to %g is no range (allowed: \"from\" less than \"to\"%s)",
                        study->file, where, from, to, down ? ", or a list of \"values\"" : "");
    }
    if (log && !(from > 0.0 && to > 0.0)) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "%s: %s: from %g to %g has no logarithm (allowed: both above 0)",
                        study->file, where, from, to);
    }
    return BST_OK;
}

/* Reads the weights of a table and normalises their cumulative sum to 1. */
static bst_status read_weights(bst_ctx *ctx, const bst_study *study, const cJSON *node,
                               bst_study_axis *axis) {
    const cJSON *weights;
    char path[96];
    const char *allowed = "an array of numbers of 0 or more, one for each value, not all 0";
    BST_TRY(read_raw_array(ctx, study, node, axis->where, "weights", allowed, &weights));
    if (!weights) {
        return BST_OK;
    }
    snprintf(path, sizeof path, "%s/weights", axis->where);
    axis->cumulative = calloc((size_t)axis->value_count, sizeof *axis->cumulative);
    if (!axis->cumulative) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the study");
    }
    double sum = 0.0;
    int n = 0;
    bool good = cJSON_GetArraySize(weights) == axis->value_count;
    for (const cJSON *item = weights->child; item && good; item = item->next) {
        good = cJSON_IsNumber(item) && item->valuedouble >= 0.0;
        sum += good ? item->valuedouble : 0.0;
        axis->cumulative[n++] = sum;
    }
    if (!good || !(sum > 0.0)) {
        return bst_config_fail(ctx, study->file, path, weights, "no weights", allowed);
    }
    for (int i = 0; i < n; i++) {
        axis->cumulative[i] /= sum;
    }
    return BST_OK;
}

bst_status bst_study_read_dispersion(bst_ctx *ctx, const bst_study *study, const cJSON *node,
                                     const bst_study_dispersion_config *c, bst_study_axis *axis) {
    BST_TRY(bst_study_read_axis(ctx, study, node, axis));
    axis->dispersion = c;
    bool table = c->distribution == BST_DISTRIBUTION_TABLE;
    if (table != (axis->values != NULL)) {
        return bst_fail(
            ctx, BST_ERR_CONFIG, "%s: %s/values: %s", study->file, axis->where,
            table ? "missing: a table is drawn from them" : "only for the distribution \"table\"");
    }
    if (table) {
        for (const cJSON *item = axis->values->child; item; item = item->next) {
            if (c->apply != BST_APPLY_SET && !cJSON_IsNumber(item)) {
                return bst_config_fail(ctx, study->file, axis->where, item,
                                       "cannot be added or multiplied", "numbers");
            }
        }
        return read_weights(ctx, study, node, axis);
    }
    if (c->distribution == BST_DISTRIBUTION_NORMAL) {
        return c->sigma > 0.0 ? BST_OK
                              : bst_fail(ctx, BST_ERR_CONFIG,
                                         "%s: %s/sigma: a normal distribution needs one above 0",
                                         study->file, axis->where);
    }
    return bst_study_check_range(ctx, study, axis->where, c->from, c->to,
                                 c->distribution == BST_DISTRIBUTION_LOG_UNIFORM, false);
}
