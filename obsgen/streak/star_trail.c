#include "obsgen/streak/star_trail.h"

#include <assert.h>
#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "boresight/vec.h"
#include "obsgen/model/matched_filter_theory.h"

static double density(double z) {
    return exp(-0.5 * z * z) / 2.5066282746310002;
}
/* Sigmas beyond which a normal distribution is 0 or 1 to double precision. */
static const double ALL_SIGMAS = 9.0;
/* Bends below this are neglected. */
static const double STRAIGHT_PX = 0.2;
/* Distance beyond the ends of a path at which light is negligible. */
static const double BEYOND_SIGMAS = 4.0;
/* Positions closer than this along both axes share a node. */
static const double SAME_PX = 0.7;

enum {
    GROUP = 8,
    /* Most steps before and after one with which it is averaged: what is left of the jitter of a
     * path at rest is a twelfth. */
    MOST_AVERAGED = 72
};

/* Trail nodes under construction, with a bounding box per GROUP of them. */
typedef struct trail_builder {
    bst_star_trail_node *nodes;
    int count;
    struct group_box {
        double x0, x1, y0, y1;
    } box[BST_ROUTE_NODES / GROUP];
} trail_builder;

/* True if a node from index `first` on lies at a position. */
static bool has_node_at(const trail_builder *l, int first, double x, double y) {
    for (int from = first / GROUP * GROUP; from < l->count; from += GROUP) {
        const struct group_box *b = &l->box[from / GROUP];
        if (!(x > b->x0 - 1.0 && x < b->x1 + 1.0 && y > b->y0 - 1.0 && y < b->y1 + 1.0)) {
            continue;
        }
        for (int i = from > first ? from : first; i < from + GROUP && i < l->count; i++) {
            if (fabs(l->nodes[i].x - x) < SAME_PX && fabs(l->nodes[i].y - y) < SAME_PX) {
                return true;
            }
        }
    }
    return false;
}

/* Appends a node unless a recent one is at the position. */
static void add_node(trail_builder *l, double x, double y, double time) {
    /* beyond this many nodes back, a returning path is a separate part of the trail */
    enum { BACK = 48 };
    if (l->count == BST_ROUTE_NODES ||
        has_node_at(l, l->count > BACK ? l->count - BACK : 0, x, y)) {
        return;
    }
    struct group_box *b = &l->box[l->count / GROUP];
    if (l->count % GROUP == 0) {
        *b = (struct group_box){x, x, y, y};
    }
    b->x0 = x < b->x0 ? x : b->x0;
    b->x1 = x > b->x1 ? x : b->x1;
    b->y0 = y < b->y0 ? y : b->y0;
    b->y1 = y > b->y1 ? y : b->y1;
    assert(l->count < BST_ROUTE_NODES);
    l->nodes[l->count++] = (bst_star_trail_node){x, y, time, 0.0};
}

/* Extends the trail straight beyond one end. */
static void extend_trail(trail_builder *l, int end, int before, double sigma_px, double time) {
    const bst_star_trail_node e = l->nodes[end], b = l->nodes[before];
    double dx = e.x - b.x, dy = e.y - b.y, length = hypot(dx, dy);
    for (int i = 1; i <= (int)ceil(BEYOND_SIGMAS * sigma_px) && length > 0.0; i++) {
        add_node(l, e.x + i * dx / length, e.y + i * dy / length, time);
    }
}

/* A uniform straight piece of a path. */
typedef struct piece {
    double x, y, cx, cy; /* middle; direction */
    double half, near;   /* half length; extent of its light along either axis */
    double height;       /* peak light: each piece has an equal share of the exposure */
} piece;

/* Piece k of a path. */
static piece piece_of(const bst_star_trail_path *p, int k, double s) {
    double dx = p->x_px[k] - p->x_px[k - 1], dy = p->y_px[k] - p->y_px[k - 1];
    double length = hypot(dx, dy), share = 1.0 / (p->count - 1);
    piece out = {.x = 0.5 * (p->x_px[k] + p->x_px[k - 1]),
                 .y = 0.5 * (p->y_px[k] + p->y_px[k - 1]),
                 .half = 0.5 * length / s,
                 .near = 6.0 * s + 0.5 * length,
                 .height = share};
    /* a shorter step is a point: L^2 / 12 < 0.8 % of s^2 */
    if (length >= 0.3 * s) {
        out.cx = dx / (length * s);
        out.cy = dy / (length * s);
        out.height = share * (s / length) * 2.5066282746310002;
    }
    return out;
}

