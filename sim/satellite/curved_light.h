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

#endif
