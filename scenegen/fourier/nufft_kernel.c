#include "scenegen/fourier/nufft_kernel.h"

#include <math.h>

#include "boresight/vec.h"

enum { QUADRATURE = 40, TRIALS = 16 };

/* Less than a sum of BST_SPREAD_BINS doubles in one order is of that in another. */
static const double ROUNDING = 1.0 - 1e-13;

double bst_nufft_kernel_value(const bst_nufft_kernel *spread, double t) {
    double z = 2.0 * t / spread->taps, q = 1.0 - z * z;
    return q > 0.0 ? exp(spread->beta * (sqrt(q) - 1.0)) : 0.0;
}

/* Midpoint rule of the kernel's Fourier transform: with t = taps / 2 sin(a) it converges
 * exponentially in a, down to exp(-beta). */
typedef struct quadrature {
    double half;                              /* taps / 2, samples */
    double z[QUADRATURE], weight[QUADRATURE]; /* sin(a); phi cos(a) */
} quadrature;

static void make_quadrature(const bst_nufft_kernel *spread, quadrature *q) {
    q->half = 0.5 * spread->taps;
    for (int i = 0; i < QUADRATURE; i++) {
        double a = 0.5 * BST_PI * (i + 0.5) / QUADRATURE, c = cos(a);
        q->z[i] = sin(a);
        q->weight[i] = exp(spread->beta * (c - 1.0)) * c;
    }
}

static double transform(const quadrature *q, double nu) {
    double sum = 0.0;
    for (int i = 0; i < QUADRATURE; i++) {
        sum += q->weight[i] * cos(2.0 * BST_PI * nu * q->half * q->z[i]);
    }
    return sum * BST_PI * q->half / QUADRATURE;
}

double bst_nufft_kernel_transform(const bst_nufft_kernel *spread, double nu) {
    quadrature q;
    make_quadrature(spread, &q);
    return transform(&q, nu);
}

/* Error of a spreading kernel: leakage of the aliased bands into the PSF's frequencies. INFINITY
 * if it is `enough` or more. */
static double leak(const bst_nufft_kernel *spread, const bst_nufft_kernel_band *band,
                   double density, double enough) {
    quadrature q;
    double part[BST_SPREAD_BINS], seen = 0.0;
    make_quadrature(spread, &q);
    /* high frequencies leak most: they tell soonest that the sum is too large, whatever its order
     */
    for (int i = BST_SPREAD_BINS - 1; i >= 0 && seen * ROUNDING < enough; i--) {
        double nu = (i + 0.5) * band->step / density;
        part[i] = 0.0;
        if (!(band->weight[i] > 0.0)) {
            continue;
        }
        if (nu >= 0.5) { /* beyond the grid's band: lost */
            part[i] = band->weight[i];
        } else {
            double own = fabs(transform(&q, nu)), others = 0.0;
            for (int m = 1; m <= 2; m++) {
                others += fabs(transform(&q, nu - m)) + fabs(transform(&q, nu + m));
            }
            part[i] = band->weight[i] * fmin(others / own, 2.0);
        }
        seen += part[i];
    }
    if (!(seen * ROUNDING < enough)) {
        return INFINITY;
    }
    double sum = 0.0;
    for (int i = 0; i < BST_SPREAD_BINS; i++) {
        sum += part[i];
    }
    return sum < enough ? sum : INFINITY;
}

/* Beta of one of the TRIALS that are compared. */
static double trial_beta(int taps, int n) {
    return taps * (0.8 + 1.8 * n / (TRIALS - 1));
}

double bst_nufft_kernel_choose(bst_nufft_kernel *spread, const bst_nufft_kernel_band *band,
                               double density) {
    double best = INFINITY, beta = 0.0;
    for (int n = 0; n < TRIALS; n++) {
        spread->beta = trial_beta(spread->taps, n);
        double error = leak(spread, band, density, best);
        if (error < best) {
            best = error;
            beta = spread->beta;
        }
    }
    spread->beta = beta;
    return best;
}

