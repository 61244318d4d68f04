/* Batch least-squares orbit determination from directions, with covariance. */
#ifndef BST_TRACKER_ORBIT_ORBIT_FIT_H
#define BST_TRACKER_ORBIT_ORBIT_FIT_H

#include "tracker/orbit/orbit_motion.h"

/* One measured direction of an object. */
typedef struct bst_od_observation {
    bst_od_observer observer; /* at mid exposure, when the light arrived */
    bst_vec3 direction;       /* unit, geometric: without aberration, light time included */
    /* covariance of its error, including the shared part below, in the tangent axes at the
     * direction (bst_tangent_at), rad^2 */
    double cov_11, cov_12, cov_22;
    /* Error part correlated between observations: along axis i, the sum of shared_rad[i][c] times
     * two numbers of mean 0 and variance 1. Their correlation with those of the previous
     * observation is exp(-shared_change); 0: the same for the whole arc. It is not fitted, but
     * increases the covariance. */
    double shared_rad[2][2], shared_change;
    double photocentre_factor; /* bst_od_photocentre_factor; 0: not known, taken for 1 */
    bst_vec3 sun; /* unit, from the Earth, GCRF; 0: not known, the photocentre is off any way */
} bst_od_observation;

typedef struct bst_od_options {
    bst_od_motion motion;
    /* an observation is rejected if its chi-square (2 degrees of freedom) exceeds this and 10 times
     * the median; 0: never */
    double reject_chi2;
    /* estimate one factor on the covariances from the residuals (see
     * bst_od_solution.variance_factor); false: they are taken as true */
    bool scale_variance;
    /* Standard deviation of the photocentre from the centre of mass along each axis of GCRF where
     * its factor is 1, m. It is not fitted, but increases the covariance; 0: none */
    double photocentre_m;
    /* share of chi-square below which a decrease that the linear model predicts ends the iteration;
     * 0: 1e-9. A start for another fit, or a comparison with a limit, needs no more than 1e-3 */
    double least_gain;
    int most_iterations; /* beyond which the fit counts as not convergent; 0: 60 */
    /* bst_od_determine: initial orbits, best first, that may fail before one converges; 0: all */
    int most_failures;
} bst_od_options;

typedef struct bst_od_solution {
    bst_od_state state;      /* at the time of an observation near the middle of the arc */
    double covariance[6][6]; /* GCRF, m and m/s, order r, v */
    double chi2;             /* of the used observations, with their stated covariances */
    int dof;                 /* 2 * used - 6 */
    /* Factor on the observations' covariances, included in `covariance`: the a-posteriori variance
     * of unit weight, (k + chi2) / (k + dof) with k = BST_OD_PRIOR_DOF; 1 without scale_variance.
     * Source: Koch, Parameter Estimation and Hypothesis Testing in Linear Models (1999), 4.3. */
    double variance_factor;
    int used, rejected;
    double rms_rad;                /* of the used residuals, per axis */
    double range_m, range_sigma_m; /* at state.time_s */
    double range_rate_sigma_mps;   /* likewise */
    /* nonlinearity: |rise of the sum of squares / 4 - 1| two standard deviations of range away.
     * Well below 1 the covariance is valid; above 1 errors may be larger than it states */
    double bend;
    int iterations;
} bst_od_solution;

enum {
    BST_OD_LEAST = 3, /* fewest observations */
    /* weight of the stated covariances: their variances are trusted to sqrt(2 / 20), a third */
    BST_OD_PRIOR_DOF = 20
};

/* Fits an orbit to directions, starting from a first state.
 *
 * Levenberg-Marquardt in coordinates that angles determine well, seen from the mid-arc observer:
 * direction and rate, logarithm of range, range rate over range. The valley of short arcs is
 * straight in them. Derivatives are central differences of the motion. The covariance is the
 * inverse normal matrix, transformed to GCRF; shared errors and the photocentre's displacement are
 * consider parameters.
 *
 * Given:     observations   in order of time (equal times allowed)
 * Returned:  residual_chi2  [count] chi-square of each observation, rejected ones included; may be
 *                           NULL
 * Errors:    BST_ERR_ARGUMENT for fewer than BST_OD_LEAST observations, descending times,
 *            covariances that are not positive definite; BST_ERR_NUMERIC, with reason and remedy,
 *            for no convergence, a singular geometry, or an orbit that leaves the Earth's vicinity
 * Reference: Montenbruck and Gill, Satellite Orbits, section 8.1; Marquardt, J. SIAM 11 (1963) 431;
 * Milani et al., Icarus 195 (2008) 474, for the coordinates */
bst_status bst_od_fit(bst_ctx *ctx, const bst_od_observation *observations, int count,
                      const bst_od_options *options, const bst_od_state *first,
                      double *residual_chi2, bst_od_solution *out) BST_MUST_CHECK;

#endif
