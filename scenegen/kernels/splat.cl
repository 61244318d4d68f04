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
/* Taps computed at once. */
#define OCTET 8
/* Nodes that share a pass over their rows, and the largest distance of their first rows. */
#define TEAM 4
#define SPREAD 12

/* Unaligned vectors: vstore16 becomes four stores on some devices. */
typedef float16 loose16 __attribute__((aligned(4)));
typedef float8 loose8 __attribute__((aligned(4)));

/* A block of nodes relative to one tile. Taps of node n along x, scaled by its electrons, follow
 * PAD zeros in row n; those along y are in column n. The first tap belongs to column left[n] and
 * row top[n]. Lanes of a team hold the bounds of its nodes' left and top, and whether it reaches
 * the tile. */
typedef struct splat_nodes {
    float x[BST_BLOCK][ROW], y[ROW][BST_BLOCK];
    int left[BST_BLOCK], top[BST_BLOCK];
    int left0[BST_BLOCK], left1[BST_BLOCK], top0[BST_BLOCK], top1[BST_BLOCK], near[BST_BLOCK];
    int taps; /* number of taps that may be non-zero */
} __attribute__((aligned(64))) splat_nodes;

INLINE float16 zip_low(float16 a, float16 b) {
    return (float16)(a.s0, b.s0, a.s1, b.s1, a.s2, b.s2, a.s3, b.s3, a.s4, b.s4, a.s5, b.s5, a.s6,
                     b.s6, a.s7, b.s7);
}

INLINE float16 zip_high(float16 a, float16 b) {
    return (float16)(a.s8, b.s8, a.s9, b.s9, a.sa, b.sa, a.sb, b.sb, a.sc, b.sc, a.sd, b.sd, a.se,
                     b.se, a.sf, b.sf);
}

#ifdef DEGREE
/* Taps by the profile law, for nodes as wide as the PSF or slightly wider (`wide`, by `more` PSF
 * variances). Taps at d and 1 - d pixels from the node's own are mirror images. */
INLINE void taps_by_law(float16 within, float16 more, int wide, float16 height, int radius,
                        global const float *law, float16 *taps) {
    float16 g = fma((float16)2.0f, within, (float16)-1.0f), g2 = g * g;
    for (int d = 1; d <= radius + 1; d++, law += LAW_FLOATS) {
        float16 even = powers(law, DEGREE + 1, 0, g2), odd = powers(law, DEGREE + 1, 1, g2);
        if (wide) {
            global const float *first = law + DEGREE + 1, *second = first + BST_LAW_FIRST;
            even = fma(more,
                       fma(more, powers(second, BST_LAW_SECOND, 0, g2),
                           powers(first, BST_LAW_FIRST, 0, g2)),
                       even);
            odd = fma(more,
                      fma(more, powers(second, BST_LAW_SECOND, 1, g2),
                          powers(first, BST_LAW_FIRST, 1, g2)),
                      odd);
        }
        odd *= g;
        taps[radius + d] = (even + odd) * height;
        taps[radius + 1 - d] = (even - odd) * height;
    }
}
#endif

/* Taps by erf at the pixel edges, for any width; scale: 1 / (sqrt(2) sigma), 1/px. */
INLINE void taps_by_edges(float16 within, float16 scale, float16 height, int radius,
                          float16 *taps) {
    height *= 0.5f;
    float16 before = error_function((-0.5f - (float)radius - within) * scale) * height;
    for (int k = 0; k < 2 * radius + 2; k++) {
        float16 edge = (float)(k - radius) + 0.5f - within;
        float16 after = error_function(edge * scale) * height;
        taps[k] = after - before;
        before = after;
    }
}

/* Stores the taps of two nodes. */
INLINE void store_pair(float16 taps, float *first) {
    *(loose8 *)first = taps.lo;
    *(loose8 *)(first + ROW) = taps.hi;
}

/* Transposes eight taps [tap][node] to rows of [node][ROW]. */
INLINE void store_octet(const float16 *t, float *row) {
    float16 a = zip_low(t[0], t[4]), b = zip_low(t[1], t[5]);
    float16 c = zip_low(t[2], t[6]), d = zip_low(t[3], t[7]);
    float16 even = zip_low(a, c), odd = zip_low(b, d);
    store_pair(zip_low(even, odd), row);
    store_pair(zip_high(even, odd), row + 2 * ROW);
    even = zip_high(a, c);
    odd = zip_high(b, d);
    store_pair(zip_low(even, odd), row + 4 * ROW);
    store_pair(zip_high(even, odd), row + 6 * ROW);
    a = zip_high(t[0], t[4]);
    b = zip_high(t[1], t[5]);
    c = zip_high(t[2], t[6]);
    d = zip_high(t[3], t[7]);
    even = zip_low(a, c);
    odd = zip_low(b, d);
    store_pair(zip_low(even, odd), row + 8 * ROW);
    store_pair(zip_high(even, odd), row + 10 * ROW);
    even = zip_high(a, c);
    odd = zip_high(b, d);
    store_pair(zip_low(even, odd), row + 12 * ROW);
    store_pair(zip_high(even, odd), row + 14 * ROW);
}

