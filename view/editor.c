#define _XOPEN_SOURCE 700 /* realpath */
#include "view/editor.h"

#include <errno.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "boresight/config.h"
#include "sim/cli/outputs.h"
#include "sim/cli/plugins.h"
#include "sim/core/draft.h"
#include "sim/core/file.h"
#include "sim/core/json_member.h"
#include "view/child_command.h"
#include "view/editor_internal.h"
#include "view/scenario_list.h"

/* Processor time of a check, s: of the shipped scenarios the longest takes 1 s. */
enum { CHECK_LIMIT_S = 10 };
/* Longest scenario file, bytes. */
enum { FILE_BYTES = 4 << 20 };

bst_status bst_view_editor_body(bst_ctx *ctx, const char *body, const char *key, bst_json **json,
                                const char **value) {
    if (bst_json_parse(ctx, "request", body, strlen(body), json) != BST_OK) {
        return bst_fail_prefix(ctx, BST_ERR_ARGUMENT, "editor");
    }
    *value = bst_json_member_text(bst_json_root(*json), key, NULL);
    if (*value) {
        return BST_OK;
    }
    bst_json_free(*json);
    *json = NULL;
    return bst_fail(ctx, BST_ERR_ARGUMENT, "the request has no text \"%s\"", key);
}

bst_status bst_view_editor_schema(bst_ctx *ctx, cJSON **out) {
    *out = bst_scenario_schema(bst_registry_shipped());
    return *out ? BST_OK : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the schema");
}

/* ------------------------------------------------------------------ open */

/* Shortens an absolute path that lies in the working folder. */
static const char *shorten(const char *path) {
    char folder[PATH_MAX];
    size_t length = getcwd(folder, sizeof folder) ? strlen(folder) : 0;
    return length > 1 && strncmp(path, folder, length) == 0 && path[length] == '/'
               ? path + length + 1
               : path;
}

/* Replaces relative paths by those that the program resolved them to. `resolved`: the same values,
 * where the program knows them. */
static void resolve_paths(cJSON *values, const cJSON *resolved) {
    int index = 0;
    for (cJSON *item = values->child; item; item = item->next, index++) {
        const cJSON *other = cJSON_IsArray(resolved) ? cJSON_GetArrayItem(resolved, index)
                                                     : bst_json_member(resolved, item->string);
        if (!other) {
            continue;
        }
        if (cJSON_IsString(item) && cJSON_IsString(other) && item->valuestring[0] &&
            item->valuestring[0] != '/' && other->valuestring[0] == '/') {
            cJSON_SetValuestring(item, shorten(other->valuestring));
        }
        resolve_paths(item, other);
    }
}

/* Values of a document, with paths that hold in the working folder. */
static cJSON *values_of(const bst_json *json) {
    cJSON *values = cJSON_Duplicate(bst_json_root(json), 1);
    bst_ctx ignored = {0};
    bst_scenario scenario;
    if (values && bst_plugins_recorded_read(&ignored, json, &scenario) == BST_OK) {
        cJSON *resolved = bst_scenario_echo(&scenario);
        if (resolved) {
            resolve_paths(values, resolved);
        }
        cJSON_Delete(resolved);
        bst_scenario_free(&scenario);
    }
    return values;
}

static bst_status open_file(bst_ctx *ctx, const char *path, cJSON **out) {
    char full[PATH_MAX], *text = NULL;
    size_t bytes;
    bst_json *json = NULL;
    if (!realpath(path, full)) {
        return bst_fail(ctx, BST_ERR_NOT_FOUND, "%.300s: %s", path, strerror(errno));
    }
    BST_TRY(bst_file_read(ctx, full, FILE_BYTES, "a scenario", &text, &bytes));
    bst_status status = bst_json_load_described(ctx, path, bst_registry_tables(), &json);
    if (status == BST_OK && !cJSON_IsObject(bst_json_root(json))) {
        status = bst_fail(ctx, BST_ERR_FORMAT, "%.300s: is no scenario", path);
    }
    if (status == BST_OK) {
        *out = cJSON_CreateObject();
        cJSON_AddStringToObject(*out, "file", shorten(full));
        cJSON_AddStringToObject(*out, "text", text);
        cJSON_AddItemToObject(*out, "document", values_of(json));
    }
    bst_json_free(json);
    free(text);
    return status;
}

