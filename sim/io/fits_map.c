/* Writes a map as a FITS file. */
#include <assert.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include "sim/io/draft_file.h"
#include "sim/io/fits_image.h"

enum { BLOCK = 2880, CARD = 80 };

/* Adds a header card "KEY     = value", padded with blanks. */
static void put_card(char *header, int *cards, const char *key, const char *value) {
    char text[CARD + 1];
    int n = snprintf(text, sizeof text, *value ? "%-8s= %20s" : "%s", key, value);
    memcpy(header + *cards * CARD, text, (size_t)(n < CARD ? n : CARD));
    (*cards)++;
}

/* Writes pixels as big-endian IEEE 754 numbers, and fills the last block. */
static void write_pixels(FILE *file, const float *pixels, size_t count) {
    unsigned char bytes[BLOCK];
    size_t at = 0;
    for (size_t i = 0; i < count; i++) {
        uint32_t word;
        memcpy(&word, &pixels[i], sizeof word);
        for (int k = 0; k < 4; k++) {
            bytes[at++] = (unsigned char)(word >> (24 - 8 * k));
        }
        if (at == BLOCK || i + 1 == count) {
            memset(bytes + at, 0, BLOCK - at);
            fwrite(bytes, 1, BLOCK, file);
            at = 0;
        }
    }
}

bst_status bst_fits_write_map(bst_ctx *ctx, const char *path, int width, int height,
                              const float *pixels, const char *unit) {
    assert(path && width > 0 && height > 0 && pixels && unit && strlen(unit) <= 60);
    char header[BLOCK], value[72];
    int cards = 0;
    bst_draft draft;
    memset(header, ' ', sizeof header);
    put_card(header, &cards, "SIMPLE", "T");
    put_card(header, &cards, "BITPIX", "-32");
    put_card(header, &cards, "NAXIS", "2");
    snprintf(value, sizeof value, "%d", width);
    put_card(header, &cards, "NAXIS1", value);
    snprintf(value, sizeof value, "%d", height);
    put_card(header, &cards, "NAXIS2", value);
    snprintf(value, sizeof value, "'%-8s'", unit);
    put_card(header, &cards, "BUNIT", value);
    put_card(header, &cards, "END", "");
    BST_TRY(bst_draft_open(ctx, path, &draft));
    fwrite(header, 1, sizeof header, draft.stream);
    write_pixels(draft.stream, pixels, (size_t)width * (size_t)height);
    return bst_draft_close(ctx, &draft, BST_OK); /* which reports errors of the stream */
}
