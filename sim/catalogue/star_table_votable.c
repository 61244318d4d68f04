/* Tables of stars in VOTable files (IVOA Recommendation VOTable 1.4, 2019; binary rows:
 * sections 5.2 to 5.4): the first table of the file, in chunks of the file. Nothing outside the
 * file is read: entities, document types and links are refused. */
#include <ctype.h>
#include <errno.h>
#include <expat.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "sim/catalogue/star_table_internal.h"
#include "sim/catalogue/votable_field.h"
#include "sim/core/file.h"
#include "sim/core/text_reader.h"

enum { CHUNK = 1 << 16, MOST_DEPTH = 64, MOST_TAG = 1 << 20, CELL = 128 };

/* Most elements of an item of a variable array: bytes of 2^32 - 1 items, which is the most that a
 * row can state, do not exceed 64 bits. */
enum { MOST_ELEMENTS = (1 << 28) - 1 };

typedef struct star_row {
    int64_t source;
    double value[BST_STAR_QUANTITIES];
} star_row;

typedef enum place { BEFORE, FIELDS, DATA, CELLS, STREAM, AFTER } place;

struct bst_star_votable {
    XML_Parser parser;
    FILE *file;
    bst_ctx *ctx; /* of the present call */
    bst_star_table *table;
    bst_status status; /* of a handler that failed */
    place place;
    int depth;
    long long fed;
    bst_votable_field fields[BST_STAR_TABLE_COLUMNS];
    int field_count;
    bool in_field; /* a FIELD is open, not a PARAM or a GROUP */
    bool wanted[BST_STAR_TABLE_COLUMNS];
    star_row row; /* that is being read */
    long long row_number;
    /* cells of TABLEDATA */
    int column;
    bool in_cell, in_row;
    char cell[CELL];
    size_t cell_length;
    /* bytes of BINARY and BINARY2 */
    bool binary, null_mask;
    uint32_t group;
    int digits, padding;
    unsigned char mask[BST_STAR_TABLE_COLUMNS / 8], item[8];
    size_t have;    /* bytes of the mask or item */
    int at;         /* field that is read; -1: mask */
    bool counting;  /* the number of items comes before the array */
    uint64_t skip;  /* bytes of an array that remain */
    star_row *rows; /* of the latest chunk */
    int row_count, row_next, row_capacity;
};

static void stop(bst_star_votable *v, bst_status status) {
    if (v->status == BST_OK) {
        v->status = status;
        XML_StopParser(v->parser, XML_FALSE);
    }
}

/* Expat 2.9 deprecates the functions of the width of a long. */
#if XML_MAJOR_VERSION > 2 || XML_MINOR_VERSION >= 9
#define LINE_NUMBER XML_GetCurrentLineNumber64
#define BYTE_INDEX XML_GetCurrentByteIndex64
#else
#define LINE_NUMBER XML_GetCurrentLineNumber
#define BYTE_INDEX XML_GetCurrentByteIndex
#endif

static unsigned long line_of(const bst_star_votable *v) {
    return (unsigned long)LINE_NUMBER(v->parser);
}

/* Stops with a message of the present line. */
static void fail_here(bst_star_votable *v, const char *what) {
    stop(v, bst_fail(v->ctx, BST_ERR_FORMAT, "%s:%lu: %s", v->table->path, line_of(v), what));
}

/* Name without its namespace. */
static const char *plain_name(const char *name) {
    const char *colon = strrchr(name, ':');
    return colon ? colon + 1 : name;
}

/* Value of an attribute; NULL: not there. */
static const char *attribute(const char **attributes, const char *name) {
    for (; attributes[0]; attributes += 2) {
        if (strcmp(attributes[0], name) == 0) {
            return attributes[1];
        }
    }
    return NULL;
}

/* ---------------------------------------------------------------- fields */

