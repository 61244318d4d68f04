#include "sim/analysis/camera/camera_fit.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/symmetric.h"

enum {
    SIZE = BST_CAMERA_FIT_SIZE,
    ALL = SIZE + 3,
    ITERATIONS = 8,
    ROUNDS = 4,
    HALVINGS = 60,
    LEAST_STARS = 4
};

/* Steps of the numerical derivatives: rad, and displacement at the field's corner over its radius.
 */
static const double STEP = 1e-6;
/* Distance, in sigma, of stars that are left out. */
static const double MOST_SIGMAS = 4.5;
/* Largest last step of the parameters, in standard errors. */
static const double MOST_STEP = 0.1;
/* Largest 1 sigma of the map in the corner, px, that counts as determined. */
static const double DETERMINED_PX = 100.0;
/* Limits of the scatter, px^2. */
static const double LEAST_SCATTER2 = 1e-8, MOST_SCATTER2 = 1e6;

typedef struct geometry {
    const bst_camera *start;
    bst_camera_fit_star *stars;
    int count, frames;
    double corner;      /* tangent radius of the field's corner */
    double x[SIZE];     /* relative displacements at the corner */
    bst_quat *attitude; /* of each frame: true from approximate */
    double scatter2;    /* px^2 */
    double covariance[SIZE][SIZE];
    double chi2;
    int used, degrees;
    double last_step; /* of the parameters, in standard errors */
} geometry;

/* Camera with parameters x; false if it folds the image. */
static bool camera_of(const geometry *g, const double x[SIZE], bst_camera *out) {
    const double r = g->corner;
    *out = *g->start;
    out->pixel_scale_arcsec = g->start->pixel_scale_arcsec * (1.0 + x[0]);
    out->distortion.k1 += x[1] / pow(r, 2.0);
    out->distortion.k2 += x[2] / pow(r, 4.0);
    out->distortion.p1 += x[3] / r;
    out->distortion.p2 += x[4] / r;
    bst_ctx ignored = {0};
    return out->pixel_scale_arcsec > 0.0 && bst_camera_prepare(&ignored, out) == BST_OK;
}

/* Places of a star in the cameras and with the frame's attitude turned about each axis. */
static bool places_of(const bst_camera cameras[1 + SIZE], bst_vec3 v, double place[1 + ALL][2]) {
    bool seen = true;
    for (int i = 0; seen && i <= SIZE; i++) {
        seen = bst_camera_project(&cameras[i], v, &place[i][0], &place[i][1]);
    }
    const bst_vec3 axes[3] = {{STEP, 0, 0}, {0, STEP, 0}, {0, 0, STEP}};
    for (int i = 0; seen && i < 3; i++) {
        bst_vec3 u = bst_vec3_add(v, bst_vec3_cross(axes[i], v));
        seen = bst_camera_project(&cameras[0], u, &place[1 + SIZE + i][0], &place[1 + SIZE + i][1]);
    }
    return seen;
}

/* Weights of a star's two coordinates. */
static void weights_of(const geometry *g, const bst_camera_fit_star *s, double w[2][2]) {
    const double xx = s->cov_xx + g->scatter2, yy = s->cov_yy + g->scatter2;
    const double det = xx * yy - pow(s->cov_xy, 2.0);
    w[0][0] = yy / det;
    w[1][1] = xx / det;
    w[0][1] = w[1][0] = -s->cov_xy / det;
}

/* Normal equations of a frame. */
typedef struct normal {
    double a[ALL][ALL], b[ALL];
    int used;
} normal;

/* Sum of squares of a star, and what it adds to the right side. */
typedef struct star_terms {
    double chi2, left[2], j[ALL][2], weighted[ALL][2], b[ALL];
} star_terms;

/* Computes the terms of a star; false: it does not fall on the focal plane. */
static bool terms_of(const geometry *g, const bst_camera cameras[1 + SIZE],
                     const bst_camera_fit_star *s, star_terms *t) {
    double place[1 + ALL][2], w[2][2];
    if (!places_of(cameras, bst_quat_rotate(g->attitude[s->frame], s->cam), place)) {
        return false;
    }
    weights_of(g, s, w);
    const double r[2] = {s->x_px - place[0][0], s->y_px - place[0][1]};
    t->left[0] = r[0];
    t->left[1] = r[1];
    t->chi2 = w[0][0] * r[0] * r[0] + 2.0 * w[0][1] * r[0] * r[1] + w[1][1] * r[1] * r[1];
    for (int i = 0; i < ALL; i++) {
        for (int k = 0; k < 2; k++) {
            t->j[i][k] = (place[1 + i][k] - place[0][k]) / STEP;
        }
        for (int k = 0; k < 2; k++) {
            t->weighted[i][k] = w[0][k] * t->j[i][0] + w[1][k] * t->j[i][1];
        }
        t->b[i] = t->weighted[i][0] * r[0] + t->weighted[i][1] * r[1];
    }
    return true;
}

