/* Light on one tile: sums the nodes' pixel-integrated profiles. Options: TILE_W, TILE_H (pixels),
 * TAPS (profile length, a multiple of 16), PHASES (sub-pixel phases of the profile table).
 *
 * Every pixel receives its nodes in the order of sources, blocks and nodes, whatever the tile, so
 * the float sum is the same for every window and work-group size. */

#define PAD 16 /* a vector may reach beyond the tile on either side; what lies there is dropped */
#define STRIDE (TILE_W + 2 * PAD)
#define HALF (TAPS / 2)

/* any(), by halves: some compilers test lane after lane. */
static int any16(int16 v) {
    int8 a = v.lo | v.hi;
    int4 b = a.lo | a.hi;
    int2 c = b.lo | b.hi;
    return (c.lo | c.hi) < 0;
}

/* Sixteen taps at `row`, between its phase and the next (t) and, when widened, between its width and
 * the next (u). */
static float16 profile16(global const float *row, float t, float u, int wide) {
    float16 a = vload16(0, row), b = vload16(0, row + TAPS);
    a = fma((float16)t, b - a, a);
    if (wide) {
        row += (PHASES + 1) * TAPS;
        float16 c = vload16(0, row), d = vload16(0, row + TAPS);
        c = fma((float16)t, d - c, c);
        a = fma((float16)u, c - a, a);
    }
    return a;
}

/* Tap j of a profile whose centre is f pixels (0 <= f < 1) right of pixel n belongs to pixel
 * n + j - (HALF - 1). profiles: [BST_WIDTHS + 1][PHASES + 1][TAPS]. */
static void splat_node(local float *sum, int tile_x, int tile_y, float x, float y, float electrons,
                       float width, int radius, int chunks, global const float *profiles) {
    float floor_x = floor(x), floor_y = floor(y);
    int ix = (int)floor_x - (HALF - 1) - tile_x; /* tile column of tap 0 */
    int iy = (int)floor_y - (HALF - 1) - tile_y;
    int first = max(HALF - 1 - radius, -iy);
    int last = min(HALF + radius, TILE_H - 1 - iy);
    if (first > last) {
        return;
    }
    float phase_x = (x - floor_x) * PHASES, phase_y = (y - floor_y) * PHASES;
    int px = min((int)phase_x, PHASES - 1), py = min((int)phase_y, PHASES - 1);
    float tx = phase_x - (float)px, ty = phase_y - (float)py;
    int wide = width > 0.0f, level = min((int)width, BST_WIDTHS - 1);
    float u = width - (float)level;
    profiles += level * (PHASES + 1) * TAPS;
    int start = HALF - 8 * chunks;
    float heights[TAPS];
    for (int c = 0; c < chunks; c++) {
        vstore16(profile16(profiles + py * TAPS + start + 16 * c, ty, u, wide), c, heights);
    }
    for (int c = 0; c < chunks; c++) {
        int column = ix + start + 16 * c;
        if (column <= -16 || column >= TILE_W) {
            continue;
        }
        float16 line =
            electrons * profile16(profiles + px * TAPS + start + 16 * c, tx, u, wide);
        local float *target = sum + (iy + first) * STRIDE + PAD + column;
        for (int j = first - start; j <= last - start; j++) {
            vstore16(fma((float16)heights[j], line, vload16(0, target)), 0, target);
            target += STRIDE;
        }
    }
}

static void splat_source(local float *sum, int tile_x, int tile_y, bst_scene_source s,
                         global const float *nodes, global const float4 *block_box,
                         global const float *profiles) {
    float x0 = (float)tile_x, x1 = (float)(tile_x + TILE_W - 1);
    float y0 = (float)tile_y, y1 = (float)(tile_y + TILE_H - 1);
    for (int b = s.first_block; b < s.first_block + s.blocks; b++) {
        float4 box = block_box[b];
        if (box.x > x1 || box.z < x0 || box.y > y1 || box.w < y0) {
            continue;
        }
        global const float *block = nodes + BST_NODE_ROWS * BST_BLOCK * b;
        for (int n = 0; n < BST_BLOCK; n++) {
            float electrons = block[2 * BST_BLOCK + n];
            if (electrons > 0.0f) {
                splat_node(sum, tile_x, tile_y, block[n], block[BST_BLOCK + n], electrons,
                           block[3 * BST_BLOCK + n], s.radius, s.chunks, profiles);
            }
        }
    }
}

/* sum: [TILE_H][STRIDE], the tile's light in electrons. tile_x, tile_y: its first pixel on the full
 * sensor. */
static void splat_tile(local float *sum, int tile_x, int tile_y, int source_groups,
                       global const bst_scene_source *sources, global const float *nodes,
                       global const float4 *block_box, global const float *source_box,
                       global const float *profiles) {
    for (int i = 0; i < TILE_H * STRIDE; i += 16) {
        vstore16((float16)0.0f, 0, sum + i);
    }
    float x0 = (float)tile_x, x1 = (float)(tile_x + TILE_W - 1);
    float y0 = (float)tile_y, y1 = (float)(tile_y + TILE_H - 1);
    for (int g = 0; g < source_groups; g++) {
        global const float *box = source_box + g * 4 * BST_BLOCK;
        int16 hit = (vload16(0, box) <= x1) & (vload16(1, box) <= y1) & (vload16(2, box) >= x0) &
                    (vload16(3, box) >= y0);
        if (!any16(hit)) {
            continue;
        }
        int hits[BST_BLOCK];
        vstore16(hit, 0, hits);
        for (int i = 0; i < BST_BLOCK; i++) {
            if (hits[i]) {
                splat_source(sum, tile_x, tile_y, sources[g * BST_BLOCK + i], nodes, block_box,
                             profiles);
            }
        }
    }
}
