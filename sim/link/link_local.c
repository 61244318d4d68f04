/* A link inside the process: modules of type "external" take what the program that holds the
 * simulation gives them, with the checks of the packet link. */
#include <assert.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/link/link_internal.h"

bst_status bst_link_create_local(bst_ctx *ctx, const bst_link_run *run, bst_link **out) {
    assert(run && out);
    *out = calloc(1, sizeof **out);
    if (!*out) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the link");
    }
    (*out)->local = true;
    (*out)->run = *run;
    (*out)->run.waiting = BST_LINK_AWAIT;
    snprintf((*out)->scenario, sizeof(*out)->scenario, "%s", run->scenario);
    (*out)->run.scenario = (*out)->scenario;
    return BST_OK;
}

/* Messages that a peer in a role may send. */
static bool may_give(const char *role, bst_link_type type) {
    static const struct {
        const char *role;
        bst_link_type type;
    } given[] = {
        {"imgproc", BST_LINK_DETECTIONS},      {"tracker", BST_LINK_TRACKS},
        {"tracker", BST_LINK_PREDICTIONS},     {"tracker", BST_LINK_TRACK_IDENTITIES},
        {"tracker", BST_LINK_TRACKS_SMOOTHED}, {"control", BST_LINK_LOS_COMMAND},
        {"control", BST_LINK_SENSOR_COMMAND},  {"control", BST_LINK_CONTROL_STATUS},
        {"gimbal", BST_LINK_POINTING},         {"gimbal", BST_LINK_TARGET_STATES},
        {"gimbal", BST_LINK_SENSOR_COMMAND},   {"gimbal", BST_LINK_TARGET_ATTITUDES},
    };
    for (size_t i = 0; i < sizeof given / sizeof *given; i++) {
        if (given[i].type == type && strcmp(given[i].role, role) == 0) {
            return true;
        }
    }
    return false;
}

/* True if an instance "observer/sensor/module" belongs to a scope "observer/sensor". */
static bool is_in_scope(const char *instance, const char *scope) {
    size_t length = scope ? strlen(scope) : 0;
    return !scope || (strncmp(instance, scope, length) == 0 && instance[length] == '/');
}

bst_status bst_link_put(bst_ctx *ctx, bst_link *link, const char *scope, bst_link_type type,
                        const void *payload) {
    assert(payload && type >= 0 && type < BST_LINK_TYPES);
    const bst_wire_message *about = bst_wire_message_of(type);
    for (int i = 0; link && link->local && i < link->part_count; i++) {
        link_part *part = &link->parts[i];
        if (!may_give(part->about.role, type) || !is_in_scope(part->about.instance, scope)) {
            continue;
        }
        BST_TRY(bst_wire_check_struct(ctx, about, payload, about->max_items));
        size_t bytes =
            about->header_bytes + (size_t)bst_wire_items(about, payload) * about->item_bytes;
        void *copy = realloc(part->given[type].payload, bytes);
        if (!copy) {
            return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a command");
        }
        memcpy(copy, payload, bytes);
        part->given[type].payload = copy;
        part->given[type].bytes = bytes;
        part->given[type].pending = true;
        return BST_OK;
    }
    return bst_fail(ctx, BST_ERR_NOT_FOUND,
                    "%s%sno module of type \"external\" takes \"%s\" from this program; set the "
                    "\"type\" of the module that writes it to \"external\", with no /link/address",
                    scope ? scope : "", scope ? ": " : "", about->name);
}

/* Number of items of a message that fit into an output; the others are counted. */
static int fitting(bst_link *link, const bst_wire_message *about, const void *payload,
                   bst_link_output *output) {
    int items = bst_wire_items(about, payload);
    output->dropped = items > output->capacity ? items - output->capacity : 0;
    link->counts[LINK_ITEMS_DROPPED] += output->dropped;
    return items - output->dropped;
}

void bst_link_local_answer(bst_link *link, int number, const bst_link_messages *m) {
    link_part *part = &link->parts[number];
    for (int i = 0; i < m->output_count; i++) {
        bst_link_output *output = &m->outputs[i];
        link_given *given = &part->given[output->type];
        output->given = given->pending;
        output->dropped = 0;
        if (given->pending) {
            const bst_wire_message *about = bst_wire_message_of(output->type);
            int items = fitting(link, about, given->payload, output);
            memcpy(output->payload, given->payload,
                   about->header_bytes + (size_t)items * about->item_bytes);
            if (output->dropped > 0) {
                bst_wire_set_items(about, output->payload, items);
            }
            given->pending = false;
        }
    }
}

void bst_link_local_free(link_part *part) {
    for (int t = 0; t < BST_LINK_TYPES; t++) {
        free(part->given[t].payload);
    }
}

/* Archives a command that waits for its module. */
static bst_status archive_given(bst_archive *archive, const bst_wire_message *about,
                                link_given *given) {
    size_t most = about->header_bytes + (size_t)about->max_items * about->item_bytes;
    bool restoring = bst_archive_is_restoring(archive);
    BST_ARCHIVE(archive, given->pending);
    if (!given->pending) {
        return BST_OK;
    }
    int bytes = bst_archive_count(archive, restoring ? 0 : (int)given->bytes, (int)most);
    if (restoring) {
        void *payload = realloc(given->payload, most);
        if (!payload) {
            return bst_fail(bst_archive_ctx(archive), BST_ERR_MEMORY,
                            "out of memory for a command");
        }
        memset(payload, 0, most);
        given->payload = payload;
        given->bytes = (size_t)bytes;
    }
    bst_archive_bytes(archive, given->payload, (size_t)bytes);
    return restoring ? bst_wire_check_struct(bst_archive_ctx(archive), about, given->payload,
                                             about->max_items)
                     : BST_OK;
}

bst_status bst_link_archive(bst_link *link, int number, bst_archive *archive) {
    link_part *part = &link->parts[number];
    if (!link->local) {
        return bst_fail(bst_archive_ctx(archive), BST_ERR_STATE,
                        "another program plays %s, whose state this one does not have; use a "
                        "built-in type to save the simulation",
                        part->about.instance);
    }
    for (int t = 0; t < BST_LINK_TYPES; t++) {
        if (may_give(part->about.role, (bst_link_type)t)) {
            BST_TRY(archive_given(archive, bst_wire_message_of((bst_link_type)t), &part->given[t]));
        }
    }
    return BST_OK;
}
