/* A star catalogue in words: where it is and what it holds. */
#ifndef BST_CATALOGUE_STAR_SUMMARY_H
#define BST_CATALOGUE_STAR_SUMMARY_H

#include <stdint.h>
#include <stdio.h>

#include "sim/catalogue/stars.h"

/* Prints source, path, completeness, patches, numbers of stars to each whole V magnitude, and
 * licence of a catalogue.
 *
 * Errors:    those of bst_stars_query */
bst_status bst_stars_print_summary(bst_ctx *ctx, const bst_stars *stars,
                                   FILE *stream) BST_MUST_CHECK;

/* Prints identity, direction at J2000, V and B-V of a star, and its identity in a user's table.
 *
 * Errors:    those of bst_stars_find */
bst_status bst_stars_print_star(bst_ctx *ctx, const bst_stars *stars, uint32_t id,
                                FILE *stream) BST_MUST_CHECK;

#endif
