/* Reads untrusted input files: regular files of limited size, and text without binary data. */
#ifndef BST_CORE_FILE_H
#define BST_CORE_FILE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "boresight/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Opens a regular file for reading; never blocks: pipes and devices are rejected. `expected` ends
 * the messages: "PATH: ...; give EXPECTED", for example "an OEM file". The caller closes *fd;
 * *bytes: file size, at most max_bytes. BST_ERR_NOT_FOUND: no file; BST_ERR_IO: cannot be opened or
 * no regular file; BST_ERR_FORMAT: too large. */
bst_status bst_file_open(bst_ctx *ctx, const char *path, uint64_t max_bytes, const char *expected,
                         int *fd, uint64_t *bytes) BST_MUST_CHECK;

/* Opens as bst_file_open and reads the whole file. *out: *bytes bytes and a terminating zero; the
 * caller frees it. Also BST_ERR_MEMORY. */
bst_status bst_file_read(bst_ctx *ctx, const char *path, uint64_t max_bytes, const char *expected,
                         char **out, size_t *bytes) BST_MUST_CHECK;

/* Writes all bytes, if necessary in several calls; false with errno. */
bool bst_file_write_all(int fd, const void *data, size_t bytes);

/* Path of a file that a document in the folder `base_dir` names: `file` itself if it is absolute or
 * empty, or if base_dir is empty.
 *
 * Returned:  out  [bytes], cut if it does not fit */
void bst_file_resolve(const char *base_dir, const char *file, char *out, size_t bytes);

/* Rejects binary files: UTF-16 and zero bytes, with the line number. `name`: file name for
 * messages. BST_ERR_FORMAT. */
bst_status bst_file_check_text(bst_ctx *ctx, const char *name, const char *text,
                               size_t bytes) BST_MUST_CHECK;

#ifdef __cplusplus
}
#endif

#endif
