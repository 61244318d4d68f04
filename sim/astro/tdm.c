#include "sim/astro/tdm.h"

#include <erfa.h>
#include <erfam.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "boresight/vec.h"
#include "sim/astro/ccsds_time.h"
#include "sim/core/file.h"
#include "sim/core/text_reader.h"

#define MAX_FILE_BYTES ((uint64_t)256 << 20)

enum { PARTICIPANTS = 5 };

typedef enum kind { ANGLE_1, ANGLE_2, MAGNITUDE, KINDS } kind;
static const char *const kind_names[KINDS] = {"ANGLE_1", "ANGLE_2", "MAG"};

typedef struct value {
    bst_time time;
    double value;
    int line, kind;
} value;

typedef enum place { IN_HEAD, IN_META, BETWEEN, IN_DATA } place;

struct bst_tdm {
    bst_tdm_pair *pairs;
    int count, capacity;
};

/* Metadata of a TDM segment. */
typedef struct metadata {
    char participant[PARTICIPANTS][80], ephemeris[PARTICIPANTS][256];
    bool has_system, radec, has_type, has_frame, eme2000, bad_frame, transmitted, applied;
    bst_astro_time_system system;
    int observer, object;                   /* numbers of the participants, from 0 */
    double integration_s, integration_part; /* START: +1/2, END: -1/2, MIDDLE: 0 */
    double correction[KINDS];
    int line;
} metadata;

typedef struct reader {
    bst_text_source source;
    bst_text_line line;
    bst_tdm *tdm;
    place where;
    bool version;
    metadata meta;
    value *values;
    int64_t value_count, value_capacity;
} reader;

static bst_status fail(const reader *r, const char *problem, const char *expected) {
    return bst_text_fail_at(&r->source, &r->line, problem, r->line.text, r->line.length, expected);
}

static bool same(bst_text_span span, const char *word) {
    return span.length == strlen(word) && strncasecmp(span.text, word, span.length) == 0;
}

/* Checks whether a name is `stem` with one digit from 1; *index counts from 0. */
static bool numbered(bst_text_span name, const char *stem, int *index) {
    size_t n = strlen(stem);
    if (name.length != n + 1 || memcmp(name.text, stem, n) != 0) {
        return false;
    }
    *index = name.text[n] - '1';
    return *index >= 0 && *index < PARTICIPANTS;
}

static bst_status split(const reader *r, bst_text_span *name, bst_text_span *rest) {
    const char *expected, *problem = bst_text_split_keyword(&r->line, name, rest, &expected);
    return problem ? fail(r, problem, expected) : BST_OK;
}

static bst_status read_head(reader *r) {
    bst_text_span name, rest;
    if (!r->version) {
        BST_TRY(split(r, &name, &rest));
        if (!bst_text_is(name, "CCSDS_TDM_VERS") ||
            (!bst_text_is(rest, "1.0") && !bst_text_is(rest, "2.0"))) {
            return fail(r, "the file does not begin as a TDM in KVN does",
                        "CCSDS_TDM_VERS = 1.0 or 2.0");
        }
        r->version = true;
        return BST_OK;
    }
    return split(r, &name, &rest);
}

static bst_status read_number(const reader *r, bst_text_span text, double *out) {
    return bst_text_number(text, out) ? BST_OK : fail(r, "the value is no number", "a number");
}

/* Parses PATH, such as "2,1": the last participant receives, the one before transmits. */
static bst_status read_path(reader *r, bst_text_span path) {
    metadata *m = &r->meta;
    int last = -1, before = -1;
    for (size_t i = 0; i < path.length; i += 2) {
        int n = path.text[i] - '1';
        if (n < 0 || n >= PARTICIPANTS || (i + 1 < path.length && path.text[i + 1] != ',')) {
            before = -1;
            break;
        }
        before = last;
        last = n;
    }
    if (before < 0 || before == last || path.length % 2 == 0) {
        return fail(r, "is no path between participants", "numbers of participants such as 2,1");
    }
    m->observer = last;
    m->object = before;
    return BST_OK;
}

