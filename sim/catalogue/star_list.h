/* Stars in memory that become a catalogue file. */
#ifndef BST_CATALOGUE_STAR_LIST_H
#define BST_CATALOGUE_STAR_LIST_H

#include <stddef.h>

#include "boresight/status.h"
#include "sim/catalogue/star_index.h"

/* V to which a catalogue of one field is complete over the whole sky */
#define BST_STAR_BRIGHTER_THAN_ALL (-2.0)

typedef struct bst_star_entry {
    bst_star_record record;
    uint32_t cell;
    uint32_t variable; /* 1 and its index in the list's variables; 0: none */
    float rest_year;   /* of a place whose motion is unknown; 0: it is at J2000 */
    int64_t source;    /* identity in a user's table; 0: none */
} bst_star_entry;

typedef struct bst_star_list {
    bst_star_entry *stars;
    size_t count, room;
    uint32_t cells; /* all cells if stars of a table are among them, else 0 */
    bst_star_variable *variables;
    bst_star_point *points;
    size_t variable_count, variable_room, point_count, point_room;
} bst_star_list;

/* What a catalogue says about itself. */
typedef struct bst_star_head {
    char source[40];
    double complete_to_v_mag;
    int patch_count;
    bst_star_patch patches[BST_STAR_PATCHES_MAX];
} bst_star_head;

/* Adds a star of Tycho-2 in its cell (TYC1). BST_ERR_MEMORY. */
bst_status bst_star_list_add(bst_ctx *ctx, bst_star_list *list, const bst_star_record *record,
                             uint32_t cell) BST_MUST_CHECK;

/* Adds a variability; its light curve is copied.
 *
 * Given:     variable  star and first_point are not used
 *            points    [variable->point_count], magnitudes 0 or more
 * Returned:  *index    for bst_star_entry.variable
 * Errors:    BST_ERR_MEMORY, BST_ERR_RANGE: too many */
bst_status bst_star_list_add_variable(bst_ctx *ctx, bst_star_list *list,
                                      const bst_star_variable *variable,
                                      const bst_star_point *points, uint32_t *index) BST_MUST_CHECK;

/* Frees what a list holds. */
void bst_star_list_free(bst_star_list *list);

/* Divides the stars of a table, from list->stars[first] on, into cells of neighbours of like
 * brightness and orders them by cell: those up to V 12 first, then in steps of 3 mag. The cells
 * of a step are triangles of the hierarchical triangular mesh (Kunszt, Szalay and Thakar 2001, in
 * Mining the Sky, 631), each cut into four while it holds more than 128 stars (512 of a table of
 * more than 100 million), 14 times at most. Sets list->cells. BST_ERR_RANGE: more cells than a file
 * may have. */
bst_status bst_star_list_divide(bst_ctx *ctx, bst_star_list *list, size_t first) BST_MUST_CHECK;

/* Orders the stars by cell, brightest first, and writes the catalogue file, under a temporary name
 * that is renamed when complete.
 * Its version is the first one that can hold the stars.
 *
 * Errors:    BST_ERR_FORMAT: no stars; BST_ERR_IO, BST_ERR_MEMORY */
bst_status bst_star_list_write(bst_ctx *ctx, bst_star_list *list, const bst_star_head *head,
                               const char *out_path) BST_MUST_CHECK;

#endif
