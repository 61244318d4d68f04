#include "view/live_socket.h"

#include <pthread.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>

#include "sim/core/json_member.h"
#include "view/large_stack.h"
#include "view/pixel_bins.h"
#include "view/socket_frames.h"

/* Clients at the same time: each has a thread of the server. */
enum { CLIENTS_MOST = 48 };
/* Largest bins of pixels that a client may ask for. */
enum { BINNING_MOST = 64 };
/* Longest time that an answer waits for a newer frame, s. Commands of the client wait as long. */
static const double WAIT_S = 0.1;
/* Longest times that a client lets wait, s: for its first request, for a further one, for the rest
 * of one, and to take an answer, with the least bytes/s beyond. A page that is in the background
 * asks once a minute. */
static const double FIRST_S = 5.0;
static const double IDLE_S = 90.0;
static const double REST_S = 1.5;
static const double SEND_S = 5.0;
static const double LEAST_RATE = 32768.0;

struct bst_view_socket {
    bst_view_live *live;
    bool stopped;                           /* the server ends; atomic */
    pthread_mutex_t lock;                   /* of all below */
    const struct mg_connection *controller; /* NULL: none */
    int clients;
};

static int on_connect(const struct mg_connection *peer, void *user) {
    bst_view_socket *socket = user;
    (void)peer;
    pthread_mutex_lock(&socket->lock);
    bool room = socket->clients < CLIENTS_MOST;
    socket->clients += room;
    pthread_mutex_unlock(&socket->lock);
    return room ? 0 : 1;
}

static void on_close(const struct mg_connection *peer, void *user) {
    bst_view_socket *socket = user;
    pthread_mutex_lock(&socket->lock);
    socket->clients--;
    if (socket->controller == peer) {
        socket->controller = NULL;
    }
    pthread_mutex_unlock(&socket->lock);
}

/* True if the client may give commands; it becomes the controller if it asks and there is none. */
static bool controls(bst_view_socket *socket, const struct mg_connection *peer, bool asks) {
    pthread_mutex_lock(&socket->lock);
    if (asks && !socket->controller) {
        socket->controller = peer;
    }
    bool controller = socket->controller == peer;
    pthread_mutex_unlock(&socket->lock);
    return controller;
}

/* What is sent of a frame. */
typedef struct sent_part {
    bst_view_part part;
    int width, height; /* pixels or bins; 0: none */
} sent_part;

/* Part and bins of a frame that a client asks for; the whole frame if it asks for something else.
 */
static sent_part choose_part(const bst_view_live_frame *frame, const cJSON *asked) {
    static const char *const names[] = {"x", "y", "width", "height"};
    const int64_t binning = bst_json_whole(bst_json_member(asked, "binning"), 1);
    const cJSON *wanted = bst_json_member(asked, "part");
    int64_t numbers[4] = {0};
    sent_part sent = {.width = 0};
    for (int i = 0; i < 4; i++) {
        numbers[i] = bst_json_whole(bst_json_member(wanted, names[i]), 0);
    }
    if (!frame || !frame->pixels) {
        return sent;
    }
    sent.part = (bst_view_part){
        .x = numbers[0], .y = numbers[1], .width = numbers[2], .height = numbers[3]};
    sent.part.binning = binning > 1 && binning <= BINNING_MOST ? binning : 1;
    if (!bst_view_fit_part(&sent.part, frame->width, frame->height)) {
        sent.part = (bst_view_part){.width = frame->width, .height = frame->height, .binning = 1};
    }
    sent.width = bst_view_bins(sent.part.width, sent.part.binning);
    sent.height = bst_view_bins(sent.part.height, sent.part.binning);
    return sent;
}

static void describe_part(const bst_view_live_frame *frame, const sent_part *sent, cJSON *node) {
    cJSON_AddNumberToObject(node, "width", sent->width);
    cJSON_AddNumberToObject(node, "height", sent->height);
    if (sent->width > 0) {
        cJSON_AddNumberToObject(node, "binning", (double)sent->part.binning);
        cJSON_AddNumberToObject(node, "x", (double)sent->part.x);
        cJSON_AddNumberToObject(node, "y", (double)sent->part.y);
        cJSON_AddNumberToObject(node, "frame_width", frame->width);
        cJSON_AddNumberToObject(node, "frame_height", frame->height);
    }
}

/* Builds the answer; the pixels are binned into it. NULL: out of memory. */
static char *make_answer(cJSON *node, const bst_view_live_frame *frame, const sent_part *sent,
                         size_t *bytes) {
    char *text = cJSON_PrintUnformatted(node);
    const size_t pixels = (size_t)sent->width * (size_t)sent->height * sizeof *frame->pixels;
    /* pixels begin at an even address of the message */
    const uint32_t length = text ? (uint32_t)(strlen(text) + strlen(text) % 2) : 0;
    *bytes = sizeof length + length + pixels;
    char *message = text ? malloc(*bytes) : NULL;
    if (message) {
        memcpy(message, &length, sizeof length);
        message[sizeof length + length - 1] = ' ';
        memcpy(message + sizeof length, text, strlen(text));
        uint16_t *out = (uint16_t *)(void *)(message + sizeof length + length);
        if (pixels > 0 &&
            !bst_view_bin_part(frame->pixels, (size_t)frame->width, &sent->part, out)) {
            free(message);
            message = NULL;
        }
    }
    cJSON_free(text);
    return message;
}

