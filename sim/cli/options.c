#include "sim/cli/options.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/cli/outputs.h"
#include "sim/core/text.h"

static const bst_option *find(const bst_option *table, const char *name, size_t length) {
    for (const bst_option *o = table; o->name; o++) {
        if (strlen(o->name) == length && strncmp(o->name, name, length) == 0) {
            return o;
        }
    }
    return NULL;
}

/* Fails on an unknown option and suggests the nearest one. */
static bst_status unknown(bst_ctx *ctx, const bst_option *table, const char *word) {
    char name[64];
    size_t dashes = strspn(word, "-");
    snprintf(name, sizeof name, "%.*s", (int)strcspn(word + dashes, "="), word + dashes);
    const bst_option *nearest = NULL;
    size_t best = SIZE_MAX;
    for (const bst_option *o = table; o->name; o++) {
        if (bst_text_is_nearer(name, o->name, &best)) {
            nearest = o;
        }
    }
    if (nearest) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "unknown option %.80s; did you mean --%s?", word,
                        nearest->name);
    }
    return bst_fail(ctx, BST_ERR_ARGUMENT, "unknown option %.80s", word);
}

static bst_status read_number(bst_ctx *ctx, const bst_option *o, const char *text, double *out) {
    char *end;
    double value = strtod(text, &end);
    bool is_int = o->kind == BST_OPTION_INT;
    /* strtod also accepts leading spaces, hexadecimal digits and names */
    bool decimal = text[strspn(text, "+-.0123456789eE")] == '\0';
    if (decimal && end != text && !*end && isfinite(value) && !(is_int && value != floor(value)) &&
        value >= o->minimum && value <= o->maximum) {
        *out = value;
        return BST_OK;
    }
    return is_int ? bst_fail(ctx, BST_ERR_ARGUMENT, "--%s %.80s: give an integer from %.0f to %.0f",
                             o->name, text, o->minimum, o->maximum)
                  : bst_fail(ctx, BST_ERR_ARGUMENT, "--%s %.80s: give a number from %.15g to %.15g",
                             o->name, text, o->minimum, o->maximum);
}

static bst_status read_choice(bst_ctx *ctx, const bst_option *o, const char *text) {
    int index = 0;
    for (const char *word = o->argument;; index++) {
        size_t length = strcspn(word, "|");
        if (strlen(text) == length && strncmp(word, text, length) == 0) {
            *(int *)o->target = index;
            return BST_OK;
        }
        if (!word[length]) {
            return bst_fail(ctx, BST_ERR_ARGUMENT, "--%s %.80s: give one of %s", o->name, text,
                            o->argument);
        }
        word += length + 1;
    }
}

/* Stores the value of a command line option. */
static bst_status store(bst_ctx *ctx, const bst_option *o, const char *value) {
    double number = 0.0;
    switch (o->kind) {
        case BST_OPTION_FLAG:
            *(bool *)o->target = true;
            return BST_OK;
        case BST_OPTION_TEXT:
            if (!*value) {
                return bst_fail(ctx, BST_ERR_ARGUMENT, "--%s needs a value: --%s %s", o->name,
                                o->name, o->argument);
            }
            *(const char **)o->target = value;
            return BST_OK;
        case BST_OPTION_INT:
            BST_TRY(read_number(ctx, o, value, &number));
            *(int64_t *)o->target = (int64_t)number;
            return BST_OK;
        case BST_OPTION_REAL:
            BST_TRY(read_number(ctx, o, value, &number));
            *(double *)o->target = number;
            return BST_OK;
        case BST_OPTION_CHOICE:
            return read_choice(ctx, o, value);
        case BST_OPTION_LIST: {
            bst_option_list *list = o->target;
            if (list->count == BST_OPTION_LIST_MAX) {
                return bst_fail(ctx, BST_ERR_ARGUMENT, "--%s is given more than %d times", o->name,
                                BST_OPTION_LIST_MAX);
            }
            list->items[list->count++] = value;
            return BST_OK;
        }
    }
    return bst_fail(ctx, BST_ERR_ARGUMENT, "--%s: option of unknown kind", o->name);
}

/* Parses the option at argv[*i] with its value; *i: last word used. */
static bst_status read_option(bst_ctx *ctx, const bst_option *table, int argc, char **argv, int *i,
                              const bst_option **out) {
    const char *word = argv[*i];
    const char *name = strcmp(word, "-h") == 0 ? "help" : word + 2;
    size_t length = strcspn(name, "=");
    const bst_option *o = word[1] == '-' || name != word + 2 ? find(table, name, length) : NULL;
    if (!o) {
        return unknown(ctx, table, word);
    }
    *out = o;
    const char *value = name[length] == '=' ? name + length + 1 : NULL;
    if (o->kind == BST_OPTION_FLAG) {
        return value ? bst_fail(ctx, BST_ERR_ARGUMENT, "--%s takes no value", o->name)
                     : store(ctx, o, "");
    }
    if (!value) {
        if (*i + 1 >= argc || strncmp(argv[*i + 1], "--", 2) == 0) {
            return bst_fail(ctx, BST_ERR_ARGUMENT, "--%s needs a value: --%s %s", o->name, o->name,
                            o->argument);
        }
        value = argv[++*i];
    }
    return store(ctx, o, value);
}

/* Rejects a table in which a file option does not declare whether it is written: a programming
 * error that must be found early. */
