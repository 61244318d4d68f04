#include <stdlib.h>

#include "sim/astro/bodies.h"
#include "sim/astro/gravity_internal.h"

/* The solid harmonics of degree n, order m, V and W (Montenbruck and Gill 3.29), normalised, follow
 * from those of lower degree by `a` and `b`; the weights for acceleration and potential collect all
 * coefficients that multiply them. */
typedef struct term {
    double a, b;
    double xv, xw, yv, yw, zv, zw;
    double uv, uw;
} term;

struct bst_gravity {
    double gm, radius;
    int degree, order;
    double *diagonal; /* by order: recursion from V, W of order m - 1 to order m */
    /* Column by column: order 0 to order + 1, in it degree m to degree + 1. NULL: point mass. */
    term *terms;
};

bst_status bst_gravity_make(bst_ctx *ctx, double gm_m3ps2, double radius_m, int degree, int order,
                            const double (*cs)[2], bst_gravity **out) {
    *out = NULL;
    bst_gravity *g = calloc(1, sizeof *g);
    if (!g) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a gravity field");
    }
    *g = (bst_gravity){gm_m3ps2, radius_m, degree, order, NULL, NULL};
    if (degree < 2) {
        *out = g;
        return BST_OK;
    }
    int columns = order + 2, rows = degree + 2;
    g->diagonal = calloc((size_t)columns, sizeof *g->diagonal);
    g->terms = calloc((size_t)columns * (size_t)rows, sizeof *g->terms);
    if (!g->diagonal || !g->terms) {
        bst_gravity_free(g);
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a gravity field of degree %d",
                        degree);
    }
    term *t = g->terms;
    for (int m = 0; m < columns; m++) {
        g->diagonal[m] = m == 1 ? sqrt(3.0) : sqrt((2.0 * m + 1.0) / fmax(2.0 * m, 1.0));
        for (int n = m; n < rows; n++, t++) {
            double nn = n, mm = m;
            t->a = n > m ? sqrt((2 * nn + 1) * (2 * nn - 1) / ((nn - mm) * (nn + mm))) : 0.0;
            t->b = n > m + 1 ? sqrt((2 * nn + 1) * (nn + mm - 1) * (nn - mm - 1) /
                                    ((2 * nn - 3) * (nn - mm) * (nn + mm)))
                             : 0.0;
            /* of the coefficients of degree k = n - 1 (Montenbruck and Gill 3.33) */
            int k = n - 1;
            double ratio = (2.0 * k + 1.0) / (2.0 * k + 3.0), kk = k;
            if (k >= 2 && m >= 1 && m - 1 <= k && m - 1 <= order) {
                const double *c = cs[bst_gravity_index(k, m - 1)];
                double up = sqrt(ratio * (kk + mm + 1) * (kk + mm)) * (m == 1 ? sqrt(0.5) : 0.5);
                t->xv -= up * c[0];
                t->xw -= up * c[1];
                t->yv += up * c[1];
                t->yw -= up * c[0];
            }
            if (k >= 2 && m + 1 <= k && m + 1 <= order) {
                const double *c = cs[bst_gravity_index(k, m + 1)];
                double down =
                    0.5 * sqrt(ratio * (kk - mm + 1) * (kk - mm)) * (m == 0 ? sqrt(2.0) : 1.0);
                t->xv += down * c[0];
                t->xw += down * c[1];
                t->yv += down * c[1];
                t->yw -= down * c[0];
            }
            if (k >= 2 && m <= k && m <= order) {
                const double *c = cs[bst_gravity_index(k, m)];
                double along = sqrt(ratio * (kk + mm + 1) * (kk - mm + 1));
                t->zv -= along * c[0];
                t->zw -= along * c[1];
            }
            if (n >= 2 && n <= degree && m <= order) {
                t->uv = cs[bst_gravity_index(n, m)][0];
                t->uw = cs[bst_gravity_index(n, m)][1];
            }
        }
    }
    *out = g;
    return BST_OK;
}

