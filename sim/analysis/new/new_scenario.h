/* boresight new: a first scenario in which one satellite follows another. */
#ifndef BST_ANALYSIS_NEW_NEW_SCENARIO_H
#define BST_ANALYSIS_NEW_NEW_SCENARIO_H

#include "sim/analysis/new/scene_search.h"
#include "sim/cli/options.h"

/* What the command line asks for. */
typedef struct bst_new_order {
    const char *observer, *target; /* as bst_new_satellite_find reads them */
    const char *out;               /* NULL: named after the two */
    bool overwrite;
    bst_new_request request; /* sensor and times; satellites and names are filled in */
} bst_new_order;

/* Reduces a name to the characters that names of scenarios and observers may hold: "NEOSSAT (X)"
 * becomes "neossat_x".
 *
 * Given:     bytes  size of `out`; longer names are cut */
void bst_new_plain_name(const char *name, char *out, size_t bytes);

/* Finds the satellites and a scene that `boresight check` accepts without warnings, writes the
 * scenario and prints what it is to stdout.
 *
 * Given:     table  options of the command: no output may be a file of element sets
 * Errors:    BST_ERR_ARGUMENT: the file is there, or observer and target are the same;
 *            those of bst_new_satellite_find, bst_new_scene_find and writing */
bst_status bst_new_scenario_make(bst_ctx *ctx, const bst_new_order *order,
                                 const bst_option *table) BST_MUST_CHECK;

#endif
