/* One step of a 15th-order implicit integrator for orbits. */
#ifndef BST_ASTRO_RADAU_H
#define BST_ASTRO_RADAU_H

#include "boresight/status.h"
#include "boresight/vec.h"

/* Everhart's implicit Gauss-Radau scheme (1985, in Dynamics of Comets, IAU Coll. 83, 185) in the
 * form of Rein and Spiegel (MNRAS 446, 2015, 1424; equation numbers below are theirs): inside of a
 * step of length h the acceleration is the polynomial a + b0 s + ... + b6 s^7, s in [0, 1] (their
 * equation 3), which agrees with the forces at eight Gauss-Radau nodes. Its integrals are position
 * and velocity everywhere in the step, so that dense output costs nothing. */
enum { BST_RADAU_TERMS = 7 };

/* Constants of the scheme. */
typedef struct bst_radau {
    /* conversion between polynomial coefficients and divided differences */
    double power_from_newton[BST_RADAU_TERMS][BST_RADAU_TERMS];
    double newton_from_power[BST_RADAU_TERMS][BST_RADAU_TERMS];
} bst_radau;

/* Computes the constants of the scheme; required once, before the first step. */
void bst_radau_init(bst_radau *radau);

/* Motion within one step; h may be negative. */
typedef struct bst_radau_step {
    double h_s;
    bst_vec3 position_m, velocity_mps, acceleration_mps2; /* at s = 0 */
    bst_vec3 position_low_m, velocity_low_mps;            /* compensation of rounding errors */
    bst_vec3 b[BST_RADAU_TERMS];
} bst_radau_step;

/* Position and velocity at s (0: start, 1: end). Either may be NULL. */
void bst_radau_state(const bst_radau_step *step, double s, bst_vec3 *position_m,
                     bst_vec3 *velocity_mps);

/* State of an integration, on which its next step depends. Zero except for position and velocity at
 * the start. */
typedef struct bst_radau_point {
    bst_vec3 position_m, velocity_mps;
    bst_vec3 position_low_m, velocity_low_mps; /* compensated sums (Kahan) */
    /* polynomial of the last step and its prediction; h_s 0: no last step */
    double h_s;
    bst_vec3 b[BST_RADAU_TERMS], predicted[BST_RADAU_TERMS];
} bst_radau_point;

/* Callback: acceleration at `offset_s` after the start of the step. */
typedef bst_status (*bst_radau_force)(void *user, double offset_s, bst_vec3 position_m,
                                      bst_vec3 velocity_mps, bst_vec3 *acceleration_mps2);

/* Computes a step of h_s. *error: |b6| over the largest acceleration (equation 8); INFINITY: the
 * iteration did not converge. */
bst_status bst_radau_try(const bst_radau *radau, const bst_radau_point *from, double h_s,
                         bst_radau_force force, void *user, bst_radau_step *step,
                         double *error) BST_MUST_CHECK;
/* Advances the state to the end of the step. */
void bst_radau_advance(bst_radau_point *point, const bst_radau_step *step);

/* nodes of the scheme, 0 first */
extern const double bst_radau_node[BST_RADAU_TERMS + 1];

#endif
