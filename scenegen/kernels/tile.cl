/* Renders one tile of the frame per work-item: light, vignetting, background and, for a frame, the
 * detector. Options: GROUP (work-items per work-group), NEAR_CACHE (one address space; memory can
 * be prefetched), FOURIER (the light is an image, otherwise it comes from nodes; `light` is the
 * image or the profile law), FLAGS (saturation flags are stored). */

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

/* Number of rows by which maps are prefetched. */
#define AHEAD 2

/* 16 digital numbers at an odd address: vstore16 may become 16 stores. */
typedef ushort16 __attribute__((aligned(2))) ushort16_anywhere;

#ifdef FLAGS
#define FLAGS_AT(flags, i) ((flags) + (i))
#else
#define FLAGS_AT(flags, i) 0
#endif

/* Stores the digital numbers (plus one half) of 16 pixels in the window's row at `column`. Returns
 * saturated pixels (`brim`, or converter at its maximum) as -1; pixels outside the window are 0.
 * marks: row of flags, with the option FLAGS. */
INLINE int16 store_dn(bst_kernel_frame_params p, detector_maps maps, float16 dn, int16 brim, int column,
                      global ushort *row, global uchar *marks) {
    ushort16 value = convert_ushort16(convert_int16(clamp(dn, 0.0f, p.max_dn)));
#ifdef CODES
    ushort numbers[16];
    vstore16(value, 0, numbers);
    for (int i = 0; i < 16; i++) {
        numbers[i] = maps.codes[numbers[i]];
    }
    value = vload16(0, numbers);
#endif
    int16 full = brim | (dn >= p.max_dn);
#ifdef FLAGS
    int16 kinds = (brim & BST_FLAG_FULL_WELL) | ((dn >= p.max_dn) & BST_FLAG_CONVERTER);
    for (int i = 0; i < 16; i++) {
        if (column + i >= 0 && column + i < p.window_width) {
            marks[column + i] = (uchar)((int *)&kinds)[i];
        }
    }
#endif
    if (column >= 0 && column + 16 <= p.window_width) {
        *(global ushort16_anywhere *)(row + column) = value;
        return full;
    }
    ushort values[16];
    int flags[16];
    vstore16(value, 0, values);
    vstore16(full, 0, flags);
    for (int i = 0; i < 16; i++) {
        if (column + i >= 0 && column + i < p.window_width) {
            row[column + i] = values[i];
        } else {
            flags[i] = 0;
        }
    }
    return vload16(0, flags);
}

#ifdef NEAR_CACHE
#define FETCH_LINE(map, at) __builtin_prefetch((const private void *)(uintptr_t)((map) + (at)))
#else
#define FETCH_LINE(map, at)
#endif
#ifdef GAIN_MAP
#define FETCH_GAIN(maps, at) FETCH_LINE((maps).gain, at)
#else
#define FETCH_GAIN(maps, at)
#endif
#ifdef DARK_MAP
#define FETCH_DARK(maps, at) FETCH_LINE((maps).dark, at)
#else
#define FETCH_DARK(maps, at)
#endif

/* Prefetches a row of the maps, whose row distance is too large for the hardware prefetcher. */
INLINE void fetch_maps(detector_maps maps, int row, int column, int columns) {
    size_t first = (size_t)row * MAP_STRIDE + column;
    for (int x = 0; x < columns; x += 16) {
        FETCH_GAIN(maps, first + x);
        FETCH_DARK(maps, first + x);
    }
}

/* frame: [window_height][window_width] digital numbers. saturated: pixels per tile. flags:
 * BST_FLAG_... of the frame, with the option FLAGS. */
