/* Step-stare search patterns: the tiles that the boresight visits, and the time they take. */
#ifndef BST_CONTROL_MODES_SEARCH_PATTERN_H
#define BST_CONTROL_MODES_SEARCH_PATTERN_H

#include <stdbool.h>

#include "boresight/archive.h"

#define BST_SEARCH_MAX_TILES 1023

/* Order of the tiles of a grid. */
typedef enum bst_search_pattern {
    /* by distance from the centre, then by angle from +x towards +y: for a Gaussian position error
     * the order that finds the target soonest */
    BST_SEARCH_NEAREST_FIRST = 0,
    BST_SEARCH_RASTER, /* row by row from -y to +y, alternately along +x and -x */
    BST_SEARCH_SPIRAL, /* spiral about the centre, +x first, then towards +y */
    BST_SEARCH_BELT,   /* column by column from -x to +x, alternately along +y and -y */
} bst_search_pattern;

/* Search area, in coordinates along and across it: image axes about a cue, or the two angles of a
 * region. */
typedef struct bst_search_area {
    double half_x_rad, half_y_rad;   /* half extent from the centre */
    double field_x_rad, field_y_rad; /* size of a tile */
    double step; /* spacing of neighbouring tiles, as a fraction of their size: (0, 1] */
} bst_search_area;

/* Tile centre: offset from the area's centre, rad. */
typedef struct bst_search_tile {
    double x_rad, y_rad;
} bst_search_tile;

typedef struct bst_search {
    int count;
    bool complete; /* false: more tiles than capacity, the outer ones are omitted */
    bst_search_tile tile[BST_SEARCH_MAX_TILES];
} bst_search;

/* Plans a grid of tiles, centred on the area, that covers it completely. */
void bst_search_plan(bst_search *search, bst_search_pattern pattern, const bst_search_area *area);

/* Saves or restores the tiles of a search, for bst_module_desc.archive. */
void bst_search_archive(bst_search *search, bst_archive *archive);

/* Largest field, aligned with the area, that fits in the camera's field of width by height rotated
 * by `turn_rad`. Its sides have the camera's proportion (inverse for rotations nearer to a quarter
 * turn). */
void bst_search_inscribe(double width_rad, double height_rad, double turn_rad, double *x_rad,
                         double *y_rad);

typedef struct bst_search_timing {
    double rate_radps, accel_radps2; /* axis limits; both axes move simultaneously */
    double settle_s;                 /* from the end of the slew until the servo reports settling */
    double period_s, exposure_s;     /* of frames */
    /* from an exposure's end to the resulting command, and from that to its effect */
    double latency_s;
    int frames; /* frames entirely at rest per tile */
} bst_search_timing;

/* Time of a rest-to-rest slew by an angle under rate and acceleration limits. */
double bst_search_slew_s(double angle_rad, double rate_radps, double accel_radps2);

/* Time from the command to the first tile until the command after the last one, if the boresight
 * starts on the first tile and frames have a fixed period. A tile costs whole frame periods,
 * because the next command follows a frame. */
double bst_search_sweep_s(const bst_search *search, const bst_search_timing *timing);

#endif
