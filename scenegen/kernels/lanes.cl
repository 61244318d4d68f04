/* Values of the pixels, or nodes, that a work-item computes side by side: LANES of them, and
 * reductions over them. Without option ONE_LANE a work-item has the 16 lanes of a vector, as suits a
 * CPU; with it one, as suits a GPU, whose work-items share instructions. Kernels of both forms draw
 * the same random numbers and add the light in the same order. */

#ifdef ONE_LANE
#define LANES 1
typedef float lanes;
typedef int lanes_int;
typedef uint lanes_uint;
typedef ushort lanes_ushort;
#define to_lanes(x) convert_float(x)
#define to_lanes_int(x) convert_int(x)
#define to_lanes_uint(x) convert_uint(x)
#define to_lanes_ushort(x) convert_ushort(x)
#define as_lanes(x) as_float(x)
#define as_lanes_int(x) as_int(x)
#define as_lanes_uint(x) as_uint(x)
/* A comparison as -1 where it is true; a scalar one gives 1. */
#define MASK(comparison) (-(comparison))
/* The sign as such a mask: select() looks at a vector's sign bits and at all bits of a scalar. */
#define SIGN_MASK(v) ((v) >> 31)
#else
#define LANES 16
typedef float16 lanes;
typedef int16 lanes_int;
typedef uint16 lanes_uint;
typedef ushort16 lanes_ushort;
#define to_lanes(x) convert_float16(x)
#define to_lanes_int(x) convert_int16(x)
#define to_lanes_uint(x) convert_uint16(x)
#define to_lanes_ushort(x) convert_ushort16(x)
#define as_lanes(x) as_float16(x)
#define as_lanes_int(x) as_int16(x)
#define as_lanes_uint(x) as_uint16(x)
#define MASK(comparison) (comparison)
#define SIGN_MASK(v) (v)
#endif

/* floor() of lanes by the processor's instruction, where the compiler has it as a function for all
 * vectors; some OpenCL libraries emulate floor() by six. Machines that take SPIR know the functions
 * of OpenCL alone. */
#if !defined(ONE_LANE) && !defined(__SPIR__) && !defined(__SPIR64__) && defined(__has_builtin)
#if __has_builtin(__builtin_elementwise_floor)
#define FLOOR(x) __builtin_elementwise_floor(x)
#endif
#endif
#ifndef FLOOR
#define FLOOR(x) floor(x)
#endif

#ifdef ONE_LANE
INLINE int any_of(int mask) {
    return mask < 0;
}
#else
/* any() by halves: some compilers test lane by lane. */
static int any_of(int16 v) {
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
#endif
