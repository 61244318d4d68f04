/* Tile size of the renderer, from the device's local memory. */
#ifndef BST_SCENEGEN_TILES_H
#define BST_SCENEGEN_TILES_H

#include <stdint.h>

#include "scenegen/renderer.h"

/* Sets tile_width, tile_height and group if tile_width is 0, and the device's largest buffer size.
 *
 * Errors:    BST_ERR_ARGUMENT for given tiles that exceed the local memory or are no multiple of 64
 *            wide, BST_ERR_DEVICE */
bst_status bst_tiles_choose(bst_ctx *ctx, const bst_device *device, bst_renderer_options *options,
                            uint64_t *most_bytes) BST_MUST_CHECK;

#endif
