/* Reads the charts of a report's page back: their axes by the printed numbers, and what is drawn in
 * them in the units of the axes. */
#ifndef BST_TESTS_REPORT_SVG_CHART_H
#define BST_TESTS_REPORT_SVG_CHART_H

#include <stdbool.h>

#include "tests/test_support.h"

/* value = low + slope * position, of the logarithm to base 10 on a logarithmic axis */
typedef struct svg_axis {
    double low, slope;
    bool logarithmic;
} svg_axis;

typedef struct svg_chart {
    const char *from, *to, *caption; /* of its SVG element; the text after it */
    double left, top, width, height; /* of the plotting area */
    svg_axis x, y;
} svg_chart;

typedef struct svg_bar {
    double x0, x1, y0, y1;
    char title[200];
} svg_bar;

/* The next place of `text` before `to`, after it; NULL: none. */
static inline const char *svg_after(const char *from, const char *to, const char *text) {
    const char *at = from ? strstr(from, text) : NULL;
    return at && at < to ? at + strlen(text) : NULL;
}

static inline double svg_value(const svg_axis *axis, double position) {
    double v = axis->low + axis->slope * position;
    return axis->logarithmic ? pow(10.0, v) : v;
}

/* Finds an axis by its first and last number. The grid's path ends with H or V. */
static inline bool svg_find_axis(const svg_chart *c, bool vertical, bool logarithmic,
                                 svg_axis *axis) {
    double at[2] = {0}, value[2] = {0};
    int count = 0;
    for (const char *p = c->from; (p = svg_after(p, c->to, "<path class=\"g\" d=\"M")) != NULL;) {
        double x, y, number;
        char end;
        int used = 0;
        assert_int_equal(sscanf(p, "%lf %lf%c", &x, &y, &end), 3);
        const char *text = svg_after(p, c->to, "<text ");
        text = svg_after(text, c->to, ">");
        assert_true(text && sscanf(text, "%lf%n", &number, &used) == 1 && text[used] == '<');
        if ((end == 'H') == vertical) {
            int k = count++ > 0;
            at[k] = vertical ? y : x;
            value[k] = logarithmic ? log10(number) : number;
        }
    }
    if (count < 2) {
        return false;
    }
    axis->slope = (value[1] - value[0]) / (at[1] - at[0]);
    axis->low = value[0] - axis->slope * at[0];
    axis->logarithmic = logarithmic;
    return true;
}

/* Finds the chart whose description begins so. `log_x`, `log_y`: axes by decades. */
static inline bool svg_find(const char *page, const char *name, bool log_x, bool log_y,
                            svg_chart *c) {
    char label[300];
    snprintf(label, sizeof label, "aria-label=\"%s", name);
    *c = (svg_chart){.from = strstr(page, label)};
    if (!c->from) {
        return false;
    }
    const char *frame = strstr(c->from, "<rect class=\"f\" ");
    assert_non_null(frame);
    assert_int_equal(
        sscanf(frame, "<rect class=\"f\" x=\"%lf\" y=\"%lf\" width=\"%lf\" height=\"%lf\"",
               &c->left, &c->top, &c->width, &c->height),
        4);
    c->to = frame;
    c->caption = strstr(frame, "</svg>");
    svg_find_axis(c, false, log_x, &c->x);
    if (!svg_find_axis(c, true, log_y, &c->y)) { /* without numbers: from 0 to 1 */
        c->y = (svg_axis){1.0 + c->top / c->height, -1.0 / c->height, false};
    }
    return true;
}

static inline svg_chart svg_need(const char *page, const char *name, bool log_x, bool log_y) {
    svg_chart c;
    if (!svg_find(page, name, log_x, log_y, &c)) {
        fail_msg("no chart \"%s\"", name);
    }
    return c;
}

