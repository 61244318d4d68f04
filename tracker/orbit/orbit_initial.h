/* First orbits from directions alone. */
#ifndef BST_TRACKER_ORBIT_ORBIT_INITIAL_H
#define BST_TRACKER_ORBIT_ORBIT_INITIAL_H

#include "sim/astro/lambert.h"
#include "tracker/orbit/orbit_fit.h"

typedef enum bst_od_method {
    BST_OD_GAUSS,      /* three directions, refined by Gooding's iteration */
    BST_OD_ADMISSIBLE, /* direction, rate, and a search over range and range rate */
    BST_OD_LAMBERT     /* a search over the ranges of the first and the last direction */
} bst_od_method;
/* "gauss", "admissible_region", "two_point". */
const char *bst_od_method_name(bst_od_method method);

typedef struct bst_od_candidate {
    bst_od_state state;
    bst_od_method method;
    double rms_rad; /* of two-body motion over a sample of the observations, per axis */
} bst_od_candidate;

enum { BST_OD_CANDIDATES = 12 };

/* Refines the ranges at the first and last of three observations so that two-body motion passes
 * through all three directions, light time included: Newton's iteration of Lambert's problem on the
 * miss of the middle direction (Gooding, Celest. Mech. Dyn. Astr. 66 (1997) 387). `position_m` and
 * `velocity_mps` are at the middle observation's time. BST_ERR_NUMERIC without convergence. */
bst_status bst_od_gooding(bst_ctx *ctx, const bst_od_observation observations[3],
                          bst_lambert_way way, double range_1_m, double range_3_m,
                          bst_od_state *out) BST_MUST_CHECK;

/* Bound two-body orbits that come near the observations (two or more, in order of time), by rising
 * rms: Gauss's method for several triples with all its roots, refined; the admissible region of
 * range and range rate (Milani et al., Celest. Mech. Dyn. Astr. 90 (2004) 59) about the direction
 * and rate in the middle of the arc; and Lambert's problem over a grid of the ranges at both ends,
 * with whole revolutions where the arc is long. *count is 1 to BST_OD_CANDIDATES. Made for arcs of
 * up to some revolutions. BST_ERR_ARGUMENT for fewer than BST_OD_LEAST observations or less than
 * three different times; BST_ERR_NUMERIC when no bound orbit comes near. */
bst_status bst_od_initial(bst_ctx *ctx, const bst_od_observation *observations, int count,
                          bst_od_candidate candidates[BST_OD_CANDIDATES],
                          int *found) BST_MUST_CHECK;

/* What bst_od_determine did. */
typedef struct bst_od_report {
    bst_od_method method; /* that the first orbit came from */
    int candidates;       /* first orbits that were tried */
    double other_chi2;    /* of the best orbit that is another one, on the first part of the arc;
                             INFINITY: there was none. Little above first_chi2: the arc allows
                             both */
    double first_chi2;    /* of the chosen one there */
} bst_od_report;

/* A first orbit, chosen by residuals among all candidates, then batch least squares over an arc
 * that grows to the whole of it (bst_od_fit with the options' motion). Hyperbolic orbits are
 * refused. `residual_chi2` as bst_od_fit; `report` may be NULL. Errors as bst_od_initial and
 * bst_od_fit. */
bst_status bst_od_determine(bst_ctx *ctx, const bst_od_observation *observations, int count,
                            const bst_od_options *options, double *residual_chi2,
                            bst_od_solution *out, bst_od_report *report) BST_MUST_CHECK;

#endif
