#include "sim/astro/aem.h"

#include <erfa.h>
#include <erfam.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "sim/astro/ccsds_time.h"
#include "sim/core/file.h"
#include "sim/core/text_reader.h"

enum { ROWS_MAX = 4000000, WORD_BYTES = 64 };

/* Norm of a quaternion of few digits. */
static const double NORM_SLACK = 1e-3;

typedef enum key {
    KEY_OBJECT_NAME,
    KEY_OBJECT_ID,
    KEY_FRAME_A,
    KEY_FRAME_B,
    KEY_TIME_SYSTEM,
    KEY_START_TIME,
    KEY_STOP_TIME,
    KEY_TYPE,
    NEEDED_KEYS,
    KEY_DIRECTION = NEEDED_KEYS, /* version 1 */
    KEY_QUATERNION_TYPE,         /* version 1 */
    KEY_EULER_ORDER,
    USED_KEYS
} key;

static const char *const key_names[] = {"OBJECT_NAME",
                                        "OBJECT_ID",
                                        "REF_FRAME_A",
                                        "REF_FRAME_B",
                                        "TIME_SYSTEM",
                                        "START_TIME",
                                        "STOP_TIME",
                                        "ATTITUDE_TYPE",
                                        "ATTITUDE_DIR",
                                        "QUATERNION_TYPE",
                                        "EULER_ROT_SEQ",
                                        "CENTER_NAME",
                                        "USEABLE_START_TIME",
                                        "USEABLE_STOP_TIME",
                                        "RATE_FRAME",
                                        "ANGVEL_FRAME",
                                        "INTERPOLATION_METHOD",
                                        "INTERPOLATION_DEGREE",
                                        NULL};

enum { KEYS = sizeof key_names / sizeof key_names[0] - 1 };

static const char *const head_names[] = {"CCSDS_AEM_VERS", "CREATION_DATE", "ORIGINATOR",
                                         "CLASSIFICATION", "MESSAGE_ID",    NULL};

typedef enum form { FORM_QUATERNION, FORM_EULER, FORM_SPIN } form;

/* The attitude types: what a row holds after its epoch. */
static const struct {
    const char *name;
    form form;
    int numbers;
} types[] = {{"QUATERNION", FORM_QUATERNION, 4},
             {"QUATERNION/DERIVATIVE", FORM_QUATERNION, 8},
             {"QUATERNION/RATE", FORM_QUATERNION, 7},
             {"QUATERNION/ANGVEL", FORM_QUATERNION, 7},
             {"EULER_ANGLE", FORM_EULER, 3},
             {"EULER_ANGLE/RATE", FORM_EULER, 6},
             {"EULER_ANGLE/DERIVATIVE", FORM_EULER, 6},
             {"EULER_ANGLE/ANGVEL", FORM_EULER, 6},
             {"SPIN", FORM_SPIN, 4}};

enum { TYPES = sizeof types / sizeof types[0] };

typedef enum place { IN_HEAD, IN_META, BEFORE_DATA, IN_DATA, AFTER_DATA } place;

typedef struct reader {
    bst_text_source source;
    bst_text_line line;
    place where;
    bool version_1;
    bool has_version;
    const char *object; /* that is wanted */
    bst_time epoch;
    char first_name[WORD_BYTES]; /* of the file's first object */
    bool found;
    /* the current segment */
    bst_text_line meta[KEYS]; /* value of each key; `text` NULL: absent */
    int meta_line;
    bool wanted;
    int type;
    bool backward;     /* the row is A from B */
    bool body_first;   /* A is the body */
    bool scalar_first; /* version 1 */
    int axis[3];       /* of the Euler angles: 0 to 2 */
    bst_astro_time_system system;
    bst_quat inertial_from_gcrf;
    double start_s, stop_s;
    int segment_rows;
    bst_attitude_row *rows;
    int count, capacity;
} reader;

static bst_status fail_meta(const reader *r, key k, const char *problem, const char *expected) {
    char text[160];
    const bst_text_line *value = &r->meta[k];
    snprintf(text, sizeof text, "%s %s", key_names[k], problem);
    return bst_text_fail_at(&r->source, value, text, value->text, value->length, expected);
}

static bool is_word(const bst_text_line *line, const char *word) {
    return line->text && line->length == strlen(word) &&
           strncasecmp(line->text, word, line->length) == 0;
}