/* Ends of the axes, from the frame of the plotting area. */
static inline double svg_low_x(const svg_chart *c) {
    return svg_value(&c->x, c->left);
}
static inline double svg_high_x(const svg_chart *c) {
    return svg_value(&c->x, c->left + c->width);
}
static inline double svg_low_y(const svg_chart *c) {
    return svg_value(&c->y, c->top + c->height);
}
static inline double svg_high_y(const svg_chart *c) {
    return svg_value(&c->y, c->top);
}

/* Points of the n-th path of a class, "l c0" for a line or "l o c0" for dots; their number.
 */
static inline int svg_points(const svg_chart *c, const char *class_of, int number, double *x,
                             double *y, int room) {
    char mark[80];
    const char *p = c->from;
    snprintf(mark, sizeof mark, "<path class=\"%s", class_of);
    for (int i = 0; i <= number; i++) {
        p = svg_after(p, c->to, mark);
        if (!p) {
            return -1;
        }
    }
    p = svg_after(p, c->to, " d=\"");
    assert_non_null(p);
    long px = 0, py = 0;
    int count = 0, used;
    while (*p != '"') {
        long dx, dy;
        bool absolute = *p == 'M';
        p += *p == 'M' || *p == 'l' || *p == ' ';
        if (strncmp(p, "h0", 2) == 0 || *p == 'z') {
            p += *p == 'z' ? 1 : 2;
            continue;
        }
        assert_int_equal(sscanf(p, "%ld %ld%n", &dx, &dy, &used), 2);
        p += used;
        bool first_again = !absolute && dx == 0 && dy == 0;
        px = absolute ? dx : px + dx;
        py = absolute ? dy : py + dy;
        if (!first_again) {
            assert_true(count < room);
            x[count] = svg_value(&c->x, c->left + 0.1 * (double)px);
            y[count++] = svg_value(&c->y, c->top + 0.1 * (double)py);
        }
    }
    return count;
}

/* Bars of a colour, -1: of any; their number. */
static inline int svg_bars(const svg_chart *c, int colour, svg_bar *bars, int room) {
    int count = 0;
    for (const char *p = c->from; (p = svg_after(p, c->to, "<rect class=\"h c")) != NULL;) {
        int own, used = 0;
        double x, y, width, height;
        assert_int_equal(sscanf(p, "%d\" x=\"%lf\" y=\"%lf\" width=\"%lf\" height=\"%lf\"%n", &own,
                                &x, &y, &width, &height, &used),
                         5);
        if (colour >= 0 && own != colour) {
            continue;
        }
        assert_true(count < room);
        svg_bar *b = &bars[count++];
        *b = (svg_bar){svg_value(&c->x, x), svg_value(&c->x, x + width),
                       svg_value(&c->y, y + height), svg_value(&c->y, y), ""};
        const char *end = strchr(p + used, '>'); /* behind the values */
        assert_non_null(end);
        if (strncmp(end, "><title>", 8) == 0) {
            const char *title = end + 8;
            snprintf(b->title, sizeof b->title, "%.*s", (int)(strstr(title, "</title>") - title),
                     title);
        }
    }
    return count;
}

/* The number after these words of a text; NAN: they are not there. */
static inline double svg_number_after(const char *text, const char *words) {
    const char *at = strstr(text, words);
    double number;
    if (!at) {
        return NAN;
    }
    at += strlen(words);
    at += strspn(at, " ");
    if (strncmp(at, "<span class=\"w\">", 16) == 0) {
        at += 16;
    }
    return sscanf(at, "%lf", &number) == 1 ? number : NAN;
}

/* Fails unless the number after the words is this one to so many digits. */
static inline void svg_expect_number(const char *text, const char *words, double value,
                                     int digits) {
    double shown = svg_number_after(text, words);
    double unit = pow(10.0, floor(log10(fabs(value))) + 1 - digits);
    if (!(fabs(shown - value) <= 0.5001 * unit)) {
        fail_msg("\"%s\" is followed by %.9g, expected %.9g: %.300s", words, shown, value, text);
    }
}

#endif
