/* The detector: from expected electrons to digital numbers. Options: CF_ORDER (terms of the noise
 * law), SINGLE_FROM (means from here on take one deviate for shot and read noise together), SEARCH
 * (some means do not).
 *
 * Pixels are drawn in chunks of 64 columns of the full sensor, each from one Philox call per lane:
 * word v of lane l belongs to column 16 v + l. */

/* Means from here on take the expansion of the Poisson quantile, below it the exact search. At 30
 * the two laws differ by a total variation of 1.4e-5, which falls as the mean to the power -1.5. */
#define POISSON_SWITCH 30.0f

/* Philox streams (second counter word) of a pixel's noise. */
#define STREAM_NOISE 0u
#define STREAM_POISSON 1u
#define STREAM_POISSON_NORMAL 2u

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

/* Coefficients of digital numbers as a polynomial of a normal deviate. */
typedef struct noise_law {
    float16 c0, c1, c2, c3;
#if CF_ORDER >= 3
    float16 c4;
#endif
#if CF_ORDER >= 4
    float16 c5;
#endif
} noise_law;

/* Quantile of Poisson(mean) + normal(0, read noise), in digital numbers plus one half, as a
 * polynomial of the normal quantile z: the Cornish-Fisher expansion (Abramowitz and Stegun 26.2.49)
 * to order CF_ORDER of 1 / sigma. All cumulants beyond the variance are the mean, so with
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
    law.c5 = a3 * h5 * p.dn_per_e;
#endif
    law.c0 = fma(c0, (float16)p.dn_per_e, (float16)(p.offset_dn + 0.5f));
    law.c1 = c1 * p.dn_per_e;
    law.c2 = c2 * p.dn_per_e;
    law.c3 = c3 * p.dn_per_e;
    return law;
}

/* Digital numbers plus one half. */
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

/* What all pixels share that no source lights. */
typedef struct dark_law {
    noise_law law;
    int single; /* one deviate does */
    int steps;  /* of the search for a small mean; 0: the search does not do */
    float mean;
} dark_law;

#define MOST_STEPS 128

/* steps: the search's cumulated chances. poisson_search16 ends where these do. */
INLINE dark_law dark_law_of(bst_scene_params p, uint *steps) {
    dark_law dark;
    float16 mean = (float16)p.background_e;
    dark.law = noise_law_of(p, mean);
    dark.single = !any16(needs_two(p, mean));
    dark.steps = 0;
    dark.mean = p.background_e;
#ifdef SEARCH
    if (p.background_e < POISSON_SWITCH && p.background_e <= p.near_full_e) {
        float16 chance = first_chance(mean);
        uint sum = 0u;
        for (int k = 0; k < MOST_STEPS; k++) {
            uint part = convert_uint(chance.s0);
            if (part == 0u && p.background_e < (float)k) {
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

/* Digital numbers plus one half of `electrons` with read noise z. */
INLINE float16 read_out(bst_scene_params p, float16 electrons, float16 z) {
    return fma(fma((float16)p.read_noise_e, z, electrons), (float16)p.dn_per_e,
               (float16)(p.offset_dn + 0.5f));
}

/* Charge first, then read noise z: replaces dn in the lanes `two`; full: those with a full well. */
INLINE float16 draw_two(bst_scene_params p, float16 mean, float16 z, uint16 word, float16 w,
                        int16 two, float16 dn, int16 *full) {
    int16 small = mean < POISSON_SWITCH;
    float16 electrons = poisson_expand16(mean, w);
    int16 search = two & small;
    if (any16(search)) {
        electrons = select(electrons, poisson_search16(mean, word, search), small);
    }
    *full = two & (electrons >= p.full_well_e);
    electrons = fmin(electrons, p.full_well_e);
    return select(dn, read_out(p, electrons, z), two);
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

/* Digital numbers plus one half, not yet cut to the converter's range, of one chunk. counter: of
 * its first lane. light: electrons of the sources, some of them where `lit`. brim: lanes with a
 * full well. */
INLINE chunk detect_chunk(bst_scene_params p, dark_law dark, const uint *steps, uint counter,
                          chunk light, int lit, chunk_flags *brim) {
    chunk dn, z = chunk_normal(chunk_random(p, counter, STREAM_NOISE));
    brim->a = brim->b = brim->c = brim->d = (int16)0;
    if (!lit && dark.single) {
        dn.a = draw_single(dark.law, z.a);
        dn.b = draw_single(dark.law, z.b);
        dn.c = draw_single(dark.law, z.c);
        dn.d = draw_single(dark.law, z.d);
        return dn;
    }
#ifdef SEARCH
    if (!lit && dark.steps > 0) {
        chunk e = dark_electrons(dark, steps, chunk_random(p, counter, STREAM_POISSON));
        dn.a = read_out(p, e.a, z.a);
        dn.b = read_out(p, e.b, z.b);
        dn.c = read_out(p, e.c, z.c);
        dn.d = read_out(p, e.d, z.d);
        return dn;
    }
#endif
    chunk m;
    m.a = light.a + p.background_e;
    m.b = light.b + p.background_e;
    m.c = light.c + p.background_e;
    m.d = light.d + p.background_e;
    dn.a = draw_single(noise_law_of(p, m.a), z.a);
    dn.b = draw_single(noise_law_of(p, m.b), z.b);
    dn.c = draw_single(noise_law_of(p, m.c), z.c);
    dn.d = draw_single(noise_law_of(p, m.d), z.d);
    chunk_flags two;
    two.a = needs_two(p, m.a);
    two.b = needs_two(p, m.b);
    two.c = needs_two(p, m.c);
    two.d = needs_two(p, m.d);
    if (any16((two.a | two.b) | (two.c | two.d))) {
        chunk_words w = chunk_random(p, counter, STREAM_POISSON);
        chunk n = chunk_normal(chunk_random(p, counter, STREAM_POISSON_NORMAL));
        dn.a = draw_two(p, m.a, z.a, w.a, n.a, two.a, dn.a, &brim->a);
        dn.b = draw_two(p, m.b, z.b, w.b, n.b, two.b, dn.b, &brim->b);
        dn.c = draw_two(p, m.c, z.c, w.c, n.c, two.c, dn.c, &brim->c);
        dn.d = draw_two(p, m.d, z.d, w.d, n.d, two.d, dn.d, &brim->d);
    }
    return dn;
}
