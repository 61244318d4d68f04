/* Internal functions of the JSON reader: grammar, origins of values. */
#ifndef BST_CORE_JSON_INTERNAL_H
#define BST_CORE_JSON_INTERNAL_H

#include <stdbool.h>
#include <stddef.h>

#include "boresight/config.h"

enum {
    BST_JSON_MAX_DEPTH = 64,
    /* cJSON needs about 80 bytes per value: any text needs less than 1 GiB */
    BST_JSON_MAX_VALUES = 8000000,
};

/* The file that set the value at a JSON pointer. */
typedef struct bst_json_origin {
    char *pointer, *file;
} bst_json_origin;

struct bst_json {
    char *name;
    struct cJSON *root;
    bst_json_origin *origins; /* for a file that extends another, later entries win; else NULL */
    int origin_count;
    const struct bst_document_tables *tables; /* NULL: pointers are taken as they are */
    bool is_copy; /* of a described document, which has warned of its former names */
};

/* Records that the value at `pointer` comes from `file`. */
bst_status bst_json_note_origin(bst_ctx *ctx, bst_json *json, const char *pointer,
                                const char *file) BST_MUST_CHECK;

/* bst_json_assign; `where`: beginning of the warnings about former names, NULL: none. */
bst_status bst_json_assign_from(bst_ctx *ctx, bst_json *json, const char *pointer,
                                struct cJSON *value, const char *where) BST_MUST_CHECK;

/* True if the first `length` bytes are a JSON pointer below the root without empty keys: "/" before
 * each key or array index. */
bool bst_json_is_pointer(const char *text, size_t length);

/* Reason and position of a JSON error. */
typedef struct bst_json_fault {
    size_t offset;  /* byte in the text */
    char what[240]; /* "... (found ...; allowed: ...)" */
} bst_json_fault;

/* Checks that a text is one JSON value in UTF-8 (RFC 8259 and 3629), without \u0000, lone
 * surrogates, zero bytes, nesting beyond BST_JSON_MAX_DEPTH and more than BST_JSON_MAX_VALUES
 * values. Linear time, no allocation. */
bool bst_json_check(const char *text, size_t bytes, bst_json_fault *fault);

#endif
