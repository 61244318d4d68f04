/* The renderer's tiles: as large as the device's local memory makes useful. */
#ifndef BST_SCENEGEN_TILES_H
#define BST_SCENEGEN_TILES_H

#include <stdint.h>

#include "scenegen/renderer.h"

/* Fills tile_width, tile_height and group where tile_width is 0, and the size of the largest buffer
 * that the device allows. BST_ERR_ARGUMENT for given tiles that do not fit into its local memory or
 * are no multiple of 64 wide, BST_ERR_DEVICE. */
bst_status bst_tiles_choose(bst_ctx *ctx, const bst_device *device, bst_renderer_options *options,
                            uint64_t *most_bytes) BST_MUST_CHECK;

#endif
