#include "sim/io/side_table.h"

#include <assert.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "sim/core/file.h"
#include "sim/core/text_reader.h"

enum { MOST_COLUMNS = 512, PATH_ROOM = 4096, MOST_PAGE = 1 << 24, NAME_ROOM = 80 };
static const uint64_t MOST_BYTES = (uint64_t)1 << 30;

/* A row of the text. */
typedef struct row {
    size_t at, length; /* in the text */
    char *file;        /* owned */
    int page;          /* 0: none */
    int line;
} row;

struct bst_side_table {
    char *text, *scratch; /* scratch: of the longest line */
    char path[PATH_ROOM], folder[PATH_ROOM];
    char names[MOST_COLUMNS][NAME_ROOM];
    int columns, file, page; /* page -1: no such column */
    row *rows;
    int64_t count, room;
};

/* Fails at a line: "FILE: line 3: WHAT". */
static bst_status fail(bst_ctx *ctx, const bst_side_table *t, int line, const char *what) {
    return bst_fail(ctx, BST_ERR_FORMAT, "%.400s: line %d: %s", t->path, line, what);
}

/* Index of the first of several columns "A|B"; -1: none. */
static int find_column(const bst_side_table *t, const char *names) {
    for (const char *at = names; *at;) {
        size_t length = strcspn(at, "|");
        for (int i = 0; i < t->columns && length > 0; i++) {
            if (strlen(t->names[i]) == length && strncasecmp(t->names[i], at, length) == 0) {
                return i;
            }
        }
        at += length + (at[length] == '|');
    }
    return -1;
}

/* Reads the line of names. */
static bst_status read_names(bst_ctx *ctx, bst_side_table *t, const bst_text_line *line,
                             const bst_side_table_columns *columns) {
    bst_text_span fields[MOST_COLUMNS];
    char what[400];
    t->columns = bst_text_split_csv(line, t->scratch, fields, MOST_COLUMNS);
    if (t->columns < 0 || t->columns > MOST_COLUMNS) {
        snprintf(what, sizeof what,
                 "is no line of column names (allowed: up to %d, separated by "
                 "commas)",
                 MOST_COLUMNS);
        t->columns = 0;
        return fail(ctx, t, line->number, what);
    }
    if (t->columns == 1 && (memchr(fields[0].text, ';', fields[0].length) ||
                            memchr(fields[0].text, '\t', fields[0].length))) {
        t->columns = 0;
        return fail(ctx, t, line->number,
                    "has column names separated by semicolons or tabs (allowed: by commas)");
    }
    for (int i = 0; i < t->columns; i++) {
        bst_text_span name = bst_text_trimmed(fields[i]);
        if (name.length >= NAME_ROOM) {
            snprintf(what, sizeof what, "column %d: its name has %zu bytes (allowed: %d)", i + 1,
                     name.length, NAME_ROOM - 1);
            t->columns = i;
            return fail(ctx, t, line->number, what);
        }
        snprintf(t->names[i], NAME_ROOM, "%.*s", (int)name.length, name.text);
        for (int k = 0; k < i && *t->names[i]; k++) {
            if (strcasecmp(t->names[i], t->names[k]) == 0) {
                snprintf(what, sizeof what, "column %.80s: is there twice, as columns %d and %d",
                         t->names[i], k + 1, i + 1);
                return fail(ctx, t, line->number, what);
            }
        }
    }
    t->file = find_column(t, columns->file);
    t->page = find_column(t, columns->page);
    if (t->file < 0) {
        snprintf(what, sizeof what,
                 "has no column with the files' names (allowed: %.200s; `file_column` of a keyword "
                 "map)",
                 columns->file);
        return fail(ctx, t, line->number, what);
    }
    return BST_OK;
}

/* Adds a row. */
static bst_status add_row(bst_ctx *ctx, bst_side_table *t, const bst_text_line *line) {
    bst_text_span fields[MOST_COLUMNS];
    char what[400], name[PATH_ROOM], path[PATH_ROOM];
    int count = bst_text_split_csv(line, t->scratch, fields, MOST_COLUMNS), page = 0;
    if (count != t->columns) {
        snprintf(what, sizeof what,
                 count < 0 ? "has an unclosed quote, or text after one (allowed: RFC 4180)"
                           : "has %d fields, the first line has %d columns (allowed: as many)",
                 count, t->columns);
        return fail(ctx, t, line->number, what);
    }
    bst_text_span file = bst_text_trimmed(fields[t->file]);
    if (file.length == 0 || file.length >= sizeof name || memchr(file.text, '\0', file.length)) {
        snprintf(what, sizeof what, "column %.80s: %s (allowed: the path of a picture)",
                 t->names[t->file], file.length == 0 ? "is empty" : "is too long");
        return fail(ctx, t, line->number, what);
    }
    if (t->page >= 0) {
        bst_text_span text = bst_text_trimmed(fields[t->page]);
        if (!bst_text_count(text, MOST_PAGE, &page) || page < 1) {
            snprintf(what, sizeof what, "column %.80s: \"%.*s\" is no page (allowed: 1 to %d)",
                     t->names[t->page], (int)(text.length < 40 ? text.length : 40), text.text,
                     MOST_PAGE);
            return fail(ctx, t, line->number, what);
        }
    }
    if (t->count == t->room) {
        int64_t room = t->room ? 2 * t->room : 64;
        row *rows = realloc(t->rows, (size_t)room * sizeof *rows);
        if (!rows) {
            return bst_fail(ctx, BST_ERR_MEMORY, "%.400s: no memory for its rows", t->path);
        }
        t->rows = rows;
        t->room = room;
    }
    snprintf(name, sizeof name, "%.*s", (int)file.length, file.text);
    bst_file_resolve(t->folder, name, path, sizeof path);
    row *r = &t->rows[t->count];
    *r = (row){(size_t)(line->text - t->text), line->length, strdup(path), page, line->number};
    t->count += r->file != NULL;
    return r->file ? BST_OK
                   : bst_fail(ctx, BST_ERR_MEMORY, "%.400s: no memory for its rows", t->path);
}

