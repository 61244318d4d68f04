/* Stars of the model: those of the catalogue, and those that the frame shows besides. */
#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/astro/bodies.h"
#include "sim/catalogue/stars.h"
#include "sim/process/twin/twin_internal.h"

/* Most stars of the catalogue and most found ones. */
enum { CATALOGUE_MOST = 1200, FOUND_MOST = BST_TWIN_STARS - CATALOGUE_MOST };
/* V of queries for all stars. */
static const double FAINTEST = 30.0;
/* Faintest star of the catalogue that is fitted, signal-to-noise ratio by the zero point. */
static const double CATALOGUE_SNR = 2.0;
/* Least share of a star's light on the frame. */
static const double LEAST_INSIDE = 0.05;
/* The end of a bright streak so far beside the frame lights its pixels: without the star, others
 * near the edge would be given its light. */
static const double EDGE_PX = 6.0;
/* A found star nearer than this to one that is so much brighter is what its fit left. */
static const double REMNANT_PX = 3.0, REMNANT_SHARE = 0.1;
enum { PATH_SAMPLES = 256 };

/* Share of a star's light on the frame, widened on all sides. */
static double share_within(const bst_twin_model *m, bst_vec3 apparent, double margin_px) {
    const double low = -0.5 - margin_px, x_most = m->width - 0.5 + margin_px,
                 y_most = m->height - 0.5 + margin_px;
    int inside = 0;
    for (int i = 0; i < PATH_SAMPLES; i++) {
        bst_quat q = bst_twin_path_attitude(&m->path, (i + 0.5) / PATH_SAMPLES);
        double x, y;
        inside += bst_camera_project(&m->camera, bst_quat_rotate(q, apparent), &x, &y) && x > low &&
                  y > low && x < x_most && y < y_most;
    }
    return (double)inside / PATH_SAMPLES;
}

static double share_inside(const bst_twin_model *m, bst_vec3 apparent) {
    return share_within(m, apparent, 0.0);
}

/* Electrons of the exposure that make a signal-to-noise ratio of 1. */
static double unit_snr_e(const bst_twin *t) {
    const bst_twin_model *m = &t->model;
    double area = 4.0 * BST_PI * m->psf.sigma_px * m->psf.sigma_px +
                  2.0 * sqrt(BST_PI) * m->psf.sigma_px * t->length_px;
    return m->noise_e * sqrt(area);
}

static int brighter_first(const void *a, const void *b) {
    const bst_star *p = a, *q = b;
    return (p->v_mag > q->v_mag) - (p->v_mag < q->v_mag);
}

/* Adds stars of a query that are sorted. */
static void add_sorted(bst_twin *t, const bst_star *stars, int count) {
    bst_twin_model *m = &t->model;
    double zero = t->process.zero_point_mag, least = CATALOGUE_SNR * unit_snr_e(t);
    double exposure_s = t->frame->values.exposure_s;
    for (int i = 0; i < count && m->count < CATALOGUE_MOST; i++) {
        const bst_star *s = &stars[i];
        double e = exposure_s * pow(10.0, 0.4 * (zero - (double)s->v_mag));
        if (isfinite(e) && e < least) {
            break;
        }
        bst_twin_star star = {.apparent = bst_light_apparent_star(&t->light, s->icrs),
                              .flux_e = isfinite(e) ? e : 0.0,
                              .sigma_e = NAN,
                              .expected_e = isfinite(e) ? e : NAN,
                              .icrs = s->icrs,
                              .v_mag = (double)s->v_mag,
                              .b_minus_v = (double)s->b_minus_v,
                              .id = s->id};
        star.inside = share_inside(m, star.apparent);
        bool lights = isfinite(e) && e * share_within(m, star.apparent, EDGE_PX) > least;
        if (star.inside > LEAST_INSIDE || lights) {
            m->stars[m->count++] = star;
        }
    }
    t->catalogue_stars = m->count;
}

