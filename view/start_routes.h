/* Routes of the start page. */
#ifndef BST_VIEW_START_ROUTES_H
#define BST_VIEW_START_ROUTES_H

#include "view/routes.h"

/* GET: what the start page lists (view/start_page.h). Errors as bst_view_start_list. */
bst_status bst_view_get_start(bst_ctx *ctx, bst_view_exchange *x);
/* GET: picture of the run x->name. Errors as bst_view_start_picture. */
bst_status bst_view_get_picture(bst_ctx *ctx, bst_view_exchange *x);
/* POST {"run": NAME}: opens a run of runs/; {"run": number}. Errors as bst_view_subject_open. */
bst_status bst_view_post_open(bst_ctx *ctx, bst_view_exchange *x);
/* POST {"scenario": FILE}: starts a shipped scenario live; {"url": address of its page}. Errors as
 * bst_view_launch. */
bst_status bst_view_post_launch(bst_ctx *ctx, bst_view_exchange *x);
/* Starts a scenario file live; the answer as that of bst_view_post_launch. */
bst_status bst_view_launch_answer(bst_ctx *ctx, bst_view_exchange *x, const char *path);

#endif
