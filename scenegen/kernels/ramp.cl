/* Non-destructive reads of an exposure: charge is collected interval by interval, and a line is
 * fitted to the reads at their ends. The read at the start is of empty pixels, so that the offset of
 * the reset drops out. From the first read of a full well on none is used: traps may take charge from
 * a full pixel, but the charge that it lost beforehand stays lost. */

/* Values of each pixel during a ramp, planes of [light_height][light_stride] floats: charge, or minus
 * the number of reads that are used once a read found a full well; sum of the reads; sum of number
 * times read (or the latest read). */
#define RAMP_PLANES 3

/* 16 pixels during a ramp. */
typedef struct ramp_lanes {
    lanes charge, sum, moment;
} ramp_lanes;

/* Adds the charge of an interval, `drawn`, and the read at its end. */
INLINE ramp_lanes add_read(bst_kernel_ramp_params t, int interval, ramp_lanes r, lanes drawn) {
    lanes number = (lanes)(float)(interval + 1);
    lanes_int all = MASK(r.charge >= 0.0f); /* reads so far are used */
    lanes q = fmin(fmax(r.charge + drawn, 0.0f), t.frame.full_well_e);
    lanes_int good = all & MASK(q < t.frame.full_well_e);
    lanes read = select((lanes)0.0f, respond(t.frame, q), good);
    ramp_lanes next;
    next.charge = select(select(r.charge, -number, all), q, good);
    next.sum = r.sum + read;
    next.moment = t.last_minus_first ? select(r.moment, read, good) : fma(number, read, r.moment);
    return next;
}

/* Adds the charge of some intervals, whose images follow each other, and their reads. */
INLINE void add_intervals(bst_kernel_ramp_params t, detector_maps maps, global const float *image,
                          int row, int column, ramp_lanes *ramp) {
    bst_kernel_frame_params p = t.frame;
    size_t plane = (size_t)p.light_height * p.light_stride;
    size_t map = (size_t)row * p.maps_stride + column;
    for (int i = 0; i < t.intervals; i++) {
        chunk m = load_chunk(image + i * plane);
        if (!HAS(p, BST_EFFECT_MEANS)) {
            m = add_dark(p, maps, map, expected_chunk(p, maps, map, m));
        }
        lanes mean[4] = {m.a, m.b, m.c, m.d}, drawn[4], below[4];
        KEEP_LOOP
        for (int v = 0; v < 4; v++) {
            below[v] = fmin(mean[v], 0.0f);
            mean[v] = fmax(mean[v], 0.0f);
        }
        /* random numbers of its own */
        p.exposure_high = t.frame.exposure_high ^ (uint)(t.interval + i + 1) << 24;
        draw_charges(p, counter_of(row, column, p.sensor_width), mean, drawn);
        KEEP_LOOP
        for (int v = 0; v < 4; v++) {
            if (HAS(p, BST_EFFECT_OVERLAY)) {
                drawn[v] += ((global const lanes *)(maps.overlay + map))[v];
            }
            ramp[v] = add_read(t, t.interval + i, ramp[v], drawn[v] + below[v]);
        }
    }
}

/* Sum of the intervals' weight times charge for 16 pixels from one normal deviate z, by the expansion
 * of Cornish and Fisher (Abramowitz and Stegun 26.2.49): the cumulants of order k are the sums of
 * weight^k times mean. usable: where that is accurate, and no read finds a full well. */
INLINE lanes draw_line(bst_kernel_ramp_params t, global const float *image, lanes gain, lanes dark,
                       lanes z, lanes_int *usable) {
    size_t plane = (size_t)t.frame.light_height * t.frame.light_stride;
    float sky = HAS(t.frame, BST_EFFECT_MEANS) ? 0.0f : t.frame.background_e - t.frame.dark_e;
    lanes all = (lanes)0.0f, k1 = all, k2 = all, k3 = all, k4 = all;
    for (int i = 0; i < t.intervals; i++) {
        lanes w = (lanes)t.weight[i];
        lanes m = fma(*(global const lanes *)(image + i * plane) + sky, gain, dark);
        all += m;
        m *= w;
        k1 += m;
        m *= w;
        k2 += m;
        m *= w;
        k3 += m;
        k4 = fma(m, w, k4);
    }
    *usable = MASK(k1 >= t.line_from) & MASK(all <= t.frame.near_full_e);
    lanes a = inverse_root(fmax(k2, 1.0f)), a2 = a * a;
    lanes skew = k3 * a * a2, tail = k4 * a2 * a2, q = z * z;
    lanes x = fma(skew * (1.0f / 6), q - 1.0f, z);
    x = fma(tail * (1.0f / 24), z * (q - 3.0f), x);
    x = fma(skew * skew * (-1.0f / 36), z * fma((lanes)2.0f, q, (lanes)-5.0f), x);
    return fma(k2 * a, x, k1);
}

