#include "view/routes.h"

#include <stdlib.h>
#include <string.h>

#include "view/panel_routes.h"
#include "view/start_routes.h"
#include "view/thumbnails.h"

/* What the page is for: {"live": true, "study": false, "runs": number of open ones, "run": as
 * api/run, "names": as api/names}, the last two if the run is open: all that a page needs at first.
 */
static bst_status get_session(bst_ctx *ctx, bst_view_exchange *x) {
    bst_view_run *run;
    cJSON *described = NULL, *names = NULL;
    x->json = cJSON_CreateObject();
    cJSON_AddBoolToObject(x->json, "live", x->live != NULL);
    cJSON_AddBoolToObject(x->json, "study", bst_view_subject_study(x->subject) != NULL);
    cJSON_AddNumberToObject(x->json, "runs", (double)bst_view_subject_count(x->subject));
    if (bst_view_subject_run(ctx, x->subject, x->run, &run) != BST_OK) {
        return BST_OK;
    }
    BST_TRY(bst_view_run_describe(ctx, run, &described));
    cJSON_AddItemToObject(x->json, "run", described);
    BST_TRY(bst_view_run_names(ctx, run, &names));
    cJSON_AddItemToObject(x->json, "names", cJSON_DetachItemFromObject(names, "names"));
    cJSON_Delete(names);
    return BST_OK;
}

/* The scenario of the live run at its present time. */
static bst_status get_scenario(bst_ctx *ctx, bst_view_exchange *x) {
    char *text = x->live ? bst_view_live_scenario(x->live) : NULL;
    x->json = text ? cJSON_Parse(text) : NULL;
    free(text);
    return x->json ? BST_OK : bst_fail(ctx, BST_ERR_NOT_FOUND, "there is no live run");
}

static bst_status get_run(bst_ctx *ctx, bst_view_exchange *x) {
    bst_view_run *run;
    BST_TRY(bst_view_subject_run(ctx, x->subject, x->run, &run));
    return bst_view_run_describe(ctx, run, &x->json);
}

static bst_status get_refreshed(bst_ctx *ctx, bst_view_exchange *x) {
    bst_view_run *run;
    BST_TRY(bst_view_subject_run(ctx, x->subject, x->run, &run));
    BST_TRY(bst_view_run_refresh(ctx, run));
    return bst_view_run_describe(ctx, run, &x->json);
}

static bst_status get_events(bst_ctx *ctx, bst_view_exchange *x) {
    bst_view_run *run;
    BST_TRY(bst_view_subject_run(ctx, x->subject, x->run, &run));
    return bst_view_run_events(ctx, run, &x->json);
}

static bst_status get_names(bst_ctx *ctx, bst_view_exchange *x) {
    bst_view_run *run;
    BST_TRY(bst_view_subject_run(ctx, x->subject, x->run, &run));
    return bst_view_run_names(ctx, run, &x->json);
}

static bst_status get_modes(bst_ctx *ctx, bst_view_exchange *x) {
    bst_view_run *run;
    BST_TRY(bst_view_subject_run(ctx, x->subject, x->run, &run));
    return bst_view_run_modes(ctx, run, x->sensor, &x->json);
}

static bst_status get_frames(bst_ctx *ctx, bst_view_exchange *x) {
    bst_view_run *run;
    BST_TRY(bst_view_subject_run(ctx, x->subject, x->run, &run));
    return bst_view_run_frames(ctx, run, x->sensor, &x->bytes);
}

static bst_status get_frame(bst_ctx *ctx, bst_view_exchange *x) {
    bst_view_run *run;
    BST_TRY(bst_view_subject_run(ctx, x->subject, x->run, &run));
    return bst_view_run_frame(ctx, run, x->sensor, x->frame, &x->json);
}

static bst_status get_pixels(bst_ctx *ctx, bst_view_exchange *x) {
    bst_view_run *run;
    BST_TRY(bst_view_subject_run(ctx, x->subject, x->run, &run));
    return bst_view_run_pixels(ctx, run, x->sensor, x->frame, &x->part, &x->bytes);
}