/* Adds a star, or leaves it out if it is `gate` sigma off; returns its sum of squares. */
static double add_star(const geometry *g, const bst_camera cameras[1 + SIZE], double gate,
                       bst_camera_fit_star *s, normal *n) {
    star_terms t;
    s->residual_x_px = s->residual_y_px = NAN;
    if (!terms_of(g, cameras, s, &t) || !(t.chi2 <= pow(gate, 2.0))) {
        return 0.0;
    }
    s->residual_x_px = t.left[0];
    s->residual_y_px = t.left[1];
    for (int i = 0; i < ALL; i++) {
        n->b[i] += t.b[i];
        for (int k = 0; k < ALL; k++) {
            n->a[i][k] += t.weighted[i][0] * t.j[k][0] + t.weighted[i][1] * t.j[k][1];
        }
    }
    n->used++;
    return t.chi2;
}

/* Steps of the attitude of a frame for a step of the camera: t = inverse (b - a step). */
typedef struct frame_solution {
    double inverse[3][3], a[3][SIZE], b[3];
    bool used;
} frame_solution;

/* Eliminates a frame's attitude; adds the rest to the camera's equations. False: it has too few
 * stars. */
static bool eliminate(const normal *n, double a[SIZE][SIZE], double b[SIZE], frame_solution *f) {
    double attitude[3][3];
    f->used = false;
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++) {
            attitude[i][k] = n->a[SIZE + i][SIZE + k];
        }
        for (int k = 0; k < SIZE; k++) {
            f->a[i][k] = n->a[SIZE + i][k];
        }
        f->b[i] = n->b[SIZE + i];
    }
    if (n->used < LEAST_STARS || !bst_symmetric_invert(3, attitude[0], f->inverse[0])) {
        return false;
    }
    for (int i = 0; i < SIZE; i++) {
        for (int k = 0; k < SIZE; k++) {
            a[i][k] += n->a[i][k];
            for (int p = 0; p < 3; p++) {
                for (int q = 0; q < 3; q++) {
                    a[i][k] -= f->a[p][i] * f->inverse[p][q] * f->a[q][k];
                }
            }
        }
        b[i] += n->b[i];
        for (int p = 0; p < 3; p++) {
            for (int q = 0; q < 3; q++) {
                b[i] -= f->a[p][i] * f->inverse[p][q] * f->b[q];
            }
        }
    }
    f->used = true;
    return true;
}

/* Turns the attitudes by their steps. */
static void turn(geometry *g, const frame_solution *solutions, const double step[SIZE]) {
    for (int f = 0; f < g->frames; f++) {
        const frame_solution *s = &solutions[f];
        double t[3] = {0};
        for (int p = 0; s->used && p < 3; p++) {
            for (int q = 0; q < 3; q++) {
                double right = s->b[q];
                for (int k = 0; k < SIZE; k++) {
                    right -= s->a[q][k] * step[k];
                }
                t[p] += s->inverse[p][q] * right;
            }
        }
        g->attitude[f] = bst_quat_unit(
            bst_quat_mul(bst_quat_from_rotvec((bst_vec3){t[0], t[1], t[2]}), g->attitude[f]));
    }
}

/* The camera, and with each parameter stepped. */
static bool cameras_of(const geometry *g, bst_camera cameras[1 + SIZE]) {
    bool good = camera_of(g, g->x, &cameras[0]);
    for (int i = 0; good && i < SIZE; i++) {
        double x[SIZE];
        memcpy(x, g->x, sizeof x);
        x[i] += STEP;
        good = camera_of(g, x, &cameras[1 + i]);
    }
    return good;
}

