/* The light between the sources: sky, bright bodies, stray light and gradients, as expected
 * electrons on a grid over the sensor. */
#ifndef BST_WORLD_SCENE_SKYLIGHT_H
#define BST_WORLD_SCENE_SKYLIGHT_H

#include "boresight/messages.h"
#include "sim/world/scene/discs.h"
#include "sim/world/world.h"

/* Electrons per pixel in one exposure at nodes x0_px + i step_px, y0_px + j step_px of the full
 * sensor, to be interpolated bilinearly; dark current is not in it. Both origins are multiples of
 * the step, a power of two, and the nodes reach beyond the window on all sides: the same node has
 * the same value whatever the window. */
typedef struct bst_skylight_map {
    int step_px;
    int x0_px, y0_px;
    int columns, rows; /* at least 3 where the step is above 1 */
    const float *e;    /* [rows][columns] */
    double least_e;    /* of the nodes */
} bst_skylight_map;

/* Value at a place of the full sensor, held at the map's border. */
double bst_skylight_at(const bst_skylight_map *map, double x_px, double y_px);

/* Whether a camera's background differs from pixel to pixel; where it does not, the one number of
 * bst_camera_background_e_per_s is all there is. */
bool bst_skylight_varies(const bst_camera *camera);

/* Whether it may differ from pixel to pixel in some exposures: as above, or where discs of bright
 * bodies come into the field. */
bool bst_skylight_may_vary(const bst_camera *camera);

/* Work space and the latest map of one camera. `world` must outlive it; not shareable between
 * threads. */
typedef struct bst_skylight bst_skylight;

/* Creates the sky background of a camera.
 *
 * Given:     world, camera  must outlive it
 * Returned:  *out  NULL on error
 * Errors:    BST_ERR_MEMORY */
bst_status bst_skylight_create(bst_ctx *ctx, const bst_world *world, const bst_camera *camera,
                               bst_skylight **out) BST_MUST_CHECK;
void bst_skylight_free(bst_skylight *skylight); /* NULL allowed */
/* From the next map on another camera with the same background, at another scale; borrowed. */
void bst_skylight_set_camera(bst_skylight *skylight, const bst_camera *camera);

/* Makes the map of one exposure for a window. The nodes are 32 px apart, closer where that is more
 * than 0.3 degrees, and 1 px where the edge of a disc, the terminator or the edge of the vignetting
 * is anywhere on the sensor. *out is held in `skylight` until the next call. BST_ERR_MEMORY. */
bst_status bst_skylight_make(bst_ctx *ctx, bst_skylight *skylight,
                             const bst_scene_surroundings *around, bst_window window,
                             const bst_skylight_map **out) BST_MUST_CHECK;

#endif