static bst_status read_meta(reader *r) {
    metadata *m = &r->meta;
    bst_text_span name, rest;
    int index;
    BST_TRY(split(r, &name, &rest));
    if (numbered(name, "PARTICIPANT_", &index)) {
        bst_text_copy(rest, m->participant[index], sizeof m->participant[index]);
    } else if (numbered(name, "EPHEMERIS_NAME_", &index)) {
        bst_text_copy(rest, m->ephemeris[index], sizeof m->ephemeris[index]);
    } else if (bst_text_is(name, "TIME_SYSTEM")) {
        m->has_system = bst_astro_time_system_find(rest.text, rest.length, &m->system);
        return m->has_system
                   ? BST_OK
                   : fail(r, "the time system is not one that is read", "UTC, TAI, TT, TDB or GPS");
    } else if (bst_text_is(name, "PATH")) {
        return read_path(r, rest);
    } else if (bst_text_is(name, "ANGLE_TYPE")) {
        m->has_type = true;
        m->radec = same(rest, "RADEC");
    } else if (bst_text_is(name, "REFERENCE_FRAME")) {
        m->has_frame = true;
        m->eme2000 = same(rest, "EME2000") || same(rest, "J2000");
        m->bad_frame = !m->eme2000 && !same(rest, "ICRF") && !same(rest, "GCRF");
    } else if (bst_text_is(name, "TIMETAG_REF")) {
        m->transmitted = !same(rest, "RECEIVE");
    } else if (bst_text_is(name, "INTEGRATION_INTERVAL")) {
        BST_TRY(read_number(r, rest, &m->integration_s));
        return m->integration_s >= 0.0 && m->integration_s < 1e6
                   ? BST_OK
                   : fail(r, "is out of range", "seconds from 0 to 1e6");
    } else if (bst_text_is(name, "INTEGRATION_REF")) {
        m->integration_part = same(rest, "START") ? 0.5 : same(rest, "END") ? -0.5 : 0.0;
    } else if (bst_text_is(name, "CORRECTIONS_APPLIED")) {
        m->applied = same(rest, "YES");
    } else if (bst_text_is(name, "CORRECTION_ANGLE_1")) {
        return read_number(r, rest, &m->correction[ANGLE_1]);
    } else if (bst_text_is(name, "CORRECTION_ANGLE_2")) {
        return read_number(r, rest, &m->correction[ANGLE_2]);
    } else if (bst_text_is(name, "CORRECTION_MAG")) {
        return read_number(r, rest, &m->correction[MAGNITUDE]);
    }
    return BST_OK;
}

static bst_status end_meta(const reader *r) {
    const metadata *m = &r->meta;
    if (!m->has_system || !m->participant[0][0]) {
        return fail(r, "the metadata lack TIME_SYSTEM or PARTICIPANT_1", "both before META_STOP");
    }
    return BST_OK;
}

/* "KEYWORD = epoch value". */
static bst_status read_data(reader *r) {
    bst_text_span name, rest, epoch, word, more;
    value v = {.line = r->line.number};
    BST_TRY(split(r, &name, &rest));
    if (!bst_text_next_word(&rest, &epoch) || !bst_text_next_word(&rest, &word) ||
        bst_text_next_word(&rest, &more)) {
        return fail(r, "is no datum", "KEYWORD = epoch value");
    }
    bst_status status =
        bst_ccsds_time(r->source.ctx, epoch.text, epoch.length, r->meta.system, &v.time);
    if (status != BST_OK) {
        return bst_fail_prefix(r->source.ctx, status, "%.400s:%d", r->source.name, r->line.number);
    }
    BST_TRY(read_number(r, word, &v.value));
    for (v.kind = 0; v.kind < KINDS && !bst_text_is(name, kind_names[v.kind]); v.kind++) {
    }
    if (v.kind == KINDS) {
        return BST_OK;
    }
    const metadata *m = &r->meta;
    if (v.kind != MAGNITUDE && (!m->has_type || !m->radec)) {
        return fail(r, "angles of this kind are not read", "ANGLE_TYPE = RADEC in the metadata");
    }
    if (v.kind != MAGNITUDE && (!m->has_frame || m->bad_frame)) {
        return fail(r, "angles in this frame are not read",
                    "REFERENCE_FRAME = ICRF, GCRF or EME2000 in the metadata");
    }
    if (v.kind != MAGNITUDE && m->transmitted) {
        return fail(r, "times of transmission are not read", "TIMETAG_REF = RECEIVE");
    }
    v.value += m->applied ? 0.0 : m->correction[v.kind];
    if ((v.kind == ANGLE_1 && !(fabs(v.value) <= 720.0)) ||
        (v.kind == ANGLE_2 && !(fabs(v.value) <= 90.0))) {
        return fail(r, "the angle is out of range",
                    "right ascension to +-720 and declination to +-90 degrees");
    }
    v.time = bst_time_add(v.time, m->integration_part * m->integration_s);
    if (r->value_count == r->value_capacity) {
        int64_t capacity = r->value_capacity ? 2 * r->value_capacity : 256;
        value *values = realloc(r->values, (size_t)capacity * sizeof *values);
        if (!values) {
            return bst_text_fail_memory(&r->source, "angles");
        }
        r->values = values;
        r->value_capacity = capacity;
    }
    r->values[r->value_count++] = v;
    return BST_OK;
}

