/* Pixels of the frame whose level no light explains: hot pixels, radiation hits, and what the
 * subtraction of a dark frame left. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/compare.h"
#include "sim/process/twin/twin_defects.h"

/* A defect is off the model by more, standard deviations. */
static const double LEAST_SIGMA = 5.0;
/* Residual of a defect's neighbours over its own, at most, as a share of what a star has there. */
static const double SHARPNESS = 0.5;
enum { NEIGHBOURS = 8 };

double bst_twin_defect_neighbours(const bst_twin_psf *psf) {
    double s = sqrt(2.0) * psf->sigma_px, own = erf(0.5 / s);
    double beside = 0.5 * (erf(1.5 / s) - own) / own;
    /* four neighbours at 1 px, four at sqrt(2) px */
    return SHARPNESS * 0.5 * (beside + beside * beside);
}

/* Median residual of the neighbours that have a value; 0 without any. */
static double median_of_neighbours(const bst_twin_model *m, const float *residual, int x, int y) {
    float values[NEIGHBOURS];
    size_t n = 0;
    for (int dy = -1; dy <= 1; dy++) {
        for (int dx = -1; dx <= 1; dx++) {
            int u = x + dx, v = y + dy;
            if ((dx == 0 && dy == 0) || u < 0 || v < 0 || u >= m->width || v >= m->height) {
                continue;
            }
            float r = residual[(size_t)v * (size_t)m->width + (size_t)u];
            if (isfinite(r)) {
                values[n++] = r;
            }
        }
    }
    if (n == 0) {
        return 0.0;
    }
    qsort(values, n, sizeof *values, bst_compare_floats);
    return 0.5 * ((double)values[(n - 1) / 2] + (double)values[n / 2]);
}

/* Lists the defects of a residual; returns their number. out: NULL, or room for them. */
static int list(const bst_twin_model *m, const float *residual, const float *light,
                bst_twin_defect *out) {
    int count = 0;
    double most = bst_twin_defect_neighbours(&m->psf);
    for (int y = 0; y < m->height; y++) {
        for (int x = 0; x < m->width; x++) {
            size_t i = (size_t)y * (size_t)m->width + (size_t)x;
            double r = (double)residual[i], stars = fmax((double)light[i], 0.0);
            double form = m->form_error * stars;
            double sigma2 = m->noise_e * m->noise_e + stars + form * form;
            if (!(r * r > LEAST_SIGMA * LEAST_SIGMA * sigma2) ||
                median_of_neighbours(m, residual, x, y) * copysign(1.0, r) > most * fabs(r)) {
                continue;
            }
            if (out) {
                out[count] = (bst_twin_defect){x, y, r};
            }
            count++;
        }
    }
    return count;
}

/* Residual of the model, and the light of its stars. */
static bst_status residual_of(bst_ctx *ctx, const bst_twin *t, float *residual, float *light) {
    BST_TRY(bst_twin_model_render(ctx, &t->model, t->pool, light));
    return bst_twin_model_residual(ctx, &t->model, t->pool, residual);
}

bst_status bst_twin_find_defects(bst_ctx *ctx, bst_twin *t) {
    size_t pixels = (size_t)t->model.width * (size_t)t->model.height;
    float *residual = malloc(2 * pixels * sizeof *residual);
    bst_twin_defect *defects = NULL;
    bst_status status = residual
                            ? residual_of(ctx, t, residual, residual + pixels)
                            : bst_fail(ctx, BST_ERR_MEMORY, "no memory for %zu pixels", pixels);
    int count = 0;
    if (status == BST_OK) {
        count = list(&t->model, residual, residual + pixels, NULL);
        defects = malloc(((size_t)count + 1) * sizeof *defects);
        if (!defects) {
            status = bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d defects", count);
        }
    }
    if (status == BST_OK) {
        list(&t->model, residual, residual + pixels, defects);
        free(t->defects);
        t->defects = defects;
        t->defect_count = count;
    }
    free(residual);
    return status;
}

bst_status bst_twin_fit_defects(bst_ctx *ctx, bst_twin *t,
                                bst_status (*fit)(bst_ctx *ctx, bst_twin *twin)) {
    bst_twin_model *m = &t->model;
    size_t pixels = (size_t)m->width * (size_t)m->height;
    if (t->defect_count == 0) {
        return fit(ctx, t);
    }
    float *others = malloc(2 * pixels * sizeof *others);
    if (!others) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %zu pixels", pixels);
    }
    memcpy(others, t->data_e, pixels * sizeof *others);
    for (int i = 0; i < t->defect_count; i++) {
        const bst_twin_defect *d = &t->defects[i];
        others[(size_t)d->y * (size_t)m->width + (size_t)d->x] = NAN;
    }
    m->data_e = others;
    bst_status status = fit(ctx, t);
    m->data_e = t->data_e;
    if (status == BST_OK) {
        status = residual_of(ctx, t, others, others + pixels);
    }
    for (int i = 0; i < t->defect_count && status == BST_OK; i++) {
        bst_twin_defect *d = &t->defects[i];
        d->level_e = (double)others[(size_t)d->y * (size_t)m->width + (size_t)d->x];
    }
    free(others);
    return status;
}

void bst_twin_defect_map(const bst_twin *t, double uniform_e, float *dark_e) {
    const bst_twin_model *m = &t->model;
    for (size_t i = 0; i < (size_t)m->width * (size_t)m->height; i++) {
        dark_e[i] = (float)uniform_e;
    }
    for (int i = 0; i < t->defect_count; i++) {
        const bst_twin_defect *d = &t->defects[i];
        dark_e[(size_t)d->y * (size_t)m->width + (size_t)d->x] =
            (float)fmax(uniform_e + d->level_e, 0.0);
    }
}
