/* Keys for authentication and encryption of a link's peers: ZeroMQ CURVE (RFC 26, CurveZMQ). */
#ifndef BST_LINK_CURVE_KEYS_H
#define BST_LINK_CURVE_KEYS_H

#include <stdbool.h>

#include "boresight/status.h"

enum { BST_CURVE_TEXT = 41 }; /* 32 bytes in Z85, zero-terminated */

/* Key pairs of the simulation and of its peers, from one file. */
typedef struct bst_curve_keys {
    char simulation_public[BST_CURVE_TEXT], simulation_secret[BST_CURVE_TEXT];
    char peer_public[BST_CURVE_TEXT], peer_secret[BST_CURVE_TEXT];
} bst_curve_keys;

/* Creates a file with new keys, mode 0600. BST_ERR_IO: the file exists or cannot be created;
 * BST_ERR_STATE: this ZeroMQ has no CURVE. */
bst_status bst_curve_keys_make(bst_ctx *ctx, const char *path) BST_MUST_CHECK;

/* Reads a key file. BST_ERR_ARGUMENT: other users may read it (allowed: mode 0600 or less);
 * BST_ERR_FORMAT with file and line; errors of bst_file_open. */
bst_status bst_curve_keys_read(bst_ctx *ctx, const char *path, bst_curve_keys *out) BST_MUST_CHECK;

/* Sets the keys of a ZeroMQ socket before it is bound or connected. The simulation's socket accepts
 * only peers with the key in the file, if bst_curve_answer is called. BST_ERR_STATE. */
bst_status bst_curve_secure(bst_ctx *ctx, void *socket, const bst_curve_keys *keys,
                            bool simulation) BST_MUST_CHECK;

/* Creates the socket for ZeroMQ's authentication requests (RFC 27, ZAP) in its context. NULL with
 * errno. */
void *bst_curve_asker(void *context);
/* Answers one authentication request if there is one: accepts the peer's key, rejects others.
 * Returned: true if a peer was rejected. */
bool bst_curve_answer(void *asker, const bst_curve_keys *keys);

#endif
