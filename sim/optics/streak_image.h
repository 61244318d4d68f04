/* Image of a Gaussian source that moves along a line: streak. */
#ifndef BST_OPTICS_STREAK_IMAGE_H
#define BST_OPTICS_STREAK_IMAGE_H

/* Integral of the squared image (per px^2) of a unit source: a straight streak of length L, blurred
 * by a Gaussian of standard deviation `along` in its direction and `across` perpendicular to it. 1
 * / (4 pi along across) for L = 0; else (1 / (2 sqrt(pi) across)) times the line integral of the
 * autocorrelation of a uniform segment. */
double bst_optics_image_squared(double along, double across, double length);

#endif
