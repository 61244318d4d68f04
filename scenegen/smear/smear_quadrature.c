#include "scenegen/smear/smear_quadrature.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "boresight/vec.h"
#include "scenegen/smear/smear_quadrature_internal.h"
#include "sim/core/invariant.h"

static bst_status push(bst_ctx *ctx, bst_smear_node_list *list, const double p[3], double weight,
                       double variance, const double error[2]) {
    if (list->count == list->capacity) {
        int capacity = list->capacity ? 2 * list->capacity : 256;
        bst_smear_node *items = realloc(list->items, (size_t)capacity * sizeof *items);
        if (!items) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d nodes of a smear", capacity);
        }
        list->items = items;
        list->capacity = capacity;
    }
    assert(list->count < list->capacity && weight >= 0.0 && variance >= 0.0);
    list->items[list->count++] =
        (bst_smear_node){{p[0], p[1], p[2]}, weight, variance, error[0], error[1]};
    return BST_OK;
}

/* Sets the Peano kernel of a group's rule, unless the group is short. */
static void set_kernel(const bst_smear_maker *m, const bst_smear_group *g,
                       const bst_smear_moments *t, bst_smear_rule *r) {
    bool split = r->pair[0] != 0.0 || r->pair[1] != 0.0 || r->pair[2] != 0.0;
    double high[2];
    if (r->nodes < 2 || split || bst_smear_most_kernel(r) < BST_LEAST_KERNEL * m->variance) {
        return;
    }
    bst_smear_kernel_moments(m, g, t, high);
    bst_smear_set_kernel(t, high, r);
}

/* Predicted errors of a group beside another one, over that alone. In an even row they nearly
 * cancel. Beside one of another speed or direction both may have the same sign in between: the
 * second extremum of a Gaussian's sixth derivative, 1.1 sigma from the first, is 0.66 of it, where
 * the Gaussian has 0.55 of its peak's light. Beside a much higher or lower speed the fainter group
 * lies in the flank of the brighter one's light: measured in tests/scenegen/test_tolerance_sweep.c,
 * straight parts of random speed. */
#define EVEN_SPEEDS 2.0
#define EVEN_DISTANCE 0.8
#define BESIDE_ANOTHER 1.25 /* 0.66 over 0.55, and a margin */
#define JUMP_SPEEDS 8.0
#define BESIDE_A_JUMP 2.4

/* Pattern of the missed moment of a rule of two or three nodes, for images that move by the root of
 * `square` of the path. */
static int pattern_of(const bst_smear_maker *m, const bst_smear_rule *r, double square) {
    double at = square * r->kernel * BST_SMOOTH_PER / m->variance;
    int n = at < BST_SMOOTH_STEPS - 1 ? (int)at : BST_SMOOTH_STEPS - 1;
    return BST_PATTERN_GROUP + 2 * n + r->nodes - 2;
}

/* Raises the list's errors to those of a rule for a group with this axis; returns its predicted
 * error. Of the missed moment's error, either bound holds: the smoothed sum of the moduli, or the
 * smoothed greatest derivative of a group, and that of a row of groups.
 *
 * Given:     beside  the predicted error beside other groups, over that alone */
