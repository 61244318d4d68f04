/* The structure of a FITS file, checked before cfitsio, which believes what headers say of sizes.
 */
#ifndef BST_IO_FITS_CHECK_H
#define BST_IO_FITS_CHECK_H

#include <stdint.h>

#include "boresight/status.h"

/* Checks that a file of `bytes` bytes at `data` is a sequence of HDUs whose sizes, by BITPIX,
 * NAXIS, NAXISn and PCOUNT, are plain integers that fit into the file, each given once; that
 * nothing follows the last; and that there is no compressed image: cfitsio 4.2 reads beyond its
 * memory on damaged ones, whatever their headers say. `name` stands for the file in messages.
 * BST_ERR_FORMAT: "NAME: HDU 2: NAXIS1 is wrong (found -1; allowed: ...)". Source: FITS
 * Standard 4.0, sections 3, 4.4.1 and 10. */
bst_status bst_fits_check_structure(bst_ctx *ctx, const char *name, const void *data,
                                    uint64_t bytes) BST_MUST_CHECK;

#endif
