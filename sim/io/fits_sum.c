/* FITS checksums DATASUM and CHECKSUM: ones' complement sums of an HDU's 32-bit words. Source: FITS
 * Standard 4.0, section 4.4.2.7 and appendix J. */
#include <stdio.h>
#include <string.h>

#include "sim/io/fits_internal.h"

enum { CARD = BST_FITS_CARD, CHUNK = 65536 };

/* Adds the carries of a sum of 16-bit words (ones' complement). */
static void fold(bst_fits_sum *sum) {
    for (uint64_t high = sum->high >> 16, low = sum->low >> 16; high | low;
         high = sum->high >> 16, low = sum->low >> 16) {
        sum->high = (sum->high & 0xffff) + low;
        sum->low = (sum->low & 0xffff) + high;
    }
}

void bst_fits_sum_pixels(bst_fits_sum *sum, const uint16_t *pixels, size_t count) {
    for (size_t at = 0; at < count; at += CHUNK) {
        size_t n = count - at < CHUNK ? count - at : CHUNK;
        uint32_t even = 0, odd = 0;
        for (size_t i = 0; i + 1 < n; i += 2) {
            even += pixels[at + i] ^ 0x8000u;
            odd += pixels[at + i + 1] ^ 0x8000u;
        }
        even += n % 2 ? pixels[at + n - 1] ^ 0x8000u : 0;
        *(sum->is_odd ? &sum->low : &sum->high) += even;
        *(sum->is_odd ? &sum->high : &sum->low) += odd;
        sum->is_odd ^= n % 2;
    }
    fold(sum);
}

/* Adds bytes to a checksum: a multiple of 4, aligned to words. */
static void sum_bytes(bst_fits_sum *sum, const char *bytes, size_t count) {
    for (size_t i = 0; i + 3 < count; i += 4) {
        const unsigned char *b = (const unsigned char *)bytes + i;
        sum->high += (uint32_t)b[0] << 8 | b[1];
        sum->low += (uint32_t)b[2] << 8 | b[3];
    }
    fold(sum);
}

/* Finds a header card by its first ten characters; NULL: none. */
static char *find_card(char *header, size_t bytes, const char *start) {
    for (size_t at = 0; at + CARD <= bytes; at += CARD) {
        if (memcmp(header + at, start, strlen(start)) == 0) {
            return header + at;
        }
    }
    return NULL;
}

void bst_fits_put_sums(const bst_fits *fits, fitsfile *file, int *code) {
    if (fits->checksums) {
        fits_write_key_str(file, "CHECKSUM", "0000000000000000", "of the HDU", code);
        fits_write_key_str(file, "DATASUM", "         0", "of the data", code);
    }
}

bool bst_fits_sign(char *hdu, size_t bytes, bst_fits_sum data) {
    char *end = find_card(hdu, bytes, "END     ");
    char *check = find_card(hdu, bytes, "CHECKSUM= '"),
         *total = find_card(hdu, bytes, "DATASUM = '");
    if (!end || !check || !total || check > end || total > end) {
        return false;
    }
    size_t header = (size_t)(end - hdu) / BST_FITS_BLOCK * BST_FITS_BLOCK + BST_FITS_BLOCK;
    char text[24];
    sum_bytes(&data, hdu + header, bytes - header);
    unsigned long sum = (unsigned long)(data.high << 16 | data.low);
    snprintf(text, sizeof text, "%10lu", sum);
    memcpy(total + 11, text, 10);
    memset(check + 11, '0', 16);
    sum_bytes(&data, hdu, header);
    /* the encoded value makes the sum of the HDU minus zero */
    fits_encode_chksum((unsigned long)(data.high << 16 | data.low), 1, text);
    memcpy(check + 11, text, 16);
    return true;
}
