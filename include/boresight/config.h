/* Configuration by descriptor tables: one table drives parsing, validation, the resolved echo and
 * the JSON Schema. */
#ifndef BORESIGHT_CONFIG_H
#define BORESIGHT_CONFIG_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "boresight/status.h"

#pragma GCC visibility push(default)

typedef enum bst_config_type {
    BST_CONFIG_BOOL,    /* bool */
    BST_CONFIG_INT,     /* int64_t */
    BST_CONFIG_REAL,    /* double */
    BST_CONFIG_STRING,  /* char[size], size in the descriptor */
    BST_CONFIG_PATH,    /* char[size]: file path; a scenario's paths become absolute when read */
    BST_CONFIG_ENUM,    /* int32_t, index into choices */
    BST_CONFIG_CHOICES, /* uint32_t, bit k for choices[k]; in JSON a list of names */
    BST_CONFIG_SEED,    /* uint64_t: "0x...", a decimal string, or an integer */
    BST_CONFIG_REALS,   /* double[size / sizeof(double)], a fixed-length array */
    BST_CONFIG_OBJECT,  /* nested struct, children */
    BST_CONFIG_LIST,    /* bst_config_list of structs, children, item_bytes */
    BST_CONFIG_RAW,     /* not stored: checked elsewhere (module blocks) */
    BST_CONFIG_STAGE,   /* bst_stage_use of include/boresight/stage.h; choices: the stage's kind */
    BST_CONFIG_FORMER,  /* not stored: former name of the key that `fallback` names */
} bst_config_type;

/* Member for a LIST. `items` is one allocation of count * item_bytes that belongs to the config
 * object; NULL if the list is empty. */
typedef struct bst_config_list {
    void *items;
    int count;
} bst_config_list;

/* Longest name of a key, with the zero byte. */
enum { BST_CONFIG_KEY_BYTES = 64 };

/* One key. Tables end with an entry whose key is NULL. */
typedef struct bst_config_desc {
    const char *key;
    bst_config_type type;
    const char *unit; /* "s", "arcsec", "" ... for the schema and the reference page */
    double minimum,
        maximum;          /* range of numbers and of each element of REALS; list: number of items */
    const char *fallback; /* default as JSON text ("0.5", "\"ideal\"", "[0, 0, 1]"); NULL: the key
                             is required; FORMER: the present name of the key */
    const char *doc;      /* one sentence */
    size_t offset, size;  /* of the member in its struct */
    const char *const *choices; /* ENUM: names; PATH: keywords that are no file; NULL-terminated */
    const struct bst_config_desc *children; /* OBJECT, LIST */
    size_t item_bytes;                      /* LIST: size of one struct */
} bst_config_desc;

/* Shorthands for tables: BST_REAL(my_config, rate_hz, "Hz", 0.1, 1e4, "1000", "Plant rate."). */
#define BST_FIELD_(s, m) .offset = offsetof(s, m), .size = sizeof(((s *)0)->m)
#define BST_REAL(s, m, unit_, min_, max_, def_, doc_)                                        \
    {                                                                                        \
        .key = #m, .type = BST_CONFIG_REAL, .unit = unit_, .minimum = min_, .maximum = max_, \
        .fallback = def_, .doc = doc_, BST_FIELD_(s, m)                                      \
    }
/* An optional number: null, the default, is NAN in the struct. */
#define BST_OPEN_REAL(s, m, unit_, min_, max_, doc_) \
    BST_REAL(s, m, unit_, min_, max_, BST_CONFIG_OPEN, doc_)
#define BST_CONFIG_OPEN "null"
#define BST_INT(s, m, unit_, min_, max_, def_, doc_)                                        \
    {                                                                                       \
        .key = #m, .type = BST_CONFIG_INT, .unit = unit_, .minimum = min_, .maximum = max_, \
        .fallback = def_, .doc = doc_, BST_FIELD_(s, m)                                     \
    }
#define BST_BOOL(s, m, def_, doc_)                                                     \
    {                                                                                  \
        .key = #m, .type = BST_CONFIG_BOOL, .unit = "", .fallback = def_, .doc = doc_, \
        BST_FIELD_(s, m)                                                               \
    }
#define BST_STRING(s, m, def_, doc_)                                                     \
    {                                                                                    \
        .key = #m, .type = BST_CONFIG_STRING, .unit = "", .fallback = def_, .doc = doc_, \
        BST_FIELD_(s, m)                                                                 \
    }
#define BST_PATH(s, m, def_, doc_)                                                     \
    {                                                                                  \
        .key = #m, .type = BST_CONFIG_PATH, .unit = "", .fallback = def_, .doc = doc_, \
        BST_FIELD_(s, m)                                                               \
    }
/* A file path, or one of a NULL-terminated list of keywords. */
#define BST_PATH_OR(s, m, words_, def_, doc_)                                          \
    {                                                                                  \
        .key = #m, .type = BST_CONFIG_PATH, .unit = "", .fallback = def_, .doc = doc_, \
        .choices = words_, BST_FIELD_(s, m)                                            \
    }
