/* The outcome of a study in words. */
#ifndef BST_STUDIES_STUDY_OUTCOME_H
#define BST_STUDIES_STUDY_OUTCOME_H

#include <stdio.h>

#include "sim/studies/driver.h"

/* Prints how many runs are done, the first failures, what is missing and how to go on, and where
 * the results are.
 *
 * Given:     wall_s  duration of the execution
 *            out     folder of the study */
void bst_study_print_outcome(FILE *stream, const bst_results *results,
                             const bst_driver_outcome *outcome, double wall_s, const char *out);

#endif
