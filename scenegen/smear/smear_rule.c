#include <assert.h>
#include <math.h>
#include <string.h>

#include "boresight/vec.h"
#include "scenegen/smear/smear_quadrature_internal.h"

static double norm3(const double v[3]) {
    return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

/* E[x p^2] / E[p^2] of the second orthogonal polynomial p = x^2 - skew x - e[2], E[p^2] = norm. */
static double second_centre(const double e[7], double skew, double norm) {
    double v = e[2];
    return (e[5] - 2.0 * skew * e[4] + (skew * skew - 2.0 * v) * e[3] + 2.0 * skew * v * v) / norm;
}

/* Gaussian quadrature of n nodes for moments e[0..2n - 1] about the mean. Returns the squared norm
 * of the next orthogonal polynomial, the rule's error of moment 2n; negative if no distribution has
 * these moments. curve: second polynomial at the nodes. */
static double quadrature(int n, const double e[7], bst_smear_rule *r) {
    double v = e[2];
    if (n == 1) {
        r->node[0] = 0.0;
        r->weight[0] = 1.0;
        return fabs(v);
    }
    if (!(v > 0.0)) {
        return -1.0;
    }
    double skew = e[3] / v, norm = e[4] - skew * e[3] - v * v;
    if (n == 2) {
        double root = sqrt(0.25 * skew * skew + v);
        r->node[0] = 0.5 * skew - root;
        r->node[1] = 0.5 * skew + root;
        r->weight[0] = r->node[1] / (2.0 * root);
        r->weight[1] = -r->node[0] / (2.0 * root);
        return fabs(norm);
    }
    if (!(norm > 1e-9 * v * v)) {
        return -1.0;
    }
    /* second polynomial: x^2 - skew x - v */
    double centre2 = second_centre(e, skew, norm);
    /* third polynomial: (x - centre2)(x^2 - skew x - v) - (norm / v) x; roots by cosines */
    double c2 = -skew - centre2, c1 = centre2 * skew - v - norm / v, c0 = centre2 * v;
    double p = (c2 * c2 - 3.0 * c1) / 9.0, q = (c2 * (2.0 * c2 * c2 - 9.0 * c1) + 27.0 * c0) / 54.0;
    if (!(p > 0.0)) {
        return -1.0;
    }
    double root = sqrt(p), angle = acos(fmax(-1.0, fmin(1.0, q / (p * root)))) / 3.0;
    for (int i = 0; i < 3; i++) {
        double x = -2.0 * root * cos(angle + i * (2.0 * BST_PI / 3.0)) - c2 / 3.0;
        double second = x * x - skew * x - v;
        r->node[i] = x;
        r->weight[i] = 1.0 / (1.0 + x * x / v + second * second / norm);
        r->curve[i] = second;
    }
    return fabs(e[6] + c2 * e[5] + c1 * e[4] + c0 * e[3]);
}

/* Largest relative change of the image, at the boresight or in a corner, if the covariance d of
 * tilts and roll is replaced by `widening`: half its contraction with the PSF's second derivatives,
 * at most 1 / variance on the diagonal and exp(-1) / variance off it. Values above `limit` may be
 * underestimated. */
static double covariance_error(const bst_smear_maker *m, double d[3][3], double widening,
                               double limit) {
    static const double place[5][2] = {{0, 0},
                                       {0.70710678118654752, 0.70710678118654752},
                                       {-0.70710678118654752, 0.70710678118654752},
                                       {-0.70710678118654752, -0.70710678118654752},
                                       {0.70710678118654752, -0.70710678118654752}};
    double worst = 0.0, per = 1.0 / m->wide_field, more = m->wide_field - 1.0;
    for (int k = 0; k < 5 && m->pixel_part[0] * worst <= limit * m->variance; k++) {
        double x = place[k][0], y = place[k][1];
        /* image motion by tilts and roll; in a corner of a wide field larger along the direction
         * from the boresight, by (1 + r r^T) of the tangent plane */
        double row[2][3] = {{-more * x * y * per, (1.0 + more * x * x) * per, -y},
                            {-(1.0 + more * y * y) * per, more * x * y * per, x}};
        double moved[3] = {-widening, 0.0, -widening}; /* xx, xy, yy */
        for (int i = 0; i < 3; i++) {
            double to[2] = {0.0, 0.0};
            for (int j = 0; j < 3; j++) {
                to[0] += d[i][j] * row[0][j];
                to[1] += d[i][j] * row[1][j];
            }
            moved[0] += row[0][i] * to[0];
            moved[1] += row[0][i] * to[1];
            moved[2] += row[1][i] * to[1];
        }
        double error = 0.5 * (fabs(moved[0]) + fabs(moved[2])) + 0.37 * fabs(moved[1]);
        worst = error > worst ? error : worst;
    }
    return worst / m->variance;
}

/* Squared norm of the second orthogonal polynomial of the moments that, convolved with a Gaussian
 * of variance u, give the group's; not positive if there are none. */
static double second_norm(const bst_smear_moments *g, double u) {
    double v = g->along[2] - u, third = g->along[3];
    return v > 0.0 ? g->along[4] - u * (6.0 * v + 3.0 * u) - third * third / v - v * v : 0.0;
}

/* Norm of the second polynomial of the moments without the widening, which depends on what the bend
 * leaves of `trace`. Returns false if little of the line is left and its bend would be uncertain.
 * *norm: on entry without widening, then with it. */
static bool widened_norm(const bst_smear_moments *g, double trace, double bend2, double per_trace,
                         double *norm) {
    double low = 0.5 * *norm, high = *norm;
    for (int round = 0; round < 14 && high > 0.0; round++) {
        double middle = round == 0 ? low : 0.5 * (low + high);
        double rest = trace - bend2 / middle;
        double found = second_norm(g, rest > 0.0 ? rest * per_trace : 0.0);
        if (found > middle) {
            low = middle;
        } else if (round == 0) {
            return false;
        } else {
            high = middle;
        }
    }
    *norm = low;
    return low > 0.0;
}

/* Remaining covariance of a group after its nodes, and the possible widening. */
typedef struct residual {
    double d[3][3];   /* covariance not represented by the nodes */
    double trace;     /* of d across the line of sight, at least 0 */
    double per_trace; /* widening over trace */
} residual;

/* Removes the bend of a three-node rule from the remaining covariance. Returns false if there is no
 * such rule. */
static bool subtract_bend(const bst_smear_moments *g, bool widen, residual *left,
                          bst_smear_rule *r) {
    double bend2 = g->bend[0] * g->bend[0] + g->bend[1] * g->bend[1];
    double norm = second_norm(g, 0.0);
    if (widen && !widened_norm(g, left->trace, bend2, left->per_trace, &norm)) {
        return false;
    }
    if (!(norm > 0.0)) {
        return false;
    }
    for (int i = 0; i < 3; i++) {
        r->bend[i] = g->bend[i] / norm;
        for (int j = 0; j < 3; j++) {
            left->d[i][j] -= g->bend[i] * g->bend[j] / norm;
        }
    }
    left->trace = fmax(left->d[0][0] + left->d[1][1], 0.0);
    return true;
}

/* Represents the largest remaining variance by a pair of nodes on either side. */
static void split_into_pair(residual *left, bst_smear_rule *r) {
    double axis[3], length2 = 0.0;
    bst_smear_nodes_main_axis(left->d, axis);
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            length2 += axis[i] * left->d[i][j] * axis[j];
        }
    }
    for (int i = 0; i < 3; i++) {
        r->pair[i] = sqrt(fmax(length2, 0.0)) * axis[i];
    }
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            left->d[i][j] -= r->pair[i] * r->pair[j];
        }
    }
}

