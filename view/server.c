#include "view/server.h"

#include <errno.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/random.h>

#include <civetweb.h>

#include "sim/core/wall_clock.h"
#include "view/large_stack.h"
#include "view/live_socket.h"
#include "view/page_files.h"
#include "view/request_body.h"
#include "view/request_guard.h"
#include "view/routes.h"

/* Connections that are served at the same time; further ones wait in the queue of the system. A
 * page uses up to 6. Most of the memory of a thread is never touched. */
#define SERVED_CONNECTIONS "192"
/* A peer that sends or takes nothing for so long loses its connection, ms. */
#define IDLE_MS "1500"
/* The same for a WebSocket, whose client asks again after each answer. */
#define SOCKET_IDLE_MS "20000"
/* Longest head of a request, bytes. */
#define REQUEST_BYTES "8192"
/* Bytes that are handed to the system at a time: IDLE_MS is counted for each. */
enum { PIECE_BYTES = 16384 };
/* A peer that takes an answer more slowly than this after the first seconds loses its connection:
 * time, s, and bytes/s. */
static const double FREE_S = 5.0;
static const double LEAST_RATE = 32768.0;
/* Answers that are computed at the same time. */
enum { COMPUTED_MOST = 12 };
/* Memory of all answers that are being sent; a single one may be larger, bytes. */
static const size_t SENT_BYTES = (size_t)192 << 20;

struct bst_view_server {
    struct mg_context *http;
    bst_view_subject *subject;
    bst_view_live *live;     /* NULL: none */
    bst_view_socket *socket; /* of `live` */
    char token[BST_VIEW_TOKEN_DIGITS + 1];
    bst_view_bodies bodies;
    pthread_mutex_t lock; /* of the two below */
    int computed;         /* answers that are being computed */
    size_t sent_bytes;    /* of those that are being sent */
};

/* What is sent for a request. */
typedef struct answer {
    int status;
    const char *type;
    const void *data;
    size_t bytes;
    const bst_view_bytes *pixels; /* NULL: something else */
} answer;

/* Scripts and data come from this server only, and no other page may show this one. */
static const char common_headers[] =
    "Cache-Control: no-store\r\n"
    "Content-Security-Policy: default-src 'none'; script-src 'self'; style-src 'self'; "
    "img-src 'self'; connect-src 'self'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'\r\n"
    "Cross-Origin-Opener-Policy: same-origin\r\n"
    "Cross-Origin-Resource-Policy: same-origin\r\n"
    "Referrer-Policy: no-referrer\r\n"
    "X-Content-Type-Options: nosniff\r\n"
    "X-Frame-Options: DENY\r\n";

static const char *reason_of(int status) {
    switch (status) {
        case BST_HTTP_OK:
            return "OK";
        case BST_HTTP_BAD_REQUEST:
            return "Bad Request";
        case BST_HTTP_FORBIDDEN:
            return "Forbidden";
        case BST_HTTP_NOT_FOUND:
            return "Not Found";
        case BST_HTTP_BAD_METHOD:
            return "Method Not Allowed";
        case BST_HTTP_TIMEOUT:
            return "Request Timeout";
        case BST_HTTP_TOO_LARGE:
            return "Content Too Large";
        case BST_HTTP_BUSY:
            return "Service Unavailable";
        default:
            return "Internal Server Error";
    }
}

/* Headers that say which pixels an answer has. */
static void describe_pixels(const bst_view_bytes *pixels, char *text, size_t bytes) {
    snprintf(text, bytes, "X-Frame-Width: %d\r\nX-Frame-Height: %d\r\n", pixels->width,
             pixels->height);
    if (pixels->binning > 0) {
        const size_t length = strlen(text);
        snprintf(text + length, bytes - length,
                 "X-Frame-Binning: %d\r\nX-Frame-Size: %d %d\r\nX-Frame-Part: %d %d\r\n",
                 pixels->binning, pixels->frame_width, pixels->frame_height, pixels->x, pixels->y);
    }
}

