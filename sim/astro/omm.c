/* Reads CCSDS Orbit Mean-elements Messages (502.0-B-3) as JSON and CSV. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cjson/cJSON.h>

#include "boresight/config.h"
#include "boresight/vec.h"
#include "sim/astro/ccsds_time.h"
#include "sim/astro/elements_internal.h"

typedef enum key {
    KEY_OBJECT_NAME,
    KEY_OBJECT_ID,
    KEY_NORAD_CAT_ID,
    KEY_EPOCH,
    KEY_MEAN_MOTION,
    KEY_ECCENTRICITY,
    KEY_INCLINATION,
    KEY_RA_OF_ASC_NODE,
    KEY_ARG_OF_PERICENTER,
    KEY_MEAN_ANOMALY,
    KEY_BSTAR,
    KEY_MEAN_MOTION_DOT,
    KEY_MEAN_MOTION_DDOT,
    KEY_ELEMENT_SET_NO,
    KEY_REV_AT_EPOCH,
    KEY_EPHEMERIS_TYPE,
    KEY_CENTER_NAME,
    KEY_REF_FRAME,
    KEY_TIME_SYSTEM,
    KEY_MEAN_ELEMENT_THEORY,
    KEYS
} key;

static const char *const key_names[KEYS] = {
    "OBJECT_NAME",       "OBJECT_ID",      "NORAD_CAT_ID", "EPOCH",
    "MEAN_MOTION",       "ECCENTRICITY",   "INCLINATION",  "RA_OF_ASC_NODE",
    "ARG_OF_PERICENTER", "MEAN_ANOMALY",   "BSTAR",        "MEAN_MOTION_DOT",
    "MEAN_MOTION_DDOT",  "ELEMENT_SET_NO", "REV_AT_EPOCH", "EPHEMERIS_TYPE",
    "CENTER_NAME",       "REF_FRAME",      "TIME_SYSTEM",  "MEAN_ELEMENT_THEORY"};

/* One message: texts of its keys and its position in the file. */
typedef struct record {
    const bst_text_source *source;
    int line;                  /* CSV; 0: JSON */
    int index;                 /* JSON: index in the array; -1: a single object */
    bst_text_span value[KEYS]; /* text NULL: absent */
    bool is_number[KEYS];      /* JSON: the value is a number */
    double number[KEYS];
} record;

/* Position for messages: "file:12: KEY" or "file: /3/KEY". */
static void locate(const record *r, const char *name, char *where, size_t bytes) {
    if (r->line > 0) {
        snprintf(where, bytes, "%.400s:%d: %s", r->source->name, r->line, name);
    } else if (r->index >= 0) {
        snprintf(where, bytes, "%.400s: /%d/%s", r->source->name, r->index, name);
    } else {
        snprintf(where, bytes, "%.400s: /%s", r->source->name, name);
    }
}

static bst_status fail_value(const record *r, key k, const char *problem, const char *expected) {
    char where[480], quoted[BST_TEXT_QUOTE_BYTES];
    locate(r, key_names[k], where, sizeof where);
    bst_text_quote(r->value[k].text, r->value[k].length, quoted);
    return bst_fail(r->source->ctx, BST_ERR_FORMAT, "%s: %s (found %s, expected %s)", where,
                    problem, quoted, expected);
}

static bst_status fail_missing(const record *r, key k) {
    char where[480];
    locate(r, key_names[k], where, sizeof where);
    return bst_fail(r->source->ctx, BST_ERR_FORMAT, "%s: is missing", where);
}

static bst_status read_number(const record *r, key k, const char *expected, double *out) {
    if (!r->value[k].text) {
        return fail_missing(r, k);
    }
    if (r->is_number[k]) {
        *out = r->number[k];
    } else if (!bst_text_number(r->value[k], out)) {
        return fail_value(r, k, "is not a number", expected);
    }
    return BST_OK;
}

static bst_status read_range(const record *r, key k, double low, double high, const char *expected,
                             double *out) {
    BST_TRY(read_number(r, k, expected, out));
    return *out >= low && *out <= high ? BST_OK : fail_value(r, k, "is out of range", expected);
}