/* Fits the rule to the group's moments up to second order. Returns false if there is no such rule.
 */
static bool fit_moments(const bst_smear_maker *m, const bst_smear_moments *g, bool widen,
                        bool split, residual *left, bst_smear_rule *r) {
    memcpy(left->d, g->covariance, sizeof left->d);
    for (int i = 0; i < 3 && r->nodes > 1; i++) {
        for (int j = 0; j < 3; j++) {
            left->d[i][j] -= g->along[2] * g->axis[i] * g->axis[j];
        }
    }
    double tilt = g->axis[0] * g->axis[0] + g->axis[1] * g->axis[1];
    left->per_trace = 1.0 / (r->nodes == 1 ? 2.0 : 2.0 - tilt);
    left->trace = fmax(left->d[0][0] + left->d[1][1], 0.0);
    if (r->nodes == 3 && !subtract_bend(g, widen, left, r)) {
        return false;
    }
    if (widen) {
        r->widening = fmin(left->trace * left->per_trace, m->widest);
        if (r->nodes > 1) { /* along the axis the moments account for the widening */
            for (int i = 0; i < 3; i++) {
                for (int j = 0; j < 3; j++) {
                    left->d[i][j] += r->widening * g->axis[i] * g->axis[j];
                }
            }
        }
    }
    if (split) {
        split_into_pair(left, r);
    }
    return true;
}

