/* What a filter for points shows of a streak that is longer than is filtered for. Inside of the
 * generator. */
#ifndef BST_OBSGEN_FRAGMENTS_H
#define BST_OBSGEN_FRAGMENTS_H

#include "obsgen/generator_internal.h"

/* Draws the filter's output along the source's path, noise correlated as a Gaussian filter makes
 * it, and keeps its separate maxima above the threshold as detections: parts of the streak. */
void bst_generator_fragments(bst_generator *generator, const generator_source *source);

#endif
