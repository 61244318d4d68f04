#include "view/request_guard.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

/* Names of the loopback interface in a URL. */
static const char *const loopback_names[] = {"127.0.0.1", "localhost", "[::1]"};
enum { LOOPBACK_NAMES = sizeof loopback_names / sizeof *loopback_names };
/* Longest value of a parameter in a query. */
enum { VALUE_BYTES = 64 };

/* True for ":PORT" with one to five digits, and for no port. */
static bool is_port(const char *text) {
    if (!*text) {
        return true;
    }
    size_t digits = strspn(text + 1, "0123456789");
    return *text == ':' && digits >= 1 && digits <= 5 && !text[1 + digits];
}

static bool is_loopback(const char *host) {
    for (int i = 0; i < LOOPBACK_NAMES; i++) {
        size_t length = strlen(loopback_names[i]);
        if (strncasecmp(host, loopback_names[i], length) == 0 && is_port(host + length)) {
            return true;
        }
    }
    return false;
}

/* True if `origin` is "http://" and the host of the same request. */
static bool is_same_origin(const char *origin, const char *host) {
    static const char scheme[] = "http://";
    return strncasecmp(origin, scheme, sizeof scheme - 1) == 0 &&
           strcasecmp(origin + sizeof scheme - 1, host) == 0;
}

/* True if `text` begins with the token; takes the same time for every text of that length. */
static bool has_token(const char *text, const char *token) {
    unsigned differs = 0;
    if (strnlen(text, BST_VIEW_TOKEN_DIGITS) < BST_VIEW_TOKEN_DIGITS) {
        return false;
    }
    for (int i = 0; i < BST_VIEW_TOKEN_DIGITS; i++) {
        differs |= (unsigned)(unsigned char)text[i] ^ (unsigned)(unsigned char)token[i];
    }
    return differs == 0;
}

/* Copies the route up to the query. False: a character or a form that no route has. */
static bool copy_route(const char *path, char route[BST_VIEW_ROUTE_BYTES]) {
    size_t length = strcspn(path, "?");
    if (length >= BST_VIEW_ROUTE_BYTES) {
        return false;
    }
    memcpy(route, path, length);
    route[length] = '\0';
    return strspn(route, "abcdefghijklmnopqrstuvwxyz0123456789_-./") == length &&
           !strstr(route, "..") && !strstr(route, "//") && route[0] != '/';
}

int bst_view_guard(const bst_view_request *request, const char *token,
                   char route[BST_VIEW_ROUTE_BYTES]) {
    route[0] = '\0';
    if (!request->method || !request->target || !request->host || request->hosts != 1 ||
        request->origins > 1 || request->target[0] != '/') {
        return BST_HTTP_BAD_REQUEST;
    }
    if (!is_loopback(request->host) ||
        (request->origin && !is_same_origin(request->origin, request->host))) {
        return BST_HTTP_FORBIDDEN;
    }
    const char *path = request->target + 1;
    if (!has_token(path, token) || path[BST_VIEW_TOKEN_DIGITS] != '/') {
        return BST_HTTP_FORBIDDEN;
    }
    bool post = strcmp(request->method, "POST") == 0;
    if (!post && strcmp(request->method, "GET") != 0 && strcmp(request->method, "HEAD") != 0) {
        return BST_HTTP_BAD_METHOD;
    }
    const char *rest = path + BST_VIEW_TOKEN_DIGITS + 1;
    const bool file = strcspn(rest, "?") == sizeof BST_VIEW_FILE_ROUTE - 1 &&
                      strncmp(rest, BST_VIEW_FILE_ROUTE, sizeof BST_VIEW_FILE_ROUTE - 1) == 0;
    if (request->body_bytes > (!post ? 0 : file ? BST_VIEW_FILE_BYTES : BST_VIEW_BODY_BYTES)) {
        return BST_HTTP_TOO_LARGE;
    }
    if (post && !request->origin) {
        return BST_HTTP_FORBIDDEN;
    }
    if (!copy_route(rest, route)) {
        route[0] = '\0';
        return BST_HTTP_NOT_FOUND;
    }
    return BST_HTTP_OK;
}

/* Copies the value of a parameter. False: too long, or given twice. *found false: missing. */
static bool find_value(const char *query, const char *name, char value[VALUE_BYTES], bool *found) {
    size_t length = strlen(name);
    *found = false;
    while (query && *query) {
        size_t part = strcspn(query, "&");
        if (strncmp(query, name, length) == 0 && query[length] == '=') {
            size_t bytes = part - length - 1;
            if (*found || bytes >= VALUE_BYTES) {
                return false;
            }
            memcpy(value, query + length + 1, bytes);
            value[bytes] = '\0';
            *found = true;
        }
        query += part + (query[part] == '&');
    }
    return true;
}

bool bst_view_query_int(const char *query, const char *name, int64_t low, int64_t high,
                        int64_t *value) {
    char text[VALUE_BYTES], *end;
    bool found;
    if (!find_value(query, name, text, &found)) {
        return false;
    }
    if (!found) {
        return true;
    }
    errno = 0;
    long long number = strtoll(text, &end, 10);
    bool begins = strchr("-0123456789", text[0]) && text[0];
    if (!begins || *end || end == text || errno || number < low || number > high) {
        return false;
    }
    *value = number;
    return true;
}

bool bst_view_query_real(const char *query, const char *name, double *value) {
    char text[VALUE_BYTES], *end;
    bool found;
    if (!find_value(query, name, text, &found)) {
        return false;
    }
    if (!found) {
        return true;
    }
    double number = strtod(text, &end);
    if (strspn(text, "-+.eE0123456789") != strlen(text) || *end || end == text ||
        !isfinite(number)) {
        return false;
    }
    *value = number;
    return true;
}

/* Reads a value that has certain characters only. */
static bool query_text(const char *query, const char *name, const char *allowed, char *word,
                       size_t bytes) {
    char text[VALUE_BYTES];
    bool found;
    if (!find_value(query, name, text, &found)) {
        return false;
    }
    size_t length = found ? strlen(text) : 0;
    if (!found) {
        return true;
    }
    if (length == 0 || length >= bytes || strspn(text, allowed) != length) {
        return false;
    }
    memcpy(word, text, length + 1);
    return true;
}

bool bst_view_query_word(const char *query, const char *name, char *word, size_t bytes) {
    return query_text(query, name, "abcdefghijklmnopqrstuvwxyz0123456789_", word, bytes);
}

bool bst_view_query_name(const char *query, const char *name, char *word, size_t bytes) {
    static const char allowed[] =
        "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-.";
    return query_text(query, name, allowed, word, bytes) && word[0] != '.';
}
