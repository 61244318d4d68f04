/* Power spectra of samples, for tests. */
#ifndef BST_TESTS_PERIODOGRAM_H
#define BST_TESTS_PERIODOGRAM_H

#include "boresight/vec.h"

/* Periodogram of x at f: one-sided density, Hann window. */
static inline double periodogram(const double *x, int count, double dt_s, double f) {
    double re = 0.0, im = 0.0, cr = 1.0, ci = 0.0;
    double tr = cos(2 * BST_PI * f * dt_s), ti = sin(2 * BST_PI * f * dt_s);
    double wr = 1.0, wi = 0.0, vr = cos(2 * BST_PI / count), vi = sin(2 * BST_PI / count);
    for (int n = 0; n < count; n++) {
        double w = 0.5 - 0.5 * wr;
        re += w * x[n] * cr;
        im += w * x[n] * ci;
        double t = cr * tr - ci * ti;
        ci = cr * ti + ci * tr;
        cr = t;
        t = wr * vr - wi * vi;
        wi = wr * vi + wi * vr;
        wr = t;
    }
    return 2.0 * dt_s * (re * re + im * im) / (0.375 * count);
}

#endif