static void add_field(bst_star_votable *v, const char **attributes) {
    bst_star_table *t = v->table;
    const char *name = attribute(attributes, "name"), *type = attribute(attributes, "datatype");
    const char *size = attribute(attributes, "arraysize"), *unit = attribute(attributes, "unit");
    name = name ? name : attribute(attributes, "ID");
    name = name ? name : "";
    if (v->field_count == BST_STAR_TABLE_COLUMNS) {
        stop(v, bst_fail(v->ctx, BST_ERR_FORMAT, "%s:%lu: more than %d columns", t->path,
                         line_of(v), BST_STAR_TABLE_COLUMNS));
        return;
    }
    const int index = v->field_count++;
    bst_votable_field *f = &v->fields[index];
    *f = (bst_votable_field){.quantity = -1, .fixed = 1};
    f->type = bst_votable_datatype(type ? type : "", &f->size);
    if (f->size < 0 || (size && !bst_votable_read_size(size, f))) {
        stop(v, bst_fail(v->ctx, BST_ERR_FORMAT,
                         "%s:%lu: column %.64s: datatype \"%.40s\" with arraysize \"%.40s\" is not "
                         "one of VOTable's",
                         t->path, line_of(v), name, type ? type : "", size ? size : ""));
        return;
    }
    if (f->variable && f->fixed > MOST_ELEMENTS) {
        stop(v, bst_fail(v->ctx, BST_ERR_FORMAT,
                         "%s:%lu: column %.64s: arraysize \"%.40s\" has more than %d elements in "
                         "each item; allowed: up to %d before the \"*\"",
                         t->path, line_of(v), name, size, MOST_ELEMENTS, MOST_ELEMENTS));
        return;
    }
    const size_t length = strlen(name);
    const bool number =
        f->type != BST_VOTABLE_OTHER && f->type != BST_VOTABLE_BIT && f->fixed == 1 && !f->variable;
    const bool whole = number && f->type != BST_VOTABLE_FLOAT && f->type != BST_VOTABLE_DOUBLE;
    if (t->source_column < 0 && whole && bst_star_name_is(bst_star_source_names, name, length)) {
        t->source_column = index;
        v->wanted[index] = true;
    }
    for (int q = 0; q < BST_STAR_QUANTITIES; q++) {
        if (t->column[q] >= 0 || !bst_star_name_is(bst_star_quantity_names[q], name, length)) {
            continue;
        }
        if (!number) {
            stop(v, bst_fail(v->ctx, BST_ERR_FORMAT,
                             "%s: column %s does not hold one number in each row, or of a type "
                             "that is not read",
                             t->path, name));
            return;
        }
        t->column[q] = index;
        f->quantity = q;
        v->wanted[index] = true;
        snprintf(t->name[q], sizeof t->name[q], "%s", name);
        bst_status status = bst_star_unit_check(v->ctx, t, (bst_star_quantity)q, unit ? unit : "",
                                                unit ? strlen(unit) : 0);
        if (status != BST_OK) {
            stop(v, status);
        }
        return;
    }
}

/* ---------------------------------------------------------------- rows */

static void begin_row(bst_star_votable *v) {
    v->row.source = 0;
    for (int q = 0; q < BST_STAR_QUANTITIES; q++) {
        v->row.value[q] = NAN;
    }
    v->row_number++;
}

static void end_row(bst_star_votable *v) {
    if (v->row_count == v->row_capacity) { /* bounded by the bytes of a chunk */
        const int capacity = v->row_capacity ? 2 * v->row_capacity : 1024;
        star_row *more = realloc(v->rows, (size_t)capacity * sizeof *more);
        if (!more) {
            stop(v, bst_fail(v->ctx, BST_ERR_MEMORY, "%s: out of memory", v->table->path));
            return;
        }
        v->rows = more;
        v->row_capacity = capacity;
    }
    v->rows[v->row_count++] = v->row;
}

/* Takes the text of a cell. */
static void end_cell(bst_star_votable *v) {
    const bst_votable_field *f = &v->fields[v->column];
    bst_star_table *t = v->table;
    char *text = v->cell;
    size_t length = v->cell_length;
    for (; length > 0 && isspace((unsigned char)text[length - 1]); length--) {
    }
    for (; length > 0 && isspace((unsigned char)*text); text++, length--) {
    }
    text[length] = '\0';
    const bst_text_span span = {text, length};
    if (bst_star_field_is_empty(span) || (f->has_null && strcmp(text, f->null) == 0)) {
        return;
    }
    if (v->column == t->source_column) {
        (void)bst_star_source_read(span, &v->row.source);
    }
    const bool infinite = strcasecmp(text + (*text == '+' || *text == '-'), "inf") == 0;
    if (f->quantity < 0 || infinite) {
        return;
    }
    if (v->cell_length == CELL - 1 || !bst_text_number(span, &v->row.value[f->quantity])) {
        stop(v, bst_fail(v->ctx, BST_ERR_FORMAT,
                         "%s:%lu: row %lld: bad number in column %s: \"%.40s\"; allowed: a decimal "
                         "number, or nothing",
                         t->path, line_of(v), v->row_number, t->name[f->quantity], text));
    }
}

