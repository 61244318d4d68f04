#include "sim/report/report_plots.h"

#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/text.h"

/* ------------------------------------------------------------------ helpers */

/* Mode at a time; -1: none. *k: index kept between calls in ascending order. */
static int mode_at(const bst_report_sensor *s, double seconds, size_t *k) {
    while (*k + 1 < s->mode_count && s->modes[*k + 1].from_s <= seconds) {
        (*k)++;
    }
    return s->mode_count > 0 && s->modes[*k].from_s <= seconds ? s->modes[*k].mode : -1;
}

static void find_spans(const bst_report_drawing *d, bst_report_spans *out) {
    const bst_report_sensor *s = d->sensor;
    double end = d->span_s / d->unit_s;
    size_t k = 0;
    out->count = 0;
    out->thinned = s->mode_count > BST_REPORT_SPANS;
    int parts = out->thinned ? BST_REPORT_SPANS : (int)s->mode_count;
    for (int i = 0; i < parts; i++) {
        double from = end * i / parts, to = end * (i + 1) / parts;
        int mode = out->thinned ? mode_at(s, 0.5 * (from + to) * d->unit_s, &k) : s->modes[i].mode;
        if (!out->thinned) {
            from = s->modes[i].from_s / d->unit_s;
            to = i + 1 < parts ? s->modes[i + 1].from_s / d->unit_s : end;
        }
        bool more =
            out->count > 0 && out->mode[out->count - 1] == mode && out->to[out->count - 1] == from;
        if (more) {
            out->to[out->count - 1] = to;
        } else if (mode >= 0 && to > from) {
            out->from[out->count] = from;
            out->to[out->count] = to;
            out->mode[out->count++] = mode;
        }
    }
}

static void put_modes(const bst_report_drawing *d, const bst_chart *c) {
    const bst_report_spans *s = d->modes;
    for (int mode = 0; mode < BST_MODE_COUNT; mode++) {
        double from[BST_REPORT_SPANS], to[BST_REPORT_SPANS];
        size_t n = 0;
        for (int i = 0; i < s->count; i++) {
            if (s->mode[i] == mode) {
                from[n] = s->from[i];
                to[n++] = s->to[i];
            }
        }
        if (n > 0) {
            bst_chart_bands(c, from, to, n, BST_CHART_MODE + mode, bst_mode_name(mode));
        }
    }
}

bst_chart bst_report_time_chart(const bst_report_drawing *d, const char *name, const char *label,
                                double low, double high, bool logarithmic) {
    bst_chart c = {.out = d->out,
                   .name = name,
                   .width = 1100.0,
                   .height = 260.0,
                   .margin_left = 64.0,
                   .common_x = d->common_x,
                   .x = bst_report_time_axis(d),
                   .y = {.label = label, .logarithmic = logarithmic}};
    bst_chart_fit(&c.y, low, high, 0.05);
    bst_chart_begin(&c);
    put_modes(d, &c);
    return c;
}

void bst_report_histogram(FILE *out, const bst_report_histogram_of *h) {
    enum { MOST = 64, CURVE = 120 };
    const double *values = h->values;
    double low = h->low, high = h->high;
    int bins = h->bins;
    double counts[MOST] = {0}, top = 0.0, x[CURVE], y[CURVE], width = (high - low) / bins;
    size_t total = 0;
    for (size_t i = 0; i < h->n; i++) {
        if (isfinite(values[i])) {
            total++;
            double at = floor((values[i] - low) / width);
            if (at >= 0.0 && at < bins) {
                counts[(int)at] += 1.0;
            }
        }
    }
    for (int i = 0; i < bins; i++) {
        top = fmax(top, counts[i]);
    }
    for (int i = 0; i < CURVE; i++) {
        x[i] = low + (high - low) * i / (CURVE - 1);
        y[i] = h->density ? h->density(x[i], h->user) * width * (double)total : 0.0;
        top = fmax(top, y[i]);
    }
    bst_chart c = {.out = out,
                   .name = h->name,
                   .width = 360.0,
                   .height = 230.0,
                   .x = {.label = h->label, .low = low, .high = high},
                   .y = {.label = h->what, .low = 0.0, .high = fmax(1.0, 1.08 * top)}};
    bst_chart_begin(&c);
    for (int i = 0; i < bins; i++) {
        if (counts[i] > 0.0) {
            bst_chart_bar(&c, low + i * width, low + (i + 1) * width, 0.0, counts[i], h->colour,
                          NULL);
        }
    }
    if (h->density) {
        bst_chart_line(&c, x, y, CURVE, BST_CHART_RED, false);
    }
    bst_chart_end(&c);
}

