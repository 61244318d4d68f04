/* Command-line options by table: parsing, messages and the output of --help. */
#ifndef BST_CLI_OPTIONS_H
#define BST_CLI_OPTIONS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include "boresight/status.h"

typedef enum bst_option_kind {
    BST_OPTION_FLAG,   /* bool: set to true */
    BST_OPTION_TEXT,   /* const char *: points into argv */
    BST_OPTION_INT,    /* int64_t within minimum..maximum, both |x| <= 2^53 */
    BST_OPTION_REAL,   /* double within minimum..maximum */
    BST_OPTION_CHOICE, /* int: index of the word in `argument`, a list separated by '|' */
    BST_OPTION_LIST    /* bst_option_list: all given values, in order */
} bst_option_kind;

/* Use of the path in an option's value. Every option with argument FILE, FOLDER or RUN declares it:
 * outputs are checked (sim/cli/outputs.h) before the command begins. */
typedef enum bst_option_path {
    BST_PATH_NONE,
    BST_PATH_INPUT,        /* a file or folder that is read */
    BST_PATH_OUTPUT,       /* a file that is written */
    BST_PATH_OUTPUT_INTO,  /* a file that is written, or the folder for it */
    BST_PATH_OUTPUT_FOLDER /* a folder for output, created if necessary */
} bst_option_path;

enum { BST_OPTION_LIST_MAX = 256, BST_OPTIONS_MAX = 96 /* entries of a table */ };

typedef struct bst_option_list {
    const char *items[BST_OPTION_LIST_MAX]; /* point into argv */
    int count;
} bst_option_list;

/* One option. A table ends with name NULL. */
typedef struct bst_option {
    const char *name; /* without the dashes */
    bst_option_kind kind;
    void *target;         /* variable of the kind's type; unchanged if the option is not given */
    size_t offset;        /* offset of the target in a request, for bst_options_bind */
    const char *argument; /* name of the value in --help: "FILE"; CHOICE: "teme|gcrf" */
    const char *doc;      /* description, with default */
    bool required;
    double minimum, maximum; /* INT, REAL: decimal numbers */
    const char *needs;       /* required options, one of "frames|coco"; NULL: none */
    bst_option_path path;    /* TEXT, LIST */
} bst_option;

/* Copies a constant option table, including its end, to *out, and sets each target by its offset in
 * *request. */
void bst_options_bind(const bst_option *table, void *request, bst_option *out);

/* Reads argv[1] .. argv[argc - 1] into the table's targets. Forms: --name value, --name=value,
 * --flag; "--" ends the options. Other words are moved, in order, to argv[1] .. argv[*arguments];
 * with arguments NULL they are an error. "-h" is --help; after --help nothing is checked.
 * bst_outputs_check checks output paths.
 * Errors: BST_ERR_ARGUMENT with the remedy: unknown option (the nearest is suggested),
 *         missing value or option, value out of range, duplicate option (except flags and lists),
 *         two options with one target, or an option without the option that it needs. */
bst_status bst_options_parse(bst_ctx *ctx, const bst_option *table, int argc, char **argv,
                             int *arguments) BST_MUST_CHECK;

/* Checks that at most one of several options is given: names[i]: its name, or NULL if not given.
 * BST_ERR_ARGUMENT names the first two. */
bst_status bst_options_one_of(bst_ctx *ctx, const char *const *names, size_t count) BST_MUST_CHECK;

/* Prints the option table, one line per option. */
void bst_options_print(FILE *stream, const bst_option *table);

/* Prints "boresight COMMAND: message" and how to get help to standard error; returns 2, the exit
 * code for wrong usage. */
int bst_options_misuse(const bst_ctx *ctx, const char *command);

#endif
