/* A stage: a part of a module that a plug-in can replace. The kinds of stages and their functions
 * are in include/boresight/stages.h. */
#ifndef BORESIGHT_STAGE_H
#define BORESIGHT_STAGE_H

#include "boresight/archive.h"
#include "boresight/config.h"

#pragma GCC visibility push(default)

#define BST_STAGE_ABI 2

typedef struct bst_stage_desc {
    uint32_t abi;     /* BST_STAGE_ABI */
    const char *kind; /* BST_STAGE_DETECTOR, ... */
    const char *type; /* the plug-in's name of the stage */
    const char *doc;
    const bst_config_desc *config; /* keys that a scenario may set beside "plugin"; NULL: none */
    size_t config_bytes;
    const void *functions; /* struct of the kind */
} bst_stage_desc;

/* Member of a module's configuration for a stage that a plug-in may replace. Its entry in the table
 * is BST_STAGE(my_config, plugin, kinds, "..."), where kinds is {name of the kind, NULL}. If the
 * key is given, the object may also contain "type" and the plug-in's own keys; its other members
 * keep their defaults. */
typedef struct bst_stage_use {
    char plugin[512];           /* path of the library; "": no plug-in */
    const bst_stage_desc *desc; /* NULL: no plug-in */
    void *config;               /* desc->config_bytes, filled; lives with the scenario */
} bst_stage_use;

#define BST_STAGE(s, m, kinds_, doc_)                                                          \
    {                                                                                          \
        .key = "plugin", .type = BST_CONFIG_STAGE, .unit = "", .doc = doc_, .choices = kinds_, \
        BST_FIELD_(s, m)                                                                       \
    }

/* As BST_STAGE, in a table that fills only a bst_stage_use. */
#define BST_STAGE_ALONE(kinds_, doc_)                                                          \
    {                                                                                          \
        .key = "plugin", .type = BST_CONFIG_STAGE, .unit = "", .doc = doc_, .choices = kinds_, \
        .size = sizeof(bst_stage_use)                                                          \
    }

/* Archives the state of a plug-in's stage.
 *
 * Given:     plugin    path of the library, for messages
 *            function  member `archive` of the stage's functions; NULL: the stage has none
 *            self      first argument of the function
 * Errors:    BST_ERR_STATE without a function; those of the function, with the plug-in's name */
bst_status bst_stage_archive(bst_archive *archive, const char *plugin,
                             bst_status (*function)(void *self, bst_archive *archive),
                             void *self) BST_MUST_CHECK;

/* Opens libraries for bst_stage_read_config. */
typedef struct bst_stage_loader {
    void *user;
    /* Finds the stage `type` (NULL: the only one) of `kind` in the library `plugin`, the text at
     * the JSON pointer `path`. Stores it in *out, and the library's full path in file[bytes]. *out
     * NULL: the block is not read. Messages name `path`. */
    bst_status (*load)(void *user, bst_ctx *ctx, const bst_json *json, const char *path,
                       const char *plugin, const char *kind, const char *type,
                       const bst_stage_desc **out, char *file, size_t bytes);
} bst_stage_loader;

/* bst_config_read for a table that may contain stages of plug-ins.
 *
 * Given:     json, node, path, table  as bst_config_read
 *            loader                   opens the libraries of plug-ins; NULL: a plug-in is an error
 * Returned:  object  the struct, zeroed first; free its lists with bst_config_free
 * Errors:    those of bst_config_read and of the loader */
bst_status bst_stage_read_config(bst_ctx *ctx, const bst_json *json, const struct cJSON *node,
                                 const char *path, const bst_config_desc *table,
                                 const bst_stage_loader *loader, void *object) BST_MUST_CHECK;

#pragma GCC visibility pop

#endif
