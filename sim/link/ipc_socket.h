/* Unix socket file at which peers of a link connect by ipc://PATH. */
#ifndef BST_LINK_IPC_SOCKET_H
#define BST_LINK_IPC_SOCKET_H

#include <sys/types.h>
#include <time.h>

#include "boresight/status.h"

typedef struct bst_ipc_socket {
    int fd; /* listening; the receiver closes it */
    char path[108];
    dev_t device;
    ino_t inode;
    struct timespec made; /* inode numbers are reused: compare the time too */
} bst_ipc_socket;

/* Makes a listening socket at `path`, for this user alone (mode 0600).
 * A dead socket of this user at the path is removed first; anything else is left unchanged.
 * Errors: BST_ERR_ARGUMENT: the path is too long; BST_ERR_IO, with path and remedy: a file
 *         that is no socket, a socket in use or of another user, or a folder without write
 *         permission. */
bst_status bst_ipc_socket_open(bst_ctx *ctx, const char *path, bst_ipc_socket *out) BST_MUST_CHECK;

/* Removes the socket file if it is still the one that was created. */
void bst_ipc_socket_remove(const bst_ipc_socket *s);

#endif
