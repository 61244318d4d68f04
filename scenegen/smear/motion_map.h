/* How a frame's stars move in the parts of the field: what a shared path of the camera's turn is
 * for the stars of each cell of a lattice over the field.
 *
 * A star at the pole of a roll stands still while the one at the boresight makes a streak, and in a
 * wide field the corners move further than the boresight. Cells are filled at first use. */
#ifndef BST_SCENEGEN_SMEAR_MOTION_MAP_H
#define BST_SCENEGEN_SMEAR_MOTION_MAP_H

#include "scenegen/smear/smear_quadrature.h"

typedef struct bst_motion_map bst_motion_map;

enum { BST_MOTION_ERRORS = 16 };

/* What holds for all stars of a cell. */
typedef struct bst_smear_star_motion_cell {
    double share;           /* at most, of a star's light on one pixel */
    double read_share;      /* the same of a pixel that is read, binned from the sensor's */
    double scale;           /* at most, of its motion over the path's */
    double low[2], high[2]; /* box of its places about the place at the reference attitude, px */
    /* room for errors that follow from `scale`, of the caller's choice; negative when the cell is
     * new */
    double error[BST_MOTION_ERRORS];
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
    const bst_smear_node *nodes; /* [count] of the camera's path, in the order of time */
    int count;
    const float *table; /* their maps of the tangent plane, blocks of BST_TABLE_ROWS x BST_BLOCK */
    double scale_rad;   /* per px */
    double tilt_px;     /* px of a node's tilts per px of image motion at the boresight */
    double roll_px;     /* px of a node's roll per rad */
    double reach_px;    /* stars further from the boresight give no light */
    double sensor_px;   /* and places that are */
    double shrink, stretch; /* least and largest scale of the image by distortion */
    double sigma_px;        /* of the Gaussian that puts as much light on one pixel as the PSF */
    int binning;
    int sources; /* how many stars will be asked for */
} bst_motion_map_frame;

/* Largest share of a Gaussian's light on a pixel that is read, binned from `binning` x `binning` of
 * the sensor's, over the sum of exp(-d^2 / 2 s^2) of the path, d from the pixel; *spread_px: s. */
double bst_motion_pixel_share(double sigma_px, int binning, double *spread_px);

/* Starts a frame; its nodes and table are copied. BST_ERR_MEMORY. */
bst_status bst_motion_map_begin(bst_ctx *ctx, bst_motion_map *map,
                                const bst_motion_map_frame *frame) BST_MUST_CHECK;

/* The cell of a star at (x, y) px from the boresight, undistorted, at the reference attitude. Valid
 * until the next frame. */
bst_smear_star_motion_cell *bst_motion_map_at(bst_motion_map *map, double x, double y);

#endif
