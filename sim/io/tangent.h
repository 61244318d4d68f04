/* Gnomonic (tangent plane) coordinates about a direction on the sky. */
#ifndef BST_IO_TANGENT_H
#define BST_IO_TANGENT_H

#include <math.h>
#include <stdbool.h>

#include "boresight/vec.h"

/* Tangent plane at a direction: unit vectors along it, east and north. */
typedef struct bst_io_sky_plane {
    bst_vec3 centre, east, north;
} bst_io_sky_plane;

static inline bst_io_sky_plane bst_io_sky_plane_at(double ra_rad, double dec_rad) {
    double sr = sin(ra_rad), cr = cos(ra_rad), sd = sin(dec_rad), cd = cos(dec_rad);
    return (bst_io_sky_plane){{cd * cr, cd * sr, sd}, {-sr, cr, 0.0}, {-sd * cr, -sd * sr, cd}};
}

/* Gnomonic coordinates (rad) of a direction; false: 90 degrees or more from the tangent point. */
static inline bool bst_io_sky_to_plane(const bst_io_sky_plane *t, bst_vec3 v, double *xi,
                                       double *eta) {
    double z = bst_vec3_dot(t->centre, v);
    if (!(z > 0.0)) {
        return false;
    }
    *xi = bst_vec3_dot(t->east, v) / z;
    *eta = bst_vec3_dot(t->north, v) / z;
    return true;
}

static inline bst_vec3 bst_io_sky_from_plane(const bst_io_sky_plane *t, double xi, double eta) {
    return bst_vec3_unit(bst_vec3_axpy(bst_vec3_axpy(t->centre, xi, t->east), eta, t->north));
}

#endif
