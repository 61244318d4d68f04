/* Probability that chance alone matches stars: the null model of star identification. */
#ifndef BST_IMGPROC_IDENTIFY_NULL_MODEL_H
#define BST_IMGPROC_IDENTIFY_NULL_MODEL_H

/* Probability that `matched` or more of `predicted` stars have a detection nearby by chance: the
 * upper tail of the binomial distribution.
 *
 * Given:     predicted, matched  numbers of stars
 *            chance              probability that a place holds a detection, 0 to 1
 * Returned:  0 to 1; natural logarithm, -INFINITY for a chance of 0 */
double bst_null_model_log_tail(int predicted, int matched, double chance);

/* Probability that a random place in a field of area_px2 lies within the tolerance of a detection,
 * if the detections are spread evenly.
 *
 * Given:     tolerances_px2  sum of the areas about the detections */
double bst_null_model_chance(double tolerances_px2, double area_px2);

#endif
