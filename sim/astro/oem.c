/* Parses OEM files into segments of states. */
#include "sim/astro/oem.h"

#include <erfa.h>
#include <erfam.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "sim/astro/ccsds_time.h"
#include "sim/astro/oem_internal.h"
#include "sim/core/file.h"
#include "sim/core/text.h"
#include "sim/core/text_reader.h"

#define MAX_FILE_BYTES ((uint64_t)256 << 20)

enum { DEFAULT_DEGREE = 7, MAX_DEGREE = 31 };

typedef enum key {
    KEY_OBJECT_NAME,
    KEY_OBJECT_ID,
    KEY_CENTER_NAME,
    KEY_REF_FRAME,
    KEY_TIME_SYSTEM,
    KEY_START_TIME,
    KEY_STOP_TIME,
    NEEDED_KEYS,
    KEY_REF_FRAME_EPOCH = NEEDED_KEYS,
    KEY_USEABLE_START_TIME,
    KEY_USEABLE_STOP_TIME,
    KEY_INTERPOLATION,
    KEY_INTERPOLATION_DEGREE,
    META_KEYS
} key;

static const char *const meta_names[] = {"OBJECT_NAME",
                                         "OBJECT_ID",
                                         "CENTER_NAME",
                                         "REF_FRAME",
                                         "TIME_SYSTEM",
                                         "START_TIME",
                                         "STOP_TIME",
                                         "REF_FRAME_EPOCH",
                                         "USEABLE_START_TIME",
                                         "USEABLE_STOP_TIME",
                                         "INTERPOLATION",
                                         "INTERPOLATION_DEGREE",
                                         NULL};

enum { HEAD_VERSION, HEAD_KEYS = 5 };
static const char *const head_names[] = {"CCSDS_OEM_VERS", "CREATION_DATE", "ORIGINATOR",
                                         "CLASSIFICATION", "MESSAGE_ID",    NULL};

typedef enum place { IN_HEAD, IN_META, IN_DATA, IN_COVARIANCE } place;

/* A covariance matrix: lines read so far. */
typedef struct covariance {
    bool has_epoch;
    int rows;
} covariance;

typedef struct reader {
    bst_text_source source;
    bst_oem *oem;
    place where;
    bst_text_line line; /* current line */
    bool head[HEAD_KEYS];
    /* metadata of the current segment */
    bst_text_line meta[META_KEYS]; /* value of each key; `text` NULL: absent */
    bst_oem_segment_rows segment;
    bst_astro_time_system system;
    bst_time start, stop, use_start, use_stop;
    bool eme2000;
    bst_mat3 eme2000_from_gcrf;
    double largest_step_s;
    covariance covariance;
} reader;

/* Appends a state to the OEM ephemeris. */
static bst_status append_row(const reader *r, const bst_astro_table_state *row) {
    bst_oem *oem = r->oem;
    if (oem->row_count == oem->row_capacity) {
        int64_t capacity = oem->row_capacity ? 2 * oem->row_capacity : 64;
        bst_astro_table_state *rows = realloc(oem->rows, (size_t)capacity * sizeof *rows);
        if (!rows) {
            return bst_text_fail_memory(&r->source, "states");
        }
        oem->rows = rows;
        oem->row_capacity = capacity;
    }
    oem->rows[oem->row_count++] = *row;
    return BST_OK;
}

static bst_status append_segment(const reader *r) {
    bst_oem *oem = r->oem;
    if (oem->segment_count == oem->segment_capacity) {
        int capacity = oem->segment_capacity ? 2 * oem->segment_capacity : 4;
        bst_oem_segment_rows *segments =
            realloc(oem->segments, (size_t)capacity * sizeof *segments);
        if (!segments) {
            return bst_text_fail_memory(&r->source, "states");
        }
        oem->segments = segments;
        oem->segment_capacity = capacity;
    }
    oem->segments[oem->segment_count++] = r->segment;
    return BST_OK;
}

static bool starts_with_word(const bst_text_line *line, const char *word) {
    size_t length = strlen(word);
    return line->length >= length && memcmp(line->text, word, length) == 0 &&
           (line->length == length || line->text[length] == ' ' || line->text[length] == '\t');
}

