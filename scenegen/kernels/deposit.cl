/* Light of all nodes on a grid for the Fourier path: each node is spread over SPREAD_ROW x
 * SPREAD_ROW samples. Options: DEPOSIT_W, DEPOSIT_H (samples of a tile, a multiple of 16 wide),
 * DEPOSIT_GROUP (work-items per work-group), SPREAD_TAPS, FIELD (weights by place).
 *
 * One work-item owns a tile and adds its nodes in the order of sources, blocks and nodes: the sum is
 * the same for every tile and work-group size. */

#define DEPOSIT_PAD 8
#define DEPOSIT_STRIDE (DEPOSIT_W + 2 * DEPOSIT_PAD)
#define DEPOSIT_ROWS (DEPOSIT_H + 2 * DEPOSIT_PAD)

static int any_of(int16 v) {
    int8 a = v.lo | v.hi;
    int4 b = a.lo | a.hi;
    int2 c = b.lo | b.hi;
    return (c.lo | c.hi) < 0;
}

/* column, row: of the first tap, from the padded tile's corner. */
static void deposit_node(local float *sum, int column, int row, int phase_x, int phase_y, float tx,
                         float ty, float electrons, global const float *table) {
    global const float *a = table + phase_x * BST_SPREAD_ROW;
    global const float *b = table + (BST_SPREAD_PHASES + 1 + phase_y) * BST_SPREAD_ROW;
    float8 x = vload8(0, a), y = vload8(0, b);
    x = electrons * fma((float8)tx, vload8(1, a) - x, x);
    y = fma((float8)ty, vload8(1, b) - y, y);
    local float *t = sum + row * DEPOSIT_STRIDE + column;
#define DEPOSIT_LINE(n, h) \
    if (n < SPREAD_TAPS) { \
        vstore8(fma((float8)(h), x, vload8(0, t + n * DEPOSIT_STRIDE)), 0, t + n * DEPOSIT_STRIDE); \
    }
    DEPOSIT_LINE(0, y.s0)
    DEPOSIT_LINE(1, y.s1)
    DEPOSIT_LINE(2, y.s2)
    DEPOSIT_LINE(3, y.s3)
    DEPOSIT_LINE(4, y.s4)
    DEPOSIT_LINE(5, y.s5)
    DEPOSIT_LINE(6, y.s6)
    DEPOSIT_LINE(7, y.s7)
}

#ifdef FIELD
/* Bilinear weight of the field node at a place. */
static float field_weight(bst_deposit_params p, global const float *field, float x, float y) {
    float u = clamp(x * p.field_per_px_x, 0.0f, (float)(p.field_x - 1));
    float v = clamp(y * p.field_per_px_y, 0.0f, (float)(p.field_y - 1));
    int i = min((int)u, p.field_x - 2), j = min((int)v, p.field_y - 2);
    global const float *a = field + j * p.field_x + i;
    float low = mix(a[0], a[1], u - (float)i);
    float high = mix(a[p.field_x], a[p.field_x + 1], u - (float)i);
    return mix(low, high, v - (float)j);
}
#endif

