/* The Earth's limb as seen from a point outside, for shadow and occultation. Internal to
 * sim/astro. */
#ifndef BST_ASTRO_EARTH_LIMB_H
#define BST_ASTRO_EARTH_LIMB_H

#include "sim/astro/bodies.h"

/* Coordinates in which the WGS-84 ellipsoid, enlarged by height_m along its axes, is the unit
 * sphere. */
static inline bst_vec3 bst_earth_unit_sphere(bst_vec3 gcrf_m, bst_vec3 pole, double height_m) {
    double a = BST_EARTH_RADIUS_M + height_m;
    double b = BST_EARTH_RADIUS_M * (1.0 - BST_EARTH_FLATTENING) + height_m;
    double along = bst_vec3_dot(gcrf_m, pole);
    bst_vec3 p = bst_vec3_scale(gcrf_m, 1.0 / a);
    return bst_vec3_axpy(p, along * (1.0 / b - 1.0 / a), pole);
}

/* Height above the ellipsoid along the radius, in Earth radii; negative: deeper inside than the
 * tangent tolerance. */
static inline double bst_earth_depth(bst_vec3 position_m, bst_vec3 pole) {
    return bst_vec3_norm(bst_earth_unit_sphere(position_m, pole, 0.0)) - 1.0 + BST_EARTH_TOUCH;
}

/* Osculating circle of the limb at its point nearest to a direction, in the tangent plane of the
 * sky at that direction (unit: its distance). */
typedef struct bst_earth_limb {
    double beyond;    /* distance of the direction outside the limb; negative: occulted */
    double curvature; /* of the limb, 0 for a straight one */
} bst_earth_limb;

/* Limb of the ellipsoid enlarged by height_m (m; negative: reduced) near the unit vector `towards`.
 *
 * Given:    position_m  geocentric, on or outside of that ellipsoid, GCRF axes
 *           pole        the Earth's axis, unit, GCRF axes
 * Returned: false if the direction is more than 90 degrees from the limb, where the
 *           tangent plane is undefined: no occultation there
 * Notes: exact at the nearest point of the limb. Away from it by an angle u the ellipse leaves the
 * circle by flattening * u^3 / radius^2 at most, radius being that of the limb (rad): 2e-8 rad at
 * the Sun's edge from geostationary orbit. */
bool bst_earth_limb_at(bst_vec3 position_m, bst_vec3 pole, double height_m, bst_vec3 towards,
                       bst_earth_limb *out);

/* True where the Earth certainly covers nothing of the Sun (*sunlit = 1), or all of it (0): outside
 * of a cone around the penumbra, or inside of one in the umbra. Decides most positions without the
 * limb.
 *
 * Given:    position_m  geocentric, GCRF axes
 *           to_sun      from there, m, with its length sun_distance_m
 *           height_m    by which the Earth is enlarged for *sunlit = 1 */
bool bst_earth_far_from_shadow(bst_vec3 position_m, bst_vec3 to_sun, double sun_distance_m,
                               double height_m, double *sunlit);

/* Fraction of the area of a disc with radius `disc` around the direction that is outside the limb,
 * 0..1; units of the tangent plane. */
double bst_earth_limb_share(const bst_earth_limb *limb, double disc);

#endif
