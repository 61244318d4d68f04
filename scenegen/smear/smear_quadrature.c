#include "scenegen/smear/smear_quadrature.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "boresight/vec.h"
#include "scenegen/smear/smear_quadrature_internal.h"

typedef struct maker {
    const bst_smear_path_point *path;
    int count;
    double total;    /* duration */
    double variance; /* of the PSF, px^2 */
    double tolerance;
    bool widen;
    bst_smear_node_list *list;
    double widest;     /* px^2 */
    double wide_field; /* as in bst_smear_node_aim */
    double curvature;
    double pixel_part[3];
    double image_share; /* variance of the image per variance of the path, mean over the field */
    double most;        /* spread of the next group, px^2 */
    double limit;       /* of it */
} maker;

/* A group: the path from time `from` (in segment `first`) to `to`. */
typedef struct group {
    int first;
    double from, to;
} group;

/* A group's moments about its mean: along the axis to the sixth order, and what lies across. */
typedef struct moments {
    double mean[3], axis[3];
    double covariance[3][3];
    double along[7]; /* E[x^k] */
    double bend[3];  /* E[y x^2], y the part across the axis */
    double drift;    /* E[x y^2] */
    double mixed;    /* E[x^2 y^2] */
    double lean[3];  /* E[y y^2] */
    double across;   /* E[y^2] */
} moments;

/* A way to stand for a group. */
typedef struct rule {
    int nodes;       /* 1 to 3 along the axis */
    double widening; /* px^2 */
    double pair[3];  /* half the distance of the pair that each node is split into */
    double node[3], weight[3];
    double bend[3];  /* shift across the axis per unit of `curve` */
    double curve[3]; /* second orthogonal polynomial at the nodes */
    double error;    /* all of it */
    double missed;   /* of it, what the quadrature misses of the last moment */
    double fixed;    /* of it, the wrong widening of images that move by less than the path */
} rule;

static bst_status push(bst_ctx *ctx, bst_smear_node_list *list, const double p[3], double weight,
                       double variance, double error) {
    if (list->count == list->capacity) {
        int capacity = list->capacity ? 2 * list->capacity : 256;
        bst_smear_node *items = realloc(list->items, (size_t)capacity * sizeof *items);
        if (!items) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d nodes of a smear", capacity);
        }
        list->items = items;
        list->capacity = capacity;
    }
    list->items[list->count++] = (bst_smear_node){{p[0], p[1], p[2]}, weight, variance, error};
    return BST_OK;
}

/* The part of segment k inside the group, as its two ends; its duration. */
static double clip(const maker *m, const group *g, int k, double a[3], double b[3]) {
    const bst_smear_path_point *p = &m->path[k], *q = p + 1;
    double length = q->s - p->s;
    double from = fmax(p->s, g->from), to = fmin(q->s, g->to);
    if (!(to > from)) {
        return 0.0;
    }
    if (to - from == length) {
        memcpy(a, p->p, sizeof p->p);
        memcpy(b, q->p, sizeof q->p);
        return length;
    }
    for (int i = 0; i < 3; i++) {
        double slope = (q->p[i] - p->p[i]) / length;
        a[i] = p->p[i] + slope * (from - p->s);
        b[i] = p->p[i] + slope * (to - p->s);
    }
    return to - from;
}

static double norm3(const double v[3]) {
    return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

static bool reaches(const maker *m, const group *g, int k) {
    return k + 1 < m->count && m->path[k].s < g->to;
}

/* Mean and covariance of the group, exactly. */
static void second_moments(const maker *m, const group *g, moments *out) {
    double weight = 0.0, a[3], b[3], origin[3] = {0}, first[3] = {0};
    bool begun = false;
    memset(out, 0, sizeof *out);
    for (int k = g->first; reaches(m, g, k); k++) {
        double w = clip(m, g, k, a, b);
        if (!(w > 0.0)) {
            continue;
        }
        if (!begun) {
            memcpy(origin, a, sizeof origin);
            begun = true;
        }
        weight += w;
        for (int i = 0; i < 3; i++) {
            a[i] -= origin[i];
            b[i] -= origin[i];
            first[i] += w * 0.5 * (a[i] + b[i]);
        }
        for (int i = 0; i < 3; i++) {
            for (int j = 0; j <= i; j++) {
                out->covariance[i][j] +=
                    w * ((a[i] * a[j] + b[i] * b[j]) / 3.0 + (a[i] * b[j] + b[i] * a[j]) / 6.0);
            }
        }
    }
    for (int i = 0; i < 3; i++) {
        first[i] /= weight;
        out->mean[i] = origin[i] + first[i];
    }
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j <= i; j++) {
            out->covariance[i][j] = out->covariance[i][j] / weight - first[i] * first[j];
            out->covariance[j][i] = out->covariance[i][j];
        }
    }
}