/* One iteration of Gauss and Newton. False: the stars do not determine the camera. */
static bool iterate(geometry *g, double gate, frame_solution *solutions) {
    bst_camera cameras[1 + SIZE];
    if (!cameras_of(g, cameras)) {
        return false;
    }
    double a[SIZE][SIZE] = {{0}}, b[SIZE] = {0};
    int star = 0;
    g->chi2 = 0.0;
    g->used = 0;
    g->degrees = -SIZE;
    for (int f = 0; f < g->frames; f++) {
        normal n = {0};
        double chi2 = 0.0;
        const int first = star;
        for (; star < g->count && g->stars[star].frame == f; star++) {
            chi2 += add_star(g, cameras, gate, &g->stars[star], &n);
        }
        if (eliminate(&n, a, b, &solutions[f])) {
            g->chi2 += chi2;
            g->used += n.used;
            g->degrees += 2 * n.used - 3;
        } else {
            for (int i = first; i < star; i++) {
                g->stars[i].residual_x_px = g->stars[i].residual_y_px = NAN;
            }
        }
    }
    if (g->degrees < 1 || !bst_symmetric_invert(SIZE, a[0], g->covariance[0])) {
        return false;
    }
    double step[SIZE] = {0};
    for (int i = 0; i < SIZE; i++) {
        for (int k = 0; k < SIZE; k++) {
            step[i] += g->covariance[i][k] * b[k];
        }
        g->x[i] += step[i];
        g->last_step = fmax(i == 0 ? 0.0 : g->last_step, fabs(step[i]) / sqrt(g->covariance[i][i]));
    }
    turn(g, solutions, step);
    return true;
}

/* Chi squared of the present residuals with another scatter. */
static double chi2_of(const geometry *g, double scatter2) {
    double sum = 0.0;
    for (int i = 0; i < g->count; i++) {
        const bst_camera_fit_star *s = &g->stars[i];
        if (isnan(s->residual_x_px)) {
            continue;
        }
        const double xx = s->cov_xx + scatter2, xy = s->cov_xy, yy = s->cov_yy + scatter2,
                     x = s->residual_x_px, y = s->residual_y_px;
        sum += (yy * x * x - 2.0 * xy * x * y + xx * y * y) / (xx * yy - xy * xy);
    }
    return sum;
}

/* Scatter with which chi squared of the present residuals is its expectation: by halving, in
 * logarithm. */
static double scatter2_of(const geometry *g) {
    double low = LEAST_SCATTER2, high = MOST_SCATTER2;
    for (int i = 0; i < HALVINGS; i++) {
        const double middle = sqrt(low * high);
        if (chi2_of(g, middle) > g->degrees) {
            low = middle;
        } else {
            high = middle;
        }
    }
    return high;
}

/* Iterates with the scatter that makes chi squared its expectation. False: not determined, or not
 * at rest at the end. */
static bool solve(geometry *g, frame_solution *solutions) {
    double gate = INFINITY; /* with a wrong scale all stars are far off */
    g->scatter2 = 1.0;
    for (int round = 0; round < ROUNDS; round++) {
        for (int k = 0; k < ITERATIONS; k++) {
            if (!iterate(g, gate, solutions)) {
                return false;
            }
            g->scatter2 = scatter2_of(g);
        }
        gate = MOST_SIGMAS;
    }
    return g->last_step < MOST_STEP;
}

/* A star's part of the gradient, for sums over the frames of each star. */
typedef struct gradient {
    int64_t id;
    double g[SIZE];
} gradient;

static int by_id(const void *a, const void *b) {
    const int64_t x = ((const gradient *)a)->id, y = ((const gradient *)b)->id;
    return (x > y) - (x < y);
}

/* Replaces the inverse a^-1 of the normal equations by a^-1 (sum over stars of s s') a^-1 n / (n -
 * size), s the sum of a star's gradients, n their number. */