/* 0 where it is absent. */
static bst_status read_optional(const record *r, key k, double *out) {
    *out = 0.0;
    return r->value[k].text ? read_number(r, k, "a number", out) : BST_OK;
}

static bst_status read_count(const record *r, key k, int maximum, const char *expected, int *out) {
    if (r->is_number[k]) {
        double value = r->number[k];
        if (!(value >= 0.0 && value <= maximum) || value != floor(value)) {
            return fail_value(r, k, "is not a whole number in the range", expected);
        }
        *out = (int)value;
        return BST_OK;
    }
    return bst_text_count(r->value[k], maximum, out)
               ? BST_OK
               : fail_value(r, k, "is not a whole number in the range", expected);
}

static bst_status read_number_of_satellite(const record *r, int *out) {
    return r->value[KEY_NORAD_CAT_ID].text
               ? read_count(r, KEY_NORAD_CAT_ID, BST_NORAD_MAX, "0 to 999999999", out)
               : fail_missing(r, KEY_NORAD_CAT_ID);
}

static bst_status check_word(const record *r, key k, const char *word, const char *other) {
    return !r->value[k].text || bst_text_is(r->value[k], word) || bst_text_is(r->value[k], other)
               ? BST_OK
               : fail_value(r, k, "is not what SGP4 element sets have", word);
}

static bst_status read_text(const record *r, key k, char *out, size_t bytes) {
    if (r->value[k].text) {
        if (r->is_number[k] || !bst_text_is_plain(r->value[k])) {
            return fail_value(r, k, "is not plain text", "printable ASCII");
        }
        bst_text_copy(r->value[k], out, bytes);
    }
    return BST_OK;
}

/* Shortens an international designator to TLE form: "2019-081A" to "19081A"; others are
 * unchanged. */
static void shorten_designator(char *d) {
    if (strlen(d) >= 9 && strspn(d, "0123456789") == 4 && d[4] == '-' &&
        strspn(d + 5, "0123456789") == 3) {
        d[0] = d[2];
        d[1] = d[3];
        memmove(d + 2, d + 5, strlen(d + 5) + 1);
    }
}

static bst_status read_epoch(const record *r, bst_elements *out) {
    bst_text_span text = r->value[KEY_EPOCH];
    if (!text.text) {
        return fail_missing(r, KEY_EPOCH);
    }
    bst_status status = bst_ccsds_utc_jd(r->source->ctx, text.text, text.length,
                                         &out->epoch_utc_jd1, &out->epoch_utc_jd2);
    if (status != BST_OK) {
        char where[480];
        locate(r, key_names[KEY_EPOCH], where, sizeof where);
        return bst_fail_prefix(r->source->ctx, BST_ERR_FORMAT, "%s", where);
    }
    return BST_OK;
}

static bst_status read_theory(const record *r) {
    BST_TRY(check_word(r, KEY_MEAN_ELEMENT_THEORY, "SGP4", "SGP/SGP4"));
    BST_TRY(check_word(r, KEY_REF_FRAME, "TEME", "TEME"));
    BST_TRY(check_word(r, KEY_TIME_SYSTEM, "UTC", "UTC"));
    BST_TRY(check_word(r, KEY_CENTER_NAME, "EARTH", "Earth"));
    if (r->value[KEY_EPHEMERIS_TYPE].text) {
        int type;
        BST_TRY(read_count(r, KEY_EPHEMERIS_TYPE, 9, "0 to 9", &type));
        if (type == 4) {
            return fail_value(r, KEY_EPHEMERIS_TYPE, "is that of SGP4-XP, which is not modelled",
                              "0 or 2, which are SGP4's");
        }
    }
    return BST_OK;
}

