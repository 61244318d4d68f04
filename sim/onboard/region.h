/* A region of the sky in which a target is to be found, when no place of it is known. */
#ifndef BST_ONBOARD_REGION_H
#define BST_ONBOARD_REGION_H

enum {
    BST_REGION_NONE,
    BST_REGION_ARC,           /* along a great circle among the stars */
    BST_REGION_GEOSTATIONARY, /* over a range of longitudes, at the radius of the belt */
};

typedef struct bst_region {
    int kind; /* BST_REGION_... */
    double half_length_rad, half_width_rad;
} bst_region;

#endif
