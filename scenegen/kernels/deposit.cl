/* Deposits the light of all nodes on the grid of the Fourier path: each node is spread over eight
 * by eight samples. Options: DEPOSIT_W, DEPOSIT_H (samples of a tile, a multiple of 16 high),
 * DEPOSIT_GROUP (work-items per work-group), FOURIER (see nodes.cl), NEAR_CACHE (one address space;
 * writes can bypass the caches).
 *
 * One work-item owns a tile and adds its nodes in the order of sources, blocks and nodes: the sum
 * is the same for every tile and work-group size. Vectors run along y, as in the grid's blocks of
 * sixteen rows. */

/* Tile columns are padded by one vector to avoid cache-set conflicts. */
#define DEPOSIT_STRIDE (DEPOSIT_H + 16)
/* Nodes processed in one pass over their columns, and the most columns that they may span. */
#define DEPOSIT_TEAM 4
#define DEPOSIT_SPAN 24
#define DEPOSIT_ROOM 40

#ifdef NEAR_CACHE
#define STREAM(value, p) __builtin_nontemporal_store(value, p)
#else
#define STREAM(value, p) (*(p) = (value))
#endif

/* Bilinear weight of the field node at a position. */
static float field_weight(bst_deposit_params p, global const float *field, float x, float y) {
    float u = clamp(x * p.field_per_px_x, 0.0f, (float)(p.field_x - 1));
    float v = clamp(y * p.field_per_px_y, 0.0f, (float)(p.field_y - 1));
    int i = min((int)u, p.field_x - 2), j = min((int)v, p.field_y - 2);
    global const float *a = field + j * p.field_x + i;
    float low = mix(a[0], a[1], u - (float)i);
    float high = mix(a[p.field_x], a[p.field_x + 1], u - (float)i);
    return mix(low, high, v - (float)j);
}

/* A block of nodes relative to one tile. */
typedef struct deposit_nodes {
    int hit[BST_BLOCK];
    int left[BST_BLOCK], top[BST_BLOCK];    /* first tap, from the tile's corner */
    int row_x[BST_BLOCK], row_y[BST_BLOCK]; /* row indices in the spreading table */
    float share_x[BST_BLOCK], share_y[BST_BLOCK], share_width[BST_BLOCK];
    float electrons[BST_BLOCK];
    int wide; /* some nodes are widened */
} deposit_nodes;

/* Spreading profiles of a team of nodes, zero-padded: taps start at 16. */
typedef struct deposit_profiles {
    float x[DEPOSIT_TEAM][DEPOSIT_ROOM], y[DEPOSIT_TEAM][DEPOSIT_ROOM];
} deposit_profiles;

/* Taps at `row` of the table, interpolated to the next phase (t) and, if nodes of the block are
 * widened, to the next width (u). */
static float8 spread8(global const float *row, float t, float u, int wide) {
    float8 a = vload8(0, row), b = vload8(1, row);
    a = fma((float8)t, b - a, a);
    if (wide) {
        row += (BST_SPREAD_PHASES + 1) * BST_SPREAD_TAPS;
        float8 c = vload8(0, row), d = vload8(1, row);
        c = fma((float8)t, d - c, c);
        a = fma((float8)u, c - a, a);
    }
    return a;
}

/* Taps of one node along y on the tile vector that starts `shift` after its first tap. */
static float16 spread_line(const float *profile, int shift) {
    if (shift <= -16 || shift >= BST_SPREAD_TAPS) {
        return (float16)0.0f;
    }
    return vload16(0, profile + 16 + shift);
}

/* Adds nodes n to n + count - 1 (at most DEPOSIT_TEAM, the others are skipped), which together span
 * at most DEPOSIT_SPAN columns from `left`. Each vector is loaded and stored once for all nodes; a
 * sample still receives them in order, and zeros from nodes that do not reach it. Vectors are
 * aligned with the tile, so that one team's stores can be loaded by the next at once. */
