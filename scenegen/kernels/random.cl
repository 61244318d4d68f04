/* Random numbers, 16 lanes at a time: Philox4x32, normal deviates, elementary functions. */

/* Number of rounds with which Philox passes TestU01's BigCrush; host streams use three more, as its
 * authors recommend (philox_shared.h). */
#define PHILOX_ROUNDS 7

/* A Philox round for 8 counters, a word in the low half of each lane (the high halves are ignored).
 * (c0, c1, c2, c3) becomes (high(M1 c2) ^ c1 ^ key0, low(M1 c2), high(M0 c0) ^ c3 ^ key1, low(M0
 * c0)). */
#define PHILOX_ROUND(c0, c1, c2, c3, k0, k1)                    \
    do {                                                        \
        ulong8 p0 = ((c0)&0xFFFFFFFFul) * (ulong8)0xD2511F53ul; \
        ulong8 p1 = ((c2)&0xFFFFFFFFul) * (ulong8)0xCD9E8D57ul; \
        c0 = (p1 >> 32) ^ (c1) ^ (ulong)(k0);                   \
        c2 = (p0 >> 32) ^ (c3) ^ (ulong)(k1);                   \
        c1 = p1;                                                \
        c3 = p0;                                                \
    } while (0)

/* Low halves of even and odd lanes, as a shuffle: compilers turn a shift into a slow product. */
INLINE uint16 low_words(ulong8 even, ulong8 odd) {
    uint16 e = as_uint16(even), o = as_uint16(odd);
    return (uint16)(e.s0, o.s0, e.s2, o.s2, e.s4, o.s4, e.s6, o.s6, e.s8, o.s8, e.sa, o.sa, e.sc,
                    o.sc, e.se, o.se);
}

/* Philox4x32 (Salmon, Moraes, Dror and Shaw 2011) for the counters (first + lane, stream,
 * exposure_low, exposure_high); even and odd lanes separately, because a product fills 64 bits. */
INLINE void philox16(bst_kernel_frame_params p, uint first, uint stream, uint16 *w0, uint16 *w1,
                     uint16 *w2, uint16 *w3) {
    ulong8 a0 = (ulong8)(0, 2, 4, 6, 8, 10, 12, 14) + (ulong)first, b0 = a0 + 1ul;
    ulong8 a1 = (ulong8)stream, b1 = a1;
    ulong8 a2 = (ulong8)p.exposure_low, b2 = a2;
    ulong8 a3 = (ulong8)p.exposure_high, b3 = a3;
    uint k0 = p.key0, k1 = p.key1;
#pragma unroll
    for (int round = 0; round < PHILOX_ROUNDS; round++) {
        PHILOX_ROUND(a0, a1, a2, a3, k0, k1);
        PHILOX_ROUND(b0, b1, b2, b3, k0, k1);
        k0 += 0x9E3779B9u;
        k1 += 0xBB67AE85u;
    }
    *w0 = low_words(a0, b0);
    *w1 = low_words(a1, b1);
    *w2 = low_words(a2, b2);
    *w3 = low_words(a3, b3);
}

/* 1 / sqrt(v), v > 0, to 5e-6: Newton's iteration from half the exponent, several times faster than
 * division. */
INLINE float16 rsqrt16(float16 v) {
    float16 y = as_float16((int16)0x5F375A86 - (as_int16(v) >> 1));
    float16 h = -0.5f * v;
    y *= fma(h * y, y, (float16)1.5f);
    y *= fma(h * y, y, (float16)1.5f);
    return y;
}

/* -2 ln((word + 1/2) / 2^32): exponent, and 2 atanh(s), s = (m - 1) / (m + 1), of the mantissa m in
 * [sqrt(1/2), sqrt(2)); the series' first neglected term is 3e-9. */
INLINE float16 log_radius2(uint16 word) {
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

/* Two independent standard normals (Box and Muller 1958). The angle's two high bits select the
 * quadrant, the others an angle in [-pi/4, pi/4) for short Taylor series. */
INLINE void normal16(uint16 radius_word, uint16 angle_word, float16 *z0, float16 *z1) {
    float16 square = fmax(log_radius2(radius_word), 1e-12f);
    float16 radius = sqrt(square);
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
    radius = as_float16(as_uint16(radius) ^ (angle_word & 0x80000000u));
    float16 c = select(cosine, -sine, swap);
    float16 s = select(sine, cosine, swap);
    *z0 = c * radius;
    *z1 = s * radius;
}
