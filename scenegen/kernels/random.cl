/* Random numbers for the lanes of a work-item: Philox4x32, normal deviates, elementary functions. */

/* Number of rounds with which Philox passes TestU01's BigCrush; host streams use three more, as its
 * authors recommend (philox_shared.h). */
#define PHILOX_ROUNDS 7

#ifdef ONE_LANE
/* Philox4x32 (Salmon, Moraes, Dror and Shaw 2011) for the counter (first, stream, exposure_low,
 * exposure_high). */
INLINE void philox_lanes(bst_kernel_frame_params p, uint first, uint stream, uint *w0, uint *w1,
                         uint *w2, uint *w3) {
    uint c0 = first, c1 = stream, c2 = p.exposure_low, c3 = p.exposure_high;
    uint k0 = p.key0, k1 = p.key1;
#pragma unroll
    for (int round = 0; round < PHILOX_ROUNDS; round++) {
        uint high0 = mul_hi(c0, 0xD2511F53u), high1 = mul_hi(c2, 0xCD9E8D57u);
        uint low0 = c0 * 0xD2511F53u, low1 = c2 * 0xCD9E8D57u;
        c0 = high1 ^ c1 ^ k0;
        c1 = low1;
        c2 = high0 ^ c3 ^ k1;
        c3 = low0;
        k0 += 0x9E3779B9u;
        k1 += 0xBB67AE85u;
    }
    *w0 = c0;
    *w1 = c1;
    *w2 = c2;
    *w3 = c3;
}
#else
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
INLINE void philox_lanes(bst_kernel_frame_params p, uint first, uint stream, uint16 *w0, uint16 *w1,
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
#endif

/* 1 / sqrt(v), v > 0, to 5e-6: Newton's iteration from half the exponent, several times faster than
 * division. */
INLINE lanes inverse_root(lanes v) {
    lanes y = as_lanes((lanes_int)0x5F375A86 - (as_lanes_int(v) >> 1));
    lanes h = -0.5f * v;
    y *= fma(h * y, y, (lanes)1.5f);
    y *= fma(h * y, y, (lanes)1.5f);
    return y;
}

/* -2 ln((word + 1/2) / 2^32): exponent, and 2 atanh(s), s = (m - 1) / (m + 1), of the mantissa m in
 * [sqrt(1/2), sqrt(2)); the series' first neglected term is 3e-9. */
INLINE lanes log_radius2(lanes_uint word) {
    lanes u = fma(to_lanes(word), (lanes)0x1p-32f, (lanes)0x1p-33f);
    lanes_int bits = as_lanes_int(u) - 0x3F3504F3; /* sqrt(1/2) */
    lanes_int exponent = bits >> 23;
    lanes m = as_lanes((bits & 0x007FFFFF) + 0x3F3504F3);
    lanes s = (m - 1.0f) / (m + 1.0f), q = s * s;
    lanes series =
        fma(q, fma(q, fma(q, (lanes)(-4.0f / 7), (lanes)(-4.0f / 5)), (lanes)(-4.0f / 3)),
            (lanes)-4.0f);
    return fma(to_lanes(exponent), (lanes)-1.38629436f, s * series);
}

/* Two independent standard normals (Box and Muller 1958). The angle's two high bits select the
 * quadrant, the others an angle in [-pi/4, pi/4) for short Taylor series. */
INLINE void normal_lanes(lanes_uint radius_word, lanes_uint angle_word, lanes *z0, lanes *z1) {
    lanes square = fmax(log_radius2(radius_word), 1e-12f);
    lanes radius = sqrt(square);
    lanes a = to_lanes(as_lanes_int(angle_word << 2)) * (0x1p-32f * 1.57079633f);
    lanes q = a * a;
    lanes sine =
        a *
        fma(q, fma(q, fma(q, (lanes)(-1.0f / 5040), (lanes)(1.0f / 120)), (lanes)(-1.0f / 6)),
            (lanes)1.0f);
    lanes cosine = fma(
        q,
        fma(q,
            fma(q, fma(q, (lanes)(1.0f / 40320), (lanes)(-1.0f / 720)), (lanes)(1.0f / 24)),
            (lanes)-0.5f),
        (lanes)1.0f);
    lanes_int swap = SIGN_MASK(as_lanes_int(angle_word << 1)); /* sign bit: bit 30 */
    radius = as_lanes(as_lanes_uint(radius) ^ (angle_word & 0x80000000u));
    lanes c = select(cosine, -sine, swap);
    lanes s = select(sine, cosine, swap);
    *z0 = c * radius;
    *z1 = s * radius;
}
