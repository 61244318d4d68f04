#include "sim/io/chart.h"

#include <math.h>
#include <stdlib.h>

#include "boresight/messages.h"
#include "sim/io/chart_values.h"
#include "sim/io/html.h"

/* margins around the plotting area; the left margin belongs to the chart */
#define MARGIN_TOP 10.0
#define MARGIN_RIGHT 16.0
#define MARGIN_BOTTOM 40.0
#define MARGIN_BARE 12.0
/* path coordinates per unit of the chart */
#define FINE 10.0
/* values off the axes are drawn at most this many heights away */
#define OFF_SCALE 2.0

enum { MOST_TICKS = 40, MOST_COLUMNS = 512 };

void bst_chart_style(FILE *out) {
    /* after Okabe and Ito, darker for a light background; then the backgrounds of the modes */
    static const char *const light[] = {"#0b62a8", "#c25b00", "#00795a", "#b3261e",
                                        "#8b3f86", "#7a5a00", "#1a8fb8", "#6b7480"};
    static const char *const dark[] = {"#6db3f2", "#f0a04b", "#4cc9a0", "#ff8a80",
                                       "#d59bd0", "#d9b64a", "#7fd3ee", "#a3adba"};
    static const char *const modes[BST_MODE_COUNT] = {
        "#9aa0a6", "#3f7fca", "#e39a1f", "#d6485a", "#2e9e4f", "#a45fc0",
        "#4b9a80", "#2f95b5", "#5a55a5", "#a8902a", "#3ba39b", "#8a5a3c",
    };
    fputs(":root{", out);
    for (int i = 0; i < BST_CHART_MODE; i++) {
        fprintf(out, "--k%d:%s;", i, light[i]);
    }
    fputs(
        "--ink:#1b1f24;--soft:#57606a;--paper:#fff;--panel:#f6f8fa;--line:#8a939d;--grid:#e3e7ec}"
        "\n@media (prefers-color-scheme:dark){@media screen{:root{",
        out);
    for (int i = 0; i < BST_CHART_MODE; i++) {
        fprintf(out, "--k%d:%s;", i, dark[i]);
    }
    fputs(
        "--ink:#e6e9ed;--soft:#a3adba;--paper:#14181d;--panel:#1d232a;--line:#6b7682;"
        "--grid:#2c343d}}}\n",
        out);
    for (int i = 0; i < BST_CHART_MODE; i++) {
        fprintf(out, ".c%d{--c:var(--k%d)}", i, i);
    }
    for (int i = 0; i < BST_MODE_COUNT; i++) {
        fprintf(out, ".c%d{--c:%s}", BST_CHART_MODE + i, modes[i]);
    }
    fputs(
        "\n.chart{display:block;width:100%;height:auto}\n"
        ".chart text{font:12px system-ui,sans-serif;fill:var(--ink)}\n"
        ".chart .g{stroke:var(--grid);fill:none}.chart .f{stroke:var(--line);fill:none}\n"
        ".chart .l{stroke:var(--c);stroke-width:1.4;fill:none;stroke-linejoin:round;"
        "vector-effect:non-scaling-stroke}\n"
        ".chart .s{stroke-dasharray:5 4}.chart .o{stroke-width:3.4}\n"
        ".chart .b{fill:var(--c);fill-opacity:.16}.chart .a{fill:var(--c);fill-opacity:.22}\n"
        ".chart .h{fill:var(--c);fill-opacity:.75}.chart .r{stroke:var(--c);stroke-dasharray:2 3}\n"
        ".chart .w{stroke:var(--c);stroke-width:1.3}\n"
        ".legend{display:flex;flex-wrap:wrap;gap:.2em 1.2em;margin:.2em 0 0;padding:0;"
        "list-style:none;font-size:.85rem}\n"
        ".key{display:inline-block;width:1.3em;margin-right:.4em;vertical-align:middle;"
        "print-color-adjust:exact;-webkit-print-color-adjust:exact}\n"
        ".key.line{border-top:2.5px solid var(--c)}.key.dash{border-top:2.5px dashed var(--c)}\n"
        ".key.dot{width:.55em;height:.55em;border-radius:50%;background:var(--c)}\n"
        ".key.ground{height:.8em;background:var(--c);opacity:.6}\n",
        out);
}

