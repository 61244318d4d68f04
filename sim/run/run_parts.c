#include "sim/run/run_parts.h"

#include <stdlib.h>
#include <string.h>

#include <cjson/cJSON.h>

#include "sim/cli/plugins.h"
#include "sim/link/link.h"

struct bst_run_parts {
    bst_json *json;        /* the scenario at time 0, with the list of changes */
    bst_scenario scenario; /* of json */
    bst_simulation_options options;
    bst_run_check check; /* NULL: done, or none */
};

static int change_count(const bst_run_parts *parts) {
    return parts->scenario.changes.count;
}

static const bst_scenario_change *changes_of(const bst_run_parts *parts) {
    return parts->scenario.changes.items;
}

/* The scenario's document after the first `count` changes. */
static bst_status changed_document(bst_ctx *ctx, const bst_json *json,
                                   const bst_scenario_change *changes, int count, bst_json **out) {
    BST_TRY(bst_json_copy(ctx, json, out));
    for (int i = 0; i < count; i++) {
        bst_status status = bst_json_set(ctx, *out, changes[i].set);
        if (status != BST_OK) {
            bst_json_free(*out);
            *out = NULL;
            return bst_fail_prefix(ctx, BST_ERR_CONFIG, "/changes/%d", i);
        }
    }
    return BST_OK;
}

/* Reads the scenario after the first `count` changes; free both results. */
static bst_status read_changed(bst_ctx *ctx, const bst_json *json,
                               const bst_scenario_change *changes, int count, bst_json **document,
                               bst_scenario *scenario) {
    BST_TRY(changed_document(ctx, json, changes, count, document));
    bst_status status = bst_plugins_scenario_read(ctx, *document, scenario);
    if (status != BST_OK) {
        bst_scenario_free(scenario);
        bst_json_free(*document);
        *document = NULL;
        return count > 0 ? bst_fail_prefix(ctx, status, "after /changes/%d", count - 1) : status;
    }
    return BST_OK;
}

/* Checks that the scenario can be read after each change from number `first` on. */
static bst_status check_changes(bst_ctx *ctx, const bst_json *json, const bst_scenario *s,
                                int first) {
    for (int i = first; i < s->changes.count; i++) {
        bst_json *document;
        bst_scenario changed;
        BST_TRY(read_changed(ctx, json, s->changes.items, i + 1, &document, &changed));
        bst_scenario_free(&changed);
        bst_json_free(document);
    }
    return BST_OK;
}

bst_status bst_run_parts_open(bst_ctx *ctx, const char *path, const bst_load_options *load,
                              const bst_simulation_options *options, bst_run_check check,
                              bst_run_parts **out) {
    bst_run_parts *parts = calloc(1, sizeof *parts);
    *out = NULL;
    if (!parts) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a run");
    }
    parts->options = *options;
    parts->check = check;
    parts->options.changes_made = true;
    bst_status status = bst_load_scenario(ctx, path, load, &parts->json, &parts->scenario);
    if (status == BST_OK && *parts->scenario.link.address) {
        status = bst_fail(ctx, BST_ERR_ARGUMENT,
                          "%s: modules of other programs (/link) cannot be saved, which a run with "
                          "changes needs",
                          path);
    }
    status = status == BST_OK ? check_changes(ctx, parts->json, &parts->scenario, 0) : status;
    if (status != BST_OK) {
        bst_run_parts_free(parts);
        return status;
    }
    *out = parts;
    return BST_OK;
}

void bst_run_parts_free(bst_run_parts *parts) {
    if (parts) {
        if (parts->json) {
            bst_scenario_free(&parts->scenario);
        }
        bst_json_free(parts->json);
        free(parts);
    }
}

const bst_scenario *bst_run_parts_scenario(const bst_run_parts *parts) {
    return &parts->scenario;
}

/* Number of changes up to a tick. */
static int changes_until(const bst_run_parts *parts, int64_t tick) {
    int count = 0;
    while (count < change_count(parts) && changes_of(parts)[count].tick <= tick) {
        count++;
    }
    return count;
}

cJSON *bst_run_parts_document(const bst_run_parts *parts, int64_t tick) {
    bst_ctx ignored = {0};
    bst_json *document;
    if (changed_document(&ignored, parts->json, changes_of(parts), changes_until(parts, tick),
                         &document) != BST_OK) {
        return NULL;
    }
    cJSON *copy = cJSON_Duplicate(bst_json_root(document), true);
    bst_json_free(document);
    return copy;
}

/* Gives the scenario another list of changes, if it can be read with it. The function owns `list`.
 */
static bst_status replace_changes(bst_ctx *ctx, bst_run_parts *parts, cJSON *list) {
    bst_json *json;
    bst_scenario scenario;
    bst_status status = bst_json_copy(ctx, parts->json, &json);
    if (status != BST_OK) {
        cJSON_Delete(list);
        return status;
    }
    status = bst_json_assign(ctx, json, "/changes", list);
    if (status == BST_OK) {
        status = bst_plugins_scenario_read(ctx, json, &scenario);
        status =
            status == BST_OK ? check_changes(ctx, json, &scenario, change_count(parts)) : status;
        if (status != BST_OK) {
            bst_scenario_free(&scenario);
        }
    }
    if (status != BST_OK) {
        bst_json_free(json);
        return status;
    }
    bst_scenario_free(&parts->scenario);
    bst_json_free(parts->json);
    parts->json = json;
    parts->scenario = scenario;
    return BST_OK;
}

