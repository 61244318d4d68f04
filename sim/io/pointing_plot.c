#include <math.h>
#include <string.h>

#include "boresight/messages.h"
#include "sim/io/plot.h"

#define FLOOR_PX 0.01

/* Background colours of the modes, in the order of bst_mode. */
static const char *const mode_colours[BST_MODE_COUNT] = {
    "#e3e3e3", "#d6e4f5", "#fbe3c0", "#f7d3d8", "#d9efd9", "#eedcf3",
    "#e6efe9", "#dfeef5", "#d5d3e6", "#f0ead2", "#e2f0ee", "#f2ded2",
};

/* Ranges of the plotted values. */
typedef struct extent {
    int counted;   /* points that are counted */
    double top;    /* largest radial error */
    double spread; /* largest component of counted points */
} extent;

static double radial(const bst_io_pointing_point *p) {
    return hypot(p->dx_px, p->dy_px);
}

/* Largest radial pointing error, and spread of the points that count. */
static extent measure(const bst_io_pointing_point *points, int count) {
    extent e = {.counted = 0};
    for (int i = 0; i < count; i++) {
        const bst_io_pointing_point *p = &points[i];
        double r = radial(p);
        if (!p->visible || !isfinite(r)) {
            continue;
        }
        e.top = fmax(e.top, r);
        if (p->counted) {
            e.counted++;
            e.spread = fmax(e.spread, fmax(fabs(p->dx_px), fabs(p->dy_px)));
        }
    }
    return e;
}

/* Writes text in gnuplot's double quotes; removes quotes, backslashes and control characters. */
static void put_text(FILE *script, const char *text) {
    for (const char *c = text ? text : ""; *c; c++) {
        fputc(strchr("\"\\`", *c) || (unsigned char)*c < ' ' ? ' ' : *c, script);
    }
}

static void put_data(FILE *s, const bst_io_pointing_point *points, int count) {
    fputs("$points << BST_END\n", s);
    for (int i = 0; i < count; i++) {
        const bst_io_pointing_point *p = &points[i];
        if (p->visible && isfinite(radial(p))) {
            fprintf(s, "%.9g %.9g %.9g %.9g %d %d\n", p->time_s, fmax(radial(p), FLOOR_PX),
                    p->dx_px, p->dy_px, p->in_track ? 1 : 0, p->counted ? 1 : 0);
        } else {
            fputc('\n', s);
        }
    }
    fputs("BST_END\n", s);
}

/* Draws the modes as background; returns a bit per mode that occurs. */
static unsigned put_modes(FILE *s, const bst_io_pointing_point *points, int count, double end_s) {
    unsigned seen = 0;
    for (int i = 0; i < count;) {
        int mode = points[i].mode, next = i + 1;
        while (next < count && points[next].mode == mode) {
            next++;
        }
        if (mode >= 0 && mode < BST_MODE_COUNT) {
            seen |= 1u << mode;
            fprintf(s,
                    "set object rectangle from first %.9g, graph 0 to first %.9g, graph 1 "
                    "fillcolor rgb '%s' fillstyle solid noborder behind\n",
                    points[i].time_s, next < count ? points[next].time_s : end_s,
                    mode_colours[mode]);
        }
        i = next;
    }
    return seen;
}