static bst_status read_elements(const record *r, bst_elements *out) {
    static const char *const angle = "-360 to 360 degrees";
    memset(out, 0, sizeof *out);
    BST_TRY(read_number_of_satellite(r, &out->norad));
    BST_TRY(read_theory(r));
    BST_TRY(read_epoch(r, out));
    double degrees[4], rev_per_day;
    BST_TRY(read_range(r, KEY_MEAN_MOTION, 0.0, 1e4, "above 0, to 10000 revolutions per day",
                       &rev_per_day));
    if (!(rev_per_day > 0.0)) {
        return fail_value(r, KEY_MEAN_MOTION, "is out of range",
                          "above 0, to 10000 revolutions per day");
    }
    BST_TRY(read_range(r, KEY_ECCENTRICITY, 0.0, 1.0, "0 to below 1", &out->eccentricity));
    if (!(out->eccentricity < 1.0)) {
        return fail_value(r, KEY_ECCENTRICITY, "is out of range", "0 to below 1");
    }
    BST_TRY(read_range(r, KEY_INCLINATION, 0.0, 180.0, "0 to 180 degrees", &degrees[0]));
    BST_TRY(read_range(r, KEY_RA_OF_ASC_NODE, -360.0, 360.0, angle, &degrees[1]));
    BST_TRY(read_range(r, KEY_ARG_OF_PERICENTER, -360.0, 360.0, angle, &degrees[2]));
    BST_TRY(read_range(r, KEY_MEAN_ANOMALY, -360.0, 360.0, angle, &degrees[3]));
    BST_TRY(read_range(r, KEY_BSTAR, -1e9, 1e9, "-1e9 to 1e9 per Earth radius", &out->bstar));
    BST_TRY(read_optional(r, KEY_MEAN_MOTION_DOT, &out->ndot_rev_day2));
    BST_TRY(read_optional(r, KEY_MEAN_MOTION_DDOT, &out->nddot_rev_day3));
    if (r->value[KEY_ELEMENT_SET_NO].text) {
        BST_TRY(
            read_count(r, KEY_ELEMENT_SET_NO, BST_NORAD_MAX, "0 to 999999999", &out->element_set));
    }
    if (r->value[KEY_REV_AT_EPOCH].text) {
        BST_TRY(read_count(r, KEY_REV_AT_EPOCH, BST_NORAD_MAX, "0 to 999999999", &out->revolution));
    }
    out->inclination_rad = degrees[0] >= 180.0 ? BST_PI : degrees[0] * BST_DEG_RAD;
    out->raan_rad = degrees[1] * BST_DEG_RAD;
    out->arg_perigee_rad = degrees[2] * BST_DEG_RAD;
    out->mean_anomaly_rad = degrees[3] * BST_DEG_RAD;
    out->mean_motion_radpmin = rev_per_day * (2.0 * BST_PI / 1440.0);
    BST_TRY(read_text(r, KEY_OBJECT_NAME, out->name, sizeof out->name));
    char designator[24] = "";
    BST_TRY(read_text(r, KEY_OBJECT_ID, designator, sizeof designator));
    shorten_designator(designator);
    snprintf(out->designator, sizeof out->designator, "%.11s", designator);
    return BST_OK;
}

static bst_status read_record(bst_elements_reader *reader, const record *r) {
    int norad;
    if (reader->options.norad != 0) {
        BST_TRY(read_number_of_satellite(r, &norad));
        if (norad != reader->options.norad) {
            reader->others++;
            return BST_OK;
        }
    }
    bst_elements set;
    BST_TRY(read_elements(r, &set));
    return bst_elements_append(reader, &set);
}

static int find_key(bst_text_span name) {
    for (int k = 0; k < KEYS; k++) {
        if (bst_text_is(name, key_names[k])) {
            return k;
        }
    }
    return -1;
}

static bst_status read_object(bst_elements_reader *reader, const cJSON *object, int index) {
    record r = {.source = &reader->source, .index = index};
    char where[480];
    locate(&r, "", where, sizeof where);
    if (!cJSON_IsObject(object)) {
        where[strlen(where) - (index >= 0)] = '\0';
        return bst_fail(reader->source.ctx, BST_ERR_FORMAT,
                        "%s: is not an object (expected an orbit mean-elements message)", where);
    }
    /* numbers as text, for messages */
    char numbers[KEYS][32];
    for (const cJSON *item = object->child; item; item = item->next) {
        int k = find_key((bst_text_span){item->string, strlen(item->string)});
        if (k < 0 || cJSON_IsNull(item)) {
            continue;
        }
        if (cJSON_IsNumber(item)) {
            r.is_number[k] = true;
            r.number[k] = item->valuedouble;
            snprintf(numbers[k], sizeof numbers[k], "%.15g", item->valuedouble);
            r.value[k] = (bst_text_span){numbers[k], strlen(numbers[k])};
        } else if (cJSON_IsString(item)) {
            bst_text_span text =
                bst_text_trimmed((bst_text_span){item->valuestring, strlen(item->valuestring)});
            if (text.length > 0) {
                r.value[k] = text;
            }
        } else {
            locate(&r, key_names[k], where, sizeof where);
            return bst_fail(reader->source.ctx, BST_ERR_FORMAT,
                            "%s: is neither a number nor a string", where);
        }
    }
    return read_record(reader, &r);
}

