/* Files of the twin: scenario, path, PSF. */
#define _XOPEN_SOURCE 700 /* realpath */
#include <assert.h>
#include <cjson/cJSON.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/cli/print_json.h"
#include "sim/io/fits_image.h"
#include "sim/process/twin/twin_defects.h"

/* Attitudes of the exposure in the file of the path. */
enum { NODES = 257 };

/* Name of a file beside the scenario. */
static const char *name_of(const bst_twin *t, const char *ending, char path[4096]) {
    bst_twin_file(t, ending, path);
    const char *slash = strrchr(path, '/');
    return slash ? slash + 1 : path;
}

static void replace_text(cJSON *object, const char *key, const char *text) {
    cJSON_DeleteItemFromObjectCaseSensitive(object, key);
    cJSON_AddStringToObject(object, key, text);
}

static cJSON *item(cJSON *object, const char *key) {
    return cJSON_GetObjectItemCaseSensitive(object, key);
}

/* The catalogue as the scenario names it: scenarios take relative paths from their own folder. */
static void name_catalogue(const bst_twin *t, char path[4096]) {
    const char *name = t->request->catalogue;
    bool word = strcmp(name, "embedded") == 0 || strcmp(name, "default") == 0;
    char *whole = word ? NULL : realpath(name, NULL);
    snprintf(path, 4096, "%s", whole ? whole : name);
    free(whole);
}

/* Removes the stars of an earlier twin, unless they are the catalogue of this one. */
static void remove_stars(const bst_twin *t, const char *path) {
    char *stars = realpath(path, NULL), *used = realpath(t->request->catalogue, NULL);
    if (stars && !(used && strcmp(stars, used) == 0)) {
        (void)remove(path); /* what is left over harms nothing but the reader */
    }
    free(stars);
    free(used);
}

/* Turns the scenario of the recorded frame into one that renders it. */
static bst_status change_scenario(bst_ctx *ctx, const bst_twin *t, cJSON *root,
                                  bst_twin_camera *camera) {
    char path[4096];
    cJSON *observer = cJSON_GetArrayItem(item(root, "observers"), 0);
    cJSON *sensor = cJSON_GetArrayItem(item(observer, "sensors"), 0);
    cJSON *scenegen = cJSON_CreateObject(), *record = item(root, "record");
    replace_text(root, "name", name_of(t, "", path));
    replace_text(root, "description", "Twin of a recorded frame: written by boresight twin.");
    char catalogue[4096];
    name_catalogue(t, catalogue);
    replace_text(item(root, "world"), "star_catalogue",
                 t->request->catalogue_only ? catalogue : name_of(t, "_stars.bin", path));
    const char *pointing = name_of(t, "_path.json", path);
    replace_text(item(observer, "orbit"), "states_file", pointing);
    replace_text(sensor, "frame_updates_file", pointing);
    cJSON_AddStringToObject(scenegen, "type", "opencl");
    cJSON_AddNumberToObject(scenegen, "star_limit_v_mag", 30.0);
    cJSON_ReplaceItemInObjectCaseSensitive(item(sensor, "modules"), "scenegen", scenegen);
    cJSON *planes = cJSON_AddArrayToObject(record, "planes");
    cJSON_AddItemToArray(planes, cJSON_CreateString("stars"));
    cJSON_AddItemToArray(planes, cJSON_CreateString("background"));
    BST_TRY(bst_twin_make_camera(ctx, t, item(sensor, "camera"), camera));
    if (camera->pedestal_dn > 0.0) {
        snprintf(path, sizeof path,
                 "Twin of a recorded frame: written by boresight twin. Its level is %.6g DN above "
                 "the recorded one.",
                 camera->pedestal_dn);
        replace_text(root, "description", path);
    }
    return BST_OK;
}

