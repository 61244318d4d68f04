/* The detector: from expected electrons to digital numbers. Options: CF_ORDER (order of the noise
 * expansion), SINGLE_FROM (means from here on use one deviate for shot and read noise), SEARCH
 * (some means do not); GAIN_MAP, DARK_MAP (response and dark current per pixel), OVERLAY (charge in
 * addition to light), NONLINEAR (with C1, C2, C3), OFFSETS (of columns and rows), CODES (output
 * code table). */

/* gain, dark (e-/s), overlay (e-): [sensor rows][MAP_STRIDE], a multiple of 64. The overlay's
 * MAP_CELLS pixels are followed by a mark per chunk of 64, non-zero if one of them has charge.
 * offsets (DN): columns [MAP_STRIDE], then rows. */
typedef struct detector_maps {
    global const float *gain, *dark, *overlay, *offsets;
    global const ushort *codes;
} detector_maps;

/* Means from here on use the expansion of the Poisson quantile, smaller ones the exact search. At
 * 30 the two distributions differ by a total variation of 1.4e-5, decreasing as the mean to the
 * power -1.5. */
#define POISSON_SWITCH 30.0f

/* Probability of zero events in units of 2^-32, the start of the search below. Probabilities are
 * reduced by a relative 5e-7, so that their sum never exceeds one. */
INLINE float16 first_chance(float16 mean) {
    return exp(-fmin(mean, POISSON_SWITCH)) * (0x1p32f * (1.0f - 2e-6f));
}

/* Poisson deviates of mean < POISSON_SWITCH by sequential search of the distribution (Devroye 1986,
 * III.2), in integers, all lanes in step; lanes outside `wanted` give 0. The words left over by
 * rounding (2e-6 of them) give the mean. */
INLINE float16 poisson_search16(float16 mean, uint16 word, int16 wanted) {
    float16 count = (float16)0.0f, p = first_chance(mean);
    uint16 rest = word;
    int16 active = wanted;
    for (int k = 0; any16(active) && k < 200;) {
        for (int step = 0; step < 4; step++) { /* finished lanes ignore surplus steps */
            uint16 chance = convert_uint16(p);
            active &= as_int16(rest > chance);
            int16 end = (chance == 0u) & (mean < (float)k);
            count = select(count, floor(mean), active & end);
            active &= ~end;
            k++;
            rest = select(rest, rest - chance, as_uint16(active));
            count = select(count, (float16)(float)k, active);
            p *= mean * (1.0f / (float)k);
        }
    }
    return count;
}

/* Poisson deviates of mean >= POISSON_SWITCH from a standard normal: the floor of the
 * Cornish-Fisher expansion of the Poisson quantile (Giles 2016, ACM TOMS 42(1) algorithm 955, Q_N
 * with terms up to 1/mean). */
INLINE float16 poisson_expand16(float16 mean, float16 w) {
    float16 root = sqrt(mean), q = w * w;
    float16 whole = floor(mean);
    float16 d = (mean - whole) + root * w + (1.0f / 3 + q * (1.0f / 6)) -
                w * (1.0f / 36 + q * (1.0f / 72)) / root +
                (-8.0f / 405 + q * (7.0f / 810 + q * (1.0f / 270))) / mean;
    return fmax(whole + floor(d), 0.0f);
}

/* Lanes for which one deviate is not accurate enough: small means with little read noise, and means
 * near the full well, where the charge is clipped before read noise is added. */
INLINE int16 needs_two(bst_kernel_frame_params p, float16 mean) {
#ifdef SEARCH
    return (mean < SINGLE_FROM) | (mean > p.near_full_e);
#else
    return mean > p.near_full_e;
#endif
}

/* Amplifier response (nonlinearity) to a charge. */
INLINE float16 respond(bst_kernel_frame_params p, float16 e) {
#ifdef NONLINEAR
    float16 u = e * p.per_full_well;
    e = fma(e, u * fma(u, fma(u, (float16)C3, (float16)C2), (float16)C1), e);
#endif
    return e;
}