/* Index of a keyword; -1: not in the list. */
static int find_name(bst_text_span name, const char *const *names) {
    for (int i = 0; names[i]; i++) {
        if (bst_text_is(name, names[i])) {
            return i;
        }
    }
    return -1;
}

static bst_status read_head(reader *r) {
    bst_text_span name, value;
    if (is_word(&r->line, "META_START") && r->has_version) {
        memset(r->meta, 0, sizeof r->meta);
        r->meta_line = r->line.number;
        r->where = IN_META;
        return BST_OK;
    }
    BST_TRY(bst_text_split(&r->source, &r->line, &name, &value));
    int k = find_name(name, head_names);
    if (k < 0 || (k == 0) == r->has_version) {
        return bst_text_fail_line(&r->source, &r->line, "no line of an AEM's header",
                                  r->has_version ? "CREATION_DATE, ORIGINATOR, ... or META_START"
                                                 : "CCSDS_AEM_VERS = 1.0 or 2.0 first");
    }
    if (k == 0) {
        r->version_1 = bst_text_is(value, "1.0");
        r->has_version = true;
        if (!r->version_1 && !bst_text_is(value, "2.0")) {
            return bst_text_fail_at(&r->source, &r->line, "the version is not one that is read",
                                    value.text, value.length, "1.0 or 2.0");
        }
    }
    return BST_OK;
}

/* Finds which of the frames A and B is inertial; the other one is the body. */
static bst_status read_frames(reader *r) {
    bool inertial[2];
    for (int i = 0; i < 2; i++) {
        key k = i == 0 ? KEY_FRAME_A : KEY_FRAME_B;
        const bst_text_line *f = &r->meta[k];
        bool eme = is_word(f, "EME2000") || is_word(f, "J2000");
        inertial[i] = eme || is_word(f, "GCRF") || is_word(f, "ICRF");
        bool body = f->length >= 7 && strncasecmp(f->text, "SC_BODY", 7) == 0;
        if (!inertial[i] && !body) {
            return fail_meta(r, k, "is not one that is read",
                             "GCRF, ICRF, EME2000 for one frame, SC_BODY for the other");
        }
        if (eme) {
            double bias[3][3], precession[3][3], both[3][3];
            bst_mat3 m;
            eraBp06(ERFA_DJ00, 0.0, bias, precession, both);
            memcpy(m.m, bias, sizeof bias);
            r->inertial_from_gcrf = bst_quat_from_mat3(&m);
        }
    }
    if (inertial[0] == inertial[1]) {
        return fail_meta(r, KEY_FRAME_B, "is of the same kind as REF_FRAME_A",
                         "one inertial frame and one SC_BODY");
    }
    r->body_first = inertial[1];
    return BST_OK;
}

/* Euler sequence: three digits (version 1) or letters. */
static bst_status read_order(reader *r) {
    const bst_text_line *s = &r->meta[KEY_EULER_ORDER];
    bool good = s->text && s->length == 3;
    for (int i = 0; i < 3 && good; i++) {
        char c = s->text[i];
        r->axis[i] = c >= '1' && c <= '3'   ? c - '1'
                     : c >= 'X' && c <= 'Z' ? c - 'X'
                     : c >= 'x' && c <= 'z' ? c - 'x'
                                            : -1;
        good = r->axis[i] >= 0 && (i == 0 || r->axis[i] != r->axis[i - 1]);
    }
    if (!s->text) {
        return bst_fail(r->source.ctx, BST_ERR_FORMAT,
                        "%.400s:%d: EULER_ROT_SEQ is missing from this metadata (allowed: as 321 "
                        "or ZYX)",
                        r->source.name, r->meta_line);
    }
    return good ? BST_OK
                : fail_meta(r, KEY_EULER_ORDER, "is no sequence of axes", "as 321, 313 or ZYX");
}

