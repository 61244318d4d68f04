#include "sim/link/link.h"

#include <assert.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "sim/link/link_internal.h"

static const char *const silence_names[] = {"stop", "go_on", NULL};

const bst_config_desc bst_link_config_table[] = {
    BST_STRING(bst_link_config, address, "\"\"",
               "Where peers connect: tcp://127.0.0.1:PORT or ipc://PATH; needed by modules of type "
               "\"external\"."),
    BST_PATH(bst_link_config, keys_file, "\"\"",
             "Keys of boresight link-keys: only peers that have them may connect, and what is sent "
             "is encrypted; a file, relative to the scenario's folder."),
    BST_REAL(bst_link_config, timeout_s, "s", 0.001, 3600, "5",
             "For which the run waits for a peer's answer to a step."),
    BST_REAL(bst_link_config, connect_timeout_s, "s", 0.001, 86400, "60",
             "For which the first step of a part waits for a peer that plays it."),
    BST_ENUM(bst_link_config, on_timeout, silence_names, "\"stop\"",
             "When no answer comes in time: the run ends with an error, or goes on without what "
             "the part would have said."),
    BST_FORMER("on_silence", "on_timeout"),
    BST_BOOL(bst_link_config, shared_memory, "false",
             "Frames go by shared memory to peers that take them so."),
    BST_CONFIG_END};

bst_status bst_link_create(bst_ctx *ctx, const bst_link_config *config, const bst_link_run *run,
                           bst_link **out) {
    assert(config && run && out);
    *out = NULL;
    bst_link *link = calloc(1, sizeof *link);
    if (!link) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the link");
    }
    link->config = *config;
    link->run = *run;
    snprintf(link->scenario, sizeof link->scenario, "%s", run->scenario);
    link->run.scenario = link->scenario;
    bst_status status = bst_link_endpoint_check(ctx, config->address, link->address);
    if (status != BST_OK) {
        free(link);
        return status;
    }
    *out = link;
    return BST_OK;
}

bst_status bst_link_add(bst_ctx *ctx, bst_link *link, const bst_link_part *part, int *number) {
    assert(link && part && number);
    if (link->router) {
        return bst_fail(ctx, BST_ERR_STATE, "link: parts are added before it is opened");
    }
    link_part *parts = realloc(link->parts, ((size_t)link->part_count + 1) * sizeof *parts);
    if (!parts) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the link's parts");
    }
    link->parts = parts;
    parts[link->part_count] = (link_part){.about = *part, .peer = -1};
    *number = link->part_count++;
    return BST_OK;
}

static void set(void *socket, int option, int value) {
    (void)zmq_setsockopt(socket, option, &value, sizeof value);
}

static bst_status bind_address(bst_ctx *ctx, bst_link *link) {
    link->context = zmq_ctx_new();
    link->router = link->context ? zmq_socket(link->context, ZMQ_ROUTER) : NULL;
    link->monitor = link->context ? zmq_socket(link->context, ZMQ_PAIR) : NULL;
    if (!link->router || !link->monitor) {
        return bst_fail(ctx, BST_ERR_IO, "link: %s", zmq_strerror(errno));
    }
    if (*link->config.keys_file) {
        BST_TRY(bst_curve_keys_read(ctx, link->config.keys_file, &link->keys));
        BST_TRY(bst_curve_secure(ctx, link->router, &link->keys, true));
        link->asker = bst_curve_asker(link->context);
        if (!link->asker) {
            return bst_fail(ctx, BST_ERR_IO, "link: keys cannot be checked: %s",
                            zmq_strerror(errno));
        }
    }
    int64_t most = LINK_MESSAGE_BYTES;
    (void)zmq_setsockopt(link->router, ZMQ_MAXMSGSIZE, &most, sizeof most);
    set(link->router, ZMQ_ROUTER_MANDATORY, 1);
    set(link->router, ZMQ_SNDHWM, LINK_QUEUE);
    set(link->router, ZMQ_RCVHWM, LINK_QUEUE);
    set(link->router, ZMQ_LINGER, 0);
    set(link->router, ZMQ_IPV6, strncmp(link->address, "tcp://[", 7) == 0);
    set(link->monitor, ZMQ_LINGER, 0);
    if (zmq_socket_monitor(link->router, "inproc://watch",
                           ZMQ_EVENT_ACCEPTED | ZMQ_EVENT_DISCONNECTED) != 0 ||
        zmq_connect(link->monitor, "inproc://watch") != 0) {
        return bst_fail(ctx, BST_ERR_IO, "link: cannot watch connections: %s", zmq_strerror(errno));
    }
    if (strncmp(link->address, "ipc://", 6) == 0) {
        /* ZeroMQ itself would remove any file at the path */
        BST_TRY(bst_ipc_socket_open(ctx, link->address + 6, &link->ipc));
        set(link->router, ZMQ_USE_FD, link->ipc.fd);
    }
    if (zmq_bind(link->router, link->address) != 0) {
        int why = errno;
        if (*link->ipc.path) {
            close(link->ipc.fd);
        }
        return bst_fail(ctx, BST_ERR_IO, "link: cannot use %s: %s%s", link->address,
                        zmq_strerror(why),
                        why == EADDRINUSE ? "; another program has it: choose another port" : "");
    }
    return BST_OK;
}

