#include "view/editor_speed.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "sim/core/json_member.h"
#include "sim/core/json_number.h"
#include "view/child_command.h"
#include "view/editor_internal.h"
#include "view/folder_copy.h"

enum { PATH_BYTES = 600 };

/* Makes a folder in $TMPDIR, or else /tmp. */
static bst_status make_folder(bst_ctx *ctx, char path[PATH_BYTES]) {
    const char *base = getenv("TMPDIR");
    int n =
        snprintf(path, PATH_BYTES - 20, "%s/boresight-speed-XXXXXX", base && *base ? base : "/tmp");
    if (n < 0 || n >= PATH_BYTES - 20 || !mkdtemp(path)) {
        return bst_fail(ctx, BST_ERR_IO, "%s: no temporary folder: %s", path, strerror(errno));
    }
    return BST_OK;
}

/* Adds the speed that the manifest of a trial run has. False: there is none. */
static bool add_speed(const char *folder, cJSON *out) {
    char path[PATH_BYTES + 20];
    bst_ctx ignored = {0};
    bst_json *json;
    snprintf(path, sizeof path, "%s/manifest.json", folder);
    if (bst_json_load(&ignored, path, &json) != BST_OK) {
        return false;
    }
    const cJSON *manifest = bst_json_root(json), *summary = bst_json_member(manifest, "summary");
    const cJSON *factor = bst_json_member(summary, "real_time_factor");
    if (cJSON_IsNumber(factor)) {
        bst_json_add_number(out, "real_time_factor", factor->valuedouble);
        bst_json_add_number(out, "wall_time_s", bst_json_member_number(manifest, "wall_time_s"));
    }
    bst_json_free(json);
    return cJSON_IsNumber(factor);
}

/* The last line of what a command wrote. */
static const char *last_line(char *messages) {
    size_t bytes = strlen(messages);
    while (bytes > 0 && messages[bytes - 1] == '\n') {
        messages[--bytes] = '\0';
    }
    const char *line = strrchr(messages, '\n');
    return line ? line + 1 : messages;
}

static bst_status run_trial(bst_ctx *ctx, const char *text, double duration_s, const char *folder,
                            cJSON *out) {
    char duration[40], partial[PATH_BYTES + 20];
    const char *const words[] = {"run",        "-",      "--out", folder,
                                 "--duration", duration, "--set", "/record/frames=\"none\"",
                                 "--quiet",    NULL};
    bst_view_child_result child;
    snprintf(duration, sizeof duration, "%.9g", duration_s);
    BST_TRY(
        bst_view_child_run(ctx, words, ".", text, strlen(text), BST_VIEW_SPEED_LIMIT_S, &child));
    bst_json_add_number(out, "duration_s", duration_s);
    if (child.timed_out) {
        char problem[120];
        snprintf(problem, sizeof problem,
                 "%.9g s of the scenario take more than %d s of processor time", duration_s,
                 BST_VIEW_SPEED_LIMIT_S);
        cJSON_AddStringToObject(out, "problem", problem);
    } else if (child.exit_code != 0 || !add_speed(folder, out)) {
        cJSON_AddStringToObject(out, "problem", last_line(child.messages));
    }
    bst_view_child_free(&child);
    bst_view_remove_copy(folder);
    snprintf(partial, sizeof partial, "%s.partial", folder);
    bst_view_remove_copy(partial);
    return BST_OK;
}

bst_status bst_view_editor_speed(bst_ctx *ctx, const char *body, cJSON **out) {
    bst_json *request;
    const char *text;
    char parent[PATH_BYTES], folder[PATH_BYTES + 5];
    *out = NULL;
    BST_TRY(bst_view_editor_body(ctx, body, "text", &request, &text));
    const cJSON *given = bst_json_member(bst_json_root(request), "duration_s");
    double duration_s = cJSON_IsNumber(given) ? given->valuedouble : NAN;
    bst_status status = BST_OK;
    if (!(duration_s > 0.0 && duration_s <= BST_VIEW_SPEED_SPAN_S)) {
        status = bst_fail(ctx, BST_ERR_ARGUMENT, "duration_s: %g (allowed: above 0, up to %g)",
                          duration_s, BST_VIEW_SPEED_SPAN_S);
    }
    status = status == BST_OK ? make_folder(ctx, parent) : status;
    if (status == BST_OK) {
        *out = cJSON_CreateObject();
        snprintf(folder, sizeof folder, "%s/run", parent);
        status = run_trial(ctx, text, duration_s, folder, *out);
        rmdir(parent);
    }
    bst_json_free(request);
    if (status != BST_OK) {
        cJSON_Delete(*out);
        *out = NULL;
    }
    return status;
}
