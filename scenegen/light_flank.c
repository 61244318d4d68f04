#include "scenegen/light_flank.h"

#include <assert.h>
#include <math.h>

/* Light of a step over the dark variance: octaves of equal steps, so that frexp finds them. */
static double light_of(int step) {
    _Static_assert(BST_FLANK_FIRST + BST_FLANK_OCTAVES < 63, "octaves are parts of 2^62");
    const double least = 1.0 / (double)(1LL << -BST_FLANK_FIRST);
    double octave = least * (double)(1LL << step / BST_FLANK_PARTS);
    return octave * (1.0 + (double)(step % BST_FLANK_PARTS) / BST_FLANK_PARTS);
}

void bst_flank_curve_make(const bst_light_flank *flank, bst_flank_curve *out) {
    for (int n = 0; n < BST_FLANK_STEPS; n++) {
        double worst = 0.0, peak = light_of(n), light = peak;
        for (int k = 0; k < BST_LIGHT_CLASSES; k++) {
            bool last = k + 1 == BST_LIGHT_CLASSES;
            double less = last ? 0.0 : 0.5 * light;
            double dim = flank->error[k] / sqrt(less + 1.0);
            double lit = last ? INFINITY : flank->noisy[k] / sqrt(peak + peak / light);
            worst = fmax(worst, fmin(dim, lit));
            light = less;
        }
        out->at[n] = (float)(worst * sqrt(peak + 1.0));
    }
}

void bst_flank_curve_raise(bst_flank_curve *curve, const bst_flank_curve *other) {
    for (int n = 0; n < BST_FLANK_STEPS; n++) {
        curve->at[n] = other->at[n] > curve->at[n] ? other->at[n] : curve->at[n];
    }
}

bst_flank_place bst_flank_place_of(double light) {
    int exponent;
    assert(light >= 0.0);
    double part = 2.0 * frexp(light, &exponent) - 1.0; /* light = 2^(exponent - 1) (1 + part) */
    double at = BST_FLANK_PARTS * (exponent - 1 - BST_FLANK_FIRST + part);
    if (!(at > 0.0) || light == 0.0) {
        return (bst_flank_place){0, 1.0};
    }
    /* the error grows with the light, at most as sqrt(light + 1), in each term of
     * bst_flank_curve_make */
    int n = at < BST_FLANK_STEPS - 1 ? (int)at : BST_FLANK_STEPS - 1;
    return (bst_flank_place){n, sqrt((light + 1.0) / (light_of(n) + 1.0))};
}

double bst_flank_curve_at(const bst_flank_curve *curve, double light) {
    return bst_flank_curve_value(curve, bst_flank_place_of(light));
}
