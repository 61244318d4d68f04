/* The interface control document of the link, made from the tables that the code uses. */
#ifndef BST_LINK_ICD_H
#define BST_LINK_ICD_H

#include <stdio.h>

#include "boresight/status.h"

/* Writes docs/reference/icd.md (Markdown). BST_ERR_IO: the stream took less. */
bst_status bst_link_icd(bst_ctx *ctx, FILE *out) BST_MUST_CHECK;

#endif
