/* Quadrature nodes of a source from its position and the node table. nodes_of generates a block of
 * them where they are rendered (splat.cl, deposit.cl). A kernel computes the pixel boxes of blocks,
 * sources and groups of sources, one work-item per source. Options: PLACE_BITS
 * (scenegen/stamp/fixed_point_px.h), SPATIAL_OVERSAMPLE (parts of a pixel per axis), DISTORTED
 * (with K1, K2, K3, P1, P2 and FOLD2), FOURIER (nodes are spread on a grid; otherwise they have
 * stamps). */

/* any() by halves: some compilers test lane by lane. */
static int any16(int16 v) {
    int8 a = v.lo | v.hi;
    int4 b = a.lo | a.hi;
    int2 c = b.lo | b.hi;
    return (c.lo | c.hi) < 0;
}

/* By comparisons, because fmax() also handles NaN. */
static float max_of(float16 v) {
    float8 a = v.lo > v.hi ? v.lo : v.hi;
    float4 b = a.lo > a.hi ? a.lo : a.hi;
    float2 c = b.lo > b.hi ? b.lo : b.hi;
    return c.lo > c.hi ? c.lo : c.hi;
}

static float min_of(float16 v) {
    return -max_of(-v);
}

/* One reduction of both bounds of both axes gave wrong bounds with NVIDIA's compiler (580.159.04),
 * which left out lanes 1 and 13 of the maxima (tests/scenegen/test_renderer.c,
 * light_does_not_depend_on_tiles). */
static int least_of(int16 v) {
    int8 a = min(v.lo, v.hi);
    int4 b = min(a.lo, a.hi);
    int2 c = min(b.lo, b.hi);
    return min(c.lo, c.hi);
}

static int most_of(int16 v) {
    int8 a = max(v.lo, v.hi);
    int4 b = max(a.lo, a.hi);
    int2 c = max(b.lo, b.hi);
    return max(c.lo, c.hi);
}

#ifdef FOURIER
/* Row of the Fourier path's width table, with fraction to the next row. */
static float16 width_of(float16 widening) {
    float16 square = fmin(widening, BST_WIDEST) * (BST_WIDTHS * BST_WIDTHS / BST_WIDEST);
    float16 row = floor(sqrt(square));
    return row + (square - row * row) / (2.0f * row + 1.0f);
}
#else
/* Stamps: widening of a node in PSF variances. */
static float16 width_of(float16 widening) {
    return widening;
}
#endif

#ifdef DISTORTED
/* Distortion (include/boresight/camera.h) with k1, k2, k3, p1, p2 scaled to pixels. Positions
 * beyond the fold give no light on the sensor. */
static void add_distortion(float16 x, float16 y, float16 *dx, float16 *dy, float16 *stretch2) {
    float16 s = x * x + y * y;
    float16 l = s * (K1 + s * (K2 + s * K3));
    float16 xy = 2.0f * x * y;
    *dx += x * l + P1 * xy + P2 * (s + 2.0f * x * x);
    *dy += y * l + P1 * (s + 2.0f * y * y) + P2 * xy;
    /* mean square scale of the map: half the sum of the squared derivatives */
    float16 r = 2.0f * (K1 + s * (2.0f * K2 + s * 3.0f * K3));
    float16 xx = 1.0f + l + x * x * r + 2.0f * P1 * y + 6.0f * P2 * x;
    float16 yy = 1.0f + l + y * y * r + 6.0f * P1 * y + 2.0f * P2 * x;
    float16 off = x * y * r + 2.0f * P1 * x + 2.0f * P2 * y;
    *stretch2 = 0.5f * (xx * xx + yy * yy) + off * off;
    *dx = select(*dx, (float16)(1e9f), s > FOLD2);
    *dy = select(*dy, (float16)(1e9f), s > FOLD2);
}
#endif

/* Fixed-point position on the sensor of `from` plus `way` pixels from the boresight; `place` is
 * `from` on the sensor. Positions far outside any sensor are clamped, NaN included. */
