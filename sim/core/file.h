/* Reading files that others wrote: regular files only, of bounded size, and text that is text. */
#ifndef BST_CORE_FILE_H
#define BST_CORE_FILE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "boresight/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Opens a regular file for reading; never waits, so a pipe or a device is refused and not read.
 * `expected` ends the messages: "PATH: ...; give EXPECTED", for example "an OEM file". *fd is the
 * caller's to close(), *bytes the file's size, at most max_bytes. BST_ERR_NOT_FOUND: there is none;
 * BST_ERR_IO: it cannot be opened or is no regular file; BST_ERR_FORMAT: it is larger. */
bst_status bst_file_open(bst_ctx *ctx, const char *path, uint64_t max_bytes, const char *expected,
                         int *fd, uint64_t *bytes) BST_MUST_CHECK;

/* Opens as bst_file_open and reads the whole file. *out holds *bytes bytes and a zero byte after
 * them; the caller frees it. Also BST_ERR_MEMORY. */
bst_status bst_file_read(bst_ctx *ctx, const char *path, uint64_t max_bytes, const char *expected,
                         char **out, size_t *bytes) BST_MUST_CHECK;

/* Writes all bytes, also in pieces; false with errno. */
bool bst_file_write_all(int fd, const void *data, size_t bytes);

/* Refuses what is no text: UTF-16, and any zero byte, by line and with what is allowed. `name`
 * stands for the file in the message. BST_ERR_FORMAT. */
bst_status bst_file_check_text(bst_ctx *ctx, const char *name, const char *text,
                               size_t bytes) BST_MUST_CHECK;

#ifdef __cplusplus
}
#endif

#endif