void bst_chart_widen(const double *values, size_t n, bool logarithmic, double *low, double *high) {
    for (size_t i = 0; i < n; i++) {
        if (isfinite(values[i]) && (!logarithmic || values[i] > 0.0)) {
            *low = fmin(*low, values[i]);
            *high = fmax(*high, values[i]);
        }
    }
}

void bst_chart_fit(bst_chart_axis *axis, double low, double high, double margin) {
    if (!(low <= high)) {
        low = axis->logarithmic ? 0.1 : 0.0;
        high = 1.0;
    }
    if (axis->logarithmic) {
        axis->low = pow(10.0, floor(log10(low) + 1e-9));
        axis->high = pow(10.0, ceil(log10(high) - 1e-9));
        if (!(axis->high > axis->low)) {
            axis->high = 10.0 * axis->low;
        }
        return;
    }
    double length = high - low;
    if (!(length > 1e-9 * fmax(fabs(low), fabs(high)))) { /* below numerical resolution */
        length = fmax(fabs(low), 1.0) * 0.1;
        margin = 1.0;
    }
    axis->low = low - margin * length;
    axis->high = high + margin * length;
}

/* Tick values of a logarithmic chart axis. */
static int decades(double low, double high, int wanted, double *ticks, int room) {
    int first = (int)ceil(log10(low) - 1e-9), last = (int)floor(log10(high) + 1e-9), count = 0;
    int every = (last - first) / (wanted > 1 ? wanted : 1) + 1;
    bool between = last - first < 2; /* few decades: ticks at 2 and 5 too */
    for (int k = first - 1; k <= last; k++) {
        static const double steps[] = {1.0, 2.0, 5.0};
        for (int i = 0; i < 3; i++) {
            double value = steps[i] * pow(10.0, k);
            bool good = i == 0 ? k >= first && (k - first) % every == 0 : between;
            if (good && value >= low * (1.0 - 1e-9) && value <= high * (1.0 + 1e-9) &&
                count < room) {
                ticks[count++] = value;
            }
        }
    }
    return count;
}

int bst_chart_ticks(double low, double high, bool logarithmic, int wanted, double *ticks, int room,
                    int *decimals) {
    *decimals = -1;
    if (!isfinite(low) || !isfinite(high) || !(high > low) || (logarithmic && !(low > 0.0))) {
        return 0;
    }
    if (logarithmic) {
        return decades(low, high, wanted, ticks, room);
    }
    double raw = (high - low) / fmax(1.0, wanted), unit = pow(10.0, floor(log10(raw)));
    double step = raw <= 1.0001 * unit   ? unit
                  : raw <= 2.0001 * unit ? 2.0 * unit
                  : raw <= 5.0001 * unit ? 5.0 * unit
                                         : 10.0 * unit;
    double first = ceil(low / step - 1e-9), last = floor(high / step + 1e-9);
    int count = 0;
    for (double k = first; k <= last && count < room; k += 1.0) {
        ticks[count++] = k == 0.0 ? 0.0 : k * step; /* no -0 */
    }
    double digits = -floor(log10(step) + 1e-9);
    if (fmax(fabs(low), fabs(high)) < 1e9 && digits <= 9.0) {
        *decimals = digits > 0.0 ? (int)digits : 0;
    }
    return count;
}

/* Column of x when a line is thinned; x = high belongs to the last column. */
static double column_of(double x, double low, double scale, int columns) {
    return fmin(floor((x - low) * scale), columns - 1.0);
}

