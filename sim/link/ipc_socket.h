/* The socket in the file system at which peers of a link connect by ipc://PATH. */
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
    struct timespec made; /* numbers of inodes are used again */
} bst_ipc_socket;

/* Makes a listening socket at `path`, for this user alone (mode 0600).
 * What is there is looked at first: a socket of this user that nobody listens at any more is
 * removed, anything else is left alone.
 * Errors: BST_ERR_ARGUMENT: the path is too long; BST_ERR_IO, with path and what to do: something
 * that is no socket is there, another program listens there, the socket is another user's, or the
 * folder cannot be written to. */
bst_status bst_ipc_socket_open(bst_ctx *ctx, const char *path, bst_ipc_socket *out) BST_MUST_CHECK;

/* Removes the socket from the file system, if it still is the one that was made. */
void bst_ipc_socket_remove(const bst_ipc_socket *s);

#endif
