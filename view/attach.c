#include "view/attach.h"

#include <stdio.h>
#include <stdlib.h>

#include "view/browser.h"
#include "view/server.h"

struct bst_view_attached {
    bst_view_subject *subject;
    bst_view_live *live;
    bst_view_server *server;
};

bst_status bst_view_attach(bst_ctx *ctx, const bst_scenario *scenario, const char *out,
                           bst_view_attached **attached) {
    bst_view_attached *a = calloc(1, sizeof *a);
    char url[BST_VIEW_URL_BYTES];
    *attached = NULL;
    if (!a) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the viewer");
    }
    bst_status status = bst_view_subject_create(ctx, &a->subject);
    if (status == BST_OK) {
        status = bst_view_live_watch(ctx, scenario, a->subject, out, &a->live);
    }
    if (status == BST_OK) {
        status = bst_view_server_start(ctx, a->subject, a->live, 0, url, &a->server);
    }
    if (status != BST_OK) {
        bst_view_detach(a);
        return status;
    }
    printf("%s\n", url);
    fflush(stdout);
    bst_view_open_browser(url);
    *attached = a;
    return BST_OK;
}

const bst_run_steering *bst_view_attached_steering(const bst_view_attached *attached) {
    return attached ? bst_view_live_steering(attached->live) : NULL;
}

void bst_view_detach(bst_view_attached *attached) {
    if (attached) {
        bst_view_server_stop(attached->server);
        bst_view_live_free(attached->live);
        bst_view_subject_free(attached->subject);
        free(attached);
    }
}
