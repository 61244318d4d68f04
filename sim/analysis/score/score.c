#include "sim/analysis/score/score.h"

#include <cjson/cJSON.h>
#include <inttypes.h>
#include <math.h>
#include <string.h>
#include <sys/stat.h>

#include "sim/cli/print_json.h"
#include "sim/core/json_number.h"
#include "sim/io/run_files.h"

#define Q bst_score_request
const bst_option bst_score_request_options[] = {
    {.name = "truth",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(Q, truth),
     .path = BST_PATH_INPUT,
     .argument = "PATH",
     .doc = "a run with truth, SatNet annotations, spotGEO labels, or CSV",
     .required = true},
    {.name = "what",
     .kind = BST_OPTION_CHOICE,
     .offset = offsetof(Q, what),
     .argument = "detections|tracks",
     .doc = "which points of a run are scored (default detections)"},
    {.name = "unknown",
     .kind = BST_OPTION_FLAG,
     .offset = offsetof(Q, unknown),
     .doc = "score a run's detections without a label, too, not only those labelled object"},
    {.name = "sensor",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(Q, sensor),
     .argument = "OBSERVER/SENSOR",
     .doc = "only this sensor of runs (default all)"},
    {.name = "radius",
     .kind = BST_OPTION_REAL,
     .offset = offsetof(Q, radius_px),
     .argument = "PX",
     .doc = "largest distance of a pair, and cutoff of GOSPA (default 5)",
     .minimum = 0.01,
     .maximum = 1e4},
    {.name = "least-snr",
     .kind = BST_OPTION_REAL,
     .offset = offsetof(Q, least_snr),
     .argument = "SNR",
     .doc = "true objects that are fainter may be found, but need not (default: none)",
     .minimum = 0,
     .maximum = 1e6},
    {.name = "least-score",
     .kind = BST_OPTION_REAL,
     .offset = offsetof(Q, least_score),
     .argument = "SCORE",
     .doc = "leave out found points with a lower score, or SNR (default: none)",
     .minimum = -1e9,
     .maximum = 1e9},
    {.name = "resamples",
     .kind = BST_OPTION_INT,
     .offset = offsetof(Q, resamples),
     .argument = "N",
     .doc = "of the bootstrap (default 1000; 0: no intervals)",
     .minimum = 0,
     .maximum = 1e6},
    {.name = "seed",
     .kind = BST_OPTION_INT,
     .offset = offsetof(Q, seed),
     .argument = "SEED",
     .doc = "of the bootstrap (default 1)",
     .minimum = 0,
     .maximum = 9e15},
    {.name = "json",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(Q, json),
     .path = BST_PATH_OUTPUT,
     .argument = "FILE",
     .doc = "the figures as JSON; - prints them in place of the table"},
    {.name = "help", .kind = BST_OPTION_FLAG, .offset = offsetof(Q, help), .doc = "print this"},
    {.name = NULL},
};
#undef Q

/* Name in JSON, label and unit of each figure. */
static const struct {
    const char *key, *label, *unit;
} figure_names[BST_SCORE_FIGURES] = {
    [BST_SCORE_PRECISION] = {"precision", "precision", ""},
    [BST_SCORE_RECALL] = {"recall", "recall", ""},
    [BST_SCORE_F1] = {"f1", "F1", ""},
    [BST_SCORE_RMS_PX] = {"rms_px", "distance, RMS", "px"},
    [BST_SCORE_GOSPA_PX] = {"gospa_px", "GOSPA", "px"},
    [BST_SCORE_SPOTGEO_1_F1] = {"spotgeo_one_minus_f1", "spotGEO 1-F1", ""},
    [BST_SCORE_SPOTGEO_MSE] = {"spotgeo_mse_px2", "spotGEO MSE", "px^2"},
    [BST_SCORE_SPOTGEO_COMPETITION] = {"spotgeo_mse_competition", "spotGEO total", ""},
};

/* The figures as JSON; NULL: out of memory. */
static cJSON *to_json(const bst_score_request *q, const char *found, const bst_score_result *r) {
    cJSON *root = cJSON_CreateObject();
    cJSON_AddStringToObject(root, "found_path", found);
    cJSON_AddStringToObject(root, "truth_path", q->truth);
    bst_json_add_number(root, "radius_px", q->radius_px);
    const struct {
        const char *key;
        int64_t value;
    } counts[] = {{"frames", r->frames},
                  {"sequences", r->sequences},
                  {"frames_only_found", r->frames_only_found},
                  {"truths", r->truths},
                  {"found", r->found},
                  {"true_positives", r->true_positives},
                  {"false_positives", r->false_positives},
                  {"false_negatives", r->false_negatives},
                  {"optional_truths", r->optional_truths},
                  {"optional_found", r->optional_found},
                  {"resamples", q->resamples}};
    for (size_t i = 0; i < sizeof counts / sizeof *counts; i++) {
        cJSON_AddNumberToObject(root, counts[i].key, (double)counts[i].value);
    }
    bst_json_add_number(root, "identity_changes",
                        r->identity_changes < 0 ? NAN : (double)r->identity_changes);
    cJSON_AddStringToObject(root, "bootstrap_over", r->by_sequence ? "sequences" : "frames");
    cJSON *figures = cJSON_AddObjectToObject(root, "figures");
    for (int k = 0; k < BST_SCORE_FIGURES; k++) {
        cJSON *node = cJSON_AddObjectToObject(figures, figure_names[k].key);
        bst_json_add_number(node, "value", r->figures[k].value);
        bst_json_add_number(node, "low_95", r->figures[k].low);
        bst_json_add_number(node, "high_95", r->figures[k].high);
    }
    return root;
}

