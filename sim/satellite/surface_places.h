/* Places on a surface where shadows on it may begin or end. Internal to sim/satellite. */
#ifndef BST_SATELLITE_SURFACE_PLACES_H
#define BST_SATELLITE_SURFACE_PLACES_H

#include "sim/satellite/line_shadow.h"

enum { BST_SURFACE_PLACES_MAX = 128, BST_SURFACE_SIDES_MAX = 7 };

/* A surface in the body frame, with the bodies that may hide some of it, and places of one
 * coordinate: azimuth about z from x; of polygons the distance along y. */
typedef struct bst_shaded_surface {
    bst_line_shadow shadow;
    const bst_curved *curved; /* NULL: a plane facet */
    bst_vec3 base, x, y, z;   /* of a sphere: z is the axis of bst_curved_panels, x the observer; of
                                 a plane facet: z is its normal */
    double radius_m;          /* of a disc */
    bst_point2 corner[BST_SURFACE_SIDES_MAX]; /* of a polygon */
    int corners;                              /* 0: a disc */
    double place[BST_SURFACE_PLACES_MAX];     /* ascending */
    int places;
    bool crowded; /* there was no room for more */
} bst_shaded_surface;

/* Finds the places between two where shadows may begin or end: for each hider the first and the
 * last one at which its silhouette meets the surface, and where it has few corners those of all
 * corners, and of the crossings of its sides with the ends of the surface.
 *
 * Given:     surface->shadow  bst_line_shadow_make has prepared it
 * Notes:     between two neighbouring places a hider's silhouette meets each line of the surface or
 *            none, but for round hiders, which count as polygons about them, up to 8 % wider. */
void bst_surface_find_places(bst_shaded_surface *surface, double start, double end);

#endif
