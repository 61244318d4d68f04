#include "sim/link/crc32c.h"

#include <string.h>

/* CRC-32C polynomial, reflected: bit 31 is the coefficient of x^0. */
#define POLYNOMIAL 0x82F63B78u

/* Register update for four bits: the sixteen multiples of the polynomial. */
static const uint32_t nibbles[16] = {
    0x00000000u, 0x105EC76Fu, 0x20BD8EDEu, 0x30E349B1u, 0x417B1DBCu, 0x5125DAD3u,
    0x61C69362u, 0x7198540Du, 0x82F63B78u, 0x92A8FC17u, 0xA24BB5A6u, 0xB21572C9u,
    0xC38D26C4u, 0xD3D3E1ABu, 0xE330A81Au, 0xF36E6F75u,
};

static uint32_t portable(uint32_t crc, const unsigned char *p, size_t bytes) {
    for (size_t i = 0; i < bytes; i++) {
        crc ^= p[i];
        crc = nibbles[crc & 15u] ^ (crc >> 4);
        crc = nibbles[crc & 15u] ^ (crc >> 4);
    }
    return crc;
}

uint32_t bst_crc32c_portable(const void *data, size_t bytes) {
    return ~portable(~0u, data, bytes);
}

#if defined(__x86_64__) && defined(__GNUC__)

/* Product of two polynomials modulo the CRC polynomial. */
static uint32_t multiply(uint32_t a, uint32_t b) {
    uint32_t product = 0;
    for (uint32_t bit = 0x80000000u; bit; bit >>= 1) {
        if (a & bit) {
            product ^= b;
        }
        b = (b >> 1) ^ (b & 1u ? POLYNOMIAL : 0u);
    }
    return product;
}

/* x^(8 bytes): effect of that many zero bytes on the CRC register. */
static uint32_t zeros(size_t bytes) {
    uint32_t power = 0x80000000u, square = 0x00800000u; /* 1, x^8 */
    for (; bytes; bytes >>= 1) {
        if (bytes & 1u) {
            power = multiply(power, square);
        }
        square = multiply(square, square);
    }
    return power;
}

static inline uint64_t load(const unsigned char *p) {
    uint64_t word;
    memcpy(&word, p, sizeof word);
    return word;
}

/* CRC-32C by SSE 4.2. The instruction has a latency of three cycles and a throughput of one: three
 * thirds of the data run in parallel and are combined at the end. */
__attribute__((target("sse4.2"))) static uint32_t by_instruction(uint32_t crc,
                                                                 const unsigned char *p,
                                                                 size_t bytes) {
    uint64_t a = crc;
    if (bytes >= 3 * 256) {
        size_t third = bytes / 24 * 8;
        uint64_t b = 0, c = 0;
        for (size_t i = 0; i < third; i += 8) {
            a = __builtin_ia32_crc32di(a, load(p + i));
            b = __builtin_ia32_crc32di(b, load(p + third + i));
            c = __builtin_ia32_crc32di(c, load(p + 2 * third + i));
        }
        uint32_t shift = zeros(third);
        a = multiply(shift, (uint32_t)a) ^ b;
        a = multiply(shift, (uint32_t)a) ^ c;
        p += 3 * third;
        bytes -= 3 * third;
    }
    for (; bytes >= 8; p += 8, bytes -= 8) {
        a = __builtin_ia32_crc32di(a, load(p));
    }
    uint32_t last = (uint32_t)a;
    for (; bytes > 0; p++, bytes--) {
        last = __builtin_ia32_crc32qi(last, *p);
    }
    return last;
}

uint32_t bst_crc32c(const void *data, size_t bytes) {
    return __builtin_cpu_supports("sse4.2") ? ~by_instruction(~0u, data, bytes)
                                            : bst_crc32c_portable(data, bytes);
}

#else

uint32_t bst_crc32c(const void *data, size_t bytes) {
    return bst_crc32c_portable(data, bytes);
}

#endif