/* ------------------------------------------------------------------ quantities */

static double radial_seen(const bst_report_frame *f) {
    return f->visible ? f->error_px : NAN;
}

static double radial_unseen(const bst_report_frame *f) {
    return f->visible ? NAN : f->error_px;
}

static bool is_pointing(const bst_report_frame *f) {
    bst_loop_frame frame = bst_report_loop_frame(f);
    return bst_loop_frame_is_pointing(&frame);
}

static double pointing_x(const bst_report_frame *f) {
    return is_pointing(f) ? f->error_x_px : NAN;
}

static double pointing_y(const bst_report_frame *f) {
    return is_pointing(f) ? f->error_y_px : NAN;
}

static double track_error(const bst_report_frame *f) {
    return hypot(f->track_east_arcsec, f->track_north_arcsec);
}

static double track_sigma(const bst_report_frame *f) {
    return f->track_sigma_arcsec;
}

static double nees(const bst_report_frame *f) {
    return f->nees;
}

static double nees_updated(const bst_report_frame *f) {
    return f->updated ? f->nees : NAN;
}

static double snr(const bst_report_frame *f) {
    return f->snr;
}

static double track_snr(const bst_report_frame *f) {
    return f->track_snr;
}

static double detections(const bst_report_frame *f) {
    return f->detections;
}

static double stars(const bst_report_frame *f) {
    return f->stars;
}

static double others(const bst_report_frame *f) {
    return f->detections - f->stars;
}

/* Moves the finite values of a series to its front; returns their number. */
static size_t gather(double *series, size_t n) {
    size_t count = 0;
    for (size_t i = 0; i < n; i++) {
        if (isfinite(series[i])) {
            series[count++] = series[i];
        }
    }
    return count;
}

/* Formats statistics: "RMS 0.21, median 0.18, 95 % below 0.36, 99 % below 0.44, largest 0.6 px";
 * NAN p99 is omitted. */
static void describe(char text[200], double rms, double median, double p95, double p99,
                     double largest, const char *unit) {
    char words[5][32], tail[48] = "";
    if (isfinite(p99)) {
        snprintf(tail, sizeof tail, " 99 %% below %s,", bst_report_page_number(words[3], p99, 3));
    }
    snprintf(text, 200, "RMS %s, median %s, 95 %% below %s,%s largest %s %s",
             bst_report_page_number(words[0], rms, 3), bst_report_page_number(words[1], median, 3),
             bst_report_page_number(words[2], p95, 3), tail,
             bst_report_page_number(words[4], largest, 3), unit);
}

/* ------------------------------------------------------------------ charts */

#define POINTING_ERROR                                                                     \
    "Pointing error: angle from the boresight to the target's true apparent direction at " \
    "mid-exposure, in pixels of the boresight."