static bst_status check_table(bst_ctx *ctx, const bst_option *table) {
    static const char *const names[] = {"FILE", "FOLDER", "RUN", "PATH"};
    for (const bst_option *o = table; o->name; o++) {
        bool text = o->kind == BST_OPTION_TEXT || o->kind == BST_OPTION_LIST;
        for (size_t i = 0; text && i < sizeof names / sizeof *names; i++) {
            if (strcmp(o->argument, names[i]) == 0 && o->path == BST_PATH_NONE) {
                return bst_fail(ctx, BST_ERR_STATE,
                                "--%s: the program's table does not say whether %s is read or "
                                "written; please report this",
                                o->name, o->argument);
            }
        }
        if (o - table == BST_OPTIONS_MAX) {
            return bst_fail(ctx, BST_ERR_STATE, "more than %d options in a table", BST_OPTIONS_MAX);
        }
    }
    return BST_OK;
}

static bool names_option(const char *list, const char *name) {
    size_t length = strlen(name);
    for (const char *word = list; word; word = strchr(word, '|'), word += word ? 1 : 0) {
        if (strcspn(word, "|") == length && strncmp(word, name, length) == 0) {
            return true;
        }
    }
    return false;
}

/* Formats alternatives: "--frames, --coco or --yolo" from "frames|coco|yolo". */
static void list_needed(const char *needs, char *out, size_t bytes) {
    size_t used = 0;
    for (const char *word = needs; *word && used < bytes;) {
        size_t length = strcspn(word, "|");
        const char *next = word + length + (word[length] == '|');
        const char *join = word == needs ? "" : strchr(next, '|') || *next ? ", " : " or ";
        int n = snprintf(out + used, bytes - used, "%s--%.*s", join, (int)length, word);
        used += n > 0 ? (size_t)n : 0;
        word = next;
    }
}

/* Checks combinations of options: duplicates and required ones. */
static bst_status check_together(bst_ctx *ctx, const bst_option *table, const bool *given) {
    for (const bst_option *o = table; o->name; o++) {
        if (o->required && !given[o - table]) {
            return bst_fail(ctx, BST_ERR_ARGUMENT, "--%s is missing: add --%s %s", o->name, o->name,
                            o->argument);
        }
        bool needed = !o->needs || !given[o - table];
        for (const bst_option *p = table; p->name; p++) {
            if (p < o && p->target == o->target && given[p - table] && given[o - table]) {
                return bst_fail(ctx, BST_ERR_ARGUMENT,
                                "--%s and --%s are the same: give one of them", p->name, o->name);
            }
            needed = needed || (given[p - table] && names_option(o->needs, p->name));
        }
        if (!needed) {
            char list[200] = "";
            list_needed(o->needs, list, sizeof list);
            return bst_fail(ctx, BST_ERR_ARGUMENT,
                            "--%s has no effect without %s: add it or leave "
                            "--%s out",
                            o->name, list, o->name);
        }
    }
    return BST_OK;
}

void bst_options_bind(const bst_option *table, void *request, bst_option *out) {
    for (; table->name; table++) {
        *out = *table;
        out++->target = (char *)request + table->offset;
    }
    *out = *table;
}

bst_status bst_options_parse(bst_ctx *ctx, const bst_option *table, int argc, char **argv,
                             int *arguments) {
    bool given[BST_OPTIONS_MAX] = {false};
    int kept = 0;
    BST_TRY(check_table(ctx, table));
    bool options_end = false;
    for (int i = 1; i < argc; i++) {
        char *word = argv[i];
        if (!options_end && strcmp(word, "--") == 0) {
            options_end = true;
        } else if (!options_end && word[0] == '-' && word[1]) {
            const bst_option *o = NULL;
            BST_TRY(read_option(ctx, table, argc, argv, &i, &o));
            if (strcmp(o->name, "help") == 0) {
                return BST_OK;
            }
            bool may_repeat = o->kind == BST_OPTION_FLAG || o->kind == BST_OPTION_LIST;
            if (given[o - table] && !may_repeat) {
                return bst_fail(ctx, BST_ERR_ARGUMENT, "--%s is given twice: give it once",
                                o->name);
            }
            given[o - table] = true;
        } else if (!arguments) {
            return bst_fail(ctx, BST_ERR_ARGUMENT,
                            "\"%.80s\" is not expected here: every value follows its option", word);
        } else {
            argv[++kept] = word;
        }
    }
    BST_TRY(check_together(ctx, table, given));
    if (arguments) {
        *arguments = kept;
    }
    return bst_outputs_check(ctx, table, given, kept, argv + 1);
}

bst_status bst_options_one_of(bst_ctx *ctx, const char *const *names, size_t count) {
    const char *first = NULL;
    for (size_t i = 0; i < count; i++) {
        if (first && names[i]) {
            return bst_fail(ctx, BST_ERR_ARGUMENT,
                            "--%s and --%s exclude each other: give one of them", first, names[i]);
        }
        first = first ? first : names[i];
    }
    return BST_OK;
}

void bst_options_print(FILE *stream, const bst_option *table) {
    int width = 0;
    for (const bst_option *o = table; o->name; o++) {
        int length = (int)(strlen(o->name) + (o->argument ? strlen(o->argument) + 1 : 0));
        width = length > width ? length : width;
    }
    for (const bst_option *o = table; o->name; o++) {
        int length = fprintf(stream, "  --%s%s%s", o->name, o->argument ? " " : "",
                             o->argument ? o->argument : "");
        fprintf(stream, "%*s  %s\n", width + 4 - length, "", o->doc);
    }
}

int bst_options_misuse(const bst_ctx *ctx, const char *command) {
    fprintf(stderr,
            "boresight %s: %s\n"
            "Try: boresight %s --help\n",
            command, ctx->message, command);
    return 2;
}
