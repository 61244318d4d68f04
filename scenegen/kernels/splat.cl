/* Light on one tile: sums the nodes' pixel-integrated profiles. Options: TILE_W, TILE_H (pixels),
 * TAPS (profile length, a multiple of 16), PHASES (sub-pixel phases of the profile table).
 *
 * Every pixel receives its nodes in the order of sources, blocks and nodes, whatever the tile, so
 * the float sum is the same for every window and work-group size. */

/* Rows of a tile are a vector apart, which keeps neighbouring rows out of one another's cache sets. */
#define STRIDE (TILE_W + 16)
#define HALF (TAPS / 2)
#define ROW (TAPS + 2 * BST_PROFILE_PAD)

/* For vectors at any place: vstore16 becomes four stores on some devices. */
typedef float16 loose16 __attribute__((aligned(4)));

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
    float16 a = vload16(0, row), b = vload16(0, row + ROW);
    a = fma((float16)t, b - a, a);
    if (wide) {
        row += (PHASES + 1) * ROW;
        float16 c = vload16(0, row), d = vload16(0, row + ROW);
        c = fma((float16)t, d - c, c);
        a = fma((float16)u, c - a, a);
    }
    return a;
}

/* Nodes that share a pass over their rows, and how many rows they may span together. */
#define TEAM 4
#define SPAN (TAPS + 16)

/* A block of nodes against one tile. */
typedef struct splat_nodes {
    int left[BST_BLOCK], top[BST_BLOCK]; /* first tap that counts, tile pixels */
    int row_x[BST_BLOCK], row_y[BST_BLOCK];
    float share_x[BST_BLOCK], share_y[BST_BLOCK], share_width[BST_BLOCK];
    int wide[BST_BLOCK];
    float electrons[BST_BLOCK];
} __attribute__((aligned(64))) splat_nodes;

/* Tap j of a profile whose centre is f pixels (0 <= f < 1) right of pixel n belongs to pixel
 * n + j - (HALF - 1). profiles: [BST_WIDTHS + 1][PHASES + 1][ROW], zeros before and after the taps. */
static void place_nodes(global const float *block, int tile_x, int tile_y, int radius,
                        splat_nodes *out) {
    const int rest = (1 << PLACE_BITS) - 1;
    const float phases = (float)PHASES / (float)(1 << PLACE_BITS);
    int16 x = as_int16(vload16(0, block)), y = as_int16(vload16(1, block));
    float16 width = vload16(3, block);
    *(int16 *)out->left = (x >> PLACE_BITS) - radius - tile_x;
    *(int16 *)out->top = (y >> PLACE_BITS) - radius - tile_y;
    float16 phase_x = convert_float16(x & rest) * phases;
    float16 phase_y = convert_float16(y & rest) * phases;
    int16 px = min(convert_int16(phase_x), PHASES - 1);
    int16 py = min(convert_int16(phase_y), PHASES - 1);
    int16 level = min(convert_int16(width), BST_WIDTHS - 1);
    int16 base = level * ((PHASES + 1) * ROW) + (BST_PROFILE_PAD + HALF - 1 - radius);
    *(int16 *)out->row_x = base + px * ROW;
    *(int16 *)out->row_y = base + py * ROW;
    *(float16 *)out->share_x = phase_x - convert_float16(px);
    *(float16 *)out->share_y = phase_y - convert_float16(py);
    *(float16 *)out->share_width = width - convert_float16(level);
    *(int16 *)out->wide = width > 0.0f;
    *(float16 *)out->electrons = vload16(2, block);
}

