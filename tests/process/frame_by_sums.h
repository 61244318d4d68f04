/* A frame of stars along a path, summed over all nodes and pixels in double precision. */
#ifndef BST_TESTS_PROCESS_FRAME_BY_SUMS_H
#define BST_TESTS_PROCESS_FRAME_BY_SUMS_H

#include "sim/process/twin/twin_model.h"

enum { BST_TEST_NX = 45, BST_TEST_NY = 38, BST_TEST_PIXELS = BST_TEST_NX * BST_TEST_NY };

/* Model of BST_TEST_NX x BST_TEST_NY px with a camera that is turned, distorted and off centre, a
 * bent path of about 8 px, and stars; no data.
 *
 * Given:     stars, count  their memory; the places are spread over the frame */
bst_twin_model bst_test_twin_model(bst_twin_star *stars, int count);

/* Part of a Gaussian that falls on a pixel whose centre is from_px from its own, as it is drawn:
 * up to 4.5 standard deviations and half a pixel. */
double bst_test_gaussian_part(double sigma, double from_px);
/* Adds the light of one star, moved by (dx, dy), to pixels [BST_TEST_NY][BST_TEST_NX]. */
void bst_test_add_star(const bst_twin_model *m, const bst_twin_star *s, double dx, double dy,
                       double *pixels);
/* All stars with the background. */
void bst_test_frame(const bst_twin_model *m, double *pixels);

#endif
