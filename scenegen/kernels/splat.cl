/* Light of one tile from stamps: generates the nodes of the sources that touch the tile (nodes.cl)
 * and sums their pixel-integrated profiles. Options: TILE_W, TILE_H (pixels), TAPS (of the longest
 * profile, a multiple of 16), DEGREE (profiles.cl). `law` is the buffer of
 * scenegen/stamp/profile_law.h.
 *
 * Every pixel receives its nodes in the order of sources, blocks and nodes, whatever the tile. The
 * float sum is therefore the same for every window and work-group size. */

/* Tile rows are padded by one vector to avoid cache-set conflicts. */
#define STRIDE (TILE_W + 16)
/* Zero padding on either side of a profile, so that a vector may start anywhere near it. */
#define PAD 16
#define ROW (TAPS + 2 * PAD)
/* Taps stored at once. */
#define QUAD 4
/* Nodes that share a pass over their rows, and the largest distance of their first rows. */
#define TEAM 4
#define SPREAD 12

/* Unaligned vectors: vstore16 becomes four stores on some devices. */
typedef float16 loose16 __attribute__((aligned(4)));
typedef float4 loose4 __attribute__((aligned(4)));

/* A block of nodes relative to one tile. Taps of node n along x, scaled by its electrons, follow
 * PAD zeros in row n; those along y are in column n. The first tap belongs to column left[n] and
 * row top[n]. from: element of x, on the first column of the node's team; row: element of y, on the
 * tile's first row. Lanes of a team hold its first column and row on the tile and those behind its
 * last, and `near`: 0 if it does not reach the tile, 2 if its nodes are close enough to each other
 * to share a pass, else 1. */
typedef struct splat_nodes {
    float x[BST_BLOCK][ROW], y[ROW][BST_BLOCK];
    int left[BST_BLOCK], top[BST_BLOCK];
    int from[BST_BLOCK], row[BST_BLOCK];
    int column[BST_BLOCK], end[BST_BLOCK], first[BST_BLOCK], last[BST_BLOCK], near[BST_BLOCK];
    int taps; /* number of taps that may be non-zero */
} __attribute__((aligned(64))) splat_nodes;

#ifdef DEGREE
/* Taps along both axes by the profile law, for nodes as wide as the PSF or slightly wider (`wide`,
 * by `more` PSF variances). Taps at d and 1 - d pixels from the node's own are mirror images. */
INLINE void taps_by_law(float8 x, float8 y, float8 more, int wide, float8 height, int radius,
                        global const float *law, float8 *along, float *columns) {
    float8 g = fma((float8)2.0f, x, (float8)-1.0f), h = fma((float8)2.0f, y, (float8)-1.0f);
    float8 g2 = g * g, h2 = h * h;
    for (int d = 1; d <= radius + 1; d++, law += LAW_FLOATS) {
        float8 even = law_power(law, LAW_POWERS - 2, more, wide), even_y = even;
        float8 odd = law_power(law, LAW_POWERS - 1, more, wide), odd_y = odd;
#pragma unroll
        for (int q = LAW_POWERS - 4; q >= 0; q -= 2) {
            float8 c = law_power(law, q, more, wide);
            even = fma(even, g2, c);
            even_y = fma(even_y, h2, c);
            c = law_power(law, q + 1, more, wide);
            odd = fma(odd, g2, c);
            odd_y = fma(odd_y, h2, c);
        }
        odd *= g;
        odd_y *= h;
        along[radius + d] = (even + odd) * height;
        along[radius + 1 - d] = (even - odd) * height;
        *(float8 *)(columns + (radius + d) * BST_BLOCK) = even_y + odd_y;
        *(float8 *)(columns + (radius + 1 - d) * BST_BLOCK) = even_y - odd_y;
    }
}
#endif

/* Taps by erf at the pixel edges, for any width, `step` vectors apart; scale: 1 / (sqrt(2) sigma),
 * 1/px. */
INLINE void taps_by_edges(float8 within, float8 scale, float8 height, int radius, float8 *taps,
                          int step) {
    height *= 0.5f;
    float8 before = error_function((-0.5f - (float)radius - within) * scale) * height;
    for (int k = 0; k < 2 * radius + 2; k++) {
        float8 edge = (float)(k - radius) + 0.5f - within;
        float8 after = error_function(edge * scale) * height;
        taps[k * step] = after - before;
        before = after;
    }
}

