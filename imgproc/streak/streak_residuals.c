/* What a matched filter along a path finds beside streaks: point sources on the path, and what the
 * subtraction of bright streaks left. */
#include <math.h>
#include <stdlib.h>

#include "imgproc/streak/common_streak_internal.h"
#include "imgproc/value_of_rank.h"
#include "sim/core/compare.h"

enum { CLIMB = 3 }; /* from a sample of a path to the pixel of a point source */
/* A peak whose median light along the path is below EVEN_SHARE of its mean is no streak. A sample
 * above LEAST_POINT sigma is a point source, of this radius in PSF sigma. */
static const double EVEN_SHARE = 0.35, LEAST_POINT = 5.0, POINT_SIGMA = 3.5;
/* Light this near to a star's path, in PSF sigma, and fainter than this share of it, may be what
 * its subtraction left. */
static const double COVER_SIGMA = 3.5, COVERED_SHARE = 0.2;
/* Least light of a sample relative to the path's mean, for the median. */
static const double LEAST_LIGHT = 0.2;

typedef bst_streak_finder finder;

/* Least weight of a pixel that shows the light of a path. */
static const float LEAST_WEIGHT = 0.5f;

/* Weight of the pixel at a place. */
static float weight_at(const finder *f, double x, double y) {
    return f->weights ? f->weights[(int)lround(y) * f->width + (int)lround(x)] : 1.0f;
}

/* Light of a peak's path: median of its samples, and the brightest. */
typedef struct path_light {
    double median; /* of the light over that of the path; NAN: no sample is inside */
    double x, y, most;
} path_light;

static path_light light_along(const finder *f, const bst_path_filter_peak *peak) {
    const bst_star_path_image image = {f->smooth, f->width, f->height};
    float values[BST_STAR_PATH_ROOM];
    double m[3];
    int inside = 0;
    path_light out = {.most = -HUGE_VAL};
    bst_star_path_map(&f->path, peak->x_px, peak->y_px, m);
    for (int k = 0; k < f->path.count; k++) {
        const double *p = f->path.place[k];
        double x = peak->x_px + m[0] * p[0] + m[1] * p[1];
        double y = peak->y_px + m[1] * p[0] + m[2] * p[1];
        if (!(x >= 0.0 && y >= 0.0 && x < f->width - 1 && y < f->height - 1)) {
            continue;
        }
        float weight = weight_at(f, x, y);
        if (weight < LEAST_WEIGHT) {
            continue;
        }
        double v = bst_star_path_image_at(&image, x, y) / (double)weight;
        values[inside++] = (float)(v / fmax(f->path.light[k], LEAST_LIGHT));
        if (v > out.most) {
            out.x = x;
            out.y = y;
            out.most = v;
        }
    }
    qsort(values, (size_t)inside, sizeof *values, bst_compare_floats);
    out.median = inside > 0 ? (double)values[inside / 2] : NAN;
    return out;
}

/* Moves to the highest pixel nearby. */
static void climb(const finder *f, path_light *at) {
    int cx = (int)lround(at->x), cy = (int)lround(at->y);
    for (int y = cy - CLIMB > 0 ? cy - CLIMB : 0; y <= cy + CLIMB && y < f->height; y++) {
        for (int x = cx - CLIMB > 0 ? cx - CLIMB : 0; x <= cx + CLIMB && x < f->width; x++) {
            if ((double)f->smooth[y * f->width + x] > at->most) {
                at->most = (double)f->smooth[y * f->width + x];
                at->x = x;
                at->y = y;
            }
        }
    }
}

/* Removes the point source that makes a peak of the filter: light that is at one place of the path
 * only. Returns false if the light is spread along the path. */
