/* The viewer's server: HTTP on the loopback interface, for those who know the token. */
#ifndef BST_VIEW_SERVER_H
#define BST_VIEW_SERVER_H

#include "view/live_run.h"
#include "view/subject.h"

typedef struct bst_view_server bst_view_server;

/* Room for the address of a server with the zero byte. */
enum { BST_VIEW_URL_BYTES = 96 };

/* Starts a server; its threads answer requests until it is stopped.
 *
 * Given:     subject  outlives the server
 *            live     the run that is steered; outlives the server; NULL: none
 *            port     TCP port on 127.0.0.1; 0: any free one
 * Returned:  url   address of the page, with the token
 * Errors:    BST_ERR_IO: the port is in use or not allowed, or no random numbers; BST_ERR_MEMORY
 * Ownership: end it with bst_view_server_stop */
bst_status bst_view_server_start(bst_ctx *ctx, bst_view_subject *subject, bst_view_live *live,
                                 int port, char url[BST_VIEW_URL_BYTES],
                                 bst_view_server **out) BST_MUST_CHECK;

/* Stops a server: requests in progress are completed or cut. NULL is allowed. */
void bst_view_server_stop(bst_view_server *server);

#endif