bst_status bst_view_editor_open(bst_ctx *ctx, const char *body, cJSON **out) {
    bst_json *request;
    const char *path;
    BST_TRY(bst_view_editor_body(ctx, body, "file", &request, &path));
    bst_status status = open_file(ctx, path, out);
    bst_json_free(request);
    return status;
}

/* ------------------------------------------------------------------ check */

/* Reads ":LINE:COLUMN: " or ": /POINTER: " behind the name of a file. */
static void add_place(const char *line, const char *end, cJSON *problem) {
    const char *colon = memchr(line, ':', (size_t)(end - line));
    int row = 0, column = 0, used = 0;
    if (colon && sscanf(colon, ":%9d:%9d: %n", &row, &column, &used) == 2 && used > 0) {
        cJSON_AddNumberToObject(problem, "line", row);
        cJSON_AddNumberToObject(problem, "column", column);
        cJSON_AddStringToObject(problem, "text", colon + used);
        return;
    }
    const char *slash = colon && colon[1] == ' ' && colon[2] == '/' ? colon + 2 : NULL;
    const char *stop = slash ? strstr(slash, ": ") : NULL;
    if (stop && stop < end) {
        char pointer[512];
        snprintf(pointer, sizeof pointer, "%.*s", (int)(stop - slash), slash);
        cJSON_AddStringToObject(problem, "pointer", pointer);
        cJSON_AddStringToObject(problem, "text", stop + 2);
        return;
    }
    cJSON_AddStringToObject(problem, "text", line);
}

/* Adds the messages of a command: a line each, "boresight: [warning: ]FILE: ...". */
static void add_problems(char *messages, cJSON *list) {
    static const char program[] = "boresight: ", warning[] = "warning: ";
    char *rest;
    for (char *line = strtok_r(messages, "\n", &rest); line; line = strtok_r(NULL, "\n", &rest)) {
        line += strncmp(line, program, sizeof program - 1) == 0 ? sizeof program - 1 : 0;
        bool warns = strncmp(line, warning, sizeof warning - 1) == 0;
        line += warns ? sizeof warning - 1 : 0;
        cJSON *problem = cJSON_CreateObject();
        cJSON_AddItemToArray(list, problem);
        cJSON_AddStringToObject(problem, "kind", warns ? "warning" : "error");
        add_place(line, line + strlen(line), problem);
    }
}

/* Runs a command on the text of a body. */
static bst_status run_on_text(bst_ctx *ctx, const char *const *words, const char *body,
                              bst_view_child_result *child) {
    bst_json *request;
    const char *text;
    BST_TRY(bst_view_editor_body(ctx, body, "text", &request, &text));
    bst_status status =
        bst_view_child_run(ctx, words, ".", text, strlen(text), CHECK_LIMIT_S, child);
    bst_json_free(request);
    return status;
}

bst_status bst_view_editor_check(bst_ctx *ctx, const char *body, cJSON **out) {
    static const char *const words[] = {"check", "-", "--figures", "-", NULL};
    bst_view_child_result child;
    BST_TRY(run_on_text(ctx, words, body, &child));
    *out = cJSON_CreateObject();
    cJSON_AddBoolToObject(*out, "good", child.exit_code == 0);
    cJSON *problems = cJSON_AddArrayToObject(*out, "problems");
    add_problems(child.messages, problems);
    if (child.exit_code != 0 && cJSON_GetArraySize(problems) == 0) {
        char end[120];
        snprintf(end, sizeof end,
                 child.timed_out ? "error: the check takes more than %d s; use boresight check"
                                 : "error: the check ended with status %d",
                 child.timed_out ? CHECK_LIMIT_S : child.exit_code);
        add_problems(end, problems);
    }
    cJSON *figures = child.exit_code == 0 ? cJSON_Parse(child.output) : NULL;
    cJSON_AddItemToObject(*out, "figures", figures ? figures : cJSON_CreateNull());
    bst_view_child_free(&child);
    return BST_OK;
}