bool bst_nufft_kernel_suffices(int taps, const bst_nufft_kernel_band *band, double density,
                               double tolerance) {
    /* the first error above the tolerance: `leak` stops there */
    double enough = nextafter(tolerance, INFINITY);
    for (int n = 0; n < TRIALS; n++) {
        bst_nufft_kernel spread = {.taps = taps, .beta = trial_beta(taps, n)};
        if (leak(&spread, band, density, enough) <= tolerance) {
            return true;
        }
    }
    return false;
}

/* Fourier transforms of phi(t) z^(2k) at nu, k = 0 to 2. */
static void transforms(const quadrature *q, double nu, double out[3]) {
    out[0] = out[1] = out[2] = 0.0;
    for (int i = 0; i < QUADRATURE; i++) {
        double z = q->z[i], v = q->weight[i] * cos(2.0 * BST_PI * nu * q->half * z);
        for (int k = 0; k < 3; k++, v *= z * z) {
            out[k] += v * BST_PI * q->half / QUADRATURE;
        }
    }
}

double bst_nufft_kernel_shape_value(const bst_nufft_kernel *spread,
                                    const bst_nufft_kernel_shape *shape, double t) {
    double z = 2.0 * t / spread->taps, q = z * z;
    return bst_nufft_kernel_value(spread, t) * (shape->c[0] + q * (shape->c[1] + q * shape->c[2]));
}

double bst_nufft_kernel_shape_transform(const bst_nufft_kernel *spread,
                                        const bst_nufft_kernel_shape *shape, double nu) {
    double t[3];
    quadrature q;
    make_quadrature(spread, &q);
    transforms(&q, nu, t);
    return (shape->c[0] * t[0] + shape->c[1] * t[1] + shape->c[2] * t[2]) / t[0];
}

double bst_nufft_kernel_widen(const bst_nufft_kernel *spread, const bst_nufft_kernel_band *band,
                              double density, double variance, bst_nufft_kernel_shape *out) {
    *out = (bst_nufft_kernel_shape){{1.0, 0.0, 0.0}};
    if (!(variance > 0.0)) {
        return 0.0;
    }
    /* Flux is conserved: c0 = 1 - (c1 T1(0) + c2 T2(0)) / T0(0). Two unknowns remain, with the
     * functions D_k(nu) = T_k(nu) - T_k(0) / T0(0) T0(nu). */
    double zero[3], normal[2][2] = {{0}}, right[2] = {0};
    quadrature q;
    make_quadrature(spread, &q);
    transforms(&q, 0.0, zero);
    double a[BST_SPREAD_BINS][2], aim[BST_SPREAD_BINS];
    for (int i = 0; i < BST_SPREAD_BINS; i++) {
        double nu = (i + 0.5) * band->step / density, own[3];
        transforms(&q, nu, own);
        aim[i] = exp(-2.0 * BST_PI * BST_PI * variance * nu * nu) - 1.0;
        for (int k = 0; k < 2; k++) {
            a[i][k] = (own[k + 1] - zero[k + 1] / zero[0] * own[0]) / own[0];
        }
        for (int k = 0; k < 2 && nu < 0.5; k++) {
            right[k] += band->weight[i] * a[i][k] * aim[i];
            normal[k][0] += band->weight[i] * a[i][k] * a[i][0];
            normal[k][1] += band->weight[i] * a[i][k] * a[i][1];
        }
    }
    double det = normal[0][0] * normal[1][1] - normal[0][1] * normal[1][0];
    double c1 = (right[0] * normal[1][1] - right[1] * normal[0][1]) / det;
    double c2 = (normal[0][0] * right[1] - normal[1][0] * right[0]) / det;
    *out = (bst_nufft_kernel_shape){{1.0 - (c1 * zero[1] + c2 * zero[2]) / zero[0], c1, c2}};
    double error = 0.0;
    for (int i = 0; i < BST_SPREAD_BINS; i++) {
        error += band->weight[i] * fabs(c1 * a[i][0] + c2 * a[i][1] - aim[i]);
    }
    return error;
}
