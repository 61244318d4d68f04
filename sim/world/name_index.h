/* Hash table from object names to object indices, for catalogues of thousands of objects. */
#ifndef BST_WORLD_NAME_INDEX_H
#define BST_WORLD_NAME_INDEX_H

#include "boresight/status.h"

typedef struct bst_name_index bst_name_index;

/* Creates an index for up to `capacity` object names. Free it with bst_name_index_free. */
bst_status bst_name_index_create(bst_ctx *ctx, int capacity, bst_name_index **out) BST_MUST_CHECK;
void bst_name_index_free(bst_name_index *index); /* NULL allowed */

/* Index of the object with this name; -1: not found. */
int bst_name_index_find(const bst_name_index *index, const char *name);

/* Adds a name that is not in the index yet; the name is borrowed. */
void bst_name_index_add(bst_name_index *index, const char *name, int number);

#endif
