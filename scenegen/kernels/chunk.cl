/* Chunks of 64 columns of a full-sensor row, the detector's unit of work, and their random numbers:
 * one Philox call per lane, whose word v belongs to column 16 v + lane. */

/* One chunk of 64 pixels as four vectors. Not all compilers unroll loops over them, which would
 * then go through memory. */
typedef struct chunk {
    float16 a, b, c, d;
} chunk;

typedef struct chunk_words {
    uint16 a, b, c, d;
} chunk_words;

typedef struct chunk_flags {
    int16 a, b, c, d;
} chunk_flags;

/* Philox streams (second counter word) of a pixel's noise. */
#define STREAM_NOISE 0u
#define STREAM_POISSON 1u
#define STREAM_POISSON_NORMAL 2u
#define STREAM_TAIL 3u

INLINE chunk load_chunk(global const float *from) {
    global const float16 *v = (global const float16 *)from;
    chunk c = {v[0], v[1], v[2], v[3]};
    return c;
}

INLINE chunk_words chunk_random(bst_kernel_frame_params p, uint counter, uint stream) {
    chunk_words w;
    philox16(p, counter, stream, &w.a, &w.b, &w.c, &w.d);
    return w;
}

INLINE chunk chunk_normal(chunk_words w) {
    chunk z;
    normal16(w.a, w.b, &z.a, &z.b);
    normal16(w.c, w.d, &z.c, &z.d);
    return z;
}
