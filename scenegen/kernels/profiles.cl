/* Pixel-integrated profile of a node along one axis. Options: DEGREE (of the profile law; without it
 * the law is not used). */

/* Half of the lanes of a work-item, as many as a register of AVX holds. Profiles are computed by
 * halves, because both axes of all lanes need more registers than AVX has. */
#ifdef ONE_LANE
typedef float half_lanes;
#else
typedef float8 half_lanes;
#endif

/* erf(u) to 2.3e-7: a minimax polynomial in u^2 inside +-3.6, and 1 beyond, with an error of 4e-7. */
INLINE half_lanes error_function(half_lanes u) {
    u = clamp(u, -3.6f, 3.6f);
    half_lanes z = fma(u * u, (half_lanes)(2.0f / (3.6f * 3.6f)), (half_lanes)-1.0f);
    half_lanes p = fma((half_lanes)-0.000965762343f, z, (half_lanes)0.00263147576f);
    p = fma(p, z, (half_lanes)-0.00284357269f);
    p = fma(p, z, (half_lanes)0.00457201151f);
    p = fma(p, z, (half_lanes)-0.0116267578f);
    p = fma(p, z, (half_lanes)0.0212467886f);
    p = fma(p, z, (half_lanes)-0.0325502623f);
    p = fma(p, z, (half_lanes)0.0482928275f);
    p = fma(p, z, (half_lanes)-0.0680295662f);
    p = fma(p, z, (half_lanes)0.0898119023f);
    p = fma(p, z, (half_lanes)-0.113793967f);
    p = fma(p, z, (half_lanes)0.143810923f);
    p = fma(p, z, (half_lanes)-0.195490509f);
    p = fma(p, z, (half_lanes)0.392712124f);
    return p * u;
}

#ifdef DEGREE
#define LAW_FLOATS (DEGREE + 1 + BST_LAW_FIRST + BST_LAW_SECOND)

/* Powers of g with a coefficient; their number is even. */
#define LAW_POWERS (DEGREE + 1 > BST_LAW_FIRST ? DEGREE + 1 : BST_LAW_FIRST)

/* Coefficient of the power q of g in the share of a pixel, for nodes as wide as the PSF or wider
 * (`wide`, by `more` PSF variances). c: the pixel's part of the law. */
INLINE half_lanes law_power(global const float *c, int q, half_lanes more, int wide) {
    half_lanes power = (half_lanes)(q <= DEGREE ? c[q] : 0.0f);
    if (wide && q < BST_LAW_FIRST) {
        half_lanes slope = (half_lanes)c[DEGREE + 1 + q];
        if (q < BST_LAW_SECOND) {
            slope = fma(more, (half_lanes)c[DEGREE + 1 + BST_LAW_FIRST + q], slope);
        }
        power = fma(more, slope, power);
    }
    return power;
}
#endif
