/* boresight pd: probability of detection, false alarms and errors of location over SNR. */
#include <cjson/cJSON.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/analysis/pd/pd.h"
#include "sim/app/app.h"
#include "sim/cli/load.h"
#include "sim/cli/stop_signals.h"
#include "sim/io/manifest.h"
#include "sim/io/plot.h"

typedef struct pd_request {
    bst_load_options load;
    bst_pd_options options;
    const char *range, *magnitudes, *json, *plot;
    int64_t threads;
    bool help;
} pd_request;

/* "2:12:0.5": first, last, step. */
static bst_status parse_range(bst_ctx *ctx, const char *name, const char *text, double low,
                              double high, bst_pd_options *out) {
    double v[3];
    char *end = (char *)text;
    for (int i = 0; i < 3; i++) {
        const char *from = end;
        v[i] = strtod(from, &end);
        if (end == from || !isfinite(v[i]) || *end != (i < 2 ? ':' : '\0')) {
            return bst_fail(ctx, BST_ERR_ARGUMENT,
                            "--%s \"%s\" is not FIRST:LAST:STEP, for example %s", name, text,
                            strcmp(name, "snr") == 0 ? "2:12:0.5" : "12:18:0.25");
        }
        end += i < 2;
    }
    if (!(v[0] >= low && v[1] <= high && v[0] <= v[1] && v[2] > 0.0)) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "--%s \"%s\": %g to %g, the first not above the last, and a step above 0",
                        name, text, low, high);
    }
    if ((v[1] - v[0]) / v[2] >= BST_PD_POINTS) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "--%s \"%s\" has more than %d steps", name, text,
                        BST_PD_POINTS);
    }
    out->low = v[0];
    out->high = v[1];
    out->step = v[2];
    return BST_OK;
}

static bst_status check(bst_ctx *ctx, pd_request *r, const bst_option *table) {
    bst_pd_options *o = &r->options;
    if (r->range && r->magnitudes) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "give --snr or --magnitude, not both");
    }
    o->by_magnitude = r->magnitudes;
    BST_TRY(r->magnitudes ? parse_range(ctx, "magnitude", r->magnitudes, -30.0, 40.0, o)
                          : parse_range(ctx, "snr",
                                        r->range       ? r->range
                                        : o->stack > 0 ? "0.8:2.4:0.1"
                                                       : "2:12:0.5",
                                        0.1, 1e4, o));
    if (o->known_rate && !(o->streak_px > 0.0)) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "--known-rate is of streaks: give their length with --streak PX");
    }
    if (o->known_rate && o->star_streak_px > 0.0) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "with --known-rate stars streak as targets do: leave out --star-streak");
    }
    if (o->stack % 4 != 0) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "--stack %lld: a multiple of 4",
                        (long long)o->stack);
    }
    if (o->stack > 0 && (o->streak_px > 0.0 || o->star_streak_px > 0.0)) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "--stack is of points: leave out --streak and --star-streak");
    }
    if (o->stars && o->background_e >= 0.0) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "--stars keeps the scenario's sky, --background sets another: give one");
    }
    o->threads = (int)r->threads;
    return bst_load_check(ctx, &r->load, table);
}

/* The same detector on frames by themselves, as many trials at the SNRs that it needs. */
static bst_status measure_single(bst_ctx *ctx, const pd_request *r, const bst_scenario *scenario,
                                 bst_pd_figures *out) {
    bst_pd_options options = r->options;
    options.stack = 0;
    options.by_magnitude = false;
    options.low = 3.5;
    options.high = 7.5;
    options.step = 0.5;
    options.empty_frames = 0;
    bst_pd_scene *scene = calloc(1, sizeof *scene);
    bst_pd_result *result = calloc(1, sizeof *result);
    bst_pd_detector *detector = NULL;
    bst_status status = scene && result
                            ? bst_pd_scene_open(ctx, scenario, &options, scene)
                            : bst_fail(ctx, BST_ERR_MEMORY, "no memory for the measurement");
    if (status == BST_OK) {
        status = bst_pd_detector_open(ctx, scene, &detector);
        if (status == BST_OK) {
            status = bst_pd_run(ctx, scene, detector, result);
        }
        if (status == BST_OK) {
            bst_pd_figures_of(scene, result, out);
        }
        bst_pd_detector_close(detector);
        bst_pd_scene_close(scene);
    }
    free(scene);
    free(result);
    return status;
}

static bst_status write_results(bst_ctx *ctx, const pd_request *r, const bst_scenario *scenario,
                                const bst_pd_scene *scene, const bst_pd_result *result) {
    bst_pd_figures figures, single;
    bst_pd_figures_of(scene, result, &figures);
    if (r->options.stack > 0) {
        BST_TRY(measure_single(ctx, r, scenario, &single));
        bst_pd_compare_single(&single, &figures);
    }
    bst_pd_print(scene, result, &figures);
    if (r->json) {
        cJSON *root = bst_pd_json(scene, result, &figures);
        char *text = cJSON_Print(root);
        bst_status status = text ? bst_io_write_file_atomic(ctx, r->json, text, strlen(text))
                                 : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the results");
        free(text);
        cJSON_Delete(root);
        BST_TRY(status);
    }
    return r->plot ? bst_pd_plot(ctx, r->plot, scene, result, &figures) : BST_OK;
}

