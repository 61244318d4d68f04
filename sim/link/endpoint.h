/* Addresses of the link: loopback and local sockets only. */
#ifndef BST_LINK_ENDPOINT_H
#define BST_LINK_ENDPOINT_H

#include "boresight/status.h"

enum { BST_LINK_ENDPOINT_BYTES = 128 };

/* Checks "tcp://127.0.0.1:PORT" (also [::1] and localhost, which becomes 127.0.0.1) or "ipc://PATH"
 * and writes the address for ZeroMQ. BST_ERR_ARGUMENT, with a hint to use a tunnel, for addresses
 * that other machines can reach. */
bst_status bst_link_endpoint_check(bst_ctx *ctx, const char *endpoint,
                                   char out[BST_LINK_ENDPOINT_BYTES]) BST_MUST_CHECK;

#endif