/* Index of a keyword in `names`, a NULL-terminated list; the error suggests the nearest one. */
static bst_status find_key(const reader *r, bst_text_span name, const char *const *names,
                           int *out) {
    char word[64], expected[96];
    size_t best = SIZE_MAX;
    const char *nearest = NULL;
    bst_text_copy(name, word, sizeof word);
    for (int i = 0; names[i]; i++) {
        if (bst_text_is(name, names[i])) {
            *out = i;
            return BST_OK;
        }
        if (bst_text_is_nearer(word, names[i], &best)) {
            nearest = names[i];
        }
    }
    snprintf(expected, sizeof expected, "%s%s", nearest ? "" : "a keyword of 502.0-B-3 such as ",
             nearest ? nearest : names[0]);
    return bst_text_fail_at(&r->source, &r->line, "the keyword is not known here", name.text,
                            name.length, expected);
}

/* Reads a line of the OEM header. */
static bst_status read_head(reader *r) {
    bst_text_span name, value;
    int k;
    bool first = !r->head[HEAD_VERSION];
    if (first && (r->line.text[0] == '<' || !starts_with_word(&r->line, head_names[0]))) {
        return bst_text_fail_line(&r->source, &r->line,
                                  "the file does not begin as an OEM in KVN does",
                                  "CCSDS_OEM_VERS = 1.0, 2.0 or 3.0");
    }
    BST_TRY(bst_text_split(&r->source, &r->line, &name, &value));
    BST_TRY(find_key(r, name, head_names, &k));
    if (r->head[k]) {
        return bst_text_fail_line(&r->source, &r->line, "the keyword is given twice",
                                  "each keyword once");
    }
    r->head[k] = true;
    if (k == HEAD_VERSION && !bst_text_is(value, "1.0") && !bst_text_is(value, "2.0") &&
        !bst_text_is(value, "3.0")) {
        return bst_text_fail_at(&r->source, &r->line, "the version is not one that is read",
                                value.text, value.length, "1.0, 2.0 or 3.0");
    }
    return BST_OK;
}

/* Reads a line of the OEM metadata. */
static bst_status read_meta(reader *r) {
    bst_text_span name, value;
    int k;
    BST_TRY(bst_text_split(&r->source, &r->line, &name, &value));
    BST_TRY(find_key(r, name, meta_names, &k));
    if (r->meta[k].text) {
        return bst_text_fail_line(&r->source, &r->line, "the keyword is given twice",
                                  "each keyword once");
    }
    r->meta[k] = (bst_text_line){value.text, value.length, r->line.number};
    return BST_OK;
}

static bst_status fail_meta(const reader *r, key k, const char *problem, const char *expected) {
    char text[160];
    const bst_text_line *value = &r->meta[k];
    snprintf(text, sizeof text, "%s %s", meta_names[k], problem);
    return bst_text_fail_at(&r->source, value, text, value->text, value->length, expected);
}

/* Compares a metadata value, ignoring case, which the standard does not define. */
static bool meta_is(const reader *r, key k, const char *word) {
    return r->meta[k].length == strlen(word) &&
           strncasecmp(r->meta[k].text, word, r->meta[k].length) == 0;
}

static bst_status read_frame(reader *r) {
    const bst_text_line *frame = &r->meta[KEY_REF_FRAME];
    r->eme2000 = meta_is(r, KEY_REF_FRAME, "EME2000") || meta_is(r, KEY_REF_FRAME, "J2000");
    if (r->eme2000) {
        double bias[3][3], precession[3][3], both[3][3];
        eraBp06(ERFA_DJ00, 0.0, bias, precession, both);
        memcpy(r->eme2000_from_gcrf.m, bias, sizeof bias);
    }
    if (r->eme2000 || meta_is(r, KEY_REF_FRAME, "GCRF") || meta_is(r, KEY_REF_FRAME, "ICRF")) {
        r->segment.axes = BST_OEM_GCRF;
        return BST_OK;
    }
    if (meta_is(r, KEY_REF_FRAME, "TEME")) {
        r->segment.axes = BST_OEM_TEME;
    } else if (frame->length >= 4 && strncasecmp(frame->text, "ITRF", 4) == 0) {
        r->segment.axes = BST_OEM_ITRF;
    } else {
        return fail_meta(r, KEY_REF_FRAME, "is not one that is read",
                         "GCRF, ICRF, EME2000, TEME or ITRF");
    }
    if (r->meta[KEY_REF_FRAME_EPOCH].text) {
        return fail_meta(r, KEY_REF_FRAME_EPOCH, "fixes a turning frame, which is not read",
                         "TEME and ITRF of date");
    }
    return BST_OK;
}

