#include "view/start_routes.h"

#include "sim/core/json_member.h"
#include "view/launch.h"
#include "view/start_page.h"

bst_status bst_view_get_start(bst_ctx *ctx, bst_view_exchange *x) {
    return bst_view_start_list(ctx, &x->json);
}

bst_status bst_view_get_picture(bst_ctx *ctx, bst_view_exchange *x) {
    x->type = "image/png";
    return bst_view_start_picture(ctx, x->name, &x->bytes);
}

/* Text member of a body; "": none. Free *root after its use. */
static const char *member_of(const bst_view_exchange *x, const char *key, cJSON **root) {
    *root = cJSON_Parse(x->body);
    const char *text = cJSON_GetStringValue(bst_json_member(*root, key));
    return text ? text : "";
}

bst_status bst_view_post_open(bst_ctx *ctx, bst_view_exchange *x) {
    char path[512];
    cJSON *root;
    int64_t number;
    bst_status status = bst_view_start_run(ctx, member_of(x, "run", &root), path, sizeof path);
    cJSON_Delete(root);
    BST_TRY(status);
    BST_TRY(bst_view_subject_open(ctx, x->subject, path, &number));
    x->json = cJSON_CreateObject();
    cJSON_AddNumberToObject(x->json, "run", (double)number);
    return BST_OK;
}

bst_status bst_view_launch_answer(bst_ctx *ctx, bst_view_exchange *x, const char *path) {
    char url[BST_VIEW_LAUNCH_URL_BYTES];
    BST_TRY(bst_view_launch(ctx, bst_view_subject_launcher(x->subject), path, url));
    x->json = cJSON_CreateObject();
    cJSON_AddStringToObject(x->json, "url", url);
    return BST_OK;
}

bst_status bst_view_post_launch(bst_ctx *ctx, bst_view_exchange *x) {
    char path[4400];
    cJSON *root;
    bst_status status =
        bst_view_start_scenario(ctx, member_of(x, "scenario", &root), path, sizeof path);
    cJSON_Delete(root);
    BST_TRY(status);
    return bst_view_launch_answer(ctx, x, path);
}
