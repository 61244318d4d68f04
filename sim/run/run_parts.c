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
    bool *by_hand;       /* [changes]: it was added; NULL: none was */
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

/* Reads parts->json, which may be NULL. Frees the parts after an error, also an earlier one. */
static bst_status read_parts(bst_ctx *ctx, bst_status status, const char *name,
                             bst_run_parts *parts) {
    if (status == BST_OK && *parts->scenario.link.address) {
        status = bst_fail(ctx, BST_ERR_ARGUMENT,
                          "%s: modules of other programs (/link) cannot be saved, which a run with "
                          "changes needs",
                          name);
    }
    status = status == BST_OK ? check_changes(ctx, parts->json, &parts->scenario, 0) : status;
    if (status != BST_OK) {
        bst_run_parts_free(parts);
    }
    return status;
}

static bst_status make_parts(bst_ctx *ctx, const bst_simulation_options *options,
                             bst_run_check check, bst_run_parts **out) {
    bst_run_parts *parts = calloc(1, sizeof *parts);
    if (!parts) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a run");
    }
    parts->options = *options;
    parts->check = check;
    parts->options.changes_made = true;
    *out = parts;
    return BST_OK;
}

bst_status bst_run_parts_open(bst_ctx *ctx, const char *path, const bst_load_options *load,
                              const bst_simulation_options *options, bst_run_check check,
                              bst_run_parts **out) {
    bst_run_parts *parts = NULL;
    *out = NULL;
    BST_TRY(make_parts(ctx, options, check, &parts));
    bst_status status = bst_load_scenario(ctx, path, load, &parts->json, &parts->scenario);
    BST_TRY(read_parts(ctx, status, path, parts));
    *out = parts;
    return BST_OK;
}

/* Prepares the parts of a scenario that is read already. */
static bst_status open_read(bst_ctx *ctx, const bst_json *json,
                            const bst_simulation_options *options, bst_run_check check,
                            bst_run_parts **out) {
    bst_run_parts *parts = NULL;
    BST_TRY(make_parts(ctx, options, check, &parts));
    bst_status status = bst_json_copy(ctx, json, &parts->json);
    if (status == BST_OK) {
        status = bst_plugins_scenario_read(ctx, parts->json, &parts->scenario);
    }
    BST_TRY(read_parts(ctx, status, parts->scenario.file, parts));
    *out = parts;
    return BST_OK;
}

void bst_run_parts_free(bst_run_parts *parts) {
    if (parts) {
        if (parts->json) {
            bst_scenario_free(&parts->scenario);
        }
        bst_json_free(parts->json);
        free(parts->by_hand);
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

bst_status bst_run_parts_changed(bst_ctx *ctx, const bst_run_parts *parts, int64_t tick,
                                 bst_json **document, bst_scenario *scenario) {
    return read_changed(ctx, parts->json, changes_of(parts), changes_until(parts, tick), document,
                        scenario);
}

/* Gives the scenario another list of changes, if it can be read with those from number `first` on.
 * The function owns `list`. */
static bst_status replace_changes(bst_ctx *ctx, bst_run_parts *parts, cJSON *list, int first) {
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
        status = status == BST_OK ? check_changes(ctx, json, &scenario, first) : status;
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

static bool is_by_hand(const bst_run_parts *parts, int change) {
    return parts->by_hand && parts->by_hand[change];
}

int bst_run_parts_by_hand(const bst_run_parts *parts, int from) {
    int count = 0;
    for (int i = from; i < change_count(parts); i++) {
        count += is_by_hand(parts, i);
    }
    return count;
}

static cJSON *describe_change(double time_s, const char *set) {
    cJSON *node = cJSON_CreateObject();
    cJSON_AddNumberToObject(node, "time_s", time_s);
    cJSON_AddStringToObject(node, "set", set);
    return node;
}

/* List of the changes, but those by hand from number `keep` on. */
static cJSON *list_changes(const bst_run_parts *parts, int keep) {
    cJSON *list = cJSON_CreateArray();
    for (int i = 0; i < change_count(parts); i++) {
        if (i < keep || !is_by_hand(parts, i)) {
            const bst_scenario_change *change = &changes_of(parts)[i];
            cJSON_AddItemToArray(list, describe_change(change->time_s, change->set));
        }
    }
    return list;
}

bst_status bst_run_parts_change(bst_ctx *ctx, bst_run_parts *parts, int64_t tick, const char *set) {
    const int count = change_count(parts), at = changes_until(parts, tick);
    bool *by_hand = calloc((size_t)count + 1, sizeof *by_hand);
    if (!by_hand) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a change");
    }
    for (int i = 0; i < count; i++) {
        by_hand[i < at ? i : i + 1] = is_by_hand(parts, i);
    }
    by_hand[at] = true;
    cJSON *list = list_changes(parts, count);
    cJSON *node = describe_change((double)tick / (double)parts->scenario.tick_rate_hz, set);
    if (at < count) {
        cJSON_InsertItemInArray(list, at, node);
    } else {
        cJSON_AddItemToArray(list, node);
    }
    bst_status status = replace_changes(ctx, parts, list, at);
    if (status == BST_OK) {
        bool *before = parts->by_hand;
        parts->by_hand = by_hand;
        by_hand = before;
    }
    free(by_hand);
    return status;
}

bst_status bst_run_parts_cut(bst_ctx *ctx, bst_run_parts *parts, int keep) {
    const int count = change_count(parts);
    int kept = 0;
    if (bst_run_parts_by_hand(parts, keep) == 0) {
        return BST_OK;
    }
    BST_TRY(replace_changes(ctx, parts, list_changes(parts, keep), count));
    for (int i = 0; i < count; i++) {
        if (i < keep || !parts->by_hand[i]) {
            parts->by_hand[kept++] = parts->by_hand[i];
        }
    }
    return BST_OK;
}

bool bst_run_parts_due(const bst_run_parts *parts, int made, int64_t tick, int64_t *until_tick) {
    if (made >= change_count(parts)) {
        return false;
    }
    const int64_t next = changes_of(parts)[made].tick;
    *until_tick = next < *until_tick ? next : *until_tick;
    return next <= tick;
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
    return bst_run_parts_due(own->parts, own->made, tick, until_tick) ? BST_RUN_PART
                                                                      : BST_RUN_ADVANCE;
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

bst_status bst_run_parts_read(bst_ctx *ctx, const bst_json *json,
                              const bst_simulation_options *options, bst_run_check check,
                              const bst_run_request *request) {
    bst_run_parts *parts;
    if (options->replay || request->saving->restore || request->saving->save_every_s > 0.0) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "--restore, --save-every and --replay: a scenario with /changes runs from "
                        "its start to its end");
    }
    BST_TRY(open_read(ctx, json, options, check, &parts));
    bst_status status = bst_run_parts_all(ctx, parts, request);
    bst_run_parts_free(parts);
    return status;
}
