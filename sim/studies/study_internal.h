/* What the parts of bst_studies share. */
#ifndef BST_STUDIES_STUDY_INTERNAL_H
#define BST_STUDIES_STUDY_INTERNAL_H

#include "sim/studies/study.h"

/* Reads the scenarios; relative paths start from the folder of `file`. */
bst_status bst_study_read_bases(bst_ctx *ctx, bst_study *study, const char *file) BST_MUST_CHECK;
/* Places the points of a latin_hypercube or morris design: factor->unit, levels and steps. */
bst_status bst_study_place_points(bst_ctx *ctx, const bst_study *study,
                                  const bst_sweep_config *sweep,
                                  bst_study_factor *factor) BST_MUST_CHECK;

/* The shortest text that reads back as the same bits. */
void bst_study_number_text(double value, char text[40]);

/* What is at a JSON pointer; NULL: nothing. */
const struct cJSON *bst_study_at(const struct cJSON *node, const char *pointer);

#endif
