/* 64-bit FNV-1a hash for names, checksums and digests; not cryptographic (Fowler, Noll and Vo; RFC
 * 9923). */
#ifndef BST_CORE_FNV_H
#define BST_CORE_FNV_H

#include <stddef.h>
#include <stdint.h>

#define BST_FNV_START UINT64_C(0xcbf29ce484222325)

/* Continues a hash with `bytes` bytes; start with BST_FNV_START. */
static inline uint64_t bst_fnv(uint64_t hash, const void *data, size_t bytes) {
    const unsigned char *p = (const unsigned char *)data;
    for (size_t i = 0; i < bytes; i++) {
        hash = (hash ^ p[i]) * UINT64_C(0x100000001b3);
    }
    return hash;
}

#endif