static double raise_error(const bst_smear_maker *m, const double axis[3], const bst_smear_rule *r,
                          double beside) {
    bst_smear_node_list *list = m->list;
    double part[BST_NODE_SCALES], one[BST_NODE_SCALES];
    bst_smear_direction_parts along = bst_smear_find_direction_parts(m, axis, r->nodes);
    bst_smear_missed_parts(m, &along, r, part, one);
    double square = 1.0 / (1 << (BST_NODE_SCALES - 2)),
           jump = beside < BESIDE_A_JUMP ? 1.0 : beside;
    for (int k = 0; k < BST_NODE_SCALES; k++, square *= 2.0) {
        double fourth = square * square, alone = fmin(one[k], part[k]), many = 0.0;
        int row = BST_PATTERN_ROW;
        double low = square * (square > 1.0 ? sqrt(square) : 1.0);
        double fixed = r->fixed * fmax(low, 1.0);
        double higher = (r->error - r->missed - r->fixed) * low;
        double missed = r->missed * (r->nodes == 3 ? fourth * square : fourth);
        double bound = fixed + higher + missed;
        if (one[k] < part[k]) {
            many =
                fmin(bst_smear_row_part(m, &along, r, sqrt(square), beside <= 1.0, &row), part[k]);
            part[k] = fmax(many, alone);
        }
        double rest = jump * (along.second * fixed + along.higher * higher);
        part[k] *= beside;
        double predicted = rest + part[k] * missed;
        list->higher[k] = rest > list->higher[k] ? rest : list->higher[k];
        if (m->direction_part && r->nodes > 1) {
            double *of = list->missed[k], *alike = of + pattern_of(m, r, square);
            *alike = fmax(*alike, beside * alone * missed);
            of[row] = fmax(of[row], beside * many * missed);
        }
        list->error[k] = bound > list->error[k] ? bound : list->error[k];
        list->predicted[k] = predicted > list->predicted[k] ? predicted : list->predicted[k];
    }
    for (int d = 0; d < BST_NODE_DIRECTIONS && m->direction_part; d++) {
        list->directions |= along.in_range[d] ? 1U << d : 0U;
    }
    return jump * (along.second * r->fixed + along.higher * (r->error - r->missed - r->fixed)) +
           part[BST_NODE_SCALES - 2] * r->missed;
}

/* Change of the velocity from one group to the next, over the greater speed, up to which they lie
 * in an even row whatever their mean speeds. */
#define EVEN_CHANGE 0.3

/* Velocity of the path's segment k. */
static void velocity_of(const bst_smear_maker *m, int k, double v[3]) {
    const bst_smear_path_point *p = &m->path[k], *q = p + 1;
    for (int i = 0; i < 3; i++) {
        v[i] = (q->p[i] - p->p[i]) / (q->s - p->s);
    }
}

/* Whether the velocity hardly changes from the last group to this one. last->velocity becomes that
 * at the end of this one. */
static bool goes_on(bst_smear_maker *m, const bst_smear_group *range) {
    bst_smear_last_group *last = &m->last;
    double v[3], change2 = 0.0, most2[2] = {0.0, 0.0};
    int k = range->first;
    while (m->path[k + 1].s <= range->from) {
        k++;
    }
    velocity_of(m, k, v);
    for (int i = 0; i < 3; i++) {
        change2 += (v[i] - last->velocity[i]) * (v[i] - last->velocity[i]);
        most2[0] += v[i] * v[i];
        most2[1] += last->velocity[i] * last->velocity[i];
    }
    for (; k + 2 < m->count && m->path[k + 1].s < range->to; k++) {
    }
    velocity_of(m, k, last->velocity);
    return change2 <= EVEN_CHANGE * EVEN_CHANGE * fmax(most2[0], most2[1]);
}

/* Compares a group with the last one, which it becomes. */
static double beside_last(bst_smear_maker *m, const bst_smear_moments *g,
                          const bst_smear_group *range, double weight) {
    bst_smear_last_group *last = &m->last;
    bool smooth = goes_on(m, range);
    double distance2 = 0.0, length = sqrt(12.0 * g->along[2]), speed = length / weight;
    double ratio = last->rests         ? INFINITY
                   : last->speed > 0.0 ? fmax(speed / last->speed, last->speed / speed)
                                       : 1.0;
    for (int i = 0; i < 3; i++) {
        distance2 += (g->mean[i] - last->mean[i]) * (g->mean[i] - last->mean[i]);
    }
    double apart = 0.5 * EVEN_DISTANCE * (length + last->length);
    bool even =
        !(last->speed > 0.0) || smooth || (ratio < EVEN_SPEEDS && distance2 > apart * apart);
    memcpy(last->mean, g->mean, sizeof last->mean);
    last->length = length;
    last->speed = speed;
    last->rests = false;
    return !(ratio < JUMP_SPEEDS) ? BESIDE_A_JUMP : even ? 1.0 : BESIDE_ANOTHER;
}

