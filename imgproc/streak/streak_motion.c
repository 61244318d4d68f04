#include "imgproc/streak/streak_motion.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "imgproc/measure/peak_centroid.h"
#include "sim/core/cholesky.h"
#include "sim/onboard/measured_path.h"

/* Least SNR of a streak used for the motion. */
static const double LEAST_SNR = 20.0;
/* Largest relative brightness of a neighbour that does not bias a streak. */
static const double ALONE_SHARE = 0.02;
/* A motion with a smaller correction needs no third round. */
static const double SMALL_STEP_PX = 0.2;
/* Rejection limit: chi-square, COMMON degrees of freedom, of a star's motion against the common
 * one. */
static const double REJECT_CHI2 = 25.0;
enum { COMMON = BST_STREAK_MOTION_COUNT, LOCAL = 4, ROUNDS = 4 };
/* number of brightest candidates searched for isolated stars */
enum { LOOKED_AT = 16 * BST_STREAK_MOTION_STARS };

typedef struct bst_streak_motion_star {
    bst_imgproc_shape shape;
    bst_imgproc_stamp stamp;
    double flux_e, product_e; /* flux; flux times widening */
    double start_x, start_y, noise_e, excess;
    double origin_x_px, origin_y_px; /* origin of the star's frame or window */
    /* step of the star's own parameters at fixed motion, and its change per step of the motion */
    double step[1 + COMMON][LOCAL];
    /* normal equations of the motion, the star's own parameters eliminated */
    double information[COMMON][COMMON], gradient[COMMON];
    const float *pixels; /* pixels and validity, as loaded by load_pixels */
    bool used;
} star;

bst_status bst_streak_motion_create(bst_ctx *ctx, int max_side, bst_streak_motion *out) {
    out->max_side = max_side;
    size_t plane = (size_t)max_side * (size_t)bst_simd_layout_round_up(max_side);
    out->planes = bst_pages_zero(plane * (BST_IMAGE_MOTION_PLANES + 2), sizeof *out->planes);
    out->scratch = bst_pages_zero(bst_source_profile_scratch(max_side), sizeof *out->scratch);
    out->pixels = bst_pages_zero(plane * 2 * BST_STREAK_MOTION_STARS, sizeof *out->pixels);
    out->stars = calloc(BST_STREAK_MOTION_STARS, sizeof *out->stars);
    if (!out->planes || !out->scratch || !out->pixels || !out->stars) {
        bst_streak_motion_free(out);
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory to measure motion");
    }
    return BST_OK;
}

void bst_streak_motion_free(bst_streak_motion *work) {
    bst_pages_free(work->planes);
    bst_pages_free(work->scratch);
    bst_pages_free(work->pixels);
    free(work->stars);
    *work = (bst_streak_motion){0};
}

/* True if a stamp lies inside the frame, has only usable pixels, and contains no significant
 * neighbour. */
static bool is_alone(const bst_locate_frame *f, const bst_candidates *candidates, int rank,
                     const bst_imgproc_stamp *s, double margin) {
    if (s->x0 <= 0 || s->y0 <= 0 || s->x0 + s->width >= f->width ||
        s->y0 + s->height >= f->height) {
        return false;
    }
    for (int j = 0; j < s->height; j++) {
        const float *row = f->signal + (size_t)(s->y0 + j) * (size_t)f->width + (size_t)s->x0;
        for (int i = 0; i < s->width; i++) {
            if (!(row[i] > BST_PIXEL_NONE)) {
                return false;
            }
        }
    }
    float least = (float)ALONE_SHARE * candidates->items[candidates->order[rank]].snr;
    for (int k = 0; k < candidates->count; k++) {
        const bst_candidate *c = &candidates->items[candidates->order[k]];
        if (c->snr < least) {
            break;
        }
        if (k != rank && c->x > s->x0 - margin && c->x < s->x0 + s->width + margin &&
            c->y > s->y0 - margin && c->y < s->y0 + s->height + margin) {
            return false;
        }
    }
    return true;
}

/* Margin about a path: for the PSF and an unknown motion error, px. */
static double stamp_margin(const bst_locate_frame *f) {
    return fmax(3.0, ceil(3.6 * f->sigma_px)) + 1.0;
}

