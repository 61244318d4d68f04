/* Which objects of a run's scenario `boresight export --orbits` writes. */
#ifndef BST_EXPORT_ORBIT_SELECTION_H
#define BST_EXPORT_ORBIT_SELECTION_H

#include <stdbool.h>

#include "sim/io/run_reader.h"
#include "sim/world/world.h"

/* Above this number of objects only those that were in a field are written, unless asked. */
enum { BST_ORBIT_SELECTION_MOST = 100 };

typedef struct bst_orbit_selection {
    bool *chosen; /* of each object of the world */
    int count;    /* of the chosen */
    int left_out; /* objects that no field held; 0: `text` was given */
} bst_orbit_selection;

/* Given: the run, its world, and `text`: "all"; "seen", the objects that came into a field and the
 * targets of the sensors; a list "NAME,NORAD,..." (a name that holds commas is found whole); NULL:
 * all of up to BST_ORBIT_SELECTION_MOST objects, else "seen". Errors: BST_ERR_NOT_FOUND for an
 * entry that is no object; BST_ERR_MEMORY. Freed with bst_orbit_selection_free, also after an
 * error. */
bst_status bst_orbit_selection_make(bst_ctx *ctx, const bst_run_reader *run, const bst_world *world,
                                    const char *text, bst_orbit_selection *out) BST_MUST_CHECK;
/* Frees the memory of a selection and clears the struct, which belongs to the caller. */
void bst_orbit_selection_free(bst_orbit_selection *selection);

#endif
