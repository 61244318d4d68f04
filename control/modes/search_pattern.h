/* Step-stare search: the places that the boresight visits, and how long that takes. */
#ifndef BST_CONTROL_MODES_SEARCH_PATTERN_H
#define BST_CONTROL_MODES_SEARCH_PATTERN_H

#include <stdbool.h>

#define BST_SEARCH_MAX_TILES 1023

/* The order of the places of a grid. */
typedef enum bst_search_pattern {
    /* by distance from the middle, and by angle from +x towards +y within a distance: for an error
     * of Gaussian probability the order that finds the target soonest */
    BST_SEARCH_NEAREST_FIRST = 0,
    BST_SEARCH_RASTER, /* row by row from -y to +y, there and back along x */
    BST_SEARCH_SPIRAL, /* round about the middle, +x first, then towards +y */
    BST_SEARCH_BELT,   /* column by column from -x to +x, there and back along y */
} bst_search_pattern;

/* What is searched, in coordinates along and across it: the image axes about a cue's place, or the
 * two angles of a region. */
typedef struct bst_search_area {
    double half_x_rad, half_y_rad;   /* how far it reaches each way from the middle */
    double field_x_rad, field_y_rad; /* what one place shows */
    double step;                     /* distance of neighbours, as a fraction of that: (0, 1] */
} bst_search_area;

/* Offset from the middle, rad. */
typedef struct bst_search_tile {
    double x_rad, y_rad;
} bst_search_tile;

typedef struct bst_search {
    int count;
    bool complete; /* false: the area has more places than there is room for, the outer are left
                      out */
    bst_search_tile tile[BST_SEARCH_MAX_TILES];
} bst_search;

/* Lays a grid of fields so that every place of the area is in one of them, about its middle. */
void bst_search_plan(bst_search *search, bst_search_pattern pattern, const bst_search_area *area);

/* The greatest field, with sides along and across the area, that lies wholly in the camera's field
 * of width by height when that is turned by `turn_rad` against it; its sides have the camera's
 * proportion (that of height to width for turns nearer to a quarter). */
void bst_search_inscribe(double width_rad, double height_rad, double turn_rad, double *x_rad,
                         double *y_rad);

typedef struct bst_search_timing {
    double rate_radps, accel_radps2; /* limits of each axis, which turn at the same time */
    double settle_s;                 /* from the end of the slew until the servo calls it so */
    double period_s, exposure_s;     /* of frames */
    double latency_s; /* from an exposure's end to the command that it brings about, and from that
                         to its effect */
    int frames;       /* wholly at rest at each place */
} bst_search_timing;

/* Time of a slew by an angle under limits of rate and acceleration, from rest to rest. */
double bst_search_slew_s(double angle_rad, double rate_radps, double accel_radps2);

/* Time from the command to the first place until that to what follows the last one, when the
 * boresight is already on the first place and frames come at a fixed period: a place costs whole
 * frame periods, because the next command follows a frame. */
double bst_search_sweep_s(const bst_search *search, const bst_search_timing *timing);

#endif
