/* Fragments of a streak that is longer than is filtered for, as a point filter shows them. Internal
 * to the generator. */
#ifndef BST_OBSGEN_STREAK_STREAK_BREAKUP_H
#define BST_OBSGEN_STREAK_STREAK_BREAKUP_H

#include "obsgen/generator_internal.h"

/* Generates the fragments of long streaks: the filter output on the pixels about all such trails is
 * their light plus correlated noise. Maxima above the threshold without a higher one connected by a
 * ridge are kept, as image processing does without fits. Call it after bst_generator_decide.
 * Errors: BST_ERR_MEMORY. */
bst_status bst_streak_breakup_fragments(bst_ctx *ctx, bst_generator *generator) BST_MUST_CHECK;

void bst_streak_breakup_free(struct generator_streaks *streaks); /* NULL: nothing */

#endif