static void cluster(gradient *all, int count, int size, double *covariance) {
    double middle[SIZE][SIZE] = {{0}}, left[SIZE][SIZE] = {{0}}, out[SIZE][SIZE] = {{0}};
    int clusters = 0;
    qsort(all, (size_t)count, sizeof *all, by_id);
    for (int i = 0; i < count;) {
        double sum[SIZE] = {0};
        const int64_t id = all[i].id;
        for (; i < count && all[i].id == id; i++) {
            for (int k = 0; k < size; k++) {
                sum[k] += all[i].g[k];
            }
        }
        for (int k = 0; k < size; k++) {
            for (int m = 0; m < size; m++) {
                middle[k][m] += sum[k] * sum[m];
            }
        }
        clusters++;
    }
    if (clusters <= size) {
        return; /* the stars' own errors and the parameters are not separable */
    }
    const double factor = clusters / (double)(clusters - size);
    for (int k = 0; k < size; k++) {
        for (int m = 0; m < size; m++) {
            for (int i = 0; i < size; i++) {
                left[k][m] += covariance[k * size + i] * middle[i][m];
            }
        }
    }
    for (int k = 0; k < size; k++) {
        for (int m = 0; m < size; m++) {
            for (int i = 0; i < size; i++) {
                out[k][m] += factor * left[k][i] * covariance[i * size + m];
            }
        }
    }
    for (int k = 0; k < size * size; k++) {
        covariance[k] = out[k / size][k % size];
    }
}

/* Covariance by clusters of the solution. */
static bool estimate_covariance(geometry *g, const frame_solution *solutions) {
    bst_camera cameras[1 + SIZE];
    gradient *all = malloc(((size_t)g->count + 1) * sizeof *all);
    int used = 0;
    bool good = all && cameras_of(g, cameras);
    for (int i = 0; good && i < g->count; i++) {
        const bst_camera_fit_star *s = &g->stars[i];
        const frame_solution *f = &solutions[s->frame];
        star_terms t;
        if (isnan(s->residual_x_px) || !f->used || !terms_of(g, cameras, s, &t)) {
            continue;
        }
        gradient *one = &all[used++];
        one->id = s->id;
        for (int k = 0; k < SIZE; k++) {
            one->g[k] = t.b[k];
            for (int p = 0; p < 3; p++) {
                for (int q = 0; q < 3; q++) {
                    one->g[k] -= f->a[p][k] * f->inverse[p][q] * t.b[SIZE + q];
                }
            }
        }
    }
    if (good) {
        cluster(all, used, SIZE, g->covariance[0]);
    }
    free(all);
    return good;
}

/* 1 sigma of the map in the corner: scale and radial terms lie along the diagonal. */
static double corner_sigma(const geometry *g) {
    const double px = g->corner / bst_camera_scale_rad(g->start);
    const double along[SIZE] = {-1.0, 1.0, 1.0, 0.0, 0.0};
    double variance = 0.0;
    for (int i = 0; i < SIZE; i++) {
        for (int k = 0; k < SIZE; k++) {
            variance += along[i] * along[k] * g->covariance[i][k];
        }
    }
    return px * sqrt(fmax(variance, 0.0));
}

static void report(const geometry *g, bst_camera_geometry_fit *out) {
    bst_camera camera;
    bool good = camera_of(g, g->x, &camera);
    assert(good);
    const double r = g->corner;
    *out = (bst_camera_geometry_fit){
        .pixel_scale_arcsec = camera.pixel_scale_arcsec,
        .pixel_scale_sigma_arcsec = g->start->pixel_scale_arcsec * sqrt(g->covariance[0][0]),
        .distortion = camera.distortion,
        .distortion_sigma = {.k1 = sqrt(g->covariance[1][1]) / pow(r, 2.0),
                             .k2 = sqrt(g->covariance[2][2]) / pow(r, 4.0),
                             .p1 = sqrt(g->covariance[3][3]) / r,
                             .p2 = sqrt(g->covariance[4][4]) / r},
        .corner_sigma_px = corner_sigma(g),
        .scatter_px = sqrt(g->scatter2),
        .stars = g->used,
        .rejected = g->count - g->used};
    int last = -1;
    for (int i = 0; i < g->count; i++) {
        const bst_camera_fit_star *s = &g->stars[i];
        if (!isnan(s->residual_x_px)) {
            out->rms_px +=
                (pow(s->residual_x_px, 2.0) + pow(s->residual_y_px, 2.0)) / (2.0 * g->used);
            out->frames += s->frame != last;
            last = s->frame;
        }
    }
    out->rms_px = sqrt(out->rms_px);
}

