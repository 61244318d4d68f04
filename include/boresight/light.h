/* Apparent directions: light deflection by the Sun and stellar aberration. */
#ifndef BORESIGHT_LIGHT_H
#define BORESIGHT_LIGHT_H

#include "boresight/vec.h"

#pragma GCC visibility push(default)

/* What turns a geometric direction into the one that an observer measures. */
typedef struct bst_light {
    bst_vec3 velocity_mps; /* observer relative to the barycentre */
    bst_vec3 sun_m;        /* observer to the Sun's centre */
} bst_light;

/* Apparent direction of a star (unit, ICRS axes): the Sun's light deflection (eraLdsun), then
 * stellar aberration with special relativity and the Sun's potential (eraAb). Without parallax.
 * Sources: Urban and Seidelmann, Explanatory Supplement (3rd edition), sections 7.2.3 and 7.2.4;
 * Klioner, AJ 125 (2003) 1580. */
bst_vec3 bst_light_apparent_star(const bst_light *light, bst_vec3 icrs);
/* The inverse, to 1e-12 rad. */
bst_vec3 bst_light_catalogue_star(const bst_light *light, bst_vec3 apparent);

/* Aberration only, for objects of the Earth-Moon space (unit vectors). The velocity is
 * barycentric, so the geometric direction must run from the observer at reception to the object at
 * emission in the barycentric frame: with geocentric positions and light time tau that is
 * r_object(t - tau) - r_observer(t) - tau * earth_bary_mps (see bst_light_path). */
bst_vec3 bst_light_aberrate(const bst_light *light, bst_vec3 direction);
bst_vec3 bst_light_unaberrate(const bst_light *light, bst_vec3 apparent); /* to 1e-12 rad */

/* What bst_light_aberrate takes from the light alone, for many directions. */
typedef struct bst_light_aberration {
    bst_vec3 velocity;                      /* in units of the speed of light */
    double inverse_gamma, share, potential; /* share: 1 / (1 + inverse_gamma) */
} bst_light_aberration;

bst_light_aberration bst_light_aberration_of(const bst_light *light);
static inline bst_vec3 bst_light_aberration_apply(const bst_light_aberration *a,
                                                  bst_vec3 direction) {
    double along = bst_vec3_dot(direction, a->velocity);
    bst_vec3 q = bst_vec3_scale(direction, a->inverse_gamma - a->potential * along);
    q = bst_vec3_axpy(q, 1.0 + along * a->share + a->potential, a->velocity);
    return bst_vec3_scale(q, 1.0 / bst_vec3_norm(q));
}

#pragma GCC visibility pop

#endif