size_t bst_chart_thin(const double *x, const double *y, size_t n, double low, double high,
                      int columns, bst_chart_point *out) {
    size_t count = 0;
    if (n <= 4 * (size_t)columns) {
        for (size_t i = 0; i < n; i++) {
            out[count++] = (bst_chart_point){x[i], isfinite(y[i]) ? y[i] : NAN};
        }
        return count;
    }
    double scale = columns / (high - low);
    for (size_t i = 0; i < n;) {
        if (!(x[i] >= low && x[i] <= high)) {
            i++;
            continue;
        }
        double column = column_of(x[i], low, scale, columns);
        size_t first = n, lowest = n, highest = n, last = n;
        for (; i < n && x[i] <= high && column_of(x[i], low, scale, columns) <= column; i++) {
            if (!isfinite(y[i])) {
                continue;
            }
            first = first == n ? i : first;
            lowest = lowest == n || y[i] < y[lowest] ? i : lowest;
            highest = highest == n || y[i] > y[highest] ? i : highest;
            last = i;
        }
        if (first == n) {
            if (count > 0 && !isnan(out[count - 1].y)) {
                out[count++] = (bst_chart_point){low + (column + 0.5) / scale, NAN};
            }
            continue;
        }
        size_t order[4] = {first, lowest < highest ? lowest : highest,
                           lowest < highest ? highest : lowest, last};
        for (int k = 0; k < 4; k++) {
            if (k == 0 || order[k] != order[k - 1]) {
                out[count++] = (bst_chart_point){x[order[k]], y[order[k]]};
            }
        }
    }
    return count;
}

/* ------------------------------------------------------------------ axes */

/* Position of a value along a chart axis, as fraction of its length. */
static double along(const bst_chart_axis *axis, double value) {
    if (axis->logarithmic) {
        return value > 0.0 ? log(value / axis->low) / log(axis->high / axis->low) : -OFF_SCALE;
    }
    return (value - axis->low) / (axis->high - axis->low);
}

/* Limits v to low..high; NAN becomes `low`. */
static double clamp(double v, double low, double high) {
    return v > high ? high : v > low ? v : low;
}

/* x coordinate in the SVG, limited to the plotting area. */
static double inside_x(const bst_chart *c, double x) {
    return c->left + c->inner_width * clamp(along(&c->x, x), 0.0, 1.0);
}

/* Vertical position of a value, clamped to the chart, in SVG units. */
static double inside_y(const bst_chart *c, double y) {
    return c->top + c->inner_height * (1.0 - clamp(along(&c->y, y), 0.0, 1.0));
}

static int write_number(char text[40], double value, int decimals) {
    bool exponent = value != 0.0 && (fabs(value) >= 1e6 || fabs(value) < 1e-4);
    return decimals >= 0 ? snprintf(text, 40, "%.*f", decimals, value)
           : exponent    ? snprintf(text, 40, "%.6g", value)
                         : snprintf(text, 40, "%g", value);
}

static void put_number(FILE *out, double value, int decimals) {
    char text[40];
    write_number(text, value, decimals);
    fputs(text, out);
}

/* Computes the ticks of the vertical axis. */
static int y_ticks(const bst_chart *c, double ticks[MOST_TICKS], int *decimals) {
    return c->y.bare ? 0
                     : bst_chart_ticks(c->y.low, c->y.high, c->y.logarithmic,
                                       (int)(c->inner_height / 32.0), ticks, MOST_TICKS, decimals);
}

/* Left margin for the longest number of the vertical axis and its label. */
static double needed_left(const bst_chart *c) {
    double ticks[MOST_TICKS];
    int decimals, longest = 0, n = y_ticks(c, ticks, &decimals);
    for (int i = 0; i < n; i++) {
        char text[40];
        int length = write_number(text, ticks[i], decimals);
        longest = length > longest ? length : longest;
    }
    return 7.2 * longest + (c->y.label && c->y.label[0] ? 28.0 : 12.0);
}

static void put_x_axis(const bst_chart *c) {
    double ticks[MOST_TICKS], bottom = c->top + c->inner_height;
    int decimals,
        n = bst_chart_ticks(c->x.low, c->x.high, c->x.logarithmic,
                            (int)fmax(fmin(7.0, c->inner_width / 60.0), c->inner_width / 85.0),
                            ticks, MOST_TICKS, &decimals);
    for (int i = 0; i < n && !c->x.bare; i++) {
        double at = inside_x(c, ticks[i]);
        fprintf(c->out, "<path class=\"g\" d=\"M%.1f %.1fV%.1f\"/>", at, c->top, bottom);
        fprintf(c->out, "<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"middle\">", at, bottom + 16.0);
        put_number(c->out, ticks[i], decimals);
        fputs("</text>", c->out);
    }
    if (c->x.label && c->x.label[0]) {
        fprintf(c->out, "<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"middle\">",
                c->left + 0.5 * c->inner_width, bottom + 33.0);
        bst_html_text(c->out, c->x.label);
        fputs("</text>", c->out);
    }
}