static bst_status read_type(reader *r) {
    for (r->type = 0; r->type < TYPES; r->type++) {
        if (is_word(&r->meta[KEY_TYPE], types[r->type].name)) {
            break;
        }
    }
    if (r->type == TYPES) {
        return fail_meta(r, KEY_TYPE, "is not one that is read",
                         "QUATERNION, EULER_ANGLE (with /RATE, /DERIVATIVE, /ANGVEL) or SPIN");
    }
    r->backward = is_word(&r->meta[KEY_DIRECTION], "B2A");
    if (r->meta[KEY_DIRECTION].text && !r->backward && !is_word(&r->meta[KEY_DIRECTION], "A2B")) {
        return fail_meta(r, KEY_DIRECTION, "is no direction", "A2B or B2A");
    }
    r->scalar_first = is_word(&r->meta[KEY_QUATERNION_TYPE], "FIRST");
    if (r->meta[KEY_QUATERNION_TYPE].text && !r->scalar_first &&
        !is_word(&r->meta[KEY_QUATERNION_TYPE], "LAST")) {
        return fail_meta(r, KEY_QUATERNION_TYPE, "is no order", "FIRST or LAST: place of QC");
    }
    return types[r->type].form == FORM_EULER ? read_order(r) : BST_OK;
}

static bst_status read_date(const reader *r, const bst_text_line *line, bst_text_span text,
                            double *seconds) {
    bst_time t;
    bst_status status = bst_ccsds_time(r->source.ctx, text.text, text.length, r->system, &t);
    if (status != BST_OK) {
        return bst_fail_prefix(r->source.ctx, BST_ERR_FORMAT, "%.400s:%d", r->source.name,
                               line->number);
    }
    *seconds = bst_time_diff(t, r->epoch);
    return BST_OK;
}

/* Whether the segment is of the wanted object. */
static bst_status choose(reader *r) {
    const bst_text_line *id = &r->meta[KEY_OBJECT_ID], *named = &r->meta[KEY_OBJECT_NAME];
    char name[WORD_BYTES];
    bst_text_copy((bst_text_span){named->text, named->length}, name, sizeof name);
    if (!*r->object) {
        if (*r->first_name && strcmp(name, r->first_name) != 0) {
            return fail_meta(r, KEY_OBJECT_NAME, "is a second object of the file",
                             "one object, or the key `object` that names one");
        }
        memcpy(r->first_name, name, sizeof name);
    }
    r->wanted = !*r->object || strcmp(name, r->object) == 0 ||
                bst_text_is((bst_text_span){id->text, id->length}, r->object);
    r->found = r->found || r->wanted;
    return BST_OK;
}

static bst_status finish_meta(reader *r) {
    for (int k = 0; k < NEEDED_KEYS; k++) {
        if (!r->meta[k].text) {
            return bst_fail(r->source.ctx, BST_ERR_FORMAT,
                            "%.400s:%d: %s is missing from this metadata (allowed: all of "
                            "OBJECT_NAME, OBJECT_ID, REF_FRAME_A, REF_FRAME_B, TIME_SYSTEM, "
                            "START_TIME, STOP_TIME, ATTITUDE_TYPE)",
                            r->source.name, r->meta_line, key_names[k]);
        }
    }
    char system[8] = "";
    const bst_text_line *s = &r->meta[KEY_TIME_SYSTEM];
    for (size_t i = 0; i < s->length && i < sizeof system - 1; i++) {
        char c = s->text[i];
        system[i] = c >= 'a' && c <= 'z' ? (char)(c - 'a' + 'A') : c;
    }
    if (!bst_astro_time_system_find(system, s->length, &r->system)) {
        return fail_meta(r, KEY_TIME_SYSTEM, "is not one that is read", "UTC, TAI, TT, TDB or GPS");
    }
    r->inertial_from_gcrf = BST_QUAT_IDENTITY;
    BST_TRY(read_frames(r));
    BST_TRY(read_type(r));
    BST_TRY(choose(r));
    double *const dates[] = {&r->start_s, &r->stop_s};
    for (int i = 0; i < 2; i++) {
        const bst_text_line *d = &r->meta[KEY_START_TIME + i];
        BST_TRY(read_date(r, d, (bst_text_span){d->text, d->length}, dates[i]));
    }
    if (!(r->stop_s >= r->start_s)) {
        return fail_meta(r, KEY_STOP_TIME, "is before START_TIME", "a later date");
    }
    r->segment_rows = 0;
    r->where = BEFORE_DATA;
    return BST_OK;
}

