/* What source_profile.c and source_profile_psf.c share. */
#ifndef BST_IMGPROC_MEASURE_SOURCE_PROFILE_INTERNAL_H
#define BST_IMGPROC_MEASURE_SOURCE_PROFILE_INTERNAL_H

#include <math.h>
#include <stdbool.h>

#include "imgproc/measure/source_profile.h"

enum { PARTS = 3 }; /* of a profile: it, its slope and half its curvature */

/* Where a profile about `centre` comes to lie on pixels 0 to side - 1. */
typedef struct laid {
    int before, phase, first, end; /* first and end of the part that is not 0 */
    float fraction;
} laid;

/* Returns false when none of it lies there. */
static inline bool lay(const bst_source_profiles *t, double centre, int side, laid *out) {
    if (!(fabs(centre) < 1e6)) {
        return false;
    }
    double at = floor(centre + 0.5), u = (centre + 0.5 - at) * BST_PROFILE_PHASES;
    int phase = (int)u;
    out->phase = phase < BST_PROFILE_PHASES ? phase : BST_PROFILE_PHASES - 1;
    out->fraction = (float)(u - out->phase);
    out->before = (int)at - t->half;
    out->first = (int)at - t->reach;
    out->end = (int)at + t->reach + 1;
    if (out->first >= side || out->end <= 0) {
        return false;
    }
    out->first = out->first < 0 ? 0 : out->first;
    out->end = out->end < side ? out->end : side;
    return true;
}

#endif