/* Profiles of a block's nodes along one axis: 2 radius + 2 taps, zero-padded to `octets`. within:
 * fraction from the node's pixel to the next; more: widening in PSF variances; height: total. */
INLINE void make_profiles(float16 within, float16 more, float16 height, int radius, int octets,
                          global const float *law, float16 *taps) {
#ifdef DEGREE
    if (!any_of(more > law[1])) {
        taps_by_law(within, more, any_of(more > 0.0f), height, radius, law + BST_LAW_HEAD, taps);
    } else
#endif
    {
        taps_by_edges(within, rsqrt(1.0f + more) * law[0], height, radius, taps);
    }
    for (int k = 2 * radius + 2; k < octets; k++) {
        taps[k] = (float16)0.0f;
    }
}

static void profiles_x(float16 within, float16 more, float16 height, int radius, int octets,
                       global const float *law, float *rows) {
    float16 taps[TAPS];
    make_profiles(within, more, height, radius, octets, law, taps);
    for (int k = 0; k < octets; k += OCTET) {
        store_octet(taps + k, rows + PAD + k);
    }
}

static void profiles_y(float16 within, float16 more, int radius, int octets,
                       global const float *law, float *columns) {
    make_profiles(within, more, (float16)1.0f, radius, octets, law, (float16 *)columns + PAD);
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
    const int rest = (1 << p.place_bits) - 1;
    int16 x = nodes.x >> p.place_bits, y = nodes.y >> p.place_bits;
    float16 within_x = convert_float16(nodes.x & rest) * p.per_parts;
    float16 within_y = convert_float16(nodes.y & rest) * p.per_parts;
    int taps = 2 * radius + 2, octets = (taps + OCTET - 1) / OCTET * OCTET;
    for (; b->taps > octets; b->taps -= OCTET) {
        for (int n = 0; n < BST_BLOCK; n++) {
            *(loose8 *)(b->x[n] + PAD + b->taps - OCTET) = (float8)0.0f;
        }
        for (int k = b->taps - OCTET; k < b->taps; k++) {
            *(float16 *)b->y[PAD + k] = (float16)0.0f;
        }
    }
    b->taps = octets;
    profiles_x(within_x, nodes.width, nodes.electrons, radius, octets, law, b->x[0]);
    profiles_y(within_y, nodes.width, radius, octets, law, b->y[0]);
    int16 left = x - (radius + tile_x), top = y - (radius + tile_y);
    int16 left0 = team_min(left), left1 = team_max(left);
    int16 top0 = team_min(top), top1 = team_max(top);
    *(int16 *)b->left = left;
    *(int16 *)b->top = top;
    *(int16 *)b->left0 = left0;
    *(int16 *)b->left1 = left1;
    *(int16 *)b->top0 = top0;
    *(int16 *)b->top1 = top1;
    *(int16 *)b->near = (left1 > -taps) & (left0 < TILE_W) & (top1 > -taps) & (top0 < TILE_H) &
                        (nodes.electrons > 0.0f);
}

/* Taps of node n along x on the tile vector that starts at `column`. */
INLINE float16 line_of(const splat_nodes *b, int n, int column, int taps) {
    return *(const loose16 *)(b->x[n] + PAD + clamp(column - b->left[n], -PAD, taps));
}

/* Taps of node n along y: tile row j at [j BST_BLOCK]. */
INLINE const float *column_of(const splat_nodes *b, int n) {
    return b->y[0] + (PAD - b->top[n]) * BST_BLOCK + n;
}

/* Adds nodes n to n + TEAM - 1, within SPREAD rows. Each row is loaded and stored once for all
 * nodes; a pixel still receives them in order, and zeros from nodes that do not reach it. */
static void splat_team(local float *sum, const splat_nodes *b, int n, int taps) {
    const float *h0 = column_of(b, n), *h1 = column_of(b, n + 1);
    const float *h2 = column_of(b, n + 2), *h3 = column_of(b, n + 3);
    int first = max(0, b->top0[n]), last = min(b->top1[n] + taps, TILE_H);
    int end = min(b->left1[n] + taps, TILE_W), column = max(b->left0[n], 0);
    for (; column + 16 < end; column += 32) {
        float16 l0 = line_of(b, n, column, taps), r0 = line_of(b, n, column + 16, taps);
        float16 l1 = line_of(b, n + 1, column, taps), r1 = line_of(b, n + 1, column + 16, taps);
        float16 l2 = line_of(b, n + 2, column, taps), r2 = line_of(b, n + 2, column + 16, taps);
        float16 l3 = line_of(b, n + 3, column, taps), r3 = line_of(b, n + 3, column + 16, taps);
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
    }
    if (column < end) {
        float16 l0 = line_of(b, n, column, taps), l1 = line_of(b, n + 1, column, taps);
        float16 l2 = line_of(b, n + 2, column, taps), l3 = line_of(b, n + 3, column, taps);
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
        if (b->near[n] && b->top1[n] - b->top0[n] <= SPREAD) {
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
        vstore16((float16)0.0f, 0, sum + i);
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
