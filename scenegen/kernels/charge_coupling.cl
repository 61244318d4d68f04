/* Effects of pixels and outputs on each other. One work-item per row. */

/* Charge that a neighbour's charge n moves into a pixel of charge q; the neighbour loses the same. A
 * border moves by a quarter of a pixel at most: four of them take no more than a pixel has. */
INLINE float16 inflow(bst_kernel_coupling_params p, float16 q, float16 n) {
    float16 moved_px = p.shift * (n - q); /* comparisons, because clamp() also handles NaN */
    moved_px = moved_px > 0.25f ? 0.25f : moved_px;
    moved_px = moved_px < -0.25f ? -0.25f : moved_px;
    return fma(0.5f * moved_px, n + q, p.coupling * (n - q));
}

/* What 16 pixels gain from their four neighbours. */
INLINE float16 gain_of(bst_kernel_coupling_params p, float16 q, float16 left, float16 right, float16 down,
                       float16 up) {
    if (p.shift == 0.0f) { /* the same without products with 0 */
        return p.coupling * (left - q) + p.coupling * (right - q) +
               (p.coupling * (down - q) + p.coupling * (up - q));
    }
    return (inflow(p, q, left) + inflow(p, q, right)) + (inflow(p, q, down) + inflow(p, q, up));
}

/* Coupling of neighbours, and borders that move away from charge: from -> to. The sum of the charge
 * stays; borders of the sensor and its overscan let nothing through. */
__attribute__((reqd_work_group_size(BST_READOUT_GROUP, 1, 1))) kernel void bst_detector_neighbours(
    bst_kernel_coupling_params p, global const float *from, global float *to) {
    const int16 lane = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
    int y = (int)get_global_id(0);
    if (y >= p.height) {
        return;
    }
    global const float *row = from + (size_t)y * p.stride;
    int real = y >= p.y0 && y < p.y1;
    global const float *below = real && y > p.y0 ? row - p.stride : row;
    global const float *above = real && y + 1 < p.y1 ? row + p.stride : row;
    for (int x = 0; x < p.width; x += 16) {
        float16 q = vload16(0, row + x), left, right;
        if (real && x > p.x0 && x + 16 < p.x1) { /* with all neighbours */
            float16 sum = gain_of(p, q, vload16(0, row + x - 1), vload16(0, row + x + 1),
                                  vload16(0, below + x), vload16(0, above + x));
            sum += q;
            vstore16(sum > 0.0f ? sum : 0.0f, 0, to + (size_t)y * p.stride + x);
            continue;
        }
        if (x > 0 && x + 16 < p.width) {
            left = vload16(0, row + x - 1);
            right = vload16(0, row + x + 1);
        } else {
            left = (float16)(x > 0 ? row[x - 1] : q.s0, q.s01234567, q.s89ab, q.scd, q.se);
            right = (float16)(q.s12345678, q.s9abc, q.sde, q.sf, q.sf);
            right.sf = x + 16 < p.width ? row[x + 16] : q.sf;
        }
        int16 column = lane + x;
        left = select(left, q, column <= p.x0);
        right = select(right, q, column + 1 >= p.x1);
        float16 down = vload16(0, below + x), up = vload16(0, above + x);
        float16 sum = gain_of(p, q, left, right, down, up);
        int16 changes = column >= p.x0 & column < p.x1 & (int16)-real;
        vstore16(select(q, fmax(q + sum, 0.0f), changes), 0, to + (size_t)y * p.stride + x);
    }
}

/* 16 pixels that an output reads from its i-th on. */
INLINE float16 load_output(bst_kernel_coupling_params p, global const float *row, int output, int i) {
    int part = p.width / p.outputs;
    if (p.mirrored && (output & 1)) {
        return vload16(0, row + (output + 1) * part - 16 - i).sfedcba9876543210;
    }
    return vload16(0, row + output * part + i);
}

INLINE void store_output(bst_kernel_coupling_params p, global float *row, int output, int i,
                         float16 q) {
    int part = p.width / p.outputs;
    if (p.mirrored && (output & 1)) {
        vstore16(q.sfedcba9876543210, 0, row + (output + 1) * part - 16 - i);
    } else {
        vstore16(q, 0, row + output * part + i);
    }
}

/* Column of the i-th pixel that an output reads. */
INLINE int column_of(bst_kernel_coupling_params p, int output, int i) {
    int part = p.width / p.outputs;
    return output * part + (p.mirrored && (output & 1) ? part - 1 - i : i);
}

/* Crosstalk: each output shows a share of what the others read at the same time. */
__attribute__((reqd_work_group_size(BST_READOUT_GROUP, 1, 1))) kernel void bst_detector_crosstalk(
    bst_kernel_coupling_params p, global float *image) {
    int y = (int)get_global_id(0), part = p.width / p.outputs, i = 0;
    if (y >= p.height) {
        return;
    }
    global float *row = image + (size_t)y * p.stride;
    for (; i + 16 <= part; i += 16) {
        float16 sum = (float16)0.0f;
        for (int o = 0; o < p.outputs; o++) {
            sum += load_output(p, row, o, i);
        }
        for (int o = 0; o < p.outputs; o++) {
            float16 q = load_output(p, row, o, i);
            store_output(p, row, o, i, fma((float16)p.crosstalk, sum - q, q));
        }
    }
    for (; i < part; i++) {
        float sum = 0.0f;
        for (int o = 0; o < p.outputs; o++) {
            sum += row[column_of(p, o, i)];
        }
        for (int o = 0; o < p.outputs; o++) {
            global float *q = row + column_of(p, o, i);
            *q = fma(p.crosstalk, sum - *q, *q);
        }
    }
}
