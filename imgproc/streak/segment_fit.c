#include "imgproc/streak/segment_fit.h"

#include <assert.h>
#include <math.h>
#include <string.h>

#include "boresight/vec.h"
#include "sim/core/cholesky.h"

/* Parameters: place along and across, direction, half length, flux, logarithm of the width, bend.
 */
enum { ALONG, ACROSS, TURN, HALF, FLUX, WIDTH, BEND, PARAMETERS };
enum { MAX_ITERATIONS = 30 };

/* Convergence: a smaller change of chi-square moves the segment by less than a tenth of its error.
 */
static const double SETTLED = 0.01;
/* Least pivot of the Cholesky factorisation, relative to its diagonal element. */
static const double LEAST_PIVOT = 1e-9;
/* The image is 0 beyond this distance from the segment, and constant this far from its ends, sigma:
 * 6e-7 of the light is left. */
static const double REACH_SIGMA = 5.0;
/* Limits of the width, of its start, and the greatest step of its logarithm. */
static const double LEAST_WIDTH = 0.7, MOST_WIDTH = 1.6, WIDTH_STEP = 0.2;
/* Shortest segment, sigma: a shorter one is a point to the pixels. */
static const double LEAST_HALF_SIGMA = 0.5;
/* Variance of the place of the largest W(t) - |t| / 2, W a Wiener process on both sides of 0. */
static const double CHANGE_VARIANCE = 26.0;

/* Image of a segment: what all pixels have in common. */
typedef struct image {
    const bst_segment *s;
    double c, q, sigma, third; /* cos, sin of its angle; third: half^2 / 3 */
} image;

static image image_of(const bst_segment *s) {
    return (image){s, cos(s->angle_rad), sin(s->angle_rad), s->sigma_px,
                   s->half_px * s->half_px / 3.0};
}

static double normal_density(double z) {
    return exp(-0.5 * z * z) / sqrt(2.0 * BST_PI);
}

/* Image of unit flux along a segment, and its derivatives. */
typedef struct profile {
    double light, by_u, by_half, by_width; /* by_width: by the logarithm of sigma */
} profile;

static profile light_along(const image *m, double u) {
    const double h = m->s->half_px, start = (u + h) / m->sigma, end = (u - h) / m->sigma;
    double before = start > REACH_SIGMA ? 1.0 : start < -REACH_SIGMA ? 0.0 : NAN, after = before;
    double at_start = 0.0, at_end = 0.0;
    if (isnan(before)) {
        before = 0.5 * erfc(-start * sqrt(0.5));
        at_start = normal_density(start) / m->sigma;
    }
    after = end > REACH_SIGMA ? 1.0 : 0.0;
    if (fabs(end) <= REACH_SIGMA) {
        after = 0.5 * erfc(-end * sqrt(0.5));
        at_end = normal_density(end) / m->sigma;
    }
    double light = (before - after) / (2.0 * h);
    return (profile){.light = light,
                     .by_u = (at_start - at_end) / (2.0 * h),
                     .by_half = (at_start + at_end) / (2.0 * h) - light / h,
                     .by_width = (end * at_end - start * at_start) * m->sigma / (2.0 * h)};
}

/* Image of unit flux at a pixel; d: its derivatives, those by the bend last. */
static double model_at(const image *m, const bst_segment_pixel *p, double d[PARAMETERS]) {
    const bst_segment *s = m->s;
    double x = (double)p->x_px - s->x_px, y = (double)p->y_px - s->y_px;
    double u = m->c * x + m->q * y, v = m->c * y - m->q * x;
    double bow = u * u - m->third, w = (v - s->bend_per_px * bow) / m->sigma;
    if (fabs(w) > REACH_SIGMA || fabs(u) > s->half_px + REACH_SIGMA * m->sigma) {
        memset(d, 0, PARAMETERS * sizeof *d);
        return 0.0;
    }
    const profile p1 = light_along(m, u);
    double beside = normal_density(w) / m->sigma;
    double along = beside * p1.by_u, across = -w / m->sigma * beside * p1.light;
    double lean = 2.0 * s->bend_per_px * u;
    d[ALONG] = -along + lean * across;
    d[ACROSS] = -across;
    d[TURN] = along * v - across * (u + lean * v);
    d[HALF] = beside * p1.by_half + across * 2.0 / 3.0 * s->bend_per_px * s->half_px;
    d[FLUX] = beside * p1.light;
    d[WIDTH] = (w * w - 1.0) * d[FLUX] + beside * p1.by_width;
    d[BEND] = -across * bow;
    return d[FLUX];
}

typedef struct equations {
    double a[PARAMETERS][PARAMETERS], g[PARAMETERS], chi_square, square;
} equations;

