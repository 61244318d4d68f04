#include <inttypes.h>
#include <math.h>
#include <string.h>

#include "sim/core/text.h"
#include "sim/report/report_plots.h"

/* A run with more than EXACT frames is drawn as fractions of INTERVALS intervals. */
enum { LANES = 4, ROWS = LANES + 1, STATES = 4, INTERVALS = 230, EXACT = 2 * INTERVALS };

/* A lane shows one of a few states over time; state -1: none. */
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

/* upper and lower edge of a row on the axis */
#define ROW_TOP(row) (ROWS - (row)-0.18)
#define ROW_BOTTOM(row) (ROWS - (row)-0.82)

static void put_span(const bst_report_drawing *d, const bst_chart *c, int row, double from,
                     double to, int colour, const char *word) {
    double width = c->inner_width * (to - from) / (c->x.high - c->x.low);
    char title[128];
    snprintf(title, sizeof title, "%s: %.6g s to %.6g s", word, from * d->unit_s, to * d->unit_s);
    /* no tooltip for very narrow spans */
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

/* Draws the states of a lane frame by frame; consecutive equal states form one span. */
static void put_frames(const bst_report_drawing *d, const bst_chart *c, const lane *l, int row) {
    const bst_report_sensor *s = d->sensor;
    for (size_t i = 0, next; i < s->count; i = next) {
        int state = l->state(&s->frames[i]);
        for (next = i + 1; next < s->count && l->state(&s->frames[next]) == state; next++) {
        }
        if (state >= 0) {
            double end = next < s->count ? d->x[next] : c->x.high;
            put_span(d, c, row, d->x[i], end, l->states[state].colour, l->states[state].word);
        }
    }
}

/* Number of frames in an interval, in total and per state. */
typedef struct interval {
    int64_t frames, in[STATES];
} interval;

/* Checks whether all frames of an interval have the same state: *state, -1: none. */
static bool is_uniform(const interval *v, int *state) {
    *state = -1;
    int64_t in = 0;
    for (int k = 0; k < STATES; k++) {
        in += v->in[k];
        *state = v->in[k] > 0 ? k : *state;
    }
    return in == 0 || (v->frames > 0 && v->in[*state] == v->frames);
}

/* Draws the states of an interval stacked by their fractions of the frames. */
static void put_shares(const bst_report_drawing *d, const bst_chart *c, const lane *l, int row,
                       const interval *v, double from, double to) {
    double bottom = ROW_BOTTOM(row), height = ROW_TOP(row) - ROW_BOTTOM(row);
    for (int k = 0; k < STATES; k++) {
        if (v->in[k] == 0) {
            continue;
        }
        double share = (double)v->in[k] / (double)v->frames;
        char title[160];
        snprintf(title, sizeof title, "%s: %.1f %% of %s from %.6g s to %.6g s", l->states[k].word,
                 100.0 * share,
                 bst_text_of_count((char[BST_COUNT_TEXT]){0}, v->frames, "frame", "frames"),
                 from * d->unit_s, to * d->unit_s);
        bst_chart_bar(c, from, to, bottom, bottom + share * height, l->states[k].colour, title);
        bottom += share * height;
    }
}

/* Draws a lane with many frames by intervals: rare states stay visible. */
static void put_intervals(const bst_report_drawing *d, const bst_chart *c, const lane *l, int row) {
    const bst_report_sensor *s = d->sensor;
    interval intervals[INTERVALS] = {{0}};
    double width = (c->x.high - c->x.low) / INTERVALS;
    for (size_t i = 0; i < s->count; i++) {
        double at = fmax(0.0, fmin((d->x[i] - c->x.low) / width, INTERVALS - 1.0));
        interval *v = &intervals[(int)at];
        int state = l->state(&s->frames[i]);
        v->frames++;
        if (state >= 0) {
            v->in[state]++;
        }
    }
    for (int i = 0, next; i < INTERVALS; i = next) {
        int state, other;
        bool uniform = is_uniform(&intervals[i], &state);
        for (next = i + 1;
             uniform && next < INTERVALS && is_uniform(&intervals[next], &other) && other == state;
             next++) {
        }
        double from = c->x.low + i * width, to = c->x.low + next * width;
        if (!uniform) {
            put_shares(d, c, l, row, &intervals[i], from, to);
        } else if (state >= 0) {
            put_span(d, c, row, from, to, l->states[state].colour, l->states[state].word);
        }
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
    /* shown even if they never occurred */
    shown[1] = s->has_truth;
    shown[2] = s->has_truth && s->has_tracks;
    shown[3] = s->has_tracks;
    if (s->mode_count == 0 && !shown[0] && !shown[3]) {
        return;
    }
    bst_report_page_figure(d->out, BST_PAGE_WIDE);
    bst_chart c = {.out = d->out,
                   .name =
                       "Timeline of the mode of control, of the target's visibility, of the "
                       "track and of the attitude",
                   .width = 1100.0,
                   .height = 50.0 + 30.0 * ROWS,
                   .margin_left = 160.0,
                   .x = bst_report_time_axis(d),
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
            (s->count > EXACT ? put_intervals : put_frames)(d, &c, &lanes[row - 1], row);
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
    bst_report_page_figure_end(
        d->out, s->count > EXACT
                    ? "What control did, and what there was to see: the height of a bar is "
                      "the share of the frames of its interval. The colours of the modes "
                      "are the ground of the charts below."
                    : "What control did, and what there was to see. The colours of the "
                      "modes are the ground of the charts below.");
}
