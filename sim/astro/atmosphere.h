/* Density of the upper atmosphere, for drag. */
#ifndef BST_ASTRO_ATMOSPHERE_H
#define BST_ASTRO_ATMOSPHERE_H

#include "boresight/vec.h"

/* Height (m) above the WGS-84 ellipsoid of a position in Earth-fixed axes, along the radius: 2 m
 * too high at most below 400 km of height, 10 m below 2000 km. */
double bst_astro_height_m(bst_vec3 position_itrf_m);

/* Mean density (kg/m^3) at a height (m), of moderate solar activity: the base densities of the
 * exponential layers of Vallado, Fundamentals of Astrodynamics and Applications, table 8-4 (US
 * Standard Atmosphere 1976 below 25 km, CIRA-72 above), joined by a natural cubic spline in the
 * logarithm, which is smooth for an integrator; above 1000 km and below 0 the logarithm is linear.
 * Real densities at 500 km vary by a factor of ten over a solar cycle. */
double bst_atmosphere_density_kgpm3(double height_m);

#endif
