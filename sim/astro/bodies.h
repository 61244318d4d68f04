/* Sun, Moon, Earth: places, light, shadow and occultation. Vectors in GCRF axes, metres. */
#ifndef BST_ASTRO_BODIES_H
#define BST_ASTRO_BODIES_H

#include <stdbool.h>

#include "sim/astro/frames.h"

#define BST_LIGHT_SPEED_MPS 299792458.0
#define BST_AU_M 149597870700.0
#define BST_SUN_RADIUS_M 6.957e8     /* IAU 2015 nominal */
#define BST_EARTH_RADIUS_M 6378137.0 /* WGS 84 equatorial */
#define BST_EARTH_FLATTENING (1.0 / 298.257223563)
#define BST_EARTH_MU_M3PS2 3.986004418e14

typedef struct bst_bodies {
    bst_vec3 sun_m;          /* Earth's centre to the Sun, geometric, GCRF */
    bst_vec3 moon_m;         /* Earth's centre to the Moon, GCRF */
    bst_vec3 earth_bary_mps; /* Earth's velocity relative to the solar-system barycentre, ICRS */
    bst_vec3 earth_bary_m;   /* Earth's position relative to the barycentre, ICRS */
} bst_bodies;

/* Sun and Earth by eraEpv00, Moon by eraMoon98 (about 3 arcsec rms). */
void bst_bodies_at(bst_time t, bst_bodies *out);

/* Fraction of the Sun's disc, 0 to 1, that a point at position_m (geocentric) sees past a spherical
 * Earth of the WGS-84 equatorial radius: 1 in full light, 0 in umbra, the uncovered area in between
 * and in annular eclipse. */
double bst_sun_fraction(bst_vec3 position_m, bst_vec3 sun_m);

/* True when the segment between two geocentric points (GCRF) passes through the WGS-84 ellipsoid.
 */
bool bst_earth_occults(bst_vec3 a_m, bst_vec3 b_m, const bst_mat3 *itrf_from_gcrf);

/* What turns a geometric direction into the one that an observer measures. */
typedef struct bst_light {
    bst_vec3 velocity_mps; /* observer relative to the barycentre */
    bst_vec3 sun_m;        /* observer to the Sun's centre */
} bst_light;

/* Light of an observer with geocentric GCRF position and velocity. */
bst_light bst_light_at(const bst_bodies *bodies, bst_vec3 position_m, bst_vec3 velocity_mps);

/* Apparent direction of a star (unit, ICRS): Sun's light deflection (eraLdsun), then stellar
 * aberration with special relativity (eraAb). Without parallax. */
bst_vec3 bst_light_apparent_star(const bst_light *light, bst_vec3 icrs);
/* The inverse, to 1e-12 rad. */
bst_vec3 bst_light_catalogue_star(const bst_light *light, bst_vec3 apparent);
/* Aberration only, for objects of the Earth-Moon space whose geometric direction already has light
 * time. */
bst_vec3 bst_light_aberrate(const bst_light *light, bst_vec3 direction);
bst_vec3 bst_light_unaberrate(const bst_light *light, bst_vec3 apparent);

#endif
