#include "sim/process/twin/twin_figures.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Pixels further off are outliers, standard deviations. */
static const double OUTLIER = 5.0;
/* A pixel of a streak has this much light of stars, in the noise's standard deviation. */
static const double STREAK = 1.0;

/* Sums over pixels. */
typedef struct sums {
    double chi2, residual2, light, light2, variance;
    int64_t count, fitted; /* pixels, and those whose own level is fitted */
} sums;

static void add(sums *s, double residual, double light, double variance) {
    s->chi2 += residual * residual / variance;
    s->residual2 += residual * residual;
    s->light += light;
    s->light2 += light * light;
    s->variance += variance;
    s->count++;
}

static double mean_chi2(const sums *s) {
    return s->count > s->fitted ? s->chi2 / (double)(s->count - s->fitted) : NAN;
}

/* Share of the variance of the light that the model explains; `noise`: the noise's part of it. */
static double explained(const sums *s, double noise) {
    double n = (double)s->count, total = s->light2 - s->light * s->light / n;
    return 1.0 - (s->residual2 - noise) / (total - noise);
}

/* Explained share by the catalogue's stars alone, with the brightness of the catalogue. */
static bst_status explain_by_catalogue(bst_ctx *ctx, const bst_twin *t, const bst_twin_frames *f,
                                       double *out) {
    size_t pixels = (size_t)t->model.width * (size_t)t->model.height;
    bst_twin_model m = t->model;
    float *light = malloc(pixels * sizeof *light);
    m.stars = malloc(BST_TWIN_STARS * sizeof *m.stars);
    bst_status status = light && m.stars
                            ? BST_OK
                            : bst_fail(ctx, BST_ERR_MEMORY, "no memory for %zu pixels", pixels);
    if (status == BST_OK) {
        m.count = 0;
        for (int i = 0; i < t->model.count; i++) {
            if (t->model.stars[i].expected_e > 0.0) {
                m.stars[m.count] = t->model.stars[i];
                m.stars[m.count++].flux_e = t->model.stars[i].expected_e;
            }
        }
        status = bst_twin_model_render(ctx, &m, t->pool, light);
    }
    sums s = {0};
    for (size_t i = 0; i < pixels && status == BST_OK; i++) {
        double r = (double)f->residual_e[i], v = (double)f->variance_e2[i];
        double data = (double)(f->residual_e[i] + f->stars_e[i]);
        bool fitted = f->defects_e && f->defects_e[i] != 0.0F;
        if (isfinite(r) && !fitted && r * r < OUTLIER * OUTLIER * v) {
            add(&s, data - (double)light[i], data, v);
        }
    }
    *out = explained(&s, s.variance);
    free(light);
    free(m.stars);
    return status;
}

/* Displacements of the catalogue's streaks. */
static bst_status measure_streaks(bst_ctx *ctx, const bst_twin *t, const bst_twin_frames *f,
                                  bst_twin_figures *out) {
    bst_twin_model m = t->model;
    double across = 0.0, along = 0.0;
    m.variance_e2 = f->variance_e2;
    for (int i = 0; i < m.count; i++) {
        const bst_twin_star *s = &m.stars[i];
        bst_twin_offset o;
        bool measured;
        if (s->found || !(s->flux_e > BST_TWIN_OFFSET_SNR * s->sigma_e) ||
            s->inside < BST_TWIN_OFFSET_INSIDE) {
            continue;
        }
        BST_TRY(bst_twin_star_offset(ctx, &m, s, f->residual_e, &o, &measured));
        if (measured) {
            across += o.across_px * o.across_px;
            along += o.along_px * o.along_px;
            out->streaks++;
        }
    }
    out->across_px = out->streaks > 0 ? sqrt(across / out->streaks) : NAN;
    out->along_px = out->streaks > 0 ? sqrt(along / out->streaks) : NAN;
    return BST_OK;
}

bst_status bst_twin_figures_compute(bst_ctx *ctx, const bst_twin *t, const bst_twin_frames *f,
                                    bst_twin_figures *out) {
    const bst_twin_model *m = &t->model;
    size_t pixels = (size_t)m->width * (size_t)m->height;
    sums all = {0}, streaks = {0}, clipped = {0}, streaks_clipped = {0}, header = {0},
         stars_alone = {0};
    double gain = t->frame->values.gain_e_per_dn;
    double header_noise2 = t->read_noise_e * t->read_noise_e + gain * gain / 12.0;
    *out = (bst_twin_figures){.outliers = 0};
    for (size_t i = 0; i < pixels; i++) {
        double r = (double)f->residual_e[i], v = (double)f->variance_e2[i];
        double defect = f->defects_e ? (double)f->defects_e[i] : 0.0;
        double stars = (double)f->stars_e[i], light = r + stars + defect;
        if (!isfinite(r)) {
            continue;
        }
        bool fitted = f->defects_e && f->defects_e[i] != 0.0F;
        bool on = stars > STREAK * m->noise_e;
        bool out_of = r * r >= OUTLIER * OUTLIER * v, in = !out_of && !fitted;
        add(&all, r, light, v);
        all.fitted += fitted;
        streaks.fitted += on && fitted;
        header.fitted += fitted;
        add(&stars_alone, r + defect, light, v);
        add(&header, r, light,
            header_noise2 + fmax((double)f->background_e[i], 0.0) + fmax(stars, 0.0));
        if (on) {
            add(&streaks, r, light, v);
        }
        if (in) {
            add(&clipped, r, light, v);
        }
        if (on && in) {
            add(&streaks_clipped, r, light, v);
        }
        out->outliers += out_of;
        out->streak_outliers += on && out_of;
    }
    out->pixels = all.count;
    out->streak_pixels = streaks.count;
    out->chi2 = mean_chi2(&all);
    out->chi2_stars = mean_chi2(&stars_alone);
    out->chi2_streaks = mean_chi2(&streaks);
    out->chi2_clipped = mean_chi2(&clipped);
    out->chi2_streaks_clipped = mean_chi2(&streaks_clipped);
    out->chi2_header = mean_chi2(&header);
    out->explained = explained(&all, 0.0);
    out->explained_clipped = explained(&clipped, clipped.variance);
    out->explained_streaks = 1.0 - streaks.residual2 / streaks.light2;
    BST_TRY(explain_by_catalogue(ctx, t, f, &out->explained_catalogue));
    return measure_streaks(ctx, t, f, out);
}