static bst_status measure(bst_ctx *ctx, const pd_request *r, const bst_scenario *scenario) {
    bst_pd_scene *scene = calloc(1, sizeof *scene);
    bst_pd_result *result = calloc(1, sizeof *result);
    bst_pd_detector *detector = NULL;
    bst_status status = scene && result
                            ? bst_pd_scene_open(ctx, scenario, &r->options, scene)
                            : bst_fail(ctx, BST_ERR_MEMORY, "no memory for the measurement");
    if (status == BST_OK) {
        status = bst_pd_detector_open(ctx, scene, &detector);
        if (status == BST_OK) {
            status = bst_pd_run(ctx, scene, detector, result);
        }
        if (status == BST_OK) {
            status = write_results(ctx, r, scenario, scene, result);
        }
        bst_pd_detector_close(detector);
        bst_pd_scene_close(scene);
    }
    free(scene);
    free(result);
    return status;
}

static const char help_text[] =
    "usage: boresight pd SCENARIO.json [options]\n\n"
    "Measures the detector of a scenario against theory. Frames of the scenario's camera are\n"
    "filled with targets at random places, kept apart, of all SNRs in turn; its image\n"
    "processing finds what it finds. Printed for each SNR: probability of detection with its\n"
    "95 % interval and the ideal one, Q(Q^-1(Pfa) - SNR), at the false alarms per frame that\n"
    "were measured without targets; errors of place and flux over the Cramer-Rao bound. The\n"
    "loss is 20 log10 of the SNR needed over the ideal one, at Pd 0.5 and 0.9.\n\n"
    "SNR is sqrt(sum s^2) over the noise of a pixel without the source's own light. A\n"
    "detection counts within one FWHM of the true place; along a streak within its half\n"
    "length.\n\n"
    "  boresight pd scenarios/neossat_geo_stare.json --snr 3:9:0.5 --trials 2000 --plot "
    "pd.png\n"
    "  boresight pd scenarios/neossat_geo_stare.json --streak 20 --known-rate --json "
    "pd.json\n\n"
    "options:\n";

#define FIELD(member) .offset = offsetof(pd_request, member)

