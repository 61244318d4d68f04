/* The detector: from expected electrons to digital numbers. Options: CF_ORDER (terms of the noise
 * law), SINGLE_FROM (means from here on take one deviate for shot and read noise together), SEARCH
 * (some means do not); GAIN_MAP, DARK_MAP (response and dark current of each pixel), OVERLAY
 * (charge that is there besides the light's), NONLINEAR (with C1, C2, C3), TAIL (with
 * TAIL_COARSE, TAIL_FINE, TAIL_RMS), OFFSETS (of columns and rows), CODES (a table from digital numbers to
 * the frame's).
 *
 * Pixels are drawn in chunks of 64 columns of the full sensor, each from one Philox call per lane:
 * word v of lane l belongs to column 16 v + l. */

/* gain, dark (e/s), overlay (e): [sensor rows][MAP_STRIDE], a multiple of 64. The overlay's
 * MAP_CELLS pixels are followed by a mark for each chunk of 64, not 0 where one of them is struck.
 * offsets (DN): columns [MAP_STRIDE], then rows. */
typedef struct detector_maps {
    global const float *gain, *dark, *overlay, *offsets;
    global const ushort *codes;
} detector_maps;

/* Means from here on take the expansion of the Poisson quantile, below it the exact search. At 30
 * the two laws differ by a total variation of 1.4e-5, which falls as the mean to the power -1.5. */
#define POISSON_SWITCH 30.0f

/* Philox streams (second counter word) of a pixel's noise. */
#define STREAM_NOISE 0u
#define STREAM_POISSON 1u
#define STREAM_POISSON_NORMAL 2u
#define STREAM_TAIL 3u
#define STREAM_TAIL_NORMAL 4u

/* Four vectors: one chunk of 64 pixels. Loops over them would not be unrolled by every compiler,
 * and would go through memory. */
typedef struct chunk {
    float16 a, b, c, d;
} chunk;

typedef struct chunk_words {
    uint16 a, b, c, d;
} chunk_words;

typedef struct chunk_flags {
    int16 a, b, c, d;
} chunk_flags;

/* Coefficients of electrons, shot and read noise, as a polynomial of a normal deviate. */
typedef struct noise_law {
    float16 c0, c1, c2, c3;
#if CF_ORDER >= 3
    float16 c4;
#endif
#if CF_ORDER >= 4
    float16 c5;
#endif
} noise_law;

/* Quantile of Poisson(mean) + normal(0, read noise), as a polynomial of the normal quantile z: the
 * Cornish-Fisher expansion (Abramowitz and Stegun 26.2.49) to order CF_ORDER of 1 / sigma. All cumulants beyond the variance are the mean, so with
 * a = 1 / sigma, b = mean / sigma^2 the standardised ones are b a, b a^2, b a^3, b a^4. */
INLINE noise_law noise_law_of(bst_scene_params p, float16 mean) {
    noise_law law;
    float16 variance = fma((float16)p.read_noise_e, (float16)p.read_noise_e, mean);
    float16 a = rsqrt16(variance), a2 = a * a, b = mean * a2, b2 = b * b;
    float16 c0 = fma(b, (float16)(-1.0f / 6), mean);
    float16 c1 = fma(a, fma(b2, (float16)(5.0f / 36), b * (-1.0f / 8)), variance * a);
    float16 c2 = b * (1.0f / 6);
    float16 c3 = a * fma(b2, (float16)(-1.0f / 18), b * (1.0f / 24));
#if CF_ORDER >= 3
    float16 b3 = b2 * b;
    c0 = fma(a2, fma(b3, (float16)(17.0f / 324), fma(b2, (float16)(-1.0f / 12), b * (1.0f / 40))),
             c0);
    c2 = fma(a2, fma(b3, (float16)(-53.0f / 324), fma(b2, (float16)(5.0f / 24), b * (-1.0f / 20))),
             c2);
    law.c4 = a2 * fma(b3, (float16)(1.0f / 27), fma(b2, (float16)(-1.0f / 24), b * (1.0f / 120))) *
             p.dn_per_e;
#endif
#if CF_ORDER >= 4
    /* He5, He3, He1 of the fourth order, gathered by powers of z */
    float16 a3 = a2 * a, b4 = b2 * b2;
    float16 h5 = fma(b4, (float16)(-252.0f / 7776),
                     fma(b3, (float16)(14.0f / 288),
                         fma(b2, (float16)(-3.0f / 384 - 2.0f / 180), b * (1.0f / 720))));
    float16 h3 = fma(b4, (float16)(-832.0f / 7776),
                     fma(b3, (float16)(37.0f / 288), b2 * (-6.0f / 384 - 3.0f / 180)));
    float16 h1 =
        fma(b4, (float16)(-227.0f / 7776), fma(b3, (float16)(8.0f / 288), b2 * (-2.0f / 384)));
    c1 = fma(a3, fma(h5, (float16)15.0f, fma(h3, (float16)-3.0f, h1)), c1);
    c3 = fma(a3, fma(h5, (float16)-10.0f, h3), c3);
    law.c5 = a3 * h5;
#endif
    law.c0 = c0;
    law.c1 = c1;
    law.c2 = c2;
    law.c3 = c3;
    return law;
}

