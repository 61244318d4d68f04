#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/utsname.h>
#include <time.h>
#include <unistd.h>

#include <cjson/cJSON.h>

#include "sim/app/app.h"
#include "sim/app/bench.h"
#include "sim/app/json_number.h"
#include "sim/app/load.h"
#include "sim/core/version.h"
#include "sim/device/device.h"
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
     bst_bench_scene},
    {"worst_case_diffraction_q1", "the same, aberrated diffraction PSF, lambda F / pixel = 1",
     bst_bench_scene},
    {"worst_case_diffraction_q2", "the same, aberrated diffraction PSF, lambda F / pixel = 2",
     bst_bench_scene},
    {"acquisition", "2048x2048, 500 stars, 3 px of motion, 3 targets", bst_bench_scene},
    {"rate_track_slow", "2048x2048, target at rest, stars 10 px", bst_bench_scene},
    {"rate_track_medium", "2048x2048, target at rest, stars 60 px", bst_bench_scene},
    {"rate_track_fast", "2048x2048, target at rest, stars 200 px", bst_bench_scene},
    {"galactic_core", "2048x2048, 100,000 stars, 5 px of motion", bst_bench_scene},
    {"window", "256x256 read-out window on a tracked target", bst_bench_scene},
    {"loop_full", "closed loop of the main scenario, per frame", bst_bench_loop},
};
enum { BENCHES = sizeof benches / sizeof *benches };

static double clock_ms(clockid_t id) {
    struct timespec now;
    clock_gettime(id, &now);
    return 1e3 * (double)now.tv_sec + 1e-6 * (double)now.tv_nsec;
}

void bst_bench_start(bst_bench_clock *clock) {
    clock->cpu_started_ms = clock_ms(CLOCK_PROCESS_CPUTIME_ID);
    clock->started_ms = clock_ms(CLOCK_MONOTONIC);
}

void bst_bench_stop(bst_bench_clock *clock, int calls) {
    double ms = clock_ms(CLOCK_MONOTONIC) - clock->started_ms;
    clock->cpu_total_ms += (clock_ms(CLOCK_PROCESS_CPUTIME_ID) - clock->cpu_started_ms) / calls;
    if (clock->count < BST_BENCH_TIMES) {
        clock->ms[clock->count++] = ms / calls;
    }
}