static void put_upper(FILE *s, const char *title, const bst_io_pointing_point *points, int count,
                      double limit_px, const extent *e) {
    double end_s = points[count - 1].time_s;
    fputs(
        "set tmargin 3.2\nset bmargin 0.6\n"
        "set title \"",
        s);
    put_text(s, title && title[0] ? title : "Boresight to true target");
    fputs(
        "\" font ',13' noenhanced offset 0,-0.2\n"
        "set logscale y\nset format y '%g'\nset format x ''\n"
        "set ylabel 'pointing error  [px]' offset 0.5,0\n",
        s);
    unsigned seen = put_modes(s, points, count, end_s);
    fprintf(s, "set yrange [%g:%.9g]\n", FLOOR_PX,
            fmax(pow(10.0, ceil(log10(fmax(e->top, 1.0)))), 10.0));
    fputs(
        "set key top right opaque width 1 spacing 1.15 samplen 2\n"
        "plot ",
        s);
    for (int m = 0; m < BST_MODE_COUNT; m++) {
        if (seen & 1u << m) {
            fprintf(s, "NaN with boxes fillstyle solid fillcolor rgb '%s' title '%s', ",
                    mode_colours[m], bst_mode_name(m));
        }
    }
    if (limit_px > 0.0) {
        fprintf(s,
                "%.9g with lines linecolor rgb '#c0392b' dashtype 2 linewidth 1.4 title '%g px', ",
                limit_px, limit_px);
    }
    fputs(
        "$points using 1:2 with lines linecolor rgb '#8a97a8' linewidth 1.2 notitle, "
        "$points using 1:($5 == 0 ? $2 : NaN) with points pointtype 7 pointsize 0.45 "
        "linecolor rgb '#8a97a8' title 'not in track', "
        "$points using 1:($5 == 1 ? $2 : NaN) with points pointtype 7 pointsize 0.45 "
        "linecolor rgb '#1f4e9c' title 'in track'\n",
        s);
}

static void put_lower(FILE *s, const char *label, double limit_px, const extent *e) {
    double span = e->counted ? fmax(1.45 * e->spread, limit_px > 0.0 ? 1.5 * limit_px : 0.1) : 1.0;
    fputs(
        "unset title\nunset object\nunset logscale y\nset tmargin 0.6\nset bmargin 3.4\n"
        "set format x '%g'\nset xlabel 'time since the epoch  [s]'\n"
        "set ylabel 'settled, mode track  [px]' offset 0.5,0\n",
        s);
    fprintf(s, "set yrange [%.9g:%.9g]\n", -span, span);
    if (label) {
        fputs("set label 1 \"", s);
        put_text(s, label);
        fputs("\" noenhanced at graph 0.012, graph 0.92 font ',10' textcolor rgb '#222222'\n", s);
    }
    fputs("plot 0 with lines linecolor rgb '#999999' linewidth 0.8 notitle, ", s);
    if (limit_px > 0.0) {
        fprintf(s,
                "%.9g with lines linecolor rgb '#c0392b' dashtype 2 notitle, "
                "%.9g with lines linecolor rgb '#c0392b' dashtype 2 notitle, ",
                limit_px, -limit_px);
    }
    fputs(
        "$points using 1:($6 == 1 ? $3 : NaN) with linespoints pointtype 7 pointsize 0.35 "
        "linecolor rgb '#1f77b4' title 'x', "
        "$points using 1:($6 == 1 ? $4 : NaN) with linespoints pointtype 7 pointsize 0.35 "
        "linecolor rgb '#e08214' title 'y'\n",
        s);
}

bst_status bst_io_pointing_plot(bst_ctx *ctx, const char *path, const char *title,
                                const char *label, const bst_io_pointing_point *points, int count,
                                double limit_px, bool *made) {
    if (made) {
        *made = false;
    }
    if (count < 2) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "%s: a plot of pointing needs two points", path);
    }
    extent e = measure(points, count);
    bst_plot plot;
    BST_TRY(bst_plot_begin(ctx, &plot, path, 1200, 760));
    FILE *s = plot.script;
    put_data(s, points, count);
    fprintf(s,
            "set multiplot layout 2,1\n"
            "set lmargin 10\nset rmargin 2.5\n"
            "set border linecolor rgb '#555555'\nset tics nomirror out scale 0.6\n"
            "set grid xtics ytics linecolor rgb '#c8c8c8' linewidth 0.6\n"
            "set xrange [%.9g:%.9g]\n",
            points[0].time_s, points[count - 1].time_s);
    put_upper(s, title, points, count, limit_px, &e);
    put_lower(s, label, limit_px, &e);
    fputs("unset multiplot\n", s);
    return bst_plot_end(ctx, &plot, made);
}