/* Sends an answer in pieces; stops when the peer is gone, takes nothing, or is too slow. */
static void send_answer(struct mg_connection *peer, const answer *a, bool head_only) {
    char size[256] = "";
    if (a->pixels && a->pixels->width > 0) {
        describe_pixels(a->pixels, size, sizeof size);
    }
    /* a refused request may have a body that was not read */
    const char *connection = a->status == BST_HTTP_OK ? "keep-alive" : "close";
    mg_printf(peer,
              "HTTP/1.1 %d %s\r\nContent-Type: %s\r\nContent-Length: %zu\r\nConnection: "
              "%s\r\n%s%s%s\r\n",
              a->status, reason_of(a->status), a->type, a->bytes, connection, size,
              a->status == BST_HTTP_BUSY ? "Retry-After: 1\r\n" : "", common_headers);
    if (a->status != BST_HTTP_OK) {
        mg_disable_connection_keep_alive(peer);
    }
    const double begin = bst_wall_seconds();
    for (size_t sent = 0; !head_only && sent < a->bytes;) {
        size_t piece = a->bytes - sent < PIECE_BYTES ? a->bytes - sent : PIECE_BYTES;
        int n = mg_write(peer, (const char *)a->data + sent, piece);
        sent += n > 0 ? (size_t)n : 0;
        if (n <= 0 || bst_wall_seconds() - begin > FREE_S + (double)sent / LEAST_RATE) {
            mg_disable_connection_keep_alive(peer); /* it may have sent further requests */
            return;
        }
    }
}

static answer text_answer(int status, const char *text) {
    return (answer){
        .status = status, .type = "text/plain; charset=utf-8", .data = text, .bytes = strlen(text)};
}

static answer refusal(int status) {
    static const char *const texts[] = {
        "This address needs the token that \"boresight view\" printed.\n",
        "There is nothing at this address.\n", "The viewer cannot answer this request.\n"};
    return text_answer(status, texts[status == BST_HTTP_FORBIDDEN   ? 0
                                     : status == BST_HTTP_NOT_FOUND ? 1
                                                                    : 2]);
}

/* ------------------------------------------------------------------ files of the page */

static const char *type_of(const char *name) {
    static const struct {
        const char *end, *type;
    } types[] = {{".html", "text/html; charset=utf-8"},
                 {".css", "text/css; charset=utf-8"},
                 {".js", "text/javascript; charset=utf-8"},
                 {".svg", "image/svg+xml"}};
    const char *dot = strrchr(name, '.');
    for (size_t i = 0; dot && i < sizeof types / sizeof *types; i++) {
        if (strcmp(dot, types[i].end) == 0) {
            return types[i].type;
        }
    }
    return "application/octet-stream";
}

static answer page_file(const char *route) {
    const char *name = *route ? route : "index.html";
    for (const bst_view_page_file *f = bst_view_page_files; f->name; f++) {
        if (strcmp(f->name, name) == 0) {
            return (answer){BST_HTTP_OK, type_of(name), f->data, f->bytes, NULL};
        }
    }
    return refusal(BST_HTTP_NOT_FOUND);
}

/* ------------------------------------------------------------------ data */

/* Takes a place for an answer that is computed. False: there is none. */
static bool begin_answer(bst_view_server *server) {
    pthread_mutex_lock(&server->lock);
    const bool room = server->computed < COMPUTED_MOST;
    server->computed += room;
    pthread_mutex_unlock(&server->lock);
    return room;
}

/* Gives the place of a computed answer back, and takes memory to send it. False: those that are
 * being sent have too much. */
static bool begin_sending(bst_view_server *server, size_t bytes) {
    pthread_mutex_lock(&server->lock);
    const bool room = server->sent_bytes == 0 || server->sent_bytes + bytes <= SENT_BYTES;
    server->computed--;
    server->sent_bytes += room ? bytes : 0;
    pthread_mutex_unlock(&server->lock);
    return room;
}

static void end_sending(bst_view_server *server, size_t bytes) {
    pthread_mutex_lock(&server->lock);
    server->sent_bytes -= bytes;
    pthread_mutex_unlock(&server->lock);
}

/* A call of a route. */
typedef struct route_call {
    const bst_view_route *route;
    bst_view_exchange *x;
    bst_ctx ctx;
    int status;
    bool is_json;
    char *text; /* JSON; cJSON_free */
} route_call;

static void call_route(void *user) {
    route_call *call = user;
    call->status = bst_view_route_call(&call->ctx, call->route, call->x);
    call->is_json = call->x->json != NULL;
    call->text = call->is_json ? cJSON_PrintUnformatted(call->x->json) : NULL;
    cJSON_Delete(call->x->json);
    call->x->json = NULL;
}

