/* Bodies of requests, from peers that may be slow. Each holds a thread of the server while it is
 * read: their number is bounded and so is their time, so that slow uploads leave the rest of the
 * server free. */
#ifndef BST_VIEW_REQUEST_BODY_H
#define BST_VIEW_REQUEST_BODY_H

#include <pthread.h>
#include <stdint.h>

#include <civetweb.h>

/* Bodies that are being read: small ones and large ones have places of their own. */
typedef struct bst_view_bodies {
    pthread_mutex_t lock;
    int reading[2];
} bst_view_bodies;

/* Reads the body of a request.
 *
 * Given:     bytes    of the body; the caller has checked it
 * Returned:  *body    [bytes], and a zero byte; malloc; NULL after an error
 *            status of HTTP: BST_HTTP_OK; BST_HTTP_BUSY: too many are being read;
 *            BST_HTTP_TIMEOUT: slower than 32 KiB/s after the first 5 s, or it stopped;
 *            BST_HTTP_BAD_REQUEST: negative length; BST_HTTP_FAILED: out of memory
 * Notes:     after an error the connection has to be closed: the rest of the body is not read */
int bst_view_read_body(bst_view_bodies *bodies, struct mg_connection *peer, int64_t bytes,
                       char **body);

#endif
