#include "sim/analysis/pd/pd_measurement.h"

#include <cjson/cJSON.h>
#include <stdlib.h>
#include <string.h>

#include "sim/io/manifest.h"

/* Measures the same detector on single frames, with as many trials, at the SNRs that it needs. */
static bst_status measure_single(bst_ctx *ctx, const bst_pd_request *r,
                                 const bst_scenario *scenario, bst_pd_figures *out) {
    bst_pd_options options = r->options;
    options.stack = 0;
    options.by_magnitude = false;
    options.low = 3.5;
    options.high = 7.5;
    options.step = 0.5;
    options.empty_frames = 0;
    bst_pd_scene *scene = calloc(1, sizeof *scene);
    bst_pd_result *result = calloc(1, sizeof *result);
    bst_pd_detector *detector = NULL;
    bst_status status = scene && result
                            ? bst_pd_scene_open(ctx, scenario, &options, scene)
                            : bst_fail(ctx, BST_ERR_MEMORY, "no memory for the measurement");
    if (status == BST_OK) {
        status = bst_pd_detector_open(ctx, scene, &detector);
        if (status == BST_OK) {
            status = bst_pd_run(ctx, scene, detector, result);
        }
        if (status == BST_OK) {
            bst_pd_figures_of(scene, result, out);
        }
        bst_pd_detector_close(detector);
        bst_pd_scene_close(scene);
    }
    free(scene);
    free(result);
    return status;
}

/* Writes the results and frees them. */
static bst_status write_json(bst_ctx *ctx, const char *path, cJSON *root) {
    char *text = cJSON_Print(root);
    bst_status status = text ? bst_io_write_file_atomic(ctx, path, text, strlen(text))
                             : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the results");
    free(text);
    cJSON_Delete(root);
    return status;
}

static bst_status write_results(bst_ctx *ctx, const bst_pd_request *r, const bst_scenario *scenario,
                                const bst_pd_scene *scene, const bst_pd_result *result) {
    bst_pd_figures figures, single;
    bst_pd_figures_of(scene, result, &figures);
    if (r->options.stack > 0) {
        BST_TRY(measure_single(ctx, r, scenario, &single));
        bst_pd_compare_single(&single, &figures);
    }
    bst_pd_print(scene, result, &figures);
    if (r->json) {
        BST_TRY(write_json(ctx, r->json, bst_pd_json(scene, result, &figures)));
    }
    return r->plot ? bst_pd_plot(ctx, r->plot, scene, result, &figures) : BST_OK;
}

static bst_status measure_pairs(bst_ctx *ctx, const bst_pd_request *r,
                                const bst_scenario *scenario) {
    bst_pd_pair_result *result = malloc(sizeof *result);
    if (!result) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the measurement");
    }
    bst_status status = bst_pd_pair_run(ctx, scenario, &r->options, &r->pairs, result);
    if (status == BST_OK) {
        bst_pd_pair_print(result);
        status = r->json ? write_json(ctx, r->json, bst_pd_pair_json(result)) : BST_OK;
    }
    if (status == BST_OK && r->plot) {
        status = bst_pd_pair_plot(ctx, r->plot, result);
    }
    free(result);
    return status;
}

bst_status bst_pd_measure(bst_ctx *ctx, const bst_pd_request *r, const bst_scenario *scenario) {
    if (r->pair) {
        return measure_pairs(ctx, r, scenario);
    }
    bst_pd_scene *scene = calloc(1, sizeof *scene);
    bst_pd_result *result = calloc(1, sizeof *result);
    bst_pd_detector *detector = NULL;
    bst_status status = scene && result
                            ? bst_pd_scene_open(ctx, scenario, &r->options, scene)
                            : bst_fail(ctx, BST_ERR_MEMORY, "no memory for the measurement");
    if (status == BST_OK) {
        status = bst_pd_detector_open(ctx, scene, &detector);
        if (status == BST_OK) {
            status = bst_pd_run(ctx, scene, detector, result);
        }
        if (status == BST_OK) {
            status = write_results(ctx, r, scenario, scene, result);
        }
        bst_pd_detector_close(detector);
        bst_pd_scene_close(scene);
    }
    free(scene);
    free(result);
    return status;
}
