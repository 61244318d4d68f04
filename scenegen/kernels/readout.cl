/* Detector in stages, for effects across pixels: blooming along columns, frame transfer under
 * light, binning. An image holds the light of all rows; charge replaces it and is read out from
 * there. One work-item per row, or per 64 columns; surplus work-items of the last group do nothing,
 * so that the groups of all frames have one size. Options: TAIL (read_tail.cl); MULTIPLY (a
 * multiplication register). */

/* image: [light_height][light_stride] floats, from column p.tiles_x0 and row p.light_y0 of the
 * sensor. */

#define READOUT_GROUP __attribute__((reqd_work_group_size(BST_READOUT_GROUP, 1, 1)))

INLINE uint counter_of(int row, int column, int width) {
    return ((uint)row * ((uint)(width + 63) / 64u) + (uint)column / 64u) * 16u;
}

INLINE void store_chunk(global float *to, chunk c) {
    global float16 *v = (global float16 *)to;
    v[0] = c.a;
    v[1] = c.b;
    v[2] = c.c;
    v[3] = c.d;
}

/* Frame transfer: from source light to expected electrons including sky and response, and the light
 * that a charge packet collects while it passes the other rows of its column. One work-item per 64
 * columns. */
READOUT_GROUP kernel void bst_detector_transfer(bst_kernel_frame_params p, global float *image,
                                  global const float *gain) {
    detector_maps maps = {gain, 0, 0, 0, 0, 0};
    int x = (int)get_global_id(0) * 64;
    if (x >= p.light_stride) {
        return;
    }
    chunk sum = {(float16)0.0f, (float16)0.0f, (float16)0.0f, (float16)0.0f};
    for (int y = 0; y < p.light_height; y++) {
        global float *at = image + (size_t)y * p.light_stride + x;
        size_t map = (size_t)(p.light_y0 + y) * p.maps_stride + p.tiles_x0 + x;
        chunk c = expected_chunk(p, maps, map, load_chunk(at));
        sum.a += c.a;
        sum.b += c.b;
        sum.c += c.c;
        sum.d += c.d;
        store_chunk(at, c);
    }
    float share = p.exposure_s > 0.0f ? p.transfer_row_s / p.exposure_s : 0.0f;
    for (int y = 0; y < p.light_height; y++) {
        global float *at = image + (size_t)y * p.light_stride + x;
        chunk c = load_chunk(at);
        c.a = fma((float16)share, sum.a - c.a, c.a);
        c.b = fma((float16)share, sum.b - c.b, c.b);
        c.c = fma((float16)share, sum.c - c.c, c.c);
        c.d = fma((float16)share, sum.d - c.d, c.d);
        store_chunk(at, c);
    }
}

/* Replaces the light of every pixel by its charge. One work-item per row. */
READOUT_GROUP kernel void bst_detector_charge(bst_kernel_frame_params p, global float *image, global const float *gain,
                                global const float *dark, global const float *overlay,
                                global const float *readout) {
    detector_maps maps = {gain, dark, overlay, 0, 0, readout};
    int row = p.light_y0 + (int)get_global_id(0);
    if (row >= p.light_y0 + p.light_height) {
        return;
    }
    global float *line = image + get_global_id(0) * (size_t)p.light_stride;
    for (int x = 0; x < p.light_stride; x += 64) {
        int column = p.tiles_x0 + x;
        size_t map = (size_t)row * p.maps_stride + column;
        uint counter = counter_of(row, column, p.sensor_width);
        chunk m = load_chunk(line + x);
        if (!HAS(p, BST_EFFECT_TRANSFER)) {
            m = expected_chunk(p, maps, map, m);
        }
        m = add_dark(p, maps, map, m);
        chunk_words w = chunk_random(p, counter, STREAM_POISSON);
        chunk n = chunk_normal(chunk_random(p, counter, STREAM_POISSON_NORMAL));
        float16 mean[4] = {m.a, m.b, m.c, m.d}, normal[4] = {n.a, n.b, n.c, n.d}, drawn[4];
        uint16 words[4] = {w.a, w.b, w.c, w.d};
        KEEP_LOOP
        for (int v = 0; v < 4; v++) {
            drawn[v] = draw_charge(mean[v], words[v], normal[v], (int16)-1);
            if (HAS(p, BST_EFFECT_OVERLAY)) {
                drawn[v] += ((global const float16 *)(overlay + map))[v];
            }
            if (!HAS(p, BST_EFFECT_BLOOM)) {
                drawn[v] = fmin(drawn[v], p.full_well_e);
            }
        }
        chunk q = {drawn[0], drawn[1], drawn[2], drawn[3]};
        store_chunk(line + x, q);
    }
}

