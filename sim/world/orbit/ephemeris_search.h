/* Search of a cone in a table of positions. Internal to sim/world. */
#ifndef BST_WORLD_ORBIT_EPHEMERIS_SEARCH_H
#define BST_WORLD_ORBIT_EPHEMERIS_SEARCH_H

#include "sim/world/orbit/ephemeris.h"

/* Positions of objects at one time, and upper limits of their speeds, GCRF. */
typedef struct bst_ephemeris_rows {
    double *x_m, *y_m, *z_m; /* NAN: unknown, to be treated as anywhere */
    float *speed_mps;        /* -INFINITY: no orbit around that time; INFINITY: position unknown */
    float *near_m[3];        /* the same positions, or 0, for the first pass of a search */
    float *velocity_mps[3];  /* NAN: unknown */
} bst_ephemeris_rows;

/* A cone to search, and the uncertainties of the positions. */
typedef struct bst_ephemeris_search {
    bst_ephemeris_cone cone;
    double after_s;   /* time of the search after that of the rows */
    double error_m;   /* of the positions in the rows */
    double shift_rad; /* by which aberration and light time change directions */
    float least_mps;  /* speed limit outside the validity of those in the rows, else 0 */
} bst_ephemeris_search;

/* Number of bytes for the rows of `objects` objects. */
size_t bst_ephemeris_rows_bytes(int objects);
/* Divides memory of that size, aligned for double. */
bst_ephemeris_rows bst_ephemeris_rows_in(void *memory, int objects);
/* Sets the position of an object. velocity_mps: NULL: unknown. */
void bst_ephemeris_rows_set(const bst_ephemeris_rows *rows, int object, const double place_m[3],
                            const double velocity_mps[3], double speed_mps);

/* Finds the objects of a table that may be in a cone.
 *
 * Returned:  their number; `indices` ascending, with room for all objects
 * Notes:     All that are in the cone, and all whose velocity is unknown and that their speed limit
 *            could take there. The others are placed by their velocity and the Earth's attraction:
 *            in 4 s the third order changes a low orbit by 0.1 m, and the flattening by as much. */
int bst_ephemeris_rows_near(const bst_ephemeris_rows *rows, int objects,
                            const bst_ephemeris_search *search, int *indices);

#endif
