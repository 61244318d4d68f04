/* Initial orbit determination from directions only. */
#ifndef BST_TRACKER_ORBIT_ORBIT_INITIAL_H
#define BST_TRACKER_ORBIT_ORBIT_INITIAL_H

#include "sim/astro/lambert.h"
#include "tracker/orbit/orbit_fit.h"

typedef enum bst_od_method {
    BST_OD_GAUSS,      /* three directions, refined by Gooding's iteration */
    BST_OD_ADMISSIBLE, /* attributable, and search over range and range rate */
    BST_OD_LAMBERT     /* search over the ranges of the first and last direction */
} bst_od_method;
/* Name of a method: "gauss", "admissible_region", "two_point". */
const char *bst_od_method_name(bst_od_method method);

typedef struct bst_od_candidate {
    bst_od_state state;
    bst_od_method method;
    /* RMS residual of two-body motion over a sample of the observations, per axis */
    double rms_rad;
} bst_od_candidate;

enum { BST_OD_CANDIDATES = 12 };

/* Gooding's method: refines the ranges at the first and last of three observations until two-body
 * motion passes through all three directions, light time included. It is Newton's iteration of
 * Lambert's problem on the miss of the middle direction.
 *
 * Returned:  *out  state at the middle observation's time
 * Errors:    BST_ERR_NUMERIC without convergence
 * Reference: Gooding, Celest. Mech. Dyn. Astr. 66 (1997) 387 */
bst_status bst_od_gooding(bst_ctx *ctx, const bst_od_observation observations[3],
                          bst_lambert_way way, double range_1_m, double range_3_m,
                          bst_od_state *out) BST_MUST_CHECK;

/* Candidate bound two-body orbits near the observations (in order of time), by rising RMS residual.
 *
 * Three methods contribute. Gauss's method uses several triples with all roots, refined. The
 * admissible region of range and range rate is searched about the attributable at mid-arc.
 * Lambert's problem is solved over a grid of the ranges at both ends, with whole revolutions for
 * long arcs. It is designed for arcs of up to a few revolutions.
 *
 * Returned:  candidates, *found: 1 to BST_OD_CANDIDATES
 * Errors:    BST_ERR_ARGUMENT for fewer than BST_OD_LEAST observations or three different times;
 *            BST_ERR_NUMERIC if no bound orbit comes near
 * Reference: Milani et al., Celest. Mech. Dyn. Astr. 90 (2004) 59 */
bst_status bst_od_initial(bst_ctx *ctx, const bst_od_observation *observations, int count,
                          bst_od_candidate candidates[BST_OD_CANDIDATES],
                          int *found) BST_MUST_CHECK;

/* Report of bst_od_determine. */
typedef struct bst_od_report {
    bst_od_method method; /* of the chosen initial orbit */
    int candidates;       /* number of initial orbits tried */
    /* of the best other orbit on the first part of the arc; INFINITY: none. If it is little above
     * first_chi2, the arc permits both */
    double other_chi2;
    double first_chi2; /* of the chosen orbit on that part */
} bst_od_report;

/* Determines an orbit: an initial orbit chosen by residuals among all candidates, then batch least
 * squares (bst_od_fit with the options' motion) over an arc that grows to the whole. Hyperbolic
 * orbits are rejected.
 *
 * Returned:  residual_chi2  as bst_od_fit
 *            report         may be NULL
 * Errors:    as bst_od_initial and bst_od_fit */
bst_status bst_od_determine(bst_ctx *ctx, const bst_od_observation *observations, int count,
                            const bst_od_options *options, double *residual_chi2,
                            bst_od_solution *out, bst_od_report *report) BST_MUST_CHECK;

#endif
