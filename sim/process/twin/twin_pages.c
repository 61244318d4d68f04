/* The report of the twin: JSON, HTML, and a few lines on the standard output. */
#include <cjson/cJSON.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/cli/print_json.h"
#include "sim/core/json_number.h"
#include "sim/io/draft_file.h"
#include "sim/io/html.h"
#include "sim/process/twin/twin_figures.h"

/* Largest outliers that are listed, and side of the blocks of the background, px. */
enum { LISTED = 20, BLOCK = 32 };
/* A star of the catalogue whose brightness is off by more is listed, mag. */
static const double ODD_MAG = 0.75;

/* Chi squared per pixel on streaks, without outliers, of a path that is right: below 1.3 on real
 * and simulated frames, 2.2 where the solver took the ends of streaks for points. */
static const double MOST_CHI2 = 1.8;
/* Least pixels on streaks that tell it, and the largest share of them beyond 5 sigma. */
enum { LEAST_PIXELS = 50 };
static const double MOST_OUTLIERS = 0.05;

/* A pixel that the twin does not explain. */
typedef struct outlier {
    int x, y;
    double sigma, electrons;
} outlier;

/* The largest outliers; returns their number. */
static int list_outliers(const bst_twin *t, const bst_twin_frames *f, outlier out[LISTED]) {
    int n = 0;
    for (int i = 0; i < t->model.width * t->model.height; i++) {
        double r = (double)f->residual_e[i], s = r / sqrt((double)f->variance_e2[i]);
        if (!isfinite(s) || fabs(s) < 5.0 || (n == LISTED && fabs(s) <= fabs(out[n - 1].sigma))) {
            continue;
        }
        int at = n < LISTED ? n++ : n - 1;
        for (; at > 0 && fabs(out[at - 1].sigma) < fabs(s); at--) {
            out[at] = out[at - 1];
        }
        out[at] = (outlier){i % t->model.width, i / t->model.width, s, r};
    }
    return n;
}

/* Structure of the background that the quadratic leaves: standard deviation of the means of blocks
 * of pixels without stars, less the part of the noise. */
static double left_background(const bst_twin *t, const bst_twin_frames *f) {
    double sum2 = 0.0;
    int blocks = 0, width = t->model.width, height = t->model.height;
    for (int y0 = 0; y0 + BLOCK <= height; y0 += BLOCK) {
        for (int x0 = 0; x0 + BLOCK <= width; x0 += BLOCK) {
            double sum = 0.0, variance = 0.0;
            int n = 0;
            for (int k = 0; k < BLOCK * BLOCK; k++) {
                size_t i = (size_t)(y0 + k / BLOCK) * (size_t)width + (size_t)(x0 + k % BLOCK);
                double r = (double)f->residual_e[i], v = (double)f->variance_e2[i];
                if (isfinite(r) && r * r < 25.0 * v && (double)f->stars_e[i] < t->model.noise_e) {
                    sum += r;
                    variance += v;
                    n++;
                }
            }
            if (n > BLOCK * BLOCK / 8) {
                sum2 += (sum * sum - variance) / ((double)n * n);
                blocks++;
            }
        }
    }
    return blocks > 0 ? sqrt(fmax(sum2 / blocks, 0.0)) : NAN;
}

static void add_fit(cJSON *root, const bst_twin *t) {
    const bst_twin_model *m = &t->model;
    cJSON *fit = cJSON_AddObjectToObject(root, "fit");
    bst_json_add_number(fit, "pixel_scale_arcsec", m->camera.pixel_scale_arcsec);
    bst_json_add_number(fit, "path_length_px", bst_twin_path_length_px(m));
    cJSON_AddNumberToObject(fit, "path_coefficients", bst_twin_path_values(&m->path));
    cJSON_AddBoolToObject(fit, "direction_known", t->direction_known);
    cJSON_AddBoolToObject(fit, "converged", m->converged);
    bst_json_add_number(fit, "psf_sigma_px", m->psf.sigma_px);
    bst_json_add_number(fit, "psf_wide_sigma_px", bst_twin_psf_wide_px(&m->psf));
    bst_json_add_number(fit, "psf_wide_share", m->psf.wide);
    bst_json_add_number(fit, "noise_e", m->noise_e);
    bst_json_add_number(fit, "zero_point_mag", t->photometry.zero_point_mag);
    bst_json_add_number(fit, "colour_term_mag", t->photometry.colour_mag);
    cJSON_AddItemToObject(fit, "background_e",
                          cJSON_CreateDoubleArray(m->background_e, BST_TWIN_BACKGROUND));
}

