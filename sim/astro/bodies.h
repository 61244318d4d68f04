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

/* Sun and Earth by eraEpv00 (heliocentric 14 km, barycentric 8 mm/s at most against DE405), Moon by
 * eraMoon98 (about 3 arcsec rms). TT serves as TDB. */
void bst_bodies_at(bst_time t, bst_bodies *out);

/* Fraction of the Sun's disc, 0 to 1, that a point at position_m (geocentric) sees past a spherical
 * Earth of the WGS-84 equatorial radius: 1 in full light, 0 in umbra and inside the Earth, the
 * uncovered area in between and in annular eclipse. The discs are plane circles of the two angular
 * radii (Montenbruck and Gill, Satellite Orbits, section 3.4.2). */
double bst_sun_fraction(bst_vec3 position_m, bst_vec3 sun_m);

/* True when the segment between two geocentric points (GCRF) passes through the WGS-84 ellipsoid,
 * also when an end lies inside it. A touch less than 1 cm deep does not count, so that a point on
 * the surface sees what is above its horizon. */
bool bst_earth_occults(bst_vec3 a_m, bst_vec3 b_m, const bst_mat3 *itrf_from_gcrf);

/* What turns a geometric direction into the one that an observer measures. */
typedef struct bst_light {
    bst_vec3 velocity_mps; /* observer relative to the barycentre */
    bst_vec3 sun_m;        /* observer to the Sun's centre */
} bst_light;

/* Light of an observer with geocentric GCRF position and velocity. */
bst_light bst_light_at(const bst_bodies *bodies, bst_vec3 position_m, bst_vec3 velocity_mps);

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
typedef struct bst_aberration {
    bst_vec3 velocity;                      /* in units of the speed of light */
    double inverse_gamma, share, potential; /* share: 1 / (1 + inverse_gamma) */
} bst_aberration;

bst_aberration bst_aberration_of(const bst_light *light);
static inline bst_vec3 bst_aberrate(const bst_aberration *a, bst_vec3 direction) {
    double along = bst_vec3_dot(direction, a->velocity);
    bst_vec3 q = bst_vec3_scale(direction, a->inverse_gamma - a->potential * along);
    q = bst_vec3_axpy(q, 1.0 + along * a->share + a->potential, a->velocity);
    return bst_vec3_scale(q, 1.0 / bst_vec3_norm(q));
}

/* The vector from observer to object that bst_light_aberrate wants, from geocentric GCRF positions
 * of the object at emission, tau_s before the observer's instant. The Earth's own motion during
 * tau counts: 20 arcsec, which aberration by the Earth's velocity takes back. */
static inline bst_vec3 bst_light_path(const bst_bodies *bodies, bst_vec3 object_at_emission_m,
                                      bst_vec3 observer_m, double tau_s) {
    return bst_vec3_axpy(bst_vec3_sub(object_at_emission_m, observer_m), -tau_s,
                         bodies->earth_bary_mps);
}

#endif
