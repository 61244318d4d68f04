/* Names to numbers: a hash table that does not slow down with a catalogue of objects. */
#ifndef BST_WORLD_NAME_INDEX_H
#define BST_WORLD_NAME_INDEX_H

#include "boresight/status.h"

typedef struct bst_name_index bst_name_index;

/* Room for up to `capacity` names. Freed with bst_name_index_free. */
bst_status bst_name_index_create(bst_ctx *ctx, int capacity, bst_name_index **out) BST_MUST_CHECK;
void bst_name_index_free(bst_name_index *index); /* NULL allowed */

/* The number that goes with `name`, -1 when it is not there. */
int bst_name_index_find(const bst_name_index *index, const char *name);

/* Adds a name (borrowed) that is not there yet. */
void bst_name_index_add(bst_name_index *index, const char *name, int number);

#endif
