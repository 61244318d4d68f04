/* A lit sphere as a disc: the points that stand for it, and its brightness by place. */
#ifndef BST_WORLD_SCENE_DISC_H
#define BST_WORLD_SCENE_DISC_H

#include "sim/world/scene/field.h"

/* A part of the disc's light. Its apparent direction is that of apparent_mid + offset. */
typedef struct bst_disc_point {
    bst_vec3 offset; /* at right angles to the line of sight, over the distance */
    double share;    /* of the source's light; all points of all lights together: 1 */
} bst_disc_point;

/* A growing array; zero-initialise, free `items`. */
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

/* Appends the points of some lights of a source with a shape, as Gauss-Legendre quadrature over the
 * lit part in panels of four by four points that are no wider than panel_rad. The integral of what
 * varies over the size of a panel as a Gaussian of that standard deviation does is right to 1e-7;
 * with panels of twice that, to 2e-5. Lambert's law with the Sun far away and the eye at its
 * distance: near by, less of the sphere is seen. BST_ERR_MEMORY. */
bst_status bst_disc_make_points(bst_ctx *ctx, const bst_scene_source *source, int lights,
                                double panel_rad, bst_disc_points *out) BST_MUST_CHECK;

/* The disc as one light sees it. */
typedef struct bst_disc_aspect {
    bst_vec3 x, y, z;    /* unit: towards the light, across, from the sphere to the eye */
    double sine, cosine; /* of the phase angle */
    double radius;       /* of the sphere over its distance */
    double scale;        /* radiance over the cosine of incidence, shares per steradian */
} bst_disc_aspect;

/* A disc ready to be asked for its brightness. */
typedef struct bst_disc {
    bst_disc_aspect sun, earth;
    double thermal; /* radiance, shares per steradian */
} bst_disc;

/* Computes what the radiance of a resolved object needs, once for all of its points.
 *
 * Given:     source  an object with a shape */
void bst_disc_begin(const bst_scene_source *source, bst_disc *out);

/* Share of the source's light per steradian in a direction (unit, apparent); 0 beside the disc. The
 * specular point is not in it. */
double bst_disc_radiance(const bst_disc *disc, bst_vec3 direction);

/* Place of the specular point, as bst_disc_point.offset. */
bst_vec3 bst_disc_specular(const bst_scene_source *source);

#endif
