/* Reads FITS headers without cfitsio: readers check the sizes in untrusted files before cfitsio
 * uses them. Source: FITS Standard 4.0, sections 3, 4 and 10. */
#ifndef BST_IO_FITS_CARDS_INTERNAL_H
#define BST_IO_FITS_CARDS_INTERNAL_H

#include <stdbool.h>
#include <stdint.h>

#include "boresight/status.h"

#define BST_FITS_BLOCK 2880
#define BST_FITS_CARD 80
#define BST_FITS_AXES 9
#define BST_FITS_UNSET INT64_MIN

/* Keys that determine sizes; BST_FITS_UNSET: missing in the header. */
typedef struct bst_fits_cards {
    int64_t bitpix, naxis, axes[BST_FITS_AXES], pcount, gcount, tfields;
    bool is_table;       /* an extension that is no image; then the three keys above are set */
    bool is_compressed;  /* ZIMAGE in any spelling, not false */
    uint64_t bytes;      /* of the header, including padding */
    uint64_t data_bytes; /* of the data, without padding */
} bst_fits_cards;

/* Parses the header of HDU `hdu` (from 1) at `data`, `bytes` long. `name`: file name for messages.
 * BST_ERR_FORMAT: "NAME: HDU 2: NAXIS1 is wrong (found -1; allowed: ...)"; also for a header
 * without END. */
bst_status bst_fits_read_cards(bst_ctx *ctx, const char *name, int hdu, const void *data,
                               uint64_t bytes, bst_fits_cards *out) BST_MUST_CHECK;

/* Value of a header key as text, without quotes and comment; false: no such key. A key that is
 * longer than 8 characters or has blanks is that of a card of ESO's HIERARCH convention: the words
 * before its =, as "ESO DET EXPTIME", with or without HIERARCH. */
bool bst_fits_card_text(const void *header, uint64_t bytes, const char *key,
                        char value[BST_FITS_CARD]);
/* Value of a header key as an integer of at most 18 digits; false: no such key or no integer. */
bool bst_fits_card_int(const void *header, uint64_t bytes, const char *key, int64_t *value);

#endif