static int ascending(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

void bst_bench_summarise(bst_bench_clock *clock, bst_bench_result *out) {
    if (clock->count == 0) {
        return;
    }
    qsort(clock->ms, (size_t)clock->count, sizeof *clock->ms, ascending);
    out->ms_min = clock->ms[0];
    out->ms_median = 0.5 * (clock->ms[(clock->count - 1) / 2] + clock->ms[clock->count / 2]);
    out->frames_per_s = 1e3 / out->ms_median;
    out->cpu_ms = clock->cpu_total_ms / clock->count;
}

static double peak_rss_mib(void) {
    struct rusage usage;
    getrusage(RUSAGE_SELF, &usage);
    return (double)usage.ru_maxrss / 1024.0;
}

static void add_result(cJSON *list, const bst_bench_result *r, const char *device, int threads) {
    cJSON *node = cJSON_CreateObject();
    cJSON_AddStringToObject(node, "name", r->name);
    bst_json_add_number(node, "frames_per_s", r->frames_per_s);
    bst_json_add_number(node, "ms_median", r->ms_median);
    bst_json_add_number(node, "ms_min", r->ms_min);
    bst_json_add_number(node, "cpu_ms", r->cpu_ms);
    bst_json_add_number(node, "error_sigma_max", r->error_sigma_max);
    bst_json_add_number(node, "error_sigma_rms", r->error_sigma_rms);
    bst_json_add_number(node, "flux_error_rel", r->flux_error_rel);
    cJSON_AddNumberToObject(node, "error_sources", r->error_sources);
    bst_json_add_number(node, "peak_rss_mib", r->peak_rss_mib);
    bst_json_add_number(node, "setup_s", r->setup_s);
    bst_json_add_number(node, "ms_max", r->ms_max);
    bst_json_add_number(node, "error_px", r->error_px);
    bst_json_add_number(node, "error_m", r->error_m);
    cJSON_AddStringToObject(node, "device", device);
    cJSON_AddNumberToObject(node, "threads", threads);
    cJSON_AddItemToArray(list, node);
}

static cJSON *machine(void) {
    cJSON *node = cJSON_CreateObject();
    struct utsname system;
    if (uname(&system) == 0) {
        char text[200];
        snprintf(text, sizeof text, "%.60s %.60s %.60s", system.sysname, system.release,
                 system.machine);
        cJSON_AddStringToObject(node, "system", text);
    }
    char line[256], model[256] = "unknown";
    FILE *info = fopen("/proc/cpuinfo", "r");
    while (info && fgets(line, sizeof line, info)) {
        if (strncmp(line, "model name", 10) == 0 && strchr(line, ':')) {
            snprintf(model, sizeof model, "%s", strchr(line, ':') + 2);
            model[strcspn(model, "\n")] = '\0';
            break;
        }
    }
    if (info) {
        fclose(info);
    }
    cJSON_AddStringToObject(node, "processor", model);
    cJSON_AddNumberToObject(node, "processors", (double)sysconf(_SC_NPROCESSORS_ONLN));
    cJSON_AddStringToObject(node, "version", bst_version());
    cJSON_AddStringToObject(node, "git_revision", bst_git_revision());
    return node;
}

static void print_cell(double value, const char *format) {
    char text[32] = "-";
    if (isfinite(value)) {
        snprintf(text, sizeof text, format, value);
    }
    printf(" %12s", text);
}

static void print_result(const bst_bench_result *r) {
    printf("%-18s", r->name);
    print_cell(r->frames_per_s, "%.4g");
    print_cell(r->ms_median, "%.4g");
    print_cell(r->ms_min, "%.4g");
    print_cell(r->cpu_ms, "%.4g");
    print_cell(r->error_sigma_max, "%.4f");
    print_cell(r->error_sigma_rms, "%.5f");
    print_cell(r->flux_error_rel, "%.1e");
    print_cell(r->peak_rss_mib, "%.0f");
    printf("\n");
    if (isfinite(r->setup_s)) {
        printf("%-18s set-up %.3f s, at most %.3f ms, error at most %.1e px at 10 km\n", "",
               r->setup_s, r->ms_max, r->error_px);
    }
    if (isfinite(r->error_m)) {
        printf("%-18s error at most %.1e m\n", "", r->error_m);
    }
    fflush(stdout);
}

static bool wanted(const bst_bench *bench, int count, char **names) {
    for (int i = 0; i < count; i++) {
        if (strcmp(names[i], bench->name) == 0) {
            return true;
        }
    }
    return count == 0;
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

static bst_status run_all(bst_ctx *ctx, const bst_bench_options *options, int count, char **names,
                          cJSON *results) {
    bst_device *device = NULL;
    char description[256];
    BST_TRY(
        bst_device_open(ctx, options->device ? options->device : "", options->threads, &device));
    snprintf(description, sizeof description, "%s", bst_device_description(device));
    bst_device_close(device);
    printf("%s\n%-18s %12s %12s %12s %12s %12s %12s %12s %12s\n", description, "name", "per s",
           "ms median", "ms min", "cpu ms", "err max/sig", "err rms/sig", "flux error", "peak MiB");
    for (int b = 0; b < BENCHES; b++) {
        if (!wanted(&benches[b], count, names)) {
            continue;
        }
        bst_bench_result result = {
            benches[b].name, NAN, NAN, NAN, NAN, NAN, NAN, NAN, 0, NAN, NAN, NAN, NAN, NAN};
        BST_TRY(benches[b].run(ctx, &benches[b], options, &result));
        result.peak_rss_mib = peak_rss_mib();
        print_result(&result);
        add_result(results, &result, description, options->threads);
    }
    return BST_OK;
}

static void print_help(const bst_option *table) {
    printf(
        "usage: boresight bench [NAME...] [options]\n\n"
        "Measures speed together with the error of the same configuration against the "
        "double-precision reference\n"
        "(errors in sigma of the pixel, on an even choice of the sources). Timings of a busy "
        "machine are noisy:\n"
        "compare two versions in alternation and look at the minimum.\n\n"
        "  boresight bench worst_case loop_full --json bench.json\n\nbenchmarks (all when none is "
        "named):\n");
    for (int b = 0; b < BENCHES; b++) {
        printf("  %-18s %s\n", benches[b].name, benches[b].doc);
    }
    printf("\noptions:\n");
    bst_options_print(stdout, table);
}

int bst_cmd_bench(int argc, char **argv) {
    bool help = false;
    const char *json = NULL;
    int64_t threads = 0;
    bst_bench_options options = {.scenario = "scenarios/neossat_geo_track.json"};
    const bst_option table[] = {
        {.name = "json",
         .kind = BST_OPTION_TEXT,
         .target = &json,
         .argument = "FILE",
         .doc = "write the results there"},
        BST_DEVICE_OPTIONS(options.device, threads),
        {.name = "tle",
         .kind = BST_OPTION_TEXT,
         .target = &options.tle_file,
         .argument = "FILE",
         .doc = "element sets (default of sgp4: scenarios/catalogue_2022-06.tle, of ephemeris_*: "
                "drawn)"},
        {.name = "scenario",
         .kind = BST_OPTION_TEXT,
         .target = &options.scenario,
         .argument = "FILE",
         .doc = "scenario of loop_full (default scenarios/neossat_geo_track.json)"},
        {.name = "help", .kind = BST_OPTION_FLAG, .target = &help, .doc = "print this"},
        {.name = NULL},
    };
    bst_ctx ctx;
    bst_ctx_init(&ctx, bst_app_log, NULL, BST_LOG_WARNING);
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
    cJSON *root = cJSON_CreateObject();
    cJSON_AddItemToObject(root, "machine", machine());
    cJSON *results = cJSON_AddArrayToObject(root, "results");
    bst_status status = run_all(&ctx, &options, arguments, argv + 1, results);
    if (status == BST_OK && json) {
        char *text = cJSON_Print(root);
        status = text ? bst_write_file_atomic(&ctx, json, text, strlen(text))
                      : bst_fail(&ctx, BST_ERR_MEMORY, "out of memory for the results");
        free(text);
    }
    cJSON_Delete(root);
    if (status != BST_OK) {
        fprintf(stderr, "boresight: %s\n", ctx.message);
        return BST_EXIT_FAILED;
    }
    return BST_EXIT_OK;
}