/* True if the streaks are those of the frame: a wrong path leaves more than an odd PSF does. */
static bool fits(const bst_twin_figures *f) {
    return f->streak_pixels >= LEAST_PIXELS && isfinite(f->chi2_streaks_clipped) &&
           f->chi2_streaks_clipped <= MOST_CHI2 &&
           (double)f->streak_outliers <= MOST_OUTLIERS * (double)f->streak_pixels;
}

static void add_figures(cJSON *root, const bst_twin *t, const bst_twin_figures *f) {
    cJSON_AddBoolToObject(root, "streaks_fit", fits(f));
    cJSON *node = cJSON_AddObjectToObject(root, "figures");
    bst_json_add_number(node, "chi2_per_pixel", f->chi2);
    bst_json_add_number(node, "chi2_per_pixel_on_streaks", f->chi2_streaks);
    bst_json_add_number(node, "chi2_per_pixel_without_outliers", f->chi2_clipped);
    bst_json_add_number(node, "chi2_per_pixel_on_streaks_without_outliers",
                        f->chi2_streaks_clipped);
    bst_json_add_number(node, "chi2_per_pixel_without_defect_map", f->chi2_stars);
    bst_json_add_number(node, "chi2_per_pixel_by_header_noise", f->chi2_header);
    bst_json_add_number(node, "explained_variance", f->explained);
    bst_json_add_number(node, "explained_variance_of_light", f->explained_clipped);
    bst_json_add_number(node, "explained_variance_on_streaks", f->explained_streaks);
    bst_json_add_number(node, "explained_variance_of_light_by_catalogue", f->explained_catalogue);
    bst_json_add_number(node, "streaks_across_rms_px", f->across_px);
    bst_json_add_number(node, "streaks_along_rms_px", f->along_px);
    cJSON_AddNumberToObject(node, "streaks_measured", f->streaks);
    bst_json_add_number(node, "photometry_scatter_mag", t->photometry.scatter_mag);
    cJSON_AddNumberToObject(node, "photometry_stars", t->photometry.stars);
    bst_json_add_number(node, "photometry_scatter_bright_mag", t->photometry.bright_mag);
    cJSON_AddNumberToObject(node, "photometry_stars_bright", t->photometry.bright);
    cJSON_AddNumberToObject(node, "pixels", (double)f->pixels);
    cJSON_AddNumberToObject(node, "pixels_with_a_level_of_their_own", t->defect_count);
    cJSON_AddNumberToObject(node, "pixels_below_the_range", (double)t->below_range);
    cJSON_AddNumberToObject(node, "pixels_on_streaks", (double)f->streak_pixels);
    cJSON_AddNumberToObject(node, "pixels_on_streaks_beyond_5_sigma", (double)f->streak_outliers);
}

/* What the scenario's camera has in place of what the frame does not tell. */
static void add_camera(cJSON *root, const bst_twin_camera *c, const bst_twin_frames *frames) {
    cJSON *node = cJSON_AddObjectToObject(root, "camera");
    bst_json_add_number(node, "read_noise_e", c->read_noise_e);
    bst_json_add_number(node, "background_behind_e", c->background_e);
    bst_json_add_number(node, "dark_behind_e", c->dark_e);
    bst_json_add_number(node, "pedestal_dn", c->pedestal_dn);
    bst_json_add_number(node, "level_rendered_minus_recorded_dn", frames->level_dn);
}