/* Factors that no formula gives: calibrated by tests/scenegen/calibrate_smear_rule.c, where the
 * worst of 36 paths with jitter has 0.97 of the predicted error, and the worst of 24 smooth ones
 * 0.90.
 *
 * Groups are shorter than the PSF is wide, so that what jitter leaves over in neighbours adds up
 * (on straight paths it nearly cancels). MARGIN is that of the quadrature's own error. */
static const double NEIGHBOURS = 1.3, MARGIN = 1.08;

/* Higher moments of a group across its axis: those of bst_smear_moments. */
typedef struct cross_moments {
    double twist[3], drift, lean[3], mixed;
} cross_moments;

/* Moments of a group that the nodes of a rule do not have.
 *
 * Given:     e  moments along the axis without the widening
 *
 * Notes:     Three nodes lie at y = c p(x), with c the rule's bend and p the second orthogonal
 *            polynomial, x^2 - skew x - v. Sums over the nodes follow from its norm and from
 *            x p = q + centre p + (norm / v) x, where the third polynomial q is zero at the nodes.
 */
static cross_moments missed_cross_moments(const bst_smear_moments *g, const double e[7],
                                          const bst_smear_rule *r) {
    cross_moments left = {.drift = g->drift, .mixed = g->mixed - g->along[2] * g->across};
    memcpy(left.twist, g->twist, sizeof left.twist);
    memcpy(left.lean, g->lean, sizeof left.lean);
    if (r->nodes < 3) {
        return left;
    }
    double v = e[2], skew = e[3] / v, norm = e[4] - skew * e[3] - v * v;
    double centre = second_centre(e, skew, norm), length = norm3(r->bend);
    double square = norm * (centre * centre + norm / v); /* sum of (x p)^2 */
    left.drift -= length * length * norm * centre;
    left.mixed -= length * length * (square - norm * v);
    for (int i = 0; i < 3; i++) {
        left.twist[i] -= r->bend[i] * norm * (centre + skew);
        left.lean[i] -= r->bend[i] * length * length * (square - norm * (skew * centre + v));
    }
    return left;
}

/* Error of the image by third and fourth moments that the rule misses, over the peak.
 *
 * Notes:     Taylor series of the image about the group's mean: each moment that is missed, over
 *            the factorials of its orders, times the greatest derivative of the PSF of those
 *            orders. A Gaussian of unit height and sigma has 1.380 (xxx), exp(-1/2) = 0.607 (xyy),
 *            0.837 (xxxy), 1 (xxyy) and 3 (xxxx). */