static bst_status read_interpolation(reader *r) {
    bst_oem_segment_rows *s = &r->segment;
    int degree = DEFAULT_DEGREE;
    bool linear = false;
    s->hermite = true;
    if (r->meta[KEY_INTERPOLATION].text) {
        linear = meta_is(r, KEY_INTERPOLATION, "LINEAR");
        s->hermite = meta_is(r, KEY_INTERPOLATION, "HERMITE");
        if (!linear && !s->hermite && !meta_is(r, KEY_INTERPOLATION, "LAGRANGE")) {
            return fail_meta(r, KEY_INTERPOLATION, "is not one that is read",
                             "HERMITE, LAGRANGE or LINEAR");
        }
    }
    const bst_text_line *text = &r->meta[KEY_INTERPOLATION_DEGREE];
    if (text->text &&
        (!bst_text_count((bst_text_span){text->text, text->length}, MAX_DEGREE, &degree) ||
         degree < 1)) {
        return fail_meta(r, KEY_INTERPOLATION_DEGREE, "is not a whole number in the range",
                         "1 to 31");
    }
    degree = linear ? 1 : degree;
    s->points = degree + 1;
    if (s->hermite) {
        s->points = (degree + 2) / 2 > 2 ? (degree + 2) / 2 : 2;
    }
    return BST_OK;
}

static bst_status read_date(const reader *r, const bst_text_line *line, bst_text_span text,
                            bst_time *out) {
    bst_status status = bst_ccsds_time(r->source.ctx, text.text, text.length, r->system, out);
    return status == BST_OK ? BST_OK
                            : bst_fail_prefix(r->source.ctx, BST_ERR_FORMAT, "%.400s:%d",
                                              r->source.name, line->number);
}

static bst_status read_meta_date(const reader *r, key k, bst_time *out) {
    const bst_text_line *line = &r->meta[k];
    return line->text ? read_date(r, line, (bst_text_span){line->text, line->length}, out) : BST_OK;
}

/* Completes the metadata at META_STOP. */
static bst_status finish_meta(reader *r) {
    for (int k = 0; k < NEEDED_KEYS; k++) {
        if (!r->meta[k].text) {
            return bst_fail(r->source.ctx, BST_ERR_FORMAT,
                            "%.400s:%d: %s is missing from this metadata", r->source.name,
                            r->segment.line, meta_names[k]);
        }
    }
    if (!meta_is(r, KEY_CENTER_NAME, "EARTH")) {
        return fail_meta(r, KEY_CENTER_NAME, "is not the one that is read", "EARTH");
    }
    char system[8] = "";
    const bst_text_line *name = &r->meta[KEY_TIME_SYSTEM];
    for (size_t i = 0; i < name->length && i < sizeof system - 1; i++) {
        char c = name->text[i];
        system[i] = c >= 'a' && c <= 'z' ? (char)(c - 'a' + 'A') : c;
    }
    if (!bst_astro_time_system_find(system, name->length, &r->system)) {
        return fail_meta(r, KEY_TIME_SYSTEM, "is not one that is read", "UTC, TAI, TT, TDB or GPS");
    }
    bst_text_copy((bst_text_span){r->meta[KEY_OBJECT_NAME].text, r->meta[KEY_OBJECT_NAME].length},
                  r->segment.name, sizeof r->segment.name);
    bst_text_copy((bst_text_span){r->meta[KEY_OBJECT_ID].text, r->meta[KEY_OBJECT_ID].length},
                  r->segment.id, sizeof r->segment.id);
    BST_TRY(read_frame(r));
    BST_TRY(read_interpolation(r));
    BST_TRY(read_meta_date(r, KEY_START_TIME, &r->start));
    BST_TRY(read_meta_date(r, KEY_STOP_TIME, &r->stop));
    if (bst_time_diff(r->stop, r->start) < 0.0) {
        return fail_meta(r, KEY_STOP_TIME, "is before START_TIME", "a later date");
    }
    r->use_start = r->start;
    r->use_stop = r->stop;
    BST_TRY(read_meta_date(r, KEY_USEABLE_START_TIME, &r->use_start));
    BST_TRY(read_meta_date(r, KEY_USEABLE_STOP_TIME, &r->use_stop));
    if (bst_time_diff(r->use_stop, r->use_start) < 0.0) {
        key k =
            r->meta[KEY_USEABLE_STOP_TIME].text ? KEY_USEABLE_STOP_TIME : KEY_USEABLE_START_TIME;
        return fail_meta(r, k, "makes the usable span end before it starts",
                         "start and stop in the order of time");
    }
    r->where = IN_DATA;
    return BST_OK;
}

static void start_meta(reader *r) {
    memset(r->meta, 0, sizeof r->meta);
    r->segment = (bst_oem_segment_rows){.line = r->line.number, .first = r->oem->row_count};
    r->largest_step_s = 0.0;
    r->where = IN_META;
}