/* Draws the radial pointing error over time. */
static void plot_pointing(const bst_report_drawing *d) {
    size_t n = d->sensor->count;
    double low = INFINITY, high = -INFINITY;
    size_t seen = bst_report_fill(d, radial_seen, d->y);
    size_t unseen = bst_report_fill(d, radial_unseen, d->z);
    if (seen + unseen == 0) {
        return;
    }
    bst_chart_widen(d->y, n, true, &low, &high);
    bst_chart_widen(d->z, n, true, &low, &high);
    if (!(high > 1e-6)) {
        fputs("<p class=\"note\">The boresight is on the true target.</p>\n", d->out);
        return;
    }
    bst_report_page_figure(d->out, BST_PAGE_WIDE);
    bst_chart c =
        bst_report_time_chart(d, "Distance from the boresight to the true target over time",
                              "pointing error, px", fmax(low, fmin(1e-2, 1e-3 * high)), high, true);
    bst_chart_line(&c, d->x, d->z, n, BST_CHART_GREY, false);
    bst_chart_line(&c, d->x, d->y, n, BST_CHART_BLUE, false);
    bst_chart_end(&c);
    fputs("<ul class=\"legend\">\n", d->out);
    bst_chart_legend(d->out, BST_KEY_LINE, BST_CHART_BLUE, "target visible");
    if (unseen > 0) {
        bst_chart_legend(d->out, BST_KEY_LINE, BST_CHART_GREY, "target hidden or dark");
    }
    fputs("</ul>\n", d->out);
    const bst_loop_figures *f = &d->sensor->loop;
    char text[200], caption[500];
    describe(text, f->pointing_rms_px, f->pointing_median_px, f->pointing_p95_px,
             f->pointing_p99_px, f->pointing_max_px, "px");
    snprintf(
        caption, sizeof caption,
        POINTING_ERROR " In the %s in mode track with the visible target, from settling on: %s.",
        bst_text_of_count((char[BST_COUNT_TEXT]){0}, f->pointing_frames, "frame", "frames"), text);
    bst_report_page_figure_end(d->out, f->pointing_frames > 0 ? caption : POINTING_ERROR);
}

/* Draws the pointing error along columns and rows over time. */
static void plot_axes(const bst_report_drawing *d) {
    size_t n = d->sensor->count, count = 0;
    size_t seen = bst_report_fill(d, pointing_x, d->y);
    bst_report_fill(d, pointing_y, d->z);
    if (seen < 2) {
        return;
    }
    double *sizes = malloc(2 * n * sizeof *sizes);
    if (!sizes) {
        return;
    }
    for (size_t i = 0; i < n; i++) {
        if (isfinite(d->y[i])) {
            sizes[count++] = fabs(d->y[i]);
            sizes[count++] = fabs(d->z[i]);
        }
    }
    bst_report_statistics m = bst_report_measure(sizes, count);
    free(sizes);
    /* the acquisition transient must not compress the chart */
    double limit = fmin(m.worst, 4.0 * m.p95);
    bst_report_page_figure(d->out, BST_PAGE_WIDE);
    bst_chart c = bst_report_time_chart(d, "Pointing error along the sensor's columns and rows",
                                        "pointing error, px", -limit, limit, false);
    bst_chart_rule(&c, 0.0, BST_CHART_GREY);
    bst_chart_line(&c, d->x, d->y, n, BST_CHART_BLUE, false);
    bst_chart_line(&c, d->x, d->z, n, BST_CHART_ORANGE, false);
    bst_chart_end(&c);
    fputs("<ul class=\"legend\">\n", d->out);
    bst_chart_legend(d->out, BST_KEY_LINE, BST_CHART_BLUE, "x (columns)");
    bst_chart_legend(d->out, BST_KEY_LINE, BST_CHART_ORANGE, "y (rows)");
    fputs("</ul>\n", d->out);
    bst_report_page_figure_end(
        d->out,
        "Pointing error per axis, in mode track with the visible target, from settling on; errors "
        "beyond the axis are cut off.");
}

#define TRACK_ERROR                                                                         \
    "Track of interest against the target's true direction, at mid-exposure, and the root " \
    "of the trace of its covariance."