/* Light of a piece at (x, y) relative to its middle. */
static double piece_light(const piece *p, double x, double y, double s) {
    if (p->cx == 0.0 && p->cy == 0.0) { /* a point */
        return p->height * exp(-0.5 * (x * x + y * y) / (s * s));
    }
    double u = x * p->cx + y * p->cy, v = y * p->cx - x * p->cy;
    double high = u + p->half, low = u - p->half;
    double within = high > ALL_SIGMAS && low < -ALL_SIGMAS
                        ? 1.0
                        : bst_matched_normal_below(high) - bst_matched_normal_below(low);
    return p->height * exp(-0.5 * v * v) * within;
}

/* Adds the light of the whole path at its nodes. */
static void add_light(const bst_star_trail_path *path, double s, bst_star_trail_node *nodes,
                      int count) {
    for (int k = 1; k < path->count; k++) {
        piece p = piece_of(path, k, s);
        for (int i = 0; i < count; i++) {
            double x = nodes[i].x - p.x, y = nodes[i].y - p.y;
            if (fabs(x) <= p.near && fabs(y) <= p.near) {
                nodes[i].light += piece_light(&p, x, y, s);
            }
        }
    }
}

/* Steps from k in one direction to the last one on the path within a distance, at most
 * MOST_AVERAGED. */
static int steps_within(const bst_star_trail_path *p, int k, int way, double within_px) {
    int n = 0;
    for (int i = k + way; i >= 0 && i < p->count && n < MOST_AVERAGED; i += way, n++) {
        double dx = p->x_px[i] - p->x_px[k], dy = p->y_px[i] - p->y_px[k];
        if (dx * dx + dy * dy > within_px * within_px) {
            break;
        }
    }
    return n;
}

/* Place of step k on the ridge of the filter's output: the line of regression over time of the
 * steps nearby. The output of a camera that trembles faster than it moves by the width of the
 * filter has no such bends as the path: on the path itself it would seem to rise and fall. */
static void ridge_at(const bst_star_trail_path *p, int k, double within_px, double at_px[2]) {
    int first = k - steps_within(p, k, -1, within_px), last = k + steps_within(p, k, 1, within_px);
    double count = last - first + 1, middle = 0.5 * (first + last), sum[2] = {0.0, 0.0},
           slope[2] = {0.0, 0.0};
    for (int i = first; i <= last; i++) {
        sum[0] += p->x_px[i];
        sum[1] += p->y_px[i];
        slope[0] += (i - middle) * p->x_px[i];
        slope[1] += (i - middle) * p->y_px[i];
    }
    double square = fmax(count * (count * count - 1.0) / 12.0, 1.0); /* of the times */
    at_px[0] = sum[0] / count + (k - middle) * slope[0] / square;
    at_px[1] = sum[1] / count + (k - middle) * slope[1] / square;
}

int bst_star_trail_parts(const bst_star_trail_path *p, double more_x_px, double more_y_px,
                         double step_px, int most) {
    assert(p && p->count >= 2 && step_px > 0.0);
    double longest2 = 0.0;
    int steps = p->count - 1;
    for (int k = 1; k <= steps; k++) {
        double dx = p->x_px[k] - p->x_px[k - 1] + more_x_px / steps;
        double dy = p->y_px[k] - p->y_px[k - 1] + more_y_px / steps;
        longest2 = fmax(longest2, dx * dx + dy * dy);
    }
    double parts = fmin(ceil(sqrt(longest2) / step_px), (most - 1) / steps);
    return parts > 1.0 ? (int)parts : 1;
}

static void divide(double *places, int count, int parts) {
    for (int k = count - 1; k > 0; k--) { /* from the end: places move to higher indices */
        double from = places[k - 1], to = places[k];
        for (int i = 1; i <= parts; i++) {
            places[(k - 1) * parts + i] = from + (to - from) * i / parts;
        }
    }
}

int bst_star_trail_divide(double *x_px, double *y_px, int count, int parts) {
    assert(x_px && y_px && count >= 2 && parts >= 1);
    divide(x_px, count, parts);
    divide(y_px, count, parts);
    return (count - 1) * parts + 1;
}

int bst_star_trail_lay(const bst_star_trail_path *p, double sigma_px, bst_star_trail_node *nodes) {
    trail_builder l = {.nodes = nodes};
    /* an even average over this distance to both sides has the variance of the filter's output */
    double from[2], to[2], within = sqrt(3.0) * sqrt(2.0) * sigma_px;
    ridge_at(p, 0, within, to);
    add_node(&l, to[0], to[1], 0.0);
    for (int k = 1; k < p->count; k++) {
        memcpy(from, to, sizeof from);
        ridge_at(p, k, within, to);
        double dx = to[0] - from[0], dy = to[1] - from[1];
        int steps = (int)fmin(ceil(hypot(dx, dy)), BST_ROUTE_NODES);
        for (int i = 1; i <= steps; i++) {
            double part = (double)i / steps;
            add_node(&l, from[0] + part * dx, from[1] + part * dy, (k - 1 + part) / (p->count - 1));
        }
    }
    int last = l.count - 1;
    if (last > 0) {
        extend_trail(&l, last, last > 2 ? last - 3 : 0, sigma_px, 1.0);
        /* nodes before the start go first, to keep the order of the trail */
        int laid = l.count;
        extend_trail(&l, 0, last > 2 ? 3 : last, sigma_px, 0.0);
        int more = l.count - laid;
        for (int i = 0; i < more; i++) {
            bst_star_trail_node moved = nodes[l.count - 1];
            memmove(nodes + i + 1, nodes + i, (size_t)(l.count - 1 - i) * sizeof *nodes);
            nodes[i] = moved;
        }
    }
    add_light(p, sigma_px * sqrt(2.0), nodes, l.count);
    return l.count;
}

