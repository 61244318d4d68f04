/* Charge-transfer inefficiency: traps capture charge of the packets that pass them and release it
 * into later ones (Short et al. 2013, MNRAS 430, 3078, equations 23 and 24, with a capture that is
 * much faster than a transfer). A packet of q electrons that is transferred n times meets n density
 * q^exponent traps; all of these share one state, so that the cost is that of one pass over the
 * pixels. One work-item per 16 columns or rows. */

/* Charge of packets and traps below this, e-, is neither captured nor followed. */
#define TRAP_LEAST 0.01f

/* A packet of 16 columns or rows on its way to the output. held: charge in the traps. */
INLINE float16 pass_traps(bst_kernel_trap_params p, float transfers, float16 q, float16 *held) {
    float16 all = q;
    for (int k = 0; k < p.kinds; k++) {
        all = fmax(all, held[k]);
    }
    if (!any_of(all > TRAP_LEAST)) {
        return q;
    }
    for (int k = 0; k < p.kinds; k++) {
        float16 least = fmax(q, TRAP_LEAST);
        float16 g = transfers * p.density[k] * exp2((p.exponent - 1.0f) * log2(least));
        float16 caught = fmax(fma(g, q, -held[k]) / (g + 1.0f), 0.0f);
        caught = select((float16)0.0f, caught, q > TRAP_LEAST);
        held[k] += caught;
        float16 released = held[k] * p.release[k];
        held[k] -= released;
        q += released - caught;
    }
    return q;
}

/* Transfers along columns. */
__attribute__((reqd_work_group_size(BST_READOUT_GROUP, 1, 1))) kernel void bst_detector_parallel(
    bst_kernel_trap_params p, global float *image) {
    int x = (int)get_global_id(0) * 16;
    if (x >= p.stride) {
        return;
    }
    float16 held[BST_TRAP_KINDS];
    for (int k = 0; k < BST_TRAP_KINDS; k++) {
        held[k] = (float16)0.0f;
    }
    for (int n = 0; n < p.height; n++) {
        int y = p.backwards ? p.height - 1 - n : n;
        global float16 *at = (global float16 *)(image + (size_t)y * p.stride + x);
        *at = pass_traps(p, (float)(n + 1), *at, held);
    }
}

/* Transfers along rows. */
__attribute__((reqd_work_group_size(BST_READOUT_GROUP, 1, 1))) kernel void bst_detector_serial(
    bst_kernel_trap_params p, global float *image) {
    int y = (int)get_global_id(0) * 16, rows = min(p.height - y, 16);
    if (rows <= 0) {
        return;
    }
    float16 held[BST_TRAP_KINDS];
    for (int k = 0; k < BST_TRAP_KINDS; k++) {
        held[k] = (float16)0.0f;
    }
    for (int n = 0; n < p.width; n += 16) {
        /* of a last block of fewer columns the others, beyond the end, are read as 0 */
        int columns = min(p.width - n, 16), first = p.backwards ? p.width - 1 - n : n;
        int step = p.backwards ? -1 : 1;
        float block[16][16]; /* [transfer][row] */
        for (int r = 0; r < 16; r++) {
            global const float *row = image + (size_t)(y + min(r, rows - 1)) * p.stride + first;
            for (int c = 0; c < 16; c++) {
                block[c][r] = c < columns ? row[c * step] : 0.0f;
            }
        }
        for (int c = 0; c < 16; c++) {
            float16 q = vload16(0, block[c]);
            vstore16(pass_traps(p, (float)(n + c + 1), q, held), 0, block[c]);
        }
        for (int r = 0; r < rows; r++) {
            global float *row = image + (size_t)(y + r) * p.stride + first;
            for (int c = 0; c < columns; c++) {
                row[c * step] = block[c][r];
            }
        }
    }
}