static void print_result(FILE *out, const bst_score_request *q, const bst_score_result *r) {
    fprintf(out, "frames          %" PRId64 " in %" PRId64 " sequence%s\n", r->frames, r->sequences,
            r->sequences == 1 ? "" : "s");
    if (r->frames_only_found > 0) {
        fprintf(out,
                "                %" PRId64 " of them are not in the truth: all in them is false\n",
                r->frames_only_found);
    }
    fprintf(out, "true points     %" PRId64 ", found %" PRId64 ", missed %" PRId64 "\n", r->truths,
            r->true_positives, r->false_negatives);
    fprintf(out, "found points    %" PRId64 ", false %" PRId64 "\n", r->found, r->false_positives);
    if (r->optional_truths > 0) {
        fprintf(out,
                "left out        %" PRId64 " fainter than SNR %g, and %" PRId64 " found there\n",
                r->optional_truths, q->least_snr, r->optional_found);
    }
    if (r->identity_changes >= 0) {
        fprintf(out, "identity        %" PRId64 " change%s\n", r->identity_changes,
                r->identity_changes == 1 ? "" : "s");
    }
    fprintf(out, "%-15s %10s   95 %% interval, over %s\n", "", "value",
            r->by_sequence ? "sequences" : "frames");
    for (int k = 0; k < BST_SCORE_FIGURES; k++) {
        const bst_score_value *v = &r->figures[k];
        if (!isfinite(v->value)) {
            fprintf(out, "%-15s %10s\n", figure_names[k].label, "-");
        } else if (isfinite(v->low)) {
            fprintf(out, "%-15s %10.4f   %.4f to %.4f %s\n", figure_names[k].label, v->value,
                    v->low, v->high, figure_names[k].unit);
        } else {
            fprintf(out, "%-15s %10.4f   %s\n", figure_names[k].label, v->value,
                    figure_names[k].unit);
        }
    }
}

/* Computes the figures of points that were read, and puts them out. */
static bst_status report(bst_ctx *ctx, const bst_score_request *q, const char *path,
                         const bst_score_points *truth, const bst_score_points *found, FILE *out) {
    const bst_score_options options = {q->radius_px, q->resamples, (uint64_t)q->seed};
    bst_score_result result;
    BST_TRY(bst_score_compute(ctx, truth, found, &options, &result));
    if (!q->json || strcmp(q->json, "-") != 0) {
        print_result(out, q, &result);
    }
    return q->json ? bst_cli_write_json(ctx, q->json, to_json(q, path, &result)) : BST_OK;
}

static bst_status fail_unused(bst_ctx *ctx, const char *option, const char *why) {
    return bst_fail(ctx, BST_ERR_ARGUMENT, "--%s has no effect %s: leave it out", option, why);
}

bst_status bst_score_request_check(bst_ctx *ctx, const bst_score_request *q, const char *found) {
    struct stat info;
    if (stat(found, &info) != 0 || stat(q->truth, &info) != 0) {
        return BST_OK; /* an error of the reader */
    }
    bool is_run = bst_io_folder_is_run(found);
    if (q->sensor && !is_run && !bst_io_folder_is_run(q->truth)) {
        return fail_unused(ctx, "sensor", "as neither source is the folder of a run");
    }
    if ((q->what >= 0 || q->unknown) && !is_run) {
        return fail_unused(ctx, q->unknown ? "unknown" : "what",
                           "as the points found are not those of a run's folder");
    }
    return q->unknown && q->what == BST_SCORE_TRACKS
               ? fail_unused(ctx, "unknown", "with --what tracks")
               : BST_OK;
}

bst_status bst_score_run(bst_ctx *ctx, const bst_score_request *q, const char *path, FILE *out) {
    bst_score_points truth = {0}, found = {0};
    const bst_score_selection known = {
        .what = BST_SCORE_TRUTH, .sensor = q->sensor, .least_snr = q->least_snr};
    const bst_score_selection tested = {
        .what = q->what == BST_SCORE_TRACKS ? BST_SCORE_TRACKS : BST_SCORE_DETECTIONS,
        .sensor = q->sensor,
        .unknown = q->unknown,
        .least_score = q->least_score};
    bst_status status = bst_score_points_read(ctx, q->truth, &known, &truth);
    if (status == BST_OK) {
        status = bst_score_points_read(ctx, path, &tested, &found);
    }
    if (status == BST_OK) {
        status = report(ctx, q, path, &truth, &found, out);
    }
    bst_score_points_free(&truth);
    bst_score_points_free(&found);
    return status;
}