static bst_status read_meta(reader *r) {
    bst_text_span name, value;
    if (is_word(&r->line, "META_STOP")) {
        return finish_meta(r);
    }
    BST_TRY(bst_text_split(&r->source, &r->line, &name, &value));
    int k = find_name(name, key_names);
    if (k < 0) {
        return bst_text_fail_line(&r->source, &r->line, "the keyword is not known here",
                                  "a keyword of an AEM's metadata (504.0-B-2) such as REF_FRAME_A");
    }
    if (r->meta[k].text) {
        return bst_text_fail_line(&r->source, &r->line, "the keyword is given twice",
                                  "each keyword once");
    }
    r->meta[k] = (bst_text_line){value.text, value.length, r->line.number};
    return BST_OK;
}

static bst_quat turn_about(bst_quat q, int axis, double deg) {
    double a = deg * BST_DEG_RAD;
    return bst_quat_turn_frame(
        q, (bst_vec3){axis == 0 ? a : 0.0, axis == 1 ? a : 0.0, axis == 2 ? a : 0.0});
}

/* Frame B from frame A by the numbers of a row. */
static bst_status make_attitude(const reader *r, const double *v, bst_quat *out) {
    if (types[r->type].form == FORM_EULER) {
        *out = BST_QUAT_IDENTITY;
        for (int i = 0; i < 3; i++) {
            *out = turn_about(*out, r->axis[i], v[i]);
        }
        return BST_OK;
    }
    if (types[r->type].form == FORM_SPIN) { /* the spin axis is z; x at angle 0 is its node */
        *out = turn_about(turn_about(BST_QUAT_IDENTITY, 2, v[0] + 90.0), 0, 90.0 - v[1]);
        *out = turn_about(*out, 2, v[2]);
        return BST_OK;
    }
    int c = r->scalar_first ? 0 : 3, first = r->scalar_first ? 1 : 0;
    bst_quat q = {v[first], v[first + 1], v[first + 2], v[c]};
    double norm = sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
    if (!(fabs(norm - 1.0) < NORM_SLACK)) {
        return bst_text_fail_line(&r->source, &r->line, "the quaternion has not the length 1",
                                  "a unit quaternion");
    }
    *out = bst_quat_conj(bst_quat_unit(q));
    return BST_OK;
}

static bst_status append(reader *r, double seconds, bst_quat q) {
    if (r->count == r->capacity) {
        int capacity = r->capacity ? 2 * r->capacity : 256;
        bst_attitude_row *rows =
            r->count < ROWS_MAX ? realloc(r->rows, (size_t)capacity * sizeof *rows) : NULL;
        if (!rows) {
            return bst_text_fail_memory(&r->source, "attitudes");
        }
        r->rows = rows;
        r->capacity = capacity;
    }
    r->rows[r->count++] = (bst_attitude_row){seconds, q};
    return BST_OK;
}

/* Takes a row of the wanted object. */
static bst_status take_row(reader *r, double seconds, const double *v) {
    double before = r->count > 0 ? r->rows[r->count - 1].seconds : -INFINITY;
    if (!(seconds > before) && !(r->segment_rows == 0 && seconds == before)) {
        return bst_text_fail_line(&r->source, &r->line,
                                  "the epoch is not after that of the attitude before it",
                                  "epochs that rise");
    }
    if (seconds < r->start_s - 1e-3 || seconds > r->stop_s + 1e-3) {
        return bst_text_fail_line(&r->source, &r->line,
                                  "the epoch is outside of START_TIME to STOP_TIME",
                                  "epochs within the segment's span");
    }
    if (types[r->type].form == FORM_SPIN && r->segment_rows > 0 &&
        fabs(v[3]) * (seconds - before) > 180.0) {
        return bst_text_fail_line(
            &r->source, &r->line,
            "the satellite spins by more than half a turn since the row before",
            "rows that stand closer");
    }
    bst_quat q;
    BST_TRY(make_attitude(r, v, &q));
    bool to_body = r->backward == r->body_first; /* the row gives the body from the frame */
    q = bst_quat_mul(to_body ? q : bst_quat_conj(q), r->inertial_from_gcrf);
    BST_TRY(append(r, seconds, q));
    r->segment_rows++;
    return BST_OK;
}

