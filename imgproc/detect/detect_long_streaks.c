/* Detection of star streaks that are longer than the matched filter for streaks: by the path that
 * all stars share (imgproc/streak/common_streak.h). */
#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "imgproc/detect/detect_internal.h"
#include "imgproc/streak/common_streak.h"

/* Variance of a position uniform over a pixel, px^2: widens the PSF to its integral over pixels. */
static const double PIXEL_VARIANCE = 1.0 / 12.0;
/* Share of the path that must be inside the frame, and its least length there, PSF sigma. */
static const double LEAST_INSIDE = 0.04, LEAST_PIECE_SIGMA = 6.0;
/* Fragments this far from a streak's path belong to it, PSF sigma; further from bright streaks. */
static const double NEAR_SIGMA = 3.0, MOST_NEAR_SIGMA = 8.0;

/* A point on a streak is another source if it is this much brighter than the streak's light there,
 * and by this many standard deviations. */
static const double OTHER_SHARE = 2.0, OTHER_SIGMA = 4.0;

/* Copies the signal above the background; what was not measured is NAN. */
static float *copy_signal(const bst_imgproc *ip) {
    const bst_locate_frame *v = &ip->view;
    size_t count = (size_t)v->width * (size_t)v->height;
    float *pixels = malloc(count * sizeof *pixels);
    for (size_t i = 0; pixels && i < count; i++) {
        float s = v->signal[i];
        pixels[i] = s >= BST_PIXEL_NONE ? s : s == BST_PIXEL_SATURATED ? (float)v->full_e : NAN;
    }
    return pixels;
}

/* Notes near the path of a star how bright a point its light looks like, if no other is brighter.
 */
static void mark_path(const bst_star_path *path, const bst_detection *d, double reach, float flux,
                      int width, int height, float *mask) {
    double m[3];
    int r = (int)ceil(reach);
    bst_star_path_map(path, d->x_px, d->y_px, m);
    for (int k = 0; k < path->count; k++) {
        double x = d->x_px + m[0] * path->place[k][0] + m[1] * path->place[k][1];
        double y = d->y_px + m[1] * path->place[k][0] + m[2] * path->place[k][1];
        if (!(x > -r && y > -r && x < width + r && y < height + r)) {
            continue;
        }
        int cx = (int)lround(x), cy = (int)lround(y);
        for (int j = cy - r < 0 ? 0 : cy - r; j <= cy + r && j < height; j++) {
            int from = cx - r < 0 ? 0 : cx - r, to = cx + r < width ? cx + r : width - 1;
            for (int i = from; i <= to; i++) {
                float *at = &mask[(size_t)j * (size_t)width + (size_t)i];
                *at = fmaxf(*at, flux);
            }
        }
    }
}

/* True for a point that is too bright for the streak on which it lies. */
static bool is_other(const bst_detection *d, double streak_e) {
    return !(d->flags & BST_DETECTION_STREAK) &&
           d->flux_e > OTHER_SHARE * streak_e + OTHER_SIGMA * d->flux_sigma_e;
}

/* Removes the detections near the paths of stars, but for brighter points; returns how many are
 * left. */
static int remove_fragments(const bst_imgproc *ip, const float *mask, bst_detections *out) {
    const bst_locate_frame *v = &ip->view;
    int kept = 0;
    for (int i = 0; i < out->count; i++) {
        int x = (int)lround((out->items[i].x_px - v->origin_x_px) / v->binning);
        int y = (int)lround((out->items[i].y_px - v->origin_y_px) / v->binning);
        bool inside = x >= 0 && y >= 0 && x < v->width && y < v->height;
        double streak = inside ? (double)mask[(size_t)y * (size_t)v->width + (size_t)x] : 0.0;
        if (!(streak > 0.0) || is_other(&out->items[i], streak)) {
            out->items[kept++] = out->items[i];
        }
    }
    out->count = kept;
    return kept;
}

/* A streak in sensor pixels. */
static bst_detection report(const bst_imgproc *ip, const bst_common_streak *found,
                            const bst_detection *d) {
    const bst_locate_frame *v = &ip->view;
    double b = v->binning;
    double dx = found->ends[1].x_px - found->ends[0].x_px;
    double dy = found->ends[1].y_px - found->ends[0].y_px;
    bst_detection s = *d;
    s.x_px = v->origin_x_px + b * d->x_px;
    s.y_px = v->origin_y_px + b * d->y_px;
    s.cov_xx *= b * b;
    s.cov_xy *= b * b;
    s.cov_yy *= b * b;
    s.length_px = ip->streak_px;
    s.width_px = b * v->sigma_px * 2.0 * sqrt(2.0 * log(2.0));
    s.angle_rad = atan2(dy, dx);
    s.v_mag = -2.5 * log10(s.flux_e / (fmax(ip->exposure_s, 1e-9) * ip->electrons_per_s_v0));
    s.flags |= BST_DETECTION_STREAK;
    return s;
}

static int by_place(const void *a, const void *b) {
    const bst_detection *d = a, *e = b;
    if (d->y_px != e->y_px) {
        return d->y_px < e->y_px ? -1 : 1;
    }
    return (d->x_px > e->x_px) - (d->x_px < e->x_px);
}