/* ---------------------------------------------------------------- binary rows */

static void take_item(bst_star_votable *v) {
    const bst_votable_field *f = &v->fields[v->at];
    int64_t whole, none;
    double value = bst_votable_number(f, v->item, &whole);
    if (v->null_mask && v->mask[v->at / 8] & 0x80 >> v->at % 8) {
        return;
    }
    if (f->has_null && f->type != BST_VOTABLE_FLOAT && f->type != BST_VOTABLE_DOUBLE &&
        bst_votable_read_integer(f->null, &none) && none == whole) {
        return;
    }
    if (v->at == v->table->source_column) {
        v->row.source = whole;
    }
    if (f->quantity >= 0) {
        v->row.value[f->quantity] = isfinite(value) ? value : NAN;
    }
}

/* Prepares the next field, or the next row after the last one. */
static void next_field(bst_star_votable *v) {
    v->have = 0;
    v->skip = 0;
    v->counting = false;
    if (++v->at == v->field_count) {
        end_row(v);
        v->at = v->null_mask ? -1 : 0;
        begin_row(v);
    }
    if (v->at >= 0 && !v->wanted[v->at]) {
        const bst_votable_field *f = &v->fields[v->at];
        v->counting = f->variable;
        v->skip = f->variable ? 0 : bst_votable_bytes(f, f->fixed);
    }
}

/* Takes a byte of the rows. */
static void take_byte(bst_star_votable *v, unsigned char byte) {
    if (v->at < 0) {
        v->mask[v->have++] = byte;
        if (v->have == ((size_t)v->field_count + 7) / 8) {
            next_field(v);
        }
        return;
    }
    const bst_votable_field *f = &v->fields[v->at];
    if (v->skip > 0) {
        if (--v->skip == 0) {
            next_field(v);
        }
        return;
    }
    v->item[v->have++] = byte;
    if (v->counting && v->have == 4) {
        const uint64_t items = (uint64_t)v->item[0] << 24 | (uint64_t)v->item[1] << 16 |
                               (uint64_t)v->item[2] << 8 | v->item[3];
        v->counting = false;
        v->have = 0;
        v->skip = bst_votable_bytes(f, items * f->fixed);
        if (v->skip == 0) {
            next_field(v);
        }
    } else if (!v->counting && v->have == (size_t)f->size) {
        take_item(v);
        next_field(v);
    }
}

/* Takes base64 text (RFC 4648, section 4), with any white space. */
static void take_base64(bst_star_votable *v, const char *text, int length) {
    for (int i = 0; i < length && v->status == BST_OK; i++) {
        const char c = text[i];
        if (isspace((unsigned char)c)) {
            continue;
        }
        int digit = c >= 'A' && c <= 'Z'   ? c - 'A'
                    : c >= 'a' && c <= 'z' ? c - 'a' + 26
                    : c >= '0' && c <= '9' ? c - '0' + 52
                    : c == '+'             ? 62
                    : c == '/'             ? 63
                                           : -1;
        const bool pad = c == '=' && v->digits >= 2;
        if ((digit < 0 && !pad) || (v->padding > 0 && !pad)) {
            fail_here(v, "the STREAM is not base64");
            return;
        }
        v->padding += pad;
        v->group = v->group << 6 | (uint32_t)(pad ? 0 : digit);
        if (++v->digits == 4) {
            for (int k = 0; k < 3 - v->padding && v->status == BST_OK; k++) {
                take_byte(v, (unsigned char)(v->group >> (16 - 8 * k)));
            }
            v->digits = 0;
            v->group = 0;
        }
    }
}

/* ---------------------------------------------------------------- elements */

static void begin_stream(bst_star_votable *v, const char **attributes) {
    const char *encoding = attribute(attributes, "encoding");
    if (attribute(attributes, "href")) {
        fail_here(v,
                  "the STREAM refers to another file by href; only data within the file are read");
    } else if (!encoding || strcmp(encoding, "base64") != 0) {
        fail_here(v, "the STREAM has another encoding than base64");
    } else if (v->field_count == 0) {
        fail_here(v, "rows of a table without FIELD");
    } else {
        v->place = STREAM;
        v->at = -1;
        begin_row(v);
        if (!v->null_mask) {
            next_field(v);
        }
    }
}