/* Taps of a profile, with zeros up to a multiple of QUAD. */
INLINE int taps_stored(int radius) {
    return (2 * radius + 2 + QUAD - 1) / QUAD * QUAD;
}

/* Transposes four taps of eight nodes, t[tap][node], to rows of [node][ROW]. Elements move within
 * the halves of a vector, so that each step is one instruction of AVX. */
INLINE void store_quad(float8 t0, float8 t1, float8 t2, float8 t3, float *row) {
    float8 a = (float8)(t0.s0, t1.s0, t0.s1, t1.s1, t0.s4, t1.s4, t0.s5, t1.s5);
    float8 b = (float8)(t0.s2, t1.s2, t0.s3, t1.s3, t0.s6, t1.s6, t0.s7, t1.s7);
    float8 c = (float8)(t2.s0, t3.s0, t2.s1, t3.s1, t2.s4, t3.s4, t2.s5, t3.s5);
    float8 d = (float8)(t2.s2, t3.s2, t2.s3, t3.s3, t2.s6, t3.s6, t2.s7, t3.s7);
    float8 n0 = (float8)(a.s01, c.s01, a.s45, c.s45), n1 = (float8)(a.s23, c.s23, a.s67, c.s67);
    float8 n2 = (float8)(b.s01, d.s01, b.s45, d.s45), n3 = (float8)(b.s23, d.s23, b.s67, d.s67);
    *(loose4 *)row = n0.lo;
    *(loose4 *)(row + ROW) = n1.lo;
    *(loose4 *)(row + 2 * ROW) = n2.lo;
    *(loose4 *)(row + 3 * ROW) = n3.lo;
    *(loose4 *)(row + 4 * ROW) = n0.hi;
    *(loose4 *)(row + 5 * ROW) = n1.hi;
    *(loose4 *)(row + 6 * ROW) = n2.hi;
    *(loose4 *)(row + 7 * ROW) = n3.hi;
}

/* Profiles of eight nodes along both axes: 2 radius + 2 taps, zero-padded to a multiple of QUAD, in
 * rows[node][ROW] and columns[tap][BST_BLOCK]. x, y: fractions from the node's pixel to the next;
 * more: widening in PSF variances; wide: 0 (it is 0 for all nodes of the block), 1 (within the
 * law's limit) or 2; height: total along x. */
INLINE void make_profiles(float8 x, float8 y, float8 more, int wide, float8 height, int radius,
                          global const float *law, float *rows, float *columns) {
    int quads = taps_stored(radius);
    float8 along[TAPS];
#ifdef DEGREE
    if (wide == 0) {
        taps_by_law(x, y, more, 0, height, radius, law + BST_LAW_HEAD, along, columns);
    } else if (wide == 1) {
        taps_by_law(x, y, more, 1, height, radius, law + BST_LAW_HEAD, along, columns);
    } else
#endif
    {
        float8 scale = rsqrt(1.0f + more) * law[0];
        taps_by_edges(x, scale, height, radius, along, 1);
        taps_by_edges(y, scale, (float8)1.0f, radius, (float8 *)columns, BST_BLOCK / 8);
    }
    for (int k = 2 * radius + 2; k < quads; k++) {
        along[k] = (float8)0.0f;
        *(float8 *)(columns + k * BST_BLOCK) = (float8)0.0f;
    }
    for (int k = 0; k < quads; k += QUAD) {
        store_quad(along[k], along[k + 1], along[k + 2], along[k + 3], rows + k);
    }
}

INLINE int16 team_min(int16 v) {
    v = min(v, v.s1032547698badcfe);
    return min(v, v.s23016745ab89efcd);
}

INLINE int16 team_max(int16 v) {
    v = max(v, v.s1032547698badcfe);
    return max(v, v.s23016745ab89efcd);
}

