/* Former names of keys in a whole document, before values are merged into it. */
#ifndef BST_CORE_FORMER_NAMES_H
#define BST_CORE_FORMER_NAMES_H

#include <stdbool.h>

#include "boresight/config.h"

/* The tables of one kind of document.
 *
 * `inside` gives table number `index` (0, 1, ...) of an object in the value of the RAW key `raw`:
 * the object at `key` of that value, or the value itself where `key` is NULL. `node` is that object
 * where it is known, else NULL. NULL: there are no more tables. */
typedef struct bst_document_tables {
    const bst_config_desc *root;
    const bst_config_desc *(*inside)(const void *user, const char *raw, const char *key,
                                     const struct cJSON *node, int index); /* may be NULL */
    const void *user;
} bst_document_tables;

/* Replaces every former name in a document by the present one and attaches the tables:
 * bst_json_assign and bst_json_set accept former names in their pointers and values from then on.
 *
 * Given:     tables  live as long as the document
 *            warn    log a warning for each occurrence: "FILE: /path: former name, now KEY"
 * Errors:    BST_ERR_CONFIG if an object has a key under both names, BST_ERR_MEMORY
 * Notes:     An object that names a plug-in keeps its keys: the plug-in's tables are not known
 *            here, and bst_config_read accepts their former names. */
bst_status bst_json_describe(bst_ctx *ctx, bst_json *json, const bst_document_tables *tables,
                             bool warn) BST_MUST_CHECK;

/* True if a document has tables (bst_json_describe). */
bool bst_json_is_described(const bst_json *json);

/* bst_json_load_extended of a described document: former names may stand in all of the files. */
bst_status bst_json_load_described(bst_ctx *ctx, const char *path,
                                   const bst_document_tables *tables,
                                   bst_json **out) BST_MUST_CHECK;

/* bst_json_load_described of a text. Files that it extends are relative to the folder of `name`. */
bst_status bst_json_parse_described(bst_ctx *ctx, const char *name, const char *text,
                                    const bst_document_tables *tables,
                                    bst_json **out) BST_MUST_CHECK;

/* Replaces the former names in a JSON pointer and in the value that belongs there.
 *
 * Given:     tables   NULL: nothing is replaced
 *            root     document that the pointer leads into; NULL: not known
 *            pointer  JSON pointer
 *            value    what is to be assigned there; NULL: nothing. Its keys are replaced in place
 *            where    beginning of each warning, before ": "; NULL: no warnings
 * Returned:  *out  the pointer in present names
 * Errors:    as bst_json_describe
 * Ownership: free *out */
bst_status bst_json_present_pointer(bst_ctx *ctx, const bst_document_tables *tables,
                                    const struct cJSON *root, const char *pointer,
                                    struct cJSON *value, const char *where,
                                    char **out) BST_MUST_CHECK;

/* Checks that an object of values by JSON pointer gives none under a former and the present name.
 *
 * Given:     tables, root  as bst_json_present_pointer
 *            set           the object; NULL: nothing to check
 *            file          file that has it as "set", for the message
 * Errors:    BST_ERR_CONFIG, BST_ERR_MEMORY */
bst_status bst_json_check_set(bst_ctx *ctx, const bst_document_tables *tables,
                              const struct cJSON *root, const struct cJSON *set,
                              const char *file) BST_MUST_CHECK;

#endif
