/* One step of a 15th-order implicit integrator for motion under forces. */
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
    /* a polynomial's coefficients from its divided differences, and back */
    double power_from_newton[BST_RADAU_TERMS][BST_RADAU_TERMS];
    double newton_from_power[BST_RADAU_TERMS][BST_RADAU_TERMS];
} bst_radau;

/* Computes the tables of an integrator from its nodes; needed once, before the first step. */
void bst_radau_init(bst_radau *radau);

/* Motion inside of one step; h may be negative. */
typedef struct bst_radau_step {
    double h_s;
    bst_vec3 position_m, velocity_mps, acceleration_mps2; /* at s = 0 */
    bst_vec3 position_low_m, velocity_low_mps;            /* what their rounding left out */
    bst_vec3 b[BST_RADAU_TERMS];
} bst_radau_step;

/* Position and velocity at s (0: start, 1: end). Either may be NULL. */
void bst_radau_state(const bst_radau_step *step, double s, bst_vec3 *position_m,
                     bst_vec3 *velocity_mps);

/* Where an integration stands: all that its next step depends on. Zero but for position and
 * velocity at the start. */
typedef struct bst_radau_point {
    bst_vec3 position_m, velocity_mps;
    bst_vec3 position_low_m, velocity_low_mps; /* compensated sums (Kahan) */
    /* last step's polynomial and what it had been predicted to be; h_s 0: there was none */
    double h_s;
    bst_vec3 b[BST_RADAU_TERMS], predicted[BST_RADAU_TERMS];
} bst_radau_point;

/* The acceleration `offset_s` after the step's start. */
typedef bst_status (*bst_radau_force)(void *user, double offset_s, bst_vec3 position_m,
                                      bst_vec3 velocity_mps, bst_vec3 *acceleration_mps2);

/* Works a step of h_s out, from where the integration stands; *error is |b6| over the largest
 * acceleration (their equation 8), INFINITY when the iteration did not converge. */
bst_status bst_radau_try(const bst_radau *radau, const bst_radau_point *from, double h_s,
                         bst_radau_force force, void *user, bst_radau_step *step,
                         double *error) BST_MUST_CHECK;
/* Moves on to the step's end. */
void bst_radau_advance(bst_radau_point *point, const bst_radau_step *step);

/* The nodes, 0 first. */
extern const double bst_radau_node[BST_RADAU_TERMS + 1];

#endif