/* Calls a route; the answer is in the memory of the call. */
static answer compute(route_call *call) {
    const bst_view_exchange *x = call->x;
    if (!bst_view_call_with_stack(call_route, call)) {
        return refusal(BST_HTTP_BUSY);
    }
    if (call->status != BST_HTTP_OK) {
        return text_answer(call->status, call->ctx.message);
    }
    if (call->text) {
        return (answer){BST_HTTP_OK, "application/json; charset=utf-8", call->text,
                        strlen(call->text), NULL};
    }
    if (call->is_json) { /* it found no memory */
        return refusal(BST_HTTP_FAILED);
    }
    return (answer){BST_HTTP_OK, x->type ? x->type : "application/octet-stream", x->bytes.data,
                    x->bytes.bytes, &x->bytes};
}

/* Sends a refusal; returns its status. */
static int refuse(struct mg_connection *peer, int status, bool head_only) {
    const answer a = refusal(status);
    send_answer(peer, &a, head_only);
    return status;
}

/* Answers a request for data. */
static int answer_data(struct mg_connection *peer, bst_view_server *server,
                       const bst_view_route *route, bool head_only) {
    const struct mg_request_info *info = mg_get_request_info(peer);
    bst_view_exchange x = {.subject = server->subject, .live = server->live};
    route_call call = {.route = route, .x = &x};
    char *body = NULL;
    if (!bst_view_exchange_read(info->query_string, &x)) {
        return refuse(peer, BST_HTTP_BAD_REQUEST, head_only);
    }
    if (route->post) {
        const int status = bst_view_read_body(&server->bodies, peer, info->content_length, &body);
        if (status != BST_HTTP_OK) {
            return refuse(peer, status, head_only);
        }
        x.body = body;
        x.body_bytes = (size_t)info->content_length;
    }
    if (!begin_answer(server)) {
        free(body);
        return refuse(peer, BST_HTTP_BUSY, head_only);
    }
    answer a = compute(&call);
    free(body);
    const size_t bytes = a.bytes;
    if (begin_sending(server, bytes)) {
        send_answer(peer, &a, head_only);
        end_sending(server, bytes);
    } else {
        a.status = refuse(peer, BST_HTTP_BUSY, head_only);
    }
    cJSON_free(call.text);
    free(x.bytes.data);
    return a.status;
}

/* ------------------------------------------------------------------ requests */

/* Finds a header and counts how often it is there. */
static const char *header_of(const struct mg_request_info *info, const char *name, int *count) {
    const char *value = NULL;
    *count = 0;
    for (int i = 0; i < info->num_headers; i++) {
        if (strcasecmp(info->http_headers[i].name, name) == 0) {
            value = info->http_headers[i].value;
            ++*count;
        }
    }
    return value;
}

/* True if all names of headers are names: letters, digits and some signs (RFC 9110, section 5.6.2).
 * Others are lines that go on, or have a space before their colon. */
static bool are_headers(const struct mg_request_info *info) {
    static const char allowed[] =
        "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789"
        "!#$%&'*+-.^_`|~";
    bool good = info->num_headers < MG_MAX_HEADERS; /* further ones are not seen */
    for (int i = 0; good && i < info->num_headers; i++) {
        const char *name = info->http_headers[i].name;
        good = *name && name[strspn(name, allowed)] == '\0';
    }
    return good;
}

/* Answers every request, so that the library serves no file of its own. Called by its threads. */
static int on_request(struct mg_connection *peer) {
    const struct mg_request_info *info = mg_get_request_info(peer);
    bst_view_server *server = info->user_data;
    bst_view_request request = {.method = info->request_method, .target = info->request_uri};
    char route[BST_VIEW_ROUTE_BYTES];
    int coded, lengths;
    request.host = header_of(info, "Host", &request.hosts);
    request.origin = header_of(info, "Origin", &request.origins);
    const char *length = header_of(info, "Content-Length", &lengths);
    request.body_bytes = length ? info->content_length : 0;
    if (header_of(info, "Transfer-Encoding", &coded) || lengths > 1) {
        request.body_bytes = INT64_MAX; /* of unknown length */
    }
    int status =
        are_headers(info) ? bst_view_guard(&request, server->token, route) : BST_HTTP_BAD_REQUEST;
    bool head_only = request.method && strcmp(request.method, "HEAD") == 0;
    if (status != BST_HTTP_OK) {
        return refuse(peer, status, head_only);
    }
    int upgrades;
    if (server->live && strcmp(route, "live") == 0 && request.origin &&
        strcmp(request.method, "GET") == 0 && header_of(info, "Upgrade", &upgrades)) {
        return 0; /* the library goes on with its WebSocket */
    }
    const bst_view_route *data = bst_view_route_find(route);
    if ((data && data->post) != (strcmp(request.method, "POST") == 0)) {
        return refuse(peer, BST_HTTP_BAD_METHOD, head_only);
    }
    if (data) {
        return answer_data(peer, server, data, head_only);
    }
    answer a = page_file(route);
    send_answer(peer, &a, head_only);
    return a.status;
}

