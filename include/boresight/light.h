/* Apparent directions: light deflection by the Sun and stellar aberration. */
#ifndef BORESIGHT_LIGHT_H
#define BORESIGHT_LIGHT_H

#include "boresight/vec.h"

#pragma GCC visibility push(default)

/* Observer's state for aberration and light deflection; ICRS axes. */
typedef struct bst_light {
    bst_vec3 velocity_mps; /* observer relative to the barycentre */
    bst_vec3 sun_m;        /* observer to the Sun's centre */
} bst_light;

/* Apparent direction of a star: the Sun's light deflection (as eraLdsun), then aberration (as
 * eraAb).
 *
 * Given:     icrs  catalogue direction, unit, ICRS axes
 * Returned:  apparent direction, unit, ICRS axes
 * Notes:     aberration includes special relativity and the Sun's potential. Parallax is not
 *            included.
 * Reference: Urban and Seidelmann, Explanatory Supplement, 3rd ed., sections 7.2.3 and 7.2.4;
 *            Klioner, AJ 125 (2003) 1580 */
bst_vec3 bst_light_apparent_star(const bst_light *light, bst_vec3 icrs);

/* Catalogue direction of a star from its apparent one; inverse of bst_light_apparent_star to 1e-12
 * rad.
 *
 * Given:     apparent  unit vector, ICRS axes
 * Returned:  catalogue direction, unit, ICRS axes */
bst_vec3 bst_light_catalogue_star(const bst_light *light, bst_vec3 apparent);

/* Apparent direction of an object in Earth-Moon space: aberration only, no light deflection.
 *
 * Given:     direction  geometric direction, unit, ICRS axes
 * Returned:  apparent direction, unit
 * Notes:     the velocity is barycentric. The geometric direction must therefore run, in the
 *            barycentric frame, from the observer at reception to the object at emission. With
 *            geocentric positions and light time tau it is r_object(t - tau) - r_observer(t) - tau
 *            * earth_bary_mps (see bst_light_path). */
bst_vec3 bst_light_aberrate(const bst_light *light, bst_vec3 direction);
/* Geometric direction from the apparent one; inverse of bst_light_aberrate to 1e-12 rad. */
bst_vec3 bst_light_unaberrate(const bst_light *light, bst_vec3 apparent); /* to 1e-12 rad */

/* Quantities of aberration that do not depend on the direction. */
typedef struct bst_light_aberration {
    bst_vec3 velocity;                      /* in units of the speed of light */
    double inverse_gamma, share, potential; /* share: 1 / (1 + inverse_gamma) */
} bst_light_aberration;

/* Computes the quantities of aberration by observer and Sun, once for many directions. */
bst_light_aberration bst_light_aberration_of(const bst_light *light);

/* bst_light_aberrate with the precomputed quantities of bst_light_aberration_of.
 *
 * Given:     direction  geometric direction, unit, ICRS axes
 * Returned:  apparent direction, unit */
static inline bst_vec3 bst_light_aberration_apply(const bst_light_aberration *a,
                                                  bst_vec3 direction) {
    double along = bst_vec3_dot(direction, a->velocity);
    bst_vec3 q = bst_vec3_scale(direction, a->inverse_gamma - a->potential * along);
    q = bst_vec3_axpy(q, 1.0 + along * a->share + a->potential, a->velocity);
    return bst_vec3_scale(q, 1.0 / bst_vec3_norm(q));
}

#pragma GCC visibility pop

#endif
