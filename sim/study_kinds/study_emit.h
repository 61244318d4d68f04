/* The scenario of one run of a study. */
#ifndef BST_STUDY_KINDS_STUDY_EMIT_H
#define BST_STUDY_KINDS_STUDY_EMIT_H

#include <stdio.h>

#include "sim/studies/kind.h"

/* Writes the scenario of a run, and how to run it by hand.
 *
 * Given:     number  of the run, from 0
 *            stream  for the scenario
 *            notes   for the command line
 * Errors:    BST_ERR_NOT_FOUND if the study has no such run; BST_ERR_MEMORY; those of the scenario
 */
bst_status bst_study_emit(bst_ctx *ctx, const bst_study *study, const bst_study_kind *kind,
                          int64_t number, FILE *stream, FILE *notes) BST_MUST_CHECK;

#endif
