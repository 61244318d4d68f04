/* Lambert's problem: the two-body orbit between two positions in a given time. */
#ifndef BST_ASTRO_LAMBERT_H
#define BST_ASTRO_LAMBERT_H

#include <stdbool.h>

#include "boresight/status.h"
#include "boresight/vec.h"

typedef struct bst_lambert_way {
    bool long_way;    /* transfer angle above 180 degrees */
    int revolutions;  /* additional whole revolutions, 0 or more */
    bool high_energy; /* with revolutions: of two orbits, the one with the larger semi-major axis */
} bst_lambert_way;

/* Velocities (m/s) at r1 and r2 (m, from the centre) of the orbit that takes `seconds` > 0 between
 * them about a centre of gravitational parameter mu (m^3/s^2). BST_ERR_ARGUMENT for positions or
 * times that are not finite or not above 0; BST_ERR_NUMERIC if the plane is undefined (positions
 * collinear with the centre), if that many revolutions take longer, or without convergence. Izzo,
 * Revisiting Lambert's problem, Celest. Mech. Dyn. Astr. 121 (2015) 1, with times of flight by
 * Lancaster and Blanchard (NASA TN D-5368), Lagrange and Battin. */
bst_status bst_lambert(bst_ctx *ctx, double mu, bst_vec3 r1_m, bst_vec3 r2_m, double seconds,
                       bst_lambert_way way, bst_vec3 *v1_mps, bst_vec3 *v2_mps) BST_MUST_CHECK;

#endif