/* Draws the error of the track of interest and its stated sigma over time. */
static void plot_track(const bst_report_drawing *d) {
    size_t n = d->sensor->count;
    double low = INFINITY, high = -INFINITY;
    if (bst_report_fill(d, track_error, d->y) == 0) {
        return;
    }
    bst_report_fill(d, track_sigma, d->z);
    bst_chart_widen(d->y, n, true, &low, &high);
    bst_chart_widen(d->z, n, true, &low, &high);
    bst_report_page_figure(d->out, BST_PAGE_WIDE);
    bst_chart c = bst_report_time_chart(d, "Error of the track of interest and its own sigma",
                                        "track error, arcsec", fmax(low, 1e-4 * high), high, true);
    bst_chart_line(&c, d->x, d->y, n, BST_CHART_BLUE, false);
    bst_chart_line(&c, d->x, d->z, n, BST_CHART_RED, false);
    bst_chart_end(&c);
    fputs("<ul class=\"legend\">\n", d->out);
    bst_chart_legend(d->out, BST_KEY_LINE, BST_CHART_BLUE, "error of its direction");
    bst_chart_legend(d->out, BST_KEY_LINE, BST_CHART_RED, "sigma that the tracker states");
    fputs("</ul>\n", d->out);
    const bst_report_sensor *s = d->sensor;
    char text[200], caption[700] = TRACK_ERROR;
    if (s->track_frames > 0) {
        describe(text, s->track_rms_px, s->track_median_px, s->track_p95_px, NAN, s->track_max_px,
                 "px");
        snprintf(caption, sizeof caption,
                 TRACK_ERROR " In the %" PRId64
                             " processed frames with the target in the field "
                             "and in track: %s of %.4g arcsec.",
                 s->track_frames, text, s->pixel_scale_arcsec);
    }
    size_t used = strlen(caption);
    if (isfinite(s->smoothed_rms_px)) {
        snprintf(
            caption + used, sizeof caption - used,
            " Smoothed with later frames (table tracks_smoothed): RMS %.3g px; without, in the "
            "same frames: %.3g px.",
            s->smoothed_rms_px, s->smoothed_filtered_rms_px);
    }
    bst_report_page_figure_end(d->out, caption);
}

/* Draws the NEES of the track of interest over time, with its 95 % bounds. */
static void plot_nees(const bst_report_drawing *d) {
    /* chi-square with 2 degrees of freedom: -2 ln(upper tail) */
    const double lower = -2.0 * log(0.975), upper = -2.0 * log(0.025);
    size_t n = d->sensor->count, inside = 0;
    double low = lower, high = upper;
    size_t count = bst_report_fill(d, nees, d->y);
    if (count == 0) {
        return;
    }
    bst_chart_widen(d->y, n, true, &low, &high);
    bst_report_page_figure(d->out, BST_PAGE_WIDE);
    bst_chart c = bst_report_time_chart(d, "Normalised error squared of the track of interest",
                                        "NEES", fmax(low, 1e-3), high, true);
    bst_chart_rule(&c, lower, BST_CHART_RED);
    bst_chart_rule(&c, upper, BST_CHART_RED);
    bst_chart_line(&c, d->x, d->y, n, BST_CHART_BLUE, false);
    bst_chart_end(&c);
    count = bst_report_fill(d, nees_updated, d->y);
    for (size_t i = 0; i < n; i++) {
        inside += d->y[i] >= lower && d->y[i] <= upper;
    }
    char caption[400], words[2][32];
    bst_report_statistics m = bst_report_measure(d->y, gather(d->y, n));
    snprintf(caption, sizeof caption,
             "NEES of the track's direction (2 degrees of freedom: 2 on average when error and "
             "covariance agree). In the %zu frames that gave it a detection: mean %s, median %s "
             "(1.39), %.0f %% between the dotted lines, where 95 %% belong. Errors of neighbouring "
             "frames are correlated.",
             count, bst_report_page_number(words[0], m.mean, 3),
             bst_report_page_number(words[1], m.median, 3),
             100.0 * (double)inside / fmax(1.0, (double)count));
    bst_report_page_figure_end(d->out, caption);
}