static void add_stars(cJSON *root, const bst_twin *t) {
    cJSON *list = cJSON_AddArrayToObject(root, "stars");
    for (int i = 0; i < t->model.count; i++) {
        const bst_twin_star *s = &t->model.stars[i];
        cJSON *star = cJSON_CreateObject();
        double ra, dec;
        cJSON_AddItemToArray(list, star);
        bst_vec3_to_radec(s->found ? bst_light_catalogue_star(&t->light, s->apparent) : s->icrs,
                          &ra, &dec);
        bst_json_add_number(star, "ra_deg", (ra < 0.0 ? ra + 2.0 * BST_PI : ra) / BST_DEG_RAD);
        bst_json_add_number(star, "dec_deg", dec / BST_DEG_RAD);
        cJSON_AddBoolToObject(star, "in_catalogue", !s->found);
        bst_json_add_number(star, "v_mag", s->v_mag);
        bst_json_add_number(star, "b_minus_v", s->b_minus_v);
        bst_json_add_number(star, "flux_e", s->flux_e);
        bst_json_add_number(star, "flux_sigma_e", s->sigma_e);
        bst_json_add_number(star, "expected_e", s->expected_e);
        bst_json_add_number(star, "share_on_frame", s->inside);
    }
}

static bool is_odd(const bst_twin_star *s) {
    double ratio = s->flux_e / s->expected_e;
    return s->expected_e > 10.0 * s->sigma_e && fabs(2.5 * log10(fmax(ratio, 1e-6))) > ODD_MAG;
}

/* What the twin lacks. */
static void add_missing(cJSON *root, const bst_twin *t, const bst_twin_figures *f,
                        const bst_twin_frames *frames) {
    outlier list[LISTED];
    int n = list_outliers(t, frames, list), odd = 0;
    double found_e = 0.0, all_e = 0.0;
    for (int i = 0; i < t->model.count; i++) {
        const bst_twin_star *s = &t->model.stars[i];
        odd += is_odd(s);
        found_e += s->found ? s->flux_e : 0.0;
        all_e += s->flux_e;
    }
    cJSON *node = cJSON_AddObjectToObject(root, "missing");
    cJSON_AddNumberToObject(node, "stars_in_no_catalogue", t->model.count - t->catalogue_stars);
    bst_json_add_number(node, "light_in_no_catalogue", found_e / fmax(all_e, 1e-9));
    cJSON_AddNumberToObject(node, "catalogue_stars_off_by_0.75_mag", odd);
    cJSON_AddNumberToObject(node, "pixels_beyond_5_sigma", (double)f->outliers);
    bst_json_add_number(node, "background_structure_e", left_background(t, frames));
    cJSON *pixels = cJSON_AddArrayToObject(node, "largest_outliers");
    for (int i = 0; i < n; i++) {
        cJSON *pixel = cJSON_CreateObject();
        cJSON_AddItemToArray(pixels, pixel);
        cJSON_AddNumberToObject(pixel, "x_px", list[i].x);
        cJSON_AddNumberToObject(pixel, "y_px", list[i].y);
        cJSON_AddNumberToObject(pixel, "sigma", list[i].sigma);
        cJSON_AddNumberToObject(pixel, "electrons", list[i].electrons);
    }
}

/* A table of the numbers of a JSON object. */
static void write_table(FILE *out, const cJSON *root, const char *key) {
    const cJSON *node = cJSON_GetObjectItemCaseSensitive(root, key), *item;
    fprintf(out, "<h2>%s</h2>\n<table>\n", key);
    cJSON_ArrayForEach(item, node) {
        if (cJSON_IsNumber(item)) {
            fprintf(out, "<tr><td>%s</td><td>%.6g</td></tr>\n", item->string, item->valuedouble);
        }
    }
    fprintf(out, "</table>\n");
}

static bst_status write_page(bst_ctx *ctx, const bst_twin *t, const cJSON *root) {
    char path[4096], picture[4096];
    bst_draft draft;
    bst_twin_file(t, "_report.png", picture);
    bst_twin_file(t, "_report.html", path);
    BST_TRY(bst_draft_open(ctx, path, &draft));
    FILE *out = draft.stream;
    const char *slash = strrchr(picture, '/');
    fprintf(out,
            "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>Twin"
            "</title>\n<style>body{font-family:sans-serif;margin:2em}td{padding:0 1em}"
            "img{max-width:100%%}</style></head><body>\n<h1>Twin of ");
    char where[BST_FRAME_WHERE_TEXT];
    bst_html_format(out, "%s", bst_frame_where(t->frame->path, &t->frame->place, where));
    fprintf(out, "</h1>\n<p><img alt=\"recorded, twin, residual\" src=\"");
    bst_html_format(out, "%s", slash ? slash + 1 : picture);
    fprintf(out, "\"></p>\n");
    write_table(out, root, "figures");
    write_table(out, root, "fit");
    write_table(out, root, "camera");
    write_table(out, root, "missing");
    fprintf(out, "</body></html>\n");
    return bst_draft_close(ctx, &draft, BST_OK);
}

