/* Checks the structure of a FITS file before cfitsio reads it: cfitsio trusts the sizes in
 * headers. */
#include <inttypes.h>
#include <stddef.h>

#include "sim/io/fits_cards_internal.h"
#include "sim/io/fits_check.h"

enum { MAX_HDUS = 10000 };

bst_status bst_fits_check_structure(bst_ctx *ctx, const char *name, const void *data,
                                    uint64_t bytes) {
    uint64_t at = 0;
    for (int hdu = 1; at < bytes; hdu++) {
        if (hdu > MAX_HDUS) {
            return bst_fail(ctx, BST_ERR_FORMAT, "%.400s: more than %d HDUs", name, MAX_HDUS);
        }
        bst_fits_cards cards;
        BST_TRY(bst_fits_read_cards(ctx, name, hdu, (const char *)data + at, bytes - at, &cards));
        uint64_t left = cards.bytes < bytes - at ? bytes - at - cards.bytes : 0;
        if (cards.data_bytes > left || cards.bytes > bytes - at) {
            return bst_fail(ctx, BST_ERR_FORMAT,
                            "%.400s: HDU %d: is cut short: %" PRIu64 " bytes of data, %" PRIu64
                            " in the file",
                            name, hdu, cards.data_bytes, left);
        }
        if (cards.is_compressed) {
            return bst_fail(ctx, BST_ERR_FORMAT,
                            "%.400s: HDU %d: is a compressed image (allowed: images that are not "
                            "compressed); unpack the file with funpack",
                            name, hdu);
        }
        at +=
            cards.bytes + (cards.data_bytes + BST_FITS_BLOCK - 1) / BST_FITS_BLOCK * BST_FITS_BLOCK;
    }
    return BST_OK;
}
