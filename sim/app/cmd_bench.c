#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/app/app.h"
#include "sim/bench/bench.h"
#include "sim/cli/load.h"
#include "sim/cli/shipped.h"
#include "sim/io/manifest.h"

static const bst_bench benches[] = {
    {"sgp4", "SGP4, 1,000 satellites x 1,000 epochs of a week, one thread", bst_bench_sgp4},
    {"numerical_leo", "a day of a numerical low orbit, all forces, from its state",
     bst_bench_numerical},
    {"star_cull", "catalogue query of a 1.5 degree field, file warm", bst_bench_star_cull},
    {"ephemeris_5000", "field query, 5,000 objects, 3 observers, per frame and observer",
     bst_bench_ephemeris},
    {"ephemeris_30000", "the same with 30,000 objects", bst_bench_ephemeris},
    {"worst_case", "2048x2048, 3220 stars, 300 px streaks, rotation, acceleration, jitter",
     bst_bench_scene_run},
    {"worst_case_plain", "the same, without the detector's patterns, hits, noise tails and bends",
     bst_bench_scene_run},
    {"worst_case_diffraction_q1", "worst_case, PSF by diffraction of an aberrated aperture, Q = 1",
     bst_bench_scene_run},
    {"worst_case_diffraction_q2", "the same, Q = 2", bst_bench_scene_run},
    {"acquisition", "2048x2048, 500 stars, 3 px of motion, 3 targets", bst_bench_scene_run},
    {"acquisition_plain", "the same, without the detector's patterns, hits, noise tails and bends",
     bst_bench_scene_run},
    {"rate_track_slow", "2048x2048, target at rest, stars 10 px", bst_bench_scene_run},
    {"rate_track_medium", "2048x2048, target at rest, stars 60 px", bst_bench_scene_run},
    {"rate_track_fast", "2048x2048, target at rest, stars 200 px", bst_bench_scene_run},
    {"galactic_core", "2048x2048, 100,000 stars, 5 px of motion", bst_bench_scene_run},
    {"window", "256x256 read-out window on a tracked target", bst_bench_scene_run},
    {"imgproc_acquisition", "image processing of the frames of acquisition, rendered beforehand",
     bst_bench_imgproc},
    {"imgproc_worst_case", "of worst_case", bst_bench_imgproc},
    {"imgproc_galactic_core", "of galactic_core, the 2,048 brightest", bst_bench_imgproc},
    {"imgproc_crowded", "of galactic_core, all of some 30,000", bst_bench_imgproc},
    {"imgproc_window", "of window", bst_bench_imgproc},
    {"imgproc_stack", "stacks of 16 frames of 2048x2048, rates to 3 px per frame: per frame",
     bst_bench_stack},
    {"loop_full", "closed loop of the main scenario, per frame", bst_bench_loop},
    {"loop_obsgen",
     "a day of the closed loop with the observation generator, per frame of 2 s, plant at 100 Hz",
     bst_bench_loop_obsgen},
    {"open_loop", "run of an open-loop scenario with recording, per frame, and with --serial",
     bst_bench_open_loop},
    {"link_tcp", "frame of 2048x2048 out over tcp, looked at, pointing in: per round trip",
     bst_bench_link},
    {"link_ipc", "the same over ipc", bst_bench_link},
    {"link_shm", "the same, frames by shared memory", bst_bench_link},
    {"cold_start", "first frame of a fresh process, kernels in the cache", bst_bench_cold_start},
    {"plant_second_order", "plant step of the gimbal type second_order, as in the main scenario",
     bst_bench_plant_second_order},
    {"plant_full", "of azimuth_elevation with friction, cable, a flexible mode and encoders",
     bst_bench_plant_full},
    {"plant_spacecraft", "of a rigid_body with 4 wheels, 2 modes, sensors and control",
     bst_bench_plant_spacecraft},
    {"plant_all", "of both together", bst_bench_plant_all},
    {"study_100000", "expansion and aggregation of 100,000 runs, per run", bst_bench_study},
    {"small", "256x256, 30 stars, 20 px streaks: a quick trial (only when named)",
     bst_bench_scene_run},
};
enum { BENCHES = sizeof benches / sizeof *benches };