static void print(const bst_twin *t, const bst_twin_camera *camera, const bst_twin_figures *f) {
    const bst_twin_model *m = &t->model;
    printf("path       %.1f px, %d values%s\n", bst_twin_path_length_px(m),
           bst_twin_path_values(&m->path),
           t->direction_known ? "" : "; which end came first is not known");
    printf("scale      %.5f arcsec/px; PSF sigma %.3f px, %.0f %% in a Gaussian of %.2f px\n",
           m->camera.pixel_scale_arcsec, m->psf.sigma_px, 100.0 * m->psf.wide,
           bst_twin_psf_wide_px(&m->psf));
    printf("stars      %d of the catalogue, %d besides; zero point %.3f mag, colour term %.3f\n",
           t->catalogue_stars, m->count - t->catalogue_stars, t->photometry.zero_point_mag,
           t->photometry.colour_mag);
    printf("photometry scatter %.3f mag of %d stars; V < %g: %.3f mag of %d\n",
           t->photometry.scatter_mag, t->photometry.stars, BST_TWIN_BRIGHT_V,
           t->photometry.bright_mag, t->photometry.bright);
    printf("streaks    %.3f px across, %.3f px along, RMS of %d\n", f->across_px, f->along_px,
           f->streaks);
    printf("chi2       %.3f per pixel, %.3f on streaks; without %" PRId64
           " outliers %.3f and %.3f\n",
           f->chi2, f->chi2_streaks, f->outliers, f->chi2_clipped, f->chi2_streaks_clipped);
    if (t->defect_count > 0) {
        printf("defects    %d pixels have a level of their own; as residuals: chi2 %.3f\n",
               t->defect_count, f->chi2_stars);
    }
    if (t->below_range > 0) {
        printf("note       %" PRId64 " pixels are below the least count and have no value\n",
               t->below_range);
    }
    printf(
        "explained  %.2f %% of the light's variance (by the catalogue %.2f %%), %.2f %% on "
        "streaks with noise\n",
        100.0 * f->explained_clipped, 100.0 * f->explained_catalogue, 100.0 * f->explained_streaks);
    if (!fits(f)) {
        printf(
            "warning    the streaks of the twin are not those of the frame: chi2 on streaks is not "
            "below %g without outliers, or more than %g %% of %" PRId64
            " pixels there are outliers, or these are fewer than %d; look at %s_report.png\n",
            MOST_CHI2, 100.0 * MOST_OUTLIERS, f->streak_pixels, LEAST_PIXELS, t->stem);
    }
    if (camera->pedestal_dn > 0.0) {
        printf("note       the twin's level is %.6g DN above the recorded one: its offset is 0\n",
               camera->pedestal_dn);
    }
    if (!m->converged) {
        printf("note       the last fit ended at its limit of iterations\n");
    }
    fflush(stdout);
}

bst_status bst_twin_write_report(bst_ctx *ctx, const bst_twin *t, const bst_twin_camera *camera,
                                 const bst_twin_figures *f, const bst_twin_frames *frames) {
    char path[4096];
    cJSON *root = cJSON_CreateObject();
    cJSON_AddStringToObject(root, "frame", t->frame->path);
    if (t->frame->place.line > 0) {
        cJSON_AddNumberToObject(root, "line", (double)t->frame->place.line);
    } else if (t->frame->place.page > 0) {
        cJSON_AddNumberToObject(root, "page", (double)t->frame->place.page);
    } else if (t->frame->place.hdu > 0) {
        cJSON_AddNumberToObject(root, "hdu", t->frame->place.hdu);
    }
    add_figures(root, t, f);
    add_fit(root, t);
    add_camera(root, camera, frames);
    add_missing(root, t, f, frames);
    bst_status status = write_page(ctx, t, root);
    if (status != BST_OK) {
        cJSON_Delete(root);
        return status;
    }
    add_stars(root, t);
    print(t, camera, f);
    bst_twin_file(t, "_report.json", path);
    return bst_cli_write_json(ctx, path, root);
}