#define BST_SEED(s, m, def_, doc_)                                                     \
    {                                                                                  \
        .key = #m, .type = BST_CONFIG_SEED, .unit = "", .fallback = def_, .doc = doc_, \
        BST_FIELD_(s, m)                                                               \
    }
#define BST_ENUM(s, m, choices_, def_, doc_)                                           \
    {                                                                                  \
        .key = #m, .type = BST_CONFIG_ENUM, .unit = "", .fallback = def_, .doc = doc_, \
        .choices = choices_, BST_FIELD_(s, m)                                          \
    }
#define BST_CHOICES(s, m, choices_, def_, doc_)                                           \
    {                                                                                     \
        .key = #m, .type = BST_CONFIG_CHOICES, .unit = "", .fallback = def_, .doc = doc_, \
        .choices = choices_, BST_FIELD_(s, m)                                             \
    }
#define BST_REALS(s, m, unit_, min_, max_, def_, doc_)                                        \
    {                                                                                         \
        .key = #m, .type = BST_CONFIG_REALS, .unit = unit_, .minimum = min_, .maximum = max_, \
        .fallback = def_, .doc = doc_, BST_FIELD_(s, m)                                       \
    }
#define BST_OBJECT(s, m, table_, def_, doc_)                                             \
    {                                                                                    \
        .key = #m, .type = BST_CONFIG_OBJECT, .unit = "", .fallback = def_, .doc = doc_, \
        .children = table_, BST_FIELD_(s, m)                                             \
    }
#define BST_LIST(s, m, item_, table_, min_, max_, def_, doc_)                             \
    {                                                                                     \
        .key = #m, .type = BST_CONFIG_LIST, .unit = "", .minimum = min_, .maximum = max_, \
        .fallback = def_, .doc = doc_, .children = table_, .item_bytes = sizeof(item_),   \
        BST_FIELD_(s, m)                                                                  \
    }
/* A former name of the key `now_` of the same table. Documents may still have it, with a warning
 * that gives the present name; schemas mark it as deprecated. A key may have several. */
#define BST_FORMER(former_, now_) \
    { .key = former_, .type = BST_CONFIG_FORMER, .fallback = now_ }
#define BST_CONFIG_END \
    { .key = NULL }

/* A parsed JSON document: text strictly checked (UTF-8, the grammar of RFC 8259, no trailing
 * garbage, no duplicate keys, no numbers beyond double, no \u0000, depth at most 64, at most
 * 8 million values, size bounded). */
typedef struct bst_json bst_json;
struct cJSON;

/* Reads and checks a JSON file.
 *
 * Given:     path  file of at most 64 MiB; also the document's name in messages
 * Returned:  *out  the document; NULL on error
 * Errors:    BST_ERR_IO, BST_ERR_NOT_FOUND, BST_ERR_FORMAT, BST_ERR_CONFIG (a key given twice),
 *            BST_ERR_MEMORY
 * Ownership: free *out with bst_json_free */
bst_status bst_json_load(bst_ctx *ctx, const char *path, bst_json **out) BST_MUST_CHECK;

/* Parses and checks JSON text.
 *
 * Given:     name   name of the document in messages; copied
 *            text   [bytes] UTF-8, with or without a byte order mark; no terminator is needed
 *            bytes  length of text
 * Returned:  *out  the document; NULL on error
 * Errors:    BST_ERR_FORMAT with line and column, BST_ERR_CONFIG (a key given twice or with a
 *            control character), BST_ERR_MEMORY
 * Ownership: free *out with bst_json_free */
bst_status bst_json_parse(bst_ctx *ctx, const char *name, const char *text, size_t bytes,
                          bst_json **out) BST_MUST_CHECK;
/* Frees a document with all of its values; NULL is allowed. */
void bst_json_free(bst_json *json);

/* Makes a deep copy of a document, with the source file of each value (bst_json_file).
 *
 * Returned:  *out  the copy; NULL on error
 * Errors:    BST_ERR_MEMORY
 * Ownership: free *out with bst_json_free */
bst_status bst_json_copy(bst_ctx *ctx, const bst_json *json, bst_json **out) BST_MUST_CHECK;
/* Root value of a document; it belongs to the document, and the caller may change it in place. */
struct cJSON *bst_json_root(const bst_json *json);
/* Name of a document as messages give it (its path); it belongs to the document. */
const char *bst_json_name(const bst_json *json);

/* Reads a JSON file that may change another one.
 *
 * Given:     path  file whose value is an object with the optional keys "extends" and "set"
 * Returned:  *out  the merged document, named `path`, without the two keys; NULL on error
 * Errors:    those of bst_json_load; BST_ERR_CONFIG for a file that extends itself, for more than
 *            16 files, for a key that is given both beside "set" and in it, and for a bad pointer
 *            in "set"
 * Ownership: free *out with bst_json_free
 * Notes:     "extends": FILE, relative to the folder of the file that names it, gives the values to
 *            start from; FILE may extend a third one. The file's other top-level keys replace those
 *            values. The object "set", {"/json/pointer": value}, is applied last. */
bst_status bst_json_load_extended(bst_ctx *ctx, const char *path, bst_json **out) BST_MUST_CHECK;