/* The library's messages, for example of peers that went away, are of no use to the user. */
static int on_message(const struct mg_connection *peer, const char *message) {
    (void)peer;
    (void)message;
    return 1;
}

/* Answers that the library makes itself, to what is no request, say no more than the status. */
static int on_error(struct mg_connection *peer, int status, const char *message) {
    (void)message;
    answer a = refusal(status);
    send_answer(peer, &a, false);
    return 0;
}

/* ------------------------------------------------------------------ start and end */

/* Draws a token from the random numbers of the system. */
static bst_status draw_token(bst_ctx *ctx, char token[BST_VIEW_TOKEN_DIGITS + 1]) {
    unsigned char random[BST_VIEW_TOKEN_DIGITS / 2];
    if (getrandom(random, sizeof random, 0) != sizeof random) {
        return bst_fail(ctx, BST_ERR_IO, "the system gives no random numbers: %s", strerror(errno));
    }
    for (size_t i = 0; i < sizeof random; i++) {
        snprintf(token + 2 * i, 3, "%02x", random[i]);
    }
    return BST_OK;
}

bst_status bst_view_server_start(bst_ctx *ctx, bst_view_subject *subject, bst_view_live *live,
                                 int port, char url[BST_VIEW_URL_BYTES], bst_view_server **out) {
    bst_view_server *server = calloc(1, sizeof *server);
    char ports[32];
    *out = NULL;
    if (!server || pthread_mutex_init(&server->lock, NULL) != 0 ||
        pthread_mutex_init(&server->bodies.lock, NULL) != 0) {
        free(server);
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the server");
    }
    server->subject = subject;
    server->live = live;
    bst_status status = draw_token(ctx, server->token);
    snprintf(ports, sizeof ports, "127.0.0.1:%d", port);
    const char *options[] = {"listening_ports",
                             ports,
                             "num_threads",
                             SERVED_CONNECTIONS,
                             "request_timeout_ms",
                             IDLE_MS,
                             "keep_alive_timeout_ms",
                             IDLE_MS,
                             "enable_keep_alive",
                             "yes",
                             "tcp_nodelay",
                             "1",
                             "max_request_size",
                             REQUEST_BYTES,
                             "listen_backlog",
                             "512",
                             "connection_queue",
                             "512",
                             "websocket_timeout_ms",
                             SOCKET_IDLE_MS,
                             "decode_url",
                             "no",
                             "enable_directory_listing",
                             "no",
                             "access_control_list",
                             "-0.0.0.0/0,+127.0.0.1",
                             NULL};
    const struct mg_callbacks callbacks = {
        .begin_request = on_request, .log_message = on_message, .http_error = on_error};
    if (status == BST_OK) {
        server->http = mg_start(&callbacks, server, options);
    }
    if (status == BST_OK && !server->http) {
        status = bst_fail(ctx, BST_ERR_IO,
                          "port %d of 127.0.0.1 cannot be opened (in use, or not allowed); give "
                          "another --port, or 0 for any free one",
                          port);
    }
    struct mg_server_port opened = {.port = 0};
    if (status == BST_OK && mg_get_server_ports(server->http, 1, &opened) < 1) {
        status = bst_fail(ctx, BST_ERR_IO, "the port of the server is unknown");
    }
    if (status != BST_OK) {
        bst_view_server_stop(server);
        return status;
    }
    if (live) {
        char uri[BST_VIEW_TOKEN_DIGITS + 16];
        snprintf(uri, sizeof uri, "/%s/live", server->token);
        status = bst_view_socket_open(ctx, server->http, uri, live, &server->socket);
        if (status != BST_OK) {
            bst_view_server_stop(server);
            return status;
        }
    }
    snprintf(url, BST_VIEW_URL_BYTES, "http://127.0.0.1:%d/%s/", opened.port, server->token);
    *out = server;
    return BST_OK;
}

void bst_view_server_stop(bst_view_server *server) {
    if (!server) {
        return;
    }
    bst_view_socket_stop(server->socket);
    if (server->http) {
        mg_stop(server->http);
    }
    bst_view_socket_free(server->socket);
    pthread_mutex_destroy(&server->bodies.lock);
    pthread_mutex_destroy(&server->lock);
    free(server);
}