bool bst_streak_finder_remove_point(finder *f, bst_path_filter *filter,
                                    const bst_path_filter_peak *peak) {
    path_light l = light_along(f, peak);
    f->point[0] = f->point[1] = NAN;
    if (!(l.median < EVEN_SHARE * peak->amplitude)) {
        return false;
    }
    if (l.most < LEAST_POINT) {
        bst_path_filter_leave_out(filter, peak, CLIMB);
        return true;
    }
    climb(f, &l);
    f->point[0] = l.x;
    f->point[1] = l.y;
    bst_path_filter_subtract_point(filter, l.x, l.y, l.most);
    int r = (int)ceil(POINT_SIGMA * f->psf_sigma_px);
    int cx = (int)lround(l.x), cy = (int)lround(l.y);
    for (int y = cy - r > 0 ? cy - r : 0; y <= cy + r && y < f->height; y++) {
        for (int x = cx - r > 0 ? cx - r : 0; x <= cx + r && x < f->width; x++) {
            f->smooth[y * f->width + x] = 0.0f;
        }
    }
    return true;
}

/* Pixel of the frame at a sample of a star's path; -1: outside. */
static int pixel_on_path(const finder *f, double x_px, double y_px, const double m[3], int k) {
    const double *p = f->path.place[k];
    double x = x_px + m[0] * p[0] + m[1] * p[1], y = y_px + m[1] * p[0] + m[2] * p[1];
    bool inside = x > -0.5 && y > -0.5 && x < f->width - 0.5 && y < f->height - 0.5;
    return inside ? (int)lround(y) * f->width + (int)lround(x) : -1;
}

/* Notes the amplitude of a star around its path, in f->scratch. */
void bst_streak_finder_cover(finder *f, const bst_path_filter_peak *peak) {
    double m[3];
    const int r = (int)ceil(COVER_SIGMA * f->psf_sigma_px);
    const float amplitude = (float)peak->amplitude;
    bst_star_path_map(&f->path, peak->x_px, peak->y_px, m);
    for (int k = 0; k < f->path.count; k++) {
        int at = pixel_on_path(f, peak->x_px, peak->y_px, m, k);
        int cx = at % f->width, cy = at / f->width;
        for (int y = cy - r > 0 ? cy - r : 0; at >= 0 && y <= cy + r && y < f->height; y++) {
            for (int x = cx - r > 0 ? cx - r : 0; x <= cx + r && x < f->width; x++) {
                float *v = &f->scratch[y * f->width + x];
                *v = *v > amplitude ? *v : amplitude;
            }
        }
    }
}

/* True if most of a peak's path lies on those of much brighter stars: what their subtraction left.
 */
bool bst_streak_finder_is_covered(const finder *f, const bst_path_filter_peak *peak) {
    double m[3];
    int inside = 0, covered = 0;
    bst_star_path_map(&f->path, peak->x_px, peak->y_px, m);
    for (int k = 0; k < f->path.count; k++) {
        int at = pixel_on_path(f, peak->x_px, peak->y_px, m, k);
        inside += at >= 0;
        covered += at >= 0 && peak->amplitude < COVERED_SHARE * (double)f->scratch[at];
    }
    return 2 * covered > inside;
}

/* True for a peak without light of its own over most of its path: what the subtraction of a bright
 * star left beyond its ends. Places on the paths of much brighter stars are not looked at. */
bool bst_streak_finder_is_uneven(const finder *f, const bst_path_filter_peak *peak) {
    const bst_star_path_image image = {f->smooth, f->width, f->height};
    float values[BST_STAR_PATH_ROOM];
    double m[3];
    int free_places = 0;
    bst_star_path_map(&f->path, peak->x_px, peak->y_px, m);
    for (int k = 0; k < f->path.count; k++) {
        const double *p = f->path.place[k];
        int at = pixel_on_path(f, peak->x_px, peak->y_px, m, k);
        if (at < 0 || peak->amplitude < COVERED_SHARE * (double)f->scratch[at]) {
            continue;
        }
        double v = bst_star_path_image_at(&image, peak->x_px + m[0] * p[0] + m[1] * p[1],
                                          peak->y_px + m[1] * p[0] + m[2] * p[1]);
        values[free_places++] = (float)(v / fmax(f->path.light[k], LEAST_LIGHT));
    }
    if (free_places == 0) {
        return false;
    }
    float middle = bst_value_of_rank(values, free_places, free_places / 2);
    return (double)middle < EVEN_SHARE * peak->amplitude;
}
