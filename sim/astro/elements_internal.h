/* What the readers of element sets share: the list that grows, and what becomes of bad sets. */
#ifndef BST_ASTRO_ELEMENTS_INTERNAL_H
#define BST_ASTRO_ELEMENTS_INTERNAL_H

#include "sim/astro/elements.h"
#include "sim/astro/text_internal.h"

typedef struct bst_elements_reader {
    bst_text_source source;
    bst_elements_options options;
    bst_elements *sets;
    int count, capacity;
    int skipped; /* bad sets */
    int others;  /* sets of other satellites than the one asked for */
} bst_elements_reader;

/* A reader of element sets without sets.
 *
 * Given:     name     file, for messages; must outlive the reader
 *            options  copied; NULL: the defaults */
bst_elements_reader bst_elements_start(bst_ctx *ctx, const char *name,
                                       const bst_elements_options *options);

/* Appends a copy of an element set.
 *
 * Errors:    BST_ERR_MEMORY */
bst_status bst_elements_append(bst_elements_reader *reader, const bst_elements *set) BST_MUST_CHECK;

/* A format error stops reading, or is logged and counted where the caller asked for that. */
bst_status bst_elements_tolerate(bst_elements_reader *reader, bst_status status) BST_MUST_CHECK;

/* Hands the list over, or frees it and fails when status is not BST_OK or there is no set in it.
 * `expected` says what the file should hold. */
bst_status bst_elements_finish(bst_elements_reader *reader, bst_status status, bool empty,
                               const char *expected, bst_elements **out, int *count) BST_MUST_CHECK;

/* Reads OMMs from JSON: an object, or an array of objects.
 *
 * Given:     data  [bytes] text
 * Errors:    BST_ERR_FORMAT, BST_ERR_MEMORY; faulty sets are tolerated as the reader's options say
 */
bst_status bst_astro_omm_read_json(bst_elements_reader *reader, const char *data,
                                   size_t bytes) BST_MUST_CHECK;

/* Reads OMMs from CSV: a row of keywords, then a row for each set.
 *
 * Given:     data  [bytes] text
 * Errors:    BST_ERR_FORMAT, BST_ERR_MEMORY; faulty sets are tolerated as the reader's options say
 */
bst_status bst_astro_omm_read_csv(bst_elements_reader *reader, const char *data,
                                  size_t bytes) BST_MUST_CHECK;

#endif
