/* Generates the interface control document of the link from its message tables. */
#ifndef BST_LINK_ICD_H
#define BST_LINK_ICD_H

#include <stdio.h>

#include "boresight/status.h"

/* Writes docs/reference/icd.md (Markdown). BST_ERR_IO: write error. */
bst_status bst_link_icd(bst_ctx *ctx, FILE *out) BST_MUST_CHECK;

#endif