bst_status bst_link_open(bst_ctx *ctx, bst_link *link) {
    if (link->router || link->local || bst_link_replays(link)) {
        return BST_OK;
    }
    link->welcome =
        calloc(1, sizeof *link->welcome + (size_t)link->part_count * sizeof(bst_link_part));
    if (!link->welcome) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the link");
    }
    if (link->config.shared_memory && !link->shared) {
        BST_TRY(bst_shared_frames_create(ctx, link->run.pixel_bytes, &link->shared));
    }
    bst_status status = bind_address(ctx, link);
    if (status == BST_OK) {
        bst_log(ctx, BST_LOG_INFO, "link: waiting for peers at %s", link->address);
    }
    return status;
}

void bst_link_set_end(bst_link *link, int reason, const char *text) {
    link->end.reason = reason;
    snprintf(link->end.text, sizeof link->end.text, "%s", text);
    for (char *c = link->end.text; *c; c++) {
        *c = *c >= 0x20 && *c <= 0x7e ? *c : '?';
    }
    link->has_end = true;
}

void bst_link_close(bst_link *link, int reason, const char *text) {
    if (!link) {
        return;
    }
    if (!link->has_end) {
        bst_link_set_end(link, reason, text);
    }
    static uint8_t none[1];
    uint8_t *rooms = link->router ? malloc((size_t)LINK_PEERS * LINK_END_BYTES) : none;
    for (int p = 0; link->router && rooms && p < LINK_PEERS; p++) {
        if (link->peers[p].used && !link->peers[p].blocked) {
            (void)bst_link_send_end(link, p, rooms + (size_t)p * LINK_END_BYTES);
        }
    }
    /* libzmq 4.3.4 aborts if a socket closes while a multi-part message is being sent to a peer
     * that disconnects. Therefore wait until the last message is sent, unless the peer does not
     * read. */
    for (int ms = 0; ms < LINK_PARTING_MS && __atomic_load_n(&link->parting, __ATOMIC_ACQUIRE) > 0;
         ms++) {
        (void)zmq_poll(NULL, 0, 1);
    }
    if (link->router) {
        set(link->router, ZMQ_LINGER, 200); /* linger in ms, so that `end` is sent */
        (void)zmq_socket_monitor(link->router, NULL, 0);
        zmq_close(link->router);
    }
    if (link->monitor) {
        zmq_close(link->monitor);
    }
    if (link->asker) {
        zmq_close(link->asker);
    }
    if (link->context) {
        zmq_ctx_term(link->context); /* ZeroMQ has released all frames when it returns */
    }
    bst_ipc_socket_remove(&link->ipc);
    if (rooms != none) {
        free(rooms);
    }
    bst_link_tape_free(link->tape);
    bst_shared_frames_free(link->shared);
    free(link->welcome);
    for (int i = 0; i < link->part_count; i++) {
        bst_link_local_free(&link->parts[i]);
        for (int a = 0; a < LINK_AHEAD; a++) {
            link_answer *answer = &link->parts[i].ahead[a];
            for (int o = 0; o < answer->output_count; o++) {
                free(answer->outputs[o].payload);
            }
            free(answer->outputs);
        }
    }
    free(link->parts);
    free(link);
}

