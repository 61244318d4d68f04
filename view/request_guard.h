/* Decides which HTTP requests the viewer answers. Loopback ports can be reached by any page in the
 * user's browser (foreign Origin, DNS rebinding) and by other users of the machine. */
#ifndef BST_VIEW_REQUEST_GUARD_H
#define BST_VIEW_REQUEST_GUARD_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Hexadecimal digits of a token: 128 random bits. */
enum { BST_VIEW_TOKEN_DIGITS = 32 };
/* Room for a route with the zero byte. */
enum { BST_VIEW_ROUTE_BYTES = 64 };
/* Longest body of a POST: a scenario's text. */
enum { BST_VIEW_BODY_BYTES = 4 << 20 };
/* Route of files that are dropped onto the editor, and the longest one: a frame of 4096 x 4096. */
#define BST_VIEW_FILE_ROUTE "api/editor/file"
enum { BST_VIEW_FILE_BYTES = 40 << 20 };

/* Statuses of HTTP that the viewer uses (RFC 9110, section 15). */
enum {
    BST_HTTP_OK = 200,
    BST_HTTP_BAD_REQUEST = 400,
    BST_HTTP_FORBIDDEN = 403,
    BST_HTTP_NOT_FOUND = 404,
    BST_HTTP_BAD_METHOD = 405,
    BST_HTTP_TIMEOUT = 408,
    BST_HTTP_TOO_LARGE = 413,
    BST_HTTP_FAILED = 500,
    BST_HTTP_BUSY = 503
};

/* A request as it came. A header that is missing is NULL. */
typedef struct bst_view_request {
    const char *method, *target; /* target: path and query, not decoded */
    const char *host, *origin;
    int hosts, origins; /* number of these headers */
    int64_t body_bytes; /* of Content-Length; 0 or less: none; INT64_MAX: unknown */
} bst_view_request;

/* Checks a request and finds its route, the path behind "/TOKEN/".
 *
 * Given:     request  as it came from the network
 *            token    of the server, BST_VIEW_TOKEN_DIGITS digits
 * Returned:  route    "" for "/TOKEN/": letters, digits, "_", "-", "/" and single dots, never ".."
 *            status of HTTP: BST_HTTP_OK, or why the request is refused
 * Notes:     Host must name the loopback interface: a name that an attacker's DNS points there is
 *            refused. The port may be any, as `ssh -L` changes it. Origin must be that of Host, or
 *            missing: browsers send it with every request of a foreign page's script, and with
 *            every POST, which needs it. Only POST has a body, of at most BST_VIEW_BODY_BYTES
 *            (BST_VIEW_FILE_BYTES for BST_VIEW_FILE_ROUTE). The time of the comparison does not
 *            depend on how many digits of the token are right. */
int bst_view_guard(const bst_view_request *request, const char *token,
                   char route[BST_VIEW_ROUTE_BYTES]);

/* Reads an integer of a query "a=1&b=2".
 *
 * Given:     query     NULL: none
 *            name      of the parameter
 *            low, high allowed values
 * Returned:  *value    unchanged if the parameter is missing
 *            false: no decimal integer, out of range, or given twice */
bool bst_view_query_int(const char *query, const char *name, int64_t low, int64_t high,
                        int64_t *value);

/* Reads a finite real number of a query, as bst_view_query_int. */
bool bst_view_query_real(const char *query, const char *name, double *value);

/* Reads a word of a query: lower-case letters, digits and "_", as bst_view_query_int.
 *
 * Given:     bytes  room at `word`, with the zero byte */
bool bst_view_query_word(const char *query, const char *name, char *word, size_t bytes);

/* Reads a name of a query: letters, digits, "_", "-" and ".", not first, as bst_view_query_word. */
bool bst_view_query_name(const char *query, const char *name, char *word, size_t bytes);

#endif
