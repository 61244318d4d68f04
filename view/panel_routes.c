#include "view/panel_routes.h"

#include <stdio.h>
#include <sys/stat.h>

#include "sim/core/json_member.h"
#include "view/editor.h"
#include "view/editor_drop.h"
#include "view/editor_speed.h"
#include "view/noise_free.h"
#include "view/request_guard.h"
#include "view/scenario_list.h"
#include "view/space.h"
#include "view/space_shapes.h"
#include "view/start_routes.h"
#include "view/study_view.h"
#include "view/track_history.h"
#include "view/why.h"

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

static bst_status speed_route(bst_ctx *ctx, bst_view_exchange *x) {
    return bst_view_editor_speed(ctx, x->body, &x->json);
}

static bst_status satellites_route(bst_ctx *ctx, bst_view_exchange *x) {
    return bst_view_editor_satellites(ctx, x->body, &x->json);
}

static bst_status file_route(bst_ctx *ctx, bst_view_exchange *x) {
    return bst_view_editor_drop(ctx, x->name, x->body, x->body_bytes, &x->json);
}

static bst_status save_route(bst_ctx *ctx, bst_view_exchange *x) {
    return bst_view_editor_save(ctx, x->body, &x->json);
}

/* POST {"file": NAME.json}: starts a scenario of the working folder live; {"url": address}. */
static bst_status run_route(bst_ctx *ctx, bst_view_exchange *x) {
    char path[300]; /* with "./" a name is no option of the command */
    struct stat found;
    cJSON *root = cJSON_Parse(x->body);
    const char *file = bst_json_member_text(root, "file", "");
    snprintf(path, sizeof path, "./%s", file);
    bst_status status = BST_OK;
    if (!bst_view_is_scenario_name(file) || stat(path, &found) != 0 || !S_ISREG(found.st_mode)) {
        status = bst_fail(ctx, BST_ERR_ARGUMENT,
                          "\"%.100s\" is no scenario of this folder (allowed: the name of a file "
                          "that ends with .json)",
                          file);
    }
    cJSON_Delete(root);
    BST_TRY(status);
    return bst_view_launch_answer(ctx, x, path);
}

const bst_view_route bst_view_panel_routes[] = {
    {"api/editor/schema", false, schema_route},
    {"api/editor/list", false, list_route},
    {"api/editor/open", true, open_route},
    {"api/editor/check", true, check_route},
    {"api/editor/loops", true, loops_route},
    {"api/editor/speed", true, speed_route},
    {"api/editor/satellites", true, satellites_route},
    {BST_VIEW_FILE_ROUTE, true, file_route},
    {"api/editor/save", true, save_route},
    {"api/editor/run", true, run_route},
    {"api/space/scene", false, bst_view_route_space_scene},
    {"api/space/states", false, bst_view_route_space_states},
    {"api/space/poses", false, bst_view_route_space_poses},
    {"api/space/shape", false, bst_view_route_space_shape},
    {"api/space/pose", false, bst_view_route_space_pose},
    {"api/space/coast", false, bst_view_route_space_coast},
    {"api/study", false, bst_view_route_study},
    {"api/study/open", true, bst_view_route_study_open},
    {"api/runs", false, bst_view_route_runs},
    {"api/why", false, bst_view_route_why},
    {"api/reason", false, bst_view_route_reason},
    {"api/track", false, bst_view_route_track},
    {"api/noise_free", false, bst_view_route_noise_free},
    {NULL, false, NULL}};
