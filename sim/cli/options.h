/* Command-line options by table: parsing, messages and the list that --help prints. */
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
    BST_OPTION_CHOICE, /* int: index of the word in `argument`, words separated by '|' */
    BST_OPTION_LIST    /* bst_option_list: every value given, in order */
} bst_option_kind;

/* What the value of an option names. Every option whose argument is FILE, FOLDER or RUN says so:
 * outputs are checked (sim/cli/outputs.h) before the command begins. */
typedef enum bst_option_path {
    BST_PATH_NONE,
    BST_PATH_INPUT,        /* a file or folder that is read */
    BST_PATH_OUTPUT,       /* a file that is written */
    BST_PATH_OUTPUT_INTO,  /* the same, or a folder that the file goes into */
    BST_PATH_OUTPUT_FOLDER /* a folder that is written into, made when missing */
} bst_option_path;

enum { BST_OPTION_LIST_MAX = 256, BST_OPTIONS_MAX = 96 /* entries of a table */ };

typedef struct bst_option_list {
    const char *items[BST_OPTION_LIST_MAX]; /* point into argv */
    int count;
} bst_option_list;

/* One option. Tables end with an entry whose name is NULL. */
typedef struct bst_option {
    const char *name; /* without the dashes */
    bst_option_kind kind;
    void *target;         /* of the kind's type; untouched when the option is not given */
    size_t offset;        /* of the target in a request, for bst_options_bind */
    const char *argument; /* what --help calls the value: "FILE"; CHOICE: "teme|gcrf" */
    const char *doc;      /* what it does, and the default where there is one */
    bool required;
    double minimum, maximum; /* INT, REAL: decimal numbers */
    const char *needs;       /* options of which one must be given too: "frames|coco"; NULL: none */
    bst_option_path path;    /* TEXT, LIST */
} bst_option;

/* Copies a table of constant data, its last entry too, to *out, and sets each target to the place
 * at the entry's offset in *request. */
void bst_options_bind(const bst_option *table, void *request, bst_option *out);

/* Reads argv[1] .. argv[argc - 1] into the table's targets. Forms: --name value, --name=value,
 * --flag; "--" ends the options. What is no option is moved, in order, to argv[1] ..
 * argv[*arguments]. With arguments NULL such a word is an error. "-h" stands for --help, and after
 * --help nothing is checked any more. What outputs name is checked by bst_outputs_check.
 * Errors: BST_ERR_ARGUMENT with a message that says what to do: an option is unknown (the nearest
 * is suggested), has no value or a value out of its range, is missing, stands twice (flags and
 * lists may), fills the same target as another one that is given, or has no effect because none of
 * those that it needs is given. */
bst_status bst_options_parse(bst_ctx *ctx, const bst_option *table, int argc, char **argv,
                             int *arguments) BST_MUST_CHECK;

/* That at most one of some options is given: names[i] is the i-th one's name, or NULL where it is
 * not given. BST_ERR_ARGUMENT with the first two that are. */
bst_status bst_options_one_of(bst_ctx *ctx, const char *const *names, size_t count) BST_MUST_CHECK;

/* Prints the options, one a line, aligned. */
void bst_options_print(FILE *stream, const bst_option *table);

/* Prints "boresight COMMAND: message" and where help is, on the standard error; returns 2, the exit
 * code of a command that was called wrongly. */
int bst_options_misuse(const bst_ctx *ctx, const char *command);

#endif