bst_status bst_twin_query_stars(bst_ctx *ctx, const bst_twin *t, const bst_stars *catalogue,
                                bst_vec3 centre, double radius_rad, bst_star **out, int *count) {
    double radius = fmin(radius_rad, BST_PI);
    int all;
    *out = NULL;
    *count = 0;
    const bst_star_query cone = {centre, radius, FAINTEST, {t->julian_year, t->light.sun_m}};
    BST_TRY(bst_stars_query_seen(ctx, catalogue, &cone, NULL, 0, &all));
    bst_star *stars = malloc(((size_t)all + 1) * sizeof *stars);
    if (!stars) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d stars", all);
    }
    bst_status status = bst_stars_query_seen(ctx, catalogue, &cone, stars, all, count);
    if (status != BST_OK) {
        free(stars);
        return status;
    }
    *out = stars;
    return BST_OK;
}

bst_status bst_twin_add_catalogue(bst_ctx *ctx, bst_twin *t) {
    bst_stars *catalogue;
    const bst_camera *camera = &t->model.camera;
    bst_star *found;
    int count;
    bst_vec3 ahead = bst_quat_rotate(bst_quat_conj(t->frame->q_middle), (bst_vec3){0, 0, 1});
    double radius = bst_camera_half_diagonal_rad(camera) +
                    (t->length_px + 20.0) * bst_camera_scale_rad(camera) + 1e-3;
    BST_TRY(bst_stars_open(ctx, t->process_request.catalogue, &catalogue));
    bst_status status = bst_twin_query_stars(ctx, t, catalogue, ahead, radius, &found, &count);
    bst_stars_close(catalogue);
    BST_TRY(status);
    qsort(found, (size_t)count, sizeof *found, brighter_first);
    add_sorted(t, found, count);
    free(found);
    return BST_OK;
}

/* The path of a star at the frame's middle, as the matched filter takes it. */
static bool make_path(const bst_twin *t, bst_star_path *path) {
    const bst_twin_model *m = &t->model;
    bst_star_path_node nodes[PATH_SAMPLES + 1];
    bst_quat back = bst_quat_conj(bst_twin_path_attitude(&m->path, 0.5));
    bst_vec3 v = bst_camera_unproject(&m->camera, 0.5 * (m->width - 1), 0.5 * (m->height - 1));
    path->centre[0] = 0.5 * (m->width - 1);
    path->centre[1] = 0.5 * (m->height - 1);
    path->tangent_per_px = bst_camera_scale_rad(&m->camera);
    for (int i = 0; i <= PATH_SAMPLES; i++) {
        double u = (double)i / PATH_SAMPLES;
        bst_quat turn = bst_quat_mul(bst_twin_path_attitude(&m->path, u), back);
        nodes[i].time = u;
        if (!bst_camera_project(&m->camera, bst_quat_rotate(turn, v), &nodes[i].x_px,
                                &nodes[i].y_px)) {
            return false;
        }
    }
    return bst_star_path_of_motion(path, nodes, PATH_SAMPLES + 1);
}

/* Mean place of a star's image. */
static void mean_place(const bst_twin_model *m, bst_vec3 apparent, double place[2]) {
    place[0] = place[1] = 0.0;
    for (int i = 0; i < PATH_SAMPLES; i++) {
        double x, y;
        bst_quat q = bst_twin_path_attitude(&m->path, (i + 0.5) / PATH_SAMPLES);
        if (bst_camera_project(&m->camera, bst_quat_rotate(q, apparent), &x, &y)) {
            place[0] += x / PATH_SAMPLES;
            place[1] += y / PATH_SAMPLES;
        }
    }
}

