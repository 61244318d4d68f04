#include "gimbal/jitter/jitter_table.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/file.h"

#define MOST_POINTS 100000

#define D bst_jitter_density_point
static const bst_config_desc point_table[] = {
    BST_REAL(D, frequency_hz, "Hz", 0, 1e6, NULL, "Frequency of this point."),
    BST_REAL(D, psd, "", 0, 1e12, NULL, "One-sided density there, unit^2/Hz, per axis."),
    BST_CONFIG_END};
#undef D

static const char *const axis_names[] = {"x", "y", "both", NULL};
#define L bst_jitter_line_config
static const bst_config_desc line_table[] = {
    BST_REAL(L, frequency_hz, "Hz", 1e-6, 1e5, NULL, "Frequency of the line."),
    BST_REAL(L, amplitude, "", 0, 1e6, NULL, "Amplitude, in the block's unit."),
    BST_ENUM(L, axis, axis_names, "\"both\"", "About which axis of the camera it turns."),
    BST_BOOL(L, random_phase, "true", "A phase drawn for each axis, in place of phase_deg."),
    BST_REAL(L, phase_deg, "deg", -360, 360, "0", "Phase at the epoch, of a sine."),
    BST_CONFIG_END};
#undef L

static const char *const unit_names[] = {"px", "arcsec", NULL};
#define P bst_jitter_psd_config
const bst_config_desc bst_jitter_psd_config_table[] = {
    BST_ENUM(P, unit, unit_names, "\"px\"", "Unit of the tables (squared, per Hz) and lines."),
    BST_LIST(P, low, bst_jitter_density_point, point_table, 0, 10000, "[]",
             "Table of the low band: points by rising frequency, straight in the logarithms "
             "between; both bands add up."),
    BST_LIST(P, high, bst_jitter_density_point, point_table, 0, 10000, "[]",
             "Table of the high band."),
    BST_PATH(P, low_file, "\"\"",
             "File with the low band's table instead: frequency in Hz and density a line."),
    BST_PATH(P, high_file, "\"\"", "File with the high band's table instead."),
    BST_REAL(P, y_scale, "", 0, 1e6, "1", "Density about the camera's y axis over that about x."),
    BST_LIST(P, lines, bst_jitter_line_config, line_table, 0, 32, "[]", "Harmonic lines."),
    BST_CONFIG_END};
#undef P

/* Density at a frequency within the segment from a point to the next. */
static double segment_at(const bst_jitter_density_point *p, double f) {
    double f1 = p[0].frequency_hz, f2 = p[1].frequency_hz, s1 = p[0].psd, s2 = p[1].psd;
    if (s1 > 0.0 && s2 > 0.0 && f1 > 0.0) {
        return s1 * pow(f / f1, log(s2 / s1) / log(f2 / f1));
    }
    return s1 + (s2 - s1) * (f - f1) / (f2 - f1);
}

static double segment_integral(const bst_jitter_density_point *p, double low, double high) {
    double f1 = p[0].frequency_hz, f2 = p[1].frequency_hz, s1 = p[0].psd, s2 = p[1].psd;
    double at_low = segment_at(p, low);
    if (s1 > 0.0 && s2 > 0.0 && f1 > 0.0) {
        /* the integral of f^m is low^(m + 1) (e^((m + 1) l) - 1) / (m + 1), l = log(high / low) */
        double m1 = log(s2 / s1) / log(f2 / f1) + 1.0, l = log(high / low);
        double x = m1 * l;
        return at_low * low * l * (fabs(x) < 1e-8 ? 1.0 + 0.5 * x : expm1(x) / x);
    }
    return 0.5 * (at_low + segment_at(p, high)) * (high - low);
}

double bst_jitter_density_at(const bst_jitter_density *d, double f) {
    for (int i = 0; i + 1 < d->count; i++) {
        if (f >= d->points[i].frequency_hz && f <= d->points[i + 1].frequency_hz) {
            return segment_at(&d->points[i], f);
        }
    }
    return 0.0;
}

