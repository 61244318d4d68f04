/* Effects of the detector on a chunk of pixels: charge, response, conversion to digital numbers.
 * Option: EFFECTS (the camera's BST_EFFECT_... bits; the others are not compiled. Without this option
 * each camera has those of p.effects, and cameras share the program, with a branch at each effect. */

#ifdef EFFECTS
#define HAS(p, effect) ((EFFECTS & (effect)) != 0)
#else
#define HAS(p, effect) (((p).effects & (effect)) != 0)
#endif

/* gain, dark (e-/s), overlay (e-): [sensor rows][p.maps_stride], a multiple of 64. The overlay's
 * pixels are followed by a mark per chunk of 64, non-zero if one of them has charge.
 * offsets (DN): columns [p.maps_stride]; with pick-up its cosines and sines by column
 * [p.maps_stride] each; at p.offsets_rows the rows [p.maps_rows]; with pick-up its amplitudes by
 * row of the cosines and of the sines [p.maps_rows] each. readout (e-): gathered outside the
 * exposure, as gain. */
typedef struct detector_maps {
    global const float *gain, *dark, *overlay, *offsets;
    global const ushort *codes;
    global const float *readout;
} detector_maps;

/* Means from here on use the expansion of the Poisson quantile, smaller ones the exact search. At
 * 30 the two distributions differ by a total variation of 1.4e-5, decreasing as the mean to the
 * power -1.5. */
#define POISSON_SWITCH 30.0f

/* Probability of zero events in units of 2^-32, the start of the search below. Probabilities are
 * reduced by a relative 5e-7, so that their sum never exceeds one. */
INLINE lanes first_chance(lanes mean) {
    return exp(-fmin(mean, POISSON_SWITCH)) * (0x1p32f * (1.0f - 2e-6f));
}

/* convert_uint of 0 <= p < 2^32, by the signed conversion that processors have. */
INLINE lanes_uint chance_of(lanes p) {
    lanes_int high = MASK(p >= 0x1p31f);
    lanes_int low = to_lanes_int(p - select((lanes)0.0f, (lanes)0x1p31f, high));
    return as_lanes_uint(low) + (as_lanes_uint(high) & 0x80000000u);
}

/* Poisson deviates of mean < POISSON_SWITCH by sequential search of the distribution (Devroye 1986,
 * III.2), in integers, all lanes in step; lanes outside `wanted` give 0. The words left over by
 * rounding (2e-6 of them) give the mean. */
INLINE lanes poisson_search(lanes mean, lanes_uint word, lanes_int wanted) {
    lanes p = first_chance(mean);
    /* numbers with the sign bit flipped: signed comparisons are those of the unsigned numbers */
    lanes_int sum = as_lanes_int((lanes_uint)0x80000000u), above = as_lanes_int(word ^ 0x80000000u);
    lanes_int active = wanted, count = (lanes_int)0, left = (lanes_int)0;
    for (int k = 0; any_of(active & ~left) && k < 200;) {
        lanes_uint chance = (lanes_uint)0u;
        for (int step = 0; step < 4; step++) { /* finished lanes ignore surplus steps */
            chance = chance_of(p);
            sum += as_lanes_int(chance);
            active &= MASK(above > sum);
            count -= active;
            k++;
            p *= mean * (1.0f / (float)k);
        }
        left = MASK(chance == 0u) & MASK(mean < (float)(k - 1));
    }
    return select(to_lanes(count), FLOOR(mean), active & left);
}

/* Poisson deviates of mean >= POISSON_SWITCH from a standard normal: the floor of the
 * Cornish-Fisher expansion of the Poisson quantile (Giles 2016, ACM TOMS 42(1) algorithm 955, Q_N
 * with terms up to 1/mean). */
INLINE lanes poisson_expand(lanes mean, lanes w) {
    lanes root = sqrt(mean), q = w * w;
    lanes whole = FLOOR(mean);
    lanes d = (mean - whole) + root * w + (1.0f / 3 + q * (1.0f / 6)) -
                w * (1.0f / 36 + q * (1.0f / 72)) / root +
                (-8.0f / 405 + q * (7.0f / 810 + q * (1.0f / 270))) / mean;
    return fmax(whole + FLOOR(d), 0.0f);
}

/* Amplifier response (nonlinearity) to a charge. */
INLINE lanes respond(bst_kernel_frame_params p, lanes e) {
    if (HAS(p, BST_EFFECT_NONLINEAR)) {
        lanes u = e * p.per_full_well;
        e = fma(e, u * fma(u, fma(u, (lanes)p.bend3, (lanes)p.bend2), (lanes)p.bend1), e);
    }
    return e;
}

