/* Non-destructive reads of an exposure: charge is collected interval by interval, and a line is
 * fitted to the reads at their ends. The read at the start is of empty pixels, so that the offset of
 * the reset drops out. From the first read of a full well on none is used: traps may take charge from
 * a full pixel, but the charge that it lost beforehand stays lost. */

/* Values of each pixel during a ramp, planes of [light_height][light_stride] floats: charge, sum of
 * the reads, sum of number times read (or the latest read), number of reads that are used. */
#define RAMP_PLANES 4

/* Adds the charge of an interval and its read. One work-item per row. */
READOUT_GROUP kernel void bst_detector_ramp(bst_kernel_ramp_params t, global const float *image,
                                            global const float *gain, global const float *dark,
                                            global const float *overlay, global float *planes) {
    bst_kernel_frame_params p = t.frame;
    detector_maps maps = {gain, dark, overlay, 0, 0, 0};
    int y = (int)get_global_id(0), row = p.light_y0 + y;
    if (y >= p.light_height) {
        return;
    }
    p.exposure_high ^= (uint)(t.interval + 1) << 24; /* random numbers of its own */
    size_t plane = (size_t)p.light_height * p.light_stride;
    for (int x = 0; x < p.light_stride; x += 64) {
        int column = p.tiles_x0 + x;
        size_t at = (size_t)y * p.light_stride + x, map = (size_t)row * p.maps_stride + column;
        chunk m = load_chunk(image + at);
        if (!HAS(p, BST_EFFECT_MEANS)) {
            m = add_dark(p, maps, map, expected_chunk(p, maps, map, m));
        }
        lanes mean[4] = {m.a, m.b, m.c, m.d}, drawn[4], below[4];
        KEEP_LOOP
        for (int v = 0; v < 4; v++) {
            below[v] = fmin(mean[v], 0.0f);
            mean[v] = fmax(mean[v], 0.0f);
        }
        draw_charges(p, counter_of(row, column, p.sensor_width), mean, drawn);
        KEEP_LOOP
        for (int v = 0; v < 4; v++) {
            global lanes *charge = (global lanes *)(planes + at) + v;
            global lanes *sum = (global lanes *)(planes + plane + at) + v;
            global lanes *moment = (global lanes *)(planes + 2 * plane + at) + v;
            global lanes *used = (global lanes *)(planes + 3 * plane + at) + v;
            int first = t.interval == 0;
            lanes before = first ? (lanes)0.0f : *charge;
            if (HAS(p, BST_EFFECT_OVERLAY)) {
                drawn[v] += ((global const lanes *)(overlay + map))[v];
            }
            lanes q = fmin(fmax(before + drawn[v] + below[v], 0.0f), p.full_well_e);
            lanes count = first ? (lanes)1.0f : *used; /* of the reads before this one */
            lanes good = select((lanes)0.0f, (lanes)1.0f,
                                MASK(q < p.full_well_e) &
                                    MASK(count == (lanes)(float)(t.interval + 1)));
            lanes read = good * respond(p, q), number = (lanes)(float)(t.interval + 1);
            *charge = q;
            *sum = (first ? (lanes)0.0f : *sum) + read;
            lanes old = first ? (lanes)0.0f : *moment;
            *moment = t.last_minus_first ? select(old, read, MASK(good > 0.0f))
                                         : fma(number, read, old);
            *used = count + good;
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
        float16 n = vload16(0, planes + 3 * plane + at), sum = vload16(0, planes + plane + at);
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