static void print_cell(double value, const char *format, bool markdown) {
    char text[32] = "-";
    if (isfinite(value)) {
        snprintf(text, sizeof text, format, value);
    }
    printf(markdown ? " %s |" : " %11s", text);
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
enum { COLUMNS = sizeof columns / sizeof *columns, NAME_WIDTH = 25 };

static void print_head(bool markdown) {
    printf(markdown ? "| name |" : "%-25s", "name");
    for (int i = 0; i < COLUMNS; i++) {
        printf(markdown ? " %s |" : " %11s", columns[i].title);
    }
    printf("\n");
    for (int i = 0; markdown && i <= COLUMNS; i++) {
        printf(i == 0 ? "|---|" : i < COLUMNS ? "---|" : "---|\n");
    }
}

static void print_result(const bst_bench_result *r, bool markdown) {
    printf(markdown ? "| `%s` |" : "%-25s", r->name);
    for (int i = 0; i < COLUMNS; i++) {
        double value;
        memcpy(&value, (const char *)r + columns[i].offset, sizeof value);
        print_cell(value, columns[i].format, markdown);
    }
    printf("\n");
    if (!markdown && isfinite(r->setup_s)) {
        printf("%-25s set-up %.3f s", "", r->setup_s);
        if (isfinite(r->ms_max)) {
            printf(", at most %.3f ms", r->ms_max);
        }
        if (isfinite(r->error_px)) {
            printf(", error at most %.1e px at 10 km", r->error_px);
        }
        printf("\n");
    }
    if (!markdown && isfinite(r->error_m)) {
        printf("%-25s error at most %.1e m\n", "", r->error_m);
    }
    if (!markdown && isfinite(r->detections)) {
        printf("%-25s %.0f detections a frame, %.0f more without room\n", "", r->detections,
               r->detections_lost);
    }
    for (int i = 0; !markdown && i < r->phase_count; i++) {
        printf(r->phases[i].ms < 20.0 ? "%s%s %.1f ms%s" : "%s%s %.0f ms%s",
               i == 0 ? "                          " : "", r->phases[i].name, r->phases[i].ms,
               i + 1 < r->phase_count ? ", " : "\n");
    }
    fflush(stdout);
}

static bool wanted(const bst_bench *bench, int count, char **names) {
    for (int i = 0; i < count; i++) {
        if (strcmp(names[i], bench->name) == 0) {
            return true;
        }
    }
    return count == 0 && strcmp(bench->name, "small") != 0;
}

static bst_status check_names(bst_ctx *ctx, int count, char **names) {
    for (int i = 0; i < count; i++) {
        bool known = false;
        for (int b = 0; b < BENCHES; b++) {
            known |= strcmp(names[i], benches[b].name) == 0;
        }
        if (!known) {
            return bst_fail(ctx, BST_ERR_ARGUMENT,
                            "there is no benchmark \"%s\"; --help lists them", names[i]);
        }
    }
    return BST_OK;
}

typedef struct errand {
    const bst_bench *bench;
    const bst_bench_options *options;
} errand;

static bst_status run_bench(bst_ctx *ctx, void *user, void *out) {
    const errand *e = user;
    bst_bench_result *result = out;
    BST_TRY(e->bench->run(ctx, e->bench, e->options, result));
    if (isnan(result->peak_rss_mib)) {
        result->peak_rss_mib = bst_bench_peak_rss_mib();
    }
    return BST_OK;
}

/* Each in a process of its own: its memory is its own, and nothing is warm that others warmed. */
static bst_status run_all(bst_ctx *ctx, const bst_bench_options *options, bool markdown, int count,
                          char **names, const bst_bench_device *device, cJSON *results) {
    print_head(markdown);
    for (int b = 0; b < BENCHES; b++) {
        if (!wanted(&benches[b], count, names)) {
            continue;
        }
        bst_bench_result result = bst_bench_nothing(benches[b].name);
        errand e = {&benches[b], options};
        BST_TRY(bst_bench_apart(ctx, run_bench, &e, &result, sizeof result));
        print_result(&result, markdown);
        cJSON_AddItemToArray(results, bst_bench_result_json(&result, device));
    }
    return BST_OK;
}

static void print_help(const bst_option *table) {
    printf(
        "usage: boresight bench [NAME...] [options]\n\n"
        "Measures speed together with the error of the same configuration against the "
        "double-precision reference\n"
        "(errors in sigma of the pixel, on an even choice of the sources). The next frame is "
        "planned "
        "while one is\n"
        "rendered: ms are from one mapped frame to the next, latency from asking for a frame until "
        "it is mapped.\n"
        "Timings of a busy machine are noisy: "
        "compare two versions in alternation and look at the minimum.\n\n"
        "  boresight bench worst_case loop_full --json bench.json\n"
        "  boresight bench --curve\n\nbenchmarks (all when none is "
        "named):\n");
    for (int b = 0; b < BENCHES; b++) {
        printf("  %-25s %s\n", benches[b].name, benches[b].doc);
    }
    printf("\noptions:\n");
    bst_options_print(stdout, table);
}

static void print_machine(const cJSON *machine) {
    const cJSON *item;
    cJSON_ArrayForEach(item, machine) {
        printf("%s%s", item->prev && item->prev->next ? ", " : "",
               cJSON_IsString(item) ? item->valuestring : item->string);
        if (cJSON_IsNumber(item)) {
            printf(" %g", item->valuedouble);
        }
    }
    printf("\n\n");
}

static bst_status bench(bst_ctx *ctx, const bst_bench_options *options, const char *json,
                        bool markdown, int count, char **names) {
    bst_bench_device device;
    BST_TRY(bst_bench_describe_device(ctx, options, &device));
    cJSON *root = cJSON_CreateObject(), *machine = bst_bench_machine(&device);
    cJSON_AddItemToObject(root, "machine", machine);
    cJSON *results = cJSON_AddArrayToObject(root, "results");
    print_machine(machine);
    bst_status status = run_all(ctx, options, markdown, count, names, &device, results);
    if (status == BST_OK && json) {
        char *text = cJSON_Print(root);
        status = text ? bst_io_write_file_atomic(ctx, json, text, strlen(text))
                      : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the results");
        free(text);
    }
    cJSON_Delete(root);
    return status;
}

int bst_cmd_bench(int argc, char **argv) {
    bool help = false, markdown = false, curve = false, first_frame = false;
    const char *json = NULL, *report = "docs/results";
    int64_t threads = 0;
    char scenario[4096];
    bst_cli_shipped_file("scenarios/neossat_geo_track.json", scenario, sizeof scenario);
    bst_bench_options options = {.scenario = scenario};
    const bst_option table[] = {
        {.name = "json",
         .kind = BST_OPTION_TEXT,
         .target = &json,
         .path = BST_PATH_OUTPUT,
         .argument = "FILE",
         .doc = "write the results there, with the machine they were measured on"},
        {.name = "markdown",
         .kind = BST_OPTION_FLAG,
         .target = &markdown,
         .doc = "print a Markdown table"},
        {.name = "curve",
         .kind = BST_OPTION_FLAG,
         .target = &curve,
         .doc = "vary each knob of fidelity, and the size of the scene, and write the report "
                "(a scene's NAME: its curve alone)"},
        {.name = "report",
         .needs = "curve",
         .kind = BST_OPTION_TEXT,
         .target = &report,
         .path = BST_PATH_OUTPUT_FOLDER,
         .argument = "FOLDER",
         .doc = "where --curve writes speed_error.md and its images (default docs/results)"},
        BST_DEVICE_OPTIONS(options.device, threads),
        {.name = "tle",
         .kind = BST_OPTION_TEXT,
         .target = &options.tle_file,
         .path = BST_PATH_INPUT,
         .argument = "FILE",
         .doc = "element sets (default of sgp4: scenarios/catalogue_2022-06.tle, of ephemeris_*: "
                "drawn)"},
        {.name = "scenario",
         .kind = BST_OPTION_TEXT,
         .target = &options.scenario,
         .path = BST_PATH_INPUT,
         .argument = "FILE",
         .doc = "scenario of loop_full (default scenarios/neossat_geo_track.json)"},
        {.name = "first-frame",
         .kind = BST_OPTION_FLAG,
         .target = &first_frame,
         .doc = "render one frame and print when each step of it was done, in seconds of the "
                "monotonic clock: what cold_start starts"},
        {.name = "help", .kind = BST_OPTION_FLAG, .target = &help, .doc = "print this"},
        {.name = NULL},
    };
    bst_ctx ctx;
    bst_ctx_init(&ctx, bst_cli_log, NULL, BST_LOG_WARNING);
    int arguments = 0;
    if (bst_options_parse(&ctx, table, argc, argv, &arguments) != BST_OK) {
        return bst_options_misuse(&ctx, "bench");
    }
    if (help) {
        print_help(table);
        return BST_EXIT_OK;
    }
    if (check_names(&ctx, arguments, argv + 1) != BST_OK) {
        return bst_options_misuse(&ctx, "bench");
    }
    options.threads = (int)threads;
    bst_status status =
        first_frame ? bst_bench_first_frame(&ctx, &options)
        : curve     ? bst_bench_curve(&ctx, &options, arguments > 0 ? argv[1] : NULL, report)
                    : bench(&ctx, &options, json, markdown, arguments, argv + 1);
    if (status != BST_OK) {
        fprintf(stderr, "boresight: %s\n", ctx.message);
        return BST_EXIT_FAILED;
    }
    return BST_EXIT_OK;
}
