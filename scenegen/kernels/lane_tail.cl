/* Tail of the read noise as in read_tail.cl, drawn by a work-group for the rows of its tile. */

#ifdef TAIL
typedef struct tail_rows {
    float excess[TILE_H][64]; /* electrons */
    int read[32];             /* distances, then numbers of the reads of a generator call */
    float z[32];
} tail_rows;

/* Draws the block that contains row `row`; the rows of the tile from t.y on are kept. */
INLINE void draw_tail_block(bst_kernel_frame_params p, tile_place t, int row, local tail_rows *tails) {
    int mine = (int)get_local_id(0), start = row / TAIL_ROWS * TAIL_ROWS, last = -1;
    uint block = (uint)(row / TAIL_ROWS) * ((uint)(p.sensor_width + 63) / 64u) + (uint)t.x / 64u;
    for (uint call = 0u; last < TAIL_READS; call++) {
        if (mine < 16) {
            chunk_words w =
                chunk_random(p, (block * TAIL_CALLS + call) * 16u + (uint)mine, STREAM_TAIL);
            float za, zb;
            normal_lanes(w.c, w.d, &za, &zb);
            tails->read[mine] = tail_gaps(p, w.a);
            tails->read[mine + 16] = tail_gaps(p, w.b);
            tails->z[mine] = za;
            tails->z[mine + 16] = zb;
        }
        barrier(CLK_LOCAL_MEM_FENCE);
        int read = last, next = last;
        for (int k = 0; k < 32; k++) {
            next += tails->read[k];
            read = k == mine ? next : read;
        }
        int at = start + read / 64 - t.y;
        if (mine < 32 && read < TAIL_READS && at >= 0 && at < TILE_H) {
            tails->excess[at][read % 64] = tails->z[mine] * p.tail_rms_e;
        }
        last = next;
        barrier(CLK_LOCAL_MEM_FENCE);
    }
}

INLINE void draw_tail_rows(bst_kernel_frame_params p, tile_place t, local tail_rows *tails) {
    local float *all = tails->excess[0];
    for (int i = (int)get_local_id(0); i < TILE_H * 64; i += BST_ROW_LANES * TILE_H) {
        all[i] = 0.0f;
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    for (int row = t.y; row < t.y + t.rows; row = (row / TAIL_ROWS + 1) * TAIL_ROWS) {
        draw_tail_block(p, t, row, tails);
    }
}

#define DRAW_TAIL_ROWS(p, t, tails) draw_tail_rows(p, t, tails)
#define ADD_TAIL_LANE(tails, row, lane, e)        \
    do {                                          \
        local float *own = (tails)->excess[row];  \
        (e).a += own[lane];                       \
        (e).b += own[(lane) + 16];                \
        (e).c += own[(lane) + 32];                \
        (e).d += own[(lane) + 48];                \
    } while (0)
#else
typedef int tail_rows;
#define DRAW_TAIL_ROWS(p, t, tails)
#define ADD_TAIL_LANE(tails, row, lane, e)
#endif
