#include "sim/astro/gauss_angles.h"

#include <stdbool.h>

/* Gauss's equation of degree eight for the middle geocentric range. */
static double octic(double a, double b, double c, double x) {
    double x3 = x * x * x;
    return x3 * x3 * (x * x + a) + b * x3 + c;
}

/* Quintic whose positive zeros are those of the octic's derivative. */
static double quintic(double a, double b, double c, double x) {
    (void)c;
    return x * x * x * (8.0 * x * x + 6.0 * a) + 3.0 * b;
}

/* A polynomial and its coefficients. */
typedef struct polynomial {
    double (*f)(double a, double b, double c, double x);
    double a, b, c;
} polynomial;

static double value_of(const polynomial *p, double x) {
    return p->f(p->a, p->b, p->c, x);
}

/* Zero between two points with opposite signs, by bisection. */
static double bisect(const polynomial *p, double low, double high) {
    bool rising = value_of(p, high) > 0.0;
    for (int i = 0; i < 200; i++) {
        double middle = 0.5 * (low + high);
        if (middle == low || middle == high) {
            break;
        }
        if ((value_of(p, middle) > 0.0) == rising) {
            high = middle;
        } else {
            low = middle;
        }
    }
    return 0.5 * (low + high);
}

/* Adds sign changes between consecutive `knots` to `zeros`. */
static int zeros_between(const polynomial *p, const double *knots, int count, double *zeros,
                         int room) {
    int found = 0;
    for (int i = 0; i + 1 < count && found < room; i++) {
        double left = value_of(p, knots[i]), right = value_of(p, knots[i + 1]);
        if ((left > 0.0) != (right > 0.0)) {
            zeros[found++] = bisect(p, knots[i], knots[i + 1]);
        }
    }
    return found;
}

int bst_gauss_roots(double a, double b, double c, double roots[BST_GAUSS_ROOTS]) {
    /* scaled so that no coefficient exceeds 1: all roots are at most 2 (Lagrange's bound) */
    double unit = fmax(fmax(sqrt(fabs(a)), pow(fabs(b), 0.2)), pow(fabs(c), 0.125));
    if (!(unit > 0.0) || !isfinite(unit)) {
        return 0;
    }
    a /= unit * unit;
    b /= pow(unit, 5.0);
    c /= pow(unit, 8.0);
    double knots[6] = {0.0}, turning[2];
    int count = 1;
    if (a < 0.0) {
        knots[count++] = sqrt(-18.0 * a / 40.0);
    }
    knots[count++] = 2.5;
    int turns = zeros_between(&(polynomial){quintic, a, b, c}, knots, count, turning, 2);
    count = 1;
    for (int i = 0; i < turns; i++) {
        knots[count++] = turning[i];
    }
    knots[count++] = 2.5;
    int found = zeros_between(&(polynomial){octic, a, b, c}, knots, count, roots, BST_GAUSS_ROOTS);
    for (int i = 0; i < found; i++) {
        roots[i] *= unit;
    }
    return found;
}

/* Quantities that do not depend on the root. */
typedef struct triangle {
    double mu, t1, t3, span; /* times relative to the second */
    double d0, d[3][3]; /* products of observer positions with normals of pairs of directions */
} triangle;

/* Ranges from the observer at the three sights. */
static void solve_ranges(const triangle *k, double r, double a, double b, double range[3]) {
    double r3 = r * r * r, t1 = k->t1, t3 = k->t3, t = k->span, mu = k->mu;
    range[0] = ((6.0 * (k->d[2][0] * t1 / t3 + k->d[1][0] * t / t3) * r3 +
                 mu * k->d[2][0] * (t * t - t1 * t1) * t1 / t3) /
                    (6.0 * r3 + mu * (t * t - t3 * t3)) -
                k->d[0][0]) /
               k->d0;
    range[1] = a + mu * b / r3;
    range[2] = ((6.0 * (k->d[0][2] * t3 / t1 - k->d[1][2] * t / t1) * r3 +
                 mu * k->d[0][2] * (t * t - t3 * t3) * t3 / t1) /
                    (6.0 * r3 + mu * (t * t - t1 * t1)) -
                k->d[2][2]) /
               k->d0;
}

