/* boresight bench: speed, together with the error of the same configuration. */
#include <stdio.h>

#include "sim/app/app.h"
#include "sim/bench/bench_list.h"
#include "sim/bench/bench_run.h"
#include "sim/cli/command_line.h"
#include "sim/cli/load.h"
#include "sim/cli/shipped.h"

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
    for (int b = 0; b < BST_BENCHES; b++) {
        printf("  %-25s %s\n", bst_bench_list[b].name, bst_bench_list[b].doc);
    }
    printf("\noptions:\n");
    bst_options_print(stdout, table);
}

/* Which options are given. */
typedef struct given {
    bool curve, first_frame, json, markdown, tle, scenario;
} given;

/* Refuses unknown names, and what has no effect on the benchmarks, --curve or --first-frame. */
static bst_status check_use(bst_ctx *ctx, const given *g, int count, char *const *names) {
    const char *const modes[] = {g->curve ? "curve" : NULL, g->first_frame ? "first-frame" : NULL};
    const char *mode = g->curve ? modes[0] : modes[1];
    const char *unused = g->json       ? "json"
                         : g->markdown ? "markdown"
                         : g->tle      ? "tle"
                         : g->scenario ? "scenario"
                                       : NULL;
    BST_TRY(bst_options_one_of(ctx, modes, 2));
    if (mode && unused) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "--%s has no effect with --%s: leave one of them out", unused, mode);
    }
    if (mode && count > (g->curve ? 1 : 0)) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "--%s: %d benchmark names were given (allowed: %s)",
                        mode, count, g->curve ? "one scene, or none" : "none");
    }
    BST_TRY(bst_bench_check_names(ctx, count, names));
    return bst_bench_check_files(ctx, g->tle, g->scenario, count, names);
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
         .doc = "scenario of loop_full, sim_*, env_* and study_100000 (default "
                "scenarios/neossat_geo_track.json)"},
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
    const given g = {.curve = curve,
                     .first_frame = first_frame,
                     .json = json != NULL,
                     .markdown = markdown,
                     .tle = options.tle_file != NULL,
                     .scenario = options.scenario != scenario};
    if (check_use(&ctx, &g, arguments, argv + 1) != BST_OK) {
        return bst_options_misuse(&ctx, "bench");
    }
    options.threads = (int)threads;
    bst_status status =
        first_frame ? bst_bench_first_frame(&ctx, &options)
        : curve     ? bst_bench_curve(&ctx, &options, arguments > 0 ? argv[1] : NULL, report)
                    : bst_bench_run(&ctx, &options, json, markdown, arguments, argv + 1);
    return bst_command_line_end(&ctx, status);
}
