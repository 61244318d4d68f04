/* Ghosts of a camera: where the second image of a source lies, how bright and how wide it is. */
#ifndef BST_OPTICS_GHOSTS_H
#define BST_OPTICS_GHOSTS_H

#include "boresight/camera.h"
#include "boresight/ghost_config.h"

/* Places of a ghost by those of its source on a rectangular grid. */
typedef struct bst_ghost_map {
    int columns, rows;           /* at least 2 */
    double *source_x, *source_y; /* [columns], [rows]: ascending, px of the full sensor */
    double *x, *y, *intensity;   /* [rows][columns] */
    double magnification;        /* largest length of the ghost's motion over the source's */
} bst_ghost_map;

/* One ghost. Pixels are full-sensor coordinates. */
typedef struct bst_ghost {
    double intensity, factor, centre_x_px, centre_y_px;
    double sigma_px, radius_px, inner_radius_px, outside_px;
    bst_ghost_map map; /* columns 0: by factor and centre */
} bst_ghost;

/* The ghosts of a camera; immutable. */
typedef struct bst_ghosts {
    int count;
    bst_ghost items[];
} bst_ghosts;

/* Creates the ghosts of a camera and reads their tables.
 *
 * Given:     camera    with its list of bst_ghost_config, size and boresight
 *            base_dir  base of relative paths
 * Returned:  *out  NULL without ghosts, or on error; free with bst_ghosts_free
 * Errors:    BST_ERR_CONFIG with the key below `camera`: two shapes, a hole without a disc, a table
 *            that cannot be read or is no grid */
bst_status bst_ghosts_create(bst_ctx *ctx, const bst_camera *camera, const char *base_dir,
                             bst_ghosts **out) BST_MUST_CHECK;
/* Frees ghosts; NULL is allowed. */
void bst_ghosts_free(bst_ghosts *ghosts);

/* Place of a ghost.
 *
 * Given:     x_px, y_px  place of the source's image
 * Returned:  to[2]  px of the full sensor. Outside a table: by its outermost cells */
void bst_ghost_place(const bst_ghost *ghost, double x_px, double y_px, double to[2]);

/* Light of a ghost over that of its source, at a place of the source; 0: it has none there. */
double bst_ghost_intensity(const bst_ghost *ghost, const bst_camera *camera, double x_px,
                           double y_px);

/* Largest length of the ghost's motion over that of the source's image. */
double bst_ghost_magnification(const bst_ghost *ghost);
/* Distance from the ghost's centre beyond which it has no light but that of the PSF, px. */
double bst_ghost_reach_px(const bst_ghost *ghost);
/* Variance of the ghost's image along an axis, without the PSF, px^2. */
double bst_ghost_variance_px2(const bst_ghost *ghost);
/* Upper bound of the light in one pixel over the ghost's, without the PSF: at most 1. */
double bst_ghost_peak_share(const bst_ghost *ghost);

/* Direction in the camera frame from which a source would have its image where the ghost of a
 * source in direction v_cam lies; (0, 0, -1) if that source has no image. */
bst_vec3 bst_ghost_direction(const bst_ghost *ghost, const bst_camera *camera, bst_vec3 v_cam);

#endif
