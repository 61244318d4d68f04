/* Pixel-integrated profile of a node along one axis. Options: DEGREE (of the profile law; without it
 * the law is not used). */

/* erf(u) to 2.3e-7: a minimax polynomial in u^2 inside +-3.6, and 1 beyond, with an error of 4e-7. */
INLINE lanes error_function(lanes u) {
    u = clamp(u, -3.6f, 3.6f);
    lanes z = fma(u * u, (lanes)(2.0f / (3.6f * 3.6f)), (lanes)-1.0f);
    lanes p = fma((lanes)-0.000965762343f, z, (lanes)0.00263147576f);
    p = fma(p, z, (lanes)-0.00284357269f);
    p = fma(p, z, (lanes)0.00457201151f);
    p = fma(p, z, (lanes)-0.0116267578f);
    p = fma(p, z, (lanes)0.0212467886f);
    p = fma(p, z, (lanes)-0.0325502623f);
    p = fma(p, z, (lanes)0.0482928275f);
    p = fma(p, z, (lanes)-0.0680295662f);
    p = fma(p, z, (lanes)0.0898119023f);
    p = fma(p, z, (lanes)-0.113793967f);
    p = fma(p, z, (lanes)0.143810923f);
    p = fma(p, z, (lanes)-0.195490509f);
    p = fma(p, z, (lanes)0.392712124f);
    return p * u;
}

#ifdef DEGREE
#define LAW_FLOATS (DEGREE + 1 + BST_LAW_FIRST + BST_LAW_SECOND)

/* Sum of the even (first 0) or odd (first 1) powers in c[count], without the odd powers' last
 * factor. */
INLINE lanes powers(global const float *c, int count, int first, lanes g2) {
    lanes v = (lanes)c[count - 2 + first];
#pragma unroll
    for (int q = count - 4; q >= 0; q -= 2) {
        v = fma(v, g2, (lanes)c[q + first]);
    }
    return v;
}
#endif