/* Initialises the parameters of a star streak from a candidate. */
static bool start_star(const bst_streak_motion *work, const bst_locate_frame *f,
                       const bst_candidates *candidates, int rank, star *out) {
    const bst_candidate *c = &candidates->items[candidates->order[rank]];
    if (!(c->snr > bst_filter_point_at(f->filter, c->x, c->y))) {
        return false;
    }
    double dx, dy, snr = bst_filter_top(f->filter, false, c->x, c->y, &dx, &dy);
    bst_imgproc_shape shape = {.x_px = c->x + dx, .y_px = c->y + dy, .sigma_px = f->sigma_px};
    bst_camera_motion_streak(f->motion, f->camera, f->origin_x_px + f->binning * c->x,
                             f->origin_y_px + f->binning * c->y, &shape.dx_px, &shape.dy_px);
    bst_camera_motion_bend(f->motion, f->camera, &shape.bend_x_px, &shape.bend_y_px);
    shape.dx_px /= f->binning;
    shape.dy_px /= f->binning;
    shape.bend_x_px /= f->binning;
    shape.bend_y_px /= f->binning;
    shape.departure = f->departure;
    if (f->uneven) {
        bst_peak_centroid_on_path(f, &shape);
    }
    *out = (star){.shape = shape,
                  .start_x = shape.x_px,
                  .start_y = shape.y_px,
                  .used = true,
                  .origin_x_px = f->origin_x_px,
                  .origin_y_px = f->origin_y_px};
    out->noise_e = bst_background_noise_at(f->background, c->x, c->y);
    out->excess = f->excess;
    out->flux_e = snr * out->noise_e / f->filter->streak_norm;
    bst_imgproc_source source = {.shape = out->shape};
    out->stamp = bst_fit_stamp(&source, stamp_margin(f), work->max_side, f->width, f->height);
    double margin = 0.5 * hypot(out->shape.dx_px, out->shape.dy_px);
    return is_alone(f, candidates, rank, &out->stamp, margin);
}

/* Solves a x = v for a symmetric positive definite matrix of order n and `count` right-hand sides,
 * each a row of x, by Cholesky; false if it is not definite. */
static bool solve(int n, double a[LOCAL][LOCAL], int count, double x[][LOCAL]) {
    if (!bst_cholesky_factor(a[0], LOCAL, n, 0.0)) {
        return false;
    }
    for (int r = 0; r < count; r++) {
        bst_cholesky_solve(a[0], LOCAL, n, x[r]);
    }
    return true;
}

enum { ALL = LOCAL + COMMON, SUMS = ALL * (ALL + 3) / 2 };

#define BST_SIMD_KERNELS "imgproc/streak/streak_motion_kernels.inc"
#include "sim/core/pages.h"
#include "sim/core/simd_each.inc"

/* Loads a star's pixels, all usable, followed by their validity 1. */
static void load_pixels(const bst_locate_frame *f, const bst_imgproc_stamp *stamp, float *value) {
    int stride = bst_simd_layout_round_up(stamp->width), n = stride * stamp->height;
    float valid[BST_PSF_MAX_SIDE + BST_LANES];
    for (int x = 0; x < stride; x++) {
        valid[x] = x < stamp->width ? 1.0f : 0.0f;
    }
    for (int y = 0; y < stamp->height; y++) {
        const float *row =
            f->signal + (size_t)(stamp->y0 + y) * (size_t)f->width + (size_t)stamp->x0;
        float *to = value + y * stride;
        memset(to + stride - BST_LANES, 0, BST_LANES * sizeof *to);
        memcpy(to, row, (size_t)stamp->width * sizeof *to);
        memcpy(to + n, valid, (size_t)stride * sizeof *to);
    }
}

