/* Model of the sensor's resolution: when two objects give one measurement, and what it measures
 * (Koch and van Keuk, IEEE Trans. AES 33, 1997). */
#ifndef BST_TRACKER_MTT_RESOLUTION_H
#define BST_TRACKER_MTT_RESOLUTION_H

#include "tracker/mtt/multitarget.h"

/* Probability that two predicted tracks are unresolved: the mean of exp(-d^2 / (2 s^2)) over their
 * separation d. s makes it 5 % at merge_rad. */
double bst_mtt_unresolved(double merge_rad, const bst_mtt_track *a, const bst_mtt_track *b);

/* Share of track a in the light of a and b. */
double bst_mtt_light_share(const bst_mtt_track *a, const bst_mtt_track *b);

/* Share of detection a in the light of both; 0.5 if a brightness is unknown. */
double bst_mtt_detection_share(const bst_mtt_detection *a, const bst_mtt_detection *b);

/* A merged measurement of two tracks. */
typedef struct bst_mtt_merged {
    double log_likelihood, chi2; /* rad^-2; 2 degrees of freedom */
    /* direction of each track that the measurement implies, given the other's prediction */
    bst_sky_measurement of_a, of_b;
} bst_mtt_merged;

/* Evaluates a detection as the centre of light of tracks a and b.
 *
 * Given:     floor_rad  1 sigma per axis added to the measurement
 * Returned:  false if a covariance is not positive definite */
bool bst_mtt_merge(const bst_mtt_track *a, const bst_mtt_track *b,
                   const bst_sky_measurement *measurement, double floor_rad, bst_mtt_merged *out);

/* Measurement of one object that may be merged with another one's. */
typedef struct bst_mtt_doubtful {
    bst_sky_measurement sky; /* mean and covariance of both hypotheses */
    double merged;           /* probability that it is merged */
} bst_mtt_doubtful;

/* Measurement of an object that gave detection `single` in one frame and `own` in another one, in
 * which an object next to it gave `companion`. In the frame of `single` the companion was missed,
 * or `single` is the centre of light of both.
 *
 * Given:     detection_probability  of a resolved object */
bst_mtt_doubtful bst_mtt_doubt_of_pair(double merge_rad, double detection_probability,
                                       const bst_mtt_detection *single,
                                       const bst_mtt_detection *own,
                                       const bst_mtt_detection *companion);

/* Measurement of track a by a detection of a alone, or of a and b together. Given that a exists, b
 * does with the ratio of their existence probabilities, at most 1. In the first case
 * b does not exist or is missed.
 *
 * Given:     params                 merge_rad and merge_floor_rad
 *            detection_probability  of b
 *            single_log_likelihood  of the detection, of a alone, with the brightness, rad^-2 */
bst_mtt_doubtful bst_mtt_doubt_of_track(const bst_mtt_params *params, const bst_mtt_track *a,
                                        const bst_mtt_track *b, const bst_mtt_detection *detection,
                                        double detection_probability, double single_log_likelihood);

/* Brightness term (-ln likelihood, at most 4.5) of a detection of the light of a and b together. */
double bst_mtt_merged_brightness_cost(const bst_mtt_track *a, const bst_mtt_track *b,
                                      const bst_mtt_detection *detection);

#endif