static double higher_moments_error(const bst_smear_maker *m, const bst_smear_moments *g,
                                   const double e[7], bool split, const bst_smear_rule *r) {
    double var = m->variance;
    int n = r->nodes;
    cross_moments left = missed_cross_moments(g, e, r);
    /* 1.380 / 3! = 0.23 of a pure third moment, 0.607 / 2! = 0.30 of a mixed one */
    double third = 0.3 * fabs(left.drift) + 0.23 * norm3(left.lean);
    third += n == 1 ? 0.23 * fabs(g->along[3]) : 0.0;
    third += n < 3 ? 0.3 * norm3(g->bend) : 0.0;
    double error = third / (var * sqrt(var));
    /* E[x^3 y]: 0.837 / 3!; E[x^2 y^2]: 1 / (2! 2!) */
    error += (0.14 * norm3(left.twist) + 0.25 * fabs(left.mixed)) / (var * var);
    double wide = split
                      ? r->pair[0] * r->pair[0] + r->pair[1] * r->pair[1] + r->pair[2] * r->pair[2]
                      : r->widening;
    /* fourth cumulant of what became a Gaussian, or a pair: of a uniform distribution it is 1.2
     * variances squared, times 3 / 4! */
    error += 0.15 * wide * wide / (var * var);
    error *= NEIGHBOURS * m->pixel_part[0];
    return error;
}

/* Takes the moments of a Gaussian of variance u out of e[0..6], about the mean (deconvolution). */
static inline void take_widening(double e[7], double u) {
    e[2] -= u;
    e[4] -= u * (6.0 * e[2] + 3.0 * u);
    e[5] -= 10.0 * u * e[3];
    e[6] -= u * (15.0 * e[4] + u * (45.0 * e[2] + 15.0 * u));
}

double bst_smear_most_kernel(const bst_smear_rule *r) {
    double low = r->node[0], high = r->node[0];
    for (int i = 1; i < r->nodes; i++) {
        low = fmin(low, r->node[i]);
        high = fmax(high, r->node[i]);
    }
    return (r->nodes == 2 ? 0.0595 : 0.0254) * (high - low) * (high - low);
}

/* The kernel K >= 0 gives the error of a smooth function f as the mean of its derivative of order
 * 2n under K, times the missed moment over (2n)! (Davis and Rabinowitz, Methods of Numerical
 * Integration, 1984, 4.3). x^(2n + 1) and x^(2n + 2) give its mean and variance. It is a spline
 * between the path's ends with the nodes as knots. A long thin tail, which smooths little, counts
 * no more than on a uniform path, where the variance is 0.0595 of the squared distance of two
 * nodes, and 0.0254 of that of the outer ones of three. */
void bst_smear_set_kernel(const bst_smear_moments *g, const double high[2], bst_smear_rule *r) {
    int n = r->nodes;
    double e[9], u = r->widening, missed = 0.0, next = 0.0, second = 0.0;
    memcpy(e, g->along, sizeof g->along);
    take_widening(e, u);
    e[7] = high[0] - u * (21.0 * e[5] + 105.0 * u * e[3]);
    e[8] = high[1] - u * (28.0 * e[6] + u * (210.0 * e[4] + u * (420.0 * e[2] + 105.0 * u)));
    for (int i = 0; i < n; i++) {
        double x = r->node[i], power = r->weight[i];
        for (int k = 0; k < 2 * n; k++) {
            power *= x;
        }
        missed -= power;
        next -= power * x;
        second -= power * x * x;
    }
    missed += e[2 * n];
    next += e[2 * n + 1];
    second += e[2 * n + 2];
    if (!(missed > 0.0)) {
        return;
    }
    double mean = next / ((2 * n + 1) * missed);
    double variance = second / ((n + 1) * (2 * n + 1) * missed) - mean * mean;
    r->kernel = fmin(fmax(variance, 0.0), bst_smear_most_kernel(r));
}

