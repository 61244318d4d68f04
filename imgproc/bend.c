#include "imgproc/bend.h"

#include <math.h>
#include <stdlib.h>

/* Streaks fainter than this say nothing beside bright ones. */
static const double LEAST_SNR = 40.0;
/* A neighbour this bright relative to a streak would bend it. */
static const double ALONE_SHARE = 0.02;
static const double LEAST_PATH_SIGMAS = 4.0;
/* Bend by which its derivative is taken, in sigma of the PSF. */
static const double STEP_SIGMAS = 0.06;
/* Chi-square, 1 degree of freedom, of a star's own bend against the common one. */
static const double REJECT_CHI2 = 16.0;
/* Steps with the bend held, and with it free. */
enum { HELD = 3, FREE = 3, LOCAL = 4 };

typedef struct star {
    bst_shape shape;
    bst_stamp stamp;
    double flux_e, product_e; /* flux; flux times widening */
    double start_x, start_y, noise_e;
    double step[LOCAL], by_bend[LOCAL]; /* the local parameters' step at a fixed bend, and what a
                                           step of the bend takes off it */
    double information, gradient;       /* of the bend, local parameters eliminated */
    bool used;
} star;

bst_status bst_bend_create(bst_ctx *ctx, int max_side, bst_bend *out) {
    out->max_pixels = max_side * max_side;
    out->render = calloc((size_t)out->max_pixels * 12, sizeof *out->render);
    return out->render ? BST_OK
                       : bst_fail(ctx, BST_ERR_MEMORY, "no memory to measure uneven motion");
}

void bst_bend_free(bst_bend *bend) {
    free(bend->render);
    *bend = (bst_bend){0};
}

static bool is_streak(const bst_filter *f, const bst_candidate *c) {
    return f->streak && c->snr > bst_filter_point_at(f, c->x, c->y);
}

/* Whether a stamp lies inside the frame, has only pixels that measure, and no other source that
 * matters. */
