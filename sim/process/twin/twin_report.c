/* Runs the twin, and reports how its frame compares with the recorded one. */
#include <cjson/cJSON.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "sim/analysis/check/check_run.h"
#include "sim/cli/print_json.h"
#include "sim/core/file.h"
#include "sim/core/json_number.h"
#include "sim/io/draft_file.h"
#include "sim/io/fits_image.h"
#include "sim/io/html.h"
#include "sim/io/picture.h"
#include "sim/process/twin/twin_figures.h"

/* Grey level of a value in the pictures: 16 bits. */
static const double LEVELS = 65535.0;
/* Residuals are drawn between these, standard deviations. */
static const double RESIDUAL_LIMIT = 6.0;
/* Longest side of a panel, and the least that small frames are enlarged to, px. */
enum { LONGEST_PANEL = 1024, SHORTEST_PANEL = 480, HEADING = 26, GAP = 8 };

static bst_status run_scenario(bst_ctx *ctx, const bst_twin *t) {
    char out[4096];
    const bst_twin_request *q = t->request;
    bst_twin_file(t, "_run", out);
    const bst_simulation_options options = {
        .device = q->device, .threads = (int)q->threads, .parallel = true};
    const bst_run_request request = {
        .out = out, .overwrite = q->overwrite, .progress = !q->quiet && isatty(STDERR_FILENO)};
    bst_load_options load = BST_LOAD_DEFAULTS;
    return bst_check_run_file(ctx, q->out, load, NULL, &options, &request);
}

/* Reads an image of the frame's size. */
static bst_status read_file(bst_ctx *ctx, const bst_twin *t, const char *ending, float **out) {
    char path[4096];
    int width, height;
    bst_twin_file(t, ending, path);
    BST_TRY(bst_fits_read_image(ctx, path, &width, &height, out));
    if (width != t->model.width || height != t->model.height) {
        return bst_fail(ctx, BST_ERR_FORMAT, "%s: %d x %d pixels in place of %d x %d", path, width,
                        height, t->model.width, t->model.height);
    }
    return BST_OK;
}

/* Reads a noise-free plane of the run. */
static bst_status read_plane(bst_ctx *ctx, const bst_twin *t, const char *name, float **out) {
    char ending[64];
    snprintf(ending, sizeof ending, "_run/%s", name);
    return read_file(ctx, t, ending, out);
}

/* Levels of the defects by the dark map that the run has read; NULL: the twin has none. */
static bst_status read_defects(bst_ctx *ctx, const bst_twin *t, const bst_twin_camera *camera,
                               float **out) {
    if (t->defect_count == 0) {
        return BST_OK;
    }
    size_t pixels = (size_t)t->model.width * (size_t)t->model.height;
    float *dark;
    BST_TRY(read_file(ctx, t, "_dark.fits", &dark));
    *out = calloc(pixels, sizeof **out);
    bst_status status =
        *out ? BST_OK : bst_fail(ctx, BST_ERR_MEMORY, "no memory for %zu pixels", pixels);
    for (int k = 0; k < t->defect_count && status == BST_OK; k++) {
        size_t i = (size_t)t->defects[k].y * (size_t)t->model.width + (size_t)t->defects[k].x;
        (*out)[i] = (float)((double)dark[i] * t->frame->values.exposure_s - camera->dark_e);
    }
    free(dark);
    return status;
}

static void frames_free(bst_twin_frames *f) {
    free(f->stars_e);
    free(f->background_e);
    free(f->defects_e);
    free(f->residual_e);
    free(f->variance_e2);
}

/* Reads what the twin shows, and subtracts it from the recorded frame. */
static bst_status read_frames(bst_ctx *ctx, const bst_twin *t, const bst_twin_camera *camera,
                              bst_twin_frames *f) {
    size_t pixels = (size_t)t->model.width * (size_t)t->model.height;
    double noise2 = t->model.noise_e * t->model.noise_e;
    BST_TRY(read_plane(ctx, t, "stars.fits", &f->stars_e));
    BST_TRY(read_plane(ctx, t, "background.fits", &f->background_e));
    BST_TRY(read_defects(ctx, t, camera, &f->defects_e));
    f->residual_e = malloc(pixels * sizeof *f->residual_e);
    f->variance_e2 = malloc(pixels * sizeof *f->variance_e2);
    if (!f->residual_e || !f->variance_e2) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %zu pixels", pixels);
    }
    for (size_t i = 0; i < pixels; i++) {
        f->background_e[i] -= (float)(camera->background_e - camera->dark_e);
        f->residual_e[i] = t->data_e[i] - f->stars_e[i] - f->background_e[i] -
                           (f->defects_e ? f->defects_e[i] : 0.0F);
        f->variance_e2[i] = (float)(noise2 + fmax((double)f->stars_e[i], 0.0));
    }
    return BST_OK;
}

/* A frame of the picture. */
typedef struct panel {
    const char *title;
    const float *values;          /* NULL: values2 alone */
    const float *minus, *divide2; /* (values - minus) / sqrt(divide2); NULL: none */
    double low, high;
} panel;

