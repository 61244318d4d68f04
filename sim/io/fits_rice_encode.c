#include <assert.h>
#include <string.h>

#include "sim/core/simd.h"
#include "sim/io/fits_rice.h"

/* Bits of a pixel and of a block's code; the code of verbatim differences, and the number of low
 * bits from which on differences are verbatim. */
enum { PIXEL_BITS = 16, CODE_BITS = 4, VERBATIM = 15, LOW_BITS_MOST = 14 };
/* Longest word of a difference of which four are put together at once. */
enum { WORD_BITS = 14 };

/* Writes bits, most significant first. Fewer than 8 of them wait. */
typedef struct bit_writer {
    uint8_t *next;
    uint64_t bits; /* left-aligned, zeros behind */
    int count;
} bit_writer;

/* Adds up to 56 bits. */
static inline void put(bit_writer *w, uint64_t bits, int n) {
    w->bits |= bits << (64 - w->count - n);
    w->count += n;
    for (int i = 0; i < 8; i++) { /* one instruction: eight bytes, of which the whole ones count */
        w->next[i] = (uint8_t)(w->bits >> (56 - 8 * i));
    }
    w->next += w->count / 8;
    w->bits <<= w->count & ~7;
    w->count &= 7;
}

/* Differences of a block, 0, -1, 1, -2, ... as 0, 1, 2, 3, ...; their sum, and the largest one.
 * `pixels[-1]` is read. */
typedef struct differences {
    uint16_t mapped[BST_FITS_RICE_BLOCK];
    uint32_t sum, most;
} differences;

static inline void map_differences(const uint16_t *pixels, int count, differences *d) {
    uint32_t sum = 0;
    uint16_t most = 0;
    for (int i = 0; i < count; i++) {
        const uint16_t step = (uint16_t)(pixels[i] - pixels[i - 1]);
        const uint16_t sign = (uint16_t)(0 - (step >> 15)), mapped = (uint16_t)(step << 1 ^ sign);
        d->mapped[i] = mapped;
        sum += mapped;
        most = mapped > most ? mapped : most;
    }
    d->sum = sum;
    d->most = most;
}

/* Number of low bits of a block's words: of half the mean, as White's encoder chooses it. */
static int choose_low_bits(uint32_t sum, uint32_t count) {
    const uint32_t least = count / 2 + 1;
    const uint32_t half = sum > least ? (sum - least) / count / 2 : 0;
    return half > 0 ? 32 - __builtin_clz(half) : 0;
}

/* Words of a whole block, four at a time. */
static inline void put_fours(bit_writer *w, const differences *d, int low_bits) {
    enum { COUNT = BST_FITS_RICE_BLOCK };
    uint32_t words[COUNT], lengths[COUNT], pair_lengths[COUNT / 2], four_lengths[COUNT / 4];
    uint64_t pairs[COUNT / 2], fours[COUNT / 4];
    const uint32_t one = 1u << low_bits;
    for (int i = 0; i < COUNT; i++) {
        words[i] = one | (d->mapped[i] & (one - 1));
        lengths[i] = ((uint32_t)d->mapped[i] >> low_bits) + 1 + (uint32_t)low_bits;
    }
    for (int i = 0; i < COUNT / 2; i++) {
        pairs[i] = (uint64_t)words[2 * i] << lengths[2 * i + 1] | words[2 * i + 1];
        pair_lengths[i] = lengths[2 * i] + lengths[2 * i + 1];
    }
    for (int i = 0; i < COUNT / 4; i++) {
        fours[i] = pairs[2 * i] << pair_lengths[2 * i + 1] | pairs[2 * i + 1];
        four_lengths[i] = pair_lengths[2 * i] + pair_lengths[2 * i + 1];
    }
    for (int i = 0; i < COUNT / 4; i++) {
        put(w, fours[i], (int)four_lengths[i]);
    }
}

/* One word: zeros, a one, low bits. */
static void put_word(bit_writer *w, uint32_t mapped, int low_bits) {
    const uint32_t one = 1u << low_bits;
    uint32_t zeros = mapped >> low_bits;
    for (; zeros > 32; zeros -= 32) {
        put(w, 0, 32);
    }
    put(w, one | (mapped & (one - 1)), (int)zeros + 1 + low_bits);
}

/* The code of a block and its words. */
static inline void put_block(bit_writer *w, const differences *d, int count) {
    const int low_bits = choose_low_bits(d->sum, (uint32_t)count);
    if (d->sum == 0) {
        put(w, 0, CODE_BITS);
        return;
    }
    if (low_bits >= LOW_BITS_MOST) {
        put(w, VERBATIM, CODE_BITS);
        for (int i = 0; i < count; i++) {
            put(w, d->mapped[i], PIXEL_BITS);
        }
        return;
    }
    put(w, (uint64_t)low_bits + 1, CODE_BITS);
    if (count == BST_FITS_RICE_BLOCK &&
        (d->most >> low_bits) + 1 + (uint32_t)low_bits <= WORD_BITS) {
        put_fours(w, d, low_bits);
        return;
    }
    for (int i = 0; i < count; i++) {
        put_word(w, d->mapped[i], low_bits);
    }
}

/* Clones are seen from outside of a library: not the function of the header. */
BST_CLONES static size_t encode(const uint16_t *pixels, size_t count, uint8_t *out) {
    bit_writer w = {.next = out};
    put(&w, pixels[0] ^ 0x8000u, PIXEL_BITS);
    for (size_t at = 0; at < count; at += BST_FITS_RICE_BLOCK) {
        const size_t left = count - at;
        differences d;
        if (at > 0 && left >= BST_FITS_RICE_BLOCK) {
            map_differences(pixels + at, BST_FITS_RICE_BLOCK, &d);
            put_block(&w, &d, BST_FITS_RICE_BLOCK);
        } else { /* the first difference of a tile is 0 */
            uint16_t block[1 + BST_FITS_RICE_BLOCK] = {pixels[at > 0 ? at - 1 : 0]};
            const int n = left < BST_FITS_RICE_BLOCK ? (int)left : BST_FITS_RICE_BLOCK;
            memcpy(block + 1, pixels + at, (size_t)n * sizeof *block);
            map_differences(block + 1, n, &d);
            put_block(&w, &d, n);
        }
    }
    return (size_t)(w.next - out) + (w.count > 0);
}

size_t bst_fits_rice_encode(const uint16_t *pixels, size_t count, uint8_t *out) {
    assert(pixels && count > 0 && out);
    return encode(pixels, count, out);
}
