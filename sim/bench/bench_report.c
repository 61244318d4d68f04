#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/bench/bench_report.h"
#include "sim/core/folder.h"
#include "sim/io/manifest.h"
#include "sim/io/plot.h"

enum { PATH_BYTES = 4096, WIDTH = 520, HEIGHT = 380 };

static const struct knob {
    const char *name, *doc;
} knobs[] = {
    {"tolerance_sigma", "The error that is allowed, from which all else follows."},
    {"temporal_oversample", "Equal parts of the exposure, one point of light each."},
    {"renderer", "Common track of all stars, or one per star."},
    {"spatial_oversample", "Subpixels per pixel; light is moved to their centres."},
    {"stamp_radius_px", "Reach of all stamps beyond the two nearest pixels."},
    {"psf_degree", "Degree of the polynomials of the PSF's profile."},
    {"fft_taps", "Taps per axis of the spreading on the grid, for a PSF that is no Gaussian."},
    {"faint_limit_mag", "Stars fainter than the brightest by more than this are not drawn."},
};
enum { KNOBS = sizeof knobs / sizeof *knobs };

void bst_bench_error_curve_mark_best(bst_bench_error_curve *curve) {
    for (int i = 0; i < curve->count; i++) {
        bst_bench_error_curve_point *p = &curve->points[i];
        p->best = true;
        for (int k = 0; k < curve->count; k++) {
            const bst_bench_error_curve_point *q = &curve->points[k];
            bool as_good = q->ms_min <= p->ms_min && q->error_sigma_max <= p->error_sigma_max;
            bool better = q->ms_min < p->ms_min || q->error_sigma_max < p->error_sigma_max;
            p->best &= !(as_good && better);
        }
    }
}

static bool has_knob(const bst_bench_error_curve *curve, const char *knob) {
    for (int i = 0; i < curve->count; i++) {
        if (strcmp(curve->points[i].knob, knob) == 0) {
            return true;
        }
    }
    return false;
}

/* Plots the points of one renderer option for all scenes, with the best ones marked; false:
 * none. */
static bst_status plot_knob(bst_ctx *ctx, const bst_bench_report *r, const char *knob,
                            const char *path, bool *made) {
    bst_plot plot;
    *made = false;
    int scenes = 0;
    for (int c = 0; c < r->curve_count; c++) {
        scenes += has_knob(&r->curves[c], knob);
    }
    if (scenes == 0) {
        return BST_OK;
    }
    BST_TRY(bst_plot_begin(ctx, &plot, path, WIDTH, HEIGHT));
    FILE *f = plot.script;
    for (int c = 0; c < r->curve_count; c++) {
        const bst_bench_error_curve *curve = &r->curves[c];
        for (int best = 0; best < 2; best++) {
            fprintf(f, "$%s%d << EOD\n", best ? "best" : "all", c);
            for (int i = 0; i < curve->count; i++) {
                const bst_bench_error_curve_point *p = &curve->points[i];
                if (strcmp(p->knob, knob) == 0 && (!best || p->best)) {
                    fprintf(f, "%.4g %.4g \"%s\"\n", p->ms_min, fmax(p->error_sigma_max, 1e-6),
                            p->value);
                }
            }
            fprintf(f, best ? "NaN NaN \"\"\nEOD\n" : "EOD\n");
        }
    }
    fprintf(f,
            "set logscale xy\nset grid\nset key outside bottom center horizontal noenhanced\n"
            "set offsets graph 0.1, graph 0.15, graph 0.1, graph 0.1\n"
            "set xlabel 'ms per frame (least)'\nset ylabel 'largest error, sigma'\n"
            "set title '%s' noenhanced\nplot ",
            knob);
    int shown = 0;
    for (int c = 0; c < r->curve_count; c++) {
        if (has_knob(&r->curves[c], knob)) {
            fprintf(f,
                    "%s$all%d u 1:2 w lp lt %d pt 7 ps 0.6 t '%s', $all%d u 1:2:3 w labels "
                    "offset 0,0.6 font ',8' tc rgb '#555555' notitle, $best%d u 1:2 w p lt %d pt 6 "
                    "ps 1.5 lw 1.5 notitle",
                    shown++ ? ", " : "", c, c + 1, r->curves[c].scene, c, c, c + 1);
        }
    }
    fputc('\n', f);
    return bst_plot_end(ctx, &plot, made);
}