/* Draws a panel. */
static bst_status draw(bst_ctx *ctx, const bst_twin *t, bst_picture *picture, int left, int side[2],
                       const panel *p) {
    int width = t->model.width, height = t->model.height;
    size_t pixels = (size_t)width * (size_t)height;
    uint16_t *grey = malloc(pixels * sizeof *grey);
    if (!grey) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %zu pixels", pixels);
    }
    for (size_t i = 0; i < pixels; i++) {
        double v = (double)p->values[i] - (p->minus ? (double)p->minus[i] : 0.0);
        v = p->divide2 ? v / sqrt((double)p->divide2[i]) : v;
        v = isfinite(v) ? (v - p->low) / (p->high - p->low) : 1.0;
        grey[i] = (uint16_t)(LEVELS * fmin(fmax(v, 0.0), 1.0));
    }
    const bst_io_stretch linear = {0.0, LEVELS, 1e3 * LEVELS};
    bst_status status =
        bst_picture_frame(ctx, picture, (bst_io_box){left, HEADING, side[0], side[1]}, grey, width,
                          height, 0, 0, width, height, linear);
    bst_picture_text(picture, left + 4, HEADING - 8, 11, (bst_io_colour){30, 30, 30}, false,
                     p->title);
    free(grey);
    return status;
}

/* Writes the picture: recorded, twin, residual. */
static bst_status write_picture(bst_ctx *ctx, const bst_twin *t, const bst_twin_frames *f,
                                const float *twin_e) {
    char path[4096];
    int longest = t->model.width > t->model.height ? t->model.width : t->model.height;
    double zoom = longest > LONGEST_PANEL    ? (double)LONGEST_PANEL / longest
                  : longest < SHORTEST_PANEL ? ceil((double)SHORTEST_PANEL / longest)
                                             : 1.0;
    int side[2] = {(int)(zoom * t->model.width), (int)(zoom * t->model.height)};
    bst_picture *picture;
    double noise = t->model.noise_e;
    const panel panels[] = {
        {"recorded, less the background", t->data_e, f->background_e, NULL, -3.0 * noise,
         15.0 * noise},
        {"twin, less the background", twin_e, f->background_e, NULL, -3.0 * noise, 15.0 * noise},
        {"residual, -6 to 6 sigma", f->residual_e, NULL, f->variance_e2, -RESIDUAL_LIMIT,
         RESIDUAL_LIMIT}};
    BST_TRY(bst_picture_create(ctx, 3 * side[0] + 2 * GAP, side[1] + HEADING,
                               (bst_io_colour){255, 255, 255}, &picture));
    bst_status status = BST_OK;
    for (int i = 0; i < 3 && status == BST_OK; i++) {
        status = draw(ctx, t, picture, i * (side[0] + GAP), side, &panels[i]);
    }
    if (status == BST_OK) {
        bst_twin_file(t, "_report.png", path);
        status = bst_picture_save(ctx, picture, path);
    }
    bst_picture_free(picture);
    return status;
}

/* The twin's frame with noise, electrons as data_e has them. */
static bst_status read_twin(bst_ctx *ctx, const bst_twin *t, const bst_twin_camera *camera,
                            bst_twin_frames *f, float **out) {
    char path[4096];
    bst_fits_source *source;
    bst_fits_source_frame place;
    size_t pixels = (size_t)t->model.width * (size_t)t->model.height;
    bst_twin_file(t, "_run/frames.fits", path);
    BST_TRY(bst_fits_source_open(ctx, path, &source));
    *out = malloc(pixels * sizeof **out);
    bst_status status = *out ? bst_fits_source_select(ctx, source, 0, &place)
                             : bst_fail(ctx, BST_ERR_MEMORY, "no memory for %zu pixels", pixels);
    if (status == BST_OK) {
        status = bst_fits_source_pixels(ctx, source, *out);
    }
    bst_fits_source_close(source);
    double mean = 0.0, dark = 0.0, recorded = 0.0, n = 0.0,
           gain = t->frame->values.gain_e_per_dn / t->process.map.dn_per_unit;
    for (size_t i = 0; i < pixels && status == BST_OK; i++) {
        (*out)[i] *= (float)gain;
        double level = (double)((*out)[i] - f->stars_e[i] - f->background_e[i]) -
                       (f->defects_e ? (double)f->defects_e[i] : 0.0);
        double r = (double)f->residual_e[i];
        mean += level / (double)pixels;
        if (r * r < 25.0 * (double)f->variance_e2[i] && (double)f->stars_e[i] < t->model.noise_e) {
            dark += level;
            recorded += r;
            n += 1.0;
        }
    }
    for (size_t i = 0; i < pixels && status == BST_OK; i++) {
        (*out)[i] -= (float)mean; /* offset, and the electrons behind the background */
    }
    f->level_dn = (dark - recorded) / n / gain - camera->recorded_offset_dn;
    return status;
}

bst_status bst_twin_report(bst_ctx *ctx, bst_twin *t, const bst_twin_camera *camera) {
    bst_twin_frames f = {.stars_e = NULL};
    bst_twin_figures figures;
    float *twin_e = NULL;
    bst_status status = run_scenario(ctx, t);
    if (status == BST_OK) {
        status = read_frames(ctx, t, camera, &f);
    }
    if (status == BST_OK) {
        status = read_twin(ctx, t, camera, &f, &twin_e);
    }
    if (status == BST_OK) {
        status = bst_twin_figures_compute(ctx, t, &f, &figures);
    }
    if (status == BST_OK) {
        status = write_picture(ctx, t, &f, twin_e);
    }
    if (status == BST_OK) {
        status = bst_twin_write_report(ctx, t, camera, &figures, &f);
    }
    free(twin_e);
    frames_free(&f);
    return status;
}
