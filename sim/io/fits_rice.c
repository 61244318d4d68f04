#include "sim/io/fits_rice.h"

/* Rice coding of 16-bit pixels: bits of a block's code, and the code of a block with verbatim
 * differences. */
enum { CODE_BITS = 4, VERBATIM = 15, PIXEL_BITS = 16 };

/* Reads bits, most significant first. Beyond the end it returns zeros and counts them in
 * `missing`. */
typedef struct bit_reader {
    const uint8_t *next, *end;
    uint64_t bits; /* next bits, left-aligned */
    int count;
    size_t missing;
} bit_reader;

/* Loads compressed bytes into the bit buffer; beyond the end zeros. */
static void refill(bit_reader *r) {
    for (; r->count <= 56; r->count += 8) {
        uint64_t byte = 0;
        if (r->next < r->end) {
            byte = *r->next++;
        } else {
            r->missing += 8;
        }
        r->bits |= byte << (56 - r->count);
    }
}

/* Reads the next n bits of the compressed tile. */
static uint32_t take(bit_reader *r, int n) {
    if (r->count < n) {
        refill(r);
    }
    uint32_t value = n > 0 ? (uint32_t)(r->bits >> (64 - n)) : 0;
    r->bits <<= n;
    r->count -= n;
    return value;
}

/* Checks whether bits beyond the end were read. */
static bool is_exhausted(const bit_reader *r) {
    return r->missing > (size_t)r->count;
}

/* Reads a unary number: zeros before the next one. False: more zeros than any code has, or the
 * bytes end: those of 32-bit pixels have no other limit. */
static bool take_unary(bit_reader *r, uint32_t most, uint32_t *zeros) {
    for (*zeros = 0; *zeros <= most;) {
        if (r->bits != 0) {
            int n = __builtin_clzll(r->bits);
            *zeros += (uint32_t)n;
            r->bits = r->bits << n << 1;
            r->count -= n + 1;
            return *zeros <= most;
        }
        if (is_exhausted(r)) {
            return false;
        }
        *zeros += (uint32_t)r->count;
        r->count = 0;
        refill(r);
    }
    return false;
}

/* The bits of a kind of pixels: of a pixel, of a block's code; the code of verbatim differences. */
typedef struct rice_kind {
    int pixel_bits, code_bits, verbatim;
    uint32_t most;
} rice_kind;

/* Decodes one block; false: an invalid code. Stored in one of narrow and wide. */
static inline bool decode_block(bit_reader *r, const rice_kind *k, size_t at, size_t stop,
                                uint32_t *last, uint16_t *narrow, int32_t *wide) {
    int code = (int)take(r, k->code_bits);
    if (code > k->verbatim) {
        return false;
    }
    for (size_t i = at; i < stop; i++) {
        uint32_t high = 0, mapped = 0;
        if (code == k->verbatim) {
            mapped = take(r, k->pixel_bits);
        } else if (code > 0) {
            int low_bits = code - 1;
            if (!take_unary(r, k->most >> low_bits, &high)) {
                return false;
            }
            mapped = high << low_bits | take(r, low_bits);
        }
        /* 0, 1, 2, 3, ... encode 0, -1, 1, -2, ... */
        *last += mapped & 1 ? ~(mapped >> 1) : mapped >> 1;
        if (narrow) {
            narrow[i] = (uint16_t)*last;
        } else {
            wide[i] = k->pixel_bits == 8    ? (int32_t)(uint8_t)*last
                      : k->pixel_bits == 16 ? (int32_t)(int16_t)*last
                                            : (int32_t)*last;
        }
    }
    return !is_exhausted(r);
}

bool bst_fits_rice_decode(const uint8_t *data, size_t bytes, int block, uint16_t *out,
                          size_t count) {
    static const rice_kind kind = {PIXEL_BITS, CODE_BITS, VERBATIM, UINT16_MAX};
    bit_reader r = {.next = data, .end = data + bytes};
    uint32_t last = take(&r, PIXEL_BITS);
    for (size_t at = 0; at < count; at += (size_t)block) {
        size_t stop = count - at < (size_t)block ? count : at + (size_t)block;
        if (!decode_block(&r, &kind, at, stop, &last, out, NULL)) {
            return false;
        }
    }
    return true;
}

bool bst_fits_rice_decode_wide(const uint8_t *data, size_t bytes, int block, int pixel_bytes,
                               int32_t *out, size_t count) {
    static const rice_kind kinds[] = {{8, 3, 7, UINT8_MAX},
                                      {PIXEL_BITS, CODE_BITS, VERBATIM, UINT16_MAX},
                                      {32, 5, 26, UINT32_MAX}};
    const rice_kind *kind = &kinds[pixel_bytes == 1 ? 0 : pixel_bytes == 2 ? 1 : 2];
    bit_reader r = {.next = data, .end = data + bytes};
    uint32_t last = take(&r, kind->pixel_bits);
    for (size_t at = 0; at < count; at += (size_t)block) {
        size_t stop = count - at < (size_t)block ? count : at + (size_t)block;
        if (!decode_block(&r, kind, at, stop, &last, NULL, out)) {
            return false;
        }
    }
    return true;
}
