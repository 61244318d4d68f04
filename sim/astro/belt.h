/* Geometry of the geostationary belt: positions, and apparent motion of Earth-fixed objects. GCRF,
 * metres. Light time is neglected: 0.13 s of the belt's own motion, 2 arcsec, and 20 arcsec of the
 * Earth's. */
#ifndef BST_ASTRO_BELT_H
#define BST_ASTRO_BELT_H

#include <stdbool.h>

#include "sim/astro/frames.h"

/* Radius of a circular orbit with the Earth's rotation rate: (mu / w^2)^(1/3). */
#define BST_BELT_RADIUS_M 42164172.0

/* An observer of the belt. */
typedef struct bst_belt_eye {
    bst_vec3 position_m, velocity_mps; /* geocentric */
    bst_vec3 earth_radps;              /* the Earth's rotation vector (bst_astro_earth_rate_gcrf) */
} bst_belt_eye;

/* Geocentric position at an east longitude and geocentric latitude, at the belt's radius. */
bst_vec3 bst_belt_place(double longitude_rad, double latitude_rad, const bst_mat3 *itrf_from_gcrf);

/* Apparent motion of an Earth-fixed point at the belt's radius in a direction (unit) from the
 * observer: rate d(direction)/dt, range and range rate. Of two intersections with the sphere it
 * takes the farther one. False: no intersection in front of the observer. */
bool bst_belt_motion(const bst_belt_eye *eye, bst_vec3 direction, bst_vec3 *rate_radps,
                     double *range_m, double *range_rate_mps);

#endif
