/* Chunks of 64 columns of a full-sensor row, the detector's unit of work, and their random numbers:
 * one Philox call per lane, whose word v belongs to column 16 v + lane. With ONE_LANE 16 work-items
 * share a chunk; each has the pixels of its lane, and `counter` and positions are that lane's. */

/* One chunk of 64 pixels as four vectors. Not all compilers unroll loops over them, which would
 * then go through memory. */
typedef struct chunk {
    lanes a, b, c, d;
} chunk;

typedef struct chunk_words {
    lanes_uint a, b, c, d;
} chunk_words;

typedef struct chunk_flags {
    lanes_int a, b, c, d;
} chunk_flags;

/* Philox streams (second counter word) of a pixel's noise. */
#define STREAM_NOISE 0u
#define STREAM_POISSON 1u
#define STREAM_POISSON_NORMAL 2u
#define STREAM_TAIL 3u
#define STREAM_MULTIPLY 4u

INLINE chunk load_chunk(global const float *from) {
    global const lanes *v = (global const lanes *)from;
    const int step = 16 / LANES; /* from one vector to the next */
    chunk c = {v[0], v[step], v[2 * step], v[3 * step]};
    return c;
}

INLINE chunk_words chunk_random(bst_kernel_frame_params p, uint counter, uint stream) {
    chunk_words w;
    philox_lanes(p, counter, stream, &w.a, &w.b, &w.c, &w.d);
    return w;
}

INLINE chunk chunk_normal(chunk_words w) {
    chunk z;
    normal_lanes(w.a, w.b, &z.a, &z.b);
    normal_lanes(w.c, w.d, &z.c, &z.d);
    return z;
}
