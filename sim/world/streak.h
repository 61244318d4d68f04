/* The image of a streak in closed form. Inside of sim/world. */
#ifndef BST_WORLD_STREAK_H
#define BST_WORLD_STREAK_H

/* Integral of the squared image (per px^2) of a unit source: a straight streak of length L, blurred
 * by a Gaussian of standard deviation `along` in its direction and `across` at right angles.
 * 1 / (4 pi along across) for L = 0; else (1 / (2 sqrt(pi) across)) times the line integral of the
 * autocorrelation of a uniform segment. */
double bst_streak_squared(double along, double across, double length);

#endif
