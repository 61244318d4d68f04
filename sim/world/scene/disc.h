/* A sunlit sphere rendered as a disc: its quadrature points and its radiance. */
#ifndef BST_WORLD_SCENE_DISC_H
#define BST_WORLD_SCENE_DISC_H

#include "sim/world/scene/field.h"

/* A quadrature point of a disc. Its apparent direction is that of apparent_mid + offset. */
typedef struct bst_disc_point {
    bst_vec3 offset; /* perpendicular to the line of sight, relative to the distance */
    double share;    /* fraction of the source's light; the sum over all lights is 1 */
} bst_disc_point;

/* A growing array of points; zero-initialise it, free `items`. */
typedef struct bst_disc_points {
    bst_disc_point *items;
    int count, capacity;
} bst_disc_points;

/* The lights of a disc. */
enum {
    BST_DISC_SUN = 1,
    BST_DISC_SPECULAR = 2,
    BST_DISC_EARTH = 4,
    BST_DISC_THERMAL = 8,
    BST_DISC_ALL = 15
};

/* Appends the points of some lights of an extended source: Gauss-Legendre quadrature over the lit
 * part, in panels of 4 x 4 points not wider than panel_rad. The error of integrating a Gaussian
 * whose sigma is the panel width is 1e-7; with panels of twice that width 2e-5. Lambert's law, the
 * Sun at infinity, the observer at its true distance. BST_ERR_MEMORY. */
bst_status bst_disc_make_points(bst_ctx *ctx, const bst_scene_source *source, int lights,
                                double panel_rad, bst_disc_points *out) BST_MUST_CHECK;

/* Geometry of a disc for one light. */
typedef struct bst_disc_aspect {
    bst_vec3 x, y, z; /* unit: towards the light, perpendicular, from the sphere to the observer */
    double sine, cosine; /* of the phase angle */
    double radius;       /* of the sphere over its distance */
    double scale;        /* radiance over the cosine of incidence, fractions per steradian */
} bst_disc_aspect;

/* A disc prepared for evaluating its radiance. */
typedef struct bst_disc {
    bst_disc_aspect sun, earth;
    double thermal; /* radiance, fractions per steradian */
} bst_disc;

/* Prepares the radiance of an extended source.
 *
 * Given:     source  an object with a shape */
void bst_disc_begin(const bst_scene_source *source, bst_disc *out);

/* Radiance of a disc in a direction (unit, apparent): fraction of the source's light per steradian;
 * 0 outside. The specular point is excluded. */
double bst_disc_radiance(const bst_disc *disc, bst_vec3 direction);

/* Position of the specular point on a disc, as bst_disc_point.offset. */
bst_vec3 bst_disc_specular(const bst_scene_source *source);

#endif