double bst_jitter_density_integral(const bst_jitter_density *d, double low_hz, double high_hz) {
    double sum = 0.0;
    for (int i = 0; i + 1 < d->count; i++) {
        double low = fmax(low_hz, d->points[i].frequency_hz);
        double high = fmin(high_hz, d->points[i + 1].frequency_hz);
        if (high > low) {
            sum += segment_integral(&d->points[i], low, high);
        }
    }
    return sum;
}

double bst_jitter_density_top_hz(const bst_jitter_density *d) {
    return d->count > 0 ? d->points[d->count - 1].frequency_hz : 0.0;
}

bst_status bst_jitter_density_check(bst_ctx *ctx, const char *what, const bst_jitter_density *d) {
    if (d->count < 2) {
        return bst_fail(ctx, BST_ERR_CONFIG, "%s: %d points make no density; give at least two",
                        what, d->count);
    }
    for (int i = 0; i < d->count; i++) {
        const bst_jitter_density_point *p = &d->points[i];
        if (!(p->frequency_hz >= 0.0) || !(p->psd >= 0.0) || !isfinite(p->frequency_hz) ||
            !isfinite(p->psd)) {
            return bst_fail(ctx, BST_ERR_CONFIG,
                            "%s: point %d, %g at %g Hz: neither may be negative or without end",
                            what, i + 1, p->psd, p->frequency_hz);
        }
        if (i > 0 && p->frequency_hz <= p[-1].frequency_hz) {
            return bst_fail(ctx, BST_ERR_CONFIG,
                            "%s: %g Hz come after %g Hz; list the points by rising frequency", what,
                            p->frequency_hz, p[-1].frequency_hz);
        }
    }
    return BST_OK;
}

/* Parses two numbers of a line up to its end or a #; 0: none, -1: anything else. */
static int parse_line(char *line, double out[2]) {
    line[strcspn(line, "#\r\n")] = '\0';
    char *at = line;
    for (int i = 0; i < 2; i++) {
        at += strspn(at, i == 0 ? " \t" : " \t,;");
        if (i == 0 && *at == '\0') {
            return 0;
        }
        char *end;
        out[i] = strtod(at, &end);
        if (end == at) {
            return -1;
        }
        at = end;
    }
    return at[strspn(at, " \t")] == '\0' ? 2 : -1;
}

bst_status bst_jitter_density_load(bst_ctx *ctx, const char *path,
                                   bst_jitter_density_point **points, int *count) {
    char *text;
    size_t bytes;
    *points = NULL;
    *count = 0;
    BST_TRY(
        bst_file_read(ctx, path, 1u << 24, "a table of frequencies and densities", &text, &bytes));
    bst_status status = bst_file_check_text(ctx, path, text, bytes);
    int lines = 1, found = 0;
    for (size_t i = 0; i < bytes; i++) {
        lines += text[i] == '\n';
    }
    bst_jitter_density_point *list = NULL;
    if (status == BST_OK && lines > MOST_POINTS) {
        status = bst_fail(ctx, BST_ERR_FORMAT, "%s: more than %d lines", path, MOST_POINTS);
    }
    if (status == BST_OK) {
        list = calloc((size_t)lines, sizeof *list);
        status = list ? BST_OK : bst_fail(ctx, BST_ERR_MEMORY, "%s: out of memory", path);
    }
    char *line = text;
    for (int n = 1; status == BST_OK && line; n++) {
        char *next = strchr(line, '\n');
        if (next) {
            *next++ = '\0';
        }
        double pair[2];
        int numbers = parse_line(line, pair);
        if (numbers < 0) {
            status =
                bst_fail(ctx, BST_ERR_FORMAT,
                         "%s: line %d: \"%.40s\" is not a frequency and a density", path, n, line);
        } else if (numbers == 2) {
            list[found++] = (bst_jitter_density_point){pair[0], pair[1]};
        }
        line = next;
    }
    free(text);
    if (status != BST_OK) {
        free(list);
        return status;
    }
    *points = list;
    *count = found;
    return BST_OK;
}