static bst_status read_row(reader *r) {
    bst_text_span rest = {r->line.text, r->line.length}, word;
    double seconds = 0.0, v[8];
    int n = 0, wanted = types[r->type].numbers;
    char expected[80];
    snprintf(expected, sizeof expected, "an epoch and %d numbers (%s)", wanted,
             types[r->type].name);
    (void)bst_text_next_word(&rest, &word);
    BST_TRY(read_date(r, &r->line, word, &seconds));
    while (bst_text_next_word(&rest, &word)) {
        if (n == wanted || !bst_text_number(word, &v[n])) {
            return bst_text_fail_at(&r->source, &r->line,
                                    n == wanted ? "is one word too many" : "is not a number",
                                    word.text, word.length, expected);
        }
        n++;
    }
    if (n < wanted) {
        return bst_text_fail_line(&r->source, &r->line, "fewer numbers than its type has",
                                  expected);
    }
    return r->wanted ? take_row(r, seconds, v) : BST_OK;
}

static bst_status read_line(reader *r) {
    switch (r->where) {
        case IN_HEAD:
            return read_head(r);
        case IN_META:
            return read_meta(r);
        case BEFORE_DATA:
            if (!is_word(&r->line, "DATA_START")) {
                return bst_text_fail_line(&r->source, &r->line, "a line between metadata and data",
                                          "DATA_START");
            }
            r->where = IN_DATA;
            return BST_OK;
        case AFTER_DATA:
            return is_word(&r->line, "META_START")
                       ? read_head(r)
                       : bst_text_fail_line(&r->source, &r->line, "a line after the data",
                                            "META_START, or the end");
        default:
            break;
    }
    if (!is_word(&r->line, "DATA_STOP")) {
        return read_row(r);
    }
    if (r->wanted && r->segment_rows == 0) {
        return bst_text_fail_line(&r->source, &r->line, "no attitudes stand before it",
                                  "at least one row");
    }
    r->where = AFTER_DATA;
    return BST_OK;
}

static bst_status read_lines(reader *r, const char *data, size_t bytes) {
    bst_text_cursor cursor = bst_text_start(data, bytes);
    while (bst_text_next_line(&cursor, &r->line)) {
        bst_text_span s = bst_text_trimmed((bst_text_span){r->line.text, r->line.length});
        r->line.text = s.text;
        r->line.length = s.length;
        bool comment = s.length >= 7 && memcmp(s.text, "COMMENT", 7) == 0;
        if (s.length > 0 && !comment) {
            BST_TRY(read_line(r));
        }
    }
    if (r->where != AFTER_DATA) {
        return bst_fail(r->source.ctx, BST_ERR_FORMAT,
                        "%.400s:%d: the file ends before its data do (expected %s)", r->source.name,
                        cursor.line_number > 0 ? cursor.line_number : 1,
                        r->where == IN_HEAD   ? "META_START"
                        : r->where == IN_META ? "META_STOP"
                        : r->where == IN_DATA ? "DATA_STOP"
                                              : "DATA_START");
    }
    return r->found ? BST_OK
                    : bst_fail(r->source.ctx, BST_ERR_NOT_FOUND,
                               "%.400s: no object \"%.64s\" (allowed: an OBJECT_NAME or OBJECT_ID "
                               "of the file)",
                               r->source.name, r->object);
}

bool bst_aem_is(const char *data, size_t bytes) {
    bst_text_cursor cursor = bst_text_start(data, bytes);
    bst_text_line line;
    while (bst_text_next_line(&cursor, &line)) {
        bst_text_span s = bst_text_trimmed((bst_text_span){line.text, line.length});
        if (s.length > 0 && !(s.length >= 7 && memcmp(s.text, "COMMENT", 7) == 0)) {
            return s.length >= 14 && memcmp(s.text, head_names[0], 14) == 0;
        }
    }
    return false;
}

bst_status bst_aem_read(bst_ctx *ctx, const char *name, const char *data, size_t bytes,
                        const char *object, bst_time epoch, bst_attitude_row **rows, int *count) {
    *rows = NULL;
    *count = 0;
    BST_TRY(bst_file_check_text(ctx, name, data, bytes));
    reader r = {.source = {ctx, name}, .object = object, .epoch = epoch};
    bst_status status = read_lines(&r, data, bytes);
    if (status != BST_OK) {
        free(r.rows);
        return status;
    }
    *rows = r.rows;
    *count = r.count;
    return BST_OK;
}