static int by_time(const void *a, const void *b) {
    const value *x = a, *y = b;
    double d = bst_time_diff(x->time, y->time);
    return d < 0.0 ? -1 : d > 0.0 ? 1 : x->line - y->line;
}

static bst_status fail_pair(const reader *r, const value *v) {
    return bst_fail(r->source.ctx, BST_ERR_FORMAT,
                    "%.400s:%d: %s has no %s of its time, or comes twice (expected both angles "
                    "once at each time)",
                    r->source.name, v->line, kind_names[v->kind],
                    kind_names[v->kind == ANGLE_1 ? ANGLE_2 : ANGLE_1]);
}

/* Combines values of one time; `items` has room for all values. */
static bst_status join(const reader *r, bst_tdm_angles *items, int64_t *count) {
    bst_mat3 bias = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
    if (r->meta.eme2000) {
        double precession[3][3], both[3][3];
        eraBp06(ERFA_DJ00, 0.0, bias.m, precession, both);
    }
    *count = 0;
    for (int64_t i = 0; i < r->value_count;) {
        const value *at[KINDS] = {NULL}, *first = &r->values[i];
        for (; i < r->value_count && bst_time_diff(r->values[i].time, first->time) <= 1e-6; i++) {
            const value *v = &r->values[i];
            if (at[v->kind] && v->kind != MAGNITUDE) {
                return fail_pair(r, v);
            }
            at[v->kind] = v;
        }
        const value *ra = at[ANGLE_1], *dec = at[ANGLE_2];
        if (!ra != !dec) {
            return fail_pair(r, ra ? ra : dec);
        }
        if (!ra) {
            continue; /* a magnitude without angles */
        }
        bst_tdm_angles *out = &items[(*count)++];
        bst_vec3 d = bst_vec3_from_radec(ra->value * BST_DEG_RAD, dec->value * BST_DEG_RAD);
        *out = (bst_tdm_angles){.time = first->time,
                                .mag = at[MAGNITUDE] ? at[MAGNITUDE]->value : NAN};
        /* the matrix of eraBp06 rotates from ICRF to EME2000 */
        bst_vec3_to_radec(bst_mat3_transpose_mul_vec(&bias, d), &out->ra_rad, &out->dec_rad);
    }
    return BST_OK;
}

static bst_status end_data(reader *r) {
    bst_tdm *tdm = r->tdm;
    const metadata *m = &r->meta;
    if (tdm->count == tdm->capacity) {
        int capacity = tdm->capacity ? 2 * tdm->capacity : 4;
        bst_tdm_pair *pairs = realloc(tdm->pairs, (size_t)capacity * sizeof *pairs);
        if (!pairs) {
            return bst_text_fail_memory(&r->source, "angles");
        }
        tdm->pairs = pairs;
        tdm->capacity = capacity;
    }
    bst_tdm_angles *items = malloc((size_t)(r->value_count + 1) * sizeof *items);
    if (!items) {
        return bst_text_fail_memory(&r->source, "angles");
    }
    bst_tdm_pair *pair = &tdm->pairs[tdm->count++];
    *pair = (bst_tdm_pair){.items = items};
    memcpy(pair->observer, m->participant[m->observer], sizeof pair->observer);
    memcpy(pair->object, m->participant[m->object], sizeof pair->object);
    memcpy(pair->ephemeris, m->ephemeris[m->observer], sizeof pair->ephemeris);
    if (r->value_count > 0) {
        qsort(r->values, (size_t)r->value_count, sizeof *r->values, by_time);
    }
    bst_status status = join(r, items, &pair->count);
    r->value_count = 0;
    return status;
}