/* Takes a parameter out of the equations: its step is 0, its variance 1. */
static void hold(equations *e, int parameter) {
    for (int p = 0; p < PARAMETERS; p++) {
        e->a[p][parameter] = e->a[parameter][p] = p == parameter ? 1.0 : 0.0;
    }
    e->g[parameter] = 0.0;
}

/* The end that is held: -1 or 1; 0: none or both. */
static double side_of(const bst_segment_freedom *f) {
    return f->held[0] == f->held[1] ? 0.0 : f->held[0] ? -1.0 : 1.0;
}

/* Normal equations and chi-square of a segment. */
static void accumulate(const bst_segment_data *data, const bst_segment *s,
                       const bst_segment_freedom *freedom, equations *e) {
    const int parameters = freedom->bent ? PARAMETERS : BEND;
    memset(e, 0, sizeof *e);
    /* with one end held, the other one moves by twice what the middle does */
    const double side = side_of(freedom);
    const image m = image_of(s);
    const double noise2 = data->noise_e * data->noise_e;
    for (int i = 0; i < data->count; i++) {
        double d[PARAMETERS], share = model_at(&m, &data->pixels[i], d), total = s->flux_e * share;
        double weight = 1.0 / (noise2 + data->excess * fmax(total, 0.0));
        double r = (double)data->pixels[i].signal_e - total;
        e->chi_square += weight * r * r;
        if (!(share > 0.0)) {
            continue;
        }
        e->square += share * share;
        d[ALONG] -= side * d[HALF];
        for (int p = 0; p < parameters; p++) {
            d[p] *= p == FLUX ? 1.0 : s->flux_e;
            e->g[p] += weight * d[p] * r;
            for (int k = 0; k <= p; k++) {
                e->a[p][k] += weight * d[p] * d[k];
            }
        }
    }
    if (freedom->held[0] || freedom->held[1]) {
        hold(e, HALF);
    }
    if (freedom->held[0] && freedom->held[1]) {
        hold(e, ALONG);
    }
}

static double limited(double v, double limit) {
    return fmin(fmax(v, -limit), limit);
}

/* The segment after a step; ends stay within `beyond` of those of `first`. */
static bst_segment moved(const bst_segment *s, const double step[PARAMETERS], double side,
                         const bst_segment *first, double beyond) {
    bst_segment next = *s;
    const double sigma = first->sigma_px;
    double width = s->sigma_px * exp(limited(step[WIDTH], WIDTH_STEP));
    next.sigma_px = fmin(fmax(width, LEAST_WIDTH * sigma), MOST_WIDTH * sigma);
    const double most = fmax(2.0 * sigma, 0.25 * s->half_px);
    double along = limited(step[ALONG], most), across = limited(step[ACROSS], 2.0 * sigma);
    double c = cos(s->angle_rad), q = sin(s->angle_rad);
    next.x_px += c * along - q * across;
    next.y_px += q * along + c * across;
    next.angle_rad += limited(step[TURN], fmin(2.0 * sigma / s->half_px, 0.5));
    double limit =
        first->half_px + beyond - hypot(next.x_px - first->x_px, next.y_px - first->y_px);
    double half = side == 0.0 ? limited(step[HALF], most) : -side * along;
    next.half_px = fmin(next.half_px + half, limit);
    next.half_px = fmax(next.half_px, LEAST_HALF_SIGMA * sigma);
    next.flux_e = fmax(next.flux_e + step[FLUX], 0.2 * next.flux_e);
    next.bend_per_px += limited(step[BEND], 2.0 * sigma / (s->half_px * s->half_px));
    return next;
}

/* Inverse of the normal matrix; false if it is not positive definite. */
static bool invert(const equations *at, int parameters, double out[PARAMETERS][PARAMETERS]) {
    double l[PARAMETERS][PARAMETERS];
    memcpy(l, at->a, sizeof l);
    if (!bst_cholesky_factor(l[0], PARAMETERS, parameters, LEAST_PIVOT)) {
        return false;
    }
    memset(out, 0, sizeof l);
    for (int p = 0; p < parameters; p++) {
        out[p][p] = 1.0;
        bst_cholesky_solve(l[0], PARAMETERS, parameters, out[p]);
    }
    return true;
}

