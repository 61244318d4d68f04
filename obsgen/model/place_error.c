#include "obsgen/model/place_error.h"

#include <assert.h>
#include <math.h>

const double bst_place_error_core[BST_OBSGEN_SNRS] = {0.939, 1.009, 1.007, 1.002, 1.0, 1.0};

/* Rounds of the iteration, and the part of each step that is taken: at SNR 5 the RMS error differs
 * by 0.3 % from that of 30 rounds. */
enum { ROUNDS = 8 };
static const double STEP = 0.8;
/* Farthest maximum, in the units of u, and least value there, of that without noise. */
static const double FARTHEST = 2.0, LEAST_VALUE = 0.3;

double bst_place_error_bend(double snr, double level, const double h[3], double error[2]) {
    assert(snr > 0.0 && level > 0.0 && h && error);
    double xx = sqrt(2.0) * h[0], yy = sqrt(2.0) * h[1], xy = h[2];
    double u = 0.0, v = 0.0, value = level;
    for (int round = 0; round < ROUNDS; round++) {
        double gx = xx * u + xy * v, gy = xy * u + yy * v;
        value = level + error[0] * u + error[1] * v + 0.5 * (gx * u + gy * v);
        value = fmax(value, LEAST_VALUE * level);
        u += STEP * ((error[0] + gx) / value - u);
        v += STEP * ((error[1] + gy) / value - v);
        double away = hypot(u, v), share = away > FARTHEST ? FARTHEST / away : 1.0;
        u *= share;
        v *= share;
    }
    error[0] = snr * u;
    error[1] = snr * v;
    return value * exp(-0.5 * (u * u + v * v));
}