/* The taps of node n along x on the vector of the tile that begins at `column`. */
static float16 line_of(const splat_nodes *b, int n, int column, int taps,
                       global const float *profiles) {
    const int16 lanes = (int16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
    int shift = column - b->left[n];
    if (shift <= -16 || shift >= taps) {
        return (float16)0.0f;
    }
    int16 tap = shift + lanes;
    float16 line =
        profile16(profiles + b->row_x[n] + shift, b->share_x[n], b->share_width[n], b->wide[n]);
    return select((float16)0.0f, b->electrons[n] * line, (tap >= 0) & (tap < taps));
}

/* Adds nodes n to n + TEAM - 1. Each row is loaded and stored once for all of them; a pixel still
 * receives them one after the other, and a zero from those that do not reach it. Vectors of the tile
 * are touched where they lie, so that what one team has stored the next can load at once; taps are
 * shifted to meet them. */
static void splat_team(local float *sum, const splat_nodes *b, int n, int taps, int top, int bottom,
                       int left, int right, global const float *profiles) {
    float16 vectors[TEAM][SPAN / 16 + 1];
    for (int k = 0; k < TEAM; k++) {
        for (int j = 0; j < SPAN / 16 + 1; j++) {
            vectors[k][j] = (float16)0.0f;
        }
        float *height = (float *)vectors[k] + (b->top[n + k] - top);
        for (int j = 0; j < taps; j += 16) {
            float16 h = profile16(profiles + b->row_y[n + k] + j, b->share_y[n + k],
                                  b->share_width[n + k], b->wide[n + k]);
            if (j + 16 <= taps) {
                *(loose16 *)(height + j) = h;
            } else { /* only the taps that count */
                const int16 lanes = (int16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
                *(loose16 *)(height + j) = select((float16)0.0f, h, lanes < taps - j);
            }
        }
    }
    const float *h0 = (const float *)vectors[0], *h1 = (const float *)vectors[1];
    const float *h2 = (const float *)vectors[2], *h3 = (const float *)vectors[3];
    int first = max(0, -top), last = min(bottom, TILE_H) - top, end = min(right, TILE_W);
    for (int column = max(left & ~15, 0); column < end; column += 16) {
        float16 l0 = line_of(b, n, column, taps, profiles);
        float16 l1 = line_of(b, n + 1, column, taps, profiles);
        float16 l2 = line_of(b, n + 2, column, taps, profiles);
        float16 l3 = line_of(b, n + 3, column, taps, profiles);
        local float16 *target = (local float16 *)(sum + (top + first) * STRIDE + column);
        for (int j = first; j < last; j++) {
            float16 v = *target;
            v = fma((float16)h0[j], l0, v);
            v = fma((float16)h1[j], l1, v);
            v = fma((float16)h2[j], l2, v);
            *target = fma((float16)h3[j], l3, v);
            target += STRIDE / 16;
        }
    }
}

static void splat_block(local float *sum, int tile_x, int tile_y, int radius,
                        global const float *block, global const float *profiles) {
    splat_nodes b;
    int taps = 2 * radius + 2;
    place_nodes(block, tile_x, tile_y, radius, &b);
    for (int n = 0; n < BST_BLOCK && b.electrons[n] > 0.0f; n += TEAM) {
        int top = b.top[n], bottom = top, left = b.left[n], right = left;
        for (int k = 1; k < TEAM; k++) {
            top = min(top, b.top[n + k]);
            bottom = max(bottom, b.top[n + k]);
            left = min(left, b.left[n + k]);
            right = max(right, b.left[n + k]);
        }
        if (bottom - top <= SPAN - TAPS) {
            bottom += taps;
            right += taps;
            if (bottom > 0 && top < TILE_H && right > 0 && left < TILE_W) {
                splat_team(sum, &b, n, taps, top, bottom, left, right, profiles);
            }
            continue;
        }
        for (int k = 0; k < TEAM; k++) { /* too far apart: one by one, the others dark */
            splat_nodes one = b;
            for (int m = 0; m < TEAM; m++) {
                one.top[n + m] = b.top[n + k];
                one.left[n + m] = b.left[n + k];
                one.electrons[n + m] = m == k ? b.electrons[n + k] : 0.0f;
            }
            top = b.top[n + k];
            left = b.left[n + k];
            if (top + taps > 0 && top < TILE_H && left + taps > 0 && left < TILE_W) {
                splat_team(sum, &one, n, taps, top, top + taps, left, left + taps, profiles);
            }
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
        if (box.x <= x1 && box.z >= x0 && box.y <= y1 && box.w >= y0) {
            splat_block(sum, tile_x, tile_y, s.radius, nodes + BST_NODE_ROWS * BST_BLOCK * b,
                        profiles);
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