/* Sampled positions of a uniform streak model. */
enum { MOST_PLACES = 48, MOST_SAMPLES = 128 };
typedef struct model {
    double x[MOST_PLACES], y[MOST_PLACES];
    int count;
} model;

static model make_model(double dx, double dy, double bend_x, double bend_y, double s) {
    model m;
    double length = hypot(dx, dy) + 2.0 * hypot(bend_x, bend_y);
    m.count = (int)fmin(ceil(1.5 * length / s) + 1.0, MOST_PLACES);
    for (int i = 0; i < m.count; i++) {
        double u = m.count > 1 ? (i + 0.5) / m.count * 2.0 - 1.0 : 0.0;
        double bent = 0.5 * (3.0 * u * u - 1.0);
        m.x[i] = 0.5 * u * dx + bent * bend_x;
        m.y[i] = 0.5 * u * dy + bent * bend_y;
    }
    return m;
}

/* Adds the gradient of the overlap between light at a position and the model. */
static void add_overlap_gradient(const model *m, double x, double y, double s, double weight,
                                 double pull[2]) {
    for (int i = 0; i < m->count; i++) {
        double dx = x - m->x[i], dy = y - m->y[i];
        double w = weight * exp(-0.5 * (dx * dx + dy * dy) / (s * s));
        pull[0] += w * dx;
        pull[1] += w * dy;
    }
}

/* Negative Hessian of the model's self-overlap. */
static void overlap_curvature(const model *m, double s, double h[3]) {
    h[0] = h[1] = h[2] = 0.0;
    for (int i = 0; i < m->count; i++) {
        for (int k = 0; k < m->count; k++) {
            double dx = m->x[i] - m->x[k], dy = m->y[i] - m->y[k];
            double w = exp(-0.5 * (dx * dx + dy * dy) / (s * s)) / m->count;
            h[0] += w * (1.0 - dx * dx / (s * s));
            h[1] -= w * dx * dy / (s * s);
            h[2] += w * (1.0 - dy * dy / (s * s));
        }
    }
}

/* Most path steps for a point's bias; longer paths are averaged in groups. */
enum { MOST_STEPS = 512 };

/* Path steps and the share of the exposure in each; returns their number. */
static int gather_steps(const bst_star_trail_path *p, float *x, float *y, float *share) {
    int together = (p->count + MOST_STEPS - 1) / MOST_STEPS, count = 0;
    for (int from = 0; from < p->count; from += together, count++) {
        double sum_x = 0.0, sum_y = 0.0, sum = 0.0;
        for (int k = from; k < from + together && k < p->count; k++) {
            double w = (k == 0 || k == p->count - 1 ? 0.5 : 1.0) / (p->count - 1);
            sum_x += w * p->x_px[k];
            sum_y += w * p->y_px[k];
            sum += w;
        }
        x[count] = (float)(sum_x / sum);
        y[count] = (float)(sum_y / sum);
        share[count] = (float)sum;
    }
    return count;
}

/* First-order bias of a straight model in closed form. */
static void straight_bias(const bst_star_trail_path *p, double dx_px, double dy_px, double s,
                          double bias_px[2]) {
    double length = hypot(dx_px, dy_px), along = 0.0, across = 0.0, value = 0.0;
    double c = length > 0.0 ? dx_px / length : 1.0, n = length > 0.0 ? dy_px / length : 0.0;
    /* a shorter path is a point: L^2 / 12 < 0.8 % of s^2 */
    bool drawn = length > 0.3 * s;
    for (int k = 0; k < p->count; k++) {
        double weight = (k == 0 || k == p->count - 1 ? 0.5 : 1.0) / (p->count - 1);
        double u = p->x_px[k] * c + p->y_px[k] * n, v = p->y_px[k] * c - p->x_px[k] * n;
        double fall = weight * exp(-0.5 * v * v / (s * s)), inside;
        if (drawn) {
            double high = (u + 0.5 * length) / s, low = (u - 0.5 * length) / s;
            inside = fall * (bst_matched_normal_below(high) - bst_matched_normal_below(low));
            along += fall * (density(low) - density(high)) / s;
        } else {
            inside = fall * exp(-0.5 * u * u / (s * s));
            along += inside * u / (s * s);
        }
        across += inside * v / (s * s);
        value += inside;
    }
    value = fmax(value, 1e-6);
    /* negative second derivative of the streak's autocorrelation */
    double curve =
        drawn ? 2.0 * (density(0.0) - density(length / s)) / (s * length) : value / (s * s);
    double a = fmax(-s, fmin(along / curve, s)), b = fmax(-s, fmin(across * s * s / value, s));
    bias_px[0] = a * c - b * n;
    bias_px[1] = a * n + b * c;
}