/* Accumulates the normal equations of one star streak at the current motion. */
static bool accumulate_star(const bst_streak_motion *work, const bst_imgproc_gauss *psf,
                            const bst_source_profiles *profiles, star *s) {
    int n = bst_simd_layout_round_up(s->stamp.width) * s->stamp.height;
    const double along[2] = {work->ex, work->ey};
    bst_source_profile_render_motion(profiles, psf, &s->shape, &s->stamp, along, work->scratch,
                                     work->planes);
    memcpy(work->planes + BST_IMAGE_MOTION_PLANES * n, s->pixels,
           2 * (size_t)n * sizeof *s->pixels);
    float sums[SUMS * BST_LANES];
    BST_SIMD_PICK(sum_star)
    (work->planes, n, (float)s->flux_e, (float)s->product_e,
     (float)(s->noise_e * s->noise_e / s->excess), sums);
    /* the kernel weighs by 1 / (noise2 + light): excess times the weight */
    const double scale = 1.0 / s->excess;
    double a[LOCAL][LOCAL] = {{0}}, right[1 + COMMON][LOCAL] = {{0}};
    double common[COMMON][COMMON] = {{0}}, g[COMMON] = {0};
    const float *at = sums;
    for (int p = 0; p < ALL; p++) {
        for (int q = 0; q <= p; q++, at += BST_LANES) {
            double v = scale * bst_simd_layout_sum(at);
            if (p < LOCAL) {
                a[p][q] = v;
            } else if (q < LOCAL) {
                right[1 + p - LOCAL][q] = v;
            } else {
                common[p - LOCAL][q - LOCAL] = v;
            }
        }
        *(p < LOCAL ? &right[0][p] : &g[p - LOCAL]) = scale * bst_simd_layout_sum(at);
        at += BST_LANES;
    }
    for (int r = 0; r <= COMMON; r++) {
        for (int p = 0; p < LOCAL; p++) {
            s->step[r][p] = right[r][p];
        }
    }
    if (!solve(LOCAL, a, 1 + COMMON, s->step)) {
        return false;
    }
    bool good = true;
    for (int k = 0; k < COMMON; k++) {
        s->gradient[k] = g[k];
        for (int p = 0; p < LOCAL; p++) {
            s->gradient[k] -= right[1 + k][p] * s->step[0][p];
        }
        for (int l = 0; l <= k; l++) {
            double v = common[k][l];
            for (int p = 0; p < LOCAL; p++) {
                v -= right[1 + k][p] * s->step[1 + l][p];
            }
            s->information[k][l] = s->information[l][k] = v;
        }
        good = good && s->information[k][k] > 0.0 && isfinite(s->gradient[k]);
    }
    return good;
}

static double clamp(double v, double limit) {
    return v < -limit ? -limit : v > limit ? limit : v;
}

/* Applies a step of the motion to a star's own parameters; false if the star diverges. */
static bool step_star(star *s, const double by[COMMON], double ex, double ey) {
    double step[LOCAL];
    for (int p = 0; p < LOCAL; p++) {
        step[p] = s->step[0][p];
        for (int k = 0; k < COMMON; k++) {
            step[p] -= by[k] * s->step[1 + k][p];
        }
    }
    s->shape.x_px += clamp(step[0], 0.7);
    s->shape.y_px += clamp(step[1], 0.7);
    s->shape.dx_px += by[0] * ex - by[1] * ey;
    s->shape.dy_px += by[0] * ey + by[1] * ex;
    s->shape.bend_x_px += by[2] * ex;
    s->shape.bend_y_px += by[2] * ey;
    /* limits of flux, width and position as in imgproc/measure/fit.c and deblend.c */
    s->flux_e = fmax(s->flux_e + step[2], 0.1 * s->flux_e);
    double variance = s->shape.sigma_px * s->shape.sigma_px * s->flux_e;
    s->product_e = fmax(-0.6 * variance, fmin(s->product_e + step[3], 1.8 * variance));
    double limit = 2.0 + 0.4 * hypot(s->shape.dx_px, s->shape.dy_px);
    return hypot(s->shape.x_px - s->start_x, s->shape.y_px - s->start_y) < limit &&
           isfinite(s->flux_e) && isfinite(s->product_e);
}

/* Joint motion step of all stars and the priors, and the covariance that is left. */
static bool solve_motion(const star *stars, int count, const double sigma[COMMON],
                         const double away[COMMON], double step[COMMON],
                         double covariance[COMMON][COMMON]) {
    double a[LOCAL][LOCAL] = {{0}}, x[1 + COMMON][LOCAL] = {{0}};
    for (int k = 0; k < COMMON; k++) {
        double prior = 1.0 / (sigma[k] * sigma[k]);
        a[k][k] = prior;
        x[0][k] = -prior * away[k];
        x[1 + k][k] = 1.0;
        for (int i = 0; i < count; i++) {
            if (stars[i].used) {
                x[0][k] += stars[i].gradient[k];
                for (int l = 0; l < COMMON; l++) {
                    a[k][l] += stars[i].information[k][l];
                }
            }
        }
    }
    if (!solve(COMMON, a, 1 + COMMON, x)) {
        return false;
    }
    for (int k = 0; k < COMMON; k++) {
        step[k] = x[0][k];
        memcpy(covariance[k], x[1 + k], sizeof covariance[k]);
    }
    return isfinite(step[0]) && isfinite(step[1]) && isfinite(step[2]);
}

