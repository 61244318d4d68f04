/* Tables of stars as text with commas. */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "sim/catalogue/star_table_internal.h"
#include "sim/core/file.h"
#include "sim/core/text_reader.h"

/* Takes what the head of an ECSV file says: that it is one, what divides its columns, their units.
 */
static bst_status read_comment(bst_ctx *ctx, bst_star_table *t, const char *text) {
    if (strstr(text, "%ECSV")) {
        t->ecsv = t->blanks = true;
    } else if (strstr(text, "delimiter:") && strchr(text, ',')) {
        t->blanks = false;
    }
    const char *name = strstr(text, "name: "), *unit = strstr(text, "unit: ");
    if (t->ecsv && name && unit && t->unit_count < BST_STAR_TABLE_COLUMNS) {
        if (!t->units) {
            t->units = calloc(BST_STAR_TABLE_COLUMNS, sizeof *t->units);
        }
        if (!t->units) {
            return bst_fail(ctx, BST_ERR_MEMORY, "%s: out of memory", t->path);
        }
        bst_star_column_unit *one = &t->units[t->unit_count++];
        name += 6;
        unit += 6;
        snprintf(one->name, sizeof one->name, "%.*s", (int)strcspn(name, ",}"), name);
        snprintf(one->unit, sizeof one->unit, "%.*s", (int)strcspn(unit, ",}"), unit);
    }
    return BST_OK;
}

/* Makes commas of the blanks that divide a line, outside quotation marks. */
static void divide_by_commas(char *text) {
    bool quoted = false;
    for (; *text; text++) {
        quoted = quoted != (*text == '"');
        *text = *text == ' ' && !quoted ? ',' : *text;
    }
}

/* Reads the next line that is no comment and not empty; false: end of the file. */
static bst_status next_line(bst_ctx *ctx, bst_star_table *t, bst_text_line *line, bool *end) {
    *end = false;
    while (fgets(t->line, BST_STAR_TABLE_LINE, t->text)) {
        t->line_number++;
        size_t length = strlen(t->line);
        if (length + 1 == BST_STAR_TABLE_LINE) {
            return bst_fail(ctx, BST_ERR_FORMAT, "%s:%d: the line is longer than %d bytes", t->path,
                            t->line_number, BST_STAR_TABLE_LINE - 2);
        }
        /* a line that ends before its end: a zero byte, of which a file may have gigabytes */
        bool cut = (length == 0 || t->line[length - 1] != '\n') && !feof(t->text);
        BST_TRY(bst_file_check_text(ctx, t->path, t->line, length + cut));
        char *text = t->line;
        if (t->line_number == 1 && strncmp(text, "\xEF\xBB\xBF", 3) == 0) {
            text += 3; /* byte order mark */
        }
        *line = (bst_text_line){text, strlen(text), t->line_number};
        bst_text_trim_end(line);
        if (line->length > 0 && line->text[0] != '#') {
            text[line->length] = '\0';
            if (t->blanks) {
                divide_by_commas(text);
            }
            return BST_OK;
        }
        if (line->length > 0 && t->fields == 0) {
            BST_TRY(read_comment(ctx, t, text));
        }
    }
    *end = true;
    if (ferror(t->text)) {
        return bst_fail(ctx, BST_ERR_IO, "%s: cannot be read after line %d: %s", t->path,
                        t->line_number, strerror(errno));
    }
    if (t->unzips) {
        int code = bst_subprocess_wait(&t->unzip);
        t->unzips = false;
        t->text = NULL;
        if (code != 0) {
            return bst_fail(ctx, BST_ERR_FORMAT,
                            "%s: cannot be unpacked (gzip ended with %d) after line %d", t->path,
                            code, t->line_number);
        }
    }
    return BST_OK;
}

/* Splits a line into fields. */
static bst_status split(bst_ctx *ctx, const bst_star_table *t, const bst_text_line *line,
                        bst_text_span fields[BST_STAR_TABLE_COLUMNS], int *count) {
    *count = bst_text_split_csv(line, t->scratch, fields, BST_STAR_TABLE_COLUMNS);
    if (t->fields > 0 && *count >= 0 && *count != t->fields) {
        return bst_fail(ctx, BST_ERR_FORMAT, "%s:%d: %d fields, but %d names of columns", t->path,
                        line->number, *count, t->fields);
    }
    if (*count >= 0 && *count <= BST_STAR_TABLE_COLUMNS) {
        return BST_OK;
    }
    if (*count < 0) {
        return bst_fail(ctx, BST_ERR_FORMAT, "%s:%d: a quotation mark has no end, or text after it",
                        t->path, line->number);
    }
    return bst_fail(ctx, BST_ERR_FORMAT, "%s:%d: more than %d columns", t->path, line->number,
                    BST_STAR_TABLE_COLUMNS);
}

