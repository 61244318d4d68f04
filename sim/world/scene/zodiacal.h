/* Zodiacal light as a function of ecliptic latitude and longitude relative to the Sun. */
#ifndef BST_WORLD_SCENE_ZODIACAL_H
#define BST_WORLD_SCENE_ZODIACAL_H

#include "boresight/vec.h"

/* Surface brightness in S10: stars like the Sun of V = 10 per square degree, as seen from 1 au.
 *
 * The nodes are those of Leinert et al., A&AS 127, 1 (1998), table 16 (after Levasseur-Regourd and
 * Dumont 1980), and 60 at the ecliptic pole; between them log brightness is bilinear in |latitude|
 * and |longitude|. The table has no values next to the Sun: where both are below 15 degrees the
 * brightness on the border of that square, on the same line through the Sun, is continued inwards
 * as distance^-2.3 (which meets the table's own value at (10, 10) to 0.5 %), down to the Sun's limb
 * at 0.27 degrees, from where it is constant.
 *
 * longitude_rad: ecliptic longitude minus the Sun's; any multiple of 2 pi. */
double bst_zodiacal_s10(double longitude_rad, double latitude_rad);

/* Zodiacal brightness in S10 towards `icrs` (unit) with the Sun at `sun` (any length), ICRS axes.
 * Ecliptic of J2000 (obliquity 84381.406 arcsec, IAU 2006). */
double bst_zodiacal_towards(bst_vec3 icrs, bst_vec3 sun);

#endif
