#include "sim/study_kinds/study_card.h"

#include <cjson/cJSON.h>
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "boresight/version.h"
#include "sim/core/json_number.h"
#include "sim/io/draft_file.h"
#include "sim/io/manifest.h"

enum { PARTS = 3 };

static const char *const part_names[PARTS] = {"train", "validation", "test"};
static const char *const part_files[PARTS] = {"train.txt", "val.txt", "test.txt"};

static double metric(const bst_results *r, int64_t run, int which) {
    return r->metrics[run * r->kind->metric_count + which];
}

static bst_status write_part(bst_ctx *ctx, const bst_results *r, const bst_study_card_metrics *m,
                             const char *out, int part) {
    char path[4200];
    bst_draft draft;
    snprintf(path, sizeof path, "%.4000s/%s", out, part_files[part]);
    BST_TRY(bst_draft_open(ctx, path, &draft));
    for (int64_t i = 0; i < r->study->runs; i++) {
        if (r->state[i] == BST_ROW_DONE && (int)metric(r, i, m->part) == part) {
            fprintf(draft.stream, "ImageFiles/%06" PRId64 ".fits Annotations/%06" PRId64 ".json\n",
                    i, i);
        }
    }
    return bst_draft_close(ctx, &draft, BST_OK);
}

static void add_counts(const bst_results *r, const bst_study_card_metrics *m, cJSON *card) {
    double sums[4] = {0.0}, parts[PARTS] = {0.0};
    const int which[4] = {m->frames, m->satellites, m->stars, m->bytes};
    for (int64_t i = 0; i < r->study->runs; i++) {
        if (r->state[i] != BST_ROW_DONE) {
            continue;
        }
        for (int k = 0; k < 4; k++) {
            sums[k] += metric(r, i, which[k]);
        }
        parts[(int)metric(r, i, m->part)]++;
    }
    cJSON *node = cJSON_AddObjectToObject(card, "counts");
    cJSON_AddNumberToObject(node, "sequences", (double)(r->done - r->failed));
    cJSON_AddNumberToObject(node, "failed", (double)r->failed);
    cJSON_AddNumberToObject(node, "frames", sums[0]);
    cJSON_AddNumberToObject(node, "satellite_labels", sums[1]);
    cJSON_AddNumberToObject(node, "star_labels", sums[2]);
    cJSON_AddNumberToObject(node, "bytes", sums[3]);
    node = cJSON_AddObjectToObject(card, "split");
    for (int p = 0; p < PARTS; p++) {
        cJSON_AddNumberToObject(node, part_names[p], parts[p]);
    }
}

/* Adds range and mean of each axis to the data card. */
static bst_status add_axes(bst_ctx *ctx, const bst_results *r, cJSON *card) {
    const bst_study *s = r->study;
    cJSON *list = cJSON_AddArrayToObject(card, "varied");
    bst_study_value *values = calloc(BST_STUDY_AXES, sizeof *values);
    double *low = calloc(BST_STUDY_AXES, sizeof *low), *high = calloc(BST_STUDY_AXES, sizeof *high),
           *sum = calloc(BST_STUDY_AXES, sizeof *sum);
    int64_t *count = calloc(BST_STUDY_AXES, sizeof *count);
    bool good = values && low && high && sum && count;
    for (int64_t i = 0; good && i < s->runs; i++) {
        bst_study_place place = bst_study_place_of(s, i);
        bst_study_values(s, &place, values);
        for (int a = 0; a < s->axis_count; a++) {
            double x = values[a].number;
            if (values[a].given && values[a].is_number) {
                low[a] = count[a] ? fmin(low[a], x) : x;
                high[a] = count[a] ? fmax(high[a], x) : x;
                sum[a] += x;
                count[a]++;
            }
        }
    }
    for (int a = 0; good && a < s->axis_count; a++) {
        static const char *const laws[] = {"uniform", "log_uniform", "normal", "table"};
        static const char *const acts[] = {"set", "add", "multiply"};
        const bst_study_axis *axis = &s->axes[a];
        cJSON *node = cJSON_CreateObject();
        cJSON_AddStringToObject(node, "name", axis->name);
        cJSON_AddStringToObject(node, "path", axis->path);
        cJSON_AddStringToObject(node, "how",
                                axis->population   ? "population"
                                : axis->dispersion ? laws[axis->dispersion->distribution]
                                                   : "sweep");
        if (axis->dispersion) {
            cJSON_AddStringToObject(node, "apply", acts[axis->dispersion->apply]);
        }
        if (count[a] > 0) {
            bst_json_add_number(node, "least", low[a]);
            bst_json_add_number(node, "greatest", high[a]);
            bst_json_add_number(node, "mean", sum[a] / (double)count[a]);
        } else {
            cJSON_AddItemToObject(node, "values", cJSON_Duplicate(axis->values, 1));
        }
        cJSON_AddItemToArray(list, node);
    }
    free(values);
    free(low);
    free(high);
    free(sum);
    free(count);
    return good ? BST_OK : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the data card");
}

bst_status bst_study_write_card(bst_ctx *ctx, const bst_results *r, const bst_study_card_metrics *m,
                                const char *out) {
    const bst_study *s = r->study;
    char path[4200], seed[24];
    for (int p = 0; p < PARTS; p++) {
        BST_TRY(write_part(ctx, r, m, out, p));
    }
    cJSON *card = cJSON_CreateObject();
    cJSON_AddStringToObject(card, "name", s->config.name);
    cJSON_AddStringToObject(card, "program", "boresight");
    cJSON_AddStringToObject(card, "version", bst_version());
    cJSON_AddStringToObject(card, "git_revision", bst_version_git_revision());
    snprintf(seed, sizeof seed, "0x%" PRIX64, s->config.seed);
    cJSON_AddStringToObject(card, "seed", seed);
    cJSON_AddStringToObject(card, "digest", s->digest);
    cJSON *scenarios = cJSON_AddArrayToObject(card, "scenarios");
    for (int i = 0; i < s->base_count; i++) {
        cJSON_AddItemToArray(scenarios, cJSON_CreateString(s->bases[i].name));
    }
    add_counts(r, m, card);
    bst_status status = add_axes(ctx, r, card);
    cJSON_AddStringToObject(card, "frames",
                            s->config.cubes.compress
                                ? "FITS, an image extension a frame, Rice compressed, lossless"
                                : "FITS, one cube of 16-bit counts, table FRAMES of times and WCS");
    cJSON_AddStringToObject(card, "labels",
                            "Annotations/NNNNNN.json, data.frames[].objects[] as SatNet has them: "
                            "places are fractions of the image between pixel edges");
    cJSON_AddStringToObject(card, "again",
                            "boresight study . --emit N writes the scenario of sequence N");
    char *text = cJSON_Print(card);
    snprintf(path, sizeof path, "%.4000s/card.json", out);
    if (status == BST_OK) {
        status = text ? bst_io_write_file_atomic(ctx, path, text, strlen(text))
                      : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the data card");
    }
    free(text);
    cJSON_Delete(card);
    return status;
}
