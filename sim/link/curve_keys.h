/* Keys of a link that asks its peers for proof of who they are, and encrypts: ZeroMQ's CURVE
 * (RFC 26, CurveZMQ). */
#ifndef BST_LINK_CURVE_KEYS_H
#define BST_LINK_CURVE_KEYS_H

#include <stdbool.h>

#include "boresight/status.h"

enum { BST_CURVE_TEXT = 41 }; /* 32 bytes in Z85, and a zero */

/* Both pairs: the simulation and its peers use the same file. */
typedef struct bst_curve_keys {
    char simulation_public[BST_CURVE_TEXT], simulation_secret[BST_CURVE_TEXT];
    char peer_public[BST_CURVE_TEXT], peer_secret[BST_CURVE_TEXT];
} bst_curve_keys;

/* Makes a file with new keys, of mode 0600. BST_ERR_IO: something is there already, or it cannot be
 * made; BST_ERR_STATE: this ZeroMQ knows no CURVE. */
bst_status bst_curve_keys_make(bst_ctx *ctx, const char *path) BST_MUST_CHECK;

/* Reads such a file. BST_ERR_ARGUMENT: others than this user may read it (allowed: mode 0600 and
 * less); BST_ERR_FORMAT with file and line: it is no file of keys; and the errors of
 * bst_file_open. */
bst_status bst_curve_keys_read(bst_ctx *ctx, const char *path, bst_curve_keys *out) BST_MUST_CHECK;

/* Sets the keys of a ZeroMQ socket, before it is bound or connected. The simulation's takes the
 * peer whose key is in the file alone, when bst_curve_answer answers. BST_ERR_STATE. */
bst_status bst_curve_secure(bst_ctx *ctx, void *socket, const bst_curve_keys *keys,
                            bool simulation) BST_MUST_CHECK;

/* Makes the socket at which ZeroMQ asks whether a peer may connect (RFC 27, ZAP), in its context;
 * NULL with errno. */
void *bst_curve_asker(void *context);
/* Answers one question there, if there is one: yes for the peer's key, no for any other. Returned:
 * whether a peer was refused. */
bool bst_curve_answer(void *asker, const bst_curve_keys *keys);

#endif