static bst_status plot_growth(bst_ctx *ctx, const bst_bench_growth_law *g, const char *title,
                              const char *path, bool *made) {
    bst_plot plot;
    BST_TRY(bst_plot_begin(ctx, &plot, path, WIDTH, HEIGHT));
    FILE *f = plot.script;
    fprintf(f, "$data << EOD\n");
    for (int i = 0; i < g->count; i++) {
        fprintf(f, "%.6g %.6g\n", g->size[i], g->ms_min[i]);
    }
    fprintf(f,
            "EOD\nset logscale xy\nset grid\nset key left top\nset xlabel '%s'\n"
            "set ylabel 'ms per frame (least)'\n"
            "plot $data u 1:2 w p pt 7 lt 1 t 'measured', %.9g + %.9g * x w l lt 2 t '%.3g ms + "
            "%.3g ms x'\n",
            title, g->offset_ms, g->slope_ms, g->offset_ms, g->slope_ms);
    return bst_plot_end(ctx, &plot, made);
}

static void write_machine(FILE *f, const cJSON *machine) {
    const char *const keys[] = {"cpu", "os", "compiler", "device", "driver", "version", "date"};
    const cJSON *cores = cJSON_GetObjectItem(machine, "cores"),
                *load = cJSON_GetObjectItem(machine, "load_before");
    fprintf(f, "Machine: %d cores", cJSON_IsNumber(cores) ? (int)cores->valuedouble : 0);
    for (size_t i = 0; i < sizeof keys / sizeof *keys; i++) {
        const cJSON *item = cJSON_GetObjectItem(machine, keys[i]);
        if (cJSON_IsString(item) && item->valuestring[0]) {
            fprintf(f, ", %s", item->valuestring);
        }
    }
    fprintf(f, ".");
    if (cJSON_IsNumber(load)) {
        fprintf(f, " Load before it began: %.1f.", load->valuedouble);
    }
    fprintf(f, "\n\n");
}

static void write_cell(FILE *f, double value, const char *format) {
    if (isfinite(value)) {
        fputc(' ', f);
        fprintf(f, format, value);
        fputs(" |", f);
    } else {
        fputs(" |", f);
    }
}

static void write_knob(FILE *f, const bst_bench_report *r, const struct knob *k, bool picture) {
    fprintf(f, "## `%s`\n\n%s\n\n", k->name, k->doc);
    if (picture) {
        fprintf(f, "![Error against time](images/speed_error_%s.png)\n\n", k->name);
    }
    fprintf(f,
            "| scene | value | ms least | ms median | cpu ms | largest error σ | predicted σ | "
            "flux error | |\n|---|---|---|---|---|---|---|---|---|\n");
    for (int c = 0; c < r->curve_count; c++) {
        for (int i = 0; i < r->curves[c].count; i++) {
            const bst_bench_error_curve_point *p = &r->curves[c].points[i];
            if (strcmp(p->knob, k->name) != 0) {
                continue;
            }
            fprintf(f, "| `%s` | %s |", r->curves[c].scene, p->value);
            write_cell(f, p->ms_min, "%.4g");
            write_cell(f, p->ms_median, "%.4g");
            write_cell(f, p->cpu_ms, "%.4g");
            write_cell(f, p->error_sigma_max, "%.2g");
            write_cell(f, p->predicted_sigma, "%.2g");
            write_cell(f, p->flux_error_rel, "%.1e");
            fprintf(f, "%s |\n", p->best ? " ●" : "");
        }
    }
    fputc('\n', f);
}

static void write_factors(FILE *f, const bst_bench_report *r) {
    fprintf(f,
            "## Temporal factor and star track\n\n"
            "The classic table: the exposure in equal parts, all stars on one track "
            "(`single_kernel`) or each on its own (`multi_kernel`). Milliseconds per frame "
            "(least) and largest error in σ.\n\n| factor | renderer |");
    for (int c = 0; c < r->factor_count; c++) {
        fprintf(f, " `%s` ms | σ |", r->factors[c].scene);
    }
    fprintf(f, "\n|---|---|");
    for (int c = 0; c < r->factor_count; c++) {
        fprintf(f, "---|---|");
    }
    fputc('\n', f);
    for (int i = 0; i < 2 * BST_FACTORS; i++) {
        fprintf(f, "| %d | %s |", bst_bench_factors[i / 2], i % 2 ? "multi" : "single");
        for (int c = 0; c < r->factor_count; c++) {
            fprintf(f, " %.4g | %.2g |", r->factors[c].ms[i / 2][i % 2],
                    r->factors[c].error_sigma[i / 2][i % 2]);
        }
        fputc('\n', f);
    }
    fputc('\n', f);
}

