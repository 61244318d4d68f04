/* Noise that neighbouring pixels share: what the variance of single pixels lacks. */
#ifndef BST_ANALYSIS_CHARACTERIZE_NEIGHBOUR_COVARIANCE_H
#define BST_ANALYSIS_CHARACTERIZE_NEIGHBOUR_COVARIANCE_H

#include "sim/analysis/characterize/clipped_moments.h"

/* Neighbours up to two columns and rows away, each pair of pixels once. */
enum { BST_NEIGHBOURS = 12 };

/* Covariance between two frames. */
typedef struct bst_neighbour_covariance {
    double covariance[BST_NEIGHBOURS]; /* DN^2 */
    double count;                      /* pixels of the pairs; 0: unknown */
} bst_neighbour_covariance;

/* Sums over exposures of what light adds. */
typedef struct bst_shared_noise {
    double covariance[BST_NEIGHBOURS], error2[BST_NEIGHBOURS]; /* with its squared standard error */
    double excess;                                             /* variance of pixels */
} bst_shared_noise;

/* Adds a pair of frames.
 *
 * Given:     difference   [height][width] of two frames without the means of its rows; NAN: left
 *                         out
 * Notes:     The covariance is half of that of the difference, freed of what the removal of a
 *            row's mean makes of white noise. Weighted by the number of pixels. */
void bst_neighbour_covariance_add(bst_neighbour_covariance *c, const float *difference, int width,
                                  int height);

/* Covariance of pixels of a column, DN^2.
 *
 * Given:     rows  1 or 2 apart */
double bst_neighbour_covariance_along(const bst_neighbour_covariance *c, int rows);

/* Adds what light adds to the noise of one exposure.
 *
 * Given:     weight                        of the exposure
 *            light, dark                   of frames with and without light
 *            light_variance, dark_variance of a pixel, DN^2 */
void bst_shared_noise_add(bst_shared_noise *sum, double weight,
                          const bst_neighbour_covariance *light, double light_variance,
                          const bst_neighbour_covariance *dark, double dark_variance);

/* Variance of the charge over that of single pixels: 1 where no neighbour shares noise for certain.
 *
 * Notes:     Coupling, the brighter-fatter effect and deferred charge take noise out of the pixels
 *            and into the covariance of neighbours; the sum of both keeps the charge's Poisson law
 *            but for what neighbours further away share. Reference: Astier et al. 2019, A&A 629,
 *            A36 */
bst_sensor_estimate bst_shared_noise_factor(const bst_shared_noise *sum);

#endif