/* Replaces the fragments among the detections by the streaks. */
static bst_status replace(bst_ctx *ctx, bst_imgproc *ip, const bst_common_streak *found,
                          const bst_star_path *path, bst_detections *out, int capacity) {
    const bst_locate_frame *v = &ip->view;
    float *mask = calloc((size_t)v->width * (size_t)v->height, sizeof *mask);
    if (!mask) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the paths of %d streaks", found->count);
    }
    double per_px = found->sigma * path->count * BST_STAR_PATH_STEP_PX;
    for (int i = 0; i < found->count; i++) {
        /* where the wings of the PSF sink into the noise */
        double amplitude = fmax(found->items[i].flux_e / per_px, 1.0);
        double reach = NEAR_SIGMA + sqrt(2.0 * log(amplitude));
        /* response of the filter for points to a line */
        double per_length = found->items[i].flux_e / (path->count * BST_STAR_PATH_STEP_PX);
        double point = per_length * 2.0 * sqrt(BST_PI) * v->sigma_px;
        mark_path(path, &found->items[i], fmin(reach, MOST_NEAR_SIGMA) * v->sigma_px, (float)point,
                  v->width, v->height, mask);
    }
    (void)remove_fragments(ip, mask, out);
    free(mask);
    for (int i = 0; i < found->count; i++) {
        if (out->count < capacity) {
            out->items[out->count++] = report(ip, found, &found->items[i]);
        } else {
            out->lost++;
        }
    }
    qsort(out->items, (size_t)out->count, sizeof *out->items, by_place);
    return BST_OK;
}

/* Path of the nodes in pixels of the frame; false: it does not fit. */
static bool make_path(const bst_imgproc *ip, const bst_star_path_node *nodes, int count,
                      bst_star_path_node *scaled, bst_star_path *path) {
    const bst_locate_frame *v = &ip->view;
    for (int i = 0; i < count; i++) {
        scaled[i] = (bst_star_path_node){nodes[i].time, nodes[i].x_px / v->binning,
                                         nodes[i].y_px / v->binning};
    }
    path->centre[0] = 0.5 * (v->width - 1);
    path->centre[1] = 0.5 * (v->height - 1);
    path->tangent_per_px = bst_camera_scale_rad(&ip->camera) * v->binning;
    return bst_star_path_of_motion(path, scaled, count);
}

/* Finds the streaks along a path and replaces their fragments. */
static bst_status follow(bst_ctx *ctx, bst_imgproc *ip, const bst_star_path *path,
                         const float *pixels, bst_detections *out, int capacity) {
    const bst_locate_frame *v = &ip->view;
    const double psf = sqrt(v->sigma_px * v->sigma_px + PIXEL_VARIANCE);
    const bst_common_streak_options options = {.max_sources = capacity,
                                               .tangent_per_px = path->tangent_per_px,
                                               .psf_sigma_px = psf,
                                               .shot_variance = 1.0,
                                               .known_path = true};
    double length = path->count * BST_STAR_PATH_STEP_PX;
    double inside = fmin(fmax(LEAST_INSIDE, LEAST_PIECE_SIGMA * v->sigma_px / length), 1.0);
    double snr = bst_streak_path_threshold(path, v->width, v->height, psf, inside,
                                           ip->config.false_alarms_per_frame);
    bst_streak_finder *finder;
    bst_common_streak found;
    BST_TRY(bst_streak_finder_create(ctx, pixels, v->width, v->height, &options, &finder));
    bst_status status = bst_streak_finder_follow(ctx, finder, path, snr, inside, &found);
    if (status == BST_OK) {
        ip->streak_px = v->binning * length;
        out->threshold_snr = snr;
        /* of a line that is summed along the path after the convolution with the PSF */
        ip->followed_sigma_e = found.sigma * sqrt(2.0 * sqrt(BST_PI) * v->sigma_px * length);
        status = replace(ctx, ip, &found, path, out, capacity);
    }
    bst_streak_finder_free(finder);
    return status;
}

bst_status bst_imgproc_follow_streaks(bst_ctx *ctx, bst_imgproc *ip,
                                      const bst_star_path_node *nodes, int count,
                                      bst_detections *out, int capacity, bool *followed) {
    assert(ip && nodes && count >= 2 && out && followed && !ip->windowed);
    assert(ip->view.signal);
    bst_star_path_node *scaled = malloc((size_t)count * sizeof *scaled);
    bst_star_path *path = malloc(sizeof *path);
    float *pixels = copy_signal(ip);
    *followed = false;
    bst_status status = BST_OK;
    if (!scaled || !path || !pixels) {
        status = bst_fail(ctx, BST_ERR_MEMORY, "no memory for the path of the stars");
    } else if (make_path(ip, nodes, count, scaled, path)) {
        status = follow(ctx, ip, path, pixels, out, capacity);
        *followed = status == BST_OK;
    }
    free(scaled);
    free(path);
    free(pixels);
    return status;
}

bool bst_imgproc_is_followed(const bst_imgproc *ip, const bst_detection *d) {
    return ip->followed_sigma_e > 0.0 && (d->flags & BST_DETECTION_STREAK) &&
           d->length_px == ip->streak_px;
}
