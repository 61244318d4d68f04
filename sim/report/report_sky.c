#include <math.h>

#include "sim/report/report_plots.h"

static double range_km(const bst_report_frame *f) {
    return f->range_m * 1e-3;
}

static double v_mag(const bst_report_frame *f) {
    return f->dark ? NAN : f->v_mag;
}

static double phase_deg(const bst_report_frame *f) {
    return f->phase_rad / BST_DEG_RAD;
}

static double sun_deg(const bst_report_frame *f) {
    return f->sun_rad / BST_DEG_RAD;
}

static double limb_deg(const bst_report_frame *f) {
    return f->limb_rad / BST_DEG_RAD;
}

static double target_dec(const bst_report_frame *f) {
    return f->apparent_dec_deg;
}

static double boresight_dec(const bst_report_frame *f) {
    return f->dec_deg;
}

static double latitude_deg(const bst_report_frame *f) {
    return f->latitude_rad / BST_DEG_RAD;
}

static double longitude_deg(const bst_report_frame *f) {
    return f->longitude_rad / BST_DEG_RAD;
}

/* Draws a small chart of one quantity over time. */
static void put_quantity(const bst_report_drawing *d, bst_report_quantity quantity,
                         const char *label, const char *caption) {
    size_t n = d->sensor->count;
    double low = INFINITY, high = -INFINITY;
    if (bst_report_fill(d, quantity, d->y) == 0) {
        return;
    }
    bst_chart_widen(d->y, n, false, &low, &high);
    bst_report_page_figure(d->out, BST_PAGE_THIRD);
    bst_chart c = {.out = d->out,
                   .name = caption,
                   .width = 360.0,
                   .height = 220.0,
                   .common_x = d->common_x,
                   .x = bst_report_time_axis(d),
                   .y = {.label = label}};
    bst_chart_fit(&c.y, low, high, 0.06);
    bst_chart_begin(&c);
    bst_chart_line(&c, d->x, d->y, n, BST_CHART_BLUE, false);
    bst_chart_end(&c);
    bst_report_page_figure_end(d->out, caption);
}

/* Unwraps the right ascensions of boresight (y) and target (z) where they cross 360 degrees. */
static void unwrap(const bst_report_drawing *d, double *low, double *high) {
    const bst_report_sensor *s = d->sensor;
    double before = NAN;
    *low = INFINITY;
    *high = -INFINITY;
    for (size_t i = 0; i < s->count; i++) {
        double *both[2] = {&d->y[i], &d->z[i]};
        d->y[i] = s->frames[i].ra_deg;
        d->z[i] = s->frames[i].apparent_ra_deg;
        for (int k = 0; k < 2; k++) {
            double *a = both[k];
            if (isfinite(*a)) {
                *a -= isfinite(before) ? 360.0 * round((*a - before) / 360.0) : 0.0;
                before = *a;
                *low = fmin(*low, *a);
                *high = fmax(*high, *a);
            }
        }
    }
    if (*high - *low > 300.0) {
        for (size_t i = 0; i < s->count; i++) {
            d->y[i] = s->frames[i].ra_deg;
            d->z[i] = s->frames[i].apparent_ra_deg;
        }
        *low = 0.0;
        *high = 360.0;
    }
}

static void put_sky_path(const bst_report_drawing *d) {
    size_t n = d->sensor->count;
    double low, high, bottom = INFINITY, top = -INFINITY;
    unwrap(d, &low, &high);
    if (!(low <= high)) {
        return;
    }
    bool whole = high - low > 300.0;
    size_t targets = bst_report_fill(d, target_dec, d->w);
    bst_chart_widen(d->w, n, false, &bottom, &top);
    bst_report_fill(d, boresight_dec, d->w);
    bst_chart_widen(d->w, n, false, &bottom, &top);
    bst_report_page_figure(d->out, BST_PAGE_HALF);
    bst_chart c = {.out = d->out,
                   .name = "Paths of the boresight and of the target among the stars",
                   .width = 540.0,
                   .height = 300.0,
                   .x = {.label = "right ascension, deg"},
                   .y = {.label = "declination, deg"}};
    bst_chart_fit(&c.x, low, high, whole ? 0.0 : 0.05);
    bst_chart_fit(&c.y, bottom, top, 0.06);
    bst_chart_begin(&c);
    bst_chart_dots(&c, d->y, d->w, n, BST_CHART_ORANGE);
    bst_report_fill(d, target_dec, d->w);
    bst_chart_dots(&c, d->z, d->w, n, BST_CHART_BLUE);
    bst_chart_end(&c);
    fputs("<ul class=\"legend\">\n", d->out);
    bst_chart_legend(d->out, BST_KEY_DOT, BST_CHART_ORANGE, "boresight");
    if (targets > 0) {
        bst_chart_legend(d->out, BST_KEY_DOT, BST_CHART_BLUE, "target");
    }
    fputs("</ul>\n", d->out);
    bst_report_page_figure_end(d->out, "Among the stars: where the camera looked, and the target.");
}

static void put_ground_path(const bst_report_drawing *d) {
    size_t n = d->sensor->count;
    if (bst_report_fill(d, longitude_deg, d->y) == 0) {
        return;
    }
    bst_report_fill(d, latitude_deg, d->z);
    bst_report_page_figure(d->out, BST_PAGE_HALF);
    bst_chart c = {.out = d->out,
                   .name = "Path of the observer's sub-satellite point",
                   .width = 540.0,
                   .height = 300.0,
                   .x = {.label = "longitude, deg", .low = -180.0, .high = 180.0},
                   .y = {.label = "latitude, deg", .low = -90.0, .high = 90.0}};
    bst_chart_begin(&c);
    bst_chart_rule(&c, 0.0, BST_CHART_GREY);
    bst_chart_dots(&c, d->y, d->z, n, BST_CHART_GREEN);
    bst_chart_end(&c);
    bst_report_page_figure_end(d->out,
                               "Below the observer: geodetic places on the ground (WGS 84).");
}

void bst_report_sky(const bst_report_drawing *d) {
    bst_report_page_grid(d->out, BST_PAGE_HALF);
    put_sky_path(d);
    put_ground_path(d);
    bst_report_page_grid_end(d->out);
    bst_report_page_grid(d->out, BST_PAGE_THIRD);
    put_quantity(d, range_km, "range, km", "Distance of the target from the observer.");
    put_quantity(d, phase_deg, "phase angle, deg", "Angle Sun - target - observer.");
    put_quantity(d, v_mag, "V, mag", "Brightness of the target; larger is fainter.");
    put_quantity(d, sun_deg, "angle, deg", "Angle from the boresight to the Sun.");
    put_quantity(d, limb_deg, "angle, deg",
                 "Angle from the boresight to the Earth's limb; below 0: on the Earth.");
    bst_report_page_grid_end(d->out);
}