bst_status bst_view_editor_loops(bst_ctx *ctx, const char *body, cJSON **out) {
    static const char *const words[] = {"loop", "-", "--json", "-", NULL};
    bst_view_child_result child;
    BST_TRY(run_on_text(ctx, words, body, &child));
    *out = cJSON_CreateObject();
    cJSON *loops = child.exit_code == 0 ? cJSON_Parse(child.output) : NULL;
    cJSON_AddItemToObject(*out, "loops", loops ? loops : cJSON_CreateNull());
    if (!loops) {
        cJSON *problems = cJSON_CreateArray();
        add_problems(child.messages, problems);
        cJSON_AddStringToObject(*out, "problem",
                                bst_json_member_text(problems->child, "text", "no answer"));
        cJSON_Delete(problems);
    }
    bst_view_child_free(&child);
    return BST_OK;
}

/* ------------------------------------------------------------------ save */

/* Checks name and text of a file that is to be saved. */
static bst_status check_saved(bst_ctx *ctx, const char *name, const char *text, char *const *base,
                              bool overwrite) {
    const char *const target = name;
    const bst_option table[] = {{.name = "file",
                                 .kind = BST_OPTION_TEXT,
                                 .target = (void *)(uintptr_t)&target, /* only read */
                                 .path = BST_PATH_OUTPUT,
                                 .argument = "FILE"},
                                {.name = NULL}};
    const bool given[] = {true};
    bst_json *json;
    if (!bst_view_is_scenario_name(name)) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "\"%.100s\" is no name for a scenario (allowed: a name without folder that "
                        "ends with .json and does not begin with \".\" or \"-\")",
                        name);
    }
    if (bst_json_parse(ctx, name, text, strlen(text), &json) != BST_OK) {
        return bst_fail_prefix(ctx, BST_ERR_ARGUMENT, "not saved");
    }
    bool object = cJSON_IsObject(bst_json_root(json));
    bst_json_free(json);
    if (!object) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "%.100s: the text is no JSON object", name);
    }
    if (*base && strcmp(*base, name) == 0) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "%.100s: a file cannot extend itself", name);
    }
    BST_TRY(bst_outputs_check(ctx, table, given, *base ? 1 : 0, base));
    return bst_outputs_refuse_earlier(ctx, name, overwrite);
}

static bst_status write_text(bst_ctx *ctx, const char *path, const char *text) {
    char draft[PATH_MAX];
    int fd;
    BST_TRY(bst_draft_make(ctx, path, draft, sizeof draft, &fd));
    bool good = bst_file_write_all(fd, text, strlen(text)) && fsync(fd) == 0;
    good = close(fd) == 0 && good;
    if (good && rename(draft, path) == 0) {
        return BST_OK;
    }
    int why = errno;
    unlink(draft);
    return bst_fail(ctx, BST_ERR_IO, "%.300s: cannot be written: %s", path, strerror(why));
}

bst_status bst_view_editor_save(bst_ctx *ctx, const char *body, cJSON **out) {
    bst_json *request;
    const char *name;
    BST_TRY(bst_view_editor_body(ctx, body, "file", &request, &name));
    const cJSON *root = bst_json_root(request);
    const char *text = bst_json_member_text(root, "text", "");
    bool overwrite = cJSON_IsTrue(bst_json_member(root, "overwrite"));
    cJSON *values = cJSON_Parse(text);
    char *base[] = {cJSON_GetStringValue(bst_json_member(values, "extends"))};
    bst_status status = check_saved(ctx, name, text, base, overwrite);
    status = status == BST_OK ? write_text(ctx, name, text) : status;
    if (status == BST_OK) {
        *out = cJSON_CreateObject();
        cJSON_AddStringToObject(*out, "file", name);
    }
    cJSON_Delete(values);
    bst_json_free(request);
    return status;
}
