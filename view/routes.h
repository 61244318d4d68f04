/* Routes of the viewer: what a request for data gets. A new route is a line of the table in
 * routes.c. */
#ifndef BST_VIEW_ROUTES_H
#define BST_VIEW_ROUTES_H

#include "view/live_run.h"
#include "view/request_guard.h"
#include "view/subject.h"

/* What a request for data asks for and gets. */
typedef struct bst_view_exchange {
    bst_view_subject *subject;
    bst_view_live *live; /* NULL: none */
    int64_t run, sensor, frame, columns, object;
    double from_s, to_s;
    bst_view_part part; /* of a frame */
    char panel[32];
    char name[64];    /* of a run in runs/ */
    const char *body; /* of POST: text that ends with a zero byte; else NULL */
    size_t body_bytes;
    cJSON *json;          /* the answer; NULL: `bytes` */
    bst_view_bytes bytes; /* the answer */
    const char *type;     /* media type of `bytes`; NULL: plain bytes */
} bst_view_exchange;

typedef struct bst_view_route {
    const char *path; /* below "/TOKEN/" */
    bool post;        /* asked for by POST with a body, else by GET */
    bst_status (*get)(bst_ctx *ctx, bst_view_exchange *x);
} bst_view_route;

/* Finds the route of a path; NULL: none. */
const bst_view_route *bst_view_route_find(const char *path);

/* Reads the query of a request into `x`. False: a value that is not allowed. */
bool bst_view_exchange_read(const char *query, bst_view_exchange *x);

/* Calls a route.
 *
 * Returned:  x->json or x->bytes, which the caller frees, also after an error
 *            status of HTTP; after an error the message in `ctx` is for the user */
int bst_view_route_call(bst_ctx *ctx, const bst_view_route *route, bst_view_exchange *x);

#endif
