/* WebSocket of a live run. A client asks, and gets one binary message for each text that it sends:
 * the length of a JSON text (32 bits), the text {state, frame, controller, sequence}, and the
 * pixels of the frame, if it is newer than the client's; with "part": {x, y, width, height} those
 * of a part of it, with "binning": N (2 to 64) the means of N x N of them (view/pixel_bins.h). The
 * text says what was sent: x, y, binning, width, height, and frame_width and frame_height of the
 * whole. So at most one message is in flight per client, and a slow one waits for itself alone. A
 * request has 8 KiB at most, and comes whole within 1.5 s; anything else ends the connection. */
#ifndef BST_VIEW_LIVE_SOCKET_H
#define BST_VIEW_LIVE_SOCKET_H

#include <civetweb.h>

#include "view/live_run.h"

typedef struct bst_view_socket bst_view_socket;

/* Accepts WebSockets at an address of a server.
 *
 * Given:     http  outlives the socket; its function begin_request has checked the request
 *            uri   path of the address
 *            live  outlives the socket
 * Errors:    BST_ERR_MEMORY
 * Ownership: free *out with bst_view_socket_free, after the server has stopped */
bst_status bst_view_socket_open(bst_ctx *ctx, struct mg_context *http, const char *uri,
                                bst_view_live *live, bst_view_socket **out) BST_MUST_CHECK;
/* Ends the waiting for all clients, so that the server can stop; NULL is allowed. */
void bst_view_socket_stop(bst_view_socket *socket);
/* Frees what belongs to a socket; NULL is allowed. */
void bst_view_socket_free(bst_view_socket *socket);

#endif
