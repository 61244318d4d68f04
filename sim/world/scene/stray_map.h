/* A user's map of stray light over the sensor. Internal to sim/world. */
#ifndef BST_WORLD_SCENE_STRAY_MAP_H
#define BST_WORLD_SCENE_STRAY_MAP_H

#include "boresight/camera.h"

/* Numbers at the middles of blocks of sensor pixels; immutable. */
typedef struct bst_stray_map bst_stray_map;

/* Makes the map of a camera.
 *
 * Given:     camera   its background says what the numbers are, and their factor
 *            pixels   [height][width], row 0 first; taken over, freed after an error, too
 * Returned:  *out     NULL on error; free with bst_stray_map_free
 * Errors:    BST_ERR_CONFIG: sides that do not divide the sensor's, a number that is
 *            negative, not finite or above 1e12 (with its place), numbers that are shares without
 *            stray light by pst */
bst_status bst_stray_map_create(bst_ctx *ctx, const bst_camera *camera, int width, int height,
                                float *pixels, bst_stray_map **out) BST_MUST_CHECK;
void bst_stray_map_free(bst_stray_map *map); /* NULL allowed */

/* The map at a position of the full sensor, times its factor: the number of the block, linear
 * between the middles of blocks of several pixels, constant beyond the outermost. */
double bst_stray_map_at(const bst_stray_map *map, double x_px, double y_px);

/* Adds `factor` times the map (with its own factor) to the pixels x0_px ... of a row of the full
 * sensor.
 *
 * Given:     sum  [count] */
void bst_stray_map_add_row(const bst_stray_map *map, int x0_px, int y_px, int count, float factor,
                           float *sum);

#endif
