#include "sim/astro/radau.h"

#include <stdbool.h>
#include <string.h>

enum { TERMS = BST_RADAU_TERMS, MOST_ITERATIONS = 12 };

/* zeros of (P7 + P8) / (1 + x), P: Legendre polynomials, scaled to [0, 1] */
const double bst_radau_node[TERMS + 1] = {0.0,
                                          0.05626256053692214647,
                                          0.18024069173689236499,
                                          0.35262471711316963737,
                                          0.54715362633055538300,
                                          0.73421017721541053152,
                                          0.88532094683909576809,
                                          0.97752061356128750189};

void bst_radau_init(bst_radau *radau) {
    memset(radau, 0, sizeof *radau);
    /* Newton's basis s (s - h1) ... (s - hk) over s, row k its coefficients */
    double basis[TERMS][TERMS] = {{1.0}};
    for (int k = 1; k < TERMS; k++) {
        for (int j = 0; j < TERMS; j++) {
            basis[k][j] = (j > 0 ? basis[k - 1][j - 1] : 0.0) - bst_radau_node[k] * basis[k - 1][j];
        }
    }
    /* s^k in that basis, by s N_j = N_(j+1) + h_(j+1) N_j */
    double power[TERMS][TERMS] = {{1.0}};
    for (int k = 1; k < TERMS; k++) {
        for (int j = 0; j < TERMS; j++) {
            power[k][j] =
                (j > 0 ? power[k - 1][j - 1] : 0.0) + bst_radau_node[j + 1] * power[k - 1][j];
        }
    }
    for (int j = 0; j < TERMS; j++) {
        for (int k = 0; k < TERMS; k++) {
            radau->power_from_newton[j][k] = basis[k][j];
            radau->newton_from_power[j][k] = power[k][j];
        }
    }
}

/* Increments of position and velocity since the step's start. */
static void increments(const bst_radau_step *step, double s, bst_vec3 *dr, bst_vec3 *dv) {
    bst_vec3 r = {0.0, 0.0, 0.0}, v = {0.0, 0.0, 0.0};
    for (int k = TERMS - 1; k >= 0; k--) {
        r = bst_vec3_scale(bst_vec3_axpy(r, 1.0 / ((k + 2.0) * (k + 3.0)), step->b[k]), s);
        v = bst_vec3_scale(bst_vec3_axpy(v, 1.0 / (k + 2.0), step->b[k]), s);
    }
    double t = s * step->h_s;
    r = bst_vec3_axpy(r, 0.5, step->acceleration_mps2);
    v = bst_vec3_add(v, step->acceleration_mps2);
    *dr = bst_vec3_scale(bst_vec3_axpy(step->velocity_mps, t, r), t);
    *dv = bst_vec3_scale(v, t);
}

void bst_radau_state(const bst_radau_step *step, double s, bst_vec3 *position_m,
                     bst_vec3 *velocity_mps) {
    bst_vec3 dr, dv;
    increments(step, s, &dr, &dv);
    if (position_m) {
        *position_m = bst_vec3_add(step->position_m, bst_vec3_add(step->position_low_m, dr));
    }
    if (velocity_mps) {
        *velocity_mps = bst_vec3_add(step->velocity_mps, bst_vec3_add(step->velocity_low_mps, dv));
    }
}

/* Predicts the polynomial of this step from that of the last step, corrected by its last prediction
 * error (equations 13 and 14). False: no last step, or far outside of it. */
static bool predict(const bst_radau_point *from, double h, bst_vec3 b[TERMS]) {
    double q = from->h_s != 0.0 ? h / from->h_s : 0.0;
    if (!(q > 0.0 && q < 8.0)) {
        memset(b, 0, TERMS * sizeof *b);
        return false;
    }
    double q_power = 1.0;
    for (int k = 0; k < TERMS; k++) {
        bst_vec3 sum = {0.0, 0.0, 0.0};
        double binomial = 1.0; /* (j + 1) over (k + 1) */
        for (int j = k; j < TERMS; j++) {
            sum = bst_vec3_axpy(sum, binomial, from->b[j]);
            binomial *= (j + 2.0) / (j - k + 1.0);
        }
        q_power *= q;
        b[k] = bst_vec3_scale(sum, q_power);
    }
    return true;
}

static double largest(double a, double b) {
    return a > b ? a : b; /* loses a NaN in b, keeps one in a: callers check for NaN */
}