static void put_y_axis(const bst_chart *c) {
    double ticks[MOST_TICKS];
    int decimals, n = y_ticks(c, ticks, &decimals);
    for (int i = 0; i < n; i++) {
        double at = inside_y(c, ticks[i]);
        fprintf(c->out, "<path class=\"g\" d=\"M%.1f %.1fH%.1f\"/>", c->left, at,
                c->left + c->inner_width);
        fprintf(c->out, "<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"end\">", c->left - 6.0,
                at + 4.0);
        put_number(c->out, ticks[i], decimals);
        fputs("</text>", c->out);
    }
    if (c->y.label && c->y.label[0]) {
        double middle = c->top + 0.5 * c->inner_height;
        fprintf(
            c->out,
            "<text x=\"14\" y=\"%.1f\" text-anchor=\"middle\" transform=\"rotate(-90 14 %.1f)\">",
            middle, middle);
        bst_html_text(c->out, c->y.label);
        fputs("</text>", c->out);
    }
}

void bst_chart_begin(bst_chart *c) {
    bool foot = !c->x.bare || (c->x.label && c->x.label[0]);
    c->top = MARGIN_TOP;
    c->inner_height = c->height - c->top - (foot ? MARGIN_BOTTOM : MARGIN_BARE);
    c->left = fmax(c->margin_left, needed_left(c));
    c->inner_width = c->width - c->left - MARGIN_RIGHT;
    fprintf(c->out, "<svg class=\"chart\" viewBox=\"0 0 %g %g\" role=\"img\" aria-label=\"",
            c->width, c->height);
    bst_html_text(c->out, c->name);
    fputc('"', c->out);
    bst_chart_values_axes(c);
    fputc('>', c->out);
    put_x_axis(c);
    put_y_axis(c);
    fputc('\n', c->out);
}

void bst_chart_end(bst_chart *c) {
    fprintf(c->out,
            "<rect class=\"f\" x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\"/></svg>\n",
            c->left, c->top, c->inner_width, c->inner_height);
}

/* ------------------------------------------------------------------ shapes */

void bst_chart_bands(const bst_chart *c, const double *from, const double *to, size_t n, int colour,
                     const char *title) {
    fprintf(c->out, "<path class=\"b c%d\"", colour);
    bst_chart_values_lists(c, "bands", (bst_chart_list[]){{"from", from}, {"to", to}}, 2, n);
    fputs(" d=\"", c->out);
    for (size_t i = 0; i < n; i++) {
        double x0 = inside_x(c, from[i]), width = inside_x(c, to[i]) - x0;
        if (width > 0.0) {
            fprintf(c->out, "M%.1f %.1fh%.1fV%.1fh%.1fz", x0, c->top, width,
                    c->top + c->inner_height, -width);
        }
    }
    fputs("\">", c->out);
    if (title) {
        fputs("<title>", c->out);
        bst_html_text(c->out, title);
        fputs("</title>", c->out);
    }
    fputs("</path>\n", c->out);
}

void bst_chart_bar(const bst_chart *c, double x0, double x1, double y0, double y1, int colour,
                   const char *title) {
    double left = inside_x(c, x0), right = inside_x(c, x1);
    double top = inside_y(c, y0), bottom = inside_y(c, y1);
    fprintf(c->out, "<rect class=\"h c%d\" x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\"",
            colour, fmin(left, right), fmin(top, bottom), fabs(right - left), fabs(bottom - top));
    bst_chart_values_of(c, "bar", (double[]){x0, x1, y0, y1}, 4);
    if (title) {
        fputs("><title>", c->out);
        bst_html_text(c->out, title);
        fputs("</title></rect>\n", c->out);
    } else {
        fputs("/>\n", c->out);
    }
}

/* Writes an SVG path inside the plotting area; coordinates are integers from the upper left
 * corner. */
typedef struct pen {
    FILE *out;
    const bst_chart *chart;
    long x, y;
    bool down;
} pen;

