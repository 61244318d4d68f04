/* The detector: from expected electrons to digital numbers, 16 pixels at a time. */

/* Means from here on take the expansion, below it the exact search. At 30 the two laws differ by a
 * total variation of 1.4e-5, which falls as the mean to the power -1.5. */
#define POISSON_SWITCH 30.0f

/* High and low words of the 32 x 32 bit products constant * v, as even and odd 64-bit products. */
static void wide_mul(ulong factor, uint16 v, uint16 *high, uint16 *low) {
    const ulong8 mask = (ulong8)0xFFFFFFFFul;
    ulong8 pairs = as_ulong8(v);
    ulong8 even = (pairs & mask) * factor, odd = (pairs >> 32) * factor;
    *high = as_uint16((even >> 32) | (odd & ~mask));
    *low = as_uint16((even & mask) | (odd << 32));
}

/* bst_philox4x32 (philox_shared.h) for 16 counters (c0, 0, c2, c3); three of its words. */
static void philox16(uint key0, uint key1, uint16 c0, uint counter2, uint counter3, uint16 *w0,
                     uint16 *w2, uint16 *w3) {
    uint16 c1 = (uint16)0u, c2 = (uint16)counter2, c3 = (uint16)counter3;
    for (int round = 0; round < 10; round++) {
        uint16 h0, l0, h1, l1;
        wide_mul(0xD2511F53ul, c0, &h0, &l0);
        wide_mul(0xCD9E8D57ul, c2, &h1, &l1);
        c0 = h1 ^ c1 ^ key0;
        c1 = l1;
        c2 = h0 ^ c3 ^ key1;
        c3 = l0;
        key0 += 0x9E3779B9u;
        key1 += 0xBB67AE85u;
    }
    *w0 = c0;
    *w2 = c2;
    *w3 = c3;
}

/* Uniform in (0, 1]: (word + 1/2) / 2^32, rounded to float. */
static float16 unit16(uint16 word) {
    return fma(convert_float16(word), 0x1p-32f, 0x1p-33f);
}

/* Natural logarithm of u in [2^-33, 1]: exponent, and 2 atanh((m - 1) / (m + 1)) of the mantissa
 * m in [sqrt(1/2), sqrt(2)); the series' first neglected term is 3e-9. */
static float16 log16(float16 u) {
    int16 bits = as_int16(u) - 0x3F3504F3; /* sqrt(1/2) */
    int16 exponent = bits >> 23;
    float16 m = as_float16((bits & 0x007FFFFF) + 0x3F3504F3);
    float16 s = (m - 1.0f) / (m + 1.0f), q = s * s;
    float16 series = 1.0f + q * (1.0f / 3 + q * (1.0f / 5 + q * (1.0f / 7 + q * (1.0f / 9))));
    return convert_float16(exponent) * 0.69314718f + 2.0f * s * series;
}

/* Two independent standard normals (Box and Muller 1958). The angle's two high bits choose the
 * quadrant, the rest an angle in [-pi/4, pi/4), where short Taylor series serve. */
static void normal16(uint16 radius_word, uint16 angle_word, float16 *z0, float16 *z1) {
    float16 radius = sqrt(fmax(-2.0f * log16(unit16(radius_word)), 0.0f));
    float16 a = convert_float16(as_int16(angle_word << 2)) * (0x1p-32f * 1.57079633f);
    float16 q = a * a;
    float16 sine =
        a * (1.0f + q * (-1.0f / 6 + q * (1.0f / 120 + q * (-1.0f / 5040 + q * (1.0f / 362880)))));
    float16 cosine = 1.0f + q * (-0.5f + q * (1.0f / 24 + q * (-1.0f / 720 + q * (1.0f / 40320))));
    int16 swap = as_int16(angle_word << 1); /* sign bit: bit 30 */
    uint16 sign = angle_word & 0x80000000u;
    float16 c = select(cosine, -sine, swap);
    float16 s = select(sine, cosine, swap);
    *z0 = as_float16(as_uint16(c) ^ sign) * radius;
    *z1 = as_float16(as_uint16(s) ^ sign) * radius;
}

/* Poisson deviates of mean < POISSON_SWITCH by sequential search of the distribution (Devroye 1986,
 * III.2), all lanes in step; lanes outside `wanted` give 0. */
static float16 poisson_search16(float16 mean, float16 u, int16 wanted) {
    float16 count = (float16)0.0f;
    float16 p = exp(-fmin(mean, POISSON_SWITCH));
    float16 rest = u;
    int16 active = wanted & (rest > p);
    /* the bound is never reached: the mean is below 30 and the search ends where p fades */
    for (int k = 0; any16(active) && k < 200;) {
        for (int step = 0; step < 4; step++) { /* lanes that are done ignore the steps too many */
            k++;
            rest = select(rest, rest - p, active);
            count = select(count, (float16)(float)k, active);
            p *= mean * (1.0f / (float)k);
            /* beyond the mode a p below 2^-30 is less than u resolves: the search ends */
            active &= (rest > p) & ((p > 0x1p-30f) | (mean > (float)k));
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

/* Digital numbers of 16 neighbouring pixels. `first`: full-sensor index of the first one. mean:
 * expected electrons. full: set where the well is full or the converter at its top. */
static ushort16 detect16(bst_scene_params p, uint first, float16 mean, int16 *full) {
    const uint16 lanes = (uint16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
    uint16 w0, w2, w3;
    philox16(p.key0, p.key1, first + lanes, p.exposure_low, p.exposure_high, &w0, &w2, &w3);
    float16 z0, z1;
    normal16(w2, w3, &z0, &z1);
    int16 small = mean < POISSON_SWITCH;
    float16 electrons = (float16)0.0f;
    if (any16(small)) {
        electrons = poisson_search16(mean, unit16(w0), small);
    }
    if (any16(~small)) {
        electrons = select(poisson_expand16(mean, z0), electrons, small);
    }
    int16 well = electrons >= p.full_well_e;
    electrons = fmin(electrons, p.full_well_e);
    float16 dn = floor((electrons + p.read_noise_e * z1) * p.dn_per_e + (p.offset_dn + 0.5f));
    *full = well | (dn >= p.max_dn);
    return convert_ushort16(clamp(dn, 0.0f, p.max_dn));
}
