#include "sim/analysis/characterize/linearity_series.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>

#include "sim/analysis/characterize/sensor_figures.h"

enum { LEAST_POINTS = 6, MOST_POINTS = 10000 };
static const double CLIP = 5.0;

void bst_linearity_series_free(bst_linearity_series *series) {
    free(series->points);
    *series = (bst_linearity_series){0};
}

/* qsort order by exposure. */
static int by_exposure(const void *a, const void *b) {
    double p = ((const bst_linearity_point *)a)->exposure_s,
           q = ((const bst_linearity_point *)b)->exposure_s;
    return (p > q) - (p < q);
}

/* Means and variances of the frames of one exposure. */
static bst_status add_point(bst_ctx *ctx, const bst_frame_stack *s, bst_linearity_series *out) {
    if (out->count == MOST_POINTS) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "flats of more than %d exposures were given",
                        MOST_POINTS);
    }
    if (out->count > 0 && (s->width != out->width || s->height != out->height)) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "a flat of %d x %d pixels after others of %d x %d (allowed: one size)",
                        s->width, s->height, out->width, out->height);
    }
    size_t pixels = (size_t)s->width * (size_t)s->height;
    bst_linearity_point *more =
        realloc(out->points, ((size_t)out->count + 1) * sizeof *out->points);
    float *scratch = malloc(pixels * sizeof *scratch);
    out->points = more ? more : out->points;
    if (!more || !scratch) {
        free(scratch);
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %zu pixels", pixels);
    }
    bst_linearity_point *p = &out->points[out->count++];
    *p = (bst_linearity_point){.exposure_s = s->exposure_s,
                               .frames = s->count,
                               .pairs = s->pairs,
                               .neighbours = s->neighbours};
    out->width = s->width;
    out->height = s->height;
    bst_sensor_block_moments(s->mean, s->width, s->height, CLIP, scratch, p->mean, p->scatter);
    for (int k = 0; k < BST_STACK_BLOCKS; k++) {
        p->variance[k] = s->pairs > 0 ? s->variance[k] : NAN;
        double noise = s->pairs > 0 ? s->variance[k] * (1.0 - 1.0 / s->count) : 0.0;
        p->scatter[k] = sqrt(p->scatter[k] + noise);
    }
    free(scratch);
    return BST_OK;
}

static bst_status read_points(bst_ctx *ctx, bst_recorded_frames *frames, const bst_keyword_map *map,
                              bst_linearity_series *out) {
    int64_t count = bst_recorded_frames_count(frames), first = 0;
    const bst_recorded_options options = {.map = map};
    double exposure_s = NAN;
    for (int64_t i = 0; i <= count; i++) {
        bst_recorded_frame f = {.path = NULL};
        if (i < count) {
            BST_TRY(bst_recorded_frames_select(ctx, frames, i, &options, &f));
        }
        bool same = i < count && fabs(f.values.exposure_s - exposure_s) <= 1e-3 * exposure_s + 1e-6;
        if (!same && i > 0) {
            bst_frame_stack stack;
            bst_status status =
                bst_frame_stack_reduce(ctx, "flat", frames, first, i - first, map, &stack);
            status = status == BST_OK ? add_point(ctx, &stack, out) : status;
            bst_frame_stack_free(&stack);
            BST_TRY(status);
            first = i;
        }
        exposure_s = same ? exposure_s : f.values.exposure_s;
    }
    return BST_OK;
}

bst_status bst_linearity_series_read(bst_ctx *ctx, const char *const *paths, int count,
                                     const bst_keyword_map *map, bst_linearity_series *out) {
    assert(paths && count > 0 && map && out);
    *out = (bst_linearity_series){0};
    bst_recorded_frames *frames = NULL;
    bst_status status = bst_recorded_frames_open(ctx, paths, count, map, &frames);
    status = status == BST_OK ? read_points(ctx, frames, map, out) : status;
    bst_recorded_frames_close(frames);
    BST_TRY(status);
    if (out->count < LEAST_POINTS) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "%s: the flats have %d exposures (allowed: %d or more, frames of one "
                        "exposure one after the other)",
                        paths[0], out->count, LEAST_POINTS);
    }
    qsort(out->points, (size_t)out->count, sizeof *out->points, by_exposure);
    return BST_OK;
}
