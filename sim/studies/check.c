/* Checks a study before its first run. */
#include <cjson/cJSON.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/text.h"
#include "sim/studies/kind.h"
#include "sim/studies/study_internal.h"

enum { RUNS_TRIED = 1000 };

int bst_kind_metric(const bst_study_kind *kind, const char *name) {
    for (int i = 0; i < kind->metric_count; i++) {
        if (strcmp(kind->metrics[i].name, name) == 0) {
            return i;
        }
    }
    return -1;
}

static bst_status unknown_metric(bst_ctx *ctx, const bst_study *study, const bst_study_kind *kind,
                                 int index, const char *name) {
    const char *nearest = NULL;
    size_t best = SIZE_MAX;
    char known[700] = "";
    for (int i = 0; i < kind->metric_count; i++) {
        if (bst_text_is_nearer(name, kind->metrics[i].name, &best)) {
            nearest = kind->metrics[i].name;
        }
        size_t used = strlen(known);
        snprintf(known + used, sizeof known - used, "%s%s", used ? ", " : "",
                 kind->metrics[i].name);
    }
    return nearest ? bst_fail(ctx, BST_ERR_CONFIG,
                              "%s: /metrics/%d: kind %s has no metric \"%.60s\"; did you mean "
                              "\"%s\"?",
                              study->file, index, kind->name, name, nearest)
                   : bst_fail(ctx, BST_ERR_CONFIG,
                              "%s: /metrics/%d: kind %s has no metric \"%.60s\" (allowed: %s)",
                              study->file, index, kind->name, name, known);
}

static bst_status check_metrics(bst_ctx *ctx, const bst_study *study, const bst_study_kind *kind) {
    const cJSON *list = cJSON_GetObjectItemCaseSensitive(bst_json_root(study->json), "metrics");
    const char *allowed = "an array of names";
    if (list && !cJSON_IsArray(list)) {
        return bst_config_fail(ctx, study->file, "/metrics", list, "wrong type", allowed);
    }
    int i = 0;
    for (const cJSON *item = list ? list->child : NULL; item; item = item->next, i++) {
        if (!cJSON_IsString(item)) {
            return bst_config_fail(ctx, study->file, "/metrics", item, "wrong type", allowed);
        }
        if (bst_kind_metric(kind, item->valuestring) < 0) {
            return unknown_metric(ctx, study, kind, i, item->valuestring);
        }
    }
    return BST_OK;
}

/* Checks the scenario of one run of the study; `deep`: with its files and references. */
static bst_status check_run(bst_ctx *ctx, const bst_study *study, const bst_study_kind *kind,
                            const bst_study_place *place, const bst_study_value *values,
                            const bst_study_population_probe *probe, bool deep) {
    bst_study_run run = {.study = study, .place = *place};
    cJSON *settings;
    BST_TRY(bst_study_document_probed(ctx, study, place, values, probe, &run.scenario, &settings));
    run.settings = settings;
    bst_status status = kind->check(ctx, kind->user, &run, deep);
    bst_json_free(run.scenario);
    cJSON_Delete(settings);
    return status;
}

/* Describes a value for messages: "value 3 of read_noise_e". */
static void say_value(const bst_study_axis *axis, const bst_study_value *value, char *out,
                      size_t bytes) {
    char number[40];
    bst_study_number_text(value->number, number);
    char *text = value->is_number ? NULL : cJSON_PrintUnformatted(value->json);
    snprintf(out, bytes, "value %.80s of %s",
             value->is_number ? number
             : text           ? text
                              : "?",
             axis->name);
    free(text);
}

typedef struct checker {
    bst_ctx *ctx;
    const bst_study *study;
    const bst_study_kind *kind;
    bst_study_value *values;
} checker;

/* Checks a run with given values; `axis`: the one that is tested. */
static bst_status try_values(checker *c, const bst_study_place *place, int axis, bool deep) {
    char value[200];
    bst_status status = check_run(c->ctx, c->study, c->kind, place, c->values, NULL, deep);
    if (status == BST_OK) {
        return BST_OK;
    }
    say_value(&c->study->axes[axis], &c->values[axis], value, sizeof value);
    return bst_fail_prefix(c->ctx, status, "%s: %s: %s", c->study->file, c->study->axes[axis].where,
                           value);
}