/* List of the first `count` changes. */
static cJSON *list_changes(const bst_run_parts *parts, int count) {
    cJSON *list = cJSON_CreateArray();
    for (int i = 0; i < count; i++) {
        cJSON *node = cJSON_CreateObject();
        cJSON_AddNumberToObject(node, "time_s", changes_of(parts)[i].time_s);
        cJSON_AddStringToObject(node, "set", changes_of(parts)[i].set);
        cJSON_AddItemToArray(list, node);
    }
    return list;
}

bst_status bst_run_parts_change(bst_ctx *ctx, bst_run_parts *parts, int64_t tick, const char *set) {
    cJSON *list = list_changes(parts, change_count(parts)), *node = cJSON_CreateObject();
    cJSON_AddNumberToObject(node, "time_s", (double)tick / (double)parts->scenario.tick_rate_hz);
    cJSON_AddStringToObject(node, "set", set);
    cJSON_AddItemToArray(list, node);
    return replace_changes(ctx, parts, list);
}

bst_status bst_run_parts_cut(bst_ctx *ctx, bst_run_parts *parts, int keep) {
    return keep < change_count(parts) ? replace_changes(ctx, parts, list_changes(parts, keep))
                                      : BST_OK;
}

/* Steps a part whose scenario is read. */
static bst_status run_read(bst_ctx *ctx, bst_run_parts *parts, const bst_scenario *scenario,
                           bst_run_part *part, bst_run_request *request) {
    bst_simulation_options options = parts->options;
    bst_simulation *sim = NULL;
    if (part->state) {
        BST_TRY(bst_run_restored_take(ctx, part->state, part->size, &options, &request->restored));
    }
    const bst_log_level level = ctx->log_level;
    ctx->log_level = part->state ? BST_LOG_ERROR : level; /* the first part has said it */
    bst_status status = bst_simulation_create(ctx, scenario, &options, &sim);
    ctx->log_level = level;
    if (status == BST_OK && parts->check) {
        status = parts->check(ctx, scenario, sim);
        parts->check = NULL;
    }
    if (status == BST_OK) {
        request->part_ended = &part->ended;
        status = bst_run_scenario(ctx, scenario, sim, request, NULL);
    }
    bst_simulation_free(sim);
    bst_run_restored_free(request->restored);
    return status;
}

bst_status bst_run_parts_run(bst_ctx *ctx, bst_run_parts *parts, bst_run_part *part,
                             const bst_run_request *given) {
    bst_run_request request = *given;
    bst_json *document;
    bst_scenario scenario;
    const int made = changes_until(parts, part->tick);
    part->ended = false;
    BST_TRY(read_changed(ctx, parts->json, changes_of(parts), made, &document, &scenario));
    cJSON *echo = bst_scenario_echo(&parts->scenario);
    bst_status status =
        echo ? BST_OK : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the scenario");
    if (status == BST_OK) {
        request.echo = echo;
        request.changes = changes_of(parts) + part->made;
        request.change_count = made - part->made;
        status = run_read(ctx, parts, &scenario, part, &request);
    }
    cJSON_Delete(echo);
    bst_scenario_free(&scenario);
    bst_json_free(document);
    return status;
}

/* ---- the scenario's own changes ---- */

typedef struct own_changes {
    const bst_run_parts *parts;
    const bst_run_steering *outer; /* NULL: none */
    int made;                      /* changes of this part */
    void *state;
    size_t size;
    int64_t tick;
} own_changes;

static bst_run_action next_change(void *user, int64_t tick, int64_t *until_tick) {
    const own_changes *own = user;
    if (own->made == change_count(own->parts)) {
        return BST_RUN_ADVANCE;
    }
    const int64_t next = changes_of(own->parts)[own->made].tick;
    *until_tick = next;
    return next > tick ? BST_RUN_ADVANCE : BST_RUN_PART;
}

static void keep_state(void *user, int64_t tick, void *bytes, size_t size) {
    own_changes *own = user;
    free(own->state);
    own->state = bytes;
    own->size = size;
    own->tick = tick;
}

static bst_status pass_message(void *user, bst_ctx *ctx, int sensor, const char *channel,
                               const void *payload, int64_t tick) {
    const bst_run_steering *outer = ((own_changes *)user)->outer;
    return outer->message(outer->user, ctx, sensor, channel, payload, tick);
}

bst_status bst_run_parts_all(bst_ctx *ctx, bst_run_parts *parts, const bst_run_request *given) {
    own_changes own = {.parts = parts, .outer = given->steering};
    const bst_run_steering steering = {
        &own, next_change, keep_state,
        given->steering && given->steering->message ? pass_message : NULL, false};
    bst_run_request request = *given;
    bst_run_part part = {.state = NULL};
    bst_status status;
    request.steering = &steering;
    do {
        part.state = own.state;
        part.size = own.size;
        part.tick = own.tick;
        part.made = own.made;
        own.state = NULL;
        own.made = changes_until(parts, part.tick);
        status = bst_run_parts_run(ctx, parts, &part, &request);
        free((void *)part.state);
    } while (status == BST_ERR_INTERRUPTED && part.ended);
    free(own.state);
    return status;
}

bst_status bst_run_parts_file(bst_ctx *ctx, const char *path, const bst_load_options *load,
                              const bst_simulation_options *options, bst_run_check check,
                              const bst_run_request *request) {
    bst_run_parts *parts;
    if (options->replay || request->saving->restore || request->saving->save_every_s > 0.0) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "--restore, --save-every and --replay: a scenario with /changes runs from "
                        "its start to its end");
    }
    BST_TRY(bst_run_parts_open(ctx, path, load, options, check, &parts));
    bst_status status = bst_run_parts_all(ctx, parts, request);
    bst_run_parts_free(parts);
    return status;
}
