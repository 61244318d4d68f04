/* Persistence: traps of a pixel fill while it holds charge and release it with the same time
 * constant (Tulloch, George and the ESO Detector Group 2019, J. Astron. Telesc. Instrum. Syst. 5,
 * 036004). Of a species with the share s and the time constant tau the trapped charge n follows
 * dn/dt = (s q - n) / tau. The charge q of the pixel grows steadily up to the full well; between
 * exposures it is 0. Traps know the expected charge: thinning of Poisson charge leaves Poisson charge,
 * so that one draw from the mean with trapped and released charge gives all noise. */

/* 1 - (1 - e^-y) / y: what a ramp from 0 to 1 in the time y fills; a series where that cancels. */
INLINE lanes filled_by_ramp(lanes y) {
    lanes series = y * fma(y, fma(y, (lanes)(1.0f / 24), (lanes)(-1.0f / 6)), (lanes)0.5f);
    lanes z = fmax(y, 0.01f);
    return select(1.0f - (1.0f - exp(-z)) / z, series, MASK(y < 0.02f));
}

/* Trapped charge of species k after an exposure in which the charge grows from `from` to `to`, which
 * lies above the full well where `full`; some_full: in one lane at least. */
INLINE lanes trapped_after(bst_kernel_persistence_params t, int k, lanes before, lanes from,
                           lanes to, lanes_int full, int some_full) {
    lanes n = fma(before, (lanes)t.stay[k],
                  t.share[k] * fma(from, (lanes)(1.0f - t.stay[k]), (to - from) * t.fill[k]));
    if (some_full) { /* the well is full before the end */
        lanes well = (lanes)t.frame.full_well_e, rise = fmax(well - from, 0.0f);
        lanes x = rise / fmax(to - from, 1e-6f), y = x * t.duration[k], r = t.duration[k] - y;
        lanes grown = exp(-y), rest = exp(-r);
        lanes m = fma(before, grown,
                      t.share[k] * fma(well - rise, 1.0f - grown, rise * filled_by_ramp(y)));
        n = select(n, fma(m, rest, t.share[k] * well * (1.0f - rest)), full);
    }
    return n;
}

/* Replaces the sources' light by the expected charge that is left and released. It may be below 0
 * where a radiation hit (overlay) filled traps. trapped: e-,
 * [light_height][light_stride / 16][kinds][16], so that a work-item reads one stream instead of one
 * for each species. held: expected charge so far in a ramp, as image. One work-item per row. */
READOUT_GROUP kernel void bst_detector_persistence(
    bst_kernel_persistence_params t, global float *image, global const float *gain,
    global const float *dark, global const float *overlay, global const float *readout,
    global float *trapped, global float *held) {
    bst_kernel_frame_params p = t.frame;
    detector_maps maps = {gain, dark, overlay, 0, 0, readout};
    int y = (int)get_global_id(0), row = p.light_y0 + y;
    if (y >= p.light_height) {
        return;
    }
    size_t plane = (size_t)p.light_height * p.light_stride;
    image += t.image * plane;
    for (int x = 0; x < p.light_stride; x += 64) {
        size_t at = (size_t)y * p.light_stride + x;
        size_t map = (size_t)row * p.maps_stride + p.tiles_x0 + x;
        chunk m = load_chunk(image + at);
        if (!HAS(p, BST_EFFECT_TRANSFER)) {
            m = expected_chunk(p, maps, map, m);
        }
        m = add_dark(p, maps, map, m);
        lanes mean[4] = {m.a, m.b, m.c, m.d};
        KEEP_LOOP
        for (int v = 0; v < 4; v++) {
            const lanes_int lane =
                (lanes_int)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
            /* beside the sensor the image holds anything */
            mean[v] = select((lanes)0.0f, mean[v], MASK(lane + x + 16 * v < p.sensor_width));
            global lanes *charge = (global lanes *)(held + at) + v; /* in a ramp */
            lanes from = t.continues ? *charge : (lanes)0.0f, to = from + mean[v];
            if (HAS(p, BST_EFFECT_OVERLAY)) {
                to += ((global const lanes *)(overlay + map))[v];
            }
            if (t.in_ramp) {
                *charge = to;
            }
            lanes_int full = MASK(to > t.frame.full_well_e);
            int some_full = any_of(full);
            for (int k = 0; k < t.kinds; k++) {
                global lanes *n = (global lanes *)trapped + (at / 16 + v) * t.kinds + k;
                lanes before = *n * t.gap[k];
                lanes after = trapped_after(t, k, before, from, to, full, some_full);
                mean[v] += before - after;
                *n = after;
            }
        }
        chunk left = {mean[0], mean[1], mean[2], mean[3]};
        store_chunk(image + at, left);
    }
}
