/* From sources and node tables to the frame's nodes: place and electrons of every node, and the
 * boxes of pixels that blocks, sources and groups of sources touch. One work-item per source. */

/* By comparisons: fmax() has more to do where one side is no number. */
static float max_of(float16 v) {
    float8 a = v.lo > v.hi ? v.lo : v.hi;
    float4 b = a.lo > a.hi ? a.lo : a.hi;
    float2 c = b.lo > b.hi ? b.lo : b.hi;
    return c.lo > c.hi ? c.lo : c.hi;
}

static float min_of(float16 v) {
    return -max_of(-v);
}

#ifdef FFT_LIGHT
/* Row of the Fourier path's table, and the share of the way to the next. */
static float16 width_of(float16 widening) {
    float16 square = fmin(widening, BST_WIDEST) * (BST_WIDTHS * BST_WIDTHS / BST_WIDEST);
    float16 row = floor(sqrt(square));
    return row + (square - row * row) / (2.0f * row + 1.0f);
}
#else
/* Sigma of the PSF over that of the node. */
static float16 width_of(float16 widening) {
    return rsqrt(1.0f + widening);
}
#endif

#ifdef DISTORTED
/* Distortion (sim/world/camera.h); k1, k2, k3, p1, p2 in pixels instead of tangents. What lies
 * beyond the fold gives no light on the sensor. */
static void add_distortion(float16 *x, float16 *y, float16 *stretch2) {
    float16 s = *x * *x + *y * *y;
    float16 l = s * (K1 + s * (K2 + s * K3));
    float16 xy = 2.0f * *x * *y;
    float16 dx = *x * l + P1 * xy + P2 * (s + 2.0f * *x * *x);
    float16 dy = *y * l + P1 * (s + 2.0f * *y * *y) + P2 * xy;
    /* mean square scale of the map there: half the sum of the squared derivatives */
    float16 r = 2.0f * (K1 + s * (2.0f * K2 + s * 3.0f * K3));
    float16 xx = 1.0f + l + *x * *x * r + 2.0f * P1 * *y + 6.0f * P2 * *x;
    float16 yy = 1.0f + l + *y * *y * r + 6.0f * P1 * *y + 2.0f * P2 * *x;
    float16 off = *x * *y * r + 2.0f * P1 * *x + 2.0f * P2 * *y;
    *stretch2 = 0.5f * (xx * xx + yy * yy) + off * off;
    *x = select(*x + dx, (float16)(1e6f), s > FOLD2);
    *y = select(*y + dy, (float16)(1e6f), s > FOLD2);
}
#endif

#ifdef SPATIAL_OVERSAMPLE
/* Of the parts into which a pixel is cut along each axis. */
static float16 centre_of_part(float16 v) {
    float16 pixel = floor(v + 0.5f);
    float16 part = floor((v + 0.5f - pixel) * SPATIAL_OVERSAMPLE) + 0.5f;
    return pixel + part * (1.0f / SPATIAL_OVERSAMPLE) - 0.5f;
}
#endif

/* A block of nodes on the sensor: x, y in px, electrons, width_of. */
typedef struct node_block {
    float16 x, y, electrons, width;
} node_block;

/* Block b of a source. Far outside any sensor all places are alike, which keeps the integer maths
 * in range. */
static node_block nodes_of(bst_scene_params p, bst_scene_source s, int b,
                           global const float16 *table) {
    global const float16 *t = table + (s.first_table + b) * BST_TABLE_ROWS;
    node_block out;
    float16 depth = t[6] * s.x_px + t[7] * s.y_px;
    float16 scale = 1.0f / (depth + t[8]);
    float16 dx = (t[0] * s.x_px + t[1] * s.y_px + t[2] - depth * s.x_px) * scale;
    float16 dy = (t[3] * s.x_px + t[4] * s.y_px + t[5] - depth * s.y_px) * scale;
#ifdef DISTORTED
    dx += s.x_px;
    dy += s.y_px;
    float16 stretch2;
    add_distortion(&dx, &dy, &stretch2);
    float16 widening = t[10] * stretch2;
    out.x = clamp(p.centre_x + dx, -1e6f, 1e6f);
    out.y = clamp(p.centre_y + dy, -1e6f, 1e6f);
#else
    float16 widening = t[10];
    out.x = clamp(p.centre_x + s.x_px + dx, -1e6f, 1e6f);
    out.y = clamp(p.centre_y + s.y_px + dy, -1e6f, 1e6f);
#endif
#ifdef SPATIAL_OVERSAMPLE
    out.x = centre_of_part(out.x);
    out.y = centre_of_part(out.y);
#endif
    out.electrons = t[9] * s.electrons;
    out.width = width_of(widening);
    return out;
}

/* Boxes of inclusive pixels, by groups of 16: x0[16], y0[16], x1[16], y1[16]. block_box: of the
 * blocks of a source that has several, from its first_box on; source_box: of sources; group_box: of
 * groups of sources. nodes (with FFT_LIGHT): per block x[16], y[16], electrons[16], width_of[16].
 */
__attribute__((reqd_work_group_size(BST_BLOCK, 1, 1))) kernel void bst_scene_nodes(
    bst_scene_params p, global const bst_scene_source *sources, int count,
    global const float16 *table, global float *block_box, global float *source_box,
    global float *group_box, global float16 *nodes) {
    int i = (int)get_global_id(0), g = i / BST_BLOCK;
    global float *box = source_box + g * 4 * BST_BLOCK + i % BST_BLOCK;
    float x0 = 1e9f, y0 = 1e9f, x1 = -1e9f, y1 = -1e9f;
    if (i < count) {
        bst_scene_source s = sources[i];
        float reach = (float)s.radius;
        for (int b = 0; b < s.blocks; b++) {
            node_block n = nodes_of(p, s, b, table);
#ifdef FFT_LIGHT
            int block = s.first_block + b;
            nodes[BST_NODE_ROWS * block] = n.x;
            nodes[BST_NODE_ROWS * block + 1] = n.y;
            nodes[BST_NODE_ROWS * block + 2] = n.electrons;
            nodes[BST_NODE_ROWS * block + 3] = n.width;
#endif
            float4 r =
                (float4)(floor(min_of(n.x)) - reach, floor(min_of(n.y)) - reach,
                         floor(max_of(n.x)) + reach + 1.0f, floor(max_of(n.y)) + reach + 1.0f);
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
