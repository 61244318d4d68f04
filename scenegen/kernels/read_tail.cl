/* Tail of the read noise (random telegraph noise): excess noise in few reads. Options: TAIL.
 * p.tail_gap is -1 / (2 ln(1 - share of the reads)).
 *
 * The reads are drawn in blocks of TAIL_ROWS rows and 64 columns of the read-out, because a single
 * chunk has few reads in the tail. Within a block the distance from one to the next is
 * geometrically distributed. */
#define TAIL_ROWS BST_TAIL_ROWS
#define TAIL_READS (TAIL_ROWS * 64)
/* Most generator calls of a block, a power of two. */
#define TAIL_CALLS 64u

#ifdef TAIL
/* Distances between successive reads in the tail. */
INLINE lanes_int tail_gaps(bst_kernel_frame_params p, lanes_uint words) {
    return 1 + to_lanes_int(fmin(log_radius2(words) * p.tail_gap, (float)TAIL_READS));
}
#endif

#ifndef ONE_LANE
typedef struct tail_block {
    float excess[TAIL_ROWS][64]; /* electrons */
    uint rows;                   /* bit per row: not all zero */
} __attribute__((aligned(64))) tail_block;

#ifdef TAIL
/* Prefix sums over the lanes. */
INLINE int16 sum_up(int16 v) {
    v += (int16)(0, v.s0, v.s12, v.s3456, v.s789a, v.sbc, v.sde);
    v += (int16)(0, 0, v.s01, v.s2345, v.s6789, v.sab, v.scd);
    v += (int16)((int4)(0), v.s0123, v.s4567, v.s89ab);
    v += (int16)((int8)(0), v.s01234567);
    return v;
}

/* Draws the block that contains a read; width: of the read-out. */
static void draw_tail(bst_kernel_frame_params p, int row, int column, int width, tail_block *tail) {
    uint block = (uint)(row / TAIL_ROWS) * ((uint)(width + 63) / 64u) + (uint)column / 64u;
    for (int y = 0; y < TAIL_ROWS; y++) {
        for (int x = 0; x < 64; x += 16) {
            *(float16 *)(tail->excess[y] + x) = (float16)0.0f;
        }
    }
    tail->rows = 0u;
    int last = -1;
    for (uint call = 0u; last < TAIL_READS; call++) {
        chunk_words w = chunk_random(p, (block * TAIL_CALLS + call) * 16u, STREAM_TAIL);
        float16 za, zb;
        normal_lanes(w.c, w.d, &za, &zb);
        int16 at = last + sum_up(tail_gaps(p, w.a));
        int read[32] __attribute__((aligned(64)));
        float z[32] __attribute__((aligned(64)));
        *(int16 *)read = at;
        *(int16 *)(read + 16) = at.sf + sum_up(tail_gaps(p, w.b));
        *(float16 *)z = za;
        *(float16 *)(z + 16) = zb;
        for (int k = 0; k < 32 && read[k] < TAIL_READS; k++) {
            tail->excess[read[k] / 64][read[k] % 64] = z[k] * p.tail_rms_e;
            tail->rows |= 1u << (read[k] / 64);
        }
        last = read[31];
    }
}

/* Adds the tail to a row of a chunk. */
INLINE chunk add_tail(const tail_block *tail, int row, chunk e) {
    row %= TAIL_ROWS;
    if (tail->rows >> row & 1u) {
        const float16 *excess = (const float16 *)tail->excess[row];
        e.a += excess[0];
        e.b += excess[1];
        e.c += excess[2];
        e.d += excess[3];
    }
    return e;
}

#define DRAW_TAIL(p, row, column, width, tail) draw_tail(p, row, column, width, tail)
#define ADD_TAIL(tail, row, e) add_tail(tail, row, e)
#else
#define DRAW_TAIL(p, row, column, width, tail)
#define ADD_TAIL(tail, row, e) (e)
#endif
#endif
