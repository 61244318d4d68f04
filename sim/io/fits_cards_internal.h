/* Headers of FITS files as bytes, read without cfitsio: a reader of foreign files checks with these
 * the sizes that cfitsio would believe. Source: FITS Standard 4.0, sections 3, 4 and 10. */
#ifndef BST_IO_FITS_CARDS_INTERNAL_H
#define BST_IO_FITS_CARDS_INTERNAL_H

#include <stdbool.h>
#include <stdint.h>

#include "boresight/status.h"

#define BST_FITS_BLOCK 2880
#define BST_FITS_CARD 80
#define BST_FITS_AXES 9
#define BST_FITS_UNSET INT64_MIN

/* Values of the keys that sizes hang on; BST_FITS_UNSET where the header has none. */
typedef struct bst_fits_cards {
    int64_t bitpix, naxis, axes[BST_FITS_AXES], pcount, gcount, tfields;
    bool is_table;       /* an extension that is no image: then none of the three above is unset */
    bool is_compressed;  /* ZIMAGE, in any spelling, and not false */
    uint64_t bytes;      /* of the header, blocks filled */
    uint64_t data_bytes; /* of the data, without filling */
} bst_fits_cards;

/* Reads the header of HDU `hdu` (from 1) that begins at `data`, of which `bytes` are there. `name`
 * stands for the file in messages. BST_ERR_FORMAT: "NAME: HDU 2: NAXIS1 is wrong (found -1;
 * allowed: ...)"; also for a header that does not end within the bytes. */
bst_status bst_fits_read_cards(bst_ctx *ctx, const char *name, int hdu, const void *data,
                               uint64_t bytes, bst_fits_cards *out) BST_MUST_CHECK;

/* The value of a key as text, without quotes and comment; false when the header has no such key. */
bool bst_fits_card_text(const void *header, uint64_t bytes, const char *key,
                        char value[BST_FITS_CARD]);
/* The same of an integer of at most 18 digits; false too when the value is none. */
bool bst_fits_card_int(const void *header, uint64_t bytes, const char *key, int64_t *value);

#endif