/* The frame alone, with the fitted path as its attitudes. */
static void frame_alone(const bst_twin *t, bst_process_frame *frame, bst_process_node *nodes,
                        bst_process *out) {
    bool still = t->model.path.count[0] == 1 && t->model.path.count[1] == 1;
    *frame = *t->frame;
    frame->nodes = nodes;
    frame->node_count = still ? 2 : NODES;
    frame->start_tick = 0;
    for (int i = 0; i < frame->node_count; i++) {
        double u = (double)i / (frame->node_count - 1);
        nodes[i] = (bst_process_node){u, bst_twin_path_attitude(&t->model.path, u)};
    }
    *out = t->process;
    out->frames = frame;
    out->count = 1;
    out->scale_arcsec = t->model.camera.pixel_scale_arcsec;
}

/* The PSF before integration over the pixel. */
static bst_status write_psf(bst_ctx *ctx, const bst_twin *t) {
    char path[4096];
    const bst_twin_psf *p = &t->model.psf;
    double wide_px = bst_twin_psf_wide_px(p), o = BST_TWIN_OVERSAMPLING;
    int half = (int)ceil(6.0 * wide_px * o), side = 2 * half + 1;
    float *samples = malloc((size_t)side * (size_t)side * sizeof *samples);
    if (!samples) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for a PSF of %d samples", side * side);
    }
    for (int j = 0; j < side; j++) {
        for (int i = 0; i < side; i++) {
            double r2 = ((i - half) * (i - half) + (j - half) * (j - half)) / (o * o);
            double narrow = (1.0 - p->wide) / (p->sigma_px * p->sigma_px) *
                            exp(-0.5 * r2 / (p->sigma_px * p->sigma_px));
            double wide = p->wide / (wide_px * wide_px) * exp(-0.5 * r2 / (wide_px * wide_px));
            samples[(size_t)j * (size_t)side + (size_t)i] = (float)(narrow + wide);
        }
    }
    bst_twin_file(t, "_psf.fits", path);
    bst_status status = bst_fits_write_map(ctx, path, side, side, samples, "");
    free(samples);
    return status;
}

/* The dark current of the pixels, with the defects in it; removes that of an earlier twin. */
static bst_status write_dark(bst_ctx *ctx, const bst_twin *t, const bst_twin_camera *camera) {
    char path[4096];
    size_t pixels = (size_t)t->model.width * (size_t)t->model.height;
    bst_twin_file(t, "_dark.fits", path);
    if (t->defect_count == 0) {
        (void)remove(path); /* what is left over harms nothing but the reader */
        return BST_OK;
    }
    float *dark = malloc(pixels * sizeof *dark);
    if (!dark) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %zu pixels", pixels);
    }
    bst_twin_defect_map(t, camera->dark_e, dark);
    for (size_t i = 0; i < pixels; i++) {
        dark[i] /= (float)t->frame->values.exposure_s;
    }
    bst_status status =
        bst_fits_write_map(ctx, path, t->model.width, t->model.height, dark, "electron/s");
    free(dark);
    return status;
}

bst_status bst_twin_write(bst_ctx *ctx, const bst_twin *t, bst_twin_camera *camera) {
    char path[4096];
    bst_process_frame frame;
    bst_process_node nodes[NODES];
    bst_process alone;
    cJSON *scenario;
    frame_alone(t, &frame, nodes, &alone);
    BST_TRY(bst_process_make_scenario(ctx, &alone, &scenario));
    bst_status status = change_scenario(ctx, t, scenario, camera);
    if (status != BST_OK) {
        cJSON_Delete(scenario);
        return status;
    }
    bst_twin_file(t, "_path.json", path);
    status = bst_cli_write_json(ctx, path, bst_process_make_pointing(&alone));
    if (status == BST_OK) {
        status = write_psf(ctx, t);
    }
    if (status == BST_OK) {
        status = write_dark(ctx, t, camera);
    }
    bst_twin_file(t, "_stars.bin", path);
    if (t->request->catalogue_only) {
        remove_stars(t, path);
    } else if (status == BST_OK) {
        status = bst_twin_write_stars(ctx, t, camera, path);
    }
    if (status != BST_OK) {
        cJSON_Delete(scenario);
        return status;
    }
    return bst_cli_write_json(ctx, t->request->out, scenario);
}
