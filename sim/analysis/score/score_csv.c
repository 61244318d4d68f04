/* Points from a CSV file with a line of names. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/analysis/score/score_points.h"

enum { COLUMN_X, COLUMN_Y, COLUMN_FRAME, COLUMN_SCORE, COLUMN_ID, COLUMN_SEQUENCE, COLUMNS };
enum { MOST_FIELDS = 64 };

/* Names of the columns that are read. */
static const char *const names[COLUMNS][3] = {
    [COLUMN_X] = {"x", "x_px", NULL},
    [COLUMN_Y] = {"y", "y_px", NULL},
    [COLUMN_FRAME] = {"frame", "exposure_id", NULL},
    [COLUMN_SCORE] = {"score", "snr", NULL},
    [COLUMN_ID] = {"id", "track", "track_id"},
    [COLUMN_SEQUENCE] = {"sequence", "sequence_id", NULL},
};

/* A CSV file being read. */
typedef struct csv {
    bst_ctx *ctx;
    const char *name;
    int line;
    int place[COLUMNS]; /* field of each column; -1: none */
    char *fields[MOST_FIELDS];
    int count;
} csv;

static bst_status wrong(const csv *c, const char *what, const char *found) {
    return bst_fail(c->ctx, BST_ERR_FORMAT, "%.400s:%d: %s (found \"%.60s\")", c->name, c->line,
                    what, found);
}

/* Splits a line at its commas and removes blanks around the fields. */
static void split(csv *c, char *line) {
    c->count = 0;
    for (char *rest = line; rest && c->count < MOST_FIELDS;) {
        char *comma = strchr(rest, ',');
        if (comma) {
            *comma = '\0';
        }
        rest += strspn(rest, " \t");
        size_t length = strcspn(rest, "\r\n");
        while (length > 0 && (rest[length - 1] == ' ' || rest[length - 1] == '\t')) {
            length--;
        }
        rest[length] = '\0';
        c->fields[c->count++] = rest;
        rest = comma ? comma + 1 : NULL;
    }
}

static bst_status read_names(csv *c) {
    for (int k = 0; k < COLUMNS; k++) {
        c->place[k] = -1;
        for (int i = 0; i < c->count; i++) {
            for (int n = 0; n < 3 && names[k][n]; n++) {
                if (strcmp(c->fields[i], names[k][n]) == 0) {
                    c->place[k] = i;
                }
            }
        }
    }
    if (c->place[COLUMN_X] < 0 || c->place[COLUMN_Y] < 0 || c->place[COLUMN_FRAME] < 0) {
        return wrong(c,
                     "the first line must name the columns x, y and frame (allowed besides: score, "
                     "id, sequence)",
                     c->fields[0]);
    }
    return BST_OK;
}

/* Text of a column in the current line; "" if it is not there. */
static const char *text_of(const csv *c, int column) {
    return c->place[column] >= 0 && c->place[column] < c->count ? c->fields[c->place[column]] : "";
}

static bst_status real_of(const csv *c, int column, double fallback, double *out) {
    const char *text = text_of(c, column);
    char *end;
    *out = fallback;
    if (*text) {
        *out = strtod(text, &end);
        if (*end || !isfinite(*out)) {
            return wrong(c, "a finite number is expected", text);
        }
    }
    return BST_OK;
}

static bst_status whole_of(const csv *c, int column, int64_t fallback, int64_t *out) {
    double value;
    BST_TRY(real_of(c, column, (double)fallback, &value));
    if (value != floor(value) || !(fabs(value) < 9e15)) {
        return wrong(c, "an integer is expected", text_of(c, column));
    }
    *out = (int64_t)value;
    return BST_OK;
}

/* Adds the point of a line; without x and y only its frame. */
static bst_status add_line(csv *c, bst_score_points *points) {
    bst_score_point p = {.id = -1};
    if (!*text_of(c, COLUMN_FRAME)) {
        return wrong(c, "the frame is missing", c->fields[0]);
    }
    BST_TRY(whole_of(c, COLUMN_FRAME, 0, &p.key.frame));
    BST_TRY(whole_of(c, COLUMN_SEQUENCE, 0, &p.key.sequence));
    bool has_x = *text_of(c, COLUMN_X) != '\0', has_y = *text_of(c, COLUMN_Y) != '\0';
    if (!has_x && !has_y) {
        return bst_score_points_add_frame(c->ctx, points, p.key);
    }
    if (!has_x || !has_y) {
        return wrong(c, "x and y are expected, or neither for a frame without a point",
                     has_x ? text_of(c, COLUMN_X) : text_of(c, COLUMN_Y));
    }
    BST_TRY(real_of(c, COLUMN_X, NAN, &p.x_px));
    BST_TRY(real_of(c, COLUMN_Y, NAN, &p.y_px));
    BST_TRY(real_of(c, COLUMN_SCORE, NAN, &p.score));
    BST_TRY(whole_of(c, COLUMN_ID, -1, &p.id));
    return bst_score_points_add(c->ctx, points, &p);
}

bst_status bst_score_points_add_csv(bst_ctx *ctx, const char *name, char *text,
                                    bst_score_points *points) {
    csv c = {.ctx = ctx, .name = name};
    bool named = false;
    static const char byte_order_mark[] = "\xEF\xBB\xBF"; /* spreadsheets write it */
    if (strncmp(text, byte_order_mark, sizeof byte_order_mark - 1) == 0) {
        text += sizeof byte_order_mark - 1;
    }
    for (char *line = text; line && *line;) {
        char *end = strchr(line, '\n');
        if (end) {
            *end = '\0';
        }
        c.line++;
        split(&c, line);
        if (*c.fields[0] != '#' && (c.count > 1 || *c.fields[0])) {
            BST_TRY(named ? add_line(&c, points) : read_names(&c));
            named = true;
        }
        line = end ? end + 1 : NULL;
    }
    return named ? BST_OK
                 : bst_fail(ctx, BST_ERR_FORMAT,
                            "%.400s: is empty (allowed: a line that names the columns x, y and "
                            "frame, and a line a point)",
                            name);
}