/* Errors of neighbouring groups of three nodes add up where their length is about 2.6 sigma, by 8 %
 * more than their light; the bound's margin contains it, a smoothed error does not. Longer groups
 * do not add up. v: variance of the Peano kernel over that of the PSF. Calibrated by
 * tests/scenegen/calibrate_smear_rule.c against the closed form. */
static double neighbours_part(double v) {
    return 1.0 + 0.08 * fmin(fmax((0.2 - v) / 0.08, 0.0), 1.0);
}

/* Least light at a distance from a point's peak, over that of the peak. */
static double light_at(const bst_smear_maker *m, const bst_smear_direction_parts *along,
                       double distance_px) {
    double at = distance_px * BST_LIGHT_PER / sqrt(m->variance), least = 1.0;
    if (!(at < BST_LIGHT_STEPS - 1)) {
        return 0.0;
    }
    int n = (int)at;
    for (int d = 0; d < BST_NODE_DIRECTIONS; d++) {
        if (along->in_range[d]) {
            const double *light = m->light_part[d] + n;
            least = fmin(least, light[0] + (at - n) * (light[1] - light[0]));
        }
    }
    return least;
}

/* Light that the nodes of a group have where others are, for images that move by the path or a part
 * of it: that of a Gaussian as narrow as the PSF's derivatives require, or of the PSF, which is
 * wider. */
typedef struct node_light {
    double distance_px[3][3], gaussian[3][3];
} node_light;

static void begin_light(const bst_smear_maker *m, const bst_smear_rule *r, double square,
                        node_light *l) {
    double lit = m->variance + m->binned_variance, bend = norm3(r->bend);
    for (int i = 0; i < r->nodes; i++) {
        for (int j = 0; j < i; j++) {
            double x = r->node[i] - r->node[j], y = bend * (r->curve[i] - r->curve[j]);
            double apart = square * (x * x + y * y);
            l->gaussian[i][j] = exp(-0.5 * apart / lit);
            l->distance_px[i][j] = m->light_part ? sqrt(apart) : 0.0;
        }
    }
}

/* Light of the brightest node; then the next scale, of twice the square. */
static double next_peak(const bst_smear_maker *m, const bst_smear_direction_parts *along,
                        const bst_smear_rule *r, node_light *l) {
    double here[3] = {r->weight[0], r->weight[1], r->weight[2]};
    for (int i = 0; i < r->nodes; i++) {
        for (int j = 0; j < i; j++) {
            double light = l->gaussian[i][j];
            if (m->light_part) {
                light = fmax(light, light_at(m, along, l->distance_px[i][j]));
                l->distance_px[i][j] *= sqrt(2.0);
            }
            here[i] += r->weight[j] * light;
            here[j] += r->weight[i] * light;
            l->gaussian[i][j] *= l->gaussian[i][j];
        }
    }
    return fmax(here[0], fmax(here[1], here[2]));
}

/* Greatest derivative of a rule's order in the directions of a group, smoothed by a variance over
 * that of the PSF, over the bound. Chords are above it where the OTF has one sign: it is
 * then a sum of exp(-w^2 variance / 2) over frequencies, which is convex. */
static double smoothed_part(const bst_smear_maker *m, const bst_smear_direction_parts *along,
                            const bst_smear_rule *r, double variance) {
    double at = variance * BST_SMOOTH_PER, worst = 0.0;
    int n = (int)fmin(at, BST_SMOOTH_STEPS - 2.0);
    double part = fmin(at - n, 1.0);
    for (int d = 0; d < BST_NODE_DIRECTIONS; d++) {
        if (along->in_range[d]) {
            const double low = m->smooth_part[d][n][r->nodes - 2],
                         high = m->smooth_part[d][n + 1][r->nodes - 2];
            worst = fmax(worst, low + part * (high - low));
        }
    }
    return worst / m->pixel_part[r->nodes - 1];
}