static void start_element(void *user, const char *full, const char **attributes) {
    bst_star_votable *v = user;
    const char *name = plain_name(full);
    if (++v->depth > MOST_DEPTH) {
        fail_here(v, "elements are nested more than 64 deep");
    } else if (v->depth == 1 && strcmp(name, "VOTABLE") != 0) {
        fail_here(v, "is XML, but no VOTABLE");
    } else if (strcmp(name, "INFO") == 0) {
        const char *key = attribute(attributes, "name"), *value = attribute(attributes, "value");
        if (key && value && strcmp(key, "QUERY_STATUS") == 0) {
            if (strcmp(value, "ERROR") == 0) {
                fail_here(v, "the query that made it has failed (QUERY_STATUS is ERROR)");
            } else if (strcmp(value, "OVERFLOW") == 0) {
                bst_log(v->ctx, BST_LOG_WARNING,
                        "%s: the query's result was cut off (QUERY_STATUS is OVERFLOW): stars are "
                        "missing",
                        v->table->path);
            }
        }
    } else if (v->place == BEFORE && strcmp(name, "TABLE") == 0) {
        v->place = FIELDS;
    } else if (v->place == FIELDS && strcmp(name, "FIELD") == 0) {
        v->in_field = true;
        add_field(v, attributes);
    } else if (v->place == FIELDS && strcmp(name, "VALUES") == 0 && v->in_field) {
        const char *null = attribute(attributes, "null");
        bst_votable_field *f = &v->fields[v->field_count - 1];
        if (null && strlen(null) < sizeof f->null) {
            f->has_null = true;
            snprintf(f->null, sizeof f->null, "%s", null);
        }
    } else if (v->place == FIELDS && strcmp(name, "DATA") == 0) {
        v->place = DATA;
    } else if (v->place == DATA && strcmp(name, "TABLEDATA") == 0) {
        v->place = CELLS;
    } else if (v->place == DATA && strncmp(name, "BINARY", 6) == 0) {
        v->binary = true;
        v->null_mask = strcmp(name, "BINARY2") == 0;
    } else if (v->place == DATA && strcmp(name, "FITS") == 0) {
        fail_here(v, "its rows are a FITS file; give that instead");
    } else if (v->place == DATA && strcmp(name, "STREAM") == 0 && v->binary) {
        begin_stream(v, attributes);
    } else if (v->place == CELLS && strcmp(name, "TR") == 0 && !v->in_row) {
        v->in_row = true;
        v->column = -1;
        begin_row(v);
    } else if (v->place == CELLS && strcmp(name, "TD") == 0 && v->in_row && !v->in_cell) {
        v->in_cell = true;
        v->cell_length = 0;
        if (++v->column >= v->field_count) {
            fail_here(v, "a row has more cells than the table has FIELDs");
        }
    }
}

static void end_element(void *user, const char *full) {
    bst_star_votable *v = user;
    const char *name = plain_name(full);
    v->depth--;
    if (v->status != BST_OK) {
        return;
    }
    if (v->place == FIELDS && strcmp(name, "FIELD") == 0) {
        v->in_field = false;
    } else if (v->place == CELLS && strcmp(name, "TD") == 0 && v->in_cell) {
        v->in_cell = false;
        if (v->wanted[v->column]) {
            end_cell(v);
        }
    } else if (v->place == CELLS && strcmp(name, "TR") == 0 && v->in_row) {
        v->in_row = false;
        if (v->column + 1 != v->field_count) {
            fail_here(v, "a row has fewer cells than the table has FIELDs");
        } else {
            end_row(v);
        }
    } else if (v->place == STREAM && strcmp(name, "STREAM") == 0) {
        const bst_votable_field *first = &v->fields[0];
        const bool none = v->null_mask || v->wanted[0] || first->variable;
        if (v->digits != 0 || v->at != (v->null_mask ? -1 : 0) || v->have != 0 ||
            v->skip != (none ? 0 : bst_votable_bytes(first, first->fixed))) {
            fail_here(v, "the STREAM ends within a row");
        }
        v->place = AFTER;
    } else if (strcmp(name, "TABLE") == 0 && v->place != BEFORE) {
        v->place = AFTER;
    }
}

static void take_text(void *user, const char *text, int length) {
    bst_star_votable *v = user;
    if (v->place == STREAM) {
        take_base64(v, text, length);
    } else if (v->in_cell && v->column < v->field_count && v->wanted[v->column]) {
        for (int i = 0; i < length && v->cell_length < CELL - 1; i++) {
            v->cell[v->cell_length++] = text[i];
        }
    }
}

static void refuse_doctype(void *user, const char *name, const char *system, const char *public,
                           int internal) {
    (void)name, (void)system, (void)public, (void)internal;
    fail_here(user, "a document type declaration is not allowed: entities are not read");
}