/* Blooming: charge above the full well leaves a pixel in halves up and down its column and fills
 * the next pixels; what reaches the column's end is lost, in front of the overscan. `over`: work
 * column of moving charge. One work-item per 16 columns. */
READOUT_GROUP kernel void bst_detector_bloom(bst_kernel_frame_params p, global float *image, global float *over) {
    int x = (int)get_global_id(0) * 16;
    if (x >= p.light_stride) {
        return;
    }
    float16 carry = (float16)0.0f, full = (float16)p.full_well_e;
    for (int y = 0; y < p.light_height; y++) { /* towards larger y */
        global float16 *at = (global float16 *)(image + (size_t)y * p.light_stride + x);
        global float16 *half_at = (global float16 *)(over + (size_t)y * p.light_stride + x);
        float16 q = *at, excess = 0.5f * fmax(q - full, 0.0f);
        q = fmin(q, full);
        if (y < p.real_y0 || y >= p.real_y1) {
            *at = q;
            continue;
        }
        float16 take = fmin(full - q, carry);
        *at = q + take;
        *half_at = excess;
        carry = carry - take + excess;
    }
    carry = (float16)0.0f;
    for (int y = p.real_y1 - 1; y >= p.real_y0; y--) {
        global float16 *at = (global float16 *)(image + (size_t)y * p.light_stride + x);
        global float16 *half_at = (global float16 *)(over + (size_t)y * p.light_stride + x);
        float16 q = *at, take = fmin(full - q, carry);
        *at = q + take;
        carry = carry - take + *half_at;
    }
}

/* Marks the pixels at full well, for effects that change their charge before it is read. full: as
 * image. One work-item per row. */
READOUT_GROUP kernel void bst_detector_mark(bst_kernel_frame_params p, global const float *image, global uchar *full) {
    int y = (int)get_global_id(0);
    if (y >= p.light_height) {
        return;
    }
    for (int x = 0; x < p.light_stride; x += 16) {
        size_t at = (size_t)y * p.light_stride + x;
        int16 mark = vload16(0, image + at) >= p.full_well_e;
        vstore16(convert_uchar16(mark & 1), 0, full + at);
    }
}

#ifdef MULTIPLY
/* Twice the natural logarithm of v > 0, as log_radius2. */
INLINE lanes log_square(lanes v) {
    lanes_int bits = as_lanes_int(v) - 0x3F3504F3; /* sqrt(1/2) */
    lanes m = as_lanes((bits & 0x007FFFFF) + 0x3F3504F3);
    lanes s = (m - 1.0f) / (m + 1.0f), q = s * s;
    lanes series = fma(q, fma(q, fma(q, (lanes)(4.0f / 7), (lanes)(4.0f / 5)), (lanes)(4.0f / 3)),
                       (lanes)4.0f);
    return fma(to_lanes(bits >> 23), (lanes)1.38629436f, s * series);
}

/* One turn for gamma deviates of the shapes n, whole numbers from 1 on: rejection without a squeeze
 * (Marsaglia and Tsang 2000, ACM TOMS 26, 363), accepted with more than 95 %. */
INLINE lanes gamma_turn(lanes n, lanes_uint word, lanes z, lanes_int *accepted) {
    lanes d = n - 1.0f / 3, t = fma(z * (1.0f / 3), inverse_root(d), (lanes)1.0f);
    lanes v = t * t * t, log_u2 = -log_radius2(word); /* twice the logarithm of a uniform number */
    lanes safe = clamp(v, 1e-6f, 100.0f);
    lanes log_v2 = log_square(safe);
    *accepted = MASK((v > 1e-6f) & (log_u2 < fma(z, z, d * (2.0f - 2.0f * v + log_v2))));
    return d * v;
}

/* Charge of 16 pixels behind a multiplication register, over its gain: the mean stays, the variance
 * of n electrons is n (1 - 1 / gain), their law a gamma distribution of shape n (Basden, Haniff and
 * Mackay 2003, MNRAS 345, 985). Fractions of an electron, which traps leave, are rounded at random,
 * by the low bits of the first word. word, z: of the first turn; stream: of the second, later ones
 * have every fourth from there on. */
