/* SGP4 on vectors, as wide as the processor has them. */
#include <stdint.h>

#include "sim/astro/sgp4_lanes.h"

/* largest angle that sine, cosine and remainder are exact for: 2^20 quarter turns */
#define LARGEST_ANGLE 1.6e6
/* 1.5 * 2^52: added and subtracted it rounds to the nearest integer, which are the low bits of the
 * sum */
#define NEAREST 6755399441055744.0
#define KEPLER_STEPS BST_SGP4_KEPLER_STEPS
#define KEPLER_LONGEST_STEP BST_SGP4_KEPLER_LONGEST_STEP

#define BST_SIMD_KERNELS "sim/astro/sgp4_kernels.inc"
#include "sim/core/simd_each.inc"

void bst_sgp4_propagate_lanes(bst_sgp4_kind kind, bst_sgp4_lanes *lanes) {
    switch (kind) {
        case BST_SGP4_NEAR:
            BST_SIMD_PICK(run_near)(lanes);
            break;
        case BST_SGP4_DEEP:
            BST_SIMD_PICK(run_deep)(lanes);
            break;
        default:
            BST_SIMD_PICK(run_resonant)(lanes);
            break;
    }
}
