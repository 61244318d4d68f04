/* The geostationary belt: where its places are, and how what moves with it is seen. GCRF, metres.
 * Light time is left out: 0.13 s of the belt's own motion, 2 arcsec, and 20 arcsec of the Earth's.
 */
#ifndef BST_ASTRO_BELT_H
#define BST_ASTRO_BELT_H

#include <stdbool.h>

#include "sim/astro/frames.h"

/* Radius at which a circular orbit keeps pace with the Earth: (mu / w^2)^(1/3). */
#define BST_BELT_RADIUS_M 42164172.0

/* An observer of the belt. */
typedef struct bst_belt_eye {
    bst_vec3 position_m, velocity_mps; /* geocentric */
    bst_vec3 earth_radps;              /* the Earth's rotation vector (bst_astro_earth_rate_gcrf) */
} bst_belt_eye;

/* The place over an east longitude and a geocentric latitude at the belt's radius (geocentric). */
bst_vec3 bst_belt_place(double longitude_rad, double latitude_rad, const bst_mat3 *itrf_from_gcrf);

/* What would stand still over the Earth at the belt's radius in a direction (unit) from the
 * observer: its apparent rate d(direction)/dt, its range and range rate. False where the line of
 * sight does not meet that sphere in front of the observer; of two places the farther one. */
bool bst_belt_motion(const bst_belt_eye *eye, bst_vec3 direction, bst_vec3 *rate_radps,
                     double *range_m, double *range_rate_mps);

#endif
