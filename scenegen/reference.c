#include "scenegen/reference_internal.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/world/scene/disc.h"

/* Sigmas beyond which a Gaussian's tail is below 1e-21. */
#define REACH_SIGMAS 9.5

/* Four-point Gauss-Legendre on [0, 1] (Abramowitz and Stegun, table 25.4). */
static const double gauss_place[4] = {0.06943184420297371, 0.33000947820757187, 0.66999052179242813,
                                      0.93056815579702629};
static const double gauss_weight[4] = {0.17392742256872693, 0.32607257743127307,
                                       0.32607257743127307, 0.17392742256872693};

/* Edge between pixels n - 1 and n, sigma * sqrt(2) from the centre, and the tail of the Gaussian
 * beyond it, on the side away from the centre: erfc, which keeps the relative precision of the
 * wings. */
typedef struct edge {
    double z, tail;
} edge;

static edge edge_before(int n, double x, double scale) {
    double z = (n - 0.5 - x) * scale;
    return (edge){z, erfc(fabs(z))};
}

static double share_between(edge a, edge b) {
    if (a.z > 0.0) {
        return 0.5 * (a.tail - b.tail);
    }
    if (b.z < 0.0) {
        return 0.5 * (b.tail - a.tail);
    }
    return 0.5 * (erf(b.z) - erf(a.z));
}

double bst_reference_pixel_share(double x, double sigma_px, int n) {
    double scale = 1.0 / (sigma_px * sqrt(2.0));
    return share_between(edge_before(n, x, scale), edge_before(n + 1, x, scale));
}

static int clamp_int(double v, int low, int high) {
    return v <= low ? low : v >= high ? high : (int)v;
}

/* Adds a Gaussian PSF at x, y (full-sensor px) with `electrons`; line: work space for one row. */
static void add_psf(bst_window w, double sigma, double x, double y, double electrons, double *line,
                    double *image) {
    double reach = REACH_SIGMAS * sigma + 1.0;
    int x0 = clamp_int(floor(x - reach), w.x0, w.x0 + w.width);
    int x1 = clamp_int(ceil(x + reach), w.x0 - 1, w.x0 + w.width - 1);
    int y0 = clamp_int(floor(y - reach), w.y0, w.y0 + w.height);
    int y1 = clamp_int(ceil(y + reach), w.y0 - 1, w.y0 + w.height - 1);
    if (x0 > x1 || y0 > y1) {
        return;
    }
    /* neighbours share an edge */
    double scale = 1.0 / (sigma * sqrt(2.0));
    edge from = edge_before(x0, x, scale);
    for (int i = x0; i <= x1; i++) {
        edge to = edge_before(i + 1, x, scale);
        line[i - w.x0] = electrons * share_between(from, to);
        from = to;
    }
    from = edge_before(y0, y, scale);
    for (int j = y0; j <= y1; j++) {
        edge to = edge_before(j + 1, y, scale);
        double share = share_between(from, to);
        double *row = image + (size_t)(j - w.y0) * (size_t)w.width;
        for (int i = x0; i <= x1; i++) {
            row[i - w.x0] += share * line[i - w.x0];
        }
        from = to;
    }
}

bool bst_reference_place(const bst_camera *camera, const bst_los_track *track,
                         const bst_scene_source *s, int k, double u, double *x, double *y,
                         double *light) {
    double from_s = track->time_s[k], dt = track->time_s[k + 1] - from_s;
    bst_quat q = bst_quat_slerp(track->q_cam_from_gcrf[k], track->q_cam_from_gcrf[k + 1], u);
    bst_vec3 v = bst_scene_source_direction(s, (from_s + u * dt) / track->time_s[track->count - 1]);
    v = bst_scene_source_seen(camera, s, bst_quat_rotate(q, v));
    if (!bst_camera_project(camera, v, x, y)) {
        return false;
    }
    *light = bst_scene_source_rate_at(s, (from_s + u * dt) / track->time_s[track->count - 1]);
    return true;
}

/* Renders one source with each interval between LOS samples in `parts` parts. */
static void render_source(const bst_camera *camera, double sigma, bst_window w,
                          const bst_los_track *track, const bst_scene_source *s, int parts,
                          double *line, double *image) {
    for (int k = 0; k + 1 < track->count; k++) {
        double dt = track->time_s[k + 1] - track->time_s[k];
        for (int n = 0; n < 4 * parts && dt > 0.0; n++) {
            double u = ((double)(n / 4) + gauss_place[n % 4]) / parts;
            double x, y, light;
            if (bst_reference_place(camera, track, s, k, u, &x, &y, &light)) {
                add_psf(w, sigma, x, y,
                        light * s->electrons_per_s * dt * gauss_weight[n % 4] / parts, line, image);
            }
        }
    }
}

