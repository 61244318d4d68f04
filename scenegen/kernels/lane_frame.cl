/* Renders one tile of the frame per work-group: its light (lane_tile.cl) and the detector
 * (pixels.cl). */

/* frame, saturated, flags and maps as in frame.cl. */
__attribute__((reqd_work_group_size(BST_ROW_LANES *TILE_H, 1, 1))) kernel void bst_scene_frame(
    bst_kernel_frame_params p, global const bst_kernel_source_record *sources, global const float *table,
    global const float *block_box, global const float *group_box, global const float *far_box,
    global const float *light, global const float *background, global ushort *frame,
    global int *saturated, global const float *gain, global const float *dark,
    global const float *overlay, global const float *offsets, global const ushort *codes,
    global uchar *flags, global const float *readout) {
    local gather_room room;
    local tail_rows tails;
    local int full;
    int tile = (int)get_group_id(0);
    tile_place t = place_tile(p, tile);
    lane_place l = place_lane(t);
    if (get_local_id(0) == 0) {
        full = 0;
    }
    chunk c = light_lane(&room, p, t, l, sources, table, block_box, group_box, far_box, light,
                         background);
    DRAW_TAIL_ROWS(p, t, &tails);
    barrier(CLK_LOCAL_MEM_FENCE);
    if (l.inside) {
        detector_maps maps = {gain, dark, overlay, offsets, codes, readout};
        uint chunks_per_row = (uint)(p.sensor_width + 63) / 64u;
        uint counter = ((uint)l.y * chunks_per_row + (uint)t.x / 64u) * 16u + (uint)(l.x - t.x);
        size_t map = (size_t)l.y * p.maps_stride + t.x;
        int struck = HAS(p, BST_EFFECT_OVERLAY) && overlay[overlay_mark(p, map)] != 0.0f;
        chunk_flags brim;
        chunk e = detect_lane(p, maps, counter, l.y, l.x, struck, c, &brim);
        ADD_TAIL_LANE(&tails, l.y - t.y, l.x - t.x, e);
        size_t first = (size_t)(p.first_row + l.top) * p.window_width;
        int n = store_lane(p, maps, convert_chunk(p, maps, l.y, l.x, e), brim, l.left,
                           frame + first, HAS(p, BST_EFFECT_FLAGS) ? flags + first : 0);
        if (n > 0) {
            atomic_add(&full, n);
        }
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    if (get_local_id(0) == 0) {
        saturated[p.first_tile + tile] = full;
    }
}
