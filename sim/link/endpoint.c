#include "sim/link/endpoint.h"

#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Decimal number from 0 to `most` that ends at `end`; -1: not a number. */
static long number(const char *text, const char *end, long most) {
    long value = 0;
    const char *p = text;
    for (; p < end && *p >= '0' && *p <= '9' && value <= most; p++) {
        value = value * 10 + (*p - '0');
    }
    return p == end && p > text && value <= most ? value : -1;
}

/* Matches 127.a.b.c. */
static bool loopback_v4(const char *host, const char *end) {
    const char *p = host;
    for (int i = 0; i < 4; i++) {
        const char *dot = memchr(p, '.', (size_t)(end - p));
        const char *stop = i < 3 ? dot : end;
        long value = stop ? number(p, stop, 255) : -1;
        if (value < 0 || (i == 0 && value != 127)) {
            return false;
        }
        p = stop + 1;
    }
    return true;
}

static bool is(const char *word, const char *host, const char *end) {
    return strlen(word) == (size_t)(end - host) && strncmp(word, host, strlen(word)) == 0;
}

bst_status bst_link_endpoint_check(bst_ctx *ctx, const char *endpoint,
                                   char out[BST_LINK_ENDPOINT_BYTES]) {
    size_t bytes = strlen(endpoint);
    /* socket paths have at most 107 bytes */
    if (strncmp(endpoint, "ipc://", 6) == 0 && bytes > 6 && bytes <= 6 + 107 &&
        endpoint[6] != '@' && endpoint[6] != '*') {
        snprintf(out, BST_LINK_ENDPOINT_BYTES, "%s", endpoint);
        return BST_OK;
    }
    const char *host = endpoint + 6, *colon = strrchr(endpoint, ':');
    long port = -1;
    if (strncmp(endpoint, "tcp://", 6) == 0 && colon > host && bytes < BST_LINK_ENDPOINT_BYTES) {
        port = number(colon + 1, endpoint + bytes, 65535);
    }
    if (port < 1) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "link: \"%.100s\" is no address (allowed: tcp://127.0.0.1:PORT with a port "
                        "from 1 to 65535, or ipc://PATH with a path of at most 107 bytes)",
                        endpoint);
    }
    if (is("localhost", host, colon)) {
        snprintf(out, BST_LINK_ENDPOINT_BYTES, "tcp://127.0.0.1:%ld", port);
        return BST_OK;
    }
    if (is("[::1]", host, colon) || loopback_v4(host, colon)) {
        snprintf(out, BST_LINK_ENDPOINT_BYTES, "%s", endpoint);
        return BST_OK;
    }
    return bst_fail(ctx, BST_ERR_ARGUMENT,
                    "link: \"%.100s\" could be reached from other machines, and the link asks for "
                    "no password (allowed: tcp://127.0.0.1:%ld). For a peer on another machine, "
                    "run there: ssh -L %ld:127.0.0.1:%ld USER@THIS_MACHINE, and connect it to "
                    "tcp://127.0.0.1:%ld",
                    endpoint, port, port, port, port);
}
