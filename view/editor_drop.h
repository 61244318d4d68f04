/* Files that are dropped onto the scenario editor: element sets, shapes, frames. */
#ifndef BST_VIEW_EDITOR_DROP_H
#define BST_VIEW_EDITOR_DROP_H

#include <cjson/cJSON.h>

#include "boresight/status.h"

enum { BST_VIEW_DROP_SETS = 500 /* element sets that are listed */ };

/* Looks at a file by its content, and says what it can become in a scenario.
 *
 * Given:     name   of the file, without a folder
 *            data   [bytes]
 * Returned:  *out   one of
 *            {kind: "elements", total, left_out, satellites: [{name, norad, line1, line2}]}: a
 *            TLE file or a CCSDS OMM (JSON, CSV), the first BST_VIEW_DROP_SETS; numbers of an OMM
 *            are rounded to the columns of a TLE, where catalogue numbers above 339999 are 0;
 *            left_out: sets before the last listed one that a TLE cannot hold otherwise
 *            {kind: "shape", file, parts, facets, radius_m}: a glTF or GLB, which was written to
 *            the working folder
 *            {kind: "frame", offers: [{text, from, unsure, changes: [{key, value}]}]}: a FITS file;
 *            key: a path below the sensor, or from the scenario's root if it begins with "/";
 *            unsure: GAIN, which has no certain unit
 * Errors:    BST_ERR_ARGUMENT with the name of the file and what is wrong with it, or another file
 *            of this name is in the folder; BST_ERR_IO
 * Notes:     files are read one at a time, and JSON of two million values at most
 * Ownership: free *out with cJSON_Delete */
bst_status bst_view_editor_drop(bst_ctx *ctx, const char *name, const char *data, size_t bytes,
                                cJSON **out) BST_MUST_CHECK;

#endif
