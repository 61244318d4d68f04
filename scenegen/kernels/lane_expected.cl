/* Expected electrons of the pixels, without noise, as expected.cl: a work-group for each tile. */

INLINE void store_expected(bst_kernel_frame_params p, global float *row, int column, float light) {
    if (column >= 0 && column < p.window_width) {
        row[column] = light + p.background_e;
    }
}

/* image: [window_height][image_stride] expected electrons. */
__attribute__((reqd_work_group_size(BST_ROW_LANES *TILE_H, 1, 1))) kernel void bst_scene_expected(
    bst_kernel_frame_params p, global const bst_kernel_source_record *sources, global const float *table,
    global const float *block_box, global const float *group_box, global const float *far_box,
    global const float *light, global const float *background, global float *image) {
    local gather_room room;
    tile_place t = place_tile(p, (int)get_group_id(0));
    lane_place l = place_lane(t);
    chunk c = light_lane(&room, p, t, l, sources, table, block_box, group_box, far_box, light,
                         background);
    if (l.inside) {
        global float *row = image + (size_t)(p.first_row + l.top) * p.image_stride;
        store_expected(p, row, l.left, c.a);
        store_expected(p, row, l.left + 16, c.b);
        store_expected(p, row, l.left + 32, c.c);
        store_expected(p, row, l.left + 48, c.d);
    }
}
