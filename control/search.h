/* Step-stare search: the places that the boresight visits, nearest to the centre first. */
#ifndef BST_CONTROL_SEARCH_H
#define BST_CONTROL_SEARCH_H

#define BST_SEARCH_TILES_PER_SIDE 15
#define BST_SEARCH_MAX_TILES (BST_SEARCH_TILES_PER_SIDE * BST_SEARCH_TILES_PER_SIDE)

/* Offset from the centre along the image axes, tangent plane, rad. */
typedef struct bst_search_tile {
    double x_rad, y_rad;
} bst_search_tile;

typedef struct bst_search {
    int count;
    bst_search_tile tile[BST_SEARCH_MAX_TILES];
} bst_search;

/* Lays a grid of fields of field_x_rad by field_y_rad, `step` of a field apart (0 < step <= 1), so
 * that every place within +-extent_rad in x and y is in one of them (up to
 * BST_SEARCH_TILES_PER_SIDE fields a side). Tile 0 is the centre; the others follow by distance
 * from it, for an error of Gaussian probability the order that finds the target soonest, and by
 * angle from +x towards +y within a distance. */
void bst_search_plan(bst_search *search, double extent_rad, double field_x_rad, double field_y_rad,
                     double step);

#endif