/* Adds read noise after the amplifier. */
INLINE float16 read_out(bst_kernel_frame_params p, float16 charge, float16 z) {
    return fma((float16)p.read_noise_e, z, respond(p, charge));
}

/* Charge from two random words: a uniform one, and one that gave the normal deviate w. */
INLINE float16 draw_charge(float16 mean, uint16 word, float16 w, int16 wanted) {
    int16 small = mean < POISSON_SWITCH;
    float16 electrons = poisson_expand16(mean, w);
    int16 search = wanted & small;
    if (any16(search)) {
        electrons = select(electrons, poisson_search16(mean, word, search), small);
    }
    return electrons;
}

/* Expected electrons of one chunk from its light; map: index of its first pixel. */
INLINE chunk expected_chunk(bst_kernel_frame_params p, detector_maps maps, size_t map, chunk light) {
    float sky = p.background_e - p.dark_e;
    chunk m;
#ifdef GAIN_MAP
    chunk gain = load_chunk(maps.gain + map);
    m.a = (light.a + sky) * gain.a;
    m.b = (light.b + sky) * gain.b;
    m.c = (light.c + sky) * gain.c;
    m.d = (light.d + sky) * gain.d;
#else
    m.a = light.a + sky;
    m.b = light.b + sky;
    m.c = light.c + sky;
    m.d = light.d + sky;
#endif
    return m;
}

INLINE chunk add_dark(bst_kernel_frame_params p, detector_maps maps, size_t map, chunk m) {
#ifdef DARK_MAP
    chunk dark = load_chunk(maps.dark + map);
    m.a = fma(dark.a, (float16)p.exposure_s, m.a);
    m.b = fma(dark.b, (float16)p.exposure_s, m.b);
    m.c = fma(dark.c, (float16)p.exposure_s, m.c);
    m.d = fma(dark.d, (float16)p.exposure_s, m.d);
#else
    m.a += p.dark_e;
    m.b += p.dark_e;
    m.c += p.dark_e;
    m.d += p.dark_e;
#endif
    return m;
}

/* Converts electrons to digital numbers plus one half, before clipping to the converter's range.
 * row, column: of the first pixel on the sensor. */
INLINE chunk convert_chunk(bst_kernel_frame_params p, detector_maps maps, int row, int column, chunk e) {
    float16 g = (float16)p.dn_per_e;
    chunk dn;
#ifdef OFFSETS
    float16 offset = (float16)(p.offset_dn + 0.5f + maps.offsets[MAP_STRIDE + row]);
    chunk o = load_chunk(maps.offsets + column);
    dn.a = fma(e.a, g, offset + o.a);
    dn.b = fma(e.b, g, offset + o.b);
    dn.c = fma(e.c, g, offset + o.c);
    dn.d = fma(e.d, g, offset + o.d);
#else
    float16 offset = (float16)(p.offset_dn + 0.5f);
    dn.a = fma(e.a, g, offset);
    dn.b = fma(e.b, g, offset);
    dn.c = fma(e.c, g, offset);
    dn.d = fma(e.d, g, offset);
#endif
    return dn;
}

/* Noise law common to all pixels without source light. */
typedef struct dark_law {
    noise_law law;
    int single; /* one deviate is accurate enough */
    int steps;  /* steps of the search for a small mean; 0: the search is not used */
    float mean;
} dark_law;

#define MOST_STEPS 128

#if !defined(GAIN_MAP) && !defined(DARK_MAP)
#define SHARED_MEAN
#endif

