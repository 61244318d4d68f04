/* What a filter for points shows of a streak that is longer than is filtered for. Inside of the
 * generator. */
#ifndef BST_OBSGEN_STREAK_STREAK_BREAKUP_H
#define BST_OBSGEN_STREAK_STREAK_BREAKUP_H

#include "obsgen/generator_internal.h"

/* Draws the filter's output on the pixels about the ways of all sources that are broken, the light
 * of all of them and noise of its correlation, and keeps the maxima above the threshold that no
 * higher one nearby shares a ridge with, as image processing does where it fits nothing: parts of
 * streaks. After bst_generator_decide. BST_ERR_MEMORY. */
bst_status bst_streak_breakup_fragments(bst_ctx *ctx, bst_generator *generator) BST_MUST_CHECK;

void bst_streak_breakup_free(struct generator_streaks *streaks); /* NULL: nothing */

#endif
