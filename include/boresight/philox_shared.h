/* Philox4x32-10 (Salmon, Moraes, Dror and Shaw, "Parallel random numbers: as easy as 1, 2, 3",
 * SC11, 2011), for C17 and OpenCL C alike. A counter-based generator: the same key and counter give
 * the same four words on every device, whatever the order in which they are asked for. */
#ifndef BORESIGHT_PHILOX_SHARED_H
#define BORESIGHT_PHILOX_SHARED_H

#ifdef __OPENCL_VERSION__
typedef uint bst_u32;
typedef ulong bst_u64;
#else
#include <stdint.h>
typedef uint32_t bst_u32;
typedef uint64_t bst_u64;
#endif

typedef struct bst_philox_words {
    bst_u32 w[4];
} bst_philox_words;

/* Philox4x32-10: encrypts a counter to four uniform 32-bit words.
 *
 * Given:     key0, key1      key
 *            c0, c1, c2, c3  counter */
static inline bst_philox_words bst_philox4x32(bst_u32 key0, bst_u32 key1, bst_u32 c0, bst_u32 c1,
                                              bst_u32 c2, bst_u32 c3) {
    for (int round = 0; round < 10; round++) {
        bst_u64 p0 = (bst_u64)0xD2511F53u * c0;
        bst_u64 p1 = (bst_u64)0xCD9E8D57u * c2;
        bst_u32 n0 = (bst_u32)(p1 >> 32) ^ c1 ^ key0;
        bst_u32 n2 = (bst_u32)(p0 >> 32) ^ c3 ^ key1;
        c1 = (bst_u32)p1;
        c3 = (bst_u32)p0;
        c0 = n0;
        c2 = n2;
        key0 += 0x9E3779B9u;
        key1 += 0xBB67AE85u;
    }
    bst_philox_words out = {{c0, c1, c2, c3}};
    return out;
}

#endif
