/* Gauss's method: initial orbit from three directions. */
#ifndef BST_ASTRO_GAUSS_ANGLES_H
#define BST_ASTRO_GAUSS_ANGLES_H

#include "boresight/status.h"
#include "boresight/vec.h"

enum { BST_GAUSS_ROOTS = 3 }; /* maximum number of positive roots of an equation with these signs */

/* A direction (unit) to the body from `observer_m` (relative to the centre of attraction). */
typedef struct bst_gauss_sight {
    double time_s;
    bst_vec3 direction;
    bst_vec3 observer_m;
} bst_gauss_sight;

typedef struct bst_gauss_orbit {
    double range_m[3];         /* from the observer, at the three times */
    bst_vec3 position_m[3];    /* from the centre, likewise */
    bst_vec3 velocity_mps;     /* at the second time */
    double geocentric_range_m; /* the root: distance from the centre at the second time */
} bst_gauss_orbit;

/* All positive real x with x^8 + a x^6 + b x^3 + c = 0, rising; returns how many (0 to
 * BST_GAUSS_ROOTS). Between the zeros of the slope, which are those of 8 x^5 + 6 a x^3 + 3 b, the
 * function is monotonous: each root is bracketed, none is missed but a double one. */
int bst_gauss_roots(double a, double b, double c, double roots[BST_GAUSS_ROOTS]);

/* Initial orbits by Gauss's method from three directions at increasing times, about a centre of
 * gravitational parameter mu (m^3/s^2): one for each positive root of its equation of 8th degree at
 * which all three ranges are positive. First order in mu/r^3, so accurate for arcs of up to about
 * 20 degrees; refine the ranges (tracker/orbit/orbit_initial.h). *count may be 0. The caller
 * corrects for light time and aberration. BST_ERR_ARGUMENT for times that do not increase or
 * non-finite numbers; BST_ERR_NUMERIC when the three directions lie in one plane (to 1e-9 of their
 * spread), as they do when the observer is in the body's orbital plane: then they do not determine
 * the ranges. Curtis, Orbital Mechanics for Engineering Students, algorithm 5.5; Escobal, Methods
 * of Orbit Determination, section 7.3; Vallado, Fundamentals of Astrodynamics and Applications,
 * section 7.3. */
bst_status bst_gauss_angles(bst_ctx *ctx, double mu, const bst_gauss_sight sights[3],
                            bst_gauss_orbit orbits[BST_GAUSS_ROOTS], int *count) BST_MUST_CHECK;

#endif
