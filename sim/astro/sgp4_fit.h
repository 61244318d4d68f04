/* Fits SGP4 mean elements to a given orbit. */
#ifndef BST_ASTRO_SGP4_FIT_H
#define BST_ASTRO_SGP4_FIT_H

#include "boresight/vec.h"
#include "sim/astro/sgp4.h"

/* A position on the orbit, TEME of date, m, at minutes after the epoch of the elements. */
typedef struct bst_sgp4_place {
    double minutes;
    bst_vec3 position_teme_m;
} bst_sgp4_place;

/* Fits the six mean elements of `elements` by least squares, so that SGP4 (WGS-72, improved mode)
 * follows `count` (at least 6) positions; the caller sets epoch, names and bstar.
 * `position_teme_m`, `velocity_teme_mps`: state at the epoch, the initial value. Mean motion,
 * eccentricity vector, inclination vector and mean longitude are varied: regular for circular and
 * equatorial orbits. *rms_m: of the residual distances. BST_ERR_NUMERIC when the state is on no
 * ellipse or within 0.1 degree of 180 degrees of inclination, or without convergence;
 * BST_ERR_ARGUMENT for too few positions. Vallado and Crawford, SGP4 orbit determination, AIAA
 * 2008-6770. */
bst_status bst_sgp4_fit(bst_ctx *ctx, const bst_sgp4_place *places, int count,
                        bst_vec3 position_teme_m, bst_vec3 velocity_teme_mps,
                        bst_elements *elements, double *rms_m) BST_MUST_CHECK;

/* Computes the six mean elements of the SGP4 orbit (WGS-72, improved mode) through
 * `position_teme_m` with velocity `velocity_teme_mps` at the epoch; the caller sets epoch, names
 * and bstar of `elements`. The velocity is the derivative of SGP4's positions; SGP4's own velocity
 * differs (by 0.1 m/s in deep space). To 1 mm, and 1 mm per orbit. Newton's iteration.
 * BST_ERR_NUMERIC when the state is on no ellipse or within 0.1 degree of 180 degrees of
 * inclination, SGP4 has no orbit there, or without convergence. */
bst_status bst_sgp4_through(bst_ctx *ctx, bst_vec3 position_teme_m, bst_vec3 velocity_teme_mps,
                            bst_elements *elements) BST_MUST_CHECK;

/* Sets the six mean elements of `out` from regular ones: mean motion (rad/min), e cos and e sin of
 * the longitude of perigee, tan(i/2) cos and sin of the node, mean longitude (rad). False: not an
 * ellipse; `out` is then as before. */
bool bst_sgp4_regular_elements(const double x[6], bst_elements *out);

/* Position (m) and its derivative (m/s) at minutes after the epoch, TEME of date, by differences of
 * SGP4 positions over +- 8 s. False: no SGP4 state. */
bool bst_sgp4_motion(const bst_sgp4 *sgp4, double minutes, bst_vec3 *position_teme_m,
                     bst_vec3 *velocity_teme_mps);

/* Osculating elements of a state (m, m/s; any axes) about a centre with gravitational parameter mu
 * (m^3/s^2). Circular orbits: perigee at the node; equatorial orbits: node at +x. */
typedef struct bst_astro_kepler_elements {
    double semi_major_axis_m; /* negative: hyperbola */
    double eccentricity;
    double inclination_rad, raan_rad, arg_perigee_rad;
    double mean_anomaly_rad; /* of a hyperbola the hyperbolic one */
} bst_astro_kepler_elements;

/* Osculating Kepler elements of a state.
 *
 * Given:     mu                        gravitational parameter, m^3/s^2
 *            position_m, velocity_mps  state in an inertial frame, m and m/s
 * Notes:     for inclination 0 the node is +x; for eccentricity 0 the argument of perigee is 0. A
 *            negative semi-major axis is a hyperbola. */
bst_astro_kepler_elements bst_astro_kepler_elements_of(double mu, bst_vec3 position_m,
                                                       bst_vec3 velocity_mps);

#endif