static bst_study_value number_value(double number) {
    return (bst_study_value){true, true, number, NULL};
}

static bst_study_value listed_value(const cJSON *item) {
    bool number = cJSON_IsNumber(item);
    return (bst_study_value){true, number, number ? item->valuedouble : 0.0, item};
}

/* First and last value of a range. */
static void ends_of(const bst_study_axis *axis, double ends[2]) {
    if (axis->axis) {
        ends[0] = axis->axis->integer ? round(axis->axis->from) : axis->axis->from;
        ends[1] = axis->axis->integer ? round(axis->axis->to) : axis->axis->to;
    } else if (axis->dispersion->distribution == BST_DISTRIBUTION_NORMAL) {
        double reach = axis->dispersion->truncate_sigma * axis->dispersion->sigma;
        ends[0] = axis->dispersion->mean - reach;
        ends[1] = axis->dispersion->mean + reach;
    } else {
        ends[0] = axis->dispersion->from;
        ends[1] = axis->dispersion->to;
    }
}

/* Checks the ends of ranges and the listed values of one axis, with the others as in the first
 * setting. */
static bst_status try_axis(checker *c, const bst_study_place *place, int a) {
    const bst_study_axis *axis = &c->study->axes[a];
    bst_study_value kept = c->values[a];
    bst_status status = BST_OK;
    if (axis->values) {
        for (const cJSON *item = axis->values->child; item && status == BST_OK; item = item->next) {
            c->values[a] = listed_value(item);
            status = try_values(c, place, a, false);
        }
    } else {
        double ends[2];
        ends_of(axis, ends);
        for (int e = 0; e < 2 && status == BST_OK; e++) {
            c->values[a] = number_value(ends[e]);
            status = try_values(c, place, a, false);
        }
    }
    c->values[a] = kept;
    return status;
}

/* Checks the extreme values of one dispersion of a population. */
static bst_status try_probe(checker *c, const bst_study_place *place, const bst_study_axis *axis,
                            const bst_study_population_probe *probe) {
    char value[200];
    bst_status status = check_run(c->ctx, c->study, c->kind, place, c->values, probe, false);
    if (status == BST_OK) {
        return BST_OK;
    }
    say_value(axis, &probe->value, value, sizeof value);
    return bst_fail_prefix(c->ctx, status, "%s: %s: %s", c->study->file, axis->where, value);
}

/* Checks the scenario at the extreme values of each dispersion of a population. */
static bst_status try_objects(checker *c, const bst_study_place *place,
                              const bst_study_population *population, int index) {
    bst_status status = BST_OK;
    for (int d = 0; d < population->config.dispersions.count && status == BST_OK; d++) {
        const bst_study_axis *axis = &population->axes[d];
        bst_study_population_probe probe = {.population = index, .dispersion = d};
        double ends[2];
        const cJSON *item = axis->values ? axis->values->child : NULL;
        for (; item && status == BST_OK; item = item->next) {
            probe.value = listed_value(item);
            status = try_probe(c, place, axis, &probe);
        }
        for (int e = 0; !axis->values && e < 2 && status == BST_OK; e++) {
            ends_of(axis, ends);
            probe.value = number_value(ends[e]);
            status = try_probe(c, place, axis, &probe);
        }
    }
    return status;
}

/* Checks the smallest and largest numbers of objects, and the objects' dispersions. */
static bst_status try_populations(checker *c, const bst_study_place *place) {
    int count = c->study->populations.count, first = c->study->axis_count - count;
    bst_study_population_list own;
    const bst_study_population_list *list;
    BST_TRY(bst_study_populations_of(c->ctx, c->study, c->values, &own, &list));
    bst_status status = BST_OK;
    for (int i = 0; i < count && status == BST_OK; i++) {
        double ends[2];
        bst_study_population_reach(&list->items[i], ends);
        status = try_objects(c, place, &list->items[i], i);
        for (int e = 0; e < 2 && status == BST_OK; e++) {
            c->values[first + i] = number_value(ends[e]);
            status = try_values(c, place, first + i, false);
        }
        if (status == BST_OK && ends[1] > 0.0) { /* including files and references of an object */
            c->values[first + i] = number_value(fmax(ends[0], 1.0));
            status = try_values(c, place, first + i, true);
        }
        c->values[first + i] = (bst_study_value){.given = false};
    }
    bst_study_populations_free(&own);
    return status;
}