/* Electrons with shot and read noise. */
INLINE float16 draw_single(noise_law law, float16 z) {
    float16 dn = law.c3;
#if CF_ORDER >= 4
    dn = fma(fma(law.c5, z, law.c4), z, dn);
#elif CF_ORDER >= 3
    dn = fma(law.c4, z, dn);
#endif
    return fma(fma(fma(dn, z, law.c2), z, law.c1), z, law.c0);
}

/* The chance of no event in units of 2^-32, where the search below begins.
 * The chances are made smaller by 5e-7 of themselves, so that they never add up to more than one.
 */
INLINE float16 first_chance(float16 mean) {
    return exp(-fmin(mean, POISSON_SWITCH)) * (0x1p32f * (1.0f - 2e-6f));
}

/* Poisson deviates of mean < POISSON_SWITCH by sequential search of the distribution (Devroye 1986,
 * III.2), in integers, all lanes in step; lanes outside `wanted` give 0. What rounding leaves of
 * the words (2e-6 of them) gives the mean. */
INLINE float16 poisson_search16(float16 mean, uint16 word, int16 wanted) {
    float16 count = (float16)0.0f, p = first_chance(mean);
    uint16 rest = word;
    int16 active = wanted;
    for (int k = 0; any16(active) && k < 200;) {
        for (int step = 0; step < 4; step++) { /* lanes that are done ignore the steps too many */
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

/* Lanes for which one deviate does not do: small means with little read noise, and those near the
 * full well, where the charge is cut before the read noise comes. */
INLINE int16 needs_two(bst_scene_params p, float16 mean) {
    return (mean < SINGLE_FROM) | (mean > p.near_full_e);
}

/* What the amplifier makes of a charge. */
INLINE float16 respond(bst_scene_params p, float16 e) {
#ifdef NONLINEAR
    float16 u = e * p.per_full_well;
    e = fma(e, u * fma(u, fma(u, (float16)C3, (float16)C2), (float16)C1), e);
#endif
    return e;
}

INLINE float16 read_out(bst_scene_params p, float16 charge, float16 z) {
    return fma((float16)p.read_noise_e, z, respond(p, charge));
}

/* Charge from two words: a uniform one, and one that made the normal deviate w. */
INLINE float16 draw_charge(float16 mean, uint16 word, float16 w, int16 wanted) {
    int16 small = mean < POISSON_SWITCH;
    float16 electrons = poisson_expand16(mean, w);
    int16 search = wanted & small;
    if (any16(search)) {
        electrons = select(electrons, poisson_search16(mean, word, search), small);
    }
    return electrons;
}

INLINE chunk_words chunk_random(bst_scene_params p, uint counter, uint stream) {
    chunk_words w;
    philox16(p, counter, stream, &w.a, &w.b, &w.c, &w.d);
    return w;
}

INLINE chunk chunk_normal(chunk_words w) {
    chunk z;
    normal16(w.a, w.b, &z.a, &z.b);
    normal16(w.c, w.d, &z.c, &z.d);
    return z;
}

INLINE chunk load_chunk(global const float *from) {
    global const float16 *v = (global const float16 *)from;
    chunk c = {v[0], v[1], v[2], v[3]};
    return c;
}

/* Expected electrons of one chunk from its light; map: of its first pixel. */
INLINE chunk expected_chunk(bst_scene_params p, detector_maps maps, size_t map, chunk light) {
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

INLINE chunk add_dark(bst_scene_params p, detector_maps maps, size_t map, chunk m) {
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

#ifdef TAIL
/* Adds the excess noise of the reads in the tail. Of 256 reads TAIL_COARSE are chosen by the low bits
 * of the words that made the read noise, which the deviates, as floats, are too coarse to feel; of
 * those the share TAIL_FINE by words of their own. */
INLINE chunk add_tail(bst_scene_params p, uint counter, chunk_words noise, chunk e) {
    const uint below = (uint)(TAIL_FINE * 4294967295.0);
    int16 a = (noise.a & 255u) < TAIL_COARSE, b = (noise.b & 255u) < TAIL_COARSE;
    int16 c = (noise.c & 255u) < TAIL_COARSE, d = (noise.d & 255u) < TAIL_COARSE;
    if (!any16((a | b) | (c | d))) {
        return e;
    }
    chunk_words w = chunk_random(p, counter, STREAM_TAIL);
    a &= w.a <= below;
    b &= w.b <= below;
    c &= w.c <= below;
    d &= w.d <= below;
    if (any16((a | b) | (c | d))) {
        chunk z = chunk_normal(chunk_random(p, counter, STREAM_TAIL_NORMAL));
        e.a += select((float16)0.0f, z.a * TAIL_RMS, a);
        e.b += select((float16)0.0f, z.b * TAIL_RMS, b);
        e.c += select((float16)0.0f, z.c * TAIL_RMS, c);
        e.d += select((float16)0.0f, z.d * TAIL_RMS, d);
    }
    return e;
}
#endif

/* Electrons to digital numbers plus one half, not yet cut to the converter's range. row, column: of
 * the first pixel on the sensor; noise: the words that made the read noise. */
INLINE chunk convert_chunk(bst_scene_params p, detector_maps maps, uint counter, int row,
                           int column, chunk_words noise, chunk e) {
#ifdef TAIL
    e = add_tail(p, counter, noise, e);
#endif
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

/* What all pixels share that no source lights. */
typedef struct dark_law {
    noise_law law;
    int single; /* one deviate does */
    int steps;  /* of the search for a small mean; 0: the search does not do */
    float mean;
} dark_law;

#define MOST_STEPS 128

#if !defined(GAIN_MAP) && !defined(DARK_MAP)
#define SHARED_MEAN
#endif

/* steps: the search's cumulated chances. poisson_search16 ends where these do. */
INLINE dark_law dark_law_of(bst_scene_params p, uint *steps) {
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
/* The search's end for the words of a dark chunk, counted instead of walked to. */
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

/* Electrons of 16 pixels, where `two` charge first, then read noise. full: lanes with a full well.
 */
INLINE float16 draw_pixels(bst_scene_params p, float16 single, float16 charge, float16 z, int16 two,
                           int16 *full) {
    *full = two & (charge >= p.full_well_e);
    return select(single, read_out(p, fmin(charge, p.full_well_e), z), two);
}

/* Digital numbers plus one half, not yet cut to the converter's range, of one chunk. counter: of
 * its first lane. row, column: of its first pixel on the sensor. light: electrons of the sources,
 * some of them where `lit`. brim: lanes with a full well. */
INLINE chunk detect_chunk(bst_scene_params p, detector_maps maps, dark_law dark, const uint *steps,
                          uint counter, int row, int column, chunk light, int lit,
                          chunk_flags *brim) {
    chunk_words noise = chunk_random(p, counter, STREAM_NOISE);
    chunk e, z = chunk_normal(noise);
    brim->a = brim->b = brim->c = brim->d = (int16)0;
#ifdef OVERLAY
    size_t place = (size_t)row * MAP_STRIDE + column;
    chunk over;
    over.a = over.b = over.c = over.d = (float16)0.0f;
    int struck = maps.overlay[MAP_CELLS + place / 64] != 0.0f;
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
        return convert_chunk(p, maps, counter, row, column, noise, e);
    }
#ifdef SEARCH
    if (!lit && dark.steps > 0) {
        chunk q = dark_electrons(dark, steps, chunk_random(p, counter, STREAM_POISSON));
        e.a = read_out(p, q.a, z.a);
        e.b = read_out(p, q.b, z.b);
        e.c = read_out(p, q.c, z.c);
        e.d = read_out(p, q.d, z.d);
        return convert_chunk(p, maps, counter, row, column, noise, e);
    }
#endif
#endif
    size_t map = (size_t)row * MAP_STRIDE + column;
    chunk m = add_dark(p, maps, map, expected_chunk(p, maps, map, light));
    e.a = draw_single(noise_law_of(p, m.a), z.a);
    e.b = draw_single(noise_law_of(p, m.b), z.b);
    e.c = draw_single(noise_law_of(p, m.c), z.c);
    e.d = draw_single(noise_law_of(p, m.d), z.d);
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
    return convert_chunk(p, maps, counter, row, column, noise, e);
}