/* Draws the true and the measured SNR of the target over time. */
static void plot_snr(const bst_report_drawing *d) {
    size_t n = d->sensor->count;
    double low = INFINITY, high = -INFINITY;
    size_t seen = bst_report_fill(d, snr, d->y), found = bst_report_fill(d, track_snr, d->z);
    if (seen + found == 0) {
        return;
    }
    bst_chart_widen(d->y, n, false, &low, &high);
    bst_chart_widen(d->z, n, false, &low, &high);
    bst_report_page_figure(d->out, BST_PAGE_WIDE);
    bst_chart c = bst_report_time_chart(d, "Signal-to-noise ratio of the target over time", "SNR",
                                        fmin(low, 0.0), high, false);
    bst_chart_dots(&c, d->x, d->z, n, BST_CHART_ORANGE);
    bst_chart_line(&c, d->x, d->y, n, BST_CHART_BLUE, false);
    bst_chart_end(&c);
    fputs("<ul class=\"legend\">\n", d->out);
    if (seen > 0) {
        bst_chart_legend(d->out, BST_KEY_LINE, BST_CHART_BLUE, "true, in the field");
    }
    if (found > 0) {
        bst_chart_legend(d->out, BST_KEY_DOT, BST_CHART_ORANGE,
                         "measured: detections of the track of interest");
    }
    fputs("</ul>\n", d->out);
    bst_report_page_figure_end(d->out, "Signal-to-noise ratio of the target.");
}

/* Draws the number of detections per frame over time. */
static void plot_detections(const bst_report_drawing *d) {
    size_t n = d->sensor->count;
    double low = 0.0, high = -INFINITY, words[3];
    if (bst_report_fill(d, detections, d->y) == 0) {
        return;
    }
    bst_chart_widen(d->y, n, false, &low, &high);
    bst_report_page_figure(d->out, BST_PAGE_WIDE);
    bst_chart c =
        bst_report_time_chart(d, "Detections per frame", "detections per frame", 0.0, high, false);
    bst_chart_line(&c, d->x, d->y, n, BST_CHART_BLUE, false);
    words[0] = bst_report_measure(d->y, gather(d->y, n)).mean;
    bst_report_fill(d, stars, d->y);
    bst_chart_line(&c, d->x, d->y, n, BST_CHART_GREEN, false);
    words[1] = bst_report_measure(d->y, gather(d->y, n)).mean;
    bst_report_fill(d, others, d->y);
    bst_chart_line(&c, d->x, d->y, n, BST_CHART_ORANGE, false);
    words[2] = bst_report_measure(d->y, gather(d->y, n)).mean;
    bst_chart_end(&c);
    fputs("<ul class=\"legend\">\n", d->out);
    bst_chart_legend(d->out, BST_KEY_LINE, BST_CHART_BLUE, "all");
    bst_chart_legend(d->out, BST_KEY_LINE, BST_CHART_GREEN, "identified as stars");
    bst_chart_legend(d->out, BST_KEY_LINE, BST_CHART_ORANGE, "others");
    fputs("</ul>\n", d->out);
    char caption[200], numbers[3][32];
    snprintf(caption, sizeof caption,
             "Detections per frame: %s on average, of which %s are identified as stars and %s are "
             "not.",
             bst_report_page_number(numbers[0], words[0], 3),
             bst_report_page_number(numbers[1], words[1], 3),
             bst_report_page_number(numbers[2], words[2], 3));
    bst_report_page_figure_end(d->out, caption);
}

/* Density of the normal distribution; `user`: mean and sigma. */
static double normal(double x, const void *user) {
    const double *p = user; /* mean, sigma */
    double u = (x - p[0]) / p[1];
    return exp(-0.5 * u * u) / (p[1] * sqrt(2.0 * BST_PI));
}

/* Density of the chi-square distribution with 2 degrees of freedom. */
static double chi_square_2(double x, const void *user) {
    (void)user;
    return 0.5 * exp(-0.5 * x);
}

/* Draws the histogram of one axis of the pointing error with a normal curve of equal mean and
 * sigma. */
