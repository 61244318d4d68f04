/* Structure check of untrusted FITS files, because cfitsio trusts the sizes in headers. */
#ifndef BST_IO_FITS_CHECK_H
#define BST_IO_FITS_CHECK_H

#include <stdint.h>

#include "boresight/status.h"

/* Checks that the file at `data` is a sequence of HDUs whose sizes (BITPIX, NAXIS, NAXISn, PCOUNT)
 * are integers, given once, and fit into the file, without trailing data. Compressed images are
 * rejected: cfitsio 4.2 reads beyond its memory on damaged ones. `name`: file name for messages.
 * BST_ERR_FORMAT: "NAME: HDU 2: NAXIS1 is wrong (found -1; allowed: ...)". Source: FITS Standard
 * 4.0, sections 3, 4.4.1 and 10. */
bst_status bst_fits_check_structure(bst_ctx *ctx, const char *name, const void *data,
                                    uint64_t bytes) BST_MUST_CHECK;

#endif
