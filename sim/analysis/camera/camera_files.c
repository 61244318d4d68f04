/* Files that `boresight calibrate-camera` writes. */
#define _XOPEN_SOURCE 700 /* realpath */
#include <cjson/cJSON.h>
#include <math.h>
#include <stdlib.h>

#include "sim/analysis/camera/camera_calibration.h"
#include "sim/analysis/camera/camera_psf.h"
#include "sim/cli/print_json.h"
#include "sim/core/json_number.h"
#include "sim/io/draft_file.h"
#include "sim/io/plot.h"

/* Arrows of the plot are this many times as long as the residual. */
static const double ARROWS = 500.0;

typedef struct writer {
    const bst_camera_calibration_request *request;
    const bst_camera *start;
    const bst_camera_figures *figures;
    const bst_camera_fit_star *stars;
    const int64_t *exposures;
    int count;
} writer;

static void set_camera(const writer *w, cJSON *set, const char *key, double value) {
    char pointer[512];
    snprintf(pointer, sizeof pointer, "%.400s/%s", w->request->camera, key);
    bst_json_add_number(set, pointer, value);
}

static void set_text(const writer *w, cJSON *set, const char *key, const char *value) {
    char pointer[512];
    snprintf(pointer, sizeof pointer, "%.400s/%s", w->request->camera, key);
    cJSON_AddStringToObject(set, pointer, value);
}

/* The PSF of the file; its middle is that of the light within 3 px. */
static void set_psf(const writer *w, cJSON *set) {
    const bst_effective_psf_options *o = &w->figures->psf.options;
    set_text(w, set, "optics/psf", "file");
    set_text(w, set, "optics/psf_file", "psf.fits");
    set_text(w, set, "optics/file_centre", "array");
    set_camera(w, set, "optics/field_columns", o->columns);
    set_camera(w, set, "optics/field_rows", o->rows);
}

/* The scenario that changes a camera; NULL: out of memory. */
static cJSON *camera_json(const writer *w) {
    const bst_camera_geometry_fit *g = &w->figures->geometry;
    const bst_camera_distortion *d = &g->distortion;
    cJSON *root = cJSON_CreateObject();
    cJSON_AddNumberToObject(root, "boresight", 1);
    if (w->request->extends) {
        char *whole = realpath(w->request->extends, NULL);
        cJSON_AddStringToObject(root, "extends", whole ? whole : w->request->extends);
        free(whole);
    }
    cJSON *set = cJSON_AddObjectToObject(root, "set");
    set_camera(w, set, "pixel_scale_arcsec", g->pixel_scale_arcsec);
    /* all terms: their errors are correlated, and one alone left out would spoil the map */
    set_camera(w, set, "distortion/k1", d->k1);
    set_camera(w, set, "distortion/k2", d->k2);
    set_camera(w, set, "distortion/p1", d->p1);
    set_camera(w, set, "distortion/p2", d->p2);
    if (w->figures->psf.value) {
        set_psf(w, set);
    }
    return root;
}

static void add_value(cJSON *node, const char *key, double value, double sigma) {
    cJSON *one = cJSON_AddObjectToObject(node, key);
    bst_json_add_number(one, "value", value);
    bst_json_add_number(one, "standard_error", sigma);
}

/* All figures with their uncertainties; NULL: out of memory. */
static cJSON *report_json(const writer *w) {
    const bst_camera_geometry_fit *g = &w->figures->geometry;
    const bst_camera_photometry_fit *p = &w->figures->photometry;
    const bst_camera_widths *f = &w->figures->widths;
    cJSON *root = cJSON_CreateObject();
    cJSON *geometry = cJSON_AddObjectToObject(root, "geometry");
    cJSON_AddNumberToObject(geometry, "stars", g->stars);
    cJSON_AddNumberToObject(geometry, "rejected", g->rejected);
    cJSON_AddNumberToObject(geometry, "frames", g->frames);
    add_value(geometry, "pixel_scale_arcsec", g->pixel_scale_arcsec, g->pixel_scale_sigma_arcsec);
    add_value(geometry, "k1", g->distortion.k1, g->distortion_sigma.k1);
    add_value(geometry, "k2", g->distortion.k2, g->distortion_sigma.k2);
    add_value(geometry, "p1", g->distortion.p1, g->distortion_sigma.p1);
    add_value(geometry, "p2", g->distortion.p2, g->distortion_sigma.p2);
    bst_json_add_number(geometry, "corner_sigma_px", g->corner_sigma_px);
    bst_json_add_number(geometry, "rms_px", g->rms_px);
    bst_json_add_number(geometry, "scatter_px", g->scatter_px);
    if (f->stars > 0) {
        cJSON *psf = cJSON_AddObjectToObject(root, "psf");
        cJSON_AddNumberToObject(psf, "stars", f->stars);
        add_value(psf, "fwhm_px", f->fwhm_px, f->fwhm_sigma_px);
        cJSON *ninths = cJSON_AddArrayToObject(psf, "fwhm_px_by_ninth");
        for (int i = 0; i < 9; i++) {
            cJSON_AddItemToArray(ninths, isfinite(f->ninth_px[i])
                                             ? cJSON_CreateNumber(f->ninth_px[i])
                                             : cJSON_CreateNull());
        }
    }
    if (p->stars > 0) {
        cJSON *light = cJSON_AddObjectToObject(root, "photometry");
        cJSON_AddNumberToObject(light, "stars", p->stars);
        cJSON_AddNumberToObject(light, "rejected", p->rejected);
        add_value(light, "zero_point_mag", p->zero_point_mag, p->zero_point_sigma_mag);
        add_value(light, "colour_term", p->colour_term, p->colour_term_sigma);
        bst_json_add_number(light, "scatter_mag", p->scatter_mag);
    }
    return root;
}