static void deposit_team(local float *sum, const deposit_nodes *b, int n, int count, int top,
                         int bottom, int left, int right, global const float *table,
                         deposit_profiles *room) {
    int shift[DEPOSIT_TEAM], over[DEPOSIT_TEAM];
    for (int k = 0; k < DEPOSIT_TEAM; k++) {
        int i = n + min(k, count - 1);
        float electrons = k < count ? b->electrons[i] : 0.0f;
        float u = b->share_width[i];
        vstore8(spread8(table + b->row_x[i], b->share_x[i], u, b->wide), 0, room->x[k] + 16);
        vstore8(electrons * spread8(table + BST_SPREAD_TABLE + b->row_y[i], b->share_y[i], u, b->wide), 0,
                room->y[k] + 16);
        shift[k] = b->top[i];
        over[k] = 16 - (b->left[i] - left);
    }
    const float *h0 = room->x[0] + over[0], *h1 = room->x[1] + over[1];
    const float *h2 = room->x[2] + over[2], *h3 = room->x[3] + over[3];
    int first = max(0, -left), last = min(right, DEPOSIT_W) - left, end = min(bottom, DEPOSIT_H);
    for (int row = max(top & ~15, 0); row < end; row += 16) {
        float16 l0 = spread_line(room->y[0], row - shift[0]);
        float16 l1 = spread_line(room->y[1], row - shift[1]);
        float16 l2 = spread_line(room->y[2], row - shift[2]);
        float16 l3 = spread_line(room->y[3], row - shift[3]);
        local float16 *target = (local float16 *)(sum + (left + first) * DEPOSIT_STRIDE + row);
        for (int j = first; j < last; j++) {
            float16 v = *target;
            v = fma((float16)h0[j], l0, v);
            v = fma((float16)h1[j], l1, v);
            v = fma((float16)h2[j], l2, v);
            *target = fma((float16)h3[j], l3, v);
            target += DEPOSIT_STRIDE / 16;
        }
    }
}

/* Samples from the grid's first one to positions on the sensor, along one axis: whole ones, and
 * *part in [0, 1). A single-precision position would be rounded by up to 1e-4 px on 2048 px: 0.04
 * sigma of a star of 40,000 e- per pixel. Whole pixels times the coarse part of the density are
 * exact (bst_deposit_params). */
static float16 samples_to(int16 position, bst_kernel_node_params n, float first_px, float coarse,
                          float finer, float16 *part) {
    int16 whole = position >> n.place_bits;
    float16 within = convert_float16(position - (whole << n.place_bits)) * n.per_parts;
    float16 px = convert_float16(whole) - first_px, near = px * coarse, before = floor(near);
    float16 rest = fma(within, (float16)(coarse + finer), (near - before) + px * finer);
    float16 more = floor(rest);
    *part = rest - more;
    return before + more;
}

/* Positions one block's nodes on the grid; returns true if any of them reaches the tile. */
static int place_nodes(bst_deposit_params p, int tile_x, int tile_y, node_block nodes,
                       global const float *field, deposit_nodes *out) {
    float16 part_u, part_v;
    float16 floor_u = samples_to(nodes.x, p.nodes, p.x0, p.coarse_x, p.finer_x, &part_u);
    float16 floor_v = samples_to(nodes.y, p.nodes, p.y0, p.coarse_y, p.finer_y, &part_v);
    const float before = BST_SPREAD_TAPS / 2 - 1, after = BST_SPREAD_TAPS / 2;
    float16 column = floor_u - (before + (float)tile_x), row = floor_v - (before + (float)tile_y);
    float16 electrons = nodes.electrons, width = nodes.width;
    int16 lit = p.by_spectrum ? electrons != 0.0f : electrons > 0.0f; /* weights may be negative */
    int16 hit = lit & (column > (float)-BST_SPREAD_TAPS) &
                (column < (float)DEPOSIT_W) & (row > (float)-BST_SPREAD_TAPS) &
                (row < (float)DEPOSIT_H) &
                /* light outside the grid would wrap around */
                (floor_u >= before) & (floor_v >= before) & (floor_u < (float)p.samples_x - after) &
                (floor_v < (float)p.samples_y - after);
    if (!any_of(hit)) {
        return 0;
    }
    float16 phase_u = part_u * BST_SPREAD_PHASES, phase_v = part_v * BST_SPREAD_PHASES;
    float16 step_u = fmin(floor(phase_u), BST_SPREAD_PHASES - 1.0f);
    float16 step_v = fmin(floor(phase_v), BST_SPREAD_PHASES - 1.0f);
    float16 level = fmin(floor(width), BST_WIDTHS - 1.0f);
    float16 base = level * (float)(BST_SPREAD_PHASES + 1);
    if (p.by_field) {
        const float px = p.nodes.per_parts;
        float at_x[16], at_y[16], e[16];
        vstore16(convert_float16(nodes.x) * px, 0, at_x);
        vstore16(convert_float16(nodes.y) * px, 0, at_y);
        for (int n = 0; n < BST_BLOCK; n++) {
            e[n] = field_weight(p, field, at_x[n], at_y[n]);
        }
        electrons *= vload16(0, e);
    }
    vstore16(hit, 0, out->hit);
    vstore16(convert_int16(column), 0, out->left);
    vstore16(convert_int16(row), 0, out->top);
    vstore16(convert_int16(base + step_u) * BST_SPREAD_TAPS, 0, out->row_x);
    vstore16(convert_int16(base + step_v) * BST_SPREAD_TAPS, 0, out->row_y);
    vstore16(phase_u - step_u, 0, out->share_x);
    vstore16(phase_v - step_v, 0, out->share_y);
    vstore16(width - level, 0, out->share_width);
    out->wide = any_of(width > 0.0f);
    vstore16(select((float16)0.0f, electrons, hit), 0, out->electrons);
    return 1;
}

