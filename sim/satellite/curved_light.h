/* Light of smooth curved surfaces, integrated over the surface itself. */
#ifndef BST_SATELLITE_CURVED_LIGHT_H
#define BST_SATELLITE_CURVED_LIGHT_H

#include "sim/satellite/model.h"

/* Light that a curved surface without shadows on it reflects.
 *
 * Given:     curved        the surface
 *            brdf          its BRDF
 *            sun, observer unit directions from the surface, frame of its joint
 * Returned:  integral of BRDF times both cosines over the lit and visible surface, m^2/sr
 * Notes:     Gauss-Legendre quadrature with panels at the borders of light and shadow and about the
 *            specular lobe: the error is below 1e-5 for Lambert's law, and below 1e-3 for lobes of
 *            0.01 rad. */
double bst_curved_light(const bst_curved *curved, const bst_brdf *brdf, bst_vec3 sun,
                        bst_vec3 observer);

/* Sorts a few numbers, by insertion. */
void bst_sort_few(double *x, int count);

/* Panels of such an integral, at most. */
enum { BST_CURVED_PANELS_MAX = 20 };

/* Ranges of azimuth in which a curved surface is lit and in sight, finer about the specular lobe,
 * for three points in each.
 *
 * Given:     as bst_curved_light
 * Returned:  panel  [BST_CURVED_PANELS_MAX] lowest and highest azimuth about z from x, rad; of
 *                   spheres about sun x observer, from the observer toward the Sun; the number is
 *                   the return value */
int bst_curved_panels(const bst_curved *curved, const bst_brdf *brdf, bst_vec3 sun,
                      bst_vec3 observer, double (*panel)[2]);

#endif
