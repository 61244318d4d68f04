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
    BST_CONFIG_PATH,    /* the same: a file; a scenario's are made absolute when it is read */
    BST_CONFIG_ENUM,    /* int32_t, index into choices */
    BST_CONFIG_CHOICES, /* uint32_t, bit k for choices[k]; in JSON a list of names */
    BST_CONFIG_SEED,    /* uint64_t: "0x...", a decimal string, or an integer */
    BST_CONFIG_REALS,   /* double[size / sizeof(double)], a fixed-length array */
    BST_CONFIG_OBJECT,  /* nested struct, children */
    BST_CONFIG_LIST,    /* bst_config_list of structs, children, item_bytes */
    BST_CONFIG_RAW,     /* not stored: checked elsewhere (module blocks) */
    BST_CONFIG_STAGE,   /* bst_stage_use of include/boresight/stage.h; choices: the stage's kind */
} bst_config_type;

/* Where a LIST lands: `items` is one allocation of count * item_bytes, owned by the config object,
 * NULL when it is empty. */
typedef struct bst_config_list {
    void *items;
    int count;
} bst_config_list;

/* One key. Tables end with an entry whose key is NULL. */
typedef struct bst_config_desc {
    const char *key;
    bst_config_type type;
    const char *unit;        /* "s", "arcsec", "" ... for the schema and the reference page */
    double minimum, maximum; /* numbers and each element of REALS; list: number of items */
    const char *fallback; /* default as JSON text ("0.5", "\"ideal\"", "[0, 0, 1]"); NULL: the key
                             is required */
    const char *doc;      /* one sentence */
    size_t offset, size;  /* of the member in its struct */
    const char *const *choices; /* ENUM: names, PATH: words that are no file; NULL-terminated */
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
/* A number that may be left open: null, the default, is NAN in the struct. */
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
/* A file, or one of a NULL-terminated list of words. */
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
#define BST_CONFIG_END \
    { .key = NULL }

/* A parsed JSON document: text strictly checked (UTF-8, the grammar of RFC 8259, no trailing
 * garbage, no duplicate keys, no numbers beyond double, no \u0000, depth at most 64, at most
 * 8 million values, size bounded). */
typedef struct bst_json bst_json;
struct cJSON;

/* Reads a file (at most 64 MiB) or a text; `name` is used in messages. */
bst_status bst_json_load(bst_ctx *ctx, const char *path, bst_json **out) BST_MUST_CHECK;
bst_status bst_json_parse(bst_ctx *ctx, const char *name, const char *text, size_t bytes,
                          bst_json **out) BST_MUST_CHECK;
void bst_json_free(bst_json *json);
/* A deep copy, with the file of each value (bst_json_file); the caller frees it. BST_ERR_MEMORY. */
bst_status bst_json_copy(bst_ctx *ctx, const bst_json *json, bst_json **out) BST_MUST_CHECK;
struct cJSON *bst_json_root(const bst_json *json);
const char *bst_json_name(const bst_json *json);

/* Reads a file that may say "extends": FILE, relative to its own folder: then the values are those
 * of FILE, read in the same way, with what this one has at its top level in their place, and after
 * that with what its object "set" lists, {"/json/pointer": value}. Both keys are gone from the
 * result, whose name is `path`. BST_ERR_CONFIG: one extends itself, by way of at most 16 files. */
bst_status bst_json_load_extended(bst_ctx *ctx, const char *path, bst_json **out) BST_MUST_CHECK;
/* The file that gave the value at a JSON pointer, or the latest that changed something in it; lent.
 */
const char *bst_json_file(const bst_json *json, const char *pointer);
/* The files that gave values, in the order in which they were applied, with repeats; NULL after the
 * last one, and for a document that extends no other; lent. */
const char *bst_json_origin_file(const bst_json *json, int index);
/* Makes the message in ctx, when it begins "NAME: /json/pointer:", name bst_json_file instead of
 * the document. */
void bst_json_name_file(bst_ctx *ctx, const bst_json *json);

/* Whether an override has the form "/json/path=value"; BST_ERR_ARGUMENT when not. */
bst_status bst_json_check_assignment(bst_ctx *ctx, const char *assignment) BST_MUST_CHECK;
/* Applies one override "/json/path=value" (JSON pointer; value is JSON text, or a bare word taken
 * as a string). Objects on the way are made when missing; array elements must exist. */
bst_status bst_json_set(bst_ctx *ctx, bst_json *json, const char *assignment) BST_MUST_CHECK;

/* Puts `value`, which it takes, at a JSON pointer. Objects on the way are made when missing; array
 * elements must exist. The value counts as given by the document's own file (bst_json_file). */
bst_status bst_json_assign(bst_ctx *ctx, bst_json *json, const char *pointer,
                           struct cJSON *value) BST_MUST_CHECK;

/* Fills `object` (zeroed by the callee) from `node` by `table`. `path` is the JSON pointer of node,
 * for messages: FILE: PATH: what is wrong (found VALUE; allowed ...) Unknown keys suggest the
 * nearest known one. Keys "$schema" and "description" are allowed everywhere. */
bst_status bst_config_read(bst_ctx *ctx, const bst_json *json, const struct cJSON *node,
                           const char *path, const bst_config_desc *table,
                           void *object) BST_MUST_CHECK;
/* Says what is wrong with a value, in the words of bst_config_read: "FILE: PATH: WHAT (found VALUE;
 * allowed: ALLOWED)". BST_ERR_CONFIG. */
bst_status bst_config_fail(bst_ctx *ctx, const char *file, const char *path,
                           const struct cJSON *value, const char *what, const char *allowed);
/* Frees the lists inside an object that bst_config_read filled. */
void bst_config_free(const bst_config_desc *table, void *object);
/* Fills `object` with the table's defaults (every key must have one); for tests and typed callers.
 */
bst_status bst_config_defaults(bst_ctx *ctx, const bst_config_desc *table,
                               void *object) BST_MUST_CHECK;

/* Whether a key may be null. */
bool bst_config_is_open(const bst_config_desc *desc);
/* The object as JSON with every default written out; the caller frees with cJSON_Delete. NULL when
 * out of memory. For printing: numbers are raw items whose text reads back as the same bits. */
struct cJSON *bst_config_echo(const bst_config_desc *table, const void *object);
/* The JSON Schema (draft 2020-12) of a table as an object node; caller frees. */
struct cJSON *bst_config_schema(const bst_config_desc *table);

#pragma GCC visibility pop

#endif