/* Checks the unit that the head of the file has for a column. */
static bst_status check_unit(bst_ctx *ctx, const bst_star_table *t, bst_star_quantity q) {
    for (int i = 0; i < t->unit_count; i++) {
        if (strcmp(t->units[i].name, t->name[q]) == 0) {
            return bst_star_unit_check(ctx, t, q, t->units[i].unit, strlen(t->units[i].unit));
        }
    }
    return BST_OK;
}

bst_status bst_star_text_open(bst_ctx *ctx, bst_star_table *t, bool gzip) {
    t->line = malloc(BST_STAR_TABLE_LINE);
    t->scratch = malloc(BST_STAR_TABLE_LINE);
    if (!t->line || !t->scratch) {
        return bst_fail(ctx, BST_ERR_MEMORY, "%s: out of memory", t->path);
    }
    if (gzip) {
        const char *argv[] = {"gzip", "-dc", "--", t->path, NULL};
        BST_TRY(bst_subprocess_start(ctx, argv, NULL, true, NULL, &t->unzip));
        t->unzips = true;
        t->text = t->unzip.output;
    } else {
        t->text = fopen(t->path, "r");
        if (!t->text) {
            return bst_fail(ctx, BST_ERR_IO, "%s: %s", t->path, strerror(errno));
        }
    }
    bst_text_line line;
    bool end;
    BST_TRY(next_line(ctx, t, &line, &end));
    if (end) {
        return bst_fail(ctx, BST_ERR_FORMAT, "%s: is empty; give a table with a line of names",
                        t->path);
    }
    bst_text_span fields[BST_STAR_TABLE_COLUMNS];
    int count;
    BST_TRY(split(ctx, t, &line, fields, &count));
    t->fields = count;
    for (int i = 0; i < count; i++) {
        if (t->source_column < 0 &&
            bst_star_name_is(bst_star_source_names, fields[i].text, fields[i].length)) {
            t->source_column = i;
        }
        for (int q = 0; q < BST_STAR_QUANTITIES; q++) {
            if (t->column[q] < 0 &&
                bst_star_name_is(bst_star_quantity_names[q], fields[i].text, fields[i].length)) {
                t->column[q] = i;
                bst_text_copy(fields[i], t->name[q], sizeof t->name[q]);
                BST_TRY(check_unit(ctx, t, (bst_star_quantity)q));
            }
        }
    }
    return BST_OK;
}

bool bst_star_field_is_empty(bst_text_span field) {
    static const char *const words[] = {"null", "nan", "--", "n/a", "none"};
    bool empty = field.length == 0;
    for (size_t i = 0; i < sizeof words / sizeof *words; i++) {
        empty = empty || (field.length == strlen(words[i]) &&
                          strncasecmp(field.text, words[i], field.length) == 0);
    }
    return empty;
}

bool bst_star_source_read(bst_text_span field, int64_t *out) {
    bool negative = field.length > 1 && field.text[0] == '-';
    int64_t value = 0;
    for (size_t i = negative; i < field.length; i++) {
        if (field.text[i] < '0' || field.text[i] > '9' ||
            value > (INT64_MAX - (field.text[i] - '0')) / 10) {
            return false;
        }
        value = 10 * value + (field.text[i] - '0');
    }
    *out = negative ? -value : value;
    return field.length > 0;
}

bst_status bst_star_text_next(bst_ctx *ctx, bst_star_table *t, int64_t *source,
                              double value[BST_STAR_QUANTITIES], bool *end) {
    *end = t->text == NULL;
    bst_text_line line;
    if (!*end) {
        BST_TRY(next_line(ctx, t, &line, end));
    }
    if (*end) {
        return BST_OK;
    }
    bst_text_span fields[BST_STAR_TABLE_COLUMNS];
    int count;
    BST_TRY(split(ctx, t, &line, fields, &count));
    const bst_text_source where = {ctx, t->path};
    *source = 0; /* also for names */
    for (int q = 0; q < BST_STAR_QUANTITIES; q++) {
        value[q] = NAN;
        if (t->column[q] >= 0 && t->column[q] < count) {
            bst_text_span field = fields[t->column[q]];
            if (!bst_star_field_is_empty(field) && !bst_text_number(field, &value[q])) {
                char problem[112];
                snprintf(problem, sizeof problem, "bad number in column %s", t->name[q]);
                return bst_text_fail_at(&where, &line, problem, field.text, field.length,
                                        "a decimal number, or nothing");
            }
        }
    }
    if (t->source_column >= 0 && t->source_column < count) {
        (void)bst_star_source_read(fields[t->source_column], source);
    }
    return BST_OK;
}