static int16 place_on_sensor(int place, float from, float16 way) {
    const float parts = (float)(1 << PLACE_BITS), limit = (float)BST_PLACE_LIMIT;
    float16 moved = clamp(way * parts, -2.0f * limit, 2.0f * limit);
    /* rounds to nearest, half away from zero */
    float16 half_way = as_float16((as_int16(moved) & (int)0x80000000) | 0x3F000000);
    int16 at = place + convert_int16(moved + half_way);
    at = select((int16)(BST_PLACE_LIMIT), at, fabs(from + way) * parts <= limit);
#ifdef SPATIAL_OVERSAMPLE /* the centre of one of the parts into which a pixel is divided */
    int16 whole = (at + (1 << (PLACE_BITS - 1))) >> PLACE_BITS;
    float16 rest = convert_float16(at - (whole << PLACE_BITS)) * (1.0f / parts) + 0.5f;
    float16 part = (floor(rest * SPATIAL_OVERSAMPLE) + 0.5f) * (1.0f / SPATIAL_OVERSAMPLE);
    at = (whole << PLACE_BITS) + convert_int16(floor((part - 0.5f) * parts + 0.5f));
#endif
    return at;
}

/* A block of nodes: fixed-point position on the sensor, electrons, width_of. */
typedef struct node_block {
    int16 x, y;
    float16 electrons, width;
} node_block;

/* Generates block b of a source's nodes. */
static node_block nodes_of(bst_kernel_source_record s, int b, global const float16 *table) {
    global const float16 *t = table + (s.first_table + b) * BST_TABLE_ROWS;
    node_block out;
    float16 depth = t[6] * s.x_px + t[7] * s.y_px;
    float16 scale = 1.0f / (depth + t[8]);
    float16 dx = (t[0] * s.x_px + t[1] * s.y_px + t[2] - depth * s.x_px) * scale;
    float16 dy = (t[3] * s.x_px + t[4] * s.y_px + t[5] - depth * s.y_px) * scale;
    float16 widening = t[10];
#ifdef DISTORTED
    float16 stretch2;
    add_distortion(s.x_px + dx, s.y_px + dy, &dx, &dy, &stretch2);
    widening *= stretch2;
#endif
    out.x = place_on_sensor(s.place_x, s.x_px, dx);
    out.y = place_on_sensor(s.place_y, s.y_px, dy);
    out.electrons = t[9] * s.electrons;
    out.width = width_of(widening);
    return out;
}

/* Boxes of inclusive pixels, in groups of 16: x0[16], y0[16], x1[16], y1[16]. block_box: of the
 * blocks of a source with several, from its first_box on; source_box: of sources; group_box: of
 * groups of sources. */
__attribute__((reqd_work_group_size(BST_BLOCK, 1, 1))) kernel void bst_scene_nodes(
    global const bst_kernel_source_record *sources, int count, global const float16 *table,
    global float *block_box, global float *source_box, global float *group_box) {
    int i = (int)get_global_id(0), g = i / BST_BLOCK;
    global float *box = source_box + g * 4 * BST_BLOCK + i % BST_BLOCK;
    float x0 = 1e9f, y0 = 1e9f, x1 = -1e9f, y1 = -1e9f;
    if (i < count) {
        bst_kernel_source_record s = sources[i];
        float reach = (float)s.radius;
        for (int b = 0; b < s.blocks; b++) {
            node_block n = nodes_of(s, b, table);
            int16 x = n.x >> PLACE_BITS, y = n.y >> PLACE_BITS;
            float4 r = (float4)((float)least_of(x) - reach, (float)least_of(y) - reach,
                                (float)most_of(x) + reach + 1.0f, (float)most_of(y) + reach + 1.0f);
            if (s.blocks > 1) {
                int lane = b % BST_BLOCK;
                global float *at = block_box + (s.first_box * BST_BLOCK + b - lane) * 4 + lane;
                at[0] = r.x;
                at[BST_BLOCK] = r.y;
                at[2 * BST_BLOCK] = r.z;
                at[3 * BST_BLOCK] = r.w;
            }
            x0 = fmin(x0, r.x);
            y0 = fmin(y0, r.y);
            x1 = fmax(x1, r.z);
            y1 = fmax(y1, r.w);
        }
    }
    box[0] = x0;
    box[BST_BLOCK] = y0;
    box[2 * BST_BLOCK] = x1;
    box[3 * BST_BLOCK] = y1;
    barrier(CLK_GLOBAL_MEM_FENCE);
    if (i % BST_BLOCK == 0) {
        global float *group = group_box + g / BST_BLOCK * 4 * BST_BLOCK + g % BST_BLOCK;
        group[0] = min_of(vload16(0, box));
        group[BST_BLOCK] = min_of(vload16(1, box));
        group[2 * BST_BLOCK] = max_of(vload16(2, box));
        group[3 * BST_BLOCK] = max_of(vload16(3, box));
    }
}
