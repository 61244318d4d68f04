#include "sim/bench/bench_table.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

static void print_cell(FILE *stream, double value, const char *format, bool markdown) {
    char text[32] = "-";
    if (isfinite(value)) {
        snprintf(text, sizeof text, format, value);
    }
    fprintf(stream, markdown ? " %s |" : " %11s", text);
}

static const struct column {
    const char *title, *format;
    size_t offset;
} columns[] = {
    {"per s", "%.4g", offsetof(bst_bench_result, frames_per_s)},
    {"ms median", "%.4g", offsetof(bst_bench_result, ms_median)},
    {"ms min", "%.4g", offsetof(bst_bench_result, ms_min)},
    {"cpu ms", "%.4g", offsetof(bst_bench_result, cpu_ms)},
    {"latency ms", "%.4g", offsetof(bst_bench_result, latency_ms)},
    {"max err/sig", "%.4f", offsetof(bst_bench_result, error_sigma_max)},
    {"predicted", "%.4f", offsetof(bst_bench_result, predicted_error_sigma)},
    {"rms err/sig", "%.5f", offsetof(bst_bench_result, error_sigma_rms)},
    {"flux error", "%.1e", offsetof(bst_bench_result, flux_error_rel)},
    {"centroid px", "%.1e", offsetof(bst_bench_result, centroid_error_px)},
    {"peak MiB", "%.0f", offsetof(bst_bench_result, peak_rss_mib)},
};
enum { COLUMNS = sizeof columns / sizeof *columns };

void bst_bench_print_head(FILE *stream, bool markdown) {
    fprintf(stream, markdown ? "| name |" : "%-25s", "name");
    for (int i = 0; i < COLUMNS; i++) {
        fprintf(stream, markdown ? " %s |" : " %11s", columns[i].title);
    }
    fprintf(stream, "\n");
    for (int i = 0; markdown && i <= COLUMNS; i++) {
        fprintf(stream, i == 0 ? "|---|" : i < COLUMNS ? "---|" : "---|\n");
    }
}

void bst_bench_print_result(FILE *stream, const bst_bench_result *r, bool markdown) {
    fprintf(stream, markdown ? "| `%s` |" : "%-25s", r->name);
    for (int i = 0; i < COLUMNS; i++) {
        double value;
        memcpy(&value, (const char *)r + columns[i].offset, sizeof value);
        print_cell(stream, value, columns[i].format, markdown);
    }
    fprintf(stream, "\n");
    if (!markdown && isfinite(r->setup_s)) {
        fprintf(stream, "%-25s set-up %.3f s", "", r->setup_s);
        if (isfinite(r->ms_max)) {
            fprintf(stream, ", at most %.3f ms", r->ms_max);
        }
        if (isfinite(r->error_px)) {
            fprintf(stream, ", error at most %.1e px at 10 km", r->error_px);
        }
        fprintf(stream, "\n");
    }
    if (!markdown && isfinite(r->error_m)) {
        fprintf(stream, "%-25s error at most %.1e m\n", "", r->error_m);
    }
    if (!markdown && isfinite(r->detections)) {
        fprintf(stream, "%-25s %.0f detections a frame, %.0f more without room\n", "",
                r->detections, r->detections_lost);
    }
    for (int i = 0; !markdown && i < r->phase_count; i++) {
        fprintf(stream, r->phases[i].ms < 20.0 ? "%s%s %.1f ms%s" : "%s%s %.0f ms%s",
                i == 0 ? "                          " : "", r->phases[i].name, r->phases[i].ms,
                i + 1 < r->phase_count ? ", " : "\n");
    }
    fflush(stream);
}
