#include "sim/astro/state_table.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/astro/ccsds_time.h"
#include "sim/astro/interpolate.h"
#include "sim/core/file.h"
#include "sim/core/text.h"
#include "sim/core/text_reader.h"

#define MAX_FILE_BYTES ((uint64_t)128 << 20)
#define SLACK_S 1e-6

enum { MAX_COLUMNS = 64, MAX_LINE = 65536 };

typedef enum column {
    COLUMN_OBJECT,
    COLUMN_STATES, /* columns of start position, velocity, end position, velocity: 12 */
    COLUMN_START_S = COLUMN_STATES + 12,
    COLUMN_END_S,
    COLUMN_START_UTC,
    COLUMN_END_UTC,
    COLUMNS
} column;

static const char *const column_names[COLUMNS] = {
    "object",       "start_x_m", "start_y_m", "start_z_m", "start_vx_mps", "start_vy_mps",
    "start_vz_mps", "end_x_m",   "end_y_m",   "end_z_m",   "end_vx_mps",   "end_vy_mps",
    "end_vz_mps",   "start_s",   "end_s",     "start_utc", "end_utc"};

/* One row of a state table: an object in a frame. */
typedef struct frame {
    bst_text_span name; /* in the file's text */
    int line;
    bst_astro_table_state start, end;
} frame;

typedef struct object {
    char *name;
    int64_t first, count; /* in bst_state_table.states */
} object;

struct bst_state_table {
    char *name;                    /* of the file, for messages */
    bst_astro_table_state *states; /* start and end of each frame, sorted by object, then by time */
    object *objects;
    int object_count;
};

typedef struct reader {
    bst_text_source source;
    bst_time epoch;
    int columns[MAX_COLUMNS]; /* our column of each column in the file */
    bool has[COLUMNS];
    int width;
    frame *frames;
    int64_t count, capacity;
} reader;

static bst_status fail_column(const reader *r, const bst_text_line *line, int c,
                              bst_text_span found, const char *problem, const char *expected) {
    char text[120];
    snprintf(text, sizeof text, "%s %s", column_names[c], problem);
    return bst_text_fail_at(&r->source, line, text, found.text, found.length, expected);
}

/* Index of a column name; the error suggests the nearest name. */
static bst_status find_column(const reader *r, const bst_text_line *line, bst_text_span name,
                              int *out) {
    char word[64];
    size_t best = SIZE_MAX;
    const char *nearest = "a column of docs/reference/file_formats.md";
    bst_text_copy(name, word, sizeof word);
    for (int c = 0; c < COLUMNS; c++) {
        if (bst_text_is(name, column_names[c])) {
            *out = c;
            return BST_OK;
        }
        if (bst_text_is_nearer(word, column_names[c], &best)) {
            nearest = column_names[c];
        }
    }
    return bst_text_fail_at(&r->source, line, "the column is not known", name.text, name.length,
                            nearest);
}

static bst_status read_header(reader *r, const bst_text_line *line, const bst_text_span *fields,
                              int count) {
    for (int i = 0; i < count; i++) {
        BST_TRY(find_column(r, line, fields[i], &r->columns[i]));
        if (r->has[r->columns[i]]) {
            return bst_text_fail_at(&r->source, line, "a column comes twice", fields[i].text,
                                    fields[i].length, "each column once");
        }
        r->has[r->columns[i]] = true;
    }
    for (int c = 0; c < COLUMN_START_S; c++) {
        if (!r->has[c]) {
            return bst_fail(r->source.ctx, BST_ERR_FORMAT, "%.400s:%d: the column %s is missing",
                            r->source.name, line->number, column_names[c]);
        }
    }
    for (int c = COLUMN_START_S; c <= COLUMN_END_S; c++) {
        if (r->has[c] == r->has[c + 2]) {
            return bst_fail(r->source.ctx, BST_ERR_FORMAT,
                            "%.400s:%d: one column of %s and %s is expected, not %s",
                            r->source.name, line->number, column_names[c], column_names[c + 2],
                            r->has[c] ? "both" : "none");
        }
    }
    r->width = count;
    return BST_OK;
}

