/* Moments of a group of a path. */
#include <math.h>
#include <string.h>

#include "scenegen/smear/gauss_legendre.h"
#include "scenegen/smear/smear_quadrature_internal.h"
#include "sim/core/simd.h"

/* A path point: three coordinates and a time, of which sums are meaningless. */
typedef double lanes __attribute__((vector_size(32), aligned(8), may_alias));

_Static_assert(sizeof(bst_smear_path_point) == sizeof(lanes), "a path point is read as one vector");

/* Part of segment k inside the group: both ends; returns its duration. */
static BST_INLINED double clip(const bst_smear_maker *m, const bst_smear_group *g, int k, lanes *a,
                               lanes *b) {
    const bst_smear_path_point *p = &m->path[k], *q = p + 1;
    double length = q->s - p->s;
    double from = p->s > g->from ? p->s : g->from, to = q->s < g->to ? q->s : g->to;
    if (!(to > from)) {
        return 0.0;
    }
    *a = *(const lanes *)p;
    *b = *(const lanes *)q;
    if (to - from != length) {
        lanes slope = (*b - *a) / length, start = *a;
        *a = start + slope * (from - p->s);
        *b = start + slope * (to - p->s);
    }
    return to - from;
}

static BST_INLINED bool reaches(const bst_smear_maker *m, const bst_smear_group *g, int k) {
    return k + 1 < m->count && m->path[k].s < g->to;
}

BST_CLONES_256
static void second_moments(const bst_smear_maker *m, const bst_smear_group *g,
                           bst_smear_moments *out) {
    double weight = 0.0;
    lanes a = {0}, b = {0}, origin = {0}, first = {0}, by_x = {0}, by_yz = {0};
    bool begun = false;
    memset(out, 0, sizeof *out);
    for (int k = g->first; reaches(m, g, k); k++) {
        double w = clip(m, g, k, &a, &b);
        if (!(w > 0.0)) {
            continue;
        }
        if (!begun) {
            origin = a;
            begun = true;
        }
        weight += w;
        a -= origin;
        b -= origin;
        first += w * 0.5 * (a + b);
        lanes ai = {a[1], a[1], a[2], 0.0}, aj = {a[1], a[2], a[2], 0.0};
        lanes bi = {b[1], b[1], b[2], 0.0}, bj = {b[1], b[2], b[2], 0.0};
        by_x += w * ((a[0] * a + b[0] * b) / 3.0 + (a[0] * b + b[0] * a) / 6.0);
        by_yz += w * ((ai * aj + bi * bj) / 3.0 + (ai * bj + bi * aj) / 6.0);
    }
    const double sum[3][3] = {
        {by_x[0], by_x[1], by_x[2]}, {by_x[1], by_yz[0], by_yz[1]}, {by_x[2], by_yz[1], by_yz[2]}};
    first /= weight;
    for (int i = 0; i < 3; i++) {
        out->mean[i] = origin[i] + first[i];
        for (int j = 0; j < 3; j++) {
            out->covariance[i][j] = sum[i][j] / weight - first[i] * first[j];
        }
    }
}

/* With so many segments in a group the two-point rule suffices for those whose squared length is at
 * most a third of the group's spread, as in equal ones: its error of the fourth moment is 1 /
 * segments^4. */
enum { MANY_SEGMENTS = 6, SHORT_PART = 3 };

/* Points of the Gauss-Legendre rule of a segment from a to b.
 *
 * Given:     many    the group has MANY_SEGMENTS
 *            spread  of the group */
static BST_INLINED int points_of(const lanes *a, const lanes *b, bool many, double spread) {
    lanes d = *b - *a;
    return many && (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]) * SHORT_PART <= spread ? 2 : 4;
}

/* Sums of a group's higher moments. */
typedef struct sums {
    double along[7], drift, mixed, across, weight, furthest2;
    lanes bend, twist, lean;
} sums;

/* Adds a point at that place from the mean, of this weight. */
static BST_INLINED void add_point(sums *s, const lanes *at, const lanes *axis, double part) {
    lanes d = *at, t = d * *axis;
    double x = t[0] + t[1] + t[2], power[7] = {part};
    for (int o = 1; o <= 6; o++) {
        power[o] = power[o - 1] * x;
    }
    for (int o = 0; o <= 6; o++) {
        s->along[o] += power[o];
    }
    d -= x * *axis;
    t = d * d;
    double y2 = t[0] + t[1] + t[2], distance2 = x * x + y2;
    s->bend += power[2] * d;
    s->twist += power[3] * d;
    s->lean += part * d * y2;
    s->furthest2 = distance2 > s->furthest2 ? distance2 : s->furthest2;
    s->drift += power[1] * y2;
    s->mixed += power[2] * y2;
    s->across += part * y2;
    s->weight += part;
}

