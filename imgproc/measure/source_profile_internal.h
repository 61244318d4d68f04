/* Declarations shared by source_profile.c and source_profile_psf.c. */
#ifndef BST_IMGPROC_MEASURE_SOURCE_PROFILE_INTERNAL_H
#define BST_IMGPROC_MEASURE_SOURCE_PROFILE_INTERNAL_H

#include <math.h>
#include <stdbool.h>

#include "imgproc/measure/source_profile.h"

enum { PARTS = 3 }; /* of a profile: share, slope, half the curvature */

/* Alignment of a profile about `centre` with pixels 0 to side - 1. */
typedef struct profile_alignment {
    int before, phase, first, end; /* first, end: range of non-zero pixels */
    float fraction;
} profile_alignment;

/* Aligns a profile with the pixels of a stamp; false if they do not overlap. */
static inline bool align_profile(const bst_source_profiles *t, double centre, int side,
                                 profile_alignment *out) {
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