/* Makes an orbit from a root of Gauss's equation; false: no positive ranges. */
static bool make_orbit(const triangle *k, const bst_gauss_sight s[3], double r, double a, double b,
                       bst_gauss_orbit *out) {
    out->geocentric_range_m = r;
    solve_ranges(k, r, a, b, out->range_m);
    for (int i = 0; i < 3; i++) {
        if (!(out->range_m[i] > 0.0) || !isfinite(out->range_m[i])) {
            return false;
        }
        out->position_m[i] = bst_vec3_axpy(s[i].observer_m, out->range_m[i], s[i].direction);
    }
    double u = k->mu / (r * r * r);
    double f1 = 1.0 - 0.5 * u * k->t1 * k->t1, g1 = k->t1 * (1.0 - u * k->t1 * k->t1 / 6.0);
    double f3 = 1.0 - 0.5 * u * k->t3 * k->t3, g3 = k->t3 * (1.0 - u * k->t3 * k->t3 / 6.0);
    double w = f1 * g3 - f3 * g1;
    out->velocity_mps = bst_vec3_scale(
        bst_vec3_axpy(bst_vec3_scale(out->position_m[2], f1), -f3, out->position_m[0]), 1.0 / w);
    return isfinite(bst_vec3_norm(out->velocity_mps));
}

bst_status bst_gauss_angles(bst_ctx *ctx, double mu, const bst_gauss_sight s[3],
                            bst_gauss_orbit orbits[BST_GAUSS_ROOTS], int *count) {
    *count = 0;
    triangle k = {.mu = mu, .t1 = s[0].time_s - s[1].time_s, .t3 = s[2].time_s - s[1].time_s};
    k.span = k.t3 - k.t1;
    if (!(k.t1 < 0.0) || !(k.t3 > 0.0) || !isfinite(k.span)) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "Gauss's method needs three times that rise");
    }
    bst_vec3 q1 = s[0].direction, q2 = s[1].direction, q3 = s[2].direction;
    const bst_vec3 p[3] = {bst_vec3_cross(q2, q3), bst_vec3_cross(q1, q3), bst_vec3_cross(q1, q2)};
    k.d0 = bst_vec3_dot(q1, p[0]);
    /* minimum deviation of a plane arc of this length from a great circle */
    double spread = bst_vec3_norm(p[1]);
    if (!(fabs(k.d0) > 1e-9 * spread * bst_vec3_norm(p[0]) * bst_vec3_norm(p[2]))) {
        return bst_fail(ctx, BST_ERR_NUMERIC,
                        "Gauss's method: the three directions lie in one plane (the observer is in "
                        "the body's orbital plane, or directions are equal), which leaves the "
                        "ranges open");
    }
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            k.d[i][j] = bst_vec3_dot(s[i].observer_m, p[j]);
        }
    }
    double t1 = k.t1, t3 = k.t3, t = k.span;
    double a = (-k.d[0][1] * t3 / t + k.d[1][1] + k.d[2][1] * t1 / t) / k.d0;
    double b = (k.d[0][1] * (t3 * t3 - t * t) * t3 / t + k.d[2][1] * (t * t - t1 * t1) * t1 / t) /
               (6.0 * k.d0);
    double e = bst_vec3_dot(s[1].observer_m, q2);
    double r2 = bst_vec3_dot(s[1].observer_m, s[1].observer_m);
    double roots[BST_GAUSS_ROOTS];
    int found = bst_gauss_roots(-(a * a + 2.0 * a * e + r2), -2.0 * mu * b * (a + e),
                                -mu * mu * b * b, roots);
    for (int i = 0; i < found; i++) {
        *count += make_orbit(&k, s, roots[i], a, b, &orbits[*count]);
    }
    return BST_OK;
}
