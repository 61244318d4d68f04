/* Archives in memory: records that a simulation's parts write and read in the same order. */
#ifndef BST_CORE_ARCHIVE_H
#define BST_CORE_ARCHIVE_H

#include <stdint.h>

#include "boresight/archive.h"

/* Creates an empty archive to save to.
 *
 * Returned:  *out  NULL on error
 * Errors:    BST_ERR_MEMORY
 * Ownership: free *out with bst_archive_free */
bst_status bst_archive_create(bst_ctx *ctx, bst_archive **out) BST_MUST_CHECK;

/* Creates an archive that restores from bytes.
 *
 * Given:     bytes  [size] must outlive the archive; not changed
 * Errors:    BST_ERR_MEMORY
 * Ownership: free *out with bst_archive_free */
bst_status bst_archive_open(bst_ctx *ctx, const void *bytes, size_t size,
                            bst_archive **out) BST_MUST_CHECK;

/* Lets an archive refer to frames by their address instead of their pixels: it is restored in this
 * process, while the simulation that it saves is unchanged.
 *
 * Notes:     of an archive to save to and of the one that restores from its bytes. */
void bst_archive_refer(bst_archive *archive);
/* True after bst_archive_refer. */
bool bst_archive_refers(const bst_archive *archive);

/* Frees an archive and the bytes that it saved; NULL is allowed. */
void bst_archive_free(bst_archive *archive);

/* Bytes saved so far.
 *
 * Returned:  [*size], valid until the next call that saves */
const void *bst_archive_data(const bst_archive *archive, size_t *size);

/* Saves bytes outside of records, such as the head of a file. */
void bst_archive_raw(bst_archive *archive, const void *data, size_t bytes);

/* Gives what an archive has saved to the caller, and empties the archive.
 *
 * Returned:  [*size] to be freed with free; NULL: there was no memory for a part of it */
void *bst_archive_take(bst_archive *archive, size_t *size);

/* Bytes of the open record that are not yet restored. */
size_t bst_archive_remaining(const bst_archive *archive);

/* Begins a record. While saving, the record gets this name. While restoring, the next record must
 * have it.
 *
 * Given:     name  at most 255 bytes, for messages and checks
 * Errors:    BST_ERR_FORMAT: another record follows, or none; BST_ERR_MEMORY */
bst_status bst_archive_begin(bst_ctx *ctx, bst_archive *archive, const char *name) BST_MUST_CHECK;

/* Ends the record.
 *
 * Errors:    BST_ERR_FORMAT: the record was not read exactly to its end, or a number of items was
 *            out of range; BST_ERR_MEMORY */
bst_status bst_archive_end(bst_ctx *ctx, bst_archive *archive) BST_MUST_CHECK;

/* Skips the next record, which must have this name.
 *
 * Errors:    BST_ERR_FORMAT */
bst_status bst_archive_skip(bst_ctx *ctx, bst_archive *archive, const char *name) BST_MUST_CHECK;

#endif
