/* Reductions over the lanes of a vector. */

/* any() by halves: some compilers test lane by lane. */
static int any16(int16 v) {
    int8 a = v.lo | v.hi;
    int4 b = a.lo | a.hi;
    int2 c = b.lo | b.hi;
    return (c.lo | c.hi) < 0;
}

/* By comparisons, because fmax() also handles NaN. */
static float max_of(float16 v) {
    float8 a = v.lo > v.hi ? v.lo : v.hi;
    float4 b = a.lo > a.hi ? a.lo : a.hi;
    float2 c = b.lo > b.hi ? b.lo : b.hi;
    return c.lo > c.hi ? c.lo : c.hi;
}

static float min_of(float16 v) {
    return -max_of(-v);
}

/* One reduction of both bounds of both axes gave wrong bounds with NVIDIA's compiler (580.159.04),
 * which left out lanes 1 and 13 of the maxima (tests/scenegen/test_renderer.c,
 * light_does_not_depend_on_tiles). */
static int least_of(int16 v) {
    int8 a = min(v.lo, v.hi);
    int4 b = min(a.lo, a.hi);
    int2 c = min(b.lo, b.hi);
    return min(c.lo, c.hi);
}

static int most_of(int16 v) {
    int8 a = max(v.lo, v.hi);
    int4 b = max(a.lo, a.hi);
    int2 c = max(b.lo, b.hi);
    return max(c.lo, c.hi);
}
