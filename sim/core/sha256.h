/* SHA-256 of bytes and files, to identify input files. */
#ifndef BST_CORE_SHA256_H
#define BST_CORE_SHA256_H

#include <stddef.h>

#include "boresight/status.h"

enum { BST_SHA256_TEXT = 65 }; /* 64 digits and a zero byte */

/* SHA-256 digest in lower-case hex, like sha256sum (FIPS 180-4, section 6.2). */
void bst_sha256_text(const void *bytes, size_t count, char out[BST_SHA256_TEXT]);

/* SHA-256 digest of a file of at most 1 GiB; errors of bst_file_open. */
bst_status bst_sha256_file(bst_ctx *ctx, const char *path,
                           char out[BST_SHA256_TEXT]) BST_MUST_CHECK;

#endif
