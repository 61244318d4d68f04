#include "sim/analysis/characterize/simplex_search.h"

#include <assert.h>
#include <math.h>
#include <string.h>

enum { N = BST_SIMPLEX_PARAMETERS };

/* Corners of the simplex with their costs, the best first. */
typedef struct simplex {
    double (*cost)(const void *user, const double *x);
    const void *user;
    int count, evaluations;
    double x[N + 1][N], f[N + 1];
} simplex;

/* Moves a corner to its place in the order of costs. */
static void sort_corner(simplex *s, int i) {
    for (; i > 0 && s->f[i] < s->f[i - 1]; i--) {
        double f = s->f[i], x[N];
        memcpy(x, s->x[i], sizeof x);
        memcpy(s->x[i], s->x[i - 1], sizeof x);
        memcpy(s->x[i - 1], x, sizeof x);
        s->f[i] = s->f[i - 1];
        s->f[i - 1] = f;
    }
}

/* Cost of the point at `factor` from the centre of the better corners to the worst one. */
static double try_point(simplex *s, double factor, double *x) {
    for (int k = 0; k < s->count; k++) {
        double centre = 0.0;
        for (int i = 0; i < s->count; i++) {
            centre += s->x[i][k] / s->count;
        }
        x[k] = centre + factor * (s->x[s->count][k] - centre);
    }
    s->evaluations++;
    return s->cost(s->user, x);
}

/* Replaces the worst corner. */
static void replace(simplex *s, const double *x, double f) {
    memcpy(s->x[s->count], x, (size_t)s->count * sizeof *x);
    s->f[s->count] = f;
    sort_corner(s, s->count);
}

/* Halves the distances to the best corner. */
static void shrink(simplex *s) {
    for (int i = 1; i <= s->count; i++) {
        for (int k = 0; k < s->count; k++) {
            s->x[i][k] = 0.5 * (s->x[i][k] + s->x[0][k]);
        }
        s->f[i] = s->cost(s->user, s->x[i]);
        s->evaluations++;
    }
    for (int i = 1; i <= s->count; i++) {
        sort_corner(s, i);
    }
}

double bst_simplex_search(double (*cost)(const void *user, const double *x), const void *user,
                          int count, double *x, const double *step, int turns) {
    assert(cost && x && step && count >= 1 && count <= N);
    simplex s = {.cost = cost, .user = user, .count = count, .evaluations = count + 1};
    for (int i = 0; i <= count; i++) {
        memcpy(s.x[i], x, (size_t)count * sizeof *x);
        if (i > 0) {
            s.x[i][i - 1] += step[i - 1];
        }
        s.f[i] = cost(user, s.x[i]);
        sort_corner(&s, i);
    }
    while (s.evaluations < turns && s.f[count] - s.f[0] > 1e-6 * fabs(s.f[0])) {
        double reflected[N], other[N], worst = s.f[count];
        double f = try_point(&s, -1.0, reflected);
        if (f < s.f[0]) {
            double g = try_point(&s, -2.0, other);
            replace(&s, g < f ? other : reflected, fmin(g, f));
        } else if (f < s.f[count - 1]) {
            replace(&s, reflected, f);
        } else {
            double g = try_point(&s, f < worst ? -0.5 : 0.5, other);
            if (g < fmin(f, worst)) {
                replace(&s, other, g);
            } else {
                shrink(&s);
            }
        }
    }
    memcpy(x, s.x[0], (size_t)count * sizeof *x);
    return s.f[0];
}