BST_CLONES_256
static void high_moments(const bst_smear_maker *m, const bst_smear_group *g,
                         bst_smear_moments *out) {
    bst_smear_nodes_main_axis(out->covariance, out->axis);
    const double spread = bst_smear_spread(out);
    const bool many = reaches(m, g, g->first + MANY_SEGMENTS - 1);
    const lanes mean = {out->mean[0], out->mean[1], out->mean[2], 0.0};
    const lanes axis = {out->axis[0], out->axis[1], out->axis[2], 0.0};
    lanes a = {0}, b = {0};
    sums s = {.weight = 0.0};
    for (int k = g->first; reaches(m, g, k); k++) {
        double w = clip(m, g, k, &a, &b);
        int points = w > 0.0 ? points_of(&a, &b, many, spread) : 0;
        for (int n = 0; n < points; n++) {
            lanes d = a + bst_smear_gauss_place[points - 1][n] * (b - a) - mean;
            add_point(&s, &d, &axis, w * bst_smear_gauss_weight[points - 1][n]);
        }
    }
    for (int o = 0; o <= 6; o++) {
        out->along[o] = s.along[o] / s.weight;
    }
    for (int i = 0; i < 3; i++) {
        out->bend[i] = s.bend[i] / s.weight;
        out->twist[i] = s.twist[i] / s.weight;
        out->lean[i] = s.lean[i] / s.weight;
    }
    out->drift = s.drift / s.weight;
    out->mixed = s.mixed / s.weight;
    out->across = s.across / s.weight;
    out->furthest2 = s.furthest2;
}

BST_CLONES_256
static void kernel_moments(const bst_smear_maker *m, const bst_smear_group *g,
                           const bst_smear_moments *t, double high[2]) {
    const double spread = bst_smear_spread(t);
    const bool many = reaches(m, g, g->first + MANY_SEGMENTS - 1);
    const lanes mean = {t->mean[0], t->mean[1], t->mean[2], 0.0};
    const lanes axis = {t->axis[0], t->axis[1], t->axis[2], 0.0};
    lanes a = {0}, b = {0};
    double weight = 0.0;
    high[0] = high[1] = 0.0;
    for (int k = g->first; reaches(m, g, k); k++) {
        double w = clip(m, g, k, &a, &b);
        int points = w > 0.0 ? points_of(&a, &b, many, spread) : 0;
        for (int n = 0; n < points; n++) {
            double part = w * bst_smear_gauss_weight[points - 1][n];
            lanes d = (a + bst_smear_gauss_place[points - 1][n] * (b - a) - mean) * axis;
            double x = d[0] + d[1] + d[2], cube = x * x * x, seventh = cube * cube * x;
            high[0] += part * seventh;
            high[1] += part * seventh * x;
            weight += part;
        }
    }
    high[0] /= weight;
    high[1] /= weight;
}

/* The clones themselves would be seen in the shared library. */
void bst_smear_second_moments(const bst_smear_maker *m, const bst_smear_group *g,
                              bst_smear_moments *out) {
    second_moments(m, g, out);
}

void bst_smear_high_moments(const bst_smear_maker *m, const bst_smear_group *g,
                            bst_smear_moments *out) {
    high_moments(m, g, out);
}

void bst_smear_kernel_moments(const bst_smear_maker *m, const bst_smear_group *g,
                              const bst_smear_moments *t, double high[2]) {
    kernel_moments(m, g, t, high);
}

/* Squared distance from the mean, over the largest spread of a group, beyond which light is
 * searched for a tail: on a uniform path it is 3, or less. */
#define TAIL_SPREADS 4.0
/* Share of the group's time, less the share of its length, at a path point where the speed changes
 * so much that the faster part is faint: beside a turning point it is at most 1 / 4. */
#define SPEED_CHANGE_SHARE 0.35

int bst_smear_find_speed_change(const bst_smear_maker *m, const bst_smear_group *g,
                                const bst_smear_moments *t) {
    if (!(t->furthest2 > TAIL_SPREADS * m->limit)) {
        return -1;
    }
    double way = 0.0, so_far = 0.0, most = SPEED_CHANGE_SHARE;
    lanes a = {0}, b = {0};
    int change = -1;
    for (int round = 0; round < 2; round++) {
        for (int k = g->first; reaches(m, g, k); k++) {
            if (!(clip(m, g, k, &a, &b) > 0.0)) {
                continue;
            }
            double share = (m->path[k].s - g->from) / (g->to - g->from);
            double apart = fabs(share - so_far / way);
            if (round > 0 && m->path[k].s > g->from && apart > most) {
                most = apart;
                change = k;
            }
            double *to = round == 0 ? &way : &so_far;
            lanes d = b - a;
            *to += sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
        }
    }
    return change;
}
