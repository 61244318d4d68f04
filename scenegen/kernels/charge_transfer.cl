/* Charge-transfer inefficiency: traps capture charge of the packets that pass them and release it
 * into later ones (Short et al. 2013, MNRAS 430, 3078, equations 23 and 24, with a capture that is
 * much faster than a transfer). A packet of q electrons that is transferred n times meets n density
 * q^exponent traps; all of these share one state, so that the cost is that of one pass over the
 * pixels. One work-item per 64 columns or 32 rows. */

/* Charge of packets and traps below this, e-, is neither captured nor followed. */
#define TRAP_LEAST 0.01f

/* 2^x for |x| < 126, to 2e-7: a polynomial for the fraction (Taylor's, by Horner), the exponent's
 * bits for the rest. */
INLINE float16 power_of_two(float16 x) {
    float16 shifted = x + 12582912.0f; /* 1.5 x 2^23: rounds to whole numbers */
    float16 f = (x - (shifted - 12582912.0f)) * 0.69314718f;
    float16 y = fma(f, fma(f, fma(f, fma(f, fma(f, (float16)(1.0f / 720), (float16)(1.0f / 120)),
                                         (float16)(1.0f / 24)),
                                  (float16)(1.0f / 6)),
                           (float16)0.5f),
                    (float16)1.0f);
    y = fma(f, y, (float16)1.0f);
    return as_float16(as_int16(y) + (as_int16(shifted) << 23));
}

/* Logarithm to base 2 of v > 0: exponent, and 2 atanh(s), s = (m - 1) / (m + 1), of the mantissa m in
 * [sqrt(1/2), sqrt(2)); the series' first neglected term is 1e-8. */
INLINE float16 log_two(float16 v) {
    int16 bits = as_int16(v) - 0x3F3504F3, exponent = bits >> 23;
    float16 m = as_float16((bits & 0x007FFFFF) + 0x3F3504F3);
    float16 s = (m - 1.0f) / (m + 1.0f), q = s * s;
    float16 series = fma(q, fma(q, fma(q, (float16)(2.0f / 7), (float16)(2.0f / 5)), (float16)(2.0f / 3)),
                         (float16)2.0f);
    return fma(s * series, (float16)1.44269504f, convert_float16(exponent));
}

/* 1 / sqrt(v) for v > 0, to 2e-7: three steps of Newton's method from a guess by the bits. */
INLINE float16 inverse_root_of(float16 v) {
    float16 y = as_float16((int16)0x5F375A86 - (as_int16(v) >> 1)), h = -0.5f * v;
    y *= fma(h * y, y, (float16)1.5f);
    y *= fma(h * y, y, (float16)1.5f);
    y *= fma(h * y, y, (float16)1.5f);
    return y;
}

/* Charge to the power p.exponent - 1: the traps that one electron of it meets. */
INLINE float16 traps_met(bst_kernel_trap_params p, float16 charge) {
    return p.exponent == 0.5f ? inverse_root_of(charge)
                              : power_of_two((p.exponent - 1.0f) * log_two(charge));
}

/* A packet of 16 columns or rows meets the traps of species k. held: charge in them. */
INLINE float16 pass_species(bst_kernel_trap_params p, int k, float transfers, float16 q,
                            float16 *held) {
    float16 least = q > TRAP_LEAST ? q : TRAP_LEAST;
    float16 g = transfers * p.density[k] * traps_met(p, least);
    float16 caught = fma(g, q, -held[k]) / (g + 1.0f);
    caught = select((float16)0.0f, caught, (q > TRAP_LEAST) & (caught > 0.0f));
    held[k] += caught;
    float16 released = held[k] * p.release[k];
    held[k] -= released;
    return q + (released - caught);
}

#if BST_TRAP_KINDS != 3
#error "pass_traps has three species"
#endif

/* A packet on its way to the output. No loop, so that the traps stay in registers: compilers do not
 * unroll one whose end is not known. */
INLINE float16 pass_traps(bst_kernel_trap_params p, float transfers, float16 q, float16 *held) {
    if (p.kinds > 0) {
        q = pass_species(p, 0, transfers, q, held);
    }
    if (p.kinds > 1) {
        q = pass_species(p, 1, transfers, q, held);
    }
    if (p.kinds > 2) {
        q = pass_species(p, 2, transfers, q, held);
    }
    return q;
}

/* True if a packet or its traps hold charge worth following. */
INLINE int has_charge(bst_kernel_trap_params p, float16 q, const float16 *held) {
#pragma unroll
    for (int k = 0; k < BST_TRAP_KINDS; k++) { /* those of absent kinds are empty */
        q = q > held[k] ? q : held[k];
    }
    return any_of(q > TRAP_LEAST);
}

