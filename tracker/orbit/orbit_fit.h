/* Batch least squares: the orbit that explains a list of directions best, with its covariance. */
#ifndef BST_TRACKER_ORBIT_ORBIT_FIT_H
#define BST_TRACKER_ORBIT_ORBIT_FIT_H

#include "tracker/orbit/orbit_motion.h"

/* One measured direction. */
typedef struct bst_od_observation {
    bst_od_observer observer; /* at mid exposure, when the light arrived */
    bst_vec3 direction;       /* unit, geometric: aberration removed, light time contained */
    /* of its error, the shared part below included, in the tangent axes at the direction
     * (bst_tangent_at), rad^2 */
    double cov_11, cov_12, cov_22;
    /* of what it has in common with the others: the error along axis i is the sum of
     * shared_rad[i][c] times two numbers of mean 0 and variance 1, whose correlation with those of
     * the observation before is exp(-shared_change); 0: the same for all of the arc. Not fitted,
     * but part of the covariance. */
    double shared_rad[2][2], shared_change;
} bst_od_observation;

typedef struct bst_od_options {
    bst_od_motion motion;
    double reject_chi2; /* an observation whose chi-square (2 degrees of freedom) is above this, and
                           above 10 times the median, is left out; 0: none */
    bool scale_variance; /* estimate one factor on the observations' covariances from the residuals
                            (see bst_od_solution.variance_factor); false: they are taken as true */
} bst_od_options;

typedef struct bst_od_solution {
    bst_od_state state;      /* at the time of an observation near the middle of the arc */
    double covariance[6][6]; /* GCRF, m and m/s, order r, v */
    double chi2;             /* of the observations used, for their covariances as stated */
    int dof;                 /* 2 * used - 6 */
    /* On the observations' covariances; `covariance` contains it. The a-posteriori variance of unit
     * weight, (k + chi2) / (k + dof) with k = BST_OD_PRIOR_DOF; 1 without scale_variance.
     * Source: Koch, Parameter Estimation and Hypothesis Testing in Linear Models (1999), 4.3. */
    double variance_factor;
    int used, rejected;
    double rms_rad;                /* of the residuals used, per axis */
    double range_m, range_sigma_m; /* at state.time_s */
    double range_rate_sigma_mps;   /* likewise */
    double bend; /* how far the problem is from linear two standard deviations of the range away:
                    the sum of squares' rise over 4, less 1, in size. Well below 1: the covariance
                    is true; above: errors may be larger than it says */
    int iterations;
} bst_od_solution;

enum {
    BST_OD_LEAST = 3,     /* observations that are needed */
    BST_OD_PRIOR_DOF = 20 /* weight of the covariances as stated: their variances are believed to
                             within sqrt(2 / 20), a third */
};

/* Fits from a first state. Observations in order of time (equal times allowed). Levenberg and
 * Marquardt's iteration in the coordinates that angles determine: direction and its rate, the
 * logarithm of range and range rate over range, seen from the observer in the middle of the arc;
 * the valley of short arcs is straight in them. Derivatives by central differences of the motion.
 * The covariance is the inverse of the normal matrix, turned to GCRF. `residual_chi2` (count
 * values, may be NULL) gets each observation's chi-square, of those left out as well.
 * Errors: BST_ERR_ARGUMENT for fewer than BST_OD_LEAST observations, times that fall, covariances
 * that are not positive definite; BST_ERR_NUMERIC, with the reason and what to do, for no
 * convergence, a singular geometry, or an orbit that leaves the Earth's surroundings.
 * Source: Montenbruck and Gill, Satellite Orbits, section 8.1; Marquardt, J. SIAM 11 (1963) 431;
 * Milani et al., Icarus 195 (2008) 474, for the coordinates. */
bst_status bst_od_fit(bst_ctx *ctx, const bst_od_observation *observations, int count,
                      const bst_od_options *options, const bst_od_state *first,
                      double *residual_chi2, bst_od_solution *out) BST_MUST_CHECK;

#endif