/* Horizontal position of a value in fine steps of the clipped SVG. */
static long step_x(const bst_chart *c, double x) {
    return lround(FINE * c->inner_width * clamp(along(&c->x, x), -OFF_SCALE, 1.0 + OFF_SCALE));
}

/* Vertical position of a value in fine steps of the clipped SVG. */
static long step_y(const bst_chart *c, double y) {
    return lround(FINE * c->inner_height *
                  (1.0 - clamp(along(&c->y, y), -OFF_SCALE, 1.0 + OFF_SCALE)));
}

/* Opens the nested SVG that clips curves to the chart. */
static void open_clip(const bst_chart *c) {
    fprintf(c->out,
            "<svg x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\" viewBox=\"0 0 %.0f %.0f\">",
            c->left, c->top, c->inner_width, c->inner_height, FINE * c->inner_width,
            FINE * c->inner_height);
}

/* Continues the SVG path of a curve to the next point. */
static void pen_to(pen *p, double x, double y) {
    long px = step_x(p->chart, x), py = step_y(p->chart, y);
    if (!p->down) {
        fprintf(p->out, "M%ld %ldl", px, py);
        fputs("0 0", p->out); /* a single point is a dot of the line's width */
    } else if (px != p->x || py != p->y) {
        fprintf(p->out, " %ld %ld", px - p->x, py - p->y);
    }
    p->x = px;
    p->y = py;
    p->down = true;
}

/* Number of columns for thinning lines: each two units wide. */
static int columns_of(const bst_chart *c) {
    return (int)clamp(0.5 * c->inner_width, 16.0, MOST_COLUMNS);
}

void bst_chart_line(const bst_chart *c, const double *x, const double *y, size_t n, int colour,
                    bool dashed) {
    bst_chart_point points[5 * MOST_COLUMNS + 1];
    int columns = columns_of(c);
    size_t count = bst_chart_thin(x, y, n, c->x.low, c->x.high, columns, points);
    pen p = {.out = c->out, .chart = c};
    open_clip(c);
    fprintf(c->out, "<path class=\"l%s c%d\" stroke-linecap=\"round\"", dashed ? " s" : "", colour);
    bst_chart_values_series(c, "line", x, y, n);
    fputs(" d=\"", c->out);
    for (size_t i = 0; i < count; i++) {
        if (isnan(points[i].y) || isnan(points[i].x)) {
            p.down = false;
        } else {
            pen_to(&p, points[i].x, points[i].y);
        }
    }
    fputs("\"/></svg>\n", c->out);
}

void bst_chart_area(const bst_chart *c, const double *x, const double *low, const double *high,
                    size_t n, int colour) {
    pen p = {.out = c->out, .chart = c};
    open_clip(c);
    fprintf(c->out, "<path class=\"a c%d\"", colour);
    bst_chart_values_lists(c, "area", (bst_chart_list[]){{"x", x}, {"low", low}, {"high", high}}, 3,
                           n);
    fputs(" d=\"", c->out);
    for (size_t i = 0; i < n; i++) {
        if (isfinite(high[i])) {
            pen_to(&p, x[i], high[i]);
        }
    }
    for (size_t i = n; i-- > 0;) {
        if (isfinite(low[i])) {
            pen_to(&p, x[i], low[i]);
        }
    }
    fputs(p.down ? "z\"/></svg>\n" : "\"/></svg>\n", c->out);
}

/* Indices of the points on the axes, of several at one integer position only the first; without
 * memory for the positions all of them. Returns their number. */
static size_t choose_dots(const bst_chart *c, const double *x, const double *y, size_t n,
                          size_t *chosen) {
    size_t wide = (size_t)c->inner_width + 2, high = (size_t)c->inner_height + 2, count = 0;
    bool *taken = calloc(wide * high, sizeof *taken);
    for (size_t i = 0; i < n; i++) {
        double ax = along(&c->x, x[i]), ay = along(&c->y, y[i]);
        if (ax >= 0.0 && ax <= 1.0 && ay >= 0.0 && ay <= 1.0) {
            size_t at = (size_t)(ay * c->inner_height) * wide + (size_t)(ax * c->inner_width);
            if (!taken || !taken[at]) {
                chosen[count++] = i;
            }
            if (taken) {
                taken[at] = true;
            }
        }
    }
    free(taken);
    return count;
}