/* Sends what a client asks for. False: it is gone, or takes nothing. */
static bool answer(bst_view_socket *socket, bst_view_peer *peer, const cJSON *asked,
                   bool controller, const char *problem) {
    const cJSON *sensor = bst_json_member(asked, "sensor"),
                *after = bst_json_member(asked, "after");
    const bst_view_live_frame *frame = NULL;
    if (cJSON_IsNumber(sensor) && cJSON_IsNumber(after)) {
        frame = bst_view_feed_get(bst_view_live_feed(socket->live), sensor->valueint,
                                  bst_json_whole(after, 0), WAIT_S);
    }
    const sent_part sent = choose_part(frame, asked);
    cJSON *node = cJSON_CreateObject();
    cJSON_AddItemToObject(node, "state", bst_view_live_state(socket->live));
    cJSON_AddBoolToObject(node, "controller", controller);
    cJSON_AddNumberToObject(node, "sequence", frame ? (double)frame->sequence : 0.0);
    describe_part(frame, &sent, node);
    if (frame) {
        cJSON_AddItemToObject(node, "frame", cJSON_CreateRaw(frame->json));
    }
    if (problem) {
        cJSON_AddStringToObject(node, "problem", problem);
    }
    size_t bytes;
    char *message = make_answer(node, frame, &sent, &bytes);
    bst_view_feed_release(frame);
    const bool taken = message && bst_view_send_frame(peer, BST_VIEW_BINARY, message, bytes);
    free(message);
    cJSON_Delete(node);
    return taken;
}

/* A client: the library's connection, and what is read from it. */
typedef struct client {
    bst_view_socket *socket;
    const struct mg_connection *connection;
    bst_view_peer peer;
} client;

/* A text of a client: {"sensor": N, "after": SEQUENCE, "take": true, "binning": N, "part": {x,
 * y, width, height}, "command": {...}}; all may be left out. False: it is something else, or its
 * answer is not taken, and the connection ends. */
static bool on_text(client *c, const char *data, size_t bytes) {
    cJSON *asked = cJSON_ParseWithLength(data, bytes);
    const char *problem = NULL;
    bool kept = cJSON_IsObject(asked);
    if (kept) {
        const bool controller =
            controls(c->socket, c->connection, cJSON_IsTrue(bst_json_member(asked, "take")));
        const cJSON *command = bst_json_member(asked, "command");
        if (command && !controller) {
            problem = "another page controls the run";
        } else if (command && !bst_view_live_command(c->socket->live, command)) {
            problem = "this is no command of a live run, or too many are waiting";
        }
        kept = answer(c->socket, &c->peer, asked, controller, problem);
    }
    cJSON_Delete(asked);
    return kept;
}

/* Answers a client until its connection ends. JSON that is deeply nested needs the larger stack. */
static void serve(void *user) {
    client *c = user;
    const char *text;
    size_t bytes;
    while (bst_view_next_text(&c->peer, &text, &bytes) && on_text(c, text, bytes)) {
    }
}

/* Takes a connection over from the library after the handshake, and gives it back when it is shut.
 * The first client is the controller. */
static void on_ready(struct mg_connection *connection, void *user) {
    bst_view_socket *socket = user;
    const struct mg_request_info *info = mg_get_request_info(connection);
    const int fd = bst_view_find_socket(info->remote_port, info->server_port);
    client *c = fd >= 0 ? calloc(1, sizeof *c) : NULL;
    pthread_mutex_lock(&socket->lock);
    socket->controller = socket->controller ? socket->controller : connection;
    pthread_mutex_unlock(&socket->lock);
    if (c) {
        *c = (client){.socket = socket, .connection = connection};
        c->peer = (bst_view_peer){.fd = fd,
                                  .stopped = &socket->stopped,
                                  .first_s = FIRST_S,
                                  .idle_s = IDLE_S,
                                  .frame_s = REST_S,
                                  .send_s = SEND_S,
                                  .least_rate = LEAST_RATE};
        (void)bst_view_call_with_stack(serve, c);
        shutdown(fd, SHUT_RDWR);
    }
    free(c);
}

/* A frame that came with the request of the handshake, before the connection was taken over, or on
 * one that could not be taken over: no browser sends one. */
static int on_data(struct mg_connection *peer, int bits, char *data, size_t bytes, void *user) {
    (void)peer;
    (void)bits;
    (void)data;
    (void)bytes;
    (void)user;
    return 0;
}

bst_status bst_view_socket_open(bst_ctx *ctx, struct mg_context *http, const char *uri,
                                bst_view_live *live, bst_view_socket **out) {
    bst_view_socket *socket = calloc(1, sizeof *socket);
    *out = NULL;
    if (!socket || pthread_mutex_init(&socket->lock, NULL) != 0) {
        free(socket);
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the server");
    }
    socket->live = live;
    mg_set_websocket_handler(http, uri, on_connect, on_ready, on_data, on_close, socket);
    *out = socket;
    return BST_OK;
}

void bst_view_socket_stop(bst_view_socket *socket) {
    if (socket) {
        __atomic_store_n(&socket->stopped, true, __ATOMIC_RELAXED);
    }
}

void bst_view_socket_free(bst_view_socket *socket) {
    if (socket) {
        pthread_mutex_destroy(&socket->lock);
        free(socket);
    }
}
