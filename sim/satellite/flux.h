/* Light that a satellite's shape sends toward a distant observer. */
#ifndef BST_SATELLITE_FLUX_H
#define BST_SATELLITE_FLUX_H

#include "sim/satellite/pose.h"

/* Directions of a quadrature of the earthlight. */
enum { BST_EARTHLIGHT_MAX = 3072, BST_EARTHLIGHT_FINEST = 4 };

/* Earthlight at the satellite: directions to lit places of the Earth, with the irradiance from each
 * over the irradiance of the Sun at the Earth. */
typedef struct bst_earthlight {
    bst_vec3 direction[BST_EARTHLIGHT_MAX]; /* unit */
    double irradiance[BST_EARTHLIGHT_MAX];
    int count;
    bst_vec3 centre; /* unit: to the centroid of the light */
} bst_earthlight;

/* Reflectance of the Earth: energy-conserving Phong (bst_brdf), diffuse only for most uses. */
typedef struct bst_earth_surface {
    double diffuse, specular, exponent;
    int fineness; /* of the quadrature: 1 to BST_EARTHLIGHT_FINEST */
} bst_earth_surface;

/* Earthlight at a place.
 *
 * Given:     surface   reflectance of the Earth, a sphere of the equatorial radius
 *            object_m  geocentric position, outside of the Earth
 *            sun       unit, geocentric direction of the Sun, the same axes
 * Returned:  *out  directions in these axes; count 0: the visible Earth is dark
 * Notes:     Gauss-Legendre in the angle from nadir, 8 rings of 24 directions times the square of
 *            the fineness. With 1 the irradiance on a plate is accurate to 1 % in low orbits, most
 *            of it from the terminator; surfaces with a narrow lobe need more. */
void bst_earthlight_at(const bst_earth_surface *surface, bst_vec3 object_m, bst_vec3 sun,
                       bst_earthlight *out);

/* Turns earthlight into other axes: q_new_from_old, such as into the body frame. */
void bst_earthlight_turn(bst_quat q, bst_earthlight *light);

/* Where light and observer are, in the body frame. */
typedef struct bst_satellite_light {
    bst_vec3 sun, observer; /* unit */
    double sun_radius_rad;  /* angular radius of the Sun's disc; 0: a point */
    double sunlit;          /* 0: no sunlight; else the sunlight is computed as if it were full */
    const bst_earthlight *earthlight; /* body frame; NULL: none */
    bool emission; /* whether emission_m2 and visible_m2 are wanted without earthlight */
} bst_satellite_light;

/* What the observer receives: intensity over irradiance, m^2/sr. Irradiance at the observer is that
 * of the Sun at 1 au times this over the square of the range. */
typedef struct bst_satellite_flux {
    double sun[BST_SUNLIGHT_COLOURS];   /* full sunlight at 1 au, reflected */
    double earth[BST_SUNLIGHT_COLOURS]; /* earthlight, reflected; with the irradiance of the Sun at
                                           the distance of bst_earthlight */
    double emission_m2;                 /* projected visible area times emissivity */
    double visible_m2;                  /* projected visible area */
    double error;                       /* estimated error of sun[BST_SUNLIGHT_V], m^2/sr */
} bst_satellite_flux;

/* Light of a pose.
 *
 * Given:     pose   joints as bst_satellite_pose_set left them; its views are changed
 *            light  directions
 * Returned:  *out
 * Notes:     shadows are those of the centre of the Sun, exact on plane facets unless a border is
 *            round. Curved surfaces are integrated without shadows and reduced by the part of their
 *            light that nothing hides (bst_curved_free_share); plane facets with a round border or
 *            a round hider likewise where they matter. `error` is an estimate of what that costs,
 *            no bound: docs/results/satellites.md has how often it is exceeded. Shadows of
 *            earthlight are those of a light at its centroid. Light that is reflected twice is left
 *            out. */
void bst_satellite_flux_at(bst_satellite_pose *pose, const bst_satellite_light *light,
                           bst_satellite_flux *out);

#endif