bst_status bst_gravity_point(bst_ctx *ctx, double gm_m3ps2, bst_gravity **out) {
    return bst_gravity_make(ctx, gm_m3ps2, 1.0, 0, 0, NULL, out);
}

bst_status bst_gravity_builtin(bst_ctx *ctx, int degree, int order, bst_gravity **out) {
    *out = NULL;
    if (degree < 0 || degree > BST_GRAVITY_BUILTIN_DEGREE || order < 0 || order > degree) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "built-in gravity field of degree %d, order %d (allowed: degree 0 to %d, "
                        "order 0 to the degree)",
                        degree, order, BST_GRAVITY_BUILTIN_DEGREE);
    }
    return bst_gravity_make(ctx, bst_gravity_table_gm_m3ps2, bst_gravity_table_radius_m, degree,
                            order, bst_gravity_table, out);
}

void bst_gravity_free(bst_gravity *gravity) {
    if (gravity) {
        free(gravity->diagonal);
        free(gravity->terms);
        free(gravity);
    }
}

double bst_gravity_gm(const bst_gravity *gravity) {
    return gravity->gm;
}
int bst_gravity_degree(const bst_gravity *gravity) {
    return gravity->degree;
}
int bst_gravity_order(const bst_gravity *gravity) {
    return gravity->order;
}

/* Evaluates all harmonics: the disturbing acceleration over gm / radius^2 into *a, or (a NULL) the
 * disturbing potential over gm / radius as result. */
static inline double walk(const bst_gravity *g, bst_vec3 p, double r2, bst_vec3 *a) {
    double to_unit = g->radius / r2, u = 0.0;
    double x = p.x * to_unit, y = p.y * to_unit, z = p.z * to_unit, rho = g->radius * to_unit;
    double v_diagonal = g->radius / sqrt(r2), w_diagonal = 0.0;
    const term *t = g->terms;
    for (int m = 0; m <= g->order + 1; m++) {
        if (m > 0) {
            double v = g->diagonal[m] * (x * v_diagonal - y * w_diagonal);
            w_diagonal = g->diagonal[m] * (x * w_diagonal + y * v_diagonal);
            v_diagonal = v;
        }
        double v = v_diagonal, w = w_diagonal, v_last = 0.0, w_last = 0.0;
        for (int n = m; n <= g->degree + 1; n++, t++) {
            if (n > m) {
                double v_next = t->a * z * v - t->b * rho * v_last;
                double w_next = t->a * z * w - t->b * rho * w_last;
                v_last = v;
                w_last = w;
                v = v_next;
                w = w_next;
            }
            if (a) {
                a->x += t->xv * v + t->xw * w;
                a->y += t->yv * v + t->yw * w;
                a->z += t->zv * v + t->zw * w;
            } else {
                u += t->uv * v + t->uw * w;
            }
        }
    }
    return u;
}

bst_vec3 bst_gravity_acceleration(const bst_gravity *g, bst_vec3 p) {
    double r2 = bst_vec3_dot(p, p);
    bst_vec3 a = {0.0, 0.0, 0.0};
    if (g->terms) {
        (void)walk(g, p, r2, &a);
    }
    return bst_vec3_axpy(bst_vec3_scale(a, g->gm / (g->radius * g->radius)),
                         -g->gm / (r2 * sqrt(r2)), p);
}

double bst_gravity_potential(const bst_gravity *g, bst_vec3 p) {
    double r2 = bst_vec3_dot(p, p);
    double u = g->terms ? walk(g, p, r2, NULL) : 0.0;
    return g->gm / sqrt(r2) + g->gm / g->radius * u;
}

bst_vec3 bst_gravity_gradient_torque(const bst_mat3 *inertia_kgm2, bst_quat q_body_from_gcrf,
                                     bst_vec3 position_m) {
    double r2 = bst_vec3_dot(position_m, position_m);
    bst_vec3 r = bst_quat_rotate(q_body_from_gcrf, position_m);
    return bst_vec3_scale(bst_vec3_cross(r, bst_mat3_mul_vec(inertia_kgm2, r)),
                          3.0 * BST_EARTH_MU_M3PS2 / (r2 * r2 * sqrt(r2)));
}