/* Adds a detection unless it is the remnant of a star. */
static bool add_detection(bst_twin *t, const bst_detection *d, const double (*places)[2]) {
    bst_twin_model *m = &t->model;
    for (int i = 0; i < m->count; i++) {
        if (hypot(places[i][0] - d->x_px, places[i][1] - d->y_px) < REMNANT_PX &&
            d->flux_e < REMNANT_SHARE * m->stars[i].flux_e) {
            return false;
        }
    }
    double mean[2];
    bst_quat back = bst_quat_conj(bst_twin_path_attitude(&m->path, 0.5));
    bst_twin_star star = {.flux_e = d->flux_e,
                          .sigma_e = NAN,
                          .expected_e = NAN,
                          .found = true,
                          .v_mag = NAN,
                          .b_minus_v = NAN};
    star.apparent =
        bst_vec3_unit(bst_quat_rotate(back, bst_camera_unproject(&m->camera, d->x_px, d->y_px)));
    for (int i = 0; i < 2; i++) { /* that was the place at half the time */
        mean_place(m, star.apparent, mean);
        bst_twin_star_shift(m, &star, d->x_px - mean[0], d->y_px - mean[1]);
    }
    star.inside = share_inside(m, star.apparent);
    if (star.inside <= LEAST_INSIDE) {
        return false;
    }
    m->stars[m->count++] = star;
    return true;
}

/* Finds stars on the residual. */
static bst_status search(bst_ctx *ctx, bst_twin *t, const float *residual, double least_snr,
                         int *added) {
    const bst_twin_model *m = &t->model;
    bst_star_path *path = malloc(sizeof *path);
    double(*places)[2] = malloc(BST_TWIN_STARS * sizeof *places);
    bst_streak_finder *finder = NULL;
    bst_common_streak streaks = {.count = 0};
    bst_status status =
        path && places ? BST_OK : bst_fail(ctx, BST_ERR_MEMORY, "no memory for a path");
    bool moving = status == BST_OK && make_path(t, path);
    const bst_common_streak_options options = {.max_sources = FOUND_MOST,
                                               .least_snr = least_snr,
                                               .tangent_per_px = bst_camera_scale_rad(&m->camera),
                                               .psf_sigma_px = m->psf.sigma_px,
                                               .known_path = moving};
    if (status == BST_OK) {
        status = bst_streak_finder_create(ctx, residual, m->width, m->height, &options, &finder);
    }
    if (status == BST_OK) {
        status =
            moving ? bst_streak_finder_follow(ctx, finder, path, least_snr, LEAST_INSIDE, &streaks)
                   : bst_streak_finder_find(ctx, finder, BST_STREAK_FINDER_POINT, &streaks);
    }
    for (int i = 0; i < m->count && status == BST_OK; i++) {
        mean_place(m, m->stars[i].apparent, places[i]);
    }
    for (int i = 0; i < streaks.count && m->count < BST_TWIN_STARS && status == BST_OK; i++) {
        int before = m->count;
        *added += add_detection(t, &streaks.items[i], (const double(*)[2])places);
        if (m->count > before) {
            mean_place(m, m->stars[before].apparent, places[before]);
        }
    }
    bst_streak_finder_free(finder);
    free(path);
    free(places);
    return status;
}

bst_status bst_twin_add_found(bst_ctx *ctx, bst_twin *t, double least_snr, int *added) {
    size_t count = (size_t)t->model.width * (size_t)t->model.height;
    float *residual = malloc(count * sizeof *residual);
    *added = 0;
    if (!residual) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %zu pixels", count);
    }
    bst_status status = bst_twin_model_residual(ctx, &t->model, t->pool, residual);
    if (status == BST_OK) {
        status = search(ctx, t, residual, least_snr, added);
    }
    free(residual);
    return status;
}

int bst_twin_remove_faint(bst_twin *t, double least_snr) {
    bst_twin_model *m = &t->model;
    int kept = 0, removed;
    for (int i = 0; i < m->count; i++) {
        const bst_twin_star *s = &m->stars[i];
        if (!s->found || (s->flux_e > least_snr * s->sigma_e)) {
            m->stars[kept++] = *s;
        }
    }
    removed = m->count - kept;
    m->count = kept;
    return removed;
}
