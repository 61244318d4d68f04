/* Quadrature nodes of a source from its position and the node table. nodes_of generates a block of
 * them where they are rendered (splat.cl, deposit.cl). Options: FOURIER (nodes are spread on a grid;
 * otherwise they have stamps). */

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

/* Distortion (include/boresight/camera.h). Positions beyond the fold give no light on the sensor. */
static void add_distortion(bst_kernel_node_params n, float16 x, float16 y, float16 *dx, float16 *dy,
                           float16 *stretch2) {
    float16 s = x * x + y * y;
    float16 l = s * (n.k1 + s * (n.k2 + s * n.k3));
    float16 xy = 2.0f * x * y;
    *dx += x * l + n.p1 * xy + n.p2 * (s + 2.0f * x * x);
    *dy += y * l + n.p1 * (s + 2.0f * y * y) + n.p2 * xy;
    /* mean square scale of the map: half the sum of the squared derivatives */
    float16 r = 2.0f * (n.k1 + s * (2.0f * n.k2 + s * 3.0f * n.k3));
    float16 xx = 1.0f + l + x * x * r + 2.0f * n.p1 * y + 6.0f * n.p2 * x;
    float16 yy = 1.0f + l + y * y * r + 6.0f * n.p1 * y + 2.0f * n.p2 * x;
    float16 off = x * y * r + 2.0f * n.p1 * x + 2.0f * n.p2 * y;
    *stretch2 = 0.5f * (xx * xx + yy * yy) + off * off;
    *dx = select(*dx, (float16)(1e9f), s > n.fold2);
    *dy = select(*dy, (float16)(1e9f), s > n.fold2);
}

/* Fixed-point position on the sensor of `from` plus `way` pixels from the boresight; `place` is
 * `from` on the sensor. Positions far outside any sensor are clamped, NaN included. */
static int16 place_on_sensor(bst_kernel_node_params n, int place, float from, float16 way) {
    const float limit = (float)BST_PLACE_LIMIT;
    float16 moved = clamp(way * n.parts, -2.0f * limit, 2.0f * limit);
    /* rounds to nearest, half away from zero */
    float16 half_way = as_float16((as_int16(moved) & (int)0x80000000) | 0x3F000000);
    int16 at = place + convert_int16(moved + half_way);
    at = select((int16)(BST_PLACE_LIMIT), at, fabs(from + way) * n.parts <= limit);
    if (n.subpixels > 0.0f) {
        int16 whole = (at + (1 << (n.place_bits - 1))) >> n.place_bits;
        float16 rest = convert_float16(at - (whole << n.place_bits)) * n.per_parts + 0.5f;
        float16 part = (floor(rest * n.subpixels) + 0.5f) * n.per_subpixels;
        at = (whole << n.place_bits) + convert_int16(floor((part - 0.5f) * n.parts + 0.5f));
    }
    return at;
}

/* A block of nodes: fixed-point position on the sensor, electrons, width_of. */
typedef struct node_block {
    int16 x, y;
    float16 electrons, width;
} node_block;

/* Generates block b of a source's nodes. */
static node_block nodes_of(bst_kernel_node_params n, bst_kernel_source_record s, int b,
                           global const float16 *table) {
    global const float16 *t = table + (s.first_table + b) * BST_TABLE_ROWS;
    node_block out;
    float16 depth = t[6] * s.x_px + t[7] * s.y_px;
    float16 scale = 1.0f / (depth + t[8]);
    float16 dx = (t[0] * s.x_px + t[1] * s.y_px + t[2] - depth * s.x_px) * scale;
    float16 dy = (t[3] * s.x_px + t[4] * s.y_px + t[5] - depth * s.y_px) * scale;
    float16 widening = t[10];
    if (n.distorted) {
        float16 stretch2;
        add_distortion(n, s.x_px + dx, s.y_px + dy, &dx, &dy, &stretch2);
        widening *= stretch2;
    }
    out.x = place_on_sensor(n, s.place_x, s.x_px, dx);
    out.y = place_on_sensor(n, s.place_y, s.y_px, dy);
    out.electrons = t[9] * s.electrons;
    out.width = width_of(widening);
    return out;
}
