/* Quadrature nodes of a source from its position and the node table. nodes_of generates a block of
 * them where they are rendered (splat.cl, deposit.cl). Options: FOURIER (nodes are spread on a grid;
 * otherwise they have stamps). */

#ifdef FOURIER
/* Row of the Fourier path's width table, with fraction to the next row. */
static lanes width_of(lanes widening) {
    lanes square = fmin(widening, BST_WIDEST) * (BST_WIDTHS * BST_WIDTHS / BST_WIDEST);
    lanes row = floor(sqrt(square));
    return row + (square - row * row) / (2.0f * row + 1.0f);
}
#else
/* Stamps: widening of a node in PSF variances. */
static lanes width_of(lanes widening) {
    return widening;
}
#endif

/* Distortion (include/boresight/camera.h). Positions beyond the fold give no light on the sensor. */
static void add_distortion(bst_kernel_node_params n, lanes x, lanes y, lanes *dx, lanes *dy,
                           lanes *stretch2) {
    lanes s = x * x + y * y;
    lanes l = s * (n.k1 + s * (n.k2 + s * n.k3));
    lanes xy = 2.0f * x * y;
    *dx += x * l + n.p1 * xy + n.p2 * (s + 2.0f * x * x);
    *dy += y * l + n.p1 * (s + 2.0f * y * y) + n.p2 * xy;
    /* mean square scale of the map: half the sum of the squared derivatives */
    lanes r = 2.0f * (n.k1 + s * (2.0f * n.k2 + s * 3.0f * n.k3));
    lanes xx = 1.0f + l + x * x * r + 2.0f * n.p1 * y + 6.0f * n.p2 * x;
    lanes yy = 1.0f + l + y * y * r + 6.0f * n.p1 * y + 2.0f * n.p2 * x;
    lanes off = x * y * r + 2.0f * n.p1 * x + 2.0f * n.p2 * y;
    *stretch2 = 0.5f * (xx * xx + yy * yy) + off * off;
    *dx = select(*dx, (lanes)(1e9f), s > n.fold2);
    *dy = select(*dy, (lanes)(1e9f), s > n.fold2);
}

/* Fixed-point position on the sensor of `from` plus `way` pixels from the boresight; `place` is
 * `from` on the sensor. Positions far outside any sensor are clamped, NaN included. */
static lanes_int place_on_sensor(bst_kernel_node_params n, int place, float from, lanes way) {
    const float limit = (float)BST_PLACE_LIMIT;
    lanes moved = clamp(way * n.parts, -2.0f * limit, 2.0f * limit);
    /* rounds to nearest, half away from zero */
    lanes half_way = as_lanes((as_lanes_int(moved) & (int)0x80000000) | 0x3F000000);
    lanes_int at = place + to_lanes_int(moved + half_way);
    at = select((lanes_int)(BST_PLACE_LIMIT), at, fabs(from + way) * n.parts <= limit);
    if (n.subpixels > 0.0f) {
        lanes_int whole = (at + (1 << (n.place_bits - 1))) >> n.place_bits;
        lanes rest = to_lanes(at - (whole << n.place_bits)) * n.per_parts + 0.5f;
        lanes part = (floor(rest * n.subpixels) + 0.5f) * n.per_subpixels;
        at = (whole << n.place_bits) + to_lanes_int(floor((part - 0.5f) * n.parts + 0.5f));
    }
    return at;
}

/* A block of nodes: fixed-point position on the sensor, electrons, width_of. */
typedef struct node_block {
    lanes_int x, y;
    lanes electrons, width;
} node_block;

/* Generates block b of a source's nodes. With ONE_LANE the work-item has one of them, and `table` is
 * moved by its number. */
static node_block nodes_of(bst_kernel_node_params n, bst_kernel_source_record s, int b,
                           global const lanes *table) {
    const int row = BST_BLOCK / LANES;
    global const lanes *t = table + (s.first_table + b) * BST_TABLE_ROWS * row;
    node_block out;
    lanes depth = t[6 * row] * s.x_px + t[7 * row] * s.y_px;
    lanes scale = 1.0f / (depth + t[8 * row]);
    lanes dx = (t[0] * s.x_px + t[row] * s.y_px + t[2 * row] - depth * s.x_px) * scale;
    lanes dy = (t[3 * row] * s.x_px + t[4 * row] * s.y_px + t[5 * row] - depth * s.y_px) * scale;
    lanes widening = t[10 * row];
    if (n.distorted) {
        lanes stretch2;
        add_distortion(n, s.x_px + dx, s.y_px + dy, &dx, &dy, &stretch2);
        widening *= stretch2;
    }
    out.x = place_on_sensor(n, s.place_x, s.x_px, dx);
    out.y = place_on_sensor(n, s.place_y, s.y_px, dy);
    out.electrons = t[9 * row] * s.electrons;
    out.width = width_of(widening);
    return out;
}