/* Raises the predicted error of the last group to what it is beside the next one. */
static void raise_last(bst_smear_maker *m, double beside) {
    if (m->last.beside > 0.0 && beside > m->last.beside) {
        double predicted = raise_error(m, m->last.axis, &m->last.rule, beside);
        for (int n = m->last.first; n < m->last.end; n++) {
            m->list->items[n].predicted = predicted;
        }
    }
}

/* Appends the node of a group at rest, which is exact. Groups beside it are beside a jump. */
static bst_status emit_rest(bst_ctx *ctx, bst_smear_maker *m, const double mean[3], double weight) {
    raise_last(m, BESIDE_A_JUMP);
    m->last = (bst_smear_last_group){.rests = true};
    return push(ctx, m->list, mean, weight, 0.0, (const double[2]){0.0, 0.0});
}

static bst_status emit(bst_ctx *ctx, bst_smear_maker *m, const bst_smear_moments *g,
                       const bst_smear_group *range, const bst_smear_rule *r, double weight) {
    bool split = r->pair[0] != 0.0 || r->pair[1] != 0.0 || r->pair[2] != 0.0;
    double beside = beside_last(m, g, range, weight);
    raise_last(m, beside);
    m->last.beside = beside;
    m->last.first = m->list->count;
    m->last.rule = *r;
    memcpy(m->last.axis, g->axis, sizeof m->last.axis);
    const double error[2] = {r->error, raise_error(m, g->axis, r, beside)};
    for (int n = 0; n < r->nodes; n++) {
        for (int side = -1; side <= 1; side += 2) {
            double p[3];
            for (int i = 0; i < 3; i++) {
                p[i] = g->mean[i] + r->node[n] * g->axis[i] + r->curve[n] * r->bend[i] +
                       (split ? side * r->pair[i] : 0.0);
            }
            BST_TRY(push(ctx, m->list, p, weight * r->weight[n] * (split ? 0.5 : 1.0),
                         r->widening * m->image_share, error));
            if (!split) {
                break;
            }
        }
    }
    m->last.end = m->list->count;
    return BST_OK;
}

static bool single_stretch(const bst_smear_maker *m, const bst_smear_group *g) {
    int k = g->first;
    while (k + 2 < m->count && m->path[k + 1].s <= g->from) {
        k++;
    }
    return k + 2 >= m->count || m->path[k + 1].s >= g->to;
}

/* Adapts the next group's size to the tolerance: the error goes as the third power of the spread on
 * a straight path. */
static void adapt(bst_smear_maker *m, double error) {
    double change = error > 0.0 ? cbrt(0.8 * m->tolerance / error) : 2.0;
    m->most = fmin(m->most * fmin(fmax(change, 0.4), 1.6), m->limit);
}

/* Moves *late to the group's part from a path point on, which must lie within it. */
static void split_at(bst_smear_group *g, bst_smear_group *late, int segment, double at) {
    *late = (bst_smear_group){segment, at, g->to};
    g->to = at;
}

/* Most splits of a group. */
enum { MOST_DEPTH = 40 };

/* Replaces a group by nodes, or by two parts of its time if no rule is accurate enough: its halves,
 * or those before and after a jump of the speed. */
