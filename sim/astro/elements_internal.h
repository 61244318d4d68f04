/* Internal parts of the element-set readers: growing list, and treatment of invalid sets. */
#ifndef BST_ASTRO_ELEMENTS_INTERNAL_H
#define BST_ASTRO_ELEMENTS_INTERNAL_H

#include "sim/astro/elements.h"
#include "sim/core/text_reader.h"

typedef struct bst_elements_reader {
    bst_text_source source;
    bst_elements_options options;
    bst_elements *sets;
    int count, capacity;
    int skipped; /* number of invalid sets */
    int others;  /* sets of other satellites than requested */
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

/* Handles a format error: stops reading, or logs and counts it if the options permit. */
bst_status bst_elements_tolerate(bst_elements_reader *reader, bst_status status) BST_MUST_CHECK;

/* Returns the list, or frees it and fails if status is not BST_OK or the list is empty. `expected`:
 * content that the file should have. */
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
