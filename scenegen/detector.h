/* The detector stage of the renderer (kernels/detector.cl): how it is built for a camera. */
#ifndef BST_SCENEGEN_DETECTOR_H
#define BST_SCENEGEN_DETECTOR_H

#include <stddef.h>

#include "sim/world/camera.h"

/* Kernel options of the detector, each with a space before it, as snprintf would write them.
 *
 * Shot and read noise of a pixel come from one normal deviate by a Cornish-Fisher expansion where
 * that is as good as the exact law, from a deviate for each elsewhere. The rule keeps the
 * chi-square divergence between the drawn and the exact law (quantised to 1 e-) below 3e-9, so that
 * it takes more than 1e9 draws to tell them apart:
 *   read noise >= 5 e-   all means, expansion to 1/sigma^2
 *   read noise >= 3 e-   all means, to 1/sigma^3
 *   read noise >= 2 e-   all means, to 1/sigma^4
 *   read noise >= 0.75 e-   means from 30 e- on, to 1/sigma^4
 *   below   never: single electrons show */
int bst_detector_options(const bst_camera *camera, char *text, size_t bytes);

/* Means above this may fill the well: there the charge is drawn by itself, cut, and read. */
double bst_detector_near_full_e(double full_well_e);

#endif