static bst_status read_rows(bst_ctx *ctx, bst_side_table *t, size_t bytes,
                            const bst_side_table_columns *columns) {
    bst_text_cursor cursor = bst_text_start(t->text, bytes);
    bst_text_line line;
    size_t longest = 1;
    while (bst_text_next_line(&cursor, &line)) {
        longest = line.length > longest ? line.length : longest;
    }
    t->scratch = malloc(longest);
    if (!t->scratch) {
        return bst_fail(ctx, BST_ERR_MEMORY, "%.400s: no memory for its lines", t->path);
    }
    cursor = bst_text_start(t->text, bytes);
    bool named = false;
    while (bst_text_next_line(&cursor, &line)) {
        if (line.length == 0 || *line.text == '#') {
            continue;
        }
        BST_TRY(named ? add_row(ctx, t, &line) : read_names(ctx, t, &line, columns));
        named = true;
    }
    return t->count > 0 ? BST_OK
                        : bst_fail(ctx, BST_ERR_FORMAT,
                                   "%.400s: has no rows (allowed: a line of column names, then a "
                                   "row for each frame)",
                                   t->path);
}

bst_status bst_side_table_open(bst_ctx *ctx, const char *path,
                               const bst_side_table_columns *columns, bst_side_table **out) {
    assert(path && columns && columns->file && columns->page && out);
    *out = NULL;
    bst_side_table *t = calloc(1, sizeof *t);
    if (!t) {
        return bst_fail(ctx, BST_ERR_MEMORY, "%.400s: no memory to open it", path);
    }
    const char *slash = strrchr(path, '/');
    size_t bytes, length = slash ? (size_t)(slash - path) : 0;
    int n = snprintf(t->path, sizeof t->path, "%s", path);
    snprintf(t->folder, sizeof t->folder, "%.*s", slash ? (length ? (int)length : 1) : 1,
             slash ? path : ".");
    bst_status status =
        n < 0 || (size_t)n >= sizeof t->path
            ? bst_fail(ctx, BST_ERR_ARGUMENT, "%.80s...: the path is too long", path)
            : bst_file_read(ctx, path, MOST_BYTES, "a side table", &t->text, &bytes);
    status = status == BST_OK ? bst_file_check_text(ctx, path, t->text, bytes) : status;
    status = status == BST_OK ? read_rows(ctx, t, bytes, columns) : status;
    if (status != BST_OK) {
        bst_side_table_close(t);
        return status;
    }
    *out = t;
    return BST_OK;
}

void bst_side_table_close(bst_side_table *t) {
    if (t) {
        for (int64_t i = 0; i < t->count; i++) {
            free(t->rows[i].file);
        }
        free(t->rows);
        free(t->scratch);
        free(t->text);
        free(t);
    }
}

int64_t bst_side_table_count(const bst_side_table *t) {
    return t->count;
}

bst_side_table_row bst_side_table_at(const bst_side_table *t, int64_t index) {
    assert(index >= 0 && index < t->count);
    const row *r = &t->rows[index];
    return (bst_side_table_row){r->file, r->page, r->line};
}

const char *bst_side_table_file_column(const bst_side_table *t) {
    return t->names[t->file];
}

const char *bst_side_table_page_column(const bst_side_table *t) {
    return t->page < 0 ? "" : t->names[t->page];
}

bool bst_side_table_text(const bst_side_table *t, int64_t index, const char *column, char *value,
                         size_t bytes) {
    assert(index >= 0 && index < t->count && column && value && bytes > 0);
    int k = find_column(t, column);
    if (k < 0) {
        return false;
    }
    const row *r = &t->rows[index];
    bst_text_span fields[MOST_COLUMNS];
    const bst_text_line line = {t->text + r->at, r->length, r->line};
    if (bst_text_split_csv(&line, t->scratch, fields, MOST_COLUMNS) != t->columns) {
        return false;
    }
    bst_text_copy(fields[k], value, bytes);
    return true;
}
