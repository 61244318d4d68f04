/* The data card of a set of labelled sequences, and its parts. */
#ifndef BST_STUDY_KINDS_STUDY_CARD_H
#define BST_STUDY_KINDS_STUDY_CARD_H

#include "sim/studies/results.h"

/* Which metrics of the kind are what the card tells. */
typedef struct bst_study_card_metrics {
    int frames, satellites, stars, bytes, part;
} bst_study_card_metrics;

/* 0 training, 1 validation, 2 test: by the run's number, whatever else is in the study, so that a
 * scene is in one part alone. */
int bst_study_part(const bst_study_cubes_config *config, uint64_t seed, int64_t run);

/* Writes OUT/train.txt, val.txt and test.txt (a line a sequence: its frames, its labels) and
 * OUT/card.json: what was varied and between which values, counts, seeds, how it was made. */
bst_status bst_study_write_card(bst_ctx *ctx, const bst_results *results,
                                const bst_study_card_metrics *metrics,
                                const char *out) BST_MUST_CHECK;

#endif
