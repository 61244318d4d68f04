/* Electrons with shot and read noise from one normal deviate. Options: CF_ORDER (order of the
 * expansion). */

/* Coefficients of electrons with shot and read noise as a polynomial of a normal deviate. */
typedef struct noise_law {
    lanes c0, c1, c2, c3;
#if CF_ORDER >= 3
    lanes c4;
#endif
#if CF_ORDER >= 4
    lanes c5;
#endif
} noise_law;

/* Quantile of Poisson(mean) + normal(0, read noise), as a polynomial of the normal quantile z: the
 * Cornish-Fisher expansion (Abramowitz and Stegun 26.2.49) to order CF_ORDER of 1 / sigma. All
 * cumulants beyond the variance are the mean, so with a = 1 / sigma, b = mean / sigma^2 the
 * standardised ones are b a, b a^2, b a^3, b a^4. */
INLINE noise_law noise_law_of(bst_kernel_frame_params p, lanes mean) {
    noise_law law;
    lanes variance = fma((lanes)p.read_noise_e, (lanes)p.read_noise_e, mean);
    lanes a = inverse_root(variance), a2 = a * a, b = mean * a2, b2 = b * b;
    lanes c0 = fma(b, (lanes)(-1.0f / 6), mean);
    lanes c1 = fma(a, fma(b2, (lanes)(5.0f / 36), b * (-1.0f / 8)), variance * a);
    lanes c2 = b * (1.0f / 6);
    lanes c3 = a * fma(b2, (lanes)(-1.0f / 18), b * (1.0f / 24));
#if CF_ORDER >= 3
    lanes b3 = b2 * b;
    c0 = fma(a2, fma(b3, (lanes)(17.0f / 324), fma(b2, (lanes)(-1.0f / 12), b * (1.0f / 40))),
             c0);
    c2 = fma(a2, fma(b3, (lanes)(-53.0f / 324), fma(b2, (lanes)(5.0f / 24), b * (-1.0f / 20))),
             c2);
    law.c4 = a2 * fma(b3, (lanes)(1.0f / 27), fma(b2, (lanes)(-1.0f / 24), b * (1.0f / 120))) *
             p.dn_per_e;
#endif
#if CF_ORDER >= 4
    /* He5, He3, He1 of the fourth order, collected by powers of z */
    lanes a3 = a2 * a, b4 = b2 * b2;
    lanes h5 = fma(b4, (lanes)(-252.0f / 7776),
                     fma(b3, (lanes)(14.0f / 288),
                         fma(b2, (lanes)(-3.0f / 384 - 2.0f / 180), b * (1.0f / 720))));
    lanes h3 = fma(b4, (lanes)(-832.0f / 7776),
                     fma(b3, (lanes)(37.0f / 288), b2 * (-6.0f / 384 - 3.0f / 180)));
    lanes h1 =
        fma(b4, (lanes)(-227.0f / 7776), fma(b3, (lanes)(8.0f / 288), b2 * (-2.0f / 384)));
    c1 = fma(a3, fma(h5, (lanes)15.0f, fma(h3, (lanes)-3.0f, h1)), c1);
    c3 = fma(a3, fma(h5, (lanes)-10.0f, h3), c3);
    law.c5 = a3 * h5;
#endif
    law.c0 = c0;
    law.c1 = c1;
    law.c2 = c2;
    law.c3 = c3;
    return law;
}

/* Electrons with shot and read noise from normal deviate z. */
INLINE lanes draw_single(noise_law law, lanes z) {
    lanes dn = law.c3;
#if CF_ORDER >= 4
    dn = fma(fma(law.c5, z, law.c4), z, dn);
#elif CF_ORDER >= 3
    dn = fma(law.c4, z, dn);
#endif
    return fma(fma(fma(dn, z, law.c2), z, law.c1), z, law.c0);
}

#ifndef ONE_LANE
/* Noise law of means about one, by cubics: its coefficients at mean + x / per_reach, |x| <= 1, a
 * quarter of the variance to either side. There the cubic of the standard deviation has a relative
 * error of 2e-5. */
typedef struct near_law {
    float4 c0, c1, c2, c3;
#if CF_ORDER >= 3
    float4 c4;
#endif
#if CF_ORDER >= 4
    float4 c5;
#endif
    float mean, per_reach;
    int serves; /* one deviate is accurate enough for all these means */
} near_law;

/* The four Chebyshev nodes. */
#define NEAR_A 0.923879533f
#define NEAR_B 0.382683432f

/* Cubic through f at A, -A, B, -B: ascending powers. */
INLINE float4 cubic_through(lanes f) {
    const float spread = NEAR_A * NEAR_A - NEAR_B * NEAR_B;
    float even_a = 0.5f * (f.s0 + f.s1), odd_a = (0.5f / NEAR_A) * (f.s0 - f.s1);
    float even_b = 0.5f * (f.s2 + f.s3), odd_b = (0.5f / NEAR_B) * (f.s2 - f.s3);
    float square = (even_a - even_b) / spread, cube = (odd_a - odd_b) / spread;
    return (float4)(even_b - square * NEAR_B * NEAR_B, odd_b - cube * NEAR_B * NEAR_B, square,
                    cube);
}

/* Noise law for pixels with little or no source light: from a tenth of the dark variance below the
 * mean to half of it above. */
static near_law near_law_of(bst_kernel_frame_params p) {
    float dark = p.background_e, read = p.read_noise_e * p.read_noise_e;
    near_law near;
    near.mean = fma(0.2f, dark + read, dark);
    float reach = 0.25f * (near.mean + read);
    const lanes places = {NEAR_A, -NEAR_A, NEAR_B, -NEAR_B, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0};
    noise_law law = noise_law_of(p, fma(places, (lanes)reach, (lanes)near.mean));
    near.c0 = cubic_through(law.c0);
    near.c1 = cubic_through(law.c1);
    near.c2 = cubic_through(law.c2);
    near.c3 = cubic_through(law.c3);
#if CF_ORDER >= 3
    near.c4 = cubic_through(law.c4);
#endif
#if CF_ORDER >= 4
    near.c5 = cubic_through(law.c5);
#endif
    near.per_reach = 1.0f / reach;
    near.serves = reach > 0.0f && max(near.mean - reach, 0.0f) >= p.single_from &&
                  near.mean + reach <= p.near_full_e;
    return near;
}

INLINE lanes cubic(float4 c, lanes x) {
    return fma(fma(fma((lanes)c.s3, x, (lanes)c.s2), x, (lanes)c.s1), x, (lanes)c.s0);
}

INLINE noise_law law_near(near_law near, lanes x) {
    noise_law law;
    law.c0 = cubic(near.c0, x);
    law.c1 = cubic(near.c1, x);
    law.c2 = cubic(near.c2, x);
    law.c3 = cubic(near.c3, x);
#if CF_ORDER >= 3
    law.c4 = cubic(near.c4, x);
#endif
#if CF_ORDER >= 4
    law.c5 = cubic(near.c5, x);
#endif
    return law;
}
#endif