static bst_status render_gaussian(bst_ctx *ctx, const bst_camera *camera, double sigma,
                                  bst_window window, const bst_los_track *track,
                                  const bst_scene_source *sources, int count, double tolerance,
                                  double *image) {
    size_t pixels = (size_t)window.width * (size_t)window.height;
    double *coarse = malloc(pixels * sizeof *coarse), *fine = malloc(pixels * sizeof *fine);
    double *line = malloc((size_t)window.width * sizeof *line);
    bst_status status = BST_OK;
    if (!coarse || !fine || !line) {
        status = bst_fail(ctx, BST_ERR_MEMORY, "no memory for a reference image of %d x %d pixels",
                          window.width, window.height);
        goto exit;
    }
    for (int i = 0; i < count; i++) {
        if (sources[i].occulted || !(sources[i].electrons_per_s > 0.0)) {
            continue;
        }
        memset(fine, 0, pixels * sizeof *fine);
        render_source(camera, sigma, window, track, &sources[i], 1, line, fine);
        double change = 1.0, peak = 0.0;
        for (int parts = 2; change > tolerance * peak; parts *= 2) {
            if (parts > 1 << 14) {
                status = bst_fail(ctx, BST_ERR_NUMERIC,
                                  "the reference image of source %d does not settle", i);
                goto exit;
            }
            double *swap = coarse;
            coarse = fine;
            fine = swap;
            memset(fine, 0, pixels * sizeof *fine);
            render_source(camera, sigma, window, track, &sources[i], parts, line, fine);
            change = 0.0;
            /* a source that only touches the window needs no 1e-9 accuracy of its faint tail */
            peak = 1e-9 * sources[i].electrons_per_s * track->time_s[track->count - 1];
            for (size_t p = 0; p < pixels; p++) {
                double step = fabs(fine[p] - coarse[p]);
                change = step > change ? step : change; /* fmax is a call */
                peak = fine[p] > peak ? fine[p] : peak;
            }
        }
        for (size_t p = 0; p < pixels; p++) {
            image[p] += fine[p];
        }
    }
exit:
    free(coarse);
    free(fine);
    free(line);
    return status;
}

/* Replaces extended sources by point sources at the points of their discs. The caller frees *out
 * and *paths. */
static bst_status split_discs(bst_ctx *ctx, const bst_camera *camera,
                              const bst_scene_source *sources, int count, bst_scene_source **out,
                              bst_scene_source_path **paths, int *made) {
    bst_disc_points points = {0};
    bst_status status = BST_OK;
    double panel = fmin(bst_camera_psf_sigma_px(camera), 1.0) * bst_camera_scale_rad(camera);
    *made = 0;
    for (int pass = 0; pass < 2; pass++) {
        int n = 0, moving = 0;
        for (int i = 0; i < count && status == BST_OK; i++) {
            const bst_scene_source *s = &sources[i];
            points.count = 0;
            if (s->shape && 2.0 * asin(s->shape->radius) > 400.0 * panel) {
                status = bst_fail(ctx, BST_ERR_NUMERIC,
                                  "the disc of source %d is too large for a reference image", i);
            } else if (s->shape) {
                status = bst_disc_make_points(ctx, s, BST_DISC_ALL, panel, &points);
            }
            for (int p = 0; p < (s->shape ? points.count : 1) && status == BST_OK; p++, n++) {
                if (pass == 0) {
                    continue;
                }
                bst_scene_source *part = &(*out)[n];
                *part = *s;
                if (!s->shape) {
                    continue;
                }
                bst_vec3 offset = points.items[p].offset;
                part->shape = NULL;
                part->electrons_per_s *= points.items[p].share;
                part->apparent_mid =
                    bst_vec3_unit(bst_vec3_add(bst_vec3_unit(s->apparent_mid), offset));
                if (s->path) {
                    bst_scene_source_path *path = &(*paths)[moving++];
                    double range = bst_vec3_norm(s->path->place[BST_PATH_NODES / 2]);
                    *path = *s->path;
                    for (int k = 0; k < BST_PATH_NODES; k++) {
                        path->place[k] = bst_vec3_axpy(path->place[k], range, offset);
                    }
                    part->path = path;
                }
            }
        }
        if (pass == 0 && status == BST_OK) {
            *out = malloc(((size_t)n + 1) * sizeof **out);
            *paths = malloc(((size_t)n + 1) * sizeof **paths);
            if (!*out || !*paths) {
                status = bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d points of discs", n);
            }
        }
        *made = n;
    }
    free(points.items);
    return status;
}

bst_status bst_reference_render_psf(bst_ctx *ctx, const bst_camera *camera, const bst_psf *psf,
                                    bst_window window, const bst_los_track *track,
                                    const bst_scene_source *sources, int count, double tolerance,
                                    double *image) {
    assert(camera && track && image && count >= 0 && (sources || count == 0) && tolerance > 0.0);
    size_t width = (size_t)window.width, height = (size_t)window.height;
    double sigma, *light = calloc(width * height, sizeof *light);
    if (!light) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for a reference image of %d x %d pixels",
                        window.width, window.height);
    }
    bst_scene_source *parts = NULL;
    bst_scene_source_path *paths = NULL;
    int made = 0;
    bst_status status = split_discs(ctx, camera, sources, count, &parts, &paths, &made);
    if (status == BST_OK) {
        status =
            bst_psf_gaussian(psf, &sigma)
                ? render_gaussian(ctx, camera, sigma, window, track, parts, made, tolerance, light)
                : bst_reference_spectrum(ctx, camera, psf, window, track, parts, made, tolerance,
                                         light);
    }
    for (size_t p = 0; p < width * height && status == BST_OK; p++) {
        double x = window.x0 + (double)(p % width), y = window.y0 + (double)(p / width);
        image[p] += bst_camera_illumination(camera, x, y) * light[p];
    }
    free(light);
    free(parts);
    free(paths);
    return status;
}

bst_status bst_reference_render(bst_ctx *ctx, const bst_camera *camera, bst_window window,
                                const bst_los_track *track, const bst_scene_source *sources,
                                int count, double tolerance, double *image) {
    bst_psf *psf;
    BST_TRY(bst_psf_create(ctx, camera, &psf));
    bst_status status =
        bst_reference_render_psf(ctx, camera, psf, window, track, sources, count, tolerance, image);
    bst_psf_free(psf);
    return status;
}