static bool is_alone(const bst_locate_frame *f, const bst_candidates *candidates, int rank,
                     const bst_stamp *s, double margin) {
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

static bool start_star(const bst_bend *b, const bst_locate_frame *f,
                       const bst_candidates *candidates, int rank, const bst_shape *path,
                       star *out) {
    const bst_candidate *c = &candidates->items[candidates->order[rank]];
    if (!is_streak(f->filter, c)) {
        return false;
    }
    *out = (star){.shape = *path, .start_x = c->x, .start_y = c->y, .used = true};
    out->shape.x_px = c->x;
    out->shape.y_px = c->y;
    bst_motion_streak(f->motion, f->camera, f->origin_x_px + f->binning * c->x,
                      f->origin_y_px + f->binning * c->y, &out->shape.dx_px, &out->shape.dy_px);
    out->shape.dx_px /= f->binning;
    out->shape.dy_px /= f->binning;
    out->noise_e = bst_background_noise_at(f->background, c->x, c->y);
    out->flux_e = (double)c->snr * out->noise_e / f->filter->streak_norm;
    bst_source source = {.shape = out->shape};
    double reach = fmax(3.0, ceil(3.6 * f->sigma_px)) + 0.5;
    out->stamp = bst_fit_stamp(&source, reach, BST_PSF_MAX_SIDE, f->width, f->height);
    double margin = 0.5 * hypot(out->shape.dx_px, out->shape.dy_px);
    return out->stamp.width * out->stamp.height <= b->max_pixels &&
           is_alone(f, candidates, rank, &out->stamp, margin);
}

/* Solves a x = v for a symmetric positive definite matrix by Cholesky; false when it is not. */
static bool solve(double a[LOCAL][LOCAL], double x[2][LOCAL]) {
    for (int j = 0; j < LOCAL; j++) {
        for (int i = j; i < LOCAL; i++) {
            for (int k = 0; k < j; k++) {
                a[i][j] -= a[i][k] * a[j][k];
            }
            if (i == j && !(a[j][j] > 0.0)) {
                return false;
            }
            a[i][j] = i == j ? sqrt(a[j][j]) : a[i][j] / a[j][j];
        }
    }
    for (int r = 0; r < 2; r++) {
        for (int i = 0; i < LOCAL; i++) {
            for (int k = 0; k < i; k++) {
                x[r][i] -= a[i][k] * x[r][k];
            }
            x[r][i] /= a[i][i];
        }
        for (int i = LOCAL - 1; i >= 0; i--) {
            for (int k = i + 1; k < LOCAL; k++) {
                x[r][i] -= a[k][i] * x[r][k];
            }
            x[r][i] /= a[i][i];
        }
    }
    return true;
}

/* Normal equations of one star at the current bend along (ex, ey). */
static bool accumulate(const bst_bend *b, const bst_psf *psf, const bst_locate_frame *f, double ex,
                       double ey, star *s) {
    size_t n = (size_t)s->stamp.width * (size_t)s->stamp.height;
    double h = STEP_SIGMAS * s->shape.sigma_px, *model[3];
    for (int k = 0; k < 3; k++) {
        bst_shape shape = s->shape;
        double step = k == 1 ? h : k == 2 ? -h : 0.0;
        shape.bend_x_px += step * ex;
        shape.bend_y_px += step * ey;
        model[k] = b->render + (size_t)k * 4 * n;
        bst_psf_render(psf, &shape, &s->stamp, model[k], model[k] + n, model[k] + 2 * n,
                       model[k] + 3 * n);
    }
    double a[LOCAL][LOCAL] = {{0}}, right[2][LOCAL] = {{0}}, bend2 = 0.0, gradient = 0.0;
    for (size_t i = 0; i < n; i++) {
        size_t y = i / (size_t)s->stamp.width, x = i % (size_t)s->stamp.width;
        double value = (double)f->signal[((size_t)s->stamp.y0 + y) * (size_t)f->width +
                                         (size_t)s->stamp.x0 + x];
        const double *m = model[0] + i;
        double total = s->flux_e * m[0] + s->product_e * m[3 * n];
        double weight = 1.0 / (s->noise_e * s->noise_e + fmax(total, 0.0));
        double r = value - total;
        double j[LOCAL] = {s->flux_e * m[n], s->flux_e * m[2 * n], m[0], m[3 * n]};
        double by_bend = s->flux_e * (model[1][i] - model[2][i]) / (2.0 * h);
        for (int p = 0; p < LOCAL; p++) {
            right[0][p] += weight * j[p] * r;
            right[1][p] += weight * j[p] * by_bend;
            for (int q = 0; q <= p; q++) {
                a[p][q] += weight * j[p] * j[q];
            }
        }
        bend2 += weight * by_bend * by_bend;
        gradient += weight * by_bend * r;
    }
    double mixed[LOCAL];
    for (int p = 0; p < LOCAL; p++) {
        mixed[p] = right[1][p];
    }
    if (!solve(a, right)) {
        return false;
    }
    for (int p = 0; p < LOCAL; p++) {
        s->step[p] = right[0][p];
        s->by_bend[p] = right[1][p];
        bend2 -= mixed[p] * right[1][p];
        gradient -= mixed[p] * right[0][p];
    }
    s->information = bend2;
    s->gradient = gradient;
    return bend2 > 0.0 && isfinite(bend2) && isfinite(gradient);
}

static double clamp(double v, double limit) {
    return v < -limit ? -limit : v > limit ? limit : v;
}

/* Takes the local step that belongs to a step of the bend; false when the star runs away. */
static bool advance(star *s, double bend_step, double ex, double ey) {
    s->shape.x_px += clamp(s->step[0] - bend_step * s->by_bend[0], 0.7);
    s->shape.y_px += clamp(s->step[1] - bend_step * s->by_bend[1], 0.7);
    s->shape.bend_x_px += bend_step * ex;
    s->shape.bend_y_px += bend_step * ey;
    double flux = s->flux_e + s->step[2] - bend_step * s->by_bend[2];
    s->flux_e = fmax(flux, 0.1 * s->flux_e);
    double variance = s->shape.sigma_px * s->shape.sigma_px * s->flux_e;
    s->product_e += s->step[3] - bend_step * s->by_bend[3];
    s->product_e = fmax(-0.6 * variance, fmin(s->product_e, 1.8 * variance));
    double limit = 2.0 + 0.4 * hypot(s->shape.dx_px, s->shape.dy_px);
    return hypot(s->shape.x_px - s->start_x, s->shape.y_px - s->start_y) < limit &&
           isfinite(s->flux_e) && isfinite(s->product_e);
}

/* Leaves out stars whose own bend contradicts the median of all: hit by radiation, double. */
static void reject(star *stars, int count) {
    double own[BST_BEND_STARS], sorted[BST_BEND_STARS];
    int n = 0;
    for (int i = 0; i < count; i++) {
        if (!stars[i].used) {
            continue;
        }
        own[i] = stars[i].gradient / stars[i].information;
        int at = n++;
        for (; at > 0 && sorted[at - 1] > own[i]; at--) {
            sorted[at] = sorted[at - 1];
        }
        sorted[at] = own[i];
    }
    double median = n > 0 ? 0.5 * (sorted[(n - 1) / 2] + sorted[n / 2]) : 0.0;
    for (int i = 0; i < count && n >= 3; i++) {
        double d = stars[i].used ? own[i] - median : 0.0;
        stars[i].used = stars[i].used && d * d * stars[i].information < REJECT_CHI2;
    }
}

bool bst_bend_measure(bst_bend *b, const bst_psf *psf, const bst_locate_frame *f,
                      const bst_candidates *candidates, double prior_px, bst_motion *motion,
                      double *shift_px) {
    if (!f->motion || !f->filter->streak || !(prior_px > 0.0)) {
        return false;
    }
    bst_shape path = {.sigma_px = f->sigma_px};
    bst_motion_streak(f->motion, f->camera, f->origin_x_px + 0.5 * f->binning * f->width,
                      f->origin_y_px + 0.5 * f->binning * f->height, &path.dx_px, &path.dy_px);
    bst_motion_bend(f->motion, f->camera, &path.bend_x_px, &path.bend_y_px);
    double length = hypot(path.dx_px, path.dy_px) / f->binning;
    if (length < LEAST_PATH_SIGMAS * f->sigma_px) {
        return false;
    }
    double ex = path.dx_px / (length * f->binning), ey = path.dy_px / (length * f->binning);
    path.bend_x_px /= f->binning;
    path.bend_y_px /= f->binning;
    star stars[BST_BEND_STARS];
    int count = 0;
    for (int k = 0; k < candidates->count && count < BST_BEND_STARS; k++) {
        if ((double)candidates->items[candidates->order[k]].snr < LEAST_SNR) {
            break;
        }
        count += start_star(b, f, candidates, k, &path, &stars[count]);
    }
    double away = 0.0, information = 0.0, prior = 1.0 / (prior_px * prior_px), shift = 0.0;
    for (int round = 0; round < HELD + FREE; round++) {
        for (int i = 0; i < count; i++) {
            stars[i].used = stars[i].used && accumulate(b, psf, f, ex, ey, &stars[i]);
        }
        if (round == HELD) {
            reject(stars, count);
        }
        double gradient = -prior * away, sum = 0.0;
        information = shift = 0.0;
        for (int i = 0; i < count; i++) {
            if (stars[i].used) {
                const star *s = &stars[i];
                information += s->information;
                gradient += s->gradient;
                shift += s->information * (s->by_bend[0] * ex + s->by_bend[1] * ey);
                sum += s->information;
            }
        }
        shift = sum > 0.0 ? shift / sum : 0.0;
        double step = round < HELD ? 0.0 : gradient / (information + prior);
        away += step;
        for (int i = 0; i < count; i++) {
            stars[i].used = stars[i].used && advance(&stars[i], step, ex, ey);
        }
    }
    if (!(information > 0.0) || !isfinite(away)) {
        return false;
    }
    bst_motion_set_bend(motion, f->camera, f->binning * (path.bend_x_px + away * ex),
                        f->binning * (path.bend_y_px + away * ey));
    *shift_px = fabs(shift) / sqrt(information + prior);
    return true;
}
