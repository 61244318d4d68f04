#include "view/panel_routes.h"

#include "view/editor.h"
#include "view/space.h"

static bst_status schema_route(bst_ctx *ctx, bst_view_exchange *x) {
    return bst_view_editor_schema(ctx, &x->json);
}

static bst_status list_route(bst_ctx *ctx, bst_view_exchange *x) {
    return bst_view_editor_list(ctx, &x->json);
}

static bst_status open_route(bst_ctx *ctx, bst_view_exchange *x) {
    return bst_view_editor_open(ctx, x->body, &x->json);
}

static bst_status check_route(bst_ctx *ctx, bst_view_exchange *x) {
    return bst_view_editor_check(ctx, x->body, &x->json);
}

static bst_status loops_route(bst_ctx *ctx, bst_view_exchange *x) {
    return bst_view_editor_loops(ctx, x->body, &x->json);
}

static bst_status satellites_route(bst_ctx *ctx, bst_view_exchange *x) {
    return bst_view_editor_satellites(ctx, x->body, &x->json);
}

static bst_status save_route(bst_ctx *ctx, bst_view_exchange *x) {
    return bst_view_editor_save(ctx, x->body, &x->json);
}

const bst_view_route bst_view_panel_routes[] = {
    {"api/editor/schema", false, schema_route},
    {"api/editor/list", false, list_route},
    {"api/editor/open", true, open_route},
    {"api/editor/check", true, check_route},
    {"api/editor/loops", true, loops_route},
    {"api/editor/satellites", true, satellites_route},
    {"api/editor/save", true, save_route},
    {"api/space/scene", false, bst_view_route_space_scene},
    {"api/space/states", false, bst_view_route_space_states},
    {"api/space/poses", false, bst_view_route_space_poses},
    {"api/space/coast", false, bst_view_route_space_coast},
    {NULL, false, NULL}};
