/* Paths that an exported page does not show. */
#ifndef BST_VIEW_PAGE_PATHS_H
#define BST_VIEW_PAGE_PATHS_H

#include <cjson/cJSON.h>

/* Cuts the path up to the folder of the run out of all texts of a JSON value, in place:
 * "/some/one/runs/demo/frames.fits: cannot be opened" becomes "demo/frames.fits: cannot be opened".
 *
 * Given:     node    with its children; NULL is allowed
 *            folder  of the run, as it was given; its absolute path is cut, too */
void bst_view_cut_path(cJSON *node, const char *folder);

#endif
