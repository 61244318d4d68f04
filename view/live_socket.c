#include "view/live_socket.h"

#include <pthread.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/json_member.h"
#include "view/pixel_bins.h"

/* Longest message of a client, bytes. */
enum { MESSAGE_BYTES = 8192 };
/* Clients at the same time: each has a thread of the server. */
enum { CLIENTS_MOST = 48 };
/* Largest bins of pixels that a client may ask for. */
enum { BINNING_MOST = 64 };
/* Longest time that an answer waits for a newer frame, s. Commands of the client wait as long. */
static const double WAIT_S = 0.1;

struct bst_view_socket {
    bst_view_live *live;
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

/* The first client is the controller. */
static void on_ready(struct mg_connection *peer, void *user) {
    bst_view_socket *socket = user;
    pthread_mutex_lock(&socket->lock);
    socket->controller = socket->controller ? socket->controller : peer;
    pthread_mutex_unlock(&socket->lock);
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

/* Reduces the pixels to bins, if a client asks for them: its screen has fewer pixels. */
static void bin_frame(bst_view_live_frame *frame, const cJSON *asked, cJSON *node) {
    const int64_t wanted = bst_json_whole(bst_json_member(asked, "binning"), 1);
    bst_view_bytes pixels = {.data = frame->pixels, .width = frame->width, .height = frame->height};
    bst_view_bin_pixels(&pixels, wanted > 1 && wanted <= BINNING_MOST ? (int)wanted : 1);
    if (pixels.binning > 1) {
        cJSON_AddNumberToObject(node, "binning", pixels.binning);
        cJSON_AddNumberToObject(node, "frame_width", pixels.frame_width);
        cJSON_AddNumberToObject(node, "frame_height", pixels.frame_height);
        frame->width = pixels.width;
        frame->height = pixels.height;
    }
}

/* Builds the answer; NULL: out of memory. */
static char *make_answer(cJSON *node, const bst_view_live_frame *frame, size_t *bytes) {
    char *text = cJSON_PrintUnformatted(node);
    const size_t pixels = (size_t)frame->width * (size_t)frame->height * sizeof *frame->pixels;
    /* pixels begin at an even address of the message */
    const uint32_t length = text ? (uint32_t)(strlen(text) + strlen(text) % 2) : 0;
    *bytes = sizeof length + length + pixels;
    char *message = text ? malloc(*bytes) : NULL;
    if (message) {
        memcpy(message, &length, sizeof length);
        memset(message + sizeof length, ' ', length);
        memcpy(message + sizeof length, text, strlen(text));
        if (pixels > 0) {
            memcpy(message + sizeof length + length, frame->pixels, pixels);
        }
    }
    cJSON_free(text);
    return message;
}

/* Sends what a client asks for. False: it is gone, or takes nothing. */
static bool answer(bst_view_socket *socket, struct mg_connection *peer, const cJSON *asked,
                   bool controller, const char *problem) {
    const cJSON *sensor = bst_json_member(asked, "sensor"),
                *after = bst_json_member(asked, "after");
    bst_view_live_frame frame = {.sequence = 0};
    if (cJSON_IsNumber(sensor) && cJSON_IsNumber(after)) {
        bst_view_feed_get(bst_view_live_feed(socket->live), sensor->valueint,
                          bst_json_whole(after, 0), WAIT_S, &frame);
    }
    cJSON *node = cJSON_CreateObject();
    cJSON_AddItemToObject(node, "state", bst_view_live_state(socket->live));
    cJSON_AddBoolToObject(node, "controller", controller);
    cJSON_AddNumberToObject(node, "sequence", (double)frame.sequence);
    bin_frame(&frame, asked, node);
    cJSON_AddNumberToObject(node, "width", frame.width);
    cJSON_AddNumberToObject(node, "height", frame.height);
    cJSON_AddItemToObject(node, "frame", frame.json ? cJSON_CreateRaw(frame.json) : NULL);
    if (problem) {
        cJSON_AddStringToObject(node, "problem", problem);
    }
    size_t bytes;
    char *message = make_answer(node, &frame, &bytes);
    bool sent = message && mg_websocket_write(peer, MG_WEBSOCKET_OPCODE_BINARY, message, bytes) > 0;
    free(message);
    cJSON_Delete(node);
    free(frame.json);
    free(frame.pixels);
    return sent;
}

/* A text of a client: {"sensor": N, "after": SEQUENCE, "take": true, "binning": N, "command":
 * {...}}; all may be left out. Anything else ends its connection. */
static int on_text(bst_view_socket *socket, struct mg_connection *peer, const char *data,
                   size_t bytes) {
    cJSON *asked = cJSON_ParseWithLength(data, bytes);
    const char *problem = NULL;
    bool kept = cJSON_IsObject(asked);
    if (kept) {
        const bool controller =
            controls(socket, peer, cJSON_IsTrue(bst_json_member(asked, "take")));
        const cJSON *command = bst_json_member(asked, "command");
        if (command && !controller) {
            problem = "another page controls the run";
        } else if (command && !bst_view_live_command(socket->live, command)) {
            problem = "this is no command of a live run, or too many are waiting";
        }
        kept = answer(socket, peer, asked, controller, problem);
    }
    cJSON_Delete(asked);
    return kept;
}

static int on_data(struct mg_connection *peer, int bits, char *data, size_t bytes, void *user) {
    const int opcode = bits & 0xf;
    const bool whole = bits & 0x80;
    if (opcode == MG_WEBSOCKET_OPCODE_PING || opcode == MG_WEBSOCKET_OPCODE_PONG) {
        return 1;
    }
    if (opcode != MG_WEBSOCKET_OPCODE_TEXT || !whole || bytes > MESSAGE_BYTES) {
        return 0;
    }
    return on_text(user, peer, data, bytes);
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

void bst_view_socket_free(bst_view_socket *socket) {
    if (socket) {
        pthread_mutex_destroy(&socket->lock);
        free(socket);
    }
}
