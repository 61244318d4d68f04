/* The detector: from expected electrons to digital numbers. Options: CF_ORDER (terms of the noise
 * law), SINGLE_FROM (means from here on take one deviate for shot and read noise together).
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

/* Four vectors: one chunk of 64 pixels. */
typedef struct chunk {
    float16 v[4];
} chunk;

typedef struct chunk_words {
    uint16 v[4];
} chunk_words;

/* Coefficients of digital numbers as a polynomial of a normal deviate. */
typedef struct noise_law {
    float16 c[CF_ORDER + 2];
} noise_law;

/* Quantile of Poisson(mean) + normal(0, read noise), in digital numbers plus one half, as a
 * polynomial of the normal quantile z: the Cornish-Fisher expansion (Abramowitz and Stegun 26.2.49)
 * to order CF_ORDER of 1 / sigma. All cumulants beyond the variance are the mean, so with
 * a = 1 / sigma, b = mean / sigma^2 the standardised ones are b a, b a^2, b a^3, b a^4. */
static noise_law noise_law_of(bst_scene_params p, float16 mean) {
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
    law.c[4] = a2 *
               fma(b3, (float16)(1.0f / 27), fma(b2, (float16)(-1.0f / 24), b * (1.0f / 120))) *
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
    law.c[5] = a3 * h5 * p.dn_per_e;
#endif
    law.c[0] = fma(c0, (float16)p.dn_per_e, (float16)(p.offset_dn + 0.5f));
    law.c[1] = c1 * p.dn_per_e;
    law.c[2] = c2 * p.dn_per_e;
    law.c[3] = c3 * p.dn_per_e;
    return law;
}

/* Digital numbers plus one half. */
static float16 draw_single(const noise_law *law, float16 z) {
    float16 dn = law->c[CF_ORDER + 1];
    for (int i = CF_ORDER; i >= 0; i--) {
        dn = fma(dn, z, law->c[i]);
    }
    return dn;
}

/* A step of the search below: the probability of k events in units of 2^-32, and the next one's.
 * The chances are made smaller by 5e-7 of themselves, so that they never add up to more than one.
 */
static float16 first_chance(float16 mean) {
    return exp(-fmin(mean, POISSON_SWITCH)) * (0x1p32f * (1.0f - 5e-7f));
}

/* Poisson deviates of mean < POISSON_SWITCH by sequential search of the distribution (Devroye 1986,
 * III.2), in integers, all lanes in step; lanes outside `wanted` give 0. What rounding leaves of
 * the words (5e-7 of them) gives the mean. */
static float16 poisson_search16(float16 mean, uint16 word, int16 wanted) {
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
static float16 poisson_expand16(float16 mean, float16 w) {
    float16 root = sqrt(mean), q = w * w;
    float16 whole = floor(mean);
    float16 d = (mean - whole) + root * w + (1.0f / 3 + q * (1.0f / 6)) -
                w * (1.0f / 36 + q * (1.0f / 72)) / root +
                (-8.0f / 405 + q * (7.0f / 810 + q * (1.0f / 270))) / mean;
    return fmax(whole + floor(d), 0.0f);
}

/* Lanes for which one deviate does not do: small means with little read noise, and those near the
 * full well, where the charge is cut before the read noise comes. */
static int16 needs_two(bst_scene_params p, float16 mean) {
    return (mean < SINGLE_FROM) | (mean > p.near_full_e);
}

/* Charge first, then read noise z: replaces dn in the lanes `two`; full: those with a full well. */
static float16 draw_two(bst_scene_params p, float16 mean, float16 z, uint16 word, float16 w,
                        int16 two, float16 dn, int16 *full) {
    int16 small = mean < POISSON_SWITCH;
    float16 electrons = poisson_expand16(mean, w);
    int16 search = two & small;
    if (any16(search)) {
        electrons = select(electrons, poisson_search16(mean, word, search), small);
    }
    *full = two & (electrons >= p.full_well_e);
    electrons = fmin(electrons, p.full_well_e);
    float16 exact = fma(fma((float16)p.read_noise_e, z, electrons), (float16)p.dn_per_e,
                        (float16)(p.offset_dn + 0.5f));
    return select(dn, exact, two);
}

/* One chunk's mean when no source lights it, and what follows from it. */
typedef struct dark_law {
    noise_law law;
    int single; /* one deviate does */
} dark_law;

static dark_law dark_law_of(bst_scene_params p) {
    dark_law dark;
    float16 mean = (float16)p.background_e;
    dark.law = noise_law_of(p, mean);
    dark.single = !any16(needs_two(p, mean));
    return dark;
}

/* Digital numbers plus one half, not yet cut to the converter's range, of one chunk. counter: of
 * its first lane. light: electrons of the sources. brim: lanes with a full well. */
static void detect_chunk(bst_scene_params p, const dark_law *dark, uint counter, const chunk *light,
                         int lit, chunk *dn, int16 *brim) {
    const uint16 lanes = (uint16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
    uint16 w0, w1, w2, w3;
    chunk z;
    philox16(p, counter + lanes, STREAM_NOISE, &w0, &w1, &w2, &w3);
    normal16(w0, w1, &z.v[0], &z.v[1]);
    normal16(w2, w3, &z.v[2], &z.v[3]);
    for (int i = 0; i < 4; i++) {
        brim[i] = (int16)0;
    }
    if (!lit && dark->single) {
        for (int i = 0; i < 4; i++) {
            dn->v[i] = draw_single(&dark->law, z.v[i]);
        }
        return;
    }
    chunk mean;
    int16 two[4], any_two = (int16)0;
    for (int i = 0; i < 4; i++) {
        mean.v[i] = light->v[i] + p.background_e;
        noise_law law = noise_law_of(p, mean.v[i]);
        dn->v[i] = draw_single(&law, z.v[i]);
        two[i] = needs_two(p, mean.v[i]);
        any_two |= two[i];
    }
    if (any16(any_two)) {
        chunk w;
        uint16 words[4], n0, n1, n2, n3;
        philox16(p, counter + lanes, STREAM_POISSON, &words[0], &words[1], &words[2], &words[3]);
        philox16(p, counter + lanes, STREAM_POISSON_NORMAL, &n0, &n1, &n2, &n3);
        normal16(n0, n1, &w.v[0], &w.v[1]);
        normal16(n2, n3, &w.v[2], &w.v[3]);
        for (int i = 0; i < 4; i++) {
            dn->v[i] = draw_two(p, mean.v[i], z.v[i], words[i], w.v[i], two[i], dn->v[i], &brim[i]);
        }
    }
}
