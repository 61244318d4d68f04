#include "imgproc/streak/streak_rays.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>

#include "boresight/vec.h"
#include "imgproc/measure/peak_centroid.h"

/* Variance of a place uniform over a pixel, px^2: widens the PSF to its integral over pixels. */
static const double PIXEL_VARIANCE = 1.0 / 12.0;
/* A maximum of the filter's output on a line is above the line's mean: of maxima at SNR 5 to 10 the
 * mean is this share. Samples count up to LIGHT_CAP of it: another source is no longer line. */
static const double LINE_SHARE = 0.75, LIGHT_CAP = 1.5;
/* Least log-likelihood ratio of a line to sky for an attempt: that of noise reaches it along one of
 * some 100 rays once in 80 sources. Least number of samples with light beside the source. */
static const double LEAST_RATIO = 9.0;
enum { LEAST_LIT = 2 };
/* Axes with less than this share of the line's light in their second and third samples together are
 * not looked along: noise has it on one of 15 axes at SNR 5, half a line has twice as much. */
static const double GLANCE_SHARE = 0.8;
/* A ray ends at a sample below this share of the line's light less this noise: a gap between two
 * sources. Half a line at SNR 5 is that dark on one sample in 50. */
static const double DARK_SHARE = 0.4, DARK_NOISE = 1.5;
/* A start is given up if its light, but for its ends, falls below this share of the line's less
 * this noise. */
static const double GAP_SHARE = 0.5, GAP_NOISE = 2.0, END_FWHM = 1.25;
/* A streak ends where the ratio has fallen by this: a gap that noise makes in one of 20,000. */
static const double LEAST_FALL = 10.0, RAY_FALL = 5.0;

/* Output of the point filter at a place, bilinear; NAN outside the frame. */
static double output_at(const bst_filter *filter, double x, double y) {
    if (!(x >= 0.0 && y >= 0.0 && x <= filter->width - 1.0 && y <= filter->height - 1.0)) {
        return NAN;
    }
    int i = (int)fmin(x, filter->width - 2.0), j = (int)fmin(y, filter->height - 2.0);
    i = i < 0 ? 0 : i;
    j = j < 0 ? 0 : j;
    int i1 = i + 1 < filter->width ? i + 1 : i, j1 = j + 1 < filter->height ? j + 1 : j;
    double p = x - i, q = y - j;
    return (1.0 - q) * ((1.0 - p) * (double)bst_filter_point_at(filter, i, j) +
                        p * (double)bst_filter_point_at(filter, i1, j)) +
           q * ((1.0 - p) * (double)bst_filter_point_at(filter, i, j1) +
                p * (double)bst_filter_point_at(filter, i1, j1));
}

double bst_streak_rays_peak(const bst_streak_rays *v, const bst_imgproc_found *s) {
    int x = s->peak_x, y = s->peak_y;
    bool inside = x >= 0 && y >= 0 && x < v->f->width && y < v->f->height;
    return inside ? (double)bst_filter_point_at(v->f->filter, x, y) : 0.0;
}

/* Light summed along a line, and how much more likely a line of that light is than the part of it
 * from which the sum began. */
typedef struct light_sum {
    double light, length_px; /* light: sum of the filter's output, px */
    double first;            /* squared light over length where it began, px */
    double decay_px, ratio;  /* ratio: logarithm of the likelihood ratio */
} light_sum;

static light_sum begin_sum(const bst_streak_rays *v, double line, double length_px) {
    double light = line * length_px;
    return (light_sum){.light = light,
                       .length_px = length_px,
                       .first = light * light / length_px,
                       .decay_px = v->decay_px};
}

/* Adds an output of the filter over a length. True if it is light of the line. */
static bool add_light(light_sum *s, double output, double length_px) {
    double line = s->light / s->length_px;
    s->light += fmin(output, LIGHT_CAP * line) * length_px;
    s->length_px += length_px;
    double light = fmax(s->light, 0.0);
    s->ratio = 0.5 * (light * light / s->length_px - s->first) / s->decay_px;
    return output > 0.5 * line;
}

/* Light along a ray from a source: that of the best end. */
typedef struct ray {
    double ratio, length_px, light; /* light: that of the ray alone */
    int lit;
} ray;