/* steps: cumulative probabilities of the search, equal to those of poisson_search16. */
INLINE dark_law dark_law_of(bst_kernel_frame_params p, uint *steps) {
    dark_law dark;
    dark.mean = (p.background_e - p.dark_e) + p.dark_e; /* as the sum of the two below */
    float16 mean = (float16)dark.mean;
    dark.law = noise_law_of(p, mean);
    dark.single = !any16(needs_two(p, mean));
    dark.steps = 0;
#if defined(SEARCH) && defined(SHARED_MEAN)
    if (dark.mean < POISSON_SWITCH && dark.mean <= p.near_full_e) {
        float16 chance = first_chance(mean);
        uint sum = 0u;
        for (int k = 0; k < MOST_STEPS; k++) {
            uint part = convert_uint(chance.s0);
            if (part == 0u && dark.mean < (float)k) {
                break;
            }
            sum = add_sat(sum, part);
            steps[k] = sum;
            dark.steps = k + 1;
            chance *= mean * (1.0f / (float)(k + 1));
        }
    }
#endif
    return dark;
}

#ifdef SEARCH
/* Search results for the words of a dark chunk, by counting instead of stepping. */
INLINE chunk dark_electrons(dark_law dark, const uint *steps, chunk_words w) {
    chunk_flags n = {(int16)0, (int16)0, (int16)0, (int16)0};
    uint last = 0u;
    for (int k = 0; k < dark.steps; k++) {
        last = steps[k];
        n.a += w.a > last;
        n.b += w.b > last;
        n.c += w.c > last;
        n.d += w.d > last;
    }
    float16 mean = (float16)floor(dark.mean);
    chunk e;
    e.a = select(-convert_float16(n.a), mean, w.a > last);
    e.b = select(-convert_float16(n.b), mean, w.b > last);
    e.c = select(-convert_float16(n.c), mean, w.c > last);
    e.d = select(-convert_float16(n.d), mean, w.d > last);
    return e;
}
#endif

/* Electrons of 16 pixels; lanes `two` draw charge first, then read noise. full: lanes with a full
 * well. */
INLINE float16 draw_pixels(bst_kernel_frame_params p, float16 single, float16 charge, float16 z, int16 two,
                           int16 *full) {
    *full = two & (charge >= p.full_well_e);
    return select(single, read_out(p, fmin(charge, p.full_well_e), z), two);
}

/* Digital numbers plus one half of one chunk, before clipping to the converter's range. counter: of
 * its first lane. row, column: of its first pixel on the sensor. light: electrons of the sources,
 * present if `lit`. brim: lanes with a full well. */