bst_status bst_radau_try(const bst_radau *radau, const bst_radau_point *from, double h,
                         bst_radau_force force, void *user, bst_radau_step *step, double *error) {
    *error = INFINITY;
    step->h_s = h;
    step->position_m = from->position_m;
    step->velocity_mps = from->velocity_mps;
    step->position_low_m = from->position_low_m;
    step->velocity_low_mps = from->velocity_low_mps;
    BST_TRY(force(user, 0.0, from->position_m, from->velocity_mps, &step->acceleration_mps2));
    if (predict(from, h, step->b)) {
        for (int k = 0; k < TERMS; k++) { /* error of the last prediction */
            step->b[k] = bst_vec3_add(step->b[k], bst_vec3_sub(from->b[k], from->predicted[k]));
        }
    }
    bst_vec3 g[TERMS];
    for (int j = 0; j < TERMS; j++) {
        g[j] = (bst_vec3){0.0, 0.0, 0.0};
        for (int k = j; k < TERMS; k++) {
            g[j] = bst_vec3_axpy(g[j], radau->newton_from_power[j][k], step->b[k]);
        }
    }
    double last_change = INFINITY, size = bst_vec3_norm(step->acceleration_mps2);
    bool converged = false;
    for (int iteration = 0; iteration < MOST_ITERATIONS && !converged; iteration++) {
        double change = 0.0;
        for (int n = 0; n < TERMS; n++) {
            double s = bst_radau_node[n + 1];
            bst_vec3 r, v, a;
            bst_radau_state(step, s, &r, &v);
            BST_TRY(force(user, s * h, r, v, &a));
            size = largest(size, bst_vec3_norm(a));
            /* the next divided difference of (a(s) - a(0)) / s */
            bst_vec3 d = bst_vec3_scale(bst_vec3_sub(a, step->acceleration_mps2), 1.0 / s);
            for (int k = 0; k < n; k++) {
                d = bst_vec3_scale(bst_vec3_sub(d, g[k]), 1.0 / (s - bst_radau_node[k + 1]));
            }
            bst_vec3 by = bst_vec3_sub(d, g[n]);
            g[n] = d;
            for (int j = 0; j <= n; j++) {
                step->b[j] = bst_vec3_axpy(step->b[j], radau->power_from_newton[j][n], by);
            }
            change = bst_vec3_norm(by); /* of b6 at the last node */
        }
        change /= size;
        if (!(change < INFINITY)) {
            return BST_OK;
        }
        /* converged, or at rounding level */
        converged = change < 1e-16 || (change < 1e-11 && change >= last_change);
        last_change = change;
    }
    if (converged) {
        *error = bst_vec3_norm(step->b[TERMS - 1]) / size;
    }
    return BST_OK;
}

/* Adds to a compensated sum; *low holds its rounding errors (Neumaier's form of Kahan's sum). */
static void add(double *sum, double *low, double term) {
    double s = *sum + term;
    *low += fabs(*sum) >= fabs(term) ? (*sum - s) + term : (term - s) + *sum;
    *sum = s;
}

/* Adds a vector with compensated summation. */
static void add_vec(bst_vec3 *sum, bst_vec3 *low, bst_vec3 term) {
    add(&sum->x, &low->x, term.x);
    add(&sum->y, &low->y, term.y);
    add(&sum->z, &low->z, term.z);
}

/* Merges the accumulated rounding errors *low into the sum. */
static void settle(bst_vec3 *sum, bst_vec3 *low) {
    bst_vec3 gathered = *low;
    *low = (bst_vec3){0.0, 0.0, 0.0};
    add_vec(sum, low, gathered);
}

/* Rounding error of the product h v. */
static bst_vec3 product_error(double h, bst_vec3 v, bst_vec3 product) {
    return (bst_vec3){fma(h, v.x, -product.x), fma(h, v.y, -product.y), fma(h, v.z, -product.z)};
}

void bst_radau_advance(bst_radau_point *p, const bst_radau_step *step) {
    double h = step->h_s;
    bst_vec3 r = {0.0, 0.0, 0.0}, v = {0.0, 0.0, 0.0};
    for (int k = TERMS - 1; k >= 0; k--) {
        r = bst_vec3_axpy(r, 1.0 / ((k + 2.0) * (k + 3.0)), step->b[k]);
        v = bst_vec3_axpy(v, 1.0 / (k + 2.0), step->b[k]);
    }
    bst_vec3 drift = bst_vec3_scale(p->velocity_mps, h);
    bst_vec3 drift_low =
        bst_vec3_axpy(product_error(h, p->velocity_mps, drift), h, p->velocity_low_mps);
    add_vec(&p->position_m, &p->position_low_m, drift);
    add_vec(&p->position_m, &p->position_low_m,
            bst_vec3_scale(step->acceleration_mps2, 0.5 * h * h));
    add_vec(&p->position_m, &p->position_low_m, bst_vec3_scale(r, h * h));
    p->position_low_m = bst_vec3_add(p->position_low_m, drift_low);
    settle(&p->position_m, &p->position_low_m);
    add_vec(&p->velocity_mps, &p->velocity_low_mps, bst_vec3_scale(step->acceleration_mps2, h));
    add_vec(&p->velocity_mps, &p->velocity_low_mps, bst_vec3_scale(v, h));
    settle(&p->velocity_mps, &p->velocity_low_mps);
    /* predicted polynomial of this step, for the next prediction */
    bst_vec3 predicted[TERMS];
    bool known = predict(p, h, predicted);
    memcpy(p->predicted, known ? predicted : step->b, sizeof p->predicted);
    memcpy(p->b, step->b, sizeof p->b);
    p->h_s = h;
}