static bst_status read_line(reader *r) {
    const bst_text_span line = {r->line.text, r->line.length};
    bool comment = line.length >= 7 && memcmp(line.text, "COMMENT", 7) == 0 &&
                   (line.length == 7 || line.text[7] == ' ' || line.text[7] == '\t');
    if (line.length == 0 || comment) {
        return r->version ? BST_OK : fail(r, "stands before CCSDS_TDM_VERS", "that keyword first");
    }
    bool head = r->where == IN_HEAD && r->version;
    if (bst_text_is(line, "META_START") && (head || r->where == BETWEEN)) {
        r->where = IN_META;
        r->meta = (metadata){.observer = 0, .object = 1, .line = r->line.number};
        return BST_OK;
    }
    if (bst_text_is(line, "META_STOP") && r->where == IN_META) {
        r->where = BETWEEN;
        return end_meta(r);
    }
    if (bst_text_is(line, "DATA_START") && r->where == BETWEEN && r->meta.line > 0) {
        r->where = IN_DATA;
        return BST_OK;
    }
    if (bst_text_is(line, "DATA_STOP") && r->where == IN_DATA) {
        r->where = BETWEEN;
        bst_status status = end_data(r);
        r->meta.line = 0;
        return status;
    }
    switch (r->where) {
        case IN_HEAD:
            return read_head(r);
        case IN_META:
            return read_meta(r);
        case IN_DATA:
            return read_data(r);
        case BETWEEN:
            break;
    }
    return fail(r, "is not a line that a TDM has here", "META_START, or DATA_START after metadata");
}

static bst_status read_all(reader *r, const char *data, size_t bytes) {
    bst_text_cursor cursor = bst_text_start(data, bytes);
    while (bst_text_next_line(&cursor, &r->line)) {
        bst_text_span inner = bst_text_trimmed((bst_text_span){r->line.text, r->line.length});
        r->line.text = inner.text;
        r->line.length = inner.length;
        BST_TRY(read_line(r));
    }
    int last = cursor.line_number > 0 ? cursor.line_number : 1;
    if (r->where != BETWEEN || r->meta.line > 0) {
        return bst_fail(r->source.ctx, BST_ERR_FORMAT,
                        "%.400s:%d: the file ends before its data do (expected %s)", r->source.name,
                        last,
                        !r->version           ? "CCSDS_TDM_VERS"
                        : r->where == IN_HEAD ? "META_START"
                        : r->where == IN_META ? "META_STOP"
                        : r->where == IN_DATA ? "DATA_STOP"
                                              : "DATA_START");
    }
    for (int i = 0; i < r->tdm->count; i++) {
        if (r->tdm->pairs[i].count > 0) {
            return BST_OK;
        }
    }
    return bst_fail(r->source.ctx, BST_ERR_FORMAT, "%.400s:%d: the file has no angles",
                    r->source.name, last);
}

bst_status bst_tdm_read_buffer(bst_ctx *ctx, const char *name, const char *data, size_t bytes,
                               bst_tdm **out) {
    *out = NULL;
    BST_TRY(bst_file_check_text(ctx, name, data, bytes));
    reader r = {.source = {ctx, name}, .tdm = calloc(1, sizeof *r.tdm)};
    bst_status status =
        r.tdm ? read_all(&r, data, bytes) : bst_text_fail_memory(&r.source, "angles");
    free(r.values);
    if (status != BST_OK) {
        bst_tdm_free(r.tdm);
        return status;
    }
    *out = r.tdm;
    return BST_OK;
}

bst_status bst_tdm_load(bst_ctx *ctx, const char *path, bst_tdm **out) {
    *out = NULL;
    char *data;
    size_t bytes;
    BST_TRY(
        bst_file_read(ctx, path, MAX_FILE_BYTES, "a TDM file (CCSDS 503.0, KVN)", &data, &bytes));
    bst_status status = bst_tdm_read_buffer(ctx, path, data, bytes, out);
    free(data);
    return status;
}

void bst_tdm_free(bst_tdm *tdm) {
    for (int i = 0; tdm && i < tdm->count; i++) {
        free((void *)tdm->pairs[i].items);
    }
    if (tdm) {
        free(tdm->pairs);
        free(tdm);
    }
}

int bst_tdm_pair_count(const bst_tdm *tdm) {
    return tdm->count;
}

const bst_tdm_pair *bst_tdm_pair_at(const bst_tdm *tdm, int index) {
    return &tdm->pairs[index];
}