static void histogram_of_axis(const bst_report_drawing *d, bst_report_quantity quantity,
                              const char *label, int colour) {
    bst_report_fill(d, quantity, d->y);
    size_t n = gather(d->y, d->sensor->count);
    if (n < 20) {
        return;
    }
    bst_report_statistics m = bst_report_measure(d->y, n); /* sorts d->y */
    double inner =
        0.5 * (bst_report_percentile(d->y, n, 0.8413) - bst_report_percentile(d->y, n, 0.1587));
    double law[2] = {m.median, fmax(inner, 1e-9)}, half = 5.0 * law[1];
    char caption[160], words[2][32];
    bst_report_page_figure(d->out, BST_PAGE_THIRD);
    const bst_report_histogram_of histogram = {.name = label,
                                               .label = label,
                                               .what = "frames",
                                               .values = d->y,
                                               .n = n,
                                               .low = m.median - half,
                                               .high = m.median + half,
                                               .bins = 40,
                                               .colour = colour,
                                               .density = normal,
                                               .user = law};
    bst_report_histogram(d->out, &histogram);
    snprintf(
        caption, sizeof caption, "Mean %s px, RMS %s px; the curve is normal with the inner 68 %%.",
        bst_report_page_number(words[0], m.mean, 2), bst_report_page_number(words[1], m.rms, 3));
    bst_report_page_figure_end(d->out, caption);
}

/* Draws histograms of the pointing error per axis and of the NEES. */
static void plot_histograms(const bst_report_drawing *d) {
    bst_report_page_grid(d->out, BST_PAGE_THIRD);
    histogram_of_axis(d, pointing_x, "pointing error in x, px", BST_CHART_BLUE);
    histogram_of_axis(d, pointing_y, "pointing error in y, px", BST_CHART_ORANGE);
    bst_report_fill(d, nees_updated, d->y);
    size_t n = gather(d->y, d->sensor->count);
    if (n >= 20) {
        bst_report_page_figure(d->out, BST_PAGE_THIRD);
        const bst_report_histogram_of histogram = {.name = "NEES of the track",
                                                   .label = "NEES of the track",
                                                   .what = "frames",
                                                   .values = d->y,
                                                   .n = n,
                                                   .high = 12.0,
                                                   .bins = 40,
                                                   .colour = BST_CHART_GREEN,
                                                   .density = chi_square_2};
        bst_report_histogram(d->out, &histogram);
        bst_report_page_figure_end(
            d->out, "Frames with a detection; the curve is chi-square with 2 degrees of freedom.");
    }
    bst_report_page_grid_end(d->out);
}

bst_status bst_report_plots(bst_ctx *ctx, FILE *out, const bst_report_sensor *s, double span_s) {
    if (s->count == 0) {
        fputs("<p class=\"note\">No frame is recorded.</p>\n", out);
        return BST_OK;
    }
    const char *unit;
    bst_report_drawing d = {.out = out, .sensor = s};
    d.span_s = fmax(span_s, s->frames[s->count - 1].mid_s);
    d.span_s = d.span_s > 0.0 ? d.span_s : 1.0;
    d.unit_s = bst_chart_time_unit(d.span_s, &unit);
    snprintf(d.time_label, sizeof d.time_label, "time since the epoch, %s", unit);
    d.x = malloc(4 * s->count * sizeof *d.x);
    if (!d.x) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the charts");
    }
    d.y = d.x + s->count;
    d.z = d.y + s->count;
    d.w = d.z + s->count;
    for (size_t i = 0; i < s->count; i++) {
        d.x[i] = s->frames[i].mid_s / d.unit_s;
    }
    bst_chart_common_x common = {.x = d.x, .n = s->count, .number = (int)s->sensor.index};
    d.common_x = &common;
    bst_report_spans *spans = malloc(sizeof *spans);
    if (!spans) {
        free(d.x);
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the charts");
    }
    find_spans(&d, spans);
    d.modes = spans;
    bst_report_timeline(&d);
    plot_pointing(&d);
    plot_axes(&d);
    plot_track(&d);
    plot_nees(&d);
    plot_snr(&d);
    plot_detections(&d);
    plot_histograms(&d);
    bst_report_sky(&d);
    free(spans);
    free(d.x);
    return BST_OK;
}
