/* One tile of the frame per work-item. Options: GROUP (work-items per work-group), FFT_LIGHT (the
 * light is an image, given as `profiles`). */

/* frame: [window_height][window_width] digital numbers. saturated: pixels per tile. */
__attribute__((reqd_work_group_size(GROUP, 1, 1))) kernel void bst_scene_frame(
    bst_scene_params p, global const bst_scene_source *sources, global const float *nodes,
    global const float4 *block_box, global const float *source_box, global const float *profiles,
    global ushort *frame, global int *saturated) {
    local float sums[GROUP][TILE_H * STRIDE] __attribute__((aligned(64)));
    int tile = (int)get_global_id(0);
    if (tile >= p.tiles_x * p.tiles_y) {
        return;
    }
    local float *sum = sums[get_local_id(0)];
    int left = tile % p.tiles_x * TILE_W, top = tile / p.tiles_x * TILE_H;
    int tile_x = p.window_x0 + left, tile_y = p.window_y0 + top;
#ifdef FFT_LIGHT
    load_tile(sum, p, left, top, profiles);
#else
    splat_tile(sum, tile_x, tile_y, p.source_groups, sources, nodes, block_box, source_box,
               profiles);
#endif
    SHADE_TILE(sum, tile_x, tile_y);
    int16 full_count = (int16)0;
    int rows = min(TILE_H, p.window_height - top), columns = min(TILE_W, p.window_width - left);
    for (int y = 0; y < rows; y++) {
        uint index = (uint)((tile_y + y) * p.sensor_width + tile_x);
        global ushort *out = frame + (size_t)(top + y) * p.window_width + left;
        for (int x = 0; x < columns; x += 16) {
            float16 mean = vload16(0, sum + y * STRIDE + x) + p.background_e;
            int16 full;
            ushort16 dn = detect16(p, index + (uint)x, mean, &full);
            if (x + 16 <= columns) {
                vstore16(dn, 0, out + x);
                full_count -= full;
            } else {
                ushort last[16];
                int flags[16];
                vstore16(dn, 0, last);
                vstore16(full, 0, flags);
                for (int i = 0; x + i < columns; i++) {
                    out[x + i] = last[i];
                    full_count.s0 -= flags[i];
                }
            }
        }
    }
    int8 a = full_count.lo + full_count.hi;
    int4 b = a.lo + a.hi;
    int2 c = b.lo + b.hi;
    saturated[tile] = c.lo + c.hi;
}

/* image: [window_height][window_width] expected electrons. */
__attribute__((reqd_work_group_size(GROUP, 1, 1))) kernel void bst_scene_expected(
    bst_scene_params p, global const bst_scene_source *sources, global const float *nodes,
    global const float4 *block_box, global const float *source_box, global const float *profiles,
    global float *image) {
    local float sums[GROUP][TILE_H * STRIDE] __attribute__((aligned(64)));
    int tile = (int)get_global_id(0);
    if (tile >= p.tiles_x * p.tiles_y) {
        return;
    }
    local float *sum = sums[get_local_id(0)];
    int left = tile % p.tiles_x * TILE_W, top = tile / p.tiles_x * TILE_H;
#ifdef FFT_LIGHT
    load_tile(sum, p, left, top, profiles);
#else
    splat_tile(sum, p.window_x0 + left, p.window_y0 + top, p.source_groups, sources, nodes,
               block_box, source_box, profiles);
#endif
    SHADE_TILE(sum, p.window_x0 + left, p.window_y0 + top);
    int rows = min(TILE_H, p.window_height - top), columns = min(TILE_W, p.window_width - left);
    for (int y = 0; y < rows; y++) {
        global float *out = image + (size_t)(top + y) * p.window_width + left;
        for (int x = 0; x < columns; x++) {
            out[x] = sum[y * STRIDE + x] + p.background_e;
        }
    }
}