/* Four-point and two-point Gauss-Legendre on [0, 1] (Abramowitz and Stegun, table 25.4): the first
 * exact for the seventh order, the second for the third. */
static const double gauss_place[2][4] = {
    {0.06943184420297371, 0.33000947820757187, 0.66999052179242813, 0.93056815579702629},
    {0.21132486540518712, 0.78867513459481288}};
static const double gauss_weight[2][4] = {
    {0.17392742256872693, 0.32607257743127307, 0.32607257743127307, 0.17392742256872693},
    {0.5, 0.5}};
/* In a group of as many segments the second does: of the fourth moment 1 / segments^4 is missed. */
enum { MANY_SEGMENTS = 6 };

/* Fills the axis and the moments about it. */
static void high_moments(const maker *m, const group *g, moments *out) {
    double a[3], b[3], weight = 0.0;
    bst_smear_nodes_main_axis(out->covariance, out->axis);
    int segments = 0;
    while (segments < MANY_SEGMENTS && reaches(m, g, g->first + segments)) {
        segments++;
    }
    int coarse = segments == MANY_SEGMENTS, points = coarse ? 2 : 4;
    for (int k = g->first; reaches(m, g, k); k++) {
        double w = clip(m, g, k, a, b);
        for (int n = 0; n < points && w > 0.0; n++) {
            double d[3], x = 0.0, part = w * gauss_weight[coarse][n];
            for (int i = 0; i < 3; i++) {
                d[i] = a[i] + gauss_place[coarse][n] * (b[i] - a[i]) - out->mean[i];
                x += d[i] * out->axis[i];
            }
            double power = part;
            for (int o = 0; o <= 6; o++, power *= x) {
                out->along[o] += power;
            }
            for (int i = 0; i < 3; i++) {
                d[i] -= x * out->axis[i];
                out->bend[i] += part * x * x * d[i];
            }
            double y2 = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
            out->drift += part * x * y2;
            out->mixed += part * x * x * y2;
            for (int i = 0; i < 3; i++) {
                out->lean[i] += part * d[i] * y2;
            }
            out->across += part * y2;
            weight += part;
        }
    }
    for (int o = 0; o <= 6; o++) {
        out->along[o] /= weight;
    }
    out->drift /= weight;
    out->mixed /= weight;
    out->across /= weight;
    for (int i = 0; i < 3; i++) {
        out->bend[i] /= weight;
        out->lean[i] /= weight;
    }
}

/* Gaussian quadrature of n nodes for moments e[0..2n - 1] about the mean; returns the squared norm
 * of the next orthogonal polynomial, which is what the rule misses of moment 2n; negative when the
 * moments are those of no distribution. curve: second polynomial at the nodes. */