/* ---------------------------------------------------------------- file */

/* Parses the next chunk of the file. */
static bst_status parse_chunk(bst_ctx *ctx, bst_star_votable *v, bool *end) {
    bst_star_table *t = v->table;
    void *buffer = XML_GetBuffer(v->parser, CHUNK);
    if (!buffer) {
        return bst_fail(ctx, BST_ERR_MEMORY, "%s: out of memory", t->path);
    }
    size_t got = fread(buffer, 1, CHUNK, v->file);
    *end = got < CHUNK && (feof(v->file) || ferror(v->file));
    if (ferror(v->file)) {
        return bst_fail(ctx, BST_ERR_IO, "%s: cannot be read: %s", t->path, strerror(errno));
    }
    v->ctx = ctx;
    v->fed += (long long)got;
    v->row_count = v->row_next = 0;
    enum XML_Status parsed = XML_ParseBuffer(v->parser, (int)got, *end);
    if (v->status != BST_OK) {
        return v->status;
    }
    if (parsed != XML_STATUS_OK) {
        return bst_fail(ctx, BST_ERR_FORMAT, "%s:%lu: is no XML: %s", t->path, line_of(v),
                        XML_ErrorString(XML_GetErrorCode(v->parser)));
    }
    if (!*end && v->fed - (long long)BYTE_INDEX(v->parser) > MOST_TAG) {
        return bst_fail(ctx, BST_ERR_FORMAT, "%s:%lu: a tag is longer than 1 MiB", t->path,
                        line_of(v));
    }
    if (*end && t->unzips) {
        int code = bst_subprocess_wait(&t->unzip);
        t->unzips = false;
        v->file = NULL;
        if (code != 0) {
            return bst_fail(ctx, BST_ERR_FORMAT, "%s: cannot be unpacked (gzip ended with %d)",
                            t->path, code);
        }
    }
    return BST_OK;
}

bst_status bst_star_votable_open(bst_ctx *ctx, bst_star_table *t, bool gzip) {
    bst_star_votable *v = calloc(1, sizeof *v);
    t->votable = v;
    if (!v || !(v->parser = XML_ParserCreate(NULL))) {
        return bst_fail(ctx, BST_ERR_MEMORY, "%s: out of memory", t->path);
    }
    v->table = t;
    if (gzip) {
        const char *argv[] = {"gzip", "-dc", "--", t->path, NULL};
        BST_TRY(bst_subprocess_start(ctx, argv, NULL, true, NULL, &t->unzip));
        t->unzips = true;
        v->file = t->unzip.output;
    } else if (!(v->file = fopen(t->path, "r"))) {
        return bst_fail(ctx, BST_ERR_IO, "%s: %s", t->path, strerror(errno));
    }
    XML_SetUserData(v->parser, v);
    XML_SetElementHandler(v->parser, start_element, end_element);
    XML_SetCharacterDataHandler(v->parser, take_text);
    XML_SetStartDoctypeDeclHandler(v->parser, refuse_doctype);
    bool end = false;
    while (v->file && !end && v->place < CELLS) {
        BST_TRY(parse_chunk(ctx, v, &end));
    }
    if (v->place == BEFORE || v->field_count == 0) {
        return bst_fail(ctx, BST_ERR_FORMAT, "%s: has no TABLE with FIELDs", t->path);
    }
    return BST_OK;
}

bst_status bst_star_votable_next(bst_ctx *ctx, bst_star_table *t, int64_t *source,
                                 double value[BST_STAR_QUANTITIES], bool *end) {
    bst_star_votable *v = t->votable;
    bool last = v->file == NULL || feof(v->file);
    while (v->row_next == v->row_count && !last) {
        BST_TRY(parse_chunk(ctx, v, &last));
    }
    *end = v->row_next == v->row_count;
    if (!*end) {
        const star_row *row = &v->rows[v->row_next++];
        *source = row->source;
        memcpy(value, row->value, sizeof row->value);
    }
    return BST_OK;
}

void bst_star_votable_close(bst_star_table *t) {
    bst_star_votable *v = t->votable;
    if (!v) {
        return;
    }
    if (v->file && t->unzips) {
        /* an unread rest is no failure */
        (void)bst_subprocess_wait(&t->unzip);
    } else if (v->file) {
        fclose(v->file);
    }
    if (v->parser) {
        XML_ParserFree(v->parser);
    }
    free(v->rows);
    free(v);
    t->votable = NULL;
}
