/* False alarms on the wings of bright sources. Internal to the generator. */
#ifndef BST_OBSGEN_MODEL_WING_ALARMS_H
#define BST_OBSGEN_MODEL_WING_ALARMS_H

#include "obsgen/generator.h"

/* Draws noise detections that the wings of bright sources lift above the threshold.
 *
 * Errors:    BST_ERR_MEMORY
 * Notes:     Image processing subtracts the background of the mesh, to which the wings contribute
 *            too; see bst_local_sky_add_wings. */
bst_status bst_wing_alarms_draw(bst_ctx *ctx, bst_generator *generator) BST_MUST_CHECK;

/* Noise of the pixels. */
typedef struct bst_wing_noise {
    double noise_e; /* of a dark pixel */
    double counted; /* share of its variance that is of counted electrons */
    double excess;  /* variance of shot noise per electron: bst_camera_excess_noise */
} bst_wing_noise;

/* Mean third power of what an electron becomes in a multiplication register, over its gain: of 1 +
 * p (e - 1), p^2 = excess - 1, e exponential.
 *
 * Given:     excess     bst_camera_excess_noise, 1 or more
 * Reference: Basden, Haniff & Mackay 2003, MNRAS 345, 985 */
double bst_wing_alarms_cube(double excess);

/* Noise with the second and third moments of counted, multiplied and normal electrons
 * (Cornish-Fisher): alarms are rare, and the threshold allows for the skewness.
 *
 * Given:     light  of the pixel, in noises of a dark pixel, like the result
 *            z      standard normal
 * Notes:     Multiplied electrons are a compound Poisson variable: its k-th cumulant is the mean
 *            number of electrons times the mean k-th power of what one becomes.
 * Reference: Basden, Haniff & Mackay 2003, MNRAS 345, 985 (law of the register) */
double bst_wing_alarms_noise(const bst_wing_noise *noise, double light, double z);

#endif