static void place_nodes(bst_kernel_node_params p, node_block nodes, int tile_x, int tile_y,
                        int radius, global const float *law, splat_nodes *b) {
    const int16 lane = (int16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
    const int rest = (1 << p.place_bits) - 1;
    int16 x = nodes.x >> p.place_bits, y = nodes.y >> p.place_bits;
    float16 within_x = convert_float16(nodes.x & rest) * p.per_parts;
    float16 within_y = convert_float16(nodes.y & rest) * p.per_parts;
    int taps = 2 * radius + 2, quads = taps_stored(radius);
    for (; b->taps > quads; b->taps -= QUAD) {
        for (int n = 0; n < BST_BLOCK; n++) {
            *(loose4 *)(b->x[n] + PAD + b->taps - QUAD) = (float4)0.0f;
        }
        for (int k = b->taps - QUAD; k < b->taps; k++) {
            *(float16 *)b->y[PAD + k] = (float16)0.0f;
        }
    }
    b->taps = quads;
    int wide = any_of(nodes.width > 0.0f);
#ifdef DEGREE
    wide += any_of(nodes.width > law[1]);
#endif
    make_profiles(within_x.lo, within_y.lo, nodes.width.lo, wide, nodes.electrons.lo, radius, law,
                  b->x[0] + PAD, b->y[PAD]);
    if (nodes.electrons.s8 > 0.0f || nodes.electrons.sc > 0.0f) { /* else no team of it is near */
        make_profiles(within_x.hi, within_y.hi, nodes.width.hi, wide, nodes.electrons.hi, radius,
                      law, b->x[8] + PAD, b->y[PAD] + 8);
    }
    int16 left = x - (radius + tile_x), top = y - (radius + tile_y);
    int16 left0 = team_min(left), left1 = team_max(left);
    int16 top0 = team_min(top), top1 = team_max(top);
    *(int16 *)b->left = left;
    *(int16 *)b->top = top;
    int16 column = max(left0, 0);
    int16 near = (left1 > -taps) & (left0 < TILE_W) & (top1 > -taps) & (top0 < TILE_H) &
                 (nodes.electrons > 0.0f);
    *(int16 *)b->from = lane * ROW + PAD + clamp(column - left, -PAD, taps);
    *(int16 *)b->row = (PAD - top) * BST_BLOCK + lane;
    *(int16 *)b->column = column;
    *(int16 *)b->end = min(left1 + taps, TILE_W);
    *(int16 *)b->first = max(top0, 0);
    *(int16 *)b->last = min(top1 + taps, TILE_H);
    *(int16 *)b->near = near & (1 - (top1 - top0 <= SPREAD));
}

/* Taps of node n along x on the tile vector that starts at `column`. */
INLINE float16 line_of(const splat_nodes *b, int n, int column, int taps) {
    return *(const loose16 *)(b->x[n] + PAD + clamp(column - b->left[n], -PAD, taps));
}

/* The same for the first vector of the node's team. */
INLINE float16 first_line(const splat_nodes *b, int n) {
    return *(const loose16 *)(b->x[0] + b->from[n]);
}

/* Taps of node n along y: tile row j at [j BST_BLOCK]. */
INLINE const float *column_of(const splat_nodes *b, int n) {
    return b->y[0] + (PAD - b->top[n]) * BST_BLOCK + n;
}

/* Adds nodes n to n + TEAM - 1, within SPREAD rows. Each row is loaded and stored once for all
 * nodes; a pixel still receives them in order, and zeros from nodes that do not reach it. */
static void splat_team(local float *sum, const splat_nodes *b, int n, int taps) {
    const float *h0 = b->y[0] + b->row[n], *h1 = b->y[0] + b->row[n + 1];
    const float *h2 = b->y[0] + b->row[n + 2], *h3 = b->y[0] + b->row[n + 3];
    int first = b->first[n], last = b->last[n], column = b->column[n], end = b->end[n];
    float16 l0 = first_line(b, n), l1 = first_line(b, n + 1);
    float16 l2 = first_line(b, n + 2), l3 = first_line(b, n + 3);
    for (; column + 16 < end; column += 32) {
        float16 r0 = line_of(b, n, column + 16, taps), r1 = line_of(b, n + 1, column + 16, taps);
        float16 r2 = line_of(b, n + 2, column + 16, taps);
        float16 r3 = line_of(b, n + 3, column + 16, taps);
        local float *target = sum + first * STRIDE + column;
        for (int j = first; j < last; j += BST_STAMP_RUN) {
            for (int k = j; k < j + BST_STAMP_RUN; k++) {
                float16 f0 = (float16)h0[k * BST_BLOCK], f1 = (float16)h1[k * BST_BLOCK];
                float16 f2 = (float16)h2[k * BST_BLOCK], f3 = (float16)h3[k * BST_BLOCK];
                float16 t = *(local loose16 *)target, u = *(local loose16 *)(target + 16);
                *(local loose16 *)target = fma(f3, l3, fma(f2, l2, fma(f1, l1, fma(f0, l0, t))));
                *(local loose16 *)(target + 16) =
                    fma(f3, r3, fma(f2, r2, fma(f1, r1, fma(f0, r0, u))));
                target += STRIDE;
            }
        }
        l0 = line_of(b, n, column + 32, taps);
        l1 = line_of(b, n + 1, column + 32, taps);
        l2 = line_of(b, n + 2, column + 32, taps);
        l3 = line_of(b, n + 3, column + 32, taps);
    }
    if (column < end) {
        local float *target = sum + first * STRIDE + column;
        for (int j = first; j < last; j += BST_STAMP_RUN) {
            for (int k = j; k < j + BST_STAMP_RUN; k++) {
                float16 v = fma((float16)h1[k * BST_BLOCK], l1,
                                fma((float16)h0[k * BST_BLOCK], l0, *(local loose16 *)target));
                *(local loose16 *)target =
                    fma((float16)h3[k * BST_BLOCK], l3, fma((float16)h2[k * BST_BLOCK], l2, v));
                target += STRIDE;
            }
        }
    }
}

/* Adds one node over its own rows. */
static void splat_node(local float *sum, const splat_nodes *b, int n, int taps) {
    const float *h = column_of(b, n);
    int first = max(0, b->top[n]), last = min(b->top[n] + taps, TILE_H);
    int end = min(b->left[n] + taps, TILE_W);
    for (int column = max(b->left[n] & ~15, 0); column < end; column += 16) {
        float16 line = line_of(b, n, column, taps);
        for (int j = first; j < last; j++) {
            local float16 *target = (local float16 *)(sum + j * STRIDE + column);
            *target = fma((float16)h[j * BST_BLOCK], line, *target);
        }
    }
}

/* Adds a block of nodes. */
static void splat_block(local float *sum, const splat_nodes *b, int taps) {
    for (int n = 0; n < BST_BLOCK; n += TEAM) {
        if (b->near[n] > 1) {
            splat_team(sum, b, n, taps);
        } else if (b->near[n]) {
            for (int m = n; m < n + TEAM; m++) {
                splat_node(sum, b, m, taps);
            }
        }
    }
}

/* Light of a tile in electrons. sum: [TILE_H + BST_SPARE_ROWS][STRIDE]. tile_x, tile_y: its first
 * pixel on the full sensor. */
static void splat_tile(bst_kernel_frame_params p, local float *sum, int tile_x, int tile_y,
                       global const bst_kernel_source_record *sources, global const float16 *table,
                       global const float *block_box, global const float *source_box,
                       global const float *group_box, global const float *law) {
    splat_nodes b;
    for (int i = 0; i < TILE_H * STRIDE; i += 16) {
        *(local float16 *)(sum + i) = (float16)0.0f;
    }
    for (int n = 0; n < BST_BLOCK; n++) {
        for (int i = 0; i < ROW; i += 16) {
            *(float16 *)(b.x[n] + i) = (float16)0.0f;
        }
    }
    for (int k = 0; k < ROW; k++) {
        *(float16 *)b.y[k] = (float16)0.0f;
    }
    b.taps = 0;
    float4 tile = (float4)((float)tile_x, (float)tile_y, (float)(tile_x + TILE_W - 1),
                           (float)(tile_y + TILE_H - 1));
    block_search search = begin_search(tile, p.source_groups, group_box);
    for (;;) {
        int block = next_block(&search, sources, block_box, source_box, group_box);
        if (block < 0) {
            break;
        }
        int radius = search.source.radius;
        place_nodes(p.nodes, nodes_of(p.nodes, search.source, block, table), tile_x, tile_y, radius,
                    law, &b);
        splat_block(sum, &b, 2 * radius + 2);
    }
}