static bst_status read_row(reader *r) {
    bst_text_span rest = {r->line.text, r->line.length}, word;
    bst_time t;
    double v[9];
    int n = 0;
    (void)bst_text_next_word(&rest, &word);
    BST_TRY(read_date(r, &r->line, word, &t));
    while (bst_text_next_word(&rest, &word)) {
        if (n == 9) {
            return bst_text_fail_line(&r->source, &r->line, "more numbers than a state has",
                                      "an epoch and 6 numbers, or 9 with accelerations");
        }
        if (!bst_text_number(word, &v[n++])) {
            return bst_text_fail_at(&r->source, &r->line, "is not a number", word.text, word.length,
                                    "a number in km, km/s or km/s2");
        }
    }
    if (n != 6 && n != 9) {
        return bst_text_fail_line(&r->source, &r->line, "fewer numbers than a state has",
                                  "an epoch and 6 numbers, or 9 with accelerations");
    }
    bst_astro_table_state row = {.position_m = {1e3 * v[0], 1e3 * v[1], 1e3 * v[2]},
                                 .velocity_mps = {1e3 * v[3], 1e3 * v[4], 1e3 * v[5]}};
    if (r->segment.rows == 0) {
        r->segment.base = t;
    } else {
        row.t_s = bst_time_diff(t, r->segment.base);
        double step_s = row.t_s - r->oem->rows[r->oem->row_count - 1].t_s;
        if (!(step_s > 0.0)) {
            return bst_text_fail_line(&r->source, &r->line,
                                      step_s == 0.0
                                          ? "the epoch is that of the state before it"
                                          : "the epoch is before that of the state before it",
                                      "epochs that rise");
        }
        r->largest_step_s = fmax(r->largest_step_s, step_s);
    }
    if (r->eme2000) {
        row.position_m = bst_mat3_transpose_mul_vec(&r->eme2000_from_gcrf, row.position_m);
        row.velocity_mps = bst_mat3_transpose_mul_vec(&r->eme2000_from_gcrf, row.velocity_mps);
    }
    r->segment.rows++;
    return append_row(r, &row);
}

/* Completes a segment after its last state. */
static bst_status finish_segment(reader *r) {
    bst_oem_segment_rows *s = &r->segment;
    bst_ctx *ctx = r->source.ctx;
    const char *name = r->source.name;
    if (s->rows == 0) {
        return bst_fail(ctx, BST_ERR_FORMAT, "%.400s:%d: no states follow this metadata", name,
                        s->line);
    }
    double last_s = r->oem->rows[r->oem->row_count - 1].t_s;
    /* metadata dates may be rounded to a second */
    double allowed_s = fmax(r->largest_step_s, 1.0);
    if (bst_time_diff(s->base, r->start) > allowed_s ||
        bst_time_diff(r->stop, s->base) - last_s > allowed_s) {
        return bst_fail(ctx, BST_ERR_FORMAT,
                        "%.400s:%d: the states do not reach from START_TIME to STOP_TIME (the last "
                        "ends before line %d); is the file cut short?",
                        name, s->line, r->line.number);
    }
    s->from_s = fmax(0.0, bst_time_diff(r->use_start, s->base));
    s->to_s = fmin(last_s, bst_time_diff(r->use_stop, s->base));
    if (s->to_s < s->from_s) {
        return bst_fail(ctx, BST_ERR_FORMAT, "%.400s:%d: no states within the usable span", name,
                        s->line);
    }
    return append_segment(r);
}

/* A line between COVARIANCE_START and COVARIANCE_STOP: each matrix has an EPOCH, perhaps a
 * COV_REF_FRAME, and the lower triangle of 6 rows. */