/* File that gave the value at a JSON pointer, or the last file that changed something inside it.
 *
 * Given:     pointer  JSON pointer ("/record/frames")
 * Returned:  path of the file; it belongs to the document */
const char *bst_json_file(const bst_json *json, const char *pointer);

/* Files that gave values to a document, in the order in which they were applied, with repeats.
 *
 * Given:     index  0, 1, ...
 * Returned:  path of the file, which belongs to the document; NULL after the last one, and for a
 *            document that extends no other */
const char *bst_json_origin_file(const bst_json *json, int index);

/* Corrects the file in an error message about a document that several files gave values to.
 *
 * Given:     ctx  a message "NAME: /json/pointer: ..." gets bst_json_file(pointer) instead of NAME;
 *                 other messages stay as they are */
void bst_json_name_file(bst_ctx *ctx, const bst_json *json);

/* Checks that an override has the form "/json/path=value".
 *
 * Errors:    BST_ERR_ARGUMENT if it has not */
bst_status bst_json_check_assignment(bst_ctx *ctx, const char *assignment) BST_MUST_CHECK;

/* Applies one override "/json/path=value" to a document.
 *
 * Given:     assignment  JSON pointer, "=", and a value: JSON text, or a bare word that is taken as
 *                        a string
 * Errors:    BST_ERR_ARGUMENT for a wrong form or an array element that does not exist,
 *            BST_ERR_MEMORY
 * Notes:     missing objects on the path are created; array elements must exist. */
bst_status bst_json_set(bst_ctx *ctx, bst_json *json, const char *assignment) BST_MUST_CHECK;

/* Puts a value at a JSON pointer.
 *
 * Given:     pointer  JSON pointer to an existing or a new value
 *            value    replaces what is there; NULL (a failed allocation): BST_ERR_MEMORY
 * Errors:    BST_ERR_ARGUMENT for an array element that does not exist or a path nested too deep,
 *            BST_ERR_MEMORY
 * Ownership: the document owns `value` from now on; it is freed on error
 * Notes:     missing objects on the path are created. bst_json_file gives the document's own file
 *            for this value. */
bst_status bst_json_assign(bst_ctx *ctx, bst_json *json, const char *pointer,
                           struct cJSON *value) BST_MUST_CHECK;

/* Fills a struct from a JSON object by a table of keys.
 *
 * Given:     json   document of the node, for messages
 *            node   JSON object; NULL: all keys at their defaults
 *            path   JSON pointer of node, for messages
 *            table  keys, types, ranges and defaults of the struct
 * Returned:  object  the struct, zeroed first; free its lists with bst_config_free
 * Errors:    BST_ERR_CONFIG "FILE: PATH: what is wrong (found VALUE; allowed: ...)",
 *            BST_ERR_MEMORY; then `object` holds nothing to free
 * Notes:     for an unknown key the message suggests the nearest known one. "$schema" and
 *            "description" are allowed in every object. A former name (BST_FORMER) sets its key and
 *            logs a warning; both names in one object are an error. A plug-in is refused: use
 *            bst_stage_read_config. */
bst_status bst_config_read(bst_ctx *ctx, const bst_json *json, const struct cJSON *node,
                           const char *path, const bst_config_desc *table,
                           void *object) BST_MUST_CHECK;

/* Reports a wrong value in the form of bst_config_read: "FILE: PATH: WHAT (found VALUE; allowed:
 * ALLOWED)".
 *
 * Given:     file, path  file and JSON pointer of the value
 *            value       the value found
 *            what        what is wrong
 *            allowed     what is allowed
 * Returned:  BST_ERR_CONFIG */
bst_status bst_config_fail(bst_ctx *ctx, const char *file, const char *path,
                           const struct cJSON *value, const char *what, const char *allowed);

/* Frees the lists and plug-in configurations inside an object that bst_config_read filled. The
 * object itself stays. */
void bst_config_free(const bst_config_desc *table, void *object);

/* Fills a struct with the defaults of its table.
 *
 * Given:     table  every key must have a default
 * Returned:  object  the struct, zeroed first; free its lists with bst_config_free
 * Errors:    BST_ERR_CONFIG if a key has no default, BST_ERR_MEMORY */
bst_status bst_config_defaults(bst_ctx *ctx, const bst_config_desc *table,
                               void *object) BST_MUST_CHECK;

/* True if a key may be null, which is NAN in the struct (BST_OPEN_REAL). */
bool bst_config_is_open(const bst_config_desc *desc);

/* Writes a struct as a JSON object with every default spelled out.
 *
 * Returned:  JSON object; NULL if out of memory
 * Ownership: free it with cJSON_Delete
 * Notes:     for printing: numbers are raw items, whose text reads back as the same bits. */
struct cJSON *bst_config_echo(const bst_config_desc *table, const void *object);

/* JSON Schema (draft 2020-12) of a table, as an object node.
 *
 * Ownership: free it with cJSON_Delete */
struct cJSON *bst_config_schema(const bst_config_desc *table);

#pragma GCC visibility pop

#endif