static void write_growth(FILE *f, const bst_bench_growth_law *g, const char *title,
                         const char *what, const char *image, bool picture) {
    fprintf(f, "### %s\n\n", title);
    if (picture) {
        fprintf(f, "![%s](images/%s)\n\n", title, image);
    }
    fprintf(f, "| %s | ms least | fit | cpu ms | peak MiB |\n|---|---|---|---|---|\n", what);
    for (int i = 0; i < g->count; i++) {
        fprintf(f, "| %.0f | %.4g | %.4g | %.4g | %.0f |\n", g->size[i], g->ms_min[i],
                g->offset_ms + g->slope_ms * g->size[i], g->cpu_ms[i], g->peak_rss_mib[i]);
    }
    fprintf(f,
            "\nFit: %.4g ms + %.4g ms per 1000 %s; the measured times differ from it by at most "
            "%.0f %%.\n\n",
            g->offset_ms, 1e3 * g->slope_ms, what, 100.0 * g->worst_rel);
}

static bst_status write_text(bst_ctx *ctx, const bst_bench_report *r, const cJSON *machine,
                             const bool *pictures, const char *path) {
    char *text = NULL;
    size_t bytes = 0;
    FILE *f = open_memstream(&text, &bytes);
    if (!f) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the report");
    }
    fprintf(
        f,
        "# Speed and error\n\nWritten by `boresight bench --curve`; scenes and errors are those "
        "of `boresight bench`. A knob is varied at a time, the others as the scene's tolerance "
        "chooses. Times are of whole frames with the full detector, pixels mapped; errors are "
        "those of the noise-free image against the double-precision reference, in σ of the "
        "pixel. ● marks the points (ringed in the pictures) that no other point of their scene, "
        "of any knob, beats in least time and error.\n\n");
    write_machine(f, machine);
    for (int k = 0; k < KNOBS; k++) {
        bool any = false;
        for (int c = 0; c < r->curve_count; c++) {
            any |= has_knob(&r->curves[c], knobs[k].name);
        }
        if (any) {
            write_knob(f, r, &knobs[k], pictures[k]);
        }
    }
    write_factors(f, r);
    if (r->has_growth) {
        fprintf(f,
                "## Growth\n\n2048 × 2048 px, 1 s, tolerance 0.05 σ. The line is fitted to the "
                "relative misses.\n\n");
        write_growth(f, &r->stars, "With the number of stars (5 px of motion)", "stars",
                     "speed_error_stars.png", pictures[KNOBS]);
        write_growth(f, &r->streak, "With the length of the streaks (1000 stars)", "px",
                     "speed_error_streak.png", pictures[KNOBS + 1]);
    }
    fclose(f);
    while (bytes > 1 && text[bytes - 1] == '\n' && text[bytes - 2] == '\n') {
        bytes--;
    }
    bst_status status = bst_io_write_file_atomic(ctx, path, text, bytes);
    free(text);
    return status;
}

bst_status bst_bench_report_write(bst_ctx *ctx, const bst_bench_report *r, const cJSON *machine,
                                  const char *folder) {
    char path[PATH_BYTES];
    bool pictures[KNOBS + 2] = {false};
    if (strlen(folder) > PATH_BYTES - 100) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "%s: too long a path", folder);
    }
    BST_TRY(bst_folder_make(ctx, folder));
    snprintf(path, sizeof path, "%s/images", folder);
    BST_TRY(bst_folder_make(ctx, path));
    for (int k = 0; k < KNOBS; k++) {
        snprintf(path, sizeof path, "%s/images/speed_error_%s.png", folder, knobs[k].name);
        BST_TRY(plot_knob(ctx, r, knobs[k].name, path, &pictures[k]));
    }
    if (r->has_growth) {
        snprintf(path, sizeof path, "%s/images/speed_error_stars.png", folder);
        BST_TRY(plot_growth(ctx, &r->stars, "stars", path, &pictures[KNOBS]));
        snprintf(path, sizeof path, "%s/images/speed_error_streak.png", folder);
        BST_TRY(plot_growth(ctx, &r->streak, "length of streaks, px", path, &pictures[KNOBS + 1]));
    }
    snprintf(path, sizeof path, "%s/speed_error.md", folder);
    BST_TRY(write_text(ctx, r, machine, pictures, path));
    printf("%s\n", path);
    return BST_OK;
}
