/* Geodetic positions on WGS 84, by GeographicLib. */
#ifndef BST_ASTRO_GEODESY_H
#define BST_ASTRO_GEODESY_H

#include "boresight/status.h"

#ifdef __cplusplus
#define BST_NOEXCEPT noexcept
extern "C" {
#else
#define BST_NOEXCEPT
#endif

/* Geodetic latitude (-pi/2..pi/2) and longitude (rad) and height above the ellipsoid (m) to ITRF
 * (m). BST_ERR_ARGUMENT for values that are not finite or a latitude beyond a pole. */
bst_status bst_astro_geodetic_to_itrf(bst_ctx *ctx, double latitude_rad, double longitude_rad,
                                      double height_m,
                                      double itrf_m[3]) BST_NOEXCEPT BST_MUST_CHECK;
/* The inverse; longitude in -pi..pi, 0 on the polar axis. At the Earth's centre, where latitude has
 * no meaning, one of the nearest points of the ellipsoid (a pole) is taken. BST_ERR_ARGUMENT for
 * coordinates that are not finite. */
bst_status bst_astro_itrf_to_geodetic(bst_ctx *ctx, const double itrf_m[3], double *latitude_rad,
                                      double *longitude_rad,
                                      double *height_m) BST_NOEXCEPT BST_MUST_CHECK;

#ifdef __cplusplus
}
#endif

#endif