static ray look_along(const bst_streak_rays *v, const bst_imgproc_found *s, int axis, double line) {
    const double step = BST_FWHM_PER_SIGMA * v->f->sigma_px;
    light_sum sum = begin_sum(v, line, v->decay_px);
    const double own = sum.light;
    ray best = {.ratio = 0.0};
    int lit = 0;
    for (int k = 0; k < BST_STREAK_RAY_SAMPLES && sum.ratio > best.ratio - RAY_FALL; k++) {
        const bst_streak_ray_sample *at = &v->rays[s->streak][axis][k];
        int x = s->peak_x + at->dx, y = s->peak_y + at->dy;
        if (x < 0 || y < 0 || x >= v->f->width || y >= v->f->height) {
            break;
        }
        double z = (double)bst_filter_point_at(v->f->filter, x, y);
        if (z < DARK_SHARE * line - DARK_NOISE) {
            break;
        }
        bool light = add_light(&sum, z, step);
        lit += k > 0 && light; /* the first may be the source's own */
        if (sum.ratio > best.ratio) {
            best = (ray){sum.ratio, (double)at->distance_px, sum.light - own, lit};
        }
    }
    return best;
}

/* True if an axis of a source may have light: `most` limits each sample, `least` is the least sum.
 */
static bool glance_along(const bst_streak_rays *v, const bst_imgproc_found *s, int axis, float most,
                         float least) {
    const bst_filter *filter = v->f->filter;
    const bst_streak_ray_sample *at[4] = {&v->rays[s->streak][axis][1],
                                          &v->rays[s->streak][axis][2],
                                          &v->rays[s->streak][axis + BST_STREAK_AXES][1],
                                          &v->rays[s->streak][axis + BST_STREAK_AXES][2]};
    float sum = 0.0f;
    for (int i = 0; i < 4; i++) {
        int x = s->peak_x + at[i]->dx, y = s->peak_y + at[i]->dy;
        if (x >= 0 && y >= 0 && x < v->f->width && y < v->f->height) {
            float z = bst_filter_point_at(filter, x, y);
            sum += z < most ? z : most;
        }
    }
    return sum >= least;
}

/* Axes of a source that may have light; returns their number. */
static int glance(const bst_streak_rays *v, const bst_imgproc_found *s, double line,
                  int axes[BST_STREAK_AXES]) {
    const float most = (float)(LIGHT_CAP * line), least = (float)(GLANCE_SHARE * line);
    const bst_filter *filter = v->f->filter;
    const int reach = v->glance_px[s->streak], x = s->peak_x, y = s->peak_y;
    int count = 0;
    if (x < reach || y < reach || x >= v->f->width - reach || y >= v->f->height - reach) {
        for (int a = 0; a < BST_STREAK_AXES; a++) {
            axes[count] = a;
            count += glance_along(v, s, a, most, least);
        }
        return count;
    }
    const float *map = filter->point + (long)(y + filter->pad) * filter->stride + x + filter->pad;
    const int *at = v->glances[s->streak][0];
    for (int a = 0; a < BST_STREAK_AXES; a++, at += 4) {
        float p = map[at[0]], q = map[at[1]], r = map[at[2]], t = map[at[3]];
        p = p < most ? p : most;
        q = q < most ? q : most;
        r = r < most ? r : most;
        t = t < most ? t : most;
        axes[count] = a;
        count += p + q + r + t >= least;
    }
    return count;
}

/* True if the light of a start goes on without a gap from one end to the other: of two sources in
 * a row the output falls between them. */
static bool is_continuous(const bst_streak_rays *v, const bst_segment *s, double line) {
    const double most = fmax(s->half_px - END_FWHM * BST_FWHM_PER_SIGMA * v->f->sigma_px, 0.0);
    double sum = 0.0, least = INFINITY;
    int count = 0;
    for (double u = -most; u <= most; u += 1.0) {
        double x, y;
        bst_segment_place(s, u, &x, &y);
        double z = output_at(v->f->filter, x, y);
        sum += z;
        least = fmin(least, z);
        count++;
    }
    return least > GAP_SHARE * fmax(sum / count, line) - GAP_NOISE;
}

