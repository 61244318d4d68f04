#include <math.h>
#include <string.h>

#include "sim/app/report_plots.h"

enum { LANES = 4, ROWS = LANES + 1, STATES = 4 };

/* A lane tells which of a few states holds; state -1: none of them. */
typedef struct lane {
    const char *name;
    int (*state)(const bst_report_frame *f);
    struct {
        const char *word;
        int colour;
    } states[STATES];
} lane;

static int sight_of(const bst_report_frame *f) {
    return !f->known ? -1 : f->occulted ? 1 : f->dark ? 2 : f->visible ? 0 : 3;
}

static int field_of(const bst_report_frame *f) {
    return f->in_field ? 0 : -1;
}

static int track_of(const bst_report_frame *f) {
    return f->in_track ? 0 : -1;
}

static int attitude_of(const bst_report_frame *f) {
    return f->attitude ? 0 : -1;
}

static const lane lanes[LANES] = {
    {"target",
     sight_of,
     {{"visible", BST_CHART_GREEN},
      {"behind the Earth", BST_CHART_GREY},
      {"in the Earth's shadow", BST_CHART_VIOLET},
      {"gives no light", BST_CHART_BROWN}}},
    {"target in the field", field_of, {{"in the field", BST_CHART_BLUE}}},
    {"right target in track", track_of, {{"in track", BST_CHART_GREEN}}},
    {"attitude from stars", attitude_of, {{"attitude", BST_CHART_CYAN}}},
};

/* Upper and lower edge of a row, on the axis. */
#define ROW_TOP(row) (ROWS - (row)-0.18)
#define ROW_BOTTOM(row) (ROWS - (row)-0.82)

static void put_span(const bst_report_drawing *d, const bst_chart *c, int row, double from,
                     double to, int colour, const char *word) {
    double width = c->inner_width * (to - from) / (c->x.high - c->x.low);
    char title[128];
    snprintf(title, sizeof title, "%s: %.6g s to %.6g s", word, from * d->unit_s, to * d->unit_s);
    /* nobody points at what is a hair wide */
    bst_chart_bar(c, from, to, ROW_BOTTOM(row), ROW_TOP(row), colour, width > 3.0 ? title : NULL);
}

static void put_modes(const bst_report_drawing *d, const bst_chart *c) {
    const bst_report_spans *s = d->modes;
    for (int i = 0; i < s->count; i++) {
        const char *word = bst_mode_name(s->mode[i]);
        put_span(d, c, 0, s->from[i], s->to[i], BST_CHART_MODE + s->mode[i], word);
        double width = c->inner_width * (s->to[i] - s->from[i]) / (c->x.high - c->x.low);
        if (width > 8.0 * (double)strlen(word)) {
            bst_chart_word(c, 0.5 * (s->from[i] + s->to[i]), ROWS - 0.5, 0.0, 4.0, "middle", word);
        }
    }
}

/* Draws the spans of a lane; a gap too short to be seen does not end one. */
static void put_lane(const bst_report_drawing *d, const bst_chart *c, const lane *l, int row) {
    const bst_report_sensor *s = d->sensor;
    double seen = (c->x.high - c->x.low) / c->inner_width; /* of the axis' unit */
    for (size_t i = 0; i < s->count;) {
        int state = l->state(&s->frames[i]);
        size_t last = i;
        for (size_t next = i + 1; next < s->count; next++) {
            if (l->state(&s->frames[next]) == state) {
                last = next;
            } else if (d->x[next] - d->x[last] > seen) {
                break;
            }
        }
        size_t next = last + 1;
        if (state >= 0) {
            double end = next < s->count ? d->x[next] : c->x.high;
            put_span(d, c, row, d->x[i], end, l->states[state].colour, l->states[state].word);
        }
        i = next;
    }
}

void bst_report_timeline(const bst_report_drawing *d) {
    const bst_report_sensor *s = d->sensor;
    bool shown[LANES] = {false}, sights[STATES] = {false}, modes[BST_MODE_COUNT] = {false};
    for (size_t i = 0; i < s->count; i++) {
        for (int k = 0; k < LANES; k++) {
            shown[k] = shown[k] || lanes[k].state(&s->frames[i]) >= 0;
        }
        int sight = sight_of(&s->frames[i]);
        if (sight >= 0) {
            sights[sight] = true;
        }
    }
    for (size_t i = 0; i < s->mode_count; i++) {
        if (s->modes[i].mode >= 0) {
            modes[s->modes[i].mode] = true;
        }
    }
    /* shown even where they never came to be */
    shown[1] = s->has_truth;
    shown[2] = s->has_truth && s->has_tracks;
    shown[3] = s->has_tracks;
    if (s->mode_count == 0 && !shown[0] && !shown[3]) {
        return;
    }
    bst_page_figure(d->out, BST_PAGE_WIDE);
    bst_chart c = {.out = d->out,
                   .name =
                       "Timeline of the mode of control, of the target's visibility, of the "
                       "track and of the attitude",
                   .width = 1100.0,
                   .height = 50.0 + 30.0 * ROWS,
                   .margin_left = 160.0,
                   .x = {.label = d->time_label, .low = 0.0, .high = d->span_s / d->unit_s},
                   .y = {.label = "", .low = 0.0, .high = ROWS, .bare = true}};
    bst_chart_begin(&c);
    put_modes(d, &c);
    for (int row = 0; row < ROWS; row++) {
        bool there = row == 0 ? s->mode_count > 0 : shown[row - 1];
        bst_chart_word(&c, c.x.low, ROWS - row - 0.5, -8.0, 4.0, "end",
                       row == 0 ? "mode" : lanes[row - 1].name);
        if (!there) {
            bst_chart_word(&c, c.x.low, ROWS - row - 0.5, 8.0, 4.0, "start", "not recorded");
        } else if (row > 0) {
            put_lane(d, &c, &lanes[row - 1], row);
        }
    }
    bst_chart_end(&c);
    fputs("<ul class=\"legend\">\n", d->out);
    for (int i = 0; i < BST_MODE_COUNT; i++) {
        if (modes[i]) {
            bst_chart_legend(d->out, BST_KEY_GROUND, BST_CHART_MODE + i, bst_mode_name(i));
        }
    }
    for (int i = 0; i < STATES; i++) {
        if (sights[i]) {
            bst_chart_legend(d->out, BST_KEY_GROUND, lanes[0].states[i].colour,
                             lanes[0].states[i].word);
        }
    }
    fputs("</ul>\n", d->out);
    bst_page_figure_end(d->out,
                        "What control did, and what there was to see. The colours of the modes are "
                        "the ground of the charts below.");
}