void bst_chart_dots(const bst_chart *c, const double *x, const double *y, size_t n, int colour) {
    size_t *chosen = malloc((n + 1) * sizeof *chosen);
    if (!chosen) {
        return; /* the chart lacks them */
    }
    size_t count = choose_dots(c, x, y, n, chosen);
    open_clip(c);
    /* round caps on strokes of zero length: one path for all dots */
    fprintf(c->out, "<path class=\"l o c%d\" stroke-linecap=\"round\"", colour);
    if (bst_chart_values_rising(x, n)) {
        bst_chart_values_series(c, "dots", x, y, n);
    } else {
        bst_chart_values_chosen(c, "dots", x, y, chosen, count);
    }
    fputs(" d=\"", c->out);
    for (size_t k = 0; k < count; k++) {
        fprintf(c->out, "M%ld %ldh0", step_x(c, x[chosen[k]]), step_y(c, y[chosen[k]]));
    }
    fputs("\"/></svg>\n", c->out);
    free(chosen);
}

void bst_chart_whiskers(const bst_chart *c, const double *x, const double *low, const double *high,
                        size_t n, int colour) {
    fprintf(c->out, "<path class=\"w c%d\" fill=\"none\"", colour);
    bst_chart_values_lists(c, "whiskers",
                           (bst_chart_list[]){{"x", x}, {"low", low}, {"high", high}}, 3, n);
    fputs(" d=\"", c->out);
    for (size_t i = 0; i < n; i++) {
        double at = along(&c->x, x[i]);
        if (isfinite(low[i]) && isfinite(high[i]) && at >= 0.0 && at <= 1.0) {
            double px = inside_x(c, x[i]);
            double y0 = inside_y(c, low[i]), y1 = inside_y(c, high[i]);
            fprintf(c->out, "M%.1f %.1fV%.1fM%.1f %.1fh6M%.1f %.1fh6", px, y0, y1, px - 3.0, y0,
                    px - 3.0, y1);
        }
    }
    fputs("\"/>\n", c->out);
}

void bst_chart_rule(const bst_chart *c, double y, int colour) {
    double at = along(&c->y, y);
    if (at >= 0.0 && at <= 1.0) {
        fprintf(c->out, "<path class=\"r c%d\" d=\"M%.1f %.1fh%.1f\"", colour, c->left,
                inside_y(c, y), c->inner_width);
        bst_chart_values_of(c, "rule", &y, 1);
        fputs("/>\n", c->out);
    }
}

void bst_chart_mark(const bst_chart *c, double x, int colour) {
    double at = along(&c->x, x);
    if (at >= 0.0 && at <= 1.0) {
        fprintf(c->out, "<path class=\"r c%d\" d=\"M%.1f %.1fv%.1f\"", colour, inside_x(c, x),
                c->top, c->inner_height);
        bst_chart_values_of(c, "mark", &x, 1);
        fputs("/>\n", c->out);
    }
}

void bst_chart_word(const bst_chart *c, double x, double y, double dx, double dy,
                    const char *anchor, const char *text) {
    fprintf(c->out, "<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"%s\"", inside_x(c, x) + dx,
            inside_y(c, y) + dy, anchor);
    bst_chart_values_of(c, "word", (double[]){x, y, dx, dy}, 4);
    fputc('>', c->out);
    bst_html_text(c->out, text);
    fputs("</text>\n", c->out);
}

double bst_chart_time_unit(double span_s, const char **name) {
    static const struct {
        double from_s, seconds;
        const char *name;
    } units[] = {
        {0.0, 1.0, "s"}, {1200.0, 60.0, "min"}, {14400.0, 3600.0, "h"}, {432000.0, 86400.0, "d"}};
    size_t k = 0;
    while (k + 1 < sizeof units / sizeof *units && span_s >= units[k + 1].from_s) {
        k++;
    }
    *name = units[k].name;
    return units[k].seconds;
}

void bst_chart_legend(FILE *out, bst_chart_key key, int colour, const char *text) {
    static const char *const names[] = {"line", "dash", "dot", "ground"};
    fprintf(out, "<li><span class=\"key %s c%d\"></span>", names[key], colour);
    bst_html_text(out, text);
    fputs("</li>\n", out);
}