bool bst_streak_rays_start(const bst_streak_rays *v, const bst_imgproc_found *s, bst_segment *out) {
    double line = LINE_SHARE * bst_streak_rays_peak(v, s), most = LEAST_RATIO;
    bool found = false;
    int axes[BST_STREAK_AXES], count = line > 0.0 ? glance(v, s, line, axes) : 0;
    for (int i = 0; i < count; i++) {
        int k = axes[i];
        ray ahead = look_along(v, s, k, line), back = look_along(v, s, k + BST_STREAK_AXES, line);
        if (ahead.lit + back.lit < LEAST_LIT) {
            continue;
        }
        light_sum sum = begin_sum(v, line, v->decay_px);
        double length = ahead.length_px + back.length_px;
        (void)add_light(&sum, (ahead.light + back.light) / length, length);
        if (sum.ratio > most) {
            most = sum.ratio;
            double middle = 0.5 * (ahead.length_px - back.length_px),
                   angle = BST_PI * k / BST_STREAK_AXES;
            *out = (bst_segment){.x_px = s->source.shape.x_px + middle * cos(angle),
                                 .y_px = s->source.shape.y_px + middle * sin(angle),
                                 .angle_rad = angle,
                                 .half_px = 0.5 * length,
                                 .flux_e = line * s->noise_e * length,
                                 .sigma_px = v->sigma_px};
            found = true;
        }
    }
    return found && is_continuous(v, out, line);
}

double bst_streak_rays_beyond(const bst_streak_rays *v, const bst_segment *s, double side,
                              double line) {
    light_sum sum = begin_sum(v, line, 2.0 * s->half_px);
    double most = 0.0, length = 0.0;
    for (int r = 1; sum.ratio > most - LEAST_FALL; r++) {
        double x, y;
        bst_segment_place(s, side * (s->half_px + r), &x, &y);
        double z = output_at(v->f->filter, x, y);
        if (isnan(z)) {
            break;
        }
        (void)add_light(&sum, z, 1.0);
        if (sum.ratio > most) {
            most = sum.ratio;
            length = r;
        }
    }
    return length;
}

/* Sets the rays for points, or for the streaks of stars, from whose ends they begin. */
static void set_rays(bst_streak_rays *v, bool streak) {
    const double step = BST_FWHM_PER_SIGMA * v->f->sigma_px;
    bst_imgproc_shape star = {.x_px = 0.5 * v->f->width, .y_px = 0.5 * v->f->height};
    if (streak) {
        bst_peak_centroid_star_path(v->f, &star);
    }
    for (int a = 0; a < BST_STREAK_RAYS; a++) {
        double c = cos(BST_PI * a / BST_STREAK_AXES), q = sin(BST_PI * a / BST_STREAK_AXES);
        double from = fmax(0.5 * fabs(star.dx_px * c + star.dy_px * q) - 0.5 * step, 0.0);
        for (int k = 0; k < BST_STREAK_RAY_SAMPLES; k++) {
            double r = from + (k + 1) * step;
            v->rays[streak][a][k] =
                (bst_streak_ray_sample){(int)lround(r * c), (int)lround(r * q), (float)r};
        }
        for (int k = 1; k <= 2; k++) {
            const bst_streak_ray_sample *at = &v->rays[streak][a][k];
            int *reach = &v->glance_px[streak];
            v->glances[streak][a % BST_STREAK_AXES][2 * (a / BST_STREAK_AXES) + k - 1] =
                at->dy * (int)v->f->filter->stride + at->dx;
            *reach = abs(at->dx) > *reach ? abs(at->dx) : *reach;
            *reach = abs(at->dy) > *reach ? abs(at->dy) : *reach;
        }
    }
}

void bst_streak_rays_set(bst_streak_rays *v, const bst_locate_frame *f) {
    assert(v && f);
    *v = (bst_streak_rays){.f = f, .sigma_px = sqrt(f->sigma_px * f->sigma_px + PIXEL_VARIANCE)};
    v->decay_px = 2.0 * sqrt(BST_PI) * v->sigma_px;
    set_rays(v, false);
    if (f->filter->streak) {
        set_rays(v, true);
    }
}
