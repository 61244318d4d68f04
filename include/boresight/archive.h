/* Archive: the state of a simulation as bytes. One function of a module both saves and restores
 * (bst_module_desc.archive): it names each member once, and the archive copies it out or in. */
#ifndef BORESIGHT_ARCHIVE_H
#define BORESIGHT_ARCHIVE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "boresight/status.h"

#pragma GCC visibility push(default)

typedef struct bst_archive bst_archive;

/* True while the archive restores: members have their new values after each call below. */
bool bst_archive_is_restoring(const bst_archive *archive);

/* Context for messages, log and warnings of a save or restore. */
bst_ctx *bst_archive_ctx(bst_archive *archive);

/* Saves bytes, or replaces them by the saved ones.
 *
 * Given:     data   [bytes] without pointers; changed while restoring
 *            bytes  the same number at save and restore
 * Notes:     an archive that ends early restores zeros; the caller of the module's function reports
 *            it. */
void bst_archive_bytes(bst_archive *archive, void *data, size_t bytes);

/* Saves a number of items, or gives the saved one.
 *
 * Given:     count     number of items; ignored while restoring
 *            capacity  largest number that there is room for
 * Returned:  the number of items to archive next, 0 to capacity
 * Notes:     a saved number beyond capacity is an error, which the caller of the module's function
 *            reports; the number is then 0. */
int bst_archive_count(bst_archive *archive, int count, int capacity);

/* Saves an integer, or gives the saved one: an index or a counter that must be in range.
 *
 * Given:     value        number to save; ignored while restoring
 *            least, most  allowed values
 * Returned:  the number, least to most
 * Notes:     a saved number out of range is an error, which the caller of the module's function
 *            reports; the number is then `least`. */
int64_t bst_archive_integer(bst_archive *archive, int64_t value, int64_t least, int64_t most);

/* Saves a flag, or restores it as true or false whatever byte was saved.
 *
 * Given:     flag  changed while restoring */
void bst_archive_bool(bst_archive *archive, bool *flag);

/* Archives one object without pointers: a number, a struct, an array. */
#define BST_ARCHIVE(archive, object) bst_archive_bytes(archive, &(object), sizeof(object))

#pragma GCC visibility pop

#endif