__attribute__((reqd_work_group_size(GROUP, 1, 1))) kernel void bst_scene_frame(
    bst_kernel_frame_params p, global const bst_kernel_source_record *sources, global const float16 *table,
    global const float *block_box, global const float *source_box, global const float *group_box,
    global const float *light, global ushort *frame, global int *saturated,
    global const float *gain, global const float *dark, global const float *overlay,
    global const float *offsets, global const ushort *codes,
    global uchar *flags BACKGROUND_ARGUMENT) {
    local float sums[GROUP][(TILE_H + BST_SPARE_ROWS) * STRIDE] __attribute__((aligned(64)));
    int tile = (int)get_global_id(0);
    if (tile >= p.tiles_x * p.tiles_y) {
        return;
    }
    local float *sum = sums[get_local_id(0)];
    tile_place t = place_tile(p, tile);
#ifdef FOURIER
    load_tile(sum, p, t.left, t.top, light);
#else
    splat_tile(p, sum, t.x, t.y, sources, table, block_box, source_box, group_box, light);
#endif
    SHADE_TILE(sum, t.x, t.y);
    ADD_BACKGROUND(sum, p, t);
    uint steps[MOST_STEPS];
    dark_law unlit = dark_law_of(p, steps);
    near_law near = near_law_of(p);
    tail_block tails[TILE_W / 64];
    detector_maps maps = {gain, dark, overlay, offsets, codes};
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
            fetch_maps(maps, t.y + y + AHEAD, t.x, t.columns);
        }
        size_t first = (size_t)(p.first_row + t.top + y) * p.window_width;
        global ushort *row = frame + first;
        global uchar *marks = FLAGS_AT(flags, first);
        for (int x = 0; x < t.columns; x += 64) {
            local float16 *from = (local float16 *)(sum + y * STRIDE + x);
            chunk lights = {from[0], from[1], from[2], from[3]};
            int lit = any16((lights.a > 0.0f) | (lights.b > 0.0f) | (lights.c > 0.0f) |
                            (lights.d > 0.0f));
            chunk_flags brim;
            chunk dn = detect_chunk(p, maps, unlit, near, steps, &tails[x / 64], counter, t.y + y,
                                    t.x + x, lights, lit, &brim);
            int column = t.left + x;
            full_count -= store_dn(p, maps, dn.a, brim.a, column, row, marks);
            full_count -= store_dn(p, maps, dn.b, brim.b, column + 16, row, marks);
            full_count -= store_dn(p, maps, dn.c, brim.c, column + 32, row, marks);
            full_count -= store_dn(p, maps, dn.d, brim.d, column + 48, row, marks);
            counter += 16u;
        }
    }
    int8 a = full_count.lo + full_count.hi;
    int4 b = a.lo + a.hi;
    int2 c = b.lo + b.hi;
    saturated[p.first_tile + tile] = c.lo + c.hi;
}

/* image: [window_height][image_stride] expected electrons. */
__attribute__((reqd_work_group_size(GROUP, 1, 1))) kernel void bst_scene_expected(
    bst_kernel_frame_params p, global const bst_kernel_source_record *sources, global const float16 *table,
    global const float *block_box, global const float *source_box, global const float *group_box,
    global const float *light, global float *image BACKGROUND_ARGUMENT) {
    local float sums[GROUP][(TILE_H + BST_SPARE_ROWS) * STRIDE] __attribute__((aligned(64)));
    int tile = (int)get_global_id(0);
    if (tile >= p.tiles_x * p.tiles_y) {
        return;
    }
    local float *sum = sums[get_local_id(0)];
    tile_place t = place_tile(p, tile);
#ifdef FOURIER
    load_tile(sum, p, t.left, t.top, light);
#else
    splat_tile(p, sum, t.x, t.y, sources, table, block_box, source_box, group_box, light);
#endif
    SHADE_TILE(sum, t.x, t.y);
    ADD_BACKGROUND(sum, p, t);
    for (int y = 0; y < t.rows; y++) {
        global float *out = image + (size_t)(p.first_row + t.top + y) * p.image_stride;
        for (int x = max(0, -t.left); x < t.columns; x++) {
            out[t.left + x] = sum[y * STRIDE + x] + p.background_e;
        }
    }
}