static bst_status read_covariance(reader *r) {
    static const char *const names[] = {"EPOCH", "COV_REF_FRAME", NULL};
    covariance *c = &r->covariance;
    bool complete = c->has_epoch && c->rows == 6;
    if (starts_with_word(&r->line, "COVARIANCE_STOP")) {
        if (!complete) {
            return bst_text_fail_line(&r->source, &r->line, "the covariance is not complete",
                                      "EPOCH and 6 rows of numbers");
        }
        r->where = IN_DATA;
        return BST_OK;
    }
    if (memchr(r->line.text, '=', r->line.length)) {
        bst_text_span name, value;
        bst_time t;
        int k;
        BST_TRY(bst_text_split(&r->source, &r->line, &name, &value));
        BST_TRY(find_key(r, name, names, &k));
        if (k == 0) {
            if (c->has_epoch && !complete) {
                return bst_text_fail_line(&r->source, &r->line,
                                          "the covariance before it is not complete",
                                          "6 rows of numbers");
            }
            *c = (covariance){.has_epoch = true};
            return read_date(r, &r->line, value, &t);
        }
        return c->has_epoch && c->rows == 0
                   ? BST_OK
                   : bst_text_fail_line(&r->source, &r->line, "COV_REF_FRAME is in the wrong place",
                                        "it after EPOCH");
    }
    if (!c->has_epoch || c->rows == 6) {
        return bst_text_fail_line(&r->source, &r->line, "a row of a covariance without an EPOCH",
                                  "EPOCH = date before it");
    }
    bst_text_span rest = {r->line.text, r->line.length}, word;
    int n = 0;
    while (bst_text_next_word(&rest, &word)) {
        double number;
        if (!bst_text_number(word, &number)) {
            return bst_text_fail_at(&r->source, &r->line, "is not a number", word.text, word.length,
                                    "an element of a covariance");
        }
        n++;
    }
    if (n != ++c->rows) {
        return bst_text_fail_line(
            &r->source, &r->line,
            "the row of the covariance has not as many numbers as its place asks",
            "the lower triangle: 1 number, then 2, to 6");
    }
    return BST_OK;
}

static bst_status read_line(reader *r) {
    const bst_text_line *line = &r->line;
    bool meta_start = starts_with_word(line, "META_START");
    switch (r->where) {
        case IN_HEAD:
            if (meta_start && r->head[HEAD_VERSION]) {
                start_meta(r);
                return BST_OK;
            }
            return read_head(r);
        case IN_META:
            return starts_with_word(line, "META_STOP") ? finish_meta(r) : read_meta(r);
        case IN_COVARIANCE:
            return read_covariance(r);
        default:
            break;
    }
    if (meta_start) {
        BST_TRY(finish_segment(r));
        start_meta(r);
        return BST_OK;
    }
    if (starts_with_word(line, "COVARIANCE_START")) {
        r->where = IN_COVARIANCE;
        r->covariance = (covariance){0};
        return BST_OK;
    }
    return read_row(r);
}

static bst_status read_lines(reader *r, const char *data, size_t bytes) {
    bst_text_cursor cursor = bst_text_start(data, bytes);
    while (bst_text_next_line(&cursor, &r->line)) {
        bst_text_span s = bst_text_trimmed((bst_text_span){r->line.text, r->line.length});
        r->line.text = s.text;
        r->line.length = s.length;
        if (s.length > 0 && !starts_with_word(&r->line, "COMMENT")) {
            BST_TRY(read_line(r));
        }
    }
    r->line = (bst_text_line){"", 0, cursor.line_number + 1};
    if (r->where != IN_DATA) {
        return bst_fail(r->source.ctx, BST_ERR_FORMAT, "%.400s:%d: the file ends %s",
                        r->source.name, cursor.line_number > 0 ? cursor.line_number : 1,
                        r->where == IN_META         ? "within metadata (expected META_STOP)"
                        : r->where == IN_COVARIANCE ? "within a covariance (expected "
                                                      "COVARIANCE_STOP)"
                        : r->head[HEAD_VERSION]     ? "before any metadata (expected META_START)"
                                                    : "before it begins as an OEM (expected "
                                                      "CCSDS_OEM_VERS)");
    }
    return finish_segment(r);
}

bst_status bst_oem_read_buffer(bst_ctx *ctx, const char *name, const char *data, size_t bytes,
                               bst_oem **out) {
    *out = NULL;
    BST_TRY(bst_file_check_text(ctx, name, data, bytes));
    reader r = {.source = {ctx, name}};
    r.oem = calloc(1, sizeof *r.oem);
    if (r.oem) {
        r.oem->name = strdup(name);
    }
    bst_status status = r.oem && r.oem->name ? read_lines(&r, data, bytes)
                                             : bst_text_fail_memory(&r.source, "states");
    if (status == BST_OK) {
        status = bst_oem_sort(ctx, r.oem);
    }
    if (status != BST_OK) {
        bst_oem_free(r.oem);
        return status;
    }
    *out = r.oem;
    return BST_OK;
}

bst_status bst_oem_load(bst_ctx *ctx, const char *path, bst_oem **out) {
    *out = NULL;
    char *data;
    size_t bytes;
    BST_TRY(
        bst_file_read(ctx, path, MAX_FILE_BYTES, "an OEM file (CCSDS 502.0, KVN)", &data, &bytes));
    bst_status status = bst_oem_read_buffer(ctx, path, data, bytes, out);
    free(data);
    return status;
}

void bst_oem_free(bst_oem *oem) {
    if (oem) {
        free(oem->name);
        free(oem->rows);
        free(oem->segments);
        free(oem->objects);
        free(oem);
    }
}