static bool set_errors(const bst_segment *s, const equations *at, int parameters,
                       bst_segment_errors *out) {
    double v[PARAMETERS][PARAMETERS];
    if (!invert(at, parameters, v)) {
        return false;
    }
    double per_px = at->a[FLUX][FLUX] * s->flux_e * s->flux_e / (2.0 * s->half_px);
    out->end_variance = CHANGE_VARIANCE / (per_px * per_px);
    /* the mean place is the mean of both ends */
    double along = v[ALONG][ALONG] + 0.5 * out->end_variance, across = v[ACROSS][ACROSS];
    double both = v[ALONG][ACROSS], c = cos(s->angle_rad), q = sin(s->angle_rad);
    out->cov_xx = c * c * along - 2.0 * c * q * both + q * q * across;
    out->cov_xy = c * q * (along - across) + (c * c - q * q) * both;
    out->cov_yy = q * q * along + 2.0 * c * q * both + c * c * across;
    out->turn_variance = v[TURN][TURN];
    out->flux_variance = v[FLUX][FLUX];
    out->chi_square = at->chi_square;
    out->norm = sqrt(at->square);
    return isfinite(out->cov_xx + out->cov_yy) && along < s->half_px * s->half_px;
}

bool bst_segment_fit_run(const bst_segment_data *data, double beyond,
                         const bst_segment_freedom *freedom, bst_segment *segment,
                         bst_segment_errors *errors) {
    assert(data && segment && errors && segment->sigma_px > 0.0 && beyond >= 0.0);
    const int parameters = freedom->bent ? PARAMETERS : BEND;
    if (data->count <= parameters || !(segment->half_px > 0.0) || !(segment->flux_e > 0.0)) {
        return false;
    }
    bst_segment best = *segment;
    equations at;
    accumulate(data, &best, freedom, &at);
    double damping = 1e-3;
    bool settled = false;
    for (int i = 0; i < MAX_ITERATIONS && !settled; i++) {
        equations e = at;
        for (int p = 0; p < parameters; p++) {
            e.a[p][p] *= 1.0 + damping;
        }
        if (!bst_cholesky_factor(e.a[0], PARAMETERS, parameters, LEAST_PIVOT)) {
            return false;
        }
        bst_cholesky_solve(e.a[0], PARAMETERS, parameters, e.g);
        bst_segment next = moved(&best, e.g, side_of(freedom), segment, beyond);
        equations trial;
        accumulate(data, &next, freedom, &trial);
        if (!(trial.chi_square <= at.chi_square)) {
            damping *= 10.0;
            settled = damping > 1e6;
            continue;
        }
        settled = at.chi_square - trial.chi_square < SETTLED;
        damping = fmax(0.1 * damping, 1e-9);
        best = next;
        at = trial;
    }
    bst_segment_errors found;
    if (!set_errors(&best, &at, parameters, &found)) {
        return false;
    }
    *segment = best;
    *errors = found;
    return true;
}

void bst_segment_place(const bst_segment *s, double along_px, double *x_px, double *y_px) {
    double c = cos(s->angle_rad), q = sin(s->angle_rad);
    double beside = s->bend_per_px * (along_px * along_px - s->half_px * s->half_px / 3.0);
    *x_px = s->x_px + c * along_px - q * beside;
    *y_px = s->y_px + q * along_px + c * beside;
}

bst_segment bst_segment_part(const bst_segment *s, double from_px, double to_px) {
    const double middle = 0.5 * (from_px + to_px);
    bst_segment part = *s;
    /* the axis follows the bend, and the mean place is beside the vertex of the part */
    part.angle_rad += 2.0 * s->bend_per_px * middle;
    part.half_px = 0.5 * (to_px - from_px);
    part.flux_e *= part.half_px / s->half_px;
    const double beside = s->bend_per_px * part.half_px * part.half_px / 3.0;
    bst_segment_place(s, middle, &part.x_px, &part.y_px);
    part.x_px -= beside * sin(part.angle_rad);
    part.y_px += beside * cos(part.angle_rad);
    return part;
}

double bst_segment_distance(const bst_segment *s, double x_px, double y_px, double *along_px) {
    double c = cos(s->angle_rad), q = sin(s->angle_rad), x = x_px - s->x_px, y = y_px - s->y_px;
    double u = c * x + q * y;
    *along_px = u;
    return fabs(c * y - q * x - s->bend_per_px * (u * u - s->half_px * s->half_px / 3.0));
}

double bst_segment_share(const bst_segment *s, double x_px, double y_px) {
    if (!(s->half_px > 0.0)) {
        double r = hypot(x_px - s->x_px, y_px - s->y_px) / s->sigma_px;
        return exp(-0.5 * r * r) / (2.0 * BST_PI * s->sigma_px * s->sigma_px);
    }
    const image m = image_of(s);
    const bst_segment_pixel p = {(float)x_px, (float)y_px, 0.0f};
    double d[PARAMETERS];
    return model_at(&m, &p, d);
}
