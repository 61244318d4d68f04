/* Renders one tile of the frame per work-item: its light (tile.cl) and the detector (pixels.cl).
 * Options: NEAR_CACHE (one address space; memory can be prefetched), and those of the files before.
 */

/* Number of rows by which maps are prefetched. */
#define AHEAD 2

#ifdef NEAR_CACHE
#define FETCH_LINE(map, at) __builtin_prefetch((const private void *)(uintptr_t)((map) + (at)))
#else
#define FETCH_LINE(map, at)
#endif

/* Prefetches a row of the maps, whose row distance is too large for the hardware prefetcher. */
INLINE void fetch_maps(bst_kernel_frame_params p, detector_maps maps, int row, int column,
                       int columns) {
    size_t first = (size_t)row * p.maps_stride + column;
    for (int x = 0; x < columns; x += 16) {
        if (HAS(p, BST_EFFECT_GAIN)) {
            FETCH_LINE(maps.gain, first + x);
        }
        if (HAS(p, BST_EFFECT_DARK)) {
            FETCH_LINE(maps.dark, first + x);
        }
        if (HAS(p, BST_EFFECT_READOUT)) {
            FETCH_LINE(maps.readout, first + x);
        }
    }
}

/* frame: [window_height][window_width] digital numbers. saturated: pixels per tile. flags:
 * BST_FLAG_... of the frame, if they are stored. Maps of effects that are off are not read. */
__attribute__((reqd_work_group_size(GROUP, 1, 1))) kernel void bst_scene_frame(
    bst_kernel_frame_params p, global const bst_kernel_source_record *sources, global const float16 *table,
    global const float *block_box, global const float *source_box, global const float *group_box,
    global const float *light, global const float *background, global ushort *frame,
    global int *saturated, global const float *gain, global const float *dark,
    global const float *overlay, global const float *offsets, global const ushort *codes,
    global uchar *flags, global const float *readout) {
    local float sums[GROUP][(TILE_H + BST_SPARE_ROWS) * STRIDE] __attribute__((aligned(64)));
    int tile = (int)get_global_id(0);
    if (tile >= p.tiles_x * p.tiles_y) {
        return;
    }
    local float *sum = sums[get_local_id(0)];
    tile_place t = place_tile(p, tile);
    light_tile(sum, p, t, sources, table, block_box, source_box, group_box, light, background);
    uint steps[MOST_STEPS];
    dark_law unlit = dark_law_of(p, steps);
    near_law near = near_law_of(p);
    tail_block tails[TILE_W / 64];
    detector_maps maps = {gain, dark, overlay, offsets, codes, readout};
    uint chunks_per_row = (uint)(p.sensor_width + 63) / 64u;
    int16 full_count = (int16)0;
    for (int y = 0; y < t.rows; y++) {
        uint counter = ((uint)(t.y + y) * chunks_per_row + (uint)t.x / 64u) * 16u;
        if (y == 0 || (t.y + y) % TAIL_ROWS == 0) {
            for (int x = 0; x < t.columns; x += 64) {
                DRAW_TAIL(p, t.y + y, t.x + x, p.sensor_width, &tails[x / 64]);
            }
        }
        if (y + AHEAD < t.rows) {
            fetch_maps(p, maps, t.y + y + AHEAD, t.x, t.columns);
        }
        size_t first = (size_t)(p.first_row + t.top + y) * p.window_width;
        global ushort *row = frame + first;
        global uchar *marks = HAS(p, BST_EFFECT_FLAGS) ? flags + first : 0;
        for (int x = 0; x < t.columns; x += 64) {
            local float16 *from = (local float16 *)(sum + y * STRIDE + x);
            chunk lights = {from[0], from[1], from[2], from[3]};
            int lit = any_of((lights.a > 0.0f) | (lights.b > 0.0f) | (lights.c > 0.0f) |
                            (lights.d > 0.0f));
            chunk_flags brim;
            chunk dn = detect_chunk(p, maps, unlit, near, steps, &tails[x / 64], counter, t.y + y,
                                    t.x + x, lights, lit, &brim);
            full_count -= store_dn(p, maps, dn, brim, t.left + x, row, marks);
            counter += 16u;
        }
    }
    int8 a = full_count.lo + full_count.hi;
    int4 b = a.lo + a.hi;
    int2 c = b.lo + b.hi;
    saturated[p.first_tile + tile] = c.lo + c.hi;
}
