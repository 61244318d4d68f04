/* Finds the element set of a satellite that the command line names. */
#ifndef BST_ANALYSIS_NEW_SATELLITE_LOOKUP_H
#define BST_ANALYSIS_NEW_SATELLITE_LOOKUP_H

#include "sim/analysis/new/scene_search.h"

/* Finds a satellite by a catalogue number or name of the shipped element sets, by a file that holds
 * one satellite, or by FILE:NUMBER. Of several sets of one satellite in a file, the latest is
 * taken.
 *
 * Given:     option  name of the command-line option, for messages
 *            which   its value; names are compared without regard to case
 * Errors:    BST_ERR_NOT_FOUND with the nearest name; BST_ERR_ARGUMENT if several satellites match;
 *            those of reading the file */
bst_status bst_new_satellite_find(bst_ctx *ctx, const char *option, const char *which,
                                  bst_new_satellite *out) BST_MUST_CHECK;

#endif
