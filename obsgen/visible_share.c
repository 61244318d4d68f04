/* Share of a source's image that is on the frame. */
#include <assert.h>
#include <math.h>
#include <stdbool.h>

#include "obsgen/generator_internal.h"

/* Sigmas of a Gaussian beyond which the error function is 1 in double precision: 6 sqrt(2). */
static const double ALL_SIGMAS = 8.5;

/* Share of a Gaussian's light at `at` between two edges. */
static double between_edges(double at, double low, double high, double sigma) {
    double s = sigma * sqrt(2.0);
    return 0.5 * (erf((high - at) / s) - erf((low - at) / s));
}

/* Share of a Gaussian's light inside the frame. */
static inline double inside(const bst_generator *g, double x, double y, double sigma) {
    double all = ALL_SIGMAS * sigma - 0.5;
    if (x > all && y > all && x < g->width - 1 - all && y < g->height - 1 - all) {
        return 1.0;
    }
    double none = ALL_SIGMAS * sigma + 0.5;
    if (x < -none || y < -none || x > g->width - 1 + none || y > g->height - 1 + none) {
        return 0.0;
    }
    return between_edges(x, -0.5, g->width - 0.5, sigma) *
           between_edges(y, -0.5, g->height - 0.5, sigma);
}

/* Limits a range of steps along an axis to those between low and high; at: coordinate of step 0. */
static void limit_steps(double at, double step, double low, double high, int *first, int *end) {
    double a = (low - at) / step, b = (high - at) / step;
    if (isfinite(a) && isfinite(b)) { /* one more step, for rounding */
        double from = fmin(a, b) - 1.0, to = fmax(a, b) + 2.0;
        *first = from > *first ? (int)fmin(from, *end) : *first;
        *end = to < *end ? (int)fmax(to, *first) : *end;
    }
}

/* Output of the filter, for a point so far beyond the centre of the frame's last pixel along an
 * axis, relative to that of the whole point: beyond it on the last pixel, where the product of
 * image and filter is a Gaussian midway between both. Noise is that of the filter's part on the
 * frame. */
static double edge_output(double beyond_px, double sigma) {
    double d = fmax(beyond_px, 0.0), seen = 0.5 - fmin(beyond_px, 0.0);
    /* the product's deviation is sigma / sqrt(2) */
    double product = 0.5 * erfc((0.5 * d - seen) / sigma);
    return exp(-0.25 * d * d / (sigma * sigma)) * product / sqrt(0.5 * erfc(-seen / sigma));
}

/* Moves a Gaussian beyond the frame along an axis to the centroid of its part on the frame. Returns
 * the share of its light there.
 *
 * Given:     edge   last coordinate of the frame's pixels
 *            sigma  of the Gaussian, including the pixel */
static double cut_light(double edge, double sigma, double *at) {
    double first = -0.5, last = edge + 0.5;
    double beyond = fmax(first - *at, *at - last) / sigma;
    if (!(beyond > 0.0)) {
        return 1.0;
    }
    double share = 0.5 * erfc(beyond * sqrt(0.5));
    /* mean of a normal distribution above `beyond`, less it */
    double density = exp(-0.5 * beyond * beyond) / sqrt(2.0 * BST_PI);
    double inside = sigma * (share > 0.0 ? density / share - beyond : 0.0);
    *at = *at < first ? first + inside : last - inside;
    return share;
}

void bst_generator_cut_light(const bst_generator *g, generator_source *light) {
    assert(g && light);
    light->flux_e *= cut_light(g->width - 1, g->total_sigma, &light->x) *
                     cut_light(g->height - 1, g->total_sigma, &light->y);
}

void bst_generator_set_visible_share(const bst_generator *g, generator_source *s) {
    double margin_x = 4.0 * g->sigma + 0.5 * fabs(s->path.dx);
    double margin_y = 4.0 * g->sigma + 0.5 * fabs(s->path.dy);
    if (s->x > margin_x && s->y > margin_y && s->x < g->width - 1 - margin_x &&
        s->y < g->height - 1 - margin_y) {
        return;
    }
    if (s->length < g->sigma) {
        double x = edge_output(fmax(-s->x, s->x - (g->width - 1)), g->total_sigma);
        double y = edge_output(fmax(-s->y, s->y - (g->height - 1)), g->total_sigma);
        s->visible = s->ends = x * x * y * y;
        return;
    }
    double narrow = g->total_sigma * sqrt(0.5), sum = 0.0, along = 0.0;
    int parts = (int)fmin(ceil(s->length / g->sigma) + 1.0, 256.0);
    int first = 0, end = parts;
    double beyond = ALL_SIGMAS * narrow + 0.5, start = 0.5 / parts - 0.5;
    limit_steps(s->x + start * s->path.dx, s->path.dx / parts, -beyond, g->width - 1 + beyond,
                &first, &end);
    limit_steps(s->y + start * s->path.dy, s->path.dy / parts, -beyond, g->height - 1 + beyond,
                &first, &end);
    for (int i = first; i < end; i++) {
        double u = (i + 0.5) / parts - 0.5;
        double share = inside(g, s->x + u * s->path.dx, s->y + u * s->path.dy, narrow);
        sum += share;
        along += u * share;
    }
    along /= fmax(sum, 1e-9);
    s->seen_x += along * s->path.dx;
    s->seen_y += along * s->path.dy;
    s->visible = sum / parts;
    s->ends = 0.5 * (inside(g, s->x - 0.5 * s->path.dx, s->y - 0.5 * s->path.dy, narrow) +
                     inside(g, s->x + 0.5 * s->path.dx, s->y + 0.5 * s->path.dy, narrow));
}