/* One block of 16 nodes. */
static void deposit_block(bst_deposit_params p, local float *sum, int tile_x, int tile_y,
                          global const float16 *block, global const float *table,
                          global const float *field) {
    float16 u = (block[0] - p.x0) * p.density_x, v = (block[1] - p.y0) * p.density_y;
    float16 floor_u = floor(u), floor_v = floor(v);
    float16 phase_u = (u - floor_u) * BST_SPREAD_PHASES, phase_v = (v - floor_v) * BST_SPREAD_PHASES;
    float16 step_u = fmin(floor(phase_u), BST_SPREAD_PHASES - 1.0f);
    float16 step_v = fmin(floor(phase_v), BST_SPREAD_PHASES - 1.0f);
    /* the first tap's sample, from the padded tile's corner */
    float16 column = floor_u - (float)(SPREAD_TAPS / 2 - 1 + tile_x - DEPOSIT_PAD);
    float16 row = floor_v - (float)(SPREAD_TAPS / 2 - 1 + tile_y - DEPOSIT_PAD);
    int16 hit = (block[2] > 0.0f) & (column > (float)(DEPOSIT_PAD - SPREAD_TAPS)) &
                (column < (float)(DEPOSIT_PAD + DEPOSIT_W)) &
                (row > (float)(DEPOSIT_PAD - SPREAD_TAPS)) &
                (row < (float)(DEPOSIT_PAD + DEPOSIT_H)) &
                /* what lies outside the grid would come in on its other side */
                (floor_u >= (float)(SPREAD_TAPS / 2 - 1)) &
                (floor_v >= (float)(SPREAD_TAPS / 2 - 1)) &
                (floor_u < (float)(p.samples_x - SPREAD_TAPS / 2)) &
                (floor_v < (float)(p.samples_y - SPREAD_TAPS / 2));
    if (!any_of(hit)) {
        return;
    }
    int hits[16], columns[16], rows[16], phases_x[16], phases_y[16];
    float tx[16], ty[16], electrons[16];
    vstore16(hit, 0, hits);
    vstore16(convert_int16(column), 0, columns);
    vstore16(convert_int16(row), 0, rows);
    vstore16(convert_int16(step_u), 0, phases_x);
    vstore16(convert_int16(step_v), 0, phases_y);
    vstore16(phase_u - step_u, 0, tx);
    vstore16(phase_v - step_v, 0, ty);
    vstore16(block[2], 0, electrons);
#ifdef FIELD
    float px[16], py[16];
    vstore16(block[0], 0, px);
    vstore16(block[1], 0, py);
#endif
    for (int i = 0; i < 16; i++) {
        /* neighbours write to the same samples: apart from each other they need not wait */
        int n = 7 * i & 15;
        if (!hits[n]) {
            continue;
        }
        float e = electrons[n];
#ifdef FIELD
        e *= field_weight(p, field, px[n], py[n]);
#endif
        deposit_node(sum, columns[n], rows[n], phases_x[n], phases_y[n], tx[n], ty[n], e, table);
    }
}

/* grid: [samples_y][pitch]. table: [2][BST_SPREAD_PHASES + 1][BST_SPREAD_ROW], along x and y. The
 * boxes are those of the nodes kernel, which reach at least as far as the spreading kernel. */
__attribute__((reqd_work_group_size(DEPOSIT_GROUP, 1, 1))) kernel void bst_light_deposit(
    bst_deposit_params p, global const bst_scene_source *sources, global const float16 *nodes,
    global const float4 *block_box, global const float *source_box, global const float *table,
    global const float *field, global float *grid) {
    local float sums[DEPOSIT_GROUP][DEPOSIT_ROWS * DEPOSIT_STRIDE];
    int tile = (int)get_global_id(0);
    if (tile >= p.tiles_x * p.tiles_y) {
        return;
    }
    local float *sum = sums[get_local_id(0)];
    int left = tile % p.tiles_x * DEPOSIT_W, top = tile / p.tiles_x * DEPOSIT_H;
    float x0 = p.x0 + (float)left / p.density_x, x1 = x0 + (float)DEPOSIT_W / p.density_x;
    float y0 = p.y0 + (float)top / p.density_y, y1 = y0 + (float)DEPOSIT_H / p.density_y;
    for (int i = 0; i < DEPOSIT_ROWS * DEPOSIT_STRIDE; i += 16) {
        vstore16((float16)0.0f, 0, sum + i);
    }
    for (int g = 0; g < p.source_groups; g++) {
        global const float *box = source_box + g * 4 * BST_BLOCK;
        int16 hit = (vload16(0, box) <= x1) & (vload16(1, box) <= y1) & (vload16(2, box) >= x0) &
                    (vload16(3, box) >= y0);
        if (!any_of(hit)) {
            continue;
        }
        int hits[BST_BLOCK];
        vstore16(hit, 0, hits);
        for (int i = 0; i < BST_BLOCK; i++) {
            if (!hits[i]) {
                continue;
            }
            bst_scene_source s = sources[g * BST_BLOCK + i];
            for (int b = s.first_block; b < s.first_block + s.blocks; b++) {
                float4 r = block_box[b];
                if (r.x <= x1 && r.z >= x0 && r.y <= y1 && r.w >= y0) {
                    deposit_block(p, sum, left, top, nodes + BST_NODE_ROWS * b, table, field);
                }
            }
        }
    }
    int rows = min(DEPOSIT_H, p.samples_y - top), columns = min(DEPOSIT_W, p.samples_x - left);
    for (int y = 0; y < rows; y++) {
        global float *out = grid + (size_t)(top + y) * p.pitch + left;
        local const float *in = sum + (y + DEPOSIT_PAD) * DEPOSIT_STRIDE + DEPOSIT_PAD;
        for (int x = 0; x < columns; x += 16) { /* samples_x is a multiple of 16 */
            vstore16(vload16(0, in + x), 0, out + x);
        }
    }
}