/* Reads the time of a row: seconds after the epoch, or UTC. */
static bst_status read_instant(const reader *r, const bst_text_line *line, int c,
                               bst_text_span text, double *seconds) {
    bst_time t;
    if (c < COLUMN_START_UTC) {
        return bst_text_number(text, seconds) && *seconds >= -1e9 && *seconds <= 1e9
                   ? BST_OK
                   : fail_column(r, line, c, text, "is not a number in the range",
                                 "-1e9 to 1e9 seconds after the epoch");
    }
    if (bst_ccsds_time(r->source.ctx, text.text, text.length, BST_TIME_UTC, &t) != BST_OK) {
        return bst_fail_prefix(r->source.ctx, BST_ERR_FORMAT, "%.400s:%d: %s", r->source.name,
                               line->number, column_names[c]);
    }
    *seconds = bst_time_diff(t, r->epoch);
    return BST_OK;
}

/* Appends a row of the state table. */
static bst_status append(reader *r, const frame *f) {
    if (r->count == r->capacity) {
        int64_t capacity = r->capacity ? 2 * r->capacity : 64;
        frame *frames = realloc(r->frames, (size_t)capacity * sizeof *frames);
        if (!frames) {
            return bst_text_fail_memory(&r->source, "states");
        }
        r->frames = frames;
        r->capacity = capacity;
    }
    r->frames[r->count++] = *f;
    return BST_OK;
}

static bst_status read_frame(reader *r, const bst_text_line *line, const bst_text_span *fields) {
    frame f = {.line = line->number};
    double v[12];
    for (int i = 0; i < r->width; i++) {
        int c = r->columns[i];
        if (c == COLUMN_OBJECT) {
            f.name = fields[i];
            if (fields[i].length == 0 || fields[i].length > 63 || !bst_text_is_plain(fields[i]) ||
                memchr(fields[i].text, '"', fields[i].length)) {
                return fail_column(r, line, c, fields[i], "is not a name",
                                   "1 to 63 characters of printable ASCII without quotes");
            }
        } else if (c < COLUMN_START_S) {
            if (!bst_text_number(fields[i], &v[c - COLUMN_STATES])) {
                return fail_column(r, line, c, fields[i], "is not a number", "m or m/s");
            }
        } else {
            bool start = c == COLUMN_START_S || c == COLUMN_START_UTC;
            BST_TRY(read_instant(r, line, c, fields[i], start ? &f.start.t_s : &f.end.t_s));
        }
    }
    if (!(f.end.t_s > f.start.t_s)) {
        return bst_fail(r->source.ctx, BST_ERR_FORMAT,
                        "%.400s:%d: the frame does not end after it starts", r->source.name,
                        line->number);
    }
    f.start.position_m = (bst_vec3){v[0], v[1], v[2]};
    f.start.velocity_mps = (bst_vec3){v[3], v[4], v[5]};
    f.end.position_m = (bst_vec3){v[6], v[7], v[8]};
    f.end.velocity_mps = (bst_vec3){v[9], v[10], v[11]};
    return append(r, &f);
}

static bst_status read_lines(reader *r, const char *data, size_t bytes, char *scratch) {
    bst_text_cursor cursor = bst_text_start(data, bytes);
    bst_text_line line;
    bst_text_span fields[MAX_COLUMNS];
    while (bst_text_next_line(&cursor, &line)) {
        if (line.length == 0 || line.text[0] == '#') {
            continue;
        }
        int count = line.length > MAX_LINE
                        ? MAX_COLUMNS + 1
                        : bst_text_split_csv(&line, scratch, fields, MAX_COLUMNS);
        if (count > MAX_COLUMNS) {
            return bst_text_fail_at(&r->source, &line, "the line is too long", line.text,
                                    line.length, "at most 64 columns and 65536 bytes");
        }
        if (count < 0) {
            return bst_text_fail_at(&r->source, &line, "a quoted field does not end", line.text,
                                    line.length, "\"field\", with \"\" for a quote within");
        }
        if (r->width == 0) {
            BST_TRY(read_header(r, &line, fields, count));
        } else if (count != r->width) {
            char problem[80];
            snprintf(problem, sizeof problem, "%d fields, where the header row has %d", count,
                     r->width);
            return bst_text_fail_at(&r->source, &line, problem, line.text, line.length,
                                    "one field for each column");
        } else {
            BST_TRY(read_frame(r, &line, fields));
        }
    }
    if (r->count == 0) {
        return bst_fail(r->source.ctx, BST_ERR_FORMAT,
                        "%.400s:%d: the file holds no states (expected a header row and a row per "
                        "object and frame)",
                        r->source.name, cursor.line_number > 0 ? cursor.line_number : 1);
    }
    return BST_OK;
}