bst_status bst_astro_omm_read_json(bst_elements_reader *reader, const char *data, size_t bytes) {
    bst_json *json;
    bst_status status = bst_json_parse(reader->source.ctx, reader->source.name, data, bytes, &json);
    if (status != BST_OK) {
        return status == BST_ERR_MEMORY ? status : BST_ERR_FORMAT;
    }
    const cJSON *root = bst_json_root(json);
    if (cJSON_IsArray(root)) {
        int index = 0;
        for (const cJSON *item = root->child; item && status == BST_OK; item = item->next) {
            status = bst_elements_tolerate(reader, read_object(reader, item, index++));
        }
    } else {
        status = bst_elements_tolerate(reader, read_object(reader, root, -1));
    }
    bst_json_free(json);
    return status;
}

enum { MAX_COLUMNS = 256, MAX_LINE = 65536 };

/* Assigns a key to each CSV column; -1: unknown. */
static bst_status read_header(const bst_text_source *source, const bst_text_line *line,
                              const bst_text_span *fields, int count, int *columns) {
    bool seen[KEYS] = {false};
    for (int i = 0; i < count; i++) {
        columns[i] = find_key(fields[i]);
        if (columns[i] >= 0) {
            if (seen[columns[i]]) {
                return bst_text_fail_at(source, line, "a column comes twice", fields[i].text,
                                        fields[i].length, "each column once");
            }
            seen[columns[i]] = true;
        }
    }
    return BST_OK;
}

static bst_status read_rows(bst_elements_reader *reader, const char *data, size_t bytes,
                            char *scratch) {
    const bst_text_source *source = &reader->source;
    bst_text_cursor cursor = bst_text_start(data, bytes);
    bst_text_line line;
    bst_text_span fields[MAX_COLUMNS];
    int columns[MAX_COLUMNS], width = 0;
    while (bst_text_next_line(&cursor, &line)) {
        if (line.length == 0 || line.text[0] == '#') {
            continue;
        }
        int count = line.length > MAX_LINE
                        ? MAX_COLUMNS + 1
                        : bst_text_split_csv(&line, scratch, fields, MAX_COLUMNS);
        bst_status status = BST_OK;
        if (count > MAX_COLUMNS) {
            return bst_text_fail_at(source, &line, "the line is too long", line.text, line.length,
                                    "at most 256 columns and 65536 bytes");
        }
        if (count < 0) {
            status = bst_text_fail_at(source, &line, "a quoted field does not end", line.text,
                                      line.length, "\"field\", with \"\" for a quote within");
        } else if (width == 0) {
            BST_TRY(read_header(source, &line, fields, count, columns));
            width = count;
            continue;
        } else if (count != width) {
            char problem[80];
            snprintf(problem, sizeof problem, "%d fields, where the header row has %d", count,
                     width);
            status = bst_text_fail_at(source, &line, problem, line.text, line.length,
                                      "one field for each column");
        } else {
            record r = {.source = source, .line = line.number};
            for (int i = 0; i < count; i++) {
                if (columns[i] >= 0 && fields[i].length > 0) {
                    r.value[columns[i]] = fields[i];
                }
            }
            status = read_record(reader, &r);
        }
        if (width == 0) {
            return status;
        }
        BST_TRY(bst_elements_tolerate(reader, status));
    }
    return BST_OK;
}

bst_status bst_astro_omm_read_csv(bst_elements_reader *reader, const char *data, size_t bytes) {
    char *scratch = malloc(MAX_LINE);
    if (!scratch) {
        return bst_fail(reader->source.ctx, BST_ERR_MEMORY, "%.400s: no memory to read it",
                        reader->source.name);
    }
    bst_status status = read_rows(reader, data, bytes, scratch);
    free(scratch);
    return status;
}
