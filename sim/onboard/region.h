/* A region of the sky that contains a target of unknown position. */
#ifndef BST_ONBOARD_REGION_H
#define BST_ONBOARD_REGION_H

enum {
    BST_REGION_NONE,
    BST_REGION_ARC,           /* along a great circle on the sky */
    BST_REGION_GEOSTATIONARY, /* over a range of longitudes at the geostationary radius */
};

typedef struct bst_region {
    int kind; /* BST_REGION_... */
    double half_length_rad, half_width_rad;
} bst_region;

#endif