void bst_link_on_wait(bst_link *link, bool (*stop)(void *user), void *user) {
    link->stop = stop;
    link->stop_user = user;
}

static const char *const event_names[LINK_EVENTS] = {
    [BST_WIRE_GOOD] = "link_messages",
    [BST_WIRE_BAD_HEADER] = "link_bad_header",
    [BST_WIRE_BAD_VERSION] = "link_bad_version",
    [BST_WIRE_BAD_LENGTH] = "link_bad_length",
    [BST_WIRE_BAD_CRC] = "link_bad_crc",
    [BST_WIRE_BAD_VALUE] = "link_bad_value",
    [BST_WIRE_UNEXPECTED] = "link_unexpected",
    [LINK_DUPLICATE] = "link_duplicate",
    [LINK_OUT_OF_ORDER] = "link_out_of_order",
    [LINK_GAP] = "link_gap",
    [LINK_LATE] = "link_late",
    [LINK_REPEATED] = "link_repeated",
    [LINK_INCOMPLETE] = "link_incomplete",
    [LINK_STRANGER] = "link_stranger",
    [LINK_REFUSED] = "link_refused",
    [LINK_FLOODED] = "link_flooded",
    [LINK_OVERSIZED] = "link_oversized",
    [LINK_NO_KEY] = "link_no_key",
    [LINK_TAKEOVER] = "link_takeover",
    [LINK_HELLO_TAKEN] = "link_hello",
    [LINK_LEFT] = "link_left",
    [LINK_UNANSWERED] = "link_unanswered",
    [LINK_ITEMS_DROPPED] = "link_items_dropped",
    [LINK_HELD] = "link_held",
    [LINK_SKIPPED] = "link_skipped",
    [LINK_CONNECTED] = "link_connected",
    [LINK_DISCONNECTED] = "link_disconnected",
};

bool bst_link_counter(const bst_link *link, int index, const char **name, int64_t *count) {
    if (index < 0 || index >= LINK_EVENTS) {
        return false;
    }
    *name = event_names[index];
    *count = link->counts[index];
    return true;
}

int64_t bst_link_news(bst_link *link, int index, const char **name) {
    int64_t count;
    if (!bst_link_counter(link, index, name, &count)) {
        return -1;
    }
    int64_t grown = count - link->reported[index];
    link->reported[index] = count;
    return grown;
}

void bst_link_event(bst_link *link, bst_ctx *ctx, int event, const char *format, ...) {
    link->counts[event]++;
    if (link->note_count == LINK_NOTES) {
        return; /* the log gets the first few; the counters count all */
    }
    char *note = link->notes[(link->note_first + link->note_count++) % LINK_NOTES];
    int n = snprintf(note, LINK_NOTE_BYTES, "%s: ", event_names[event] + strlen("link_"));
    va_list args;
    va_start(args, format);
    vsnprintf(note + n, (size_t)(LINK_NOTE_BYTES - n), format, args);
    va_end(args);
    bool calm = event == LINK_HELLO_TAKEN || event == LINK_LEFT;
    if (calm) {
        bst_log(ctx, BST_LOG_INFO, "link: %s", note);
    } else if (link->warnings < LINK_WARNINGS) {
        link->warnings++;
        bst_log(ctx, BST_LOG_WARNING, "link: %s%s", note,
                link->warnings == LINK_WARNINGS ? " (more are counted, not shown)" : "");
    }
}

const char *bst_link_note(bst_link *link) {
    if (link->note_count == 0) {
        return NULL;
    }
    const char *note = link->notes[link->note_first];
    link->note_first = (link->note_first + 1) % LINK_NOTES;
    link->note_count--;
    return note;
}
