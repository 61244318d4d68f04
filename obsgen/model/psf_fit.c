#include "obsgen/model/psf_fit.h"

#include <assert.h>
#include <math.h>
#include <string.h>

#include "sim/core/cholesky.h"

enum { MOST_SIDE = 48, PARAMETERS = 4, ROUNDS = 15 };

/* Limits of a step and of the widening relative to the PSF's variance, and least pivot
 * (imgproc/measure/fit.c). */
static const double MOST_STEP_PX = 0.7, LEAST_FLUX = 0.1, LEAST_WIDENING = -0.6,
                    MOST_WIDENING = 1.8;
static const double LEAST_PIVOT = 1e-11;
/* Convergence limit, px: a hundredth of the smallest position error of interest. */
static const double SETTLED_PX = 1e-4;

/* Pixels about a start, and the light on them; pixel (0, 0) is at (x0, y0) relative to the start.
 */
typedef struct stamp {
    int width, height;
    double x0, y0;
    double light[MOST_SIDE * MOST_SIDE];
} stamp;

/* Pixels of the stamp as bst_fit_stamp of imgproc/measure/fit.c takes them, with the light of all
 * points. */
static void fill(const bst_response *r, const bst_path_point *points, int count,
                 const double start[2], double reach_px, stamp *out) {
    double first[2];
    int side[2];
    for (int k = 0; k < 2; k++) {
        double from = floor(start[k] - reach_px + 0.5), to = floor(start[k] + reach_px + 0.5);
        side[k] = (int)fmin(to - from, MOST_SIDE - 1) + 1;
        first[k] = from - start[k];
    }
    out->width = side[0];
    out->height = side[1];
    out->x0 = first[0];
    out->y0 = first[1];
    memset(out->light, 0, sizeof out->light);
    for (int i = 0; i < count; i++) {
        for (int j = 0; j < out->height; j++) {
            for (int u = 0; u < out->width; u++) {
                double away = hypot(out->x0 + u - points[i].x_px, out->y0 + j - points[i].y_px);
                out->light[j * out->width + u] +=
                    points[i].flux * bst_response_image_share(r, away);
            }
        }
    }
}

/* Share of the fitted PSF on a pixel and its derivatives by x, y and variance. */
static void model_at(const bst_response *r, double dx, double dy, double out[4]) {
    double away = hypot(dx, dy), slope, curvature;
    out[0] = bst_response_model_share(r, away, &slope, &curvature);
    double outwards = away > 1e-6 ? slope / away : curvature;
    out[1] = -outwards * dx;
    out[2] = -outwards * dy;
    /* diffusion: half of the Laplacian */
    out[3] = 0.5 * (curvature + outwards);
}

/* One Gauss-Newton step; false if it is settled or the pixels do not determine it. */
static bool improve(const bst_response *r, const stamp *s, const bst_psf_fit_frame *frame,
                    bst_path_point_fit *f) {
    double a[PARAMETERS][PARAMETERS] = {{0.0}}, g[PARAMETERS] = {0.0};
    double full = frame->saturated_e > 0.0 ? frame->saturated_e : INFINITY;
    double noise2 = frame->noise_e * frame->noise_e;
    for (int j = 0; j < s->height; j++) {
        for (int u = 0; u < s->width; u++) {
            double light = s->light[j * s->width + u], model[4];
            if (light > full) {
                continue;
            }
            model_at(r, s->x0 + u - f->x_px, s->y0 + j - f->y_px, model);
            double shape = model[0] + f->widening_px2 * model[3];
            const double by[PARAMETERS] = {f->flux * model[1], f->flux * model[2], shape, model[3]};
            double left = light - f->flux * shape;
            double weight = 1.0 / (noise2 + fmax(f->flux * shape, 0.0));
            for (int p = 0; p < PARAMETERS; p++) {
                g[p] += weight * by[p] * left;
                for (int q = 0; q <= p; q++) {
                    a[p][q] += weight * by[p] * by[q];
                }
            }
        }
    }
    if (!bst_cholesky_factor(a[0], PARAMETERS, PARAMETERS, LEAST_PIVOT)) {
        return false;
    }
    bst_cholesky_solve(a[0], PARAMETERS, PARAMETERS, g);
    double before[2] = {f->x_px, f->y_px}, variance = frame->sigma_px * frame->sigma_px;
    const double limit = frame->limit_px;
    f->x_px += fmin(fmax(g[0], -MOST_STEP_PX), MOST_STEP_PX);
    f->y_px += fmin(fmax(g[1], -MOST_STEP_PX), MOST_STEP_PX);
    f->x_px = fmin(fmax(f->x_px, -limit), limit);
    f->y_px = fmin(fmax(f->y_px, -limit), limit);
    double product = f->flux * f->widening_px2 + g[3];
    f->flux = fmax(f->flux + g[2], LEAST_FLUX * f->flux);
    f->widening_px2 =
        fmin(fmax(product / f->flux, LEAST_WIDENING * variance), MOST_WIDENING * variance);
    return hypot(f->x_px - before[0], f->y_px - before[1]) > SETTLED_PX;
}