static const bst_option OPTIONS[] = {
    {.name = "snr",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(pd_request, range),
     .argument = "FIRST:LAST:STEP",
     .doc = "SNRs of the targets (default 2:12:0.5)"},
    {.name = "magnitude",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(pd_request, magnitudes),
     .argument = "FIRST:LAST:STEP",
     .doc = "V magnitudes instead of SNRs"},
    {.name = "trials",
     .kind = BST_OPTION_INT,
     .offset = offsetof(pd_request, options.trials),
     .argument = "N",
     .doc = "targets of each SNR (default 1000)",
     .minimum = 1,
     .maximum = 1e9},
    {.name = "json",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(pd_request, json),
     .path = BST_PATH_OUTPUT,
     .argument = "FILE",
     .doc = "write the figures there"},
    {.name = "plot",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(pd_request, plot),
     .path = BST_PATH_OUTPUT,
     .argument = "FILE",
     .doc = "draw Pd beside the ideal, and errors over bounds, as a PNG"},
    {.name = "streak",
     .kind = BST_OPTION_REAL,
     .offset = offsetof(pd_request, options.streak_px),
     .argument = "PX",
     .doc = "length of the targets' streaks, each in a direction of its own (default 0: "
            "points)",
     .minimum = 0,
     .maximum = 1000},
    {.name = "stack",
     .kind = BST_OPTION_INT,
     .offset = offsetof(pd_request, options.stack),
     .argument = "N",
     .doc = "search N frames together, in which targets move at rates of their own; SNRs are of "
            "one frame (default 0: each frame by itself)",
     .minimum = 0,
     .maximum = BST_STACK_MAX_FRAMES},
    {.name = "rates",
     .needs = "stack",
     .kind = BST_OPTION_REAL,
     .offset = offsetof(pd_request, options.rates_px),
     .argument = "PX",
     .doc = "greatest rate of the targets of a stack and of the search, px per frame in x and "
            "in y (default 3)",
     .minimum = 0.05,
     .maximum = 16},
    {.name = "known-rate",
     .kind = BST_OPTION_FLAG,
     .offset = offsetof(pd_request, options.known_rate),
     .doc = "the camera turns, each frame in its own direction, and image processing knows it"},
    {.name = "false-alarms",
     .kind = BST_OPTION_REAL,
     .offset = offsetof(pd_request, options.false_alarms),
     .argument = "PER_FRAME",
     .doc = "asked of the detector (default: the scenario's)",
     .minimum = 1e-6,
     .maximum = 1e4},
    {.name = "empty-frames",
     .kind = BST_OPTION_INT,
     .offset = offsetof(pd_request, options.empty_frames),
     .argument = "N",
     .doc = "frames without targets (default: for 400 false alarms, 50 to 400)",
     .minimum = 1,
     .maximum = 1e7},
    {.name = "background",
     .kind = BST_OPTION_REAL,
     .offset = offsetof(pd_request, options.background_e),
     .argument = "E",
     .doc = "sky per pixel and exposure, electrons (default: the camera's)",
     .minimum = 0,
     .maximum = 1e6},
    {.name = "jitter",
     .kind = BST_OPTION_REAL,
     .offset = offsetof(pd_request, options.jitter_px),
     .argument = "PX",
     .doc = "RMS per axis by which the image is blurred (default: jitter_px of imgproc)",
     .minimum = 0,
     .maximum = 5},
    {.name = "apart",
     .kind = BST_OPTION_REAL,
     .offset = offsetof(pd_request, options.min_separation_px),
     .argument = "PX",
     .doc = "least distance between targets, their own length not counted (default 24)",
     .minimum = 1,
     .maximum = 1000},
    {.name = "cell",
     .kind = BST_OPTION_REAL,
     .offset = offsetof(pd_request, options.cell_px),
     .argument = "PX",
     .doc = "one target in each square of this side (default: 40 more than they are apart)",
     .minimum = 3,
     .maximum = 32768},
    {.name = "stars",
     .kind = BST_OPTION_FLAG,
     .offset = offsetof(pd_request, options.stars),
     .doc = "keep the scenario's stars and sky, the camera rolled from frame to frame; what "
            "may be a star of SNR 1 or more is no false alarm"},
    {.name = "star-streak",
     .kind = BST_OPTION_REAL,
     .offset = offsetof(pd_request, options.star_streak_px),
     .argument = "PX",
     .doc = "the camera turns with the targets, each frame in a direction of its own, so that "
            "stars streak by this; image processing knows it (default 0)",
     .minimum = 0,
     .maximum = 1000},
    {.name = "module",
     .kind = BST_OPTION_FLAG,
     .offset = offsetof(pd_request, options.by_module),
     .doc = "step the scenario's imgproc module as a run does; always so of one that does not "
            "come with Boresight"},
    {.name = "sensor",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(pd_request, options.sensor),
     .argument = "OBSERVER/SENSOR",
     .doc = "whose camera and detector (default the first)"},
    BST_LOAD_OPTIONS_AT(FIELD, load),
    BST_DEVICE_OPTIONS_AT(FIELD, options.device, threads),
    {.name = "help",
     .kind = BST_OPTION_FLAG,
     .offset = offsetof(pd_request, help),
     .doc = "print this"},
    {.name = NULL},
};

int bst_cmd_pd(int argc, char **argv) {
    pd_request r = {.load = BST_LOAD_DEFAULTS,
                    .options = {.trials = 1000,
                                .background_e = -1.0,
                                .jitter_px = -1.0,
                                .min_separation_px = 24.0,
                                .rates_px = 3.0}};
    bst_option table[sizeof OPTIONS / sizeof *OPTIONS];
    bst_options_bind(OPTIONS, &r, table);
    bst_ctx ctx;
    bst_ctx_init(&ctx, bst_cli_log, NULL, BST_LOG_WARNING);
    int arguments = 0;
    if (bst_options_parse(&ctx, table, argc, argv, &arguments) != BST_OK) {
        return bst_options_misuse(&ctx, "pd");
    }
    if (r.help) {
        fputs(help_text, stdout);
        bst_options_print(stdout, table);
        return BST_EXIT_OK;
    }
    if (bst_plot_check_path(&ctx, r.plot) != BST_OK) {
        return bst_options_misuse(&ctx, "pd");
    }
    if (arguments != 1) {
        bst_fail(&ctx, BST_ERR_ARGUMENT, "one scenario file is expected, %d were given", arguments);
        return bst_options_misuse(&ctx, "pd");
    }
    if (check(&ctx, &r, table) != BST_OK) {
        return bst_options_misuse(&ctx, "pd");
    }
    bst_stop_catch_signals();
    bst_json *json = NULL;
    bst_scenario scenario;
    bst_status status = bst_load_scenario(&ctx, argv[1], &r.load, &json, &scenario);
    if (status == BST_OK) {
        status = measure(&ctx, &r, &scenario);
        bst_scenario_free(&scenario);
        bst_json_free(json);
    }
    if (status != BST_OK) {
        fprintf(stderr, "boresight: %s\n", ctx.message);
    }
    return status == BST_OK                ? BST_EXIT_OK
           : status == BST_ERR_INTERRUPTED ? BST_EXIT_INTERRUPTED
                                           : BST_EXIT_FAILED;
}