void bst_smear_missed_parts(const bst_smear_maker *m, const bst_smear_direction_parts *along,
                            const bst_smear_rule *r, double part[BST_NODE_SCALES],
                            double one[BST_NODE_SCALES]) {
    enum { LOWEST = 2 - BST_NODE_SCALES };
    double lit = m->variance + m->binned_variance, v = r->kernel / (lit + m->further_variance);
    double square = exp2(LOWEST);
    node_light light;
    for (int k = 0; k < BST_NODE_SCALES; k++) {
        part[k] = 1.0;
        one[k] = along->missed;
    }
    if (v < BST_LEAST_KERNEL) {
        return;
    }
    begin_light(m, r, square, &light);
    for (int k = 0; k < BST_NODE_SCALES; k++, square *= 2.0) {
        double peak = next_peak(m, along, r, &light), wide = 1.0 + square * v;
        double next_to = r->nodes == 3 ? neighbours_part(square * v) : 1.0;
        /* the greatest derivative of order 4 or 6, smoothed by K, over the group's own peak */
        double smooth = 1.0 / (wide * wide * sqrt(wide) * peak);
        smooth *= r->nodes == 3 ? next_to / wide : 1.0;
        part[k] = fmin(smooth, 1.0);
        one[k] *= part[k];
        if (m->smooth_part && r->nodes > 1) {
            double alone = smoothed_part(m, along, r, square * r->kernel / m->variance);
            one[k] = fmin(one[k], alone * next_to / peak);
        }
    }
}

void bst_smear_try_rule(const bst_smear_maker *m, const bst_smear_moments *g, int n, bool widen,
                        bool split, double limit, bst_smear_rule *r) {
    assert(m && g && r && n >= 1 && n <= 3 && m->variance > 0.0);
    double var = m->variance;
    residual rest;
    memset(r, 0, sizeof *r);
    r->nodes = n;
    r->error = INFINITY;
    if (!fit_moments(m, g, widen, split, &rest, r)) {
        return;
    }
    double e[7];
    memcpy(e, g->along, sizeof e);
    take_widening(e, n == 1 ? 0.0 : r->widening);
    double error = higher_moments_error(m, g, e, split, r);
    if (!(error <= limit)) {
        return;
    }
    double left_out =
        m->pixel_part[0] * covariance_error(m, rest.d, r->widening * m->image_share, limit - error);
    r->fixed = r->widening > 0.0 ? left_out : 0.0;
    error += left_out;
    /* the mean position is not the position of the mean: half the second derivative times the
     * remaining variance, at 0.607 / sigma per px */
    double left = n == 1 ? g->along[2] + g->across : g->across;
    error += 0.304 * m->curvature * left / sqrt(var);
    if (!(error <= limit)) {
        return;
    }
    double missed = quadrature(n, e, r);
    if (missed < 0.0) {
        return;
    }
    static const double factor[4] = {0, 0, 8.0, 48.0}; /* 2^n n! = (2n)! over the greatest
                                                            derivative of order 2n, (2n - 1)!! */
    double power = n == 3 ? var * var * var : var * var;
    r->missed = n == 1 ? 0.0 : m->pixel_part[n - 1] * missed / (factor[n] / MARGIN * power);
    r->error = error + r->missed;
}

void bst_smear_choose_rule(const bst_smear_maker *m, const bst_smear_moments *g, double limit,
                           bst_smear_rule *best) {
    bst_smear_rule r;
    for (int n = 1; n <= 3 && best->error > m->tolerance; n++) {
        for (int widen = 0; widen <= m->widen && best->error > m->tolerance; widen++) {
            bst_smear_try_rule(m, g, n, widen, false, n == 3 ? INFINITY : limit, &r);
            if (r.error < best->error) {
                *best = r;
            }
        }
    }
}