bst_path_point_fit bst_psf_fit_points(const bst_response *response, const bst_path_point *points,
                                      int count, const double start[2],
                                      const bst_psf_fit_frame *frame) {
    assert(response && response->falloff.tabulated && points && count > 0 && start && frame);
    stamp s;
    fill(response, points, count, start, frame->reach_px, &s);
    bst_path_point_fit f = {0.0, 0.0, points[0].flux, 0.0};
    bool moving = true;
    for (int round = 0; round < ROUNDS && moving; round++) {
        moving = improve(response, &s, frame, &f);
    }
    return f;
}

bst_psf_fit_moments bst_psf_fit_measure(const bst_response *response, const bst_path_point *points,
                                        int count, const double start[2],
                                        const bst_psf_fit_frame *frame,
                                        const bst_path_point_fit *fit) {
    assert(response && points && count > 0 && start && frame && fit);
    /* source_moments.c asks for twice the reach more */
    const double centre[2] = {start[0] + fit->x_px, start[1] + fit->y_px};
    stamp s;
    bst_path_point about[BST_PATH_POINTS];
    for (int i = 0; i < count && i < BST_PATH_POINTS; i++) {
        about[i] = (bst_path_point){points[i].x_px - fit->x_px, points[i].y_px - fit->y_px,
                                    points[i].flux};
    }
    fill(response, about, count, centre, 3.0 * frame->reach_px, &s);
    double window =
        2.0 * (frame->sigma_px * frame->sigma_px + fmax(fit->widening_px2, 0.0) + 1.0 / 12.0);
    double sum = 0.0, xx = 0.0, xy = 0.0, yy = 0.0;
    for (int j = 0; j < s.height; j++) {
        for (int u = 0; u < s.width; u++) {
            double x = s.x0 + u, y = s.y0 + j;
            double light = s.light[j * s.width + u] * exp(-0.5 * (x * x + y * y) / window);
            sum += light;
            xx += light * x * x;
            xy += light * x * y;
            yy += light * y * y;
        }
    }
    xx /= sum;
    xy /= sum;
    yy /= sum;
    /* for a Gaussian under a Gaussian window, inverse covariances add */
    double det = xx * yy - xy * xy;
    double ixx = yy / det - 1.0 / window, iyy = xx / det - 1.0 / window, ixy = -xy / det;
    double open = ixx * iyy - ixy * ixy;
    if (!(ixx > 0.0 && iyy > 0.0 && open > 0.0)) {
        return (bst_psf_fit_moments){0.0, 0.0, 0.0};
    }
    return (bst_psf_fit_moments){iyy / open - 1.0 / 12.0, -ixy / open, ixx / open - 1.0 / 12.0};
}
