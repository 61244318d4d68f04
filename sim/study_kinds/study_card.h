/* Data card of a set of labelled sequences, and its split into training, validation and test. */
#ifndef BST_STUDY_KINDS_STUDY_CARD_H
#define BST_STUDY_KINDS_STUDY_CARD_H

#include "sim/studies/results.h"

/* Metrics of the kind that the data card summarises. */
typedef struct bst_study_card_metrics {
    int frames, satellites, stars, bytes, part;
} bst_study_card_metrics;

/* Part of a run: 0 training, 1 validation, 2 test. It depends only on seed and run number, so that
 * a scene is in one part only. */
int bst_study_part(const bst_study_cubes_config *config, uint64_t seed, int64_t run);

/* Writes OUT/train.txt, val.txt and test.txt (per line a sequence: frames, labels) and
 * OUT/card.json: varied parameters with ranges, counts, seeds, provenance. */
bst_status bst_study_write_card(bst_ctx *ctx, const bst_results *results,
                                const bst_study_card_metrics *metrics,
                                const char *out) BST_MUST_CHECK;

#endif
