/* Random numbers, 16 lanes at a time: Philox4x32-10, normal deviates, elementary functions. */

/* High and low words of the 32 x 32 bit products constant * v, as even and odd 64-bit products. */
static void wide_mul(ulong factor, uint16 v, uint16 *high, uint16 *low) {
    const ulong8 mask = (ulong8)0xFFFFFFFFul;
    ulong8 pairs = as_ulong8(v);
    ulong8 even = (pairs & mask) * factor, odd = (pairs >> 32) * factor;
    *high = as_uint16((even >> 32) | (odd & ~mask));
    *low = as_uint16((even & mask) | (odd << 32));
}

/* bst_philox4x32 (philox_shared.h) for 16 counters (c0, stream, exposure_low, exposure_high). */
static void philox16(bst_scene_params p, uint16 c0, uint stream, uint16 *w0, uint16 *w1, uint16 *w2,
                     uint16 *w3) {
    uint16 c1 = (uint16)stream, c2 = (uint16)p.exposure_low, c3 = (uint16)p.exposure_high;
    uint key0 = p.key0, key1 = p.key1;
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
    *w1 = c1;
    *w2 = c2;
    *w3 = c3;
}

/* 1 / sqrt(v), v > 0: Newton's iteration from the exponent's half; exact to a few units of the last
 * place, and several times faster than the divider. */
static float16 rsqrt16(float16 v) {
    float16 y = as_float16((int16)0x5F375A86 - (as_int16(v) >> 1));
    float16 h = -0.5f * v;
    y *= fma(h * y, y, (float16)1.5f);
    y *= fma(h * y, y, (float16)1.5f);
    y *= fma(h * y, y, (float16)1.5f);
    return y;
}

/* -2 ln((word + 1/2) / 2^32): exponent, and 2 atanh(s), s = (m - 1) / (m + 1), of the mantissa m in
 * [sqrt(1/2), sqrt(2)); the series' first neglected term is 3e-9. */
static float16 log_radius2(uint16 word) {
    float16 u = fma(convert_float16(word), (float16)0x1p-32f, (float16)0x1p-33f);
    int16 bits = as_int16(u) - 0x3F3504F3; /* sqrt(1/2) */
    int16 exponent = bits >> 23;
    float16 m = as_float16((bits & 0x007FFFFF) + 0x3F3504F3);
    float16 s = (m - 1.0f) / (m + 1.0f), q = s * s;
    float16 series =
        fma(q, fma(q, fma(q, (float16)(-4.0f / 7), (float16)(-4.0f / 5)), (float16)(-4.0f / 3)),
            (float16)-4.0f);
    return fma(convert_float16(exponent), (float16)-1.38629436f, s * series);
}

/* Two independent standard normals (Box and Muller 1958). The angle's two high bits choose the
 * quadrant, the rest an angle in [-pi/4, pi/4), where short Taylor series serve. */
static void normal16(uint16 radius_word, uint16 angle_word, float16 *z0, float16 *z1) {
    float16 square = fmax(log_radius2(radius_word), 1e-12f);
    float16 radius = square * rsqrt16(square);
    float16 a = convert_float16(as_int16(angle_word << 2)) * (0x1p-32f * 1.57079633f);
    float16 q = a * a;
    float16 sine =
        a *
        fma(q, fma(q, fma(q, (float16)(-1.0f / 5040), (float16)(1.0f / 120)), (float16)(-1.0f / 6)),
            (float16)1.0f);
    float16 cosine = fma(
        q,
        fma(q,
            fma(q, fma(q, (float16)(1.0f / 40320), (float16)(-1.0f / 720)), (float16)(1.0f / 24)),
            (float16)-0.5f),
        (float16)1.0f);
    int16 swap = as_int16(angle_word << 1); /* sign bit: bit 30 */
    uint16 sign = angle_word & 0x80000000u;
    float16 c = select(cosine, -sine, swap);
    float16 s = select(sine, cosine, swap);
    *z0 = as_float16(as_uint16(c) ^ sign) * radius;
    *z1 = as_float16(as_uint16(s) ^ sign) * radius;
}