static bst_status write_json(bst_ctx *ctx, const writer *w, const char *name, cJSON *node) {
    char path[4096 + 32];
    snprintf(path, sizeof path, "%s/%s", w->request->out, name);
    return bst_cli_write_json(ctx, path, node);
}

/* Writes each star with its residual. */
static bst_status write_stars(bst_ctx *ctx, const writer *w) {
    char path[4096 + 32];
    bst_draft draft;
    snprintf(path, sizeof path, "%s/stars.csv", w->request->out);
    BST_TRY(bst_draft_open(ctx, path, &draft));
    fputs(
        "exposure_id,star_id,x_px,y_px,residual_x_px,residual_y_px,v_mag,b_minus_v,electrons_per_"
        "s\r\n",
        draft.stream);
    for (int i = 0; i < w->count; i++) {
        const bst_camera_fit_star *s = &w->stars[i];
        fprintf(draft.stream, "%lld,%lld,%.4f,%.4f,", (long long)w->exposures[i], (long long)s->id,
                s->x_px, s->y_px);
        if (isnan(s->residual_x_px)) {
            fputs(",,", draft.stream);
        } else {
            fprintf(draft.stream, "%.5f,%.5f,", s->residual_x_px, s->residual_y_px);
        }
        fprintf(draft.stream, "%.3f,", s->v_mag);
        if (isfinite(s->b_minus_v)) {
            fprintf(draft.stream, "%.3f", s->b_minus_v);
        }
        fputc(',', draft.stream);
        if (isfinite(s->rate_e_per_s)) {
            fprintf(draft.stream, "%.6g", s->rate_e_per_s);
        }
        fputs("\r\n", draft.stream);
    }
    return bst_draft_close(ctx, &draft, BST_OK);
}

/* Plots the residuals over the field, and magnitudes against light. */
static bst_status plot(bst_ctx *ctx, const writer *w) {
    char path[4096 + 32];
    bst_plot p;
    snprintf(path, sizeof path, "%s/plot.png", w->request->out);
    BST_TRY(bst_plot_begin(ctx, &p, path, 1300, 640));
    fputs("$left << EOD\n", p.script);
    for (int i = 0; i < w->count; i++) {
        const bst_camera_fit_star *s = &w->stars[i];
        if (!isnan(s->residual_x_px)) {
            fprintf(p.script, "%.2f %.2f %.4f %.4f\n", s->x_px, s->y_px, ARROWS * s->residual_x_px,
                    ARROWS * s->residual_y_px);
        }
    }
    fputs("EOD\n$light << EOD\n", p.script);
    const bst_camera_photometry_fit *f = &w->figures->photometry;
    int lit = 0;
    for (int i = 0; i < w->count; i++) {
        const bst_camera_fit_star *s = &w->stars[i];
        if (f->stars > 0 && s->rate_e_per_s > 0.0 && isfinite(s->b_minus_v)) {
            fprintf(p.script, "%.4f %.4f\n", s->b_minus_v, s->v_mag + 2.5 * log10(s->rate_e_per_s));
            lit++;
        }
    }
    fprintf(p.script,
            "EOD\nset multiplot layout 1,2\nset size ratio -1\nset grid\nunset key\n"
            "set title 'places: measured - fitted, arrows x %g'\nset xlabel 'x (px)'\nset ylabel "
            "'y (px)'\nset xrange [0:%lld]\nset yrange [%lld:0]\n"
            "plot $left with vectors lc rgb '#0072b2'\n",
            ARROWS, (long long)w->start->width_px, (long long)w->start->height_px);
    if (lit > 0) {
        fprintf(p.script,
                "set size noratio\nset autoscale\nset title 'zero point of each star'\n"
                "set xlabel 'B-V (mag)'\nset ylabel 'V of 1 electron/s (mag)'\n"
                "plot $light with points pt 7 ps 0.4 lc rgb '#0072b2', %.6f + %.6f * x lw 2 lc rgb "
                "'#d55e00'\n",
                f->zero_point_mag, f->colour_term);
    }
    fputs("unset multiplot\n", p.script);
    return bst_plot_end(ctx, &p, NULL);
}

/* Removes the PSF of an earlier run, which would not belong to the new report. */
static void remove_earlier_psf(const bst_camera_calibration_request *request) {
    static const char *const names[] = {"psf.fits", "psf_sigma.fits"};
    char path[4096 + 32];
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        snprintf(path, sizeof path, "%s/%s", request->out, names[i]);
        (void)remove(path); /* mostly there is none */
    }
}

bst_status bst_camera_calibration_write(bst_ctx *ctx, const bst_camera_calibration_request *request,
                                        const bst_camera *start, const bst_camera_figures *figures,
                                        const bst_camera_fit_star *stars, const int64_t *exposures,
                                        int count) {
    const writer w = {request, start, figures, stars, exposures, count};
    if (request->overwrite) {
        remove_earlier_psf(request);
    }
    BST_TRY(write_stars(ctx, &w));
    BST_TRY(plot(ctx, &w));
    cJSON *report = report_json(&w);
    if (figures->psf.value) {
        bst_status status = bst_camera_psf_write(ctx, request->out, &figures->psf, report);
        if (status != BST_OK) {
            cJSON_Delete(report);
            return status;
        }
    }
    BST_TRY(write_json(ctx, &w, "report.json", report));
    return write_json(ctx, &w, "camera.json", camera_json(&w));
}