INLINE chunk respond_chunk(bst_kernel_frame_params p, chunk e) {
    e.a = respond(p, e.a);
    e.b = respond(p, e.b);
    e.c = respond(p, e.c);
    e.d = respond(p, e.d);
    return e;
}

/* Adds read noise after the amplifier. */
INLINE lanes read_out(bst_kernel_frame_params p, lanes charge, lanes z) {
    return fma((lanes)p.read_noise_e, z, respond(p, charge));
}

/* Charge from two random words: a uniform one, and one that gave the normal deviate w. */
INLINE lanes draw_charge(lanes mean, lanes_uint word, lanes w, lanes_int wanted) {
    lanes_int small = MASK(mean < POISSON_SWITCH);
    lanes electrons = poisson_expand(mean, w);
    lanes_int search = wanted & small;
    if (any_of(search)) {
        electrons = select(electrons, poisson_search(mean, word, search), small);
    }
    return electrons;
}

/* Expected electrons of one chunk from its light; map: index of its first pixel. */
INLINE chunk expected_chunk(bst_kernel_frame_params p, detector_maps maps, size_t map, chunk light) {
    float sky = p.background_e - p.dark_e;
    chunk m;
    m.a = light.a + sky;
    m.b = light.b + sky;
    m.c = light.c + sky;
    m.d = light.d + sky;
    if (HAS(p, BST_EFFECT_GAIN)) {
        chunk gain = load_chunk(maps.gain + map);
        m.a *= gain.a;
        m.b *= gain.b;
        m.c *= gain.c;
        m.d *= gain.d;
    }
    return m;
}

INLINE chunk add_dark(bst_kernel_frame_params p, detector_maps maps, size_t map, chunk m) {
    if (HAS(p, BST_EFFECT_DARK)) {
        chunk dark = load_chunk(maps.dark + map);
        m.a = fma(dark.a, (lanes)p.exposure_s, m.a);
        m.b = fma(dark.b, (lanes)p.exposure_s, m.b);
        m.c = fma(dark.c, (lanes)p.exposure_s, m.c);
        m.d = fma(dark.d, (lanes)p.exposure_s, m.d);
    } else {
        m.a += p.dark_e;
        m.b += p.dark_e;
        m.c += p.dark_e;
        m.d += p.dark_e;
    }
    if (HAS(p, BST_EFFECT_READOUT)) {
        chunk readout = load_chunk(maps.readout + map);
        m.a += readout.a;
        m.b += readout.b;
        m.c += readout.c;
        m.d += readout.d;
    }
    return m;
}

/* Adds coherent pick-up to the offsets of a chunk. */
INLINE chunk add_pick_up(bst_kernel_frame_params p, detector_maps maps, int row, int column, chunk o) {
    chunk c = load_chunk(maps.offsets + p.maps_stride + column);
    chunk s = load_chunk(maps.offsets + 2 * p.maps_stride + column);
    lanes of_c = (lanes)maps.offsets[p.offsets_rows + p.maps_rows + row];
    lanes of_s = (lanes)maps.offsets[p.offsets_rows + 2 * p.maps_rows + row];
    o.a = fma(c.a, of_c, fma(s.a, of_s, o.a));
    o.b = fma(c.b, of_c, fma(s.b, of_s, o.b));
    o.c = fma(c.c, of_c, fma(s.c, of_s, o.c));
    o.d = fma(c.d, of_c, fma(s.d, of_s, o.d));
    return o;
}

/* Converts electrons to digital numbers plus one half, before clipping to the converter's range.
 * row, column: of the first pixel on the sensor. */
INLINE chunk convert_chunk(bst_kernel_frame_params p, detector_maps maps, int row, int column, chunk e) {
    lanes g = (lanes)p.dn_per_e, offset = (lanes)(p.offset_dn + 0.5f);
    chunk dn;
    chunk o = {offset, offset, offset, offset};
    if (HAS(p, BST_EFFECT_OFFSETS)) {
        offset = (lanes)(p.offset_dn + 0.5f + maps.offsets[p.offsets_rows + row]);
        o = load_chunk(maps.offsets + column);
        o.a += offset;
        o.b += offset;
        o.c += offset;
        o.d += offset;
        if (HAS(p, BST_EFFECT_PICK_UP)) {
            o = add_pick_up(p, maps, row, column, o);
        }
    }
    dn.a = fma(e.a, g, o.a);
    dn.b = fma(e.b, g, o.b);
    dn.c = fma(e.c, g, o.c);
    dn.d = fma(e.d, g, o.d);
    return dn;
}

/* Mark of the overlay's chunk that starts at a pixel of the maps: non-zero if it has charge. */
INLINE size_t overlay_mark(bst_kernel_frame_params p, size_t map) {
    return (size_t)p.maps_stride * (size_t)p.maps_rows + map / 64;
}
