/* Background of a frame: sky, bright bodies, stray light and gradients, as expected electrons on a
 * grid over the sensor. */
#ifndef BST_WORLD_SCENE_SKYLIGHT_H
#define BST_WORLD_SCENE_SKYLIGHT_H

#include "boresight/messages.h"
#include "sim/world/scene/discs.h"
#include "sim/world/world.h"

/* Background electrons per pixel in one exposure, without dark current, at nodes x0_px + i step_px,
 * y0_px + j step_px of the full sensor; interpolate bilinearly. Origins are multiples of the step,
 * a power of two, and the nodes enclose the window: a node's value does not depend on the
 * window. */
typedef struct bst_skylight_map {
    int step_px;
    int x0_px, y0_px;
    int columns, rows; /* at least 3 where the step is above 1 */
    const float *e;    /* [rows][columns] */
    double least_e;    /* smallest value of all nodes */
    /* not NULL: an edge is in the window (x0_px, y0_px, columns, rows in steps), `e` misses it, and
     * bst_skylight_at computes the pixels around a position itself */
    const struct bst_skylight *at_pixels;
    /* not NULL: bst_skylight_at computes the nodes around a position when they are first asked for;
     * `e` has NAN until then, and least_e is 0 */
    struct bst_skylight *at_nodes;
} bst_skylight_map;

/* Background at a position of the full sensor; constant beyond the border of the map. */
double bst_skylight_at(const bst_skylight_map *map, double x_px, double y_px);

/* True if the background differs between pixels. If not, bst_camera_background_e_per_s gives the
 * single value. */
bool bst_skylight_varies(const bst_camera *camera);

/* True if the background may differ between pixels in some exposures: as bst_skylight_varies, or
 * discs of bright bodies may enter the field. */
bool bst_skylight_may_vary(const bst_camera *camera);

/* Work space and latest background map of one camera. `world` must outlive it; for one thread. */
typedef struct bst_skylight bst_skylight;

/* Creates the sky background of a camera.
 *
 * Given:     world, camera  must outlive it
 * Returned:  *out  NULL on error
 * Errors:    BST_ERR_MEMORY */
bst_status bst_skylight_create(bst_ctx *ctx, const bst_world *world, const bst_camera *camera,
                               bst_skylight **out) BST_MUST_CHECK;
void bst_skylight_free(bst_skylight *skylight); /* NULL allowed */
/* Uses another camera with the same background and another scale from the next map on; borrowed. */
void bst_skylight_set_camera(bst_skylight *skylight, const bst_camera *camera);

/* From the next map on, pixels at an edge and, without ghosts, nodes elsewhere are computed by
 * bst_skylight_at where they are asked for, instead of all of them by bst_skylight_make: for those
 * who need few places of a map. */
void bst_skylight_set_places_only(bst_skylight *skylight);

/* Computes the background map of an exposure for a window. Nodes are 32 px apart, closer above 0.3
 * degrees, and 1 px apart if the edge of a disc, the terminator or the edge of the vignetting is on
 * the sensor. `skylight` holds *out until the next call. BST_ERR_MEMORY. */
bst_status bst_skylight_make(bst_ctx *ctx, bst_skylight *skylight,
                             const bst_scene_surroundings *around, bst_window window,
                             const bst_skylight_map **out) BST_MUST_CHECK;

#endif
