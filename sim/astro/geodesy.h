/* Geodetic positions on WGS 84, by GeographicLib. */
#ifndef BST_ASTRO_GEODESY_H
#define BST_ASTRO_GEODESY_H

#include "sim/core/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Geodetic latitude, longitude (rad, -pi..pi) and height above the ellipsoid (m) to ITRF (m), and
 * back. */
bst_status bst_geodetic_to_itrf(bst_ctx *ctx, double latitude_rad, double longitude_rad,
                                double height_m, double itrf_m[3]) BST_MUST_CHECK;
bst_status bst_itrf_to_geodetic(bst_ctx *ctx, const double itrf_m[3], double *latitude_rad,
                                double *longitude_rad, double *height_m) BST_MUST_CHECK;

#ifdef __cplusplus
}
#endif

#endif