static lanes multiply_charge(bst_kernel_frame_params p, uint counter, uint stream, lanes_uint word,
                             lanes z, lanes q) {
    lanes whole = floor(q), u = to_lanes(word & 0xFFFFu) * 0x1p-16f, out = (lanes)0.0f;
    lanes n = fmax(whole + select((lanes)0.0f, (lanes)1.0f, MASK(u < q - whole)), 0.0f);
    lanes_int open = MASK(n > 0.0f);
    for (uint turn = 0u; any_of(open) && turn < 64u; turn++) {
        lanes_int good;
        lanes drawn = gamma_turn(fmax(n, 1.0f), word, z, &good);
        good &= open;
        out = select(out, fma(drawn - n, (lanes)p.multiply_rms, n), good);
        open &= ~good;
        if (any_of(open)) {
            lanes_uint w0, w1, unused;
            lanes other;
            philox_lanes(p, counter, stream + 4u * turn, &w0, &w1, &word, &unused);
            normal_lanes(w0, w1, &z, &other);
        }
    }
    return out;
}

INLINE chunk multiply_chunk(bst_kernel_frame_params p, uint counter, chunk q) {
    chunk z = chunk_normal(chunk_random(p, counter, STREAM_MULTIPLY));
    chunk_words w = chunk_random(p, counter, STREAM_MULTIPLY + 1u);
    const uint next = STREAM_MULTIPLY + 2u;
    q.a = multiply_charge(p, counter, next, w.a, z.a, q.a);
    q.b = multiply_charge(p, counter, next + 1u, w.b, z.b, q.b);
    q.c = multiply_charge(p, counter, next + 2u, w.c, z.c, q.c);
    q.d = multiply_charge(p, counter, next + 3u, w.d, z.d, q.d);
    return q;
}
#endif

/* Reads charge as digital numbers: p.binning x p.binning pixels are summed before they are read.
 * frame: [window_height][window_width], both after binning. saturated: pixels per row. full: of
 * bst_detector_mark, with BST_EFFECT_MARKS. One work-item per frame row. */
READOUT_GROUP kernel void bst_detector_read(bst_kernel_frame_params p, global const float *image, global ushort *frame,
                              global int *saturated, global const float *offsets,
                              global const ushort *codes, global uchar *flags,
                              global const uchar *full) {
    detector_maps maps = {0, 0, 0, offsets, codes, 0};
    int y = (int)get_global_id(0), b = p.binning;
    if (y >= p.window_height) {
        return;
    }
    int row = p.window_y0 + y * b;
    global ushort *out = frame + (size_t)y * p.window_width;
    global uchar *marks =
        HAS(p, BST_EFFECT_FLAGS) ? flags + (size_t)y * p.window_width : 0;
    /* binned pixels lie on a grid that starts at the window's first pixel */
    int first = p.window_x0 / b / 64 * 64, skip = p.window_x0 / b - first;
    int16 full_count = (int16)0;
    tail_block tail;
    for (int x = 0; x < skip + p.window_width; x += 64) {
        float sums[64];
        int brims[64];
        for (int i = 0; i < 64; i++) {
            int column = x + i - skip;
            float sum = 0.0f;
            int brim = 0;
            if (column >= 0 && column < p.window_width) {
                size_t first_at = (size_t)(row - p.light_y0) * p.light_stride + p.window_x0 -
                                  p.tiles_x0 + column * b;
                for (int v = 0; v < b; v++) {
                    for (int u = 0; u < b; u++) {
                        size_t at = first_at + (size_t)v * p.light_stride + u;
                        sum += image[at];
                        brim |= HAS(p, BST_EFFECT_MARKS) ? full[at] : image[at] >= p.full_well_e;
                    }
                }
            }
            sums[i] = sum;
            brims[i] = -brim;
        }
        uint counter = counter_of(row / b, first + x, p.sensor_width / b);
        chunk q = {vload16(0, sums), vload16(1, sums), vload16(2, sums), vload16(3, sums)};
        chunk_flags brim = {vload16(0, brims), vload16(1, brims), vload16(2, brims),
                            vload16(3, brims)};
#ifdef MULTIPLY
        q = multiply_chunk(p, counter, q);
#endif
        chunk e, z = chunk_normal(chunk_random(p, counter, STREAM_NOISE));
        e.a = read_out(p, q.a, z.a);
        e.b = read_out(p, q.b, z.b);
        e.c = read_out(p, q.c, z.c);
        e.d = read_out(p, q.d, z.d);
        DRAW_TAIL(p, row / b, first + x, p.sensor_width / b, &tail);
        e = ADD_TAIL(&tail, row / b, e);
        chunk dn = convert_chunk(p, maps, row, first + x, e);
        full_count -= store_dn(p, maps, dn, brim, x - skip, out, marks);
    }
    int8 s8 = full_count.lo + full_count.hi;
    int4 s4 = s8.lo + s8.hi;
    int2 s2 = s4.lo + s4.hi;
    saturated[y] = s2.lo + s2.hi;
}
