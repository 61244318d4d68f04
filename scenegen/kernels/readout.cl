/* Detector in stages, for effects across pixels: blooming along columns, frame transfer under
 * light, binning. An image holds the light of all rows; charge replaces it and is read out from
 * there. One work-item per row, or per 64 columns; surplus work-items of the last group do nothing,
 * so that the groups of all frames have one size. Options: TAIL (read_tail.cl); MULTIPLY (a
 * multiplication register); RAMP (charge is the line through several reads, ramp.cl). */

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

/* Charges of a chunk of given means, as draw_charge gives them, from the random words that they need:
 * one for each small mean, a normal deviate for the others. */
INLINE void draw_charges(bst_kernel_frame_params p, uint counter, const lanes *mean, lanes *drawn) {
    lanes least = fmin(fmin(mean[0], mean[1]), fmin(mean[2], mean[3]));
    lanes most = fmax(fmax(mean[0], mean[1]), fmax(mean[2], mean[3]));
    int few = any_of(MASK(least < POISSON_SWITCH)), many = any_of(MASK(most >= POISSON_SWITCH));
    for (int v = 0; v < 4; v++) {
        drawn[v] = (lanes)0.0f;
    }
    if (many) {
        chunk n = chunk_normal(chunk_random(p, counter, STREAM_POISSON_NORMAL));
        drawn[0] = poisson_expand(mean[0], n.a);
        drawn[1] = poisson_expand(mean[1], n.b);
        drawn[2] = poisson_expand(mean[2], n.c);
        drawn[3] = poisson_expand(mean[3], n.d);
    }
    if (few) {
        chunk_words words = chunk_random(p, counter, STREAM_POISSON);
        lanes_uint w[4] = {words.a, words.b, words.c, words.d};
        KEEP_LOOP
        for (int v = 0; v < 4; v++) {
            lanes_int small = MASK(mean[v] < POISSON_SWITCH);
            if (any_of(small)) {
                lanes found = poisson_search(mean[v], w[v], small);
                drawn[v] = many ? select(drawn[v], found, small) : found;
            }
        }
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
        if (!HAS(p, BST_EFFECT_TRANSFER | BST_EFFECT_MEANS)) {
            m = expected_chunk(p, maps, map, m);
        }
        if (!HAS(p, BST_EFFECT_MEANS)) {
            m = add_dark(p, maps, map, m);
        }
        lanes mean[4] = {m.a, m.b, m.c, m.d}, drawn[4], below[4];
        if (HAS(p, BST_EFFECT_MEANS)) { /* a hit may fill more traps than its pixel has other charge */
            KEEP_LOOP
            for (int v = 0; v < 4; v++) {
                below[v] = fmin(mean[v], 0.0f);
                mean[v] = fmax(mean[v], 0.0f);
            }
        }
        draw_charges(p, counter, mean, drawn);
        KEEP_LOOP
        for (int v = 0; v < 4; v++) {
            if (HAS(p, BST_EFFECT_OVERLAY)) {
                drawn[v] += ((global const lanes *)(overlay + map))[v];
            }
            if (HAS(p, BST_EFFECT_MEANS)) {
                drawn[v] = fmax(drawn[v] + below[v], 0.0f);
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
    int first = p.light_height; /* row of the first excess; most columns have none */
    for (int y = 0; y < p.light_height; y++) { /* towards larger y */
        global float16 *at = (global float16 *)(image + (size_t)y * p.light_stride + x);
        float16 q = *at;
        if (first == p.light_height && !any_of(q > full)) {
            continue;
        }
        float16 excess = 0.5f * fmax(q - full, 0.0f);
        q = fmin(q, full);
        if (y < p.real_y0 || y >= p.real_y1) {
            *at = q;
            continue;
        }
        first = min(first, y);
        float16 take = fmin(full - q, carry);
        *at = q + take;
        *(global float16 *)(over + (size_t)y * p.light_stride + x) = excess;
        carry = carry - take + excess;
    }
    if (first == p.light_height) {
        return;
    }
    carry = (float16)0.0f;
    for (int y = p.real_y1 - 1; y >= p.real_y0; y--) {
        if (y < first && !any_of(carry > 0.0f)) {
            break;
        }
        global float16 *at = (global float16 *)(image + (size_t)y * p.light_stride + x);
        float16 q = *at, take = fmin(full - q, carry);
        *at = q + take;
        carry -= take;
        if (y >= first) {
            carry += *(global const float16 *)(over + (size_t)y * p.light_stride + x);
        }
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
        /* the sign of a difference: some compilers narrow comparisons to bytes lane by lane; fmax:
         * no number has any sign, and is not full */
        uint16 below = as_uint16(fmax(vload16(0, image + at), 0.0f) - p.full_well_e) >> 31;
        vstore16(convert_uchar16(1u - below), 0, full + at);
    }
}

#ifdef MULTIPLY
/* Quantile of the gamma distribution of shape n at that of the normal one, z: Cornish and Fisher's
 * expansion to n^(-3/2) (Abramowitz and Stegun 26.2.49 with the cumulants n (r - 1)!). */
INLINE lanes gamma_expand(lanes n, lanes z) {
    lanes a = inverse_root(n), q = z * z;
    lanes c1 = z * fma(q, (lanes)(1.0f / 36), (lanes)(-7.0f / 36));
    lanes c2 = fma(q, fma(q, (lanes)(-3.0f / 810), (lanes)(-7.0f / 810)), (lanes)(16.0f / 810));
    lanes c3 = z * fma(q, fma(q, (lanes)(9.0f / 38880), (lanes)(256.0f / 38880)),
                       (lanes)(-433.0f / 38880));
    lanes rest = fma(a, fma(a, fma(a, c3, c2), c1), fma(q, (lanes)(1.0f / 3), (lanes)(-1.0f / 3)));
    return n + fma(n * a, z, rest);
}

/* What the expansion lacks of the quantiles of few electrons, by linear interpolation in the table
 * of multiplication.h. */
INLINE lanes gamma_lacks(global const float *table, lanes n, lanes z) {
    const float per_step = BST_MULTIPLY_STEPS / (2.0f * BST_MULTIPLY_REACH);
    lanes at = fma(z, (lanes)per_step, (lanes)(0.5f * BST_MULTIPLY_STEPS));
    lanes_int step = to_lanes_int(at);
    lanes_int row = to_lanes_int(fmin(n, (float)BST_MULTIPLY_FEW)) - 1;
    int places[16];
    float low[16], high[16];
    vstore16(row * (BST_MULTIPLY_STEPS + 1) + step, 0, places);
    for (int i = 0; i < 16; i++) {
        low[i] = table[places[i]];
        high[i] = table[places[i] + 1];
    }
    lanes a = vload16(0, low), b = vload16(0, high);
    return fma(at - to_lanes(step), b - a, a);
}

/* Charge of 16 pixels behind a multiplication register, over its gain: the mean stays, the variance
 * of n electrons is n (1 - 1 / gain), their law a gamma distribution of shape n (Basden, Haniff and
 * Mackay 2003, MNRAS 345, 985). Fractions of an electron, which traps, coupling, brighter-fatter and
 * crosstalk leave, are rounded at random by the low 16 bits of a word that gave z. These bits change
 * z by up to 6e-4 as bits of the angle, and by more in the tails as bits of the radius. */
INLINE lanes multiply_charge(bst_kernel_frame_params p, global const float *table, lanes_uint word,
                             lanes z, lanes q) {
    lanes whole = FLOOR(q), u = to_lanes(as_lanes_int(word & 0xFFFFu)) * 0x1p-16f;
    lanes n = fmax(whole + select((lanes)0.0f, (lanes)1.0f, MASK(u < q - whole)), 0.0f);
    lanes some = fmax(n, 1.0f), x = gamma_expand(some, z);
    if (any_of(MASK(n < (float)BST_MULTIPLY_FEW))) {
        x += gamma_lacks(table, some, z);
    }
    return select((lanes)0.0f, fma(fmax(x, 0.0f) - n, (lanes)p.multiply_rms, n), MASK(n > 0.0f));
}

INLINE chunk multiply_chunk(bst_kernel_frame_params p, global const float *table, uint counter,
                            chunk q) {
    chunk_words w = chunk_random(p, counter, STREAM_MULTIPLY);
    chunk z = chunk_normal(w);
    lanes_uint word[4] = {w.a, w.b, w.c, w.d};
    lanes normal[4] = {z.a, z.b, z.c, z.d}, out[4] = {q.a, q.b, q.c, q.d};
    KEEP_LOOP
    for (int v = 0; v < 4; v++) {
        out[v] = multiply_charge(p, table, word[v], normal[v], out[v]);
    }
    chunk multiplied = {out[0], out[1], out[2], out[3]};
    return multiplied;
}
#endif

/* A chunk of charge that is read, and which of its pixels are full. column: of its first pixel, in
 * the window after binning; pixels outside the window are empty. */
INLINE chunk gather_charge(bst_kernel_frame_params p, global const float *image,
                           global const uchar *full, int row, int column, chunk_flags *brim) {
    int b = p.binning;
    long from = (long)(row - p.light_y0) * p.light_stride + p.window_x0 - p.tiles_x0 + column * b;
    if (b == 1 && column >= 0 && column + 64 <= p.window_width) {
        global const float *at = image + from;
        chunk q = {vload16(0, at), vload16(1, at), vload16(2, at), vload16(3, at)};
        if (HAS(p, BST_EFFECT_MARKS)) {
            brim->a = -convert_int16(vload16(0, full + from));
            brim->b = -convert_int16(vload16(1, full + from));
            brim->c = -convert_int16(vload16(2, full + from));
            brim->d = -convert_int16(vload16(3, full + from));
        } else {
            brim->a = q.a >= p.full_well_e;
            brim->b = q.b >= p.full_well_e;
            brim->c = q.c >= p.full_well_e;
            brim->d = q.d >= p.full_well_e;
        }
        return q;
    }
    float sums[64];
    int brims[64];
    for (int i = 0; i < 64; i++) {
        float sum = 0.0f;
        int full_wells = 0;
        if (column + i >= 0 && column + i < p.window_width) {
            for (int v = 0; v < b; v++) {
                for (int u = 0; u < b; u++) {
                    size_t at = (size_t)(from + i * b) + (size_t)v * p.light_stride + u;
                    sum += image[at];
                    full_wells |= HAS(p, BST_EFFECT_MARKS) ? full[at] : image[at] >= p.full_well_e;
                }
            }
        }
        sums[i] = sum;
        brims[i] = -full_wells;
    }
    chunk q = {vload16(0, sums), vload16(1, sums), vload16(2, sums), vload16(3, sums)};
    brim->a = vload16(0, brims);
    brim->b = vload16(1, brims);
    brim->c = vload16(2, brims);
    brim->d = vload16(3, brims);
    return q;
}

/* Signal of 16 pixels of output `own`, from column `first` on, with a share of what the other outputs
 * read at the same time. part: columns of an output. */
INLINE float16 add_others(bst_kernel_frame_params p, global const float *row, int part, int own,
                          int first, float16 q) {
    /* lane l reads the i-th pixel of its output, i = from + l, or from - l if it reads backwards */
    int backwards = p.mirrored & own;
    int from = backwards ? (own + 1) * part - 1 - first : first - own * part;
    int lowest = backwards ? from - 15 : from; /* i of the lane with the lowest one */
    float16 sum = (float16)0.0f;
    for (int o = 0; o < p.outputs; o++) {
        if (o == own) {
            sum += q;
            continue;
        }
        int at = p.mirrored & o ? (o + 1) * part - 16 - lowest : o * part + lowest;
        float16 there = vload16(0, row + at);
        sum += (p.mirrored & o) != backwards ? there.sfedcba9876543210 : there;
    }
    return fma((float16)p.crosstalk, sum - q, q);
}

/* The same for pixels that may belong to several outputs or lie beside the sensor. */
INLINE float16 add_others_at_edge(bst_kernel_frame_params p, global const float *row, int part,
                                  int first, float16 q) {
    int own = first / part;
    if (first >= 0 && first + 16 <= p.sensor_width && first + 16 <= (own + 1) * part) {
        return add_others(p, row, part, own, first, q);
    }
    float signal[16];
    vstore16(q, 0, signal);
    for (int l = 0; l < 16; l++) {
        int x = first + l, output = x / part, i = x - output * part;
        if (x < 0 || output >= p.outputs) {
            continue;
        }
        i = p.mirrored & output ? part - 1 - i : i;
        float sum = 0.0f;
        for (int o = 0; o < p.outputs; o++) {
            sum += row[p.mirrored & o ? (o + 1) * part - 1 - i : o * part + i];
        }
        signal[l] = fma(p.crosstalk, sum - signal[l], signal[l]);
    }
    return vload16(0, signal);
}

/* Signal of the 64 pixels of a chunk of a sensor row with crosstalk. The same as
 * bst_detector_crosstalk, without a pass over the image. */
INLINE chunk add_crosstalk(bst_kernel_frame_params p, global const float *row, int first, chunk q) {
    int part = p.sensor_width / p.outputs, own = first / part;
    if (first >= 0 && first + 64 <= p.sensor_width && first + 64 <= (own + 1) * part) {
        q.a = add_others(p, row, part, own, first, q.a);
        q.b = add_others(p, row, part, own, first + 16, q.b);
        q.c = add_others(p, row, part, own, first + 32, q.c);
        q.d = add_others(p, row, part, own, first + 48, q.d);
        return q;
    }
    q.a = add_others_at_edge(p, row, part, first, q.a);
    q.b = add_others_at_edge(p, row, part, first + 16, q.b);
    q.c = add_others_at_edge(p, row, part, first + 32, q.c);
    q.d = add_others_at_edge(p, row, part, first + 48, q.d);
    return q;
}

/* What the read-out of a frame takes and gives. */
typedef struct read_buffers {
    global const float *image;
    global ushort *frame;
    global uchar *flags;
    global const uchar *full;
    global const float *table, *noise;
} read_buffers;

/* Charge behind the amplifier with read noise; row, column: as gather_charge. */
INLINE chunk add_read_noise(bst_kernel_frame_params p, read_buffers from, uint counter, int row,
                            int column, chunk q) {
    chunk e, z = chunk_normal(chunk_random(p, counter, STREAM_NOISE));
#ifdef RAMP
    chunk_flags none;
    chunk noise = gather_charge(p, from.table, from.full, row, column, &none);
    e.a = fma(sqrt(noise.a), z.a, q.a);
    e.b = fma(sqrt(noise.b), z.b, q.b);
    e.c = fma(sqrt(noise.c), z.c, q.c);
    e.d = fma(sqrt(noise.d), z.d, q.d);
#else
    e.a = read_out(p, q.a, z.a);
    e.b = read_out(p, q.b, z.b);
    e.c = read_out(p, q.c, z.c);
    e.d = read_out(p, q.d, z.d);
#endif
    return e;
}

/* Reads the 64 pixels of a frame row y from x - skip on, columns from first + x on of the binned
 * sensor. Returns the saturated ones as store_dn does. */
INLINE int16 read_chunk(bst_kernel_frame_params p, detector_maps maps, read_buffers to,
                        const tail_block *tail, int y, int first, int x, int skip) {
    int b = p.binning, row = p.window_y0 + y * b;
    chunk_flags brim;
    chunk q = gather_charge(p, to.image, to.full, row, x - skip, &brim);
    if (HAS(p, BST_EFFECT_CROSSTALK)) { /* b is 1 */
        global const float *line = to.image + (long)(row - p.light_y0) * p.light_stride;
        q = add_crosstalk(p, line, first + x, q);
    }
    uint counter = counter_of(row / b, first + x, p.sensor_width / b);
#ifdef MULTIPLY
    q = multiply_chunk(p, to.table, counter, q);
#endif
    chunk e;
    if (HAS(p, BST_EFFECT_FLICKER)) {
        chunk n = load_chunk(to.noise + (size_t)row * p.maps_stride + first + x);
        e.a = n.a + respond(p, q.a);
        e.b = n.b + respond(p, q.b);
        e.c = n.c + respond(p, q.c);
        e.d = n.d + respond(p, q.d);
    } else {
        e = add_read_noise(p, to, counter, row, x - skip, q);
    }
    e = ADD_TAIL(tail, row / b, e);
    size_t line = (size_t)y * p.window_width;
    global uchar *marks = HAS(p, BST_EFFECT_FLAGS) ? to.flags + line : 0;
    return store_dn(p, maps, convert_chunk(p, maps, row, first + x, e), brim, x - skip,
                    to.frame + line, marks);
}

/* Reads charge as digital numbers: p.binning x p.binning pixels are summed before they are read.
 * frame: [window_height][window_width], both after binning. saturated: pixels per work-item. full:
 * of bst_detector_mark, with BST_EFFECT_MARKS. table: of multiply_chunk, or with RAMP the variance
 * of the read noise of each pixel, as image. noise: of bst_detector_flicker, with
 * BST_EFFECT_FLICKER. One work-item per frame row; with TAIL one per block of
 * read_tail.cl, whose noise is drawn at once, the blocks of a row side by side. */
READOUT_GROUP kernel void bst_detector_read(bst_kernel_frame_params p, global const float *image, global ushort *frame,
                              global int *saturated, global const float *offsets,
                              global const ushort *codes, global uchar *flags,
                              global const uchar *full, global const float *table,
                              global const float *noise) {
    detector_maps maps = {0, 0, 0, offsets, codes, 0};
    read_buffers to = {image, frame, flags, full, table, noise};
    /* binned pixels lie on a grid that starts at the window's first pixel */
    int item = (int)get_global_id(0), b = p.binning;
    int first = p.window_x0 / b / 64 * 64, skip = p.window_x0 / b - first;
    int left = 0, right = skip + p.window_width, from = item, end = item + 1;
    int16 full_count = (int16)0;
    tail_block tail;
#ifdef TAIL
    int across = (right + 63) / 64, top = p.window_y0 / b;
    int block = (top / TAIL_ROWS + item / across) * TAIL_ROWS - top;
    left = item % across * 64;
    right = min(right, left + 64);
    from = max(block, 0);
    end = min(block + TAIL_ROWS, p.window_height);
#endif
    if (from >= p.window_height) {
        return;
    }
    DRAW_TAIL(p, top + from, first + left, p.sensor_width / b, &tail);
    for (int y = from; y < end; y++) {
        for (int x = left; x < right; x += 64) {
            full_count -= read_chunk(p, maps, to, &tail, y, first, x, skip);
        }
    }
    int8 s8 = full_count.lo + full_count.hi;
    int4 s4 = s8.lo + s8.hi;
    int2 s2 = s4.lo + s4.hi;
    saturated[item] = s2.lo + s2.hi;
}