static int compare_names(bst_text_span a, bst_text_span b) {
    size_t shorter = a.length < b.length ? a.length : b.length;
    int order = memcmp(a.text, b.text, shorter);
    return order ? order : (a.length > b.length) - (a.length < b.length);
}

static int compare_frames(const void *x, const void *y) {
    const frame *a = x, *b = y;
    int order = compare_names(a->name, b->name);
    return order ? order : (a->line > b->line) - (a->line < b->line);
}

/* Builds the table: sorts frames by object; frames of one object must follow each other in time. */
static bst_status build(reader *r, bst_state_table *out) {
    qsort(r->frames, (size_t)r->count, sizeof *r->frames, compare_frames);
    int objects = 0;
    for (int64_t i = 0; i < r->count; i++) {
        objects += i == 0 || compare_names(r->frames[i - 1].name, r->frames[i].name) != 0;
    }
    out->states = malloc(2 * (size_t)r->count * sizeof *out->states);
    out->objects = calloc((size_t)objects, sizeof *out->objects);
    if (!out->states || !out->objects) {
        return bst_text_fail_memory(&r->source, "states");
    }
    for (int64_t i = 0; i < r->count; i++) {
        const frame *f = &r->frames[i];
        object *o = &out->objects[out->object_count - (out->object_count > 0)];
        if (i == 0 || compare_names(f[-1].name, f->name) != 0) {
            o = &out->objects[out->object_count++];
            o->first = 2 * i;
            o->name = strndup(f->name.text, f->name.length);
            if (!o->name) {
                return bst_text_fail_memory(&r->source, "states");
            }
        } else if (f->start.t_s < f[-1].end.t_s) {
            return bst_fail(r->source.ctx, BST_ERR_FORMAT,
                            "%.400s:%d: the frame of \"%s\" starts before the one of line %d ends",
                            r->source.name, f->line, o->name, f[-1].line);
        }
        out->states[2 * i] = f->start;
        out->states[2 * i + 1] = f->end;
        o->count += 2;
    }
    return BST_OK;
}

bst_status bst_state_table_read_buffer(bst_ctx *ctx, const char *name, const char *data,
                                       size_t bytes, bst_time epoch, bst_state_table **out) {
    *out = NULL;
    BST_TRY(bst_file_check_text(ctx, name, data, bytes));
    reader r = {.source = {ctx, name}, .epoch = epoch};
    bst_state_table *injected = calloc(1, sizeof *injected);
    char *scratch = malloc(MAX_LINE);
    bst_status status = injected && scratch ? BST_OK : bst_text_fail_memory(&r.source, "states");
    if (status == BST_OK) {
        status = read_lines(&r, data, bytes, scratch);
    }
    if (status == BST_OK) {
        status = build(&r, injected);
    }
    if (status == BST_OK) {
        injected->name = strdup(name);
        status = injected->name ? BST_OK : bst_text_fail_memory(&r.source, "states");
    }
    free(scratch);
    free(r.frames);
    if (status != BST_OK) {
        bst_state_table_free(injected);
        return status;
    }
    *out = injected;
    return BST_OK;
}