/* Signals of a chunk by draw_line; returns 1 if some of them are not usable. */
INLINE int draw_lines(bst_kernel_ramp_params t, detector_maps maps, global const float *image,
                      int row, int column, lanes *line, lanes_int *usable) {
    bst_kernel_frame_params p = t.frame;
    size_t map = (size_t)row * p.maps_stride + column;
    p.exposure_high ^= 128u << 24; /* no interval has this number */
    chunk n = chunk_normal(chunk_random(p, counter_of(row, column, p.sensor_width),
                                        STREAM_POISSON_NORMAL));
    lanes z[4] = {n.a, n.b, n.c, n.d};
    lanes_int unusable = (lanes_int)0;
    KEEP_LOOP
    for (int v = 0; v < 4; v++) {
        lanes gain = (lanes)1.0f, dark = (lanes)0.0f;
        if (!HAS(p, BST_EFFECT_MEANS)) {
            gain = HAS(p, BST_EFFECT_GAIN) ? ((global const lanes *)(maps.gain + map))[v] : gain;
            dark = HAS(p, BST_EFFECT_DARK)
                       ? ((global const lanes *)(maps.dark + map))[v] * p.exposure_s
                       : (lanes)p.dark_e;
        }
        line[v] = draw_line(t, image + 16 * v, gain, dark, z[v], &usable[v]);
        unusable |= ~usable[v];
    }
    return any_of(unusable);
}

/* Gives pixels whose line is usable the sums that bst_detector_ramp_fit makes it of. */
INLINE void keep_lines(bst_kernel_ramp_params t, const lanes *line, const lanes_int *usable,
                       ramp_lanes *ramp) {
    float reads = (float)t.reads;
    lanes per_slope = (lanes)(reads * (reads * reads - 1.0f) / (12.0f * (reads - 1.0f)));
    for (int v = 0; v < 4; v++) {
        ramp[v].charge = select(ramp[v].charge, (lanes)0.0f, usable[v]);
        ramp[v].sum = select(ramp[v].sum, (lanes)0.0f, usable[v]);
        ramp[v].moment = select(ramp[v].moment, line[v] * per_slope, usable[v]);
    }
}

/* Intervals of a ramp, all of them if line_from is not negative. One work-item per row. */
READOUT_GROUP kernel void bst_detector_ramp(bst_kernel_ramp_params t, global const float *image,
                                            global const float *gain, global const float *dark,
                                            global const float *overlay, global float *planes) {
    bst_kernel_frame_params p = t.frame;
    detector_maps maps = {gain, dark, overlay, 0, 0, 0};
    int y = (int)get_global_id(0), row = p.light_y0 + y;
    if (y >= p.light_height) {
        return;
    }
    size_t plane = (size_t)p.light_height * p.light_stride;
    for (int x = 0; x < p.light_stride; x += 64) {
        int column = p.tiles_x0 + x;
        size_t at = (size_t)y * p.light_stride + x;
        ramp_lanes ramp[4];
        for (int v = 0; v < 4; v++) {
            const ramp_lanes empty = {(lanes)0.0f, (lanes)0.0f, (lanes)0.0f};
            global const lanes *from = (global const lanes *)(planes + at) + v;
            ramp[v] = empty;
            if (t.interval > 0) {
                ramp[v].charge = from[0];
                ramp[v].sum = from[plane / 16];
                ramp[v].moment = from[2 * (plane / 16)];
            }
        }
        lanes line[4];
        lanes_int usable[4];
        int single = t.line_from < 0.0f;
        if (single || draw_lines(t, maps, image + at, row, column, line, usable)) {
            add_intervals(t, maps, image + at, row, column, ramp);
        }
        if (!single) {
            keep_lines(t, line, usable, ramp);
        }
        for (int v = 0; v < 4; v++) {
            global lanes *to = (global lanes *)(planes + at) + v;
            to[0] = ramp[v].charge;
            to[plane / 16] = ramp[v].sum;
            to[2 * (plane / 16)] = ramp[v].moment;
        }
    }
}

/* Ends a ramp: charge of the whole exposure by the line through the reads. The plane of charge gets
 * the variance of its read noise. full: pixels of which no read but the first is used. One work-item
 * per row. */
READOUT_GROUP kernel void bst_detector_ramp_fit(bst_kernel_ramp_params t, global float *image,
                                                global float *planes, global uchar *full) {
    bst_kernel_frame_params p = t.frame;
    int y = (int)get_global_id(0);
    if (y >= p.light_height) {
        return;
    }
    size_t plane = (size_t)p.light_height * p.light_stride;
    float all = (float)(t.reads - 1), full_e = respond(p, (lanes)p.full_well_e).s0 * all;
    for (int x = 0; x < p.light_stride; x += 16) {
        size_t at = (size_t)y * p.light_stride + x;
        float16 charge = vload16(0, planes + at), sum = vload16(0, planes + plane + at);
        float16 n = select((float16)(float)t.reads, -charge, charge < 0.0f);
        float16 moment = vload16(0, planes + 2 * plane + at), m = fmax(n, 2.0f);
        float16 slope = t.last_minus_first
                            ? moment / (m - 1.0f)
                            : (moment - 0.5f * (m - 1.0f) * sum) * (12.0f / (m * (m * m - 1.0f)));
        int16 none = n < 1.5f;
        vstore16(select(slope * all, (float16)full_e, none), 0, image + at);
        vstore16(convert_uchar16(none & 1), 0, full + at);
        float v[16], count[16];
        vstore16(m, 0, count);
        for (int i = 0; i < 16; i++) { /* beside the sensor the planes hold anything */
            v[i] = t.variance[clamp((int)count[i], 2, t.reads)];
        }
        vstore16(vload16(0, v), 0, planes + at);
    }
}
