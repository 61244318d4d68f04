/* Sun, Moon and Earth: positions, illumination, shadow and occultation. GCRF axes, metres. */
#ifndef BST_ASTRO_BODIES_H
#define BST_ASTRO_BODIES_H

#include <stdbool.h>

#include "boresight/light.h"
#include "sim/astro/frames.h"

#define BST_LIGHT_SPEED_MPS 299792458.0
#define BST_AU_M 149597870700.0
#define BST_SUN_RADIUS_M 6.957e8         /* IAU 2015 nominal */
#define BST_SOLAR_IRRADIANCE_WPM2 1361.0 /* at 1 au; IAU 2015 nominal */
#define BST_EARTH_RADIUS_M 6378137.0     /* WGS 84 equatorial */
#define BST_EARTH_FLATTENING (1.0 / 298.257223563)
#define BST_EARTH_MU_M3PS2 3.986004418e14

typedef struct bst_bodies {
    bst_vec3 sun_m;          /* Earth's centre to the Sun, geometric, GCRF */
    bst_vec3 moon_m;         /* Earth's centre to the Moon, GCRF */
    bst_vec3 earth_bary_mps; /* Earth's velocity relative to the solar-system barycentre, ICRS */
    bst_vec3 earth_bary_m;   /* Earth's position relative to the barycentre, ICRS */
    bst_vec3 pole;           /* the Earth's axis (unit), GCRF: the symmetry axis of its figure */
} bst_bodies;

/* Sun and Earth by eraEpv00 (heliocentric 14 km, barycentric 8 mm/s at most against DE405), Moon by
 * eraMoon98 (about 3 arcsec rms). The pole is the mean one of date (eraPmat06): nutation moves it
 * by 9 arcsec, the limb by less than 2 m. TT is used as TDB. */
void bst_bodies_at(bst_time t, bst_bodies *out);

/* Apparent origin of sunlight at the Earth: the Sun at the time of emission, seen from the moving
 * Earth. It is 20.5 arcsec from the geometric Sun; the shadow at geostationary distance is up to 4
 * km off the line of centres. GCRF axes, m. */
static inline bst_vec3 bst_bodies_sunlight_from(const bst_bodies *b) {
    return bst_vec3_axpy(b->sun_m, bst_vec3_norm(b->sun_m) / BST_LIGHT_SPEED_MPS,
                         b->earth_bary_mps);
}

/* Pole for unknown dates: that of J2000. In 2030 the limb error is at most 60 m. */
#define BST_EARTH_POLE_J2000 ((bst_vec3){0.0, 0.0, 1.0})

/* depth in Earth radii (1 cm) up to which a line counts as tangent to the Earth */
#define BST_EARTH_TOUCH 1.5e-9

/* Visible fraction of the Sun's disc by area, 0 to 1, at a point, with the WGS-84 ellipsoid and
 * without atmosphere.
 *
 * Given:    position_m  geocentric, GCRF axes
 *           sun_m       geocentric origin of the sunlight (bst_bodies_sunlight_from)
 *           pole        the Earth's axis, unit
 * Returned: 1 in full light, 0 in umbra and inside the Earth, the uncovered area in between and in
 *           annular eclipse.
 * Notes: the Sun is a circle and the limb next to it the circle that osculates it, both in the
 * plane that is tangent to the sky at the Sun. Contacts agree with rays round the ellipsoid to 1 ms
 * (tests/astro/test_shadow_rays.c). */
double bst_astro_sun_fraction(bst_vec3 position_m, bst_vec3 sun_m, bst_vec3 pole);

/* wavelengths of bst_astro_sunlight; the second one represents V */
enum { BST_SUNLIGHT_COLOURS = 4, BST_SUNLIGHT_V = 1 };
extern const double bst_sunlight_wavelength_m[BST_SUNLIGHT_COLOURS];

typedef struct bst_astro_sunlight {
    double disc;                        /* bst_astro_sun_fraction */
    double light[BST_SUNLIGHT_COLOURS]; /* irradiance over that of the whole Sun, by wavelength */
} bst_astro_sunlight;

/* Sunlight at a point, with the Sun's limb darkening and, if asked for, the refraction and
 * extinction of the Earth's atmosphere.
 *
 * Given:    as bst_astro_sun_fraction; atmosphere: include the Earth's atmosphere
 * Returned: *out
 * Notes: rays are bent and spread as in geometric optics, weakened by Rayleigh scattering and
 * ozone, and end at the cloud tops (8 km). Light below 12 km (most of the light in the inner
 * penumbra of low orbits and in all umbrae) depends on clouds and aerosols, which are unknown: an
 * error by a factor of 2 is possible. At points below 80 km refraction is omitted.
 * Reference: Baum and Code, AJ 58, 108 (1953); Link, Eclipse Phenomena in
 * Astronomy (1969), chapter 2; limb darkening: Cox, Allen's Astrophysical Quantities (4th edition),
 * table 14.17. */
void bst_astro_sunlight_at(bst_vec3 position_m, bst_vec3 sun_m, bst_vec3 pole, bool atmosphere,
                           bst_astro_sunlight *out);

/* Angle (rad) of a direction from the limb of the WGS-84 ellipsoid, at position_m. Negative: the
 * Earth occults it; pi: more than 90 degrees beyond; -pi: inside the Earth. Exact at the limb. */
double bst_astro_earth_limb_angle(bst_vec3 position_m, bst_vec3 pole, bst_vec3 direction);

/* True if the segment between two geocentric points (GCRF) intersects the WGS-84 ellipsoid with
 * axis `pole`, also if an end is inside. Intersections less than 1 cm deep do not count: a point on
 * the surface sees objects above its horizon. */
bool bst_astro_earth_occults(bst_vec3 a_m, bst_vec3 b_m, bst_vec3 pole);

/* Aberration and light deflection for an observer with geocentric GCRF position and velocity. */
bst_light bst_light_at(const bst_bodies *bodies, bst_vec3 position_m, bst_vec3 velocity_mps);

/* Vector from observer to object for bst_light_aberrate, from the geocentric GCRF position of the
 * object at emission, tau_s earlier. It includes the Earth's motion during tau, 20 arcsec, which
 * aberration by the Earth's velocity cancels. */
static inline bst_vec3 bst_light_path(const bst_bodies *bodies, bst_vec3 object_at_emission_m,
                                      bst_vec3 observer_m, double tau_s) {
    return bst_vec3_axpy(bst_vec3_sub(object_at_emission_m, observer_m), -tau_s,
                         bodies->earth_bary_mps);
}

/* Reflected irradiance over incident irradiance, times range^2 / (albedo * area), of a sphere with
 * cross-section `area` (McCue, Williams and Morford, Planetary and Space Science 19, 851, 1971):
 * (1 - s) 2 / (3 pi^2) ((pi - phi) cos phi + sin phi) + s / (4 pi). 0 at a phase of pi and beyond
 * for the diffuse part. */
double bst_astro_sphere_phase(double specular_fraction, double phase_rad);

#endif