/* Checks parallel axes: all values of one level together. */
static bst_status try_list(checker *c, const bst_study_place *place, int factor) {
    const bst_study_factor *f = &c->study->factors[factor];
    int64_t levels[BST_STUDY_AXES + 1];
    bst_study_levels(c->study, place->setting, levels);
    for (int64_t level = 0; level < f->levels; level++) {
        levels[factor] = level;
        bst_study_swept_values(c->study, levels, c->values);
        BST_TRY(try_values(c, place, f->first_axis, false));
    }
    levels[factor] = 0;
    bst_study_swept_values(c->study, levels, c->values);
    return BST_OK;
}

/* Finds the faulty value of the first setting by inserting its values one after the other. */
static bst_status blame(checker *c, const bst_study_place *place) {
    const bst_study *study = c->study;
    bst_study_value first[BST_STUDY_AXES];
    bst_ctx quiet = {0};
    memcpy(first, c->values, sizeof first);
    memset(c->values, 0, sizeof first);
    if (check_run(&quiet, study, c->kind, place, c->values, NULL, false) == BST_OK) {
        for (int a = 0; a < study->swept_count; a++) {
            c->values[a] = first[a];
            BST_TRY(first[a].given ? try_values(c, place, a, false) : BST_OK);
        }
    }
    memcpy(c->values, first, sizeof first);
    bst_status status = check_run(c->ctx, study, c->kind, place, c->values, NULL, true);
    return bst_fail_prefix(c->ctx, status, "%s: the first setting", study->file);
}

/* Checks a base scenario alone and at the extreme values of every axis and population. */
static bst_status try_base(checker *c, const bst_study_place *place) {
    const bst_study *study = c->study;
    int64_t levels[BST_STUDY_AXES + 1];
    bst_study_levels(study, place->setting, levels);
    memset(c->values, 0, BST_STUDY_AXES * sizeof *c->values);
    bst_study_swept_values(study, levels, c->values);
    if (check_run(c->ctx, study, c->kind, place, c->values, NULL, true) != BST_OK) {
        return blame(c, place);
    }
    for (int f = 0; f < study->factor_count; f++) {
        const bst_study_factor *factor = &study->factors[f];
        if (factor->design == BST_SWEEP_LIST) {
            BST_TRY(try_list(c, place, f));
            continue;
        }
        for (int a = factor->first_axis; a < factor->first_axis + factor->axis_count; a++) {
            BST_TRY(try_axis(c, place, a));
        }
    }
    for (int a = study->swept_count; a < study->axis_count - study->populations.count; a++) {
        BST_TRY(try_axis(c, place, a));
    }
    return try_populations(c, place);
}

/* Checks the runs themselves: all, or a sample. */
static bst_status try_runs(checker *c) {
    const bst_study *study = c->study;
    int64_t count = study->runs < RUNS_TRIED ? study->runs : RUNS_TRIED;
    for (int64_t i = 0; i < count; i++) {
        int64_t run = (int64_t)((double)i * (double)study->runs / (double)count);
        bst_study_place place = bst_study_place_of(study, run);
        bst_study_values(study, &place, c->values);
        bst_status status = check_run(c->ctx, study, c->kind, &place, c->values, NULL, false);
        if (status != BST_OK) {
            return bst_fail_prefix(c->ctx, status, "%s: run %" PRId64, study->file, place.run);
        }
    }
    return BST_OK;
}

bst_status bst_study_check(bst_ctx *ctx, const bst_study *study, const bst_study_kind *kind) {
    BST_TRY(check_metrics(ctx, study, kind));
    checker c = {ctx, study, kind, calloc(BST_STUDY_AXES, sizeof *c.values)};
    if (!c.values) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the study");
    }
    bst_status status = BST_OK;
    int64_t runs_per_base = study->runs / study->base_count;
    for (int b = 0; b < study->base_count && status == BST_OK; b++) {
        bst_study_place place = bst_study_place_of(study, b * runs_per_base);
        status = try_base(&c, &place);
    }
    if (status == BST_OK) {
        status = try_runs(&c);
    }
    free(c.values);
    return status;
}
