/* Motion map: how the stars of each field cell move for a common path of camera rotations.
 *
 * A star at the pole of a roll is at rest while one at the boresight makes a streak, and in a wide
 * field the corners move further than the boresight. Cells are computed at first use. */
#ifndef BST_SCENEGEN_SMEAR_MOTION_MAP_H
#define BST_SCENEGEN_SMEAR_MOTION_MAP_H

#include <stdbool.h>

#include "scenegen/smear/smear_quadrature.h"
#include "sim/core/parallel.h"

typedef struct bst_motion_map bst_motion_map;

enum { BST_MOTION_ERRORS = 16 };

/* Properties common to all stars of a cell. */
typedef struct bst_smear_star_motion_cell {
    double share;      /* largest light share of a star in one pixel */
    double read_share; /* the same for a binned pixel */
    double scale;      /* largest ratio of its motion to the path's */
    /* box of its positions relative to that at the reference attitude, px */
    double low[2], high[2];
    /* caller's cache of errors that depend on `scale`; negative in a new cell */
    double error[BST_MOTION_ERRORS], predicted[BST_MOTION_ERRORS];
} bst_smear_star_motion_cell;

/* Creates an empty motion map.
 *
 * Returned:  *out  NULL on error
 * Errors:    BST_ERR_MEMORY
 * Ownership: free *out with bst_motion_map_free */
bst_status bst_motion_map_create(bst_ctx *ctx, bst_motion_map **out) BST_MUST_CHECK;
/* Frees a motion map; NULL is allowed. */
void bst_motion_map_free(bst_motion_map *map);

typedef struct bst_motion_map_frame {
    const bst_smear_node *nodes; /* [count] of the camera path, in order of time */
    int count;
    const float *table;     /* their tangent-plane maps, blocks of BST_TABLE_ROWS x BST_BLOCK */
    double scale_rad;       /* per px */
    double tilt_px;         /* px of a node's tilts per px of image motion at the boresight */
    double roll_px;         /* px of a node's roll per rad */
    double reach_px;        /* largest distance of a star from the boresight that gives light */
    double sensor_px;       /* largest distance of a position on the sensor */
    double shrink, stretch; /* least and largest image scale by distortion */
    double sigma_px;        /* Gaussian with the PSF's peak pixel share */
    int binning;
    int sources; /* number of stars that will be queried */
} bst_motion_map_frame;

/* Peak light share of a Gaussian in a binned pixel, over the sum of exp(-d^2 / 2 s^2) along the
 * path, d from the pixel; *spread_px: s. */
double bst_motion_pixel_share(double sigma_px, int binning, double *spread_px);

/* Starts a frame; nodes and table are copied. Errors: BST_ERR_MEMORY. */
bst_status bst_motion_map_begin(bst_ctx *ctx, bst_motion_map *map,
                                const bst_motion_map_frame *frame) BST_MUST_CHECK;

/* Cell of a star at (x, y) px from the boresight, undistorted, at the reference attitude. Valid
 * until the next frame. */
bst_smear_star_motion_cell *bst_motion_map_at(bst_motion_map *map, double x, double y);

/* Computes the cells of the stars at xy[2 count], (x, y) as in bst_motion_map_at, on several
 * threads, for later calls of that function. x NAN: no star. Returns false if there is too little
 * memory; cells are then computed at first use. */
bool bst_motion_map_fill(bst_motion_map *map, bst_parallel *pool, const double *xy, int count);

#endif
