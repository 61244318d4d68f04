/* Selection of objects whose orbits `boresight export --orbits` writes. */
#ifndef BST_EXPORT_ORBIT_SELECTION_H
#define BST_EXPORT_ORBIT_SELECTION_H

#include <stdbool.h>

#include "sim/io/run_reader.h"
#include "sim/world/world.h"

/* maximum number of objects written by default; of more, only those that were in a field */
enum { BST_ORBIT_SELECTION_MOST = 100 };

typedef struct bst_orbit_selection {
    bool *chosen; /* [objects of the world] */
    int count;    /* number of selected objects */
    int left_out; /* objects that were never in a field; 0 if `text` was given */
} bst_orbit_selection;

/* Selects objects of a run.
 *
 * Given:     the run, its world, and `text`: "all"; "seen": objects that were in a
 *            field, and the sensors' targets; a list "NAME,NORAD,..." (names may contain commas);
 *            NULL: all of up to BST_ORBIT_SELECTION_MOST objects, else "seen"
 * Errors:    BST_ERR_NOT_FOUND: an entry is no object; BST_ERR_MEMORY
 * Ownership: free with bst_orbit_selection_free, also after an error */
bst_status bst_orbit_selection_make(bst_ctx *ctx, const bst_run_reader *run, const bst_world *world,
                                    const char *text, bst_orbit_selection *out) BST_MUST_CHECK;
/* Frees the memory of a selection and clears the struct, which belongs to the caller. */
void bst_orbit_selection_free(bst_orbit_selection *selection);

#endif
