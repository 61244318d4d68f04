/* A star catalogue in words: where it is and what it holds. */
#ifndef BST_CATALOGUE_STAR_SUMMARY_H
#define BST_CATALOGUE_STAR_SUMMARY_H

#include <stdio.h>

#include "sim/catalogue/stars.h"

/* Prints source, path, completeness, patches, numbers of stars to each whole V magnitude, and
 * licence of a catalogue.
 *
 * Errors:    those of bst_stars_query */
bst_status bst_stars_print_summary(bst_ctx *ctx, const bst_stars *stars,
                                   FILE *stream) BST_MUST_CHECK;

#endif