static bst_status get_thumbnail(bst_ctx *ctx, bst_view_exchange *x) {
    bst_view_run *run;
    BST_TRY(bst_view_subject_run(ctx, x->subject, x->run, &run));
    return bst_view_run_thumbnail(ctx, run, x->sensor, x->frame, &x->bytes);
}

static bst_status get_plot(bst_ctx *ctx, bst_view_exchange *x) {
    const bst_view_plot plot = {x->sensor, x->panel, x->from_s, x->to_s, (int)x->columns};
    bst_view_run *run;
    BST_TRY(bst_view_subject_run(ctx, x->subject, x->run, &run));
    return bst_view_run_plot(ctx, run, &plot, &x->bytes);
}

static const bst_view_route routes[] = {{"api/session", false, get_session},
                                        {"api/scenario", false, get_scenario},
                                        {"api/start", false, bst_view_get_start},
                                        {"api/picture", false, bst_view_get_picture},
                                        {"api/open", true, bst_view_post_open},
                                        {"api/launch", true, bst_view_post_launch},
                                        {"api/run", false, get_run},
                                        {"api/refresh", false, get_refreshed},
                                        {"api/events", false, get_events},
                                        {"api/modes", false, get_modes},
                                        {"api/names", false, get_names},
                                        {"api/frames", false, get_frames},
                                        {"api/frame", false, get_frame},
                                        {"api/pixels", false, get_pixels},
                                        {"api/thumbnail", false, get_thumbnail},
                                        {"api/plot", false, get_plot}};
enum { ROUTES = sizeof routes / sizeof *routes };

const bst_view_route *bst_view_route_find(const char *path) {
    for (int i = 0; i < ROUTES; i++) {
        if (strcmp(path, routes[i].path) == 0) {
            return &routes[i];
        }
    }
    for (const bst_view_route *route = bst_view_panel_routes; route->path; route++) {
        if (strcmp(path, route->path) == 0) {
            return route;
        }
    }
    return NULL;
}

bool bst_view_exchange_read(const char *query, bst_view_exchange *x) {
    const int64_t most = INT64_C(1) << 40;
    x->columns = 1000;
    x->to_s = 1.0;
    return bst_view_query_int(query, "run", 0, most, &x->run) &&
           bst_view_query_name(query, "name", x->name, sizeof x->name) &&
           bst_view_query_int(query, "sensor", 0, most, &x->sensor) &&
           bst_view_query_int(query, "frame", 0, most, &x->frame) &&
           bst_view_query_int(query, "object", 0, most, &x->object) &&
           bst_view_query_int(query, "x", 0, most, &x->part.x) &&
           bst_view_query_int(query, "y", 0, most, &x->part.y) &&
           bst_view_query_int(query, "width", 1, most, &x->part.width) &&
           bst_view_query_int(query, "height", 1, most, &x->part.height) &&
           bst_view_query_int(query, "binning", 1, BST_VIEW_BINNING_MOST, &x->part.binning) &&
           bst_view_query_int(query, "longest", 1, most, &x->part.longest) &&
           bst_view_query_int(query, "columns", 1, BST_VIEW_COLUMNS, &x->columns) &&
           bst_view_query_real(query, "from", &x->from_s) &&
           bst_view_query_real(query, "to", &x->to_s) &&
           bst_view_query_word(query, "panel", x->panel, sizeof x->panel);
}

int bst_view_route_call(bst_ctx *ctx, const bst_view_route *route, bst_view_exchange *x) {
    bst_status status = route->get(ctx, x);
    return status == BST_OK              ? BST_HTTP_OK
           : status == BST_ERR_NOT_FOUND ? BST_HTTP_NOT_FOUND
           : status == BST_ERR_ARGUMENT  ? BST_HTTP_BAD_REQUEST
                                         : BST_HTTP_FAILED;
}