void bst_star_trail_point_bias(const bst_star_trail_path *p, const bst_blend_weights *weights,
                               double light, double sigma_px, double bias_px[2]) {
    enum { ROUNDS = 4 };
    /* convergence limit: a fifth of 0.01 px, the bias that matters (source_shape.c) */
    static const double ENOUGH_PX = 0.002;
    float row[BST_BLEND_DISTANCES];
    bst_blend_weight_row(weights, light, row);
    float x[MOST_STEPS], y[MOST_STEPS], share[MOST_STEPS];
    int count = gather_steps(p, x, y, share);
    float scale = (float)(BST_BLEND_PER_SIGMA / sigma_px);
    for (int round = 0; round < ROUNDS; round++) {
        float at_x = (float)bias_px[0], at_y = (float)bias_px[1];
        float sum = 0.0f, pull_x = 0.0f, pull_y = 0.0f;
        for (int k = 0; k < count; k++) {
            float dx = x[k] - at_x, dy = y[k] - at_y;
            float far = sqrtf(dx * dx + dy * dy) * scale;
            int i = (int)fminf(far, BST_BLEND_DISTANCES - 2);
            float part = fminf(far - (float)i, 1.0f);
            float w = share[k] * (row[i] + part * (row[i + 1] - row[i]));
            sum += w;
            pull_x += w * dx;
            pull_y += w * dy;
        }
        double step_x = (double)(pull_x / fmaxf(sum, 1e-6f));
        double step_y = (double)(pull_y / fmaxf(sum, 1e-6f));
        bias_px[0] += step_x;
        bias_px[1] += step_y;
        if (hypot(step_x, step_y) < ENOUGH_PX) {
            break;
        }
    }
}

void bst_star_trail_bias(const bst_star_trail_path *p, double dx_px, double dy_px, double bend_x_px,
                         double bend_y_px, double sigma_px, double bias_px[2]) {
    enum { ROUNDS = 6 };
    double s = sigma_px * sqrt(2.0), h[3], total = 0.0;
    if (hypot(bend_x_px, bend_y_px) < STRAIGHT_PX) {
        straight_bias(p, dx_px, dy_px, s, bias_px);
        return;
    }
    model m = make_model(dx_px, dy_px, bend_x_px, bend_y_px, s);
    overlap_curvature(&m, s, h);
    double determinant = fmax(h[0] * h[2] - h[1] * h[1], 1e-12);
    /* averages over samples that still resolve the jitter, about their own mean */
    int samples = p->count < MOST_SAMPLES ? p->count : MOST_SAMPLES;
    double x[MOST_SAMPLES], y[MOST_SAMPLES], weight[MOST_SAMPLES];
    for (int i = 0; i < samples; i++) {
        x[i] = y[i] = weight[i] = 0.0;
    }
    for (int k = 0; k < p->count; k++) {
        int i = (int)((long)k * samples / p->count);
        double w = k == 0 || k == p->count - 1 ? 0.5 : 1.0;
        x[i] += w * p->x_px[k];
        y[i] += w * p->y_px[k];
        weight[i] += w;
        total += w;
    }
    bias_px[0] = bias_px[1] = 0.0;
    for (int round = 0; round < ROUNDS; round++) {
        double pull[2] = {0.0, 0.0};
        for (int i = 0; i < samples; i++) {
            add_overlap_gradient(&m, x[i] / weight[i] - bias_px[0], y[i] / weight[i] - bias_px[1],
                                 s, weight[i] / total, pull);
        }
        double step[2] = {(h[2] * pull[0] - h[1] * pull[1]) / determinant,
                          (h[0] * pull[1] - h[1] * pull[0]) / determinant};
        double far = hypot(step[0], step[1]), share = far > s ? s / far : 1.0;
        bias_px[0] += share * step[0];
        bias_px[1] += share * step[1];
        /* convergence limit: half of 0.01 px, the bias that matters (source_shape.c) */
        if (far < 0.005) {
            break;
        }
    }
}