/* Rejects stars whose motion disagrees with the common one: cosmic-ray hits, double stars. */
static void reject_outliers(star *stars, int count, const double step[COMMON]) {
    for (int i = 0; i < count; i++) {
        double a[LOCAL][LOCAL] = {{0}}, x[1][LOCAL] = {{0}}, left[COMMON], chi2 = 0.0;
        for (int k = 0; k < COMMON; k++) {
            left[k] = stars[i].gradient[k];
            for (int l = 0; l < COMMON; l++) {
                a[k][l] = stars[i].information[k][l];
                left[k] -= a[k][l] * step[l];
            }
            x[0][k] = left[k];
        }
        bool solved = stars[i].used && solve(COMMON, a, 1, x);
        for (int k = 0; k < COMMON; k++) {
            chi2 += left[k] * x[0][k];
        }
        stars[i].used = solved && chi2 < REJECT_CHI2;
    }
}

bool bst_streak_motion_begin(bst_streak_motion *work, const bst_locate_frame *f) {
    work->count = 0;
    if (!f->motion || !f->filter->streak) {
        return false;
    }
    double dx, dy, bend_x, bend_y;
    bst_camera_motion_streak(f->motion, f->camera, bst_camera_centre_x(f->camera),
                             bst_camera_centre_y(f->camera), &dx, &dy);
    bst_camera_motion_bend(f->motion, f->camera, &bend_x, &bend_y);
    double length = hypot(dx, dy);
    work->ex = dx / length;
    work->ey = dy / length;
    work->binning = f->binning;
    work->sigma_px = f->sigma_px;
    return bst_path_is_measured(length, hypot(bend_x, bend_y), f->sigma_px * f->binning, f->uneven);
}

void bst_streak_motion_add(bst_streak_motion *work, const bst_locate_frame *f,
                           const bst_candidates *candidates) {
    size_t plane = (size_t)work->max_side * (size_t)bst_simd_layout_round_up(work->max_side);
    for (int k = 0; k < candidates->count && k < LOOKED_AT; k++) {
        if (work->count == BST_STREAK_MOTION_STARS ||
            (double)candidates->items[candidates->order[k]].snr < LEAST_SNR) {
            break;
        }
        star *s = &work->stars[work->count];
        if (start_star(work, f, candidates, k, s)) {
            float *pixels = work->pixels + (size_t)work->count * 2 * plane;
            load_pixels(f, &s->stamp, pixels);
            s->pixels = pixels;
            work->count++;
        }
    }
}

bool bst_streak_motion_solve(bst_streak_motion *work, const bst_imgproc_gauss *psf,
                             bst_source_profiles *profiles, const bst_camera *camera,
                             double length_px, double bend_px, bst_camera_motion *motion) {
    assert(work && psf && profiles && camera && motion && length_px >= 0.0);
    star *stars = work->stars;
    int count = work->count, left = 0;
    double ex = work->ex, ey = work->ey, b = work->binning;
    bst_source_profiles_on(profiles, 0.0, 0.0, (int)b);
    bst_source_profiles_set(profiles, psf, work->sigma_px);
    /* a floor for priors known exactly keeps the matrix well conditioned */
    const double least = 1e-4;
    const double sigma[COMMON] = {fmax(length_px, least), fmax(length_px, least),
                                  fmax(bend_px, least)};
    double away[COMMON] = {0};
    for (int round = 0; round < ROUNDS; round++) {
        double step[COMMON] = {0};
        for (int i = 0; i < count; i++) {
            bst_source_profiles_on(profiles, stars[i].origin_x_px, stars[i].origin_y_px, (int)b);
            stars[i].used = stars[i].used && accumulate_star(work, psf, profiles, &stars[i]);
        }
        if (!solve_motion(stars, count, sigma, away, step, work->covariance)) {
            return false;
        }
        if (round == ROUNDS - 2) {
            reject_outliers(stars, count, step);
            if (!solve_motion(stars, count, sigma, away, step, work->covariance)) {
                return false;
            }
        }
        left = 0;
        for (int i = 0; i < count; i++) {
            stars[i].used = stars[i].used && step_star(&stars[i], step, ex, ey);
            left += stars[i].used;
        }
        bool small = true;
        for (int k = 0; k < COMMON; k++) {
            away[k] += step[k];
            small = small && fabs(step[k]) < SMALL_STEP_PX;
        }
        if (small && round < ROUNDS - 3) {
            round = ROUNDS - 3;
        }
    }
    if (left == 0) {
        return false;
    }
    bst_camera_motion_add(motion, camera, b * (away[0] * ex - away[1] * ey),
                          b * (away[0] * ey + away[1] * ex), b * away[2] * ex, b * away[2] * ey);
    const double bend_px2 = work->covariance[COMMON - 1][COMMON - 1];
    motion->bend_sigma_rad = b * sqrt(bend_px2) * bst_camera_scale_rad(camera);
    for (int k = 0; k < COMMON * COMMON; k++) {
        work->covariance[k / COMMON][k % COMMON] *= b * b;
    }
    return true;
}