bst_status bst_camera_fit_geometry(bst_ctx *ctx, const bst_camera *start,
                                   bst_camera_fit_star *stars, int count, int frames,
                                   bst_camera_geometry_fit *out) {
    assert(start && (stars || count == 0) && out && count >= 0 && frames >= 0);
    geometry g = {.start = start,
                  .stars = stars,
                  .count = count,
                  .frames = frames,
                  .corner = tan(bst_camera_half_diagonal_rad(start)),
                  .attitude = malloc(((size_t)frames + 1) * sizeof *g.attitude)};
    frame_solution *solutions = calloc((size_t)frames + 1, sizeof *solutions);
    bst_status status = BST_OK;
    if (!g.attitude || !solutions) {
        status = bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %d frames", frames);
    }
    for (int f = 0; status == BST_OK && f < frames; f++) {
        g.attitude[f] = BST_QUAT_IDENTITY;
    }
    if (status == BST_OK && (!solve(&g, solutions) || !estimate_covariance(&g, solutions) ||
                             !(corner_sigma(&g) < DETERMINED_PX))) {
        status = bst_fail(ctx, BST_ERR_RANGE,
                          "%d identified stars in %d frames do not determine scale and distortion: "
                          "frames with at least %d stars all over the field are needed",
                          count, frames, LEAST_STARS);
    }
    if (status == BST_OK) {
        report(&g, out);
    }
    free(g.attitude);
    free(solutions);
    return status;
}

/* ---------------------------------------------------------------- photometry */

/* Weighted sums of a straight line over B-V. */
typedef struct line_fit {
    double w, x, y, xx, xy, chi2, mean_variance;
    int used;
} line_fit;

static bool has_light(const bst_camera_fit_star *s) {
    return s->rate_e_per_s > 0.0 && s->rate_sigma_e_per_s > 0.0 && isfinite(s->b_minus_v) &&
           isfinite(s->v_mag);
}

static double noise2_of(const bst_camera_fit_star *s) {
    return pow(2.5 / log(10.0) * s->rate_sigma_e_per_s / s->rate_e_per_s, 2.0);
}

bst_status bst_camera_fit_photometry(bst_ctx *ctx, const bst_camera_fit_star *stars, int count,
                                     bst_camera_photometry_fit *out) {
    double zero = NAN, slope = 0.0, scatter2 = pow(0.1, 2.0);
    int given = 0;
    *out = (bst_camera_photometry_fit){0};
    gradient *all = malloc(((size_t)count + 1) * sizeof *all);
    if (!all) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %d stars", count);
    }
    for (int round = 0; round < 12; round++) {
        line_fit f = {0};
        given = 0;
        for (int i = 0; i < count; i++) {
            const bst_camera_fit_star *s = &stars[i];
            if (!has_light(s)) {
                continue;
            }
            given++;
            const double y = s->v_mag + 2.5 * log10(s->rate_e_per_s), x = s->b_minus_v;
            const double variance = noise2_of(s) + scatter2, w = 1.0 / variance;
            const double left = y - zero - slope * x;
            /* the first rounds find a rough line with all */
            if (round > 2 && pow(left, 2.0) > 16.0 * variance) {
                continue;
            }
            f.w += w;
            f.x += w * x;
            f.y += w * y;
            f.xx += w * x * x;
            f.xy += w * x * y;
            f.chi2 += isnan(left) ? 0.0 : w * left * left;
            f.mean_variance += variance;
            all[f.used++] = (gradient){s->id, {w * left, w * x * left}};
        }
        const double det = f.w * f.xx - f.x * f.x;
        if (f.used < 3 || !(det > 1e-9 * f.w * f.xx)) {
            free(all);
            return bst_fail(ctx, BST_ERR_RANGE,
                            "%d stars with a colour and unsaturated light do not give a zero point "
                            "and a colour term",
                            f.used);
        }
        if (!isnan(zero)) {
            f.mean_variance /= f.used;
            /* the variance of the stars is the present one times chi2 per degree of freedom */
            scatter2 =
                fmax(scatter2 + f.mean_variance * (f.chi2 / fmax(f.used - 2, 1) - 1.0), 1e-8);
        }
        slope = (f.w * f.xy - f.x * f.y) / det;
        zero = (f.y - slope * f.x) / f.w;
        double covariance[4] = {f.xx / det, -f.x / det, -f.x / det, f.w / det};
        cluster(all, f.used, 2, covariance);
        *out = (bst_camera_photometry_fit){.zero_point_mag = zero,
                                           .zero_point_sigma_mag = sqrt(covariance[0]),
                                           .colour_term = slope,
                                           .colour_term_sigma = sqrt(covariance[3]),
                                           .scatter_mag = sqrt(scatter2),
                                           .stars = f.used,
                                           .rejected = given - f.used};
    }
    free(all);
    return BST_OK;
}