INLINE chunk detect_chunk(bst_kernel_frame_params p, detector_maps maps, dark_law dark, near_law near,
                          const uint *steps, const tail_block *tail, uint counter, int row,
                          int column, chunk light, int lit, chunk_flags *brim) {
    chunk e, z = chunk_normal(chunk_random(p, counter, STREAM_NOISE));
    brim->a = brim->b = brim->c = brim->d = (int16)0;
    int struck = 0;
#ifdef OVERLAY
    size_t place = (size_t)row * MAP_STRIDE + column;
    chunk over;
    over.a = over.b = over.c = over.d = (float16)0.0f;
    struck = maps.overlay[MAP_CELLS + place / 64] != 0.0f;
    if (struck) {
        over = load_chunk(maps.overlay + place);
        lit = 1;
    }
#endif
#ifdef SHARED_MEAN
    if (!lit && dark.single) {
        e.a = respond(p, draw_single(dark.law, z.a));
        e.b = respond(p, draw_single(dark.law, z.b));
        e.c = respond(p, draw_single(dark.law, z.c));
        e.d = respond(p, draw_single(dark.law, z.d));
        return convert_chunk(p, maps, row, column, ADD_TAIL(tail, row, e));
    }
#ifdef SEARCH
    if (!lit && dark.steps > 0) {
        chunk q = dark_electrons(dark, steps, chunk_random(p, counter, STREAM_POISSON));
        e.a = read_out(p, q.a, z.a);
        e.b = read_out(p, q.b, z.b);
        e.c = read_out(p, q.c, z.c);
        e.d = read_out(p, q.d, z.d);
        return convert_chunk(p, maps, row, column, ADD_TAIL(tail, row, e));
    }
#endif
#endif
    size_t map = (size_t)row * MAP_STRIDE + column;
    chunk m = add_dark(p, maps, map, expected_chunk(p, maps, map, light));
    /* lane by lane, so that no pixel depends on its neighbours, which a window may not have */
    chunk_flags far = {(int16)-1, (int16)-1, (int16)-1, (int16)-1};
    if (near.serves) {
        chunk x;
        x.a = (m.a - near.mean) * near.per_reach;
        x.b = (m.b - near.mean) * near.per_reach;
        x.c = (m.c - near.mean) * near.per_reach;
        x.d = (m.d - near.mean) * near.per_reach;
        e.a = draw_single(law_near(near, x.a), z.a);
        e.b = draw_single(law_near(near, x.b), z.b);
        e.c = draw_single(law_near(near, x.c), z.c);
        e.d = draw_single(law_near(near, x.d), z.d);
        far.a = fabs(x.a) > 1.0f;
        far.b = fabs(x.b) > 1.0f;
        far.c = fabs(x.c) > 1.0f;
        far.d = fabs(x.d) > 1.0f;
    }
    int all_near = !any16((far.a | far.b) | (far.c | far.d));
    if (all_near && !struck) {
        e.a = respond(p, e.a);
        e.b = respond(p, e.b);
        e.c = respond(p, e.c);
        e.d = respond(p, e.d);
        return convert_chunk(p, maps, row, column, ADD_TAIL(tail, row, e));
    }
    e.a = any16(far.a) ? select(e.a, draw_single(noise_law_of(p, m.a), z.a), far.a) : e.a;
    e.b = any16(far.b) ? select(e.b, draw_single(noise_law_of(p, m.b), z.b), far.b) : e.b;
    e.c = any16(far.c) ? select(e.c, draw_single(noise_law_of(p, m.c), z.c), far.c) : e.c;
    e.d = any16(far.d) ? select(e.d, draw_single(noise_law_of(p, m.d), z.d), far.d) : e.d;
    chunk_flags two = {needs_two(p, m.a), needs_two(p, m.b), needs_two(p, m.c), needs_two(p, m.d)};
#ifdef OVERLAY
    if (struck) {
        e.a += over.a;
        e.b += over.b;
        e.c += over.c;
        e.d += over.d;
        two.a |= m.a + over.a > p.near_full_e;
        two.b |= m.b + over.b > p.near_full_e;
        two.c |= m.c + over.c > p.near_full_e;
        two.d |= m.d + over.d > p.near_full_e;
    }
#endif
    e.a = respond(p, e.a);
    e.b = respond(p, e.b);
    e.c = respond(p, e.c);
    e.d = respond(p, e.d);
    if (any16((two.a | two.b) | (two.c | two.d))) {
        chunk_words w = chunk_random(p, counter, STREAM_POISSON);
        chunk q, n = chunk_normal(chunk_random(p, counter, STREAM_POISSON_NORMAL));
        q.a = draw_charge(m.a, w.a, n.a, two.a);
        q.b = draw_charge(m.b, w.b, n.b, two.b);
        q.c = draw_charge(m.c, w.c, n.c, two.c);
        q.d = draw_charge(m.d, w.d, n.d, two.d);
#ifdef OVERLAY
        q.a += over.a;
        q.b += over.b;
        q.c += over.c;
        q.d += over.d;
#endif
        e.a = draw_pixels(p, e.a, q.a, z.a, two.a, &brim->a);
        e.b = draw_pixels(p, e.b, q.b, z.b, two.b, &brim->b);
        e.c = draw_pixels(p, e.c, q.c, z.c, two.c, &brim->c);
        e.d = draw_pixels(p, e.d, q.d, z.d, two.d, &brim->d);
    }
    return convert_chunk(p, maps, row, column, ADD_TAIL(tail, row, e));
}
