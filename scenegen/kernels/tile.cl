/* Light of one tile of a frame: of the sources, with vignetting, and the background. One work-item
 * per tile, or a work-group (lane_tile.cl). Options: TILE_W, TILE_H, GROUP (work-items per
 * work-group; not with ONE_LANE), FOURIER (the light is an
 * image, otherwise it comes from nodes; `light` is the image or the profile law). */

/* Position of a tile: its first pixel on the full sensor and in the window, and its size. Tiles
 * start at multiples of 64 columns, so the first and last may extend beyond the window. */
typedef struct tile_place {
    int x, y, left, top, rows, columns;
} tile_place;

static tile_place place_tile(bst_kernel_frame_params p, int tile) {
    tile_place t;
    t.x = p.tiles_x0 + tile % p.tiles_x * TILE_W;
    t.left = t.x - p.window_x0;
    t.top = tile / p.tiles_x * TILE_H;
    t.y = p.window_y0 + t.top;
    t.rows = min(TILE_H, p.window_height - t.top);
    t.columns = min(TILE_W, p.window_width - t.left);
    return t;
}

#ifndef ONE_LANE
/* sum: [TILE_H + BST_SPARE_ROWS][STRIDE]. */
INLINE void light_tile(local float *sum, bst_kernel_frame_params p, tile_place t,
                       global const bst_kernel_source_record *sources, global const float16 *table,
                       global const float *block_box, global const float *source_box,
                       global const float *group_box, global const float *light,
                       global const float *background) {
#ifdef FOURIER
    load_tile(sum, p, t.left, t.top, light);
#else
    splat_tile(p, sum, t.x, t.y, sources, table, block_box, source_box, group_box, light);
#endif
    shade_tile(sum, p.vignetting, t.x, t.y);
    add_background(sum, p, t.x, t.y, t.rows, t.columns, background);
}
#endif