static bst_status close_group(bst_ctx *ctx, bst_smear_maker *m, bst_smear_group g, int depth) {
    bst_smear_group late;
    bst_smear_moments t;
    bst_smear_rule best = {.error = INFINITY}, r;
    bst_smear_second_moments(m, &g, &t);
    double spread = bst_smear_spread(&t);
    double weight = (g.to - g.from) / m->total;
    if (!(spread > 1e-12 * m->variance)) {
        return emit_rest(ctx, m, t.mean, weight);
    }
    bst_smear_high_moments(m, &g, &t);
    int change = bst_smear_find_speed_change(m, &g, &t);
    if (change >= 0 && depth < MOST_DEPTH) {
        split_at(&g, &late, change, m->path[change].s);
        BST_TRY(close_group(ctx, m, g, depth + 1));
        return close_group(ctx, m, late, depth + 1);
    }
    bst_smear_choose_rule(m, &t, m->tolerance, &best);
    /* a round distribution does not become thinner by halving */
    if (best.error > m->tolerance && !m->widen && t.across > 0.2 * t.along[2]) {
        bst_smear_try_rule(m, &t, 2, false, true, INFINITY, &r);
        if (r.error < best.error) {
            best = r;
        }
    }
    if (depth == 0 && best.nodes == 3) {
        adapt(m, best.error);
    }
    if (best.error > m->tolerance && depth < MOST_DEPTH &&
        !(single_stretch(m, &g) && spread < 1e-6 * m->variance)) {
        double middle = 0.5 * (g.from + g.to);
        int segment = g.first;
        while (m->path[segment + 1].s <= middle) {
            segment++;
        }
        split_at(&g, &late, segment, middle);
        BST_TRY(close_group(ctx, m, g, depth + 1));
        return close_group(ctx, m, late, depth + 1);
    }
    if (best.error > m->tolerance) {
        bst_smear_choose_rule(m, &t, INFINITY, &best);
    }
    set_kernel(m, &g, &t, &best);
    return emit(ctx, m, &t, &g, &best, weight);
}

/* Moments of a part of the path about an origin, for the greedy grouping. */
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
    assert(path && aim && list && count >= 2 && bst_is_positive(aim->psf_sigma_px));
    assert(aim->tolerance > 0.0 && aim->widest >= 0.0 && aim->widest <= BST_NODE_WIDEST);
    double variance = aim->psf_sigma_px * aim->psf_sigma_px, tolerance = aim->tolerance;
    double wide = fmax(aim->wide_field, 1.0);
    bst_smear_maker m = {
        .path = path,
        .count = count,
        .total = path[count - 1].s - path[0].s,
        .variance = variance,
        .tolerance = tolerance,
        .widen = aim->widest > 0.0,
        .list = list,
        .widest = aim->widest * variance,
        .wide_field = wide,
        .curvature = aim->curvature,
        .binned_variance = aim->binned_variance,
        .further_variance = aim->further_variance,
        .direction_part = aim->direction_part,
        .smooth_part = aim->smooth_part,
        .row_ripple = aim->row_ripple,
        .most_per_px = aim->most_per_px,
        .light_part = aim->light_part,
        .turns = aim->turns,
        .unlike_rad = aim->unlike_rad,
        /* mean over the boresight and four corners: full scale, and 1 / wide^2 across */
        .image_share = (2.0 + 3.0 / (wide * wide)) / 5.0};
    if (!(m.total > 0.0)) {
        return push(ctx, list, path[0].p, 1.0, 0.0, (const double[2]){0.0, 0.0});
    }
    /* three nodes on a uniform part of variance v miss 0.617 v^3 of the sixth moment */
    for (int k = 0; k < 3; k++) {
        m.pixel_part[k] = aim->pixel_part[k] > 0.0 ? aim->pixel_part[k] : 1.0;
    }
    /* 5 % below: the path is not quite uniform */
    m.limit = m.most = 0.95 * m.variance * cbrt(tolerance / m.pixel_part[2] * 48.0 / 0.617);
    bst_smear_group g = {0, path[0].s, path[0].s};
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
            BST_TRY(close_group(ctx, &m,
                                (bst_smear_group){k, p->s + n * step, p->s + (n + 1) * step}, 0));
        }
        /* the last piece starts the next group */
        g = (bst_smear_group){k, p->s + (pieces - 1) * step, q->s};
        e = (extent){0};
        for (int i = 0; i < 3; i++) {
            a[i] = (q->p[i] - p->p[i]) * (pieces - 1) / pieces;
            b[i] = q->p[i] - p->p[i];
        }
        extend(&e, a, b, step);
    }
    return close_group(ctx, &m, g, 0);
}
