/* A complete measurement of the probability of detection, with its table and files. */
#ifndef BST_ANALYSIS_PD_PD_MEASUREMENT_H
#define BST_ANALYSIS_PD_PD_MEASUREMENT_H

#include "sim/analysis/pd/pd_request.h"

/* Measures the detector of a scenario, prints the table to stdout, and writes the JSON file and the
 * plot if asked for. For a stack, the detector is measured on single frames, too. With
 * request->pair, pairs are measured: pd_pair.h.
 *
 * Given:     request  after bst_pd_request_settle
 * Errors:    BST_ERR_INTERRUPTED; BST_ERR_MEMORY; those of opening the scene and the detector, of
 *            rendering and of writing the files */
bst_status bst_pd_measure(bst_ctx *ctx, const bst_pd_request *request,
                          const bst_scenario *scenario) BST_MUST_CHECK;

#endif