static double quadrature(int n, const double e[7], rule *r) {
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
    /* x^2 - skew x - v is the second polynomial */
    double centre2 =
        (e[5] - 2.0 * skew * e[4] + (skew * skew - 2.0 * v) * e[3] + 2.0 * skew * v * v) / norm;
    /* third polynomial: (x - centre2)(x^2 - skew x - v) - (norm / v) x; its roots by cosines */
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

/* Largest share of the peak by which the image changes for a source at the boresight or in a corner
 * when the covariance d of tilts and roll is left out and `widening` put in its place: half the
 * covariance's contraction with the PSF's second derivatives, which are at most 1 / variance on the
 * diagonal and exp(-1) / variance off it. More than `limit` may be less than it is. */
static double covariance_error(const maker *m, double d[3][3], double widening, double limit) {
    static const double place[5][2] = {{0, 0},
                                       {0.70710678118654752, 0.70710678118654752},
                                       {-0.70710678118654752, 0.70710678118654752},
                                       {-0.70710678118654752, -0.70710678118654752},
                                       {0.70710678118654752, -0.70710678118654752}};
    double worst = 0.0, per = 1.0 / m->wide_field, more = m->wide_field - 1.0;
    for (int k = 0; k < 5 && m->pixel_part[0] * worst <= limit * m->variance; k++) {
        double x = place[k][0], y = place[k][1];
        /* image motion by the tilts and the roll; in a corner of a wide field more along the way
         * from the boresight, as (1 + r r^T) of the tangent plane has it */
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

/* Squared norm of the second orthogonal polynomial of the moments along the axis that, convolved
 * with a Gaussian of variance u, give the group's; not positive when there are none. */
static double second_norm(const moments *g, double u) {
    double v = g->along[2] - u, third = g->along[3];
    return v > 0.0 ? g->along[4] - u * (6.0 * v + 3.0 * u) - third * third / v - v * v : 0.0;
}

/* The norm of the second polynomial of the moments without the widening, which is what the bend
 * leaves over of `trace`: one follows from the other. false when little of the line is left, where
 * its bend would be a guess. *norm: before, without widening; after, with. */
static bool widened_norm(const moments *g, double trace, double bend2, double per_trace,
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

/* What a rule leaves of a group's covariance, and what of that its Gaussian can be widened by. */
typedef struct residual {
    double d[3][3];   /* covariance that nodes do not have yet */
    double trace;     /* of d across the line of sight, at least 0 */
    double per_trace; /* widening over trace */
} residual;

/* Takes the bend of a rule of three nodes off the residual. False where there is no such rule. */
static bool take_bend(const moments *g, bool widen, residual *left, rule *r) {
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

/* Takes the greatest variance of the residual as a pair of nodes, one on each side. */
static void take_pair(residual *left, rule *r) {
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

/* Gives the rule the group's moments up to the second. False where there is no such rule. */
static bool take_moments(const maker *m, const moments *g, bool widen, bool split, residual *left,
                         rule *r) {
    memcpy(left->d, g->covariance, sizeof left->d);
    for (int i = 0; i < 3 && r->nodes > 1; i++) {
        for (int j = 0; j < 3; j++) {
            left->d[i][j] -= g->along[2] * g->axis[i] * g->axis[j];
        }
    }
    double tilt = g->axis[0] * g->axis[0] + g->axis[1] * g->axis[1];
    left->per_trace = 1.0 / (r->nodes == 1 ? 2.0 : 2.0 - tilt);
    left->trace = fmax(left->d[0][0] + left->d[1][1], 0.0);
    if (r->nodes == 3 && !take_bend(g, widen, left, r)) {
        return false;
    }
    if (widen) {
        r->widening = fmin(left->trace * left->per_trace, m->widest);
        if (r->nodes > 1) { /* along the axis the moments make room for it */
            for (int i = 0; i < 3; i++) {
                for (int j = 0; j < 3; j++) {
                    left->d[i][j] += r->widening * g->axis[i] * g->axis[j];
                }
            }
        }
    }
    if (split) {
        take_pair(left, r);
    }
    return true;
}

/* Error of the image by third and fourth moments that the rule misses, over the peak. */
static double higher_moments_error(const maker *m, const moments *g, bool split, const rule *r) {
    double var = m->variance;
    int n = r->nodes;
    /* third moments that are missed: a sixth, or half for mixed ones, times the greatest third
     * derivative, 1.38 or 0.61 of the peak over sigma^3 */
    double third = 0.3 * fabs(g->drift) + 0.23 * norm3(g->lean);
    third += n == 1 ? 0.23 * fabs(g->along[3]) : 0.0;
    third += n < 3 ? 0.3 * norm3(g->bend) : 0.0;
    double error = third / (var * sqrt(var));
    /* x^2 and y^2 together: a quarter of a derivative of at most the peak over sigma^4 */
    error += 0.25 * fabs(g->mixed - g->along[2] * g->across) / (var * var);
    double wide = split
                      ? r->pair[0] * r->pair[0] + r->pair[1] * r->pair[1] + r->pair[2] * r->pair[2]
                      : r->widening;
    /* fourth cumulant of what became a Gaussian, or a pair, taken for uniform */
    error += 0.15 * wide * wide / (var * var);
    /* Groups are shorter than the PSF is wide, so that what jitter leaves over in neighbours adds
     * up; on straight paths it nearly cancels (factors measured on random paths) */
    error *= 1.8 * m->pixel_part[0];
    return error;
}

/* Fills the rule and its error: what it misses of the image, over the peak. Infinite where there is
 * no such rule, or where its error is more than `limit`. */
static void try_rule(const maker *m, const moments *g, int n, bool widen, bool split, double limit,
                     rule *r) {
    double var = m->variance;
    residual rest;
    memset(r, 0, sizeof *r);
    r->nodes = n;
    r->error = INFINITY;
    if (!take_moments(m, g, widen, split, &rest, r)) {
        return;
    }
    double error = higher_moments_error(m, g, split, r);
    if (!(error <= limit)) {
        return;
    }
    double left_out =
        m->pixel_part[0] * covariance_error(m, rest.d, r->widening * m->image_share, limit - error);
    r->fixed = r->widening > 0.0 ? left_out : 0.0;
    error += left_out;
    /* the mean of places is no place of the mean: by half the second derivative of what is left of
     * the variance, at 0.607 / sigma per px */
    double left = n == 1 ? g->along[2] + g->across : g->across;
    error += 0.304 * m->curvature * left / sqrt(var);
    if (!(error <= limit)) {
        return;
    }
    double e[7], u = n == 1 ? 0.0 : r->widening;
    memcpy(e, g->along, sizeof e);
    e[2] -= u;
    e[4] -= u * (6.0 * e[2] + 3.0 * u);
    e[5] -= 10.0 * u * e[3];
    e[6] -= u * (15.0 * e[4] + u * (45.0 * e[2] + 15.0 * u));
    double missed = quadrature(n, e, r);
    if (missed < 0.0) {
        return;
    }
    static const double factor[4] = {0, 0, 8.0 / 1.08, 48.0 / 1.08}; /* 2^n n!, margin */
    double power = n == 3 ? var * var * var : var * var;
    r->missed = n == 1 ? 0.0 : m->pixel_part[n - 1] * missed / (factor[n] * power);
    r->error = error + r->missed;
}

static void raise_error(bst_smear_node_list *list, const rule *r) {
    for (int k = 0; k < BST_NODE_SCALES; k++) {
        double square = exp2(k - (BST_NODE_SCALES - 2)), fourth = square * square;
        double low = square * (square > 1.0 ? sqrt(square) : 1.0);
        double error = r->fixed * fmax(low, 1.0) + (r->error - r->missed - r->fixed) * low +
                       r->missed * (r->nodes == 3 ? fourth * square : fourth);
        list->error[k] = fmax(list->error[k], error);
    }
}

static bst_status emit(bst_ctx *ctx, const maker *m, const moments *g, const rule *r,
                       double weight) {
    bool split = r->pair[0] != 0.0 || r->pair[1] != 0.0 || r->pair[2] != 0.0;
    raise_error(m->list, r);
    for (int n = 0; n < r->nodes; n++) {
        for (int side = -1; side <= 1; side += 2) {
            double p[3];
            for (int i = 0; i < 3; i++) {
                p[i] = g->mean[i] + r->node[n] * g->axis[i] + r->curve[n] * r->bend[i] +
                       (split ? side * r->pair[i] : 0.0);
            }
            BST_TRY(push(ctx, m->list, p, weight * r->weight[n] * (split ? 0.5 : 1.0),
                         r->widening * m->image_share, r->error));
            if (!split) {
                break;
            }
        }
    }
    return BST_OK;
}

static bool single_stretch(const maker *m, const group *g) {
    int k = g->first;
    while (k + 2 < m->count && m->path[k + 1].s <= g->from) {
        k++;
    }
    return k + 2 >= m->count || m->path[k + 1].s >= g->to;
}

/* The next group's size from how this one's error compares with the tolerance, which goes as the
 * third power of its spread where the path is straight. */
static void adapt(maker *m, double error) {
    double change = error > 0.0 ? cbrt(0.8 * m->tolerance / error) : 2.0;
    m->most = fmin(m->most * fmin(fmax(change, 0.4), 1.6), m->limit);
}

/* The rule with the fewest nodes that is good enough, else the best of those of three, and of those
 * whose error is not beyond `limit`. */
static void choose_rule(const maker *m, const moments *g, double limit, rule *best) {
    rule r;
    for (int n = 1; n <= 3 && best->error > m->tolerance; n++) {
        for (int widen = 0; widen <= m->widen && best->error > m->tolerance; widen++) {
            try_rule(m, g, n, widen, false, n == 3 ? INFINITY : limit, &r);
            if (r.error < best->error) {
                *best = r;
            }
        }
    }
}

/* Replaces a group by nodes, in halves of its time where no rule is good enough. */
static bst_status close_group(bst_ctx *ctx, maker *m, group g, int depth) {
    moments t;
    rule best = {.error = INFINITY}, r;
    second_moments(m, &g, &t);
    double spread = t.covariance[0][0] + t.covariance[1][1] + t.covariance[2][2];
    double weight = (g.to - g.from) / m->total;
    if (!(spread > 1e-12 * m->variance)) {
        return push(ctx, m->list, t.mean, weight, 0.0, 0.0);
    }
    high_moments(m, &g, &t);
    choose_rule(m, &t, m->tolerance, &best);
    /* a blob rather than a line does not get thinner by halves */
    if (best.error > m->tolerance && !m->widen && t.across > 0.2 * t.along[2]) {
        try_rule(m, &t, 2, false, true, INFINITY, &r);
        if (r.error < best.error) {
            best = r;
        }
    }
    if (depth == 0 && best.nodes == 3) {
        adapt(m, best.error);
    }
    if (best.error > m->tolerance && depth < 40 &&
        !(single_stretch(m, &g) && spread < 1e-6 * m->variance)) {
        double middle = 0.5 * (g.from + g.to);
        group late = {g.first, middle, g.to};
        while (m->path[late.first + 1].s <= middle) {
            late.first++;
        }
        g.to = middle;
        BST_TRY(close_group(ctx, m, g, depth + 1));
        return close_group(ctx, m, late, depth + 1);
    }
    if (best.error > m->tolerance) {
        choose_rule(m, &t, INFINITY, &best);
    }
    return emit(ctx, m, &t, &best, weight);
}

/* Moments of a stretch of path about an origin, for the greedy cut. */
typedef struct extent {
    double weight, first[3], second;
} extent;

static void extend(extent *e, const double a[3], const double b[3], double w) {
    e->weight += w;
    for (int i = 0; i < 3; i++) {
        e->first[i] += w * 0.5 * (a[i] + b[i]);
        e->second += w * (a[i] * a[i] + a[i] * b[i] + b[i] * b[i]) / 3.0;
    }
}

static double spread_of(const extent *e) {
    double total = e->second / e->weight;
    for (int i = 0; i < 3; i++) {
        total -= e->first[i] * e->first[i] / (e->weight * e->weight);
    }
    return total;
}

bst_status bst_smear_nodes_from_path(bst_ctx *ctx, const bst_smear_path_point *path, int count,
                                     const bst_smear_node_aim *aim, bst_smear_node_list *list) {
    double variance = aim->psf_sigma_px * aim->psf_sigma_px, tolerance = aim->tolerance;
    double wide = fmax(aim->wide_field, 1.0);
    maker m = {.path = path,
               .count = count,
               .total = path[count - 1].s - path[0].s,
               .variance = variance,
               .tolerance = tolerance,
               .widen = aim->widest > 0.0,
               .list = list,
               .widest = aim->widest * variance,
               .wide_field = wide,
               .curvature = aim->curvature,
               /* of the boresight and four corners: all, and all along with 1 / wide^2 across */
               .image_share = (2.0 + 3.0 / (wide * wide)) / 5.0};
    if (!(m.total > 0.0)) {
        return push(ctx, list, path[0].p, 1.0, 0.0, 0.0);
    }
    /* three nodes on a uniform stretch of variance v miss 0.617 v^3 of the sixth moment */
    for (int k = 0; k < 3; k++) {
        m.pixel_part[k] = aim->pixel_part[k] > 0.0 ? aim->pixel_part[k] : 1.0;
    }
    m.limit = m.most = 0.95 * m.variance * cbrt(tolerance / m.pixel_part[2] * 48.0 / 0.617);
    group g = {0, path[0].s, path[0].s};
    extent e = {0};
    for (int k = 0; k + 1 < count; k++) {
        const bst_smear_path_point *p = &path[k], *q = p + 1;
        if (!(q->s > p->s)) {
            continue;
        }
        double a[3], b[3], length2 = 0.0;
        const double *origin = path[g.first].p;
        for (int i = 0; i < 3; i++) {
            a[i] = p->p[i] - origin[i];
            b[i] = q->p[i] - origin[i];
            length2 += (b[i] - a[i]) * (b[i] - a[i]);
        }
        extent more = e;
        extend(&more, a, b, q->s - p->s);
        if (spread_of(&more) <= m.most) {
            e = more;
            g.to = q->s;
            continue;
        }
        if (e.weight > 0.0) {
            BST_TRY(close_group(ctx, &m, g, 0));
        }
        int pieces = (int)fmin(ceil(sqrt(length2 / (12.0 * m.most))), 1e6);
        pieces = pieces < 1 ? 1 : pieces;
        double step = (q->s - p->s) / pieces;
        for (int n = 0; n + 1 < pieces; n++) {
            BST_TRY(close_group(ctx, &m, (group){k, p->s + n * step, p->s + (n + 1) * step}, 0));
        }
        /* the last piece begins the next group */
        g = (group){k, p->s + (pieces - 1) * step, q->s};
        e = (extent){0};
        for (int i = 0; i < 3; i++) {
            a[i] = (q->p[i] - p->p[i]) * (pieces - 1) / pieces;
            b[i] = q->p[i] - p->p[i];
        }
        extend(&e, a, b, step);
    }
    return close_group(ctx, &m, g, 0);
}