bst_status bst_state_table_create(bst_ctx *ctx, const char *name,
                                  const bst_state_table_frame *frames, int64_t count,
                                  bst_state_table **out) {
    *out = NULL;
    reader r = {.source = {ctx, name}, .frames = NULL};
    bst_state_table *injected = calloc(1, sizeof *injected);
    bst_status status = injected && (injected->name = strdup(name))
                            ? BST_OK
                            : bst_text_fail_memory(&r.source, "states");
    if (status == BST_OK && count < 1) {
        status = bst_fail(ctx, BST_ERR_FORMAT, "%.400s: holds no states of objects", name);
    }
    for (int64_t i = 0; status == BST_OK && i < count; i++) {
        const bst_state_table_frame *from = &frames[i];
        frame f = {.name = {from->object, strlen(from->object)},
                   .line = (int)from->number,
                   .start = {from->start_s, from->start_position_m, from->start_velocity_mps},
                   .end = {from->end_s, from->end_position_m, from->end_velocity_mps}};
        status = append(&r, &f);
    }
    if (status == BST_OK) {
        status = build(&r, injected);
    }
    free(r.frames);
    if (status != BST_OK) {
        bst_state_table_free(injected);
        return status;
    }
    *out = injected;
    return BST_OK;
}

bst_status bst_state_table_load(bst_ctx *ctx, const char *path, bst_time epoch,
                                bst_state_table **out) {
    *out = NULL;
    char *data;
    size_t bytes;
    BST_TRY(bst_file_read(ctx, path, MAX_FILE_BYTES, "a file of states per frame (CSV)", &data,
                          &bytes));
    bst_status status = bst_state_table_read_buffer(ctx, path, data, bytes, epoch, out);
    free(data);
    return status;
}

void bst_state_table_free(bst_state_table *injected) {
    if (injected) {
        for (int i = 0; i < injected->object_count; i++) {
            free(injected->objects[i].name);
        }
        free(injected->objects);
        free(injected->states);
        free(injected->name);
        free(injected);
    }
}

int bst_state_table_object_count(const bst_state_table *injected) {
    return injected->object_count;
}
const char *bst_state_table_object_name(const bst_state_table *injected, int index) {
    return injected->objects[index].name;
}

bst_status bst_state_table_find(bst_ctx *ctx, const bst_state_table *injected, const char *name,
                                int *index) {
    *index = 0;
    if (!*name && injected->object_count == 1) {
        return BST_OK;
    }
    for (int i = 0; i < injected->object_count; i++) {
        if (strcmp(injected->objects[i].name, name) == 0) {
            *index = i;
            return BST_OK;
        }
    }
    return bst_fail(ctx, BST_ERR_NOT_FOUND,
                    "%.400s: no object \"%.100s\" among %d (the first: \"%s\")", injected->name,
                    name, injected->object_count, injected->objects[0].name);
}

void bst_state_table_span(const bst_state_table *injected, int index, double *start_s,
                          double *end_s) {
    const object *o = &injected->objects[index];
    *start_s = injected->states[o->first].t_s;
    *end_s = injected->states[o->first + o->count - 1].t_s;
}

bst_status bst_state_table_state(bst_ctx *ctx, const bst_state_table *injected, int index,
                                 double seconds, bst_vec3 *position_m, bst_vec3 *velocity_mps) {
    const object *o = &injected->objects[index];
    double start_s, end_s;
    bst_state_table_span(injected, index, &start_s, &end_s);
    if (!(seconds >= start_s - SLACK_S && seconds <= end_s + SLACK_S)) {
        return bst_fail(ctx, BST_ERR_NUMERIC,
                        "%.400s: no state of \"%s\" %.6f s after the epoch: the file covers %.6f s "
                        "to %.6f s",
                        injected->name, o->name, seconds, start_s, end_s);
    }
    const bst_astro_table_state *states = injected->states + o->first;
    int64_t near = bst_interpolate_find(states, o->count, seconds);
    near = near < o->count - 1 ? near : o->count - 2;
    bst_interpolate(states + near, 2, seconds, 2, true, position_m, velocity_mps);
    return BST_OK;
}