/* Transfers along columns. Four vectors side by side: each waits for its own packet before. */
__attribute__((reqd_work_group_size(BST_READOUT_GROUP, 1, 1))) kernel void bst_detector_parallel(
    bst_kernel_trap_params p, global float *image) {
    int x = (int)get_global_id(0) * 64;
    if (x >= p.stride) {
        return;
    }
    float16 held[4][BST_TRAP_KINDS];
    for (int k = 0; k < BST_TRAP_KINDS; k++) {
        held[0][k] = held[1][k] = held[2][k] = held[3][k] = (float16)0.0f;
    }
    for (int n = 0; n < p.height; n++) {
        int y = p.backwards ? p.height - 1 - n : n;
        global float16 *at = (global float16 *)(image + (size_t)y * p.stride + x);
        float16 q[4] = {at[0], at[1], at[2], at[3]};
        if (has_charge(p, q[0], held[0]) | has_charge(p, q[1], held[1]) |
            has_charge(p, q[2], held[2]) | has_charge(p, q[3], held[3])) {
            at[0] = pass_traps(p, (float)(n + 1), q[0], held[0]);
            at[1] = pass_traps(p, (float)(n + 1), q[1], held[1]);
            at[2] = pass_traps(p, (float)(n + 1), q[2], held[2]);
            at[3] = pass_traps(p, (float)(n + 1), q[3], held[3]);
        }
    }
}

/* Transposes 16 vectors: each of four steps interleaves the first eight of them with the others. */
INLINE void transpose(float16 *v) {
    float16 w[16];
#pragma unroll
    for (int step = 0; step < 4; step++) {
#pragma unroll
        for (int i = 0; i < 8; i++) {
            w[2 * i].even = v[i].lo;
            w[2 * i].odd = v[i + 8].lo;
            w[2 * i + 1].even = v[i].hi;
            w[2 * i + 1].odd = v[i + 8].hi;
        }
#pragma unroll
        for (int i = 0; i < 16; i++) {
            v[i] = w[i];
        }
    }
}

/* Columns n to n + 16 of 16 rows from `image` on, in the order of their transfers, [transfer][row].
 * Rows from `rows` on repeat the last one, columns beyond the end are 0. */
INLINE void load_block(bst_kernel_trap_params p, global const float *image, int rows, int n,
                       float16 *block) {
    int columns = min(p.width - n, 16);
    if (columns == 16) {
        int first = p.backwards ? p.width - 16 - n : n;
        for (int r = 0; r < 16; r++) {
            float16 v = vload16(0, image + (size_t)min(r, rows - 1) * p.stride + first);
            block[r] = p.backwards ? v.sfedcba9876543210 : v;
        }
        transpose(block);
        return;
    }
    for (int c = 0; c < 16; c++) {
        float at[16];
        for (int r = 0; r < 16; r++) {
            int x = p.backwards ? p.width - 1 - n - c : n + c;
            at[r] = c < columns ? image[(size_t)min(r, rows - 1) * p.stride + x] : 0.0f;
        }
        block[c] = vload16(0, at);
    }
}

/* Stores what load_block loaded. */
INLINE void store_block(bst_kernel_trap_params p, global float *image, int rows, int n,
                        float16 *block) {
    int columns = min(p.width - n, 16);
    if (columns == 16) {
        int first = p.backwards ? p.width - 16 - n : n;
        transpose(block);
        for (int r = 0; r < rows; r++) {
            float16 v = p.backwards ? block[r].sfedcba9876543210 : block[r];
            vstore16(v, 0, image + (size_t)r * p.stride + first);
        }
        return;
    }
    for (int c = 0; c < columns; c++) {
        float at[16];
        vstore16(block[c], 0, at);
        for (int r = 0; r < rows; r++) {
            image[(size_t)r * p.stride + (p.backwards ? p.width - 1 - n - c : n + c)] = at[r];
        }
    }
}

/* Transfers along rows. Two blocks of 16 rows side by side: each waits for its own packet before. */
__attribute__((reqd_work_group_size(BST_READOUT_GROUP, 1, 1))) kernel void bst_detector_serial(
    bst_kernel_trap_params p, global float *image) {
    int y = (int)get_global_id(0) * 32, rows = min(p.height - y, 32);
    if (rows <= 0) {
        return;
    }
    float16 held[2][BST_TRAP_KINDS];
    for (int k = 0; k < BST_TRAP_KINDS; k++) {
        held[0][k] = held[1][k] = (float16)0.0f;
    }
    global float *low = image + (size_t)y * p.stride;
    /* of a last block of 16 rows or fewer the second copy is not stored */
    global float *high = rows > 16 ? low + (size_t)16 * p.stride : low;
    int low_rows = min(rows, 16), high_rows = rows > 16 ? rows - 16 : low_rows;
    for (int n = 0; n < p.width; n += 16) {
        float16 a[16], b[16]; /* [transfer][row] */
        load_block(p, low, low_rows, n, a);
        load_block(p, high, high_rows, n, b);
        for (int c = 0; c < 16; c++) {
            int some_a = has_charge(p, a[c], held[0]), some_b = has_charge(p, b[c], held[1]);
            float transfers = (float)(n + c + 1);
            if (some_a & some_b) {
                a[c] = pass_traps(p, transfers, a[c], held[0]);
                b[c] = pass_traps(p, transfers, b[c], held[1]);
            } else if (some_a) {
                a[c] = pass_traps(p, transfers, a[c], held[0]);
            } else if (some_b) {
                b[c] = pass_traps(p, transfers, b[c], held[1]);
            }
        }
        store_block(p, low, low_rows, n, a);
        if (rows > 16) {
            store_block(p, high, high_rows, n, b);
        }
    }
}
