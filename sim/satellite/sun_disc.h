/* The Sun's disc as directions, and the sunlight that a facet reflects. Internal to sim/satellite.
 */
#ifndef BST_SATELLITE_SUN_DISC_H
#define BST_SATELLITE_SUN_DISC_H

#include "sim/satellite/model.h"

enum { BST_SUN_NODES_MAX = 49 };

/* Directions that stand for the Sun's disc. */
typedef struct bst_sun_disc {
    bst_vec3 direction[BST_SUN_NODES_MAX]; /* unit */
    double weight[BST_SUN_NODES_MAX];
    int count;
    bst_vec3 centre;
    double radius_rad;
} bst_sun_disc;

/* Prepares the disc for the narrowest specular lobe of a model.
 *
 * Given:     sun         unit direction
 *            radius_rad  angular radius; 0: a point */
void bst_sun_disc_make(bst_vec3 sun, double radius_rad, double lobe_rad, bst_sun_disc *out);

/* Nodes of the disc that a material needs: for wide lobes the Sun is a point. */
int bst_sun_disc_nodes(const bst_material *material, const bst_sun_disc *sun);

/* BRDF times both cosines, mean over the Sun's disc; the normal faces its centre and the
 * observer. */
double bst_facet_light(const bst_material *material, const bst_sun_disc *sun, bst_vec3 normal,
                       bst_vec3 observer);

#endif