static void deposit_block(bst_deposit_params p, local float *sum, int tile_x, int tile_y,
                          node_block nodes, global const float *table, global const float *field,
                          deposit_profiles *room) {
    deposit_nodes b;
    if (!place_nodes(p, tile_x, tile_y, nodes, field, &b)) {
        return;
    }
    for (int n = 0; n < BST_BLOCK; n += DEPOSIT_TEAM) {
        const int *t = b.top + n, *l = b.left + n, *h = b.hit + n;
        if (!(h[0] | h[1] | h[2] | h[3])) {
            continue;
        }
        int top = min(min(t[0], t[1]), min(t[2], t[3]));
        int bottom = max(max(t[0], t[1]), max(t[2], t[3])) + BST_SPREAD_TAPS;
        int left = min(min(l[0], l[1]), min(l[2], l[3]));
        int right = max(max(l[0], l[1]), max(l[2], l[3])) + BST_SPREAD_TAPS;
        if (right - left <= DEPOSIT_SPAN) {
            deposit_team(sum, &b, n, DEPOSIT_TEAM, top, bottom, left, right, table, room);
            continue;
        }
        for (int k = 0; k < DEPOSIT_TEAM; k++) { /* nodes far apart: one by one */
            if (h[k]) {
                deposit_team(sum, &b, n + k, 1, t[k], t[k] + BST_SPREAD_TAPS, l[k],
                             l[k] + BST_SPREAD_TAPS, table, room);
            }
        }
    }
}

/* nodes: table of nodes. grid: [samples_y / 16][samples_x][16]. table: [2][BST_SPREAD_TABLE], along
 * x and y. shares: [sources][BST_SPECTRA], if p.by_spectrum. The boxes are those of the nodes kernel, which extend
 * at least as far as the spreading kernel. */
__attribute__((reqd_work_group_size(DEPOSIT_GROUP, 1, 1))) kernel void bst_light_deposit(
    bst_deposit_params p, global const bst_kernel_source_record *sources, global const float16 *nodes,
    global const float *block_box, global const float *source_box, global const float *table,
    global const float *field, global float16 *grid, global const float *shares) {
    local float16 sums[DEPOSIT_GROUP][DEPOSIT_W * DEPOSIT_STRIDE / 16];
    int tile = (int)get_global_id(0);
    if (tile >= p.tiles_x * p.tiles_y) {
        return;
    }
    local float *sum = (local float *)sums[get_local_id(0)];
    int left = tile % p.tiles_x * DEPOSIT_W, top = tile / p.tiles_x * DEPOSIT_H;
    float density_x = p.coarse_x + p.finer_x, density_y = p.coarse_y + p.finer_y;
    float x0 = p.x0 + (float)left / density_x, y0 = p.y0 + (float)top / density_y;
    float4 place = (float4)(x0, y0, x0 + (float)DEPOSIT_W / density_x,
                            y0 + (float)DEPOSIT_H / density_y);
    for (int i = 0; i < DEPOSIT_W * DEPOSIT_STRIDE / 16; i++) {
        sums[get_local_id(0)][i] = (float16)0.0f;
    }
    deposit_profiles room;
    for (int k = 0; k < DEPOSIT_TEAM; k++) {
        for (int j = 0; j < DEPOSIT_ROOM; j++) {
            room.x[k][j] = room.y[k][j] = 0.0f;
        }
    }
    block_search search = begin_search(place, p.source_groups, 0);
    for (;;) {
        int block = next_block(&search, sources, block_box, source_box, 0);
        if (block < 0) {
            break;
        }
        bst_kernel_source_record s = search.source;
        if (p.by_spectrum) {
            s.electrons *= shares[search.source_index * BST_SPECTRA + p.spectrum];
            if (s.electrons == 0.0f) {
                continue;
            }
        }
        deposit_block(p, sum, left, top, nodes_of(p.nodes, s, block, nodes), table, field, &room);
    }
    int columns = min(DEPOSIT_W, p.samples_x - left);
    int rows = min(DEPOSIT_H, p.samples_y - top); /* samples_y is a multiple of 16 */
    for (int y = 0; y < rows; y += 16) {
        global float16 *out = grid + (size_t)((top + y) / 16) * p.samples_x + left;
        local const float16 *in = (local const float16 *)(sum + y);
        for (int x = 0; x < columns; x++) {
            STREAM(in[x * (DEPOSIT_STRIDE / 16)], out + x);
        }
    }
}
