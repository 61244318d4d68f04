/* Expected electrons of the pixels, without noise. */

/* image: [window_height][image_stride] expected electrons. */
__attribute__((reqd_work_group_size(GROUP, 1, 1))) kernel void bst_scene_expected(
    bst_kernel_frame_params p, global const bst_kernel_source_record *sources, global const float16 *table,
    global const float *block_box, global const float *source_box, global const float *group_box,
    global const float *light, global const float *background, global float *image) {
    local float sums[GROUP][(TILE_H + BST_SPARE_ROWS) * STRIDE] __attribute__((aligned(64)));
    int tile = (int)get_global_id(0);
    if (tile >= p.tiles_x * p.tiles_y) {
        return;
    }
    local float *sum = sums[get_local_id(0)];
    tile_place t = place_tile(p, tile);
    light_tile(sum, p, t, sources, table, block_box, source_box, group_box, light, background);
    for (int y = 0; y < t.rows; y++) {
        global float *out = image + (size_t)(p.first_row + t.top + y) * p.image_stride;
        for (int x = max(0, -t.left); x < t.columns; x++) {
            out[t.left + x] = sum[y * STRIDE + x] + p.background_e;
        }
    }
}
