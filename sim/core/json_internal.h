/* What the parts of the JSON reader share. */
#ifndef BST_CORE_JSON_INTERNAL_H
#define BST_CORE_JSON_INTERNAL_H

#include <stdbool.h>
#include <stddef.h>

#include "boresight/config.h"

enum {
    BST_JSON_MAX_DEPTH = 64,
    /* cJSON takes about 80 bytes for each, so that any text stays below 1 GiB */
    BST_JSON_MAX_VALUES = 8000000,
};

/* Which file gave the value at a JSON pointer. */
typedef struct bst_json_origin {
    char *pointer, *file;
} bst_json_origin;

struct bst_json {
    char *name;
    struct cJSON *root;
    bst_json_origin *origins; /* of a file that extends another: later ones win; else NULL */
    int origin_count;
    const struct bst_document_tables *tables; /* NULL: pointers are taken as they are */
    bool is_copy; /* of a described document, which has warned of its former names */
};

/* Notes that what is at `pointer` comes from `file`. */
bst_status bst_json_note_origin(bst_ctx *ctx, bst_json *json, const char *pointer,
                                const char *file) BST_MUST_CHECK;

/* bst_json_assign; `where`: beginning of the warnings about former names, NULL: none. */
bst_status bst_json_assign_from(bst_ctx *ctx, bst_json *json, const char *pointer,
                                struct cJSON *value, const char *where) BST_MUST_CHECK;

/* Whether the first `length` bytes are a JSON pointer to something below the root, without empty
 * keys: "/", then keys and numbers of elements with one "/" between them. */
bool bst_json_is_pointer(const char *text, size_t length);

/* Why and where a text is not the JSON that is read here. */
typedef struct bst_json_fault {
    size_t offset;  /* byte in the text */
    char what[240]; /* "... (found ...; allowed: ...)" */
} bst_json_fault;

/* Whether a text is one JSON value in UTF-8 (RFC 8259 and 3629), without \u0000, lone surrogates,
 * zero bytes, nesting beyond BST_JSON_MAX_DEPTH and more than BST_JSON_MAX_VALUES values. Takes
 * time in proportion to bytes, and no memory. */
bool bst_json_check(const char *text, size_t bytes, bst_json_fault *fault);

#endif
