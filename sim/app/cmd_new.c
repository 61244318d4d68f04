/* boresight new: a first scenario for two satellites. */
#include "sim/analysis/new/new_scenario.h"
#include "sim/app/app.h"
#include "sim/cli/command_line.h"
#include "sim/cli/outputs.h"

static const char help_text[] =
    "usage: boresight new [FILE.json] [options]\n"
    "\n"
    "Writes a small scenario in which one satellite finds and follows another: a telescope on the "
    "one, and a loop that\n"
    "holds. The time is one at which the target is in sunlight and clear of the Earth, the Moon "
    "and the Sun for the\n"
    "whole run, and slow; it is looked for in the two days from the later of the element sets. "
    "Exposure, frame\n"
    "rate and mount are chosen for it; boresight check warns of nothing. Without options NEOSSat "
    "looks at INMARSAT GX5.\n"
    "\n"
    "  boresight new first.json\n"
    "  boresight new pass.json --observer-tle 39089 --target-tle \"ISS (ZARYA)\" --aperture 0.1\n"
    "  boresight new mine.json --observer-tle eye.tle --target-tle catalogue.tle:44801 "
    "--focal-length "
    "0.9\n"
    "\n"
    "SATELLITE is a catalogue number or a name of the element sets that come with Boresight, a "
    "file "
    "of element sets\n"
    "that holds one satellite, or FILE:NUMBER. Without FILE.json the file is called NAME.json "
    "after "
    "the two.\n"
    "\n"
    "options:\n";

/* Makes the word FILE.json the value of --out. */
static bst_status take_out(bst_ctx *ctx, const bst_option *table, int arguments, char **argv,
                           bst_new_order *w) {
    bool given[32] = {false};
    if (arguments == 0) {
        return BST_OK;
    }
    if (arguments > 1 || w->out) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "one FILE.json is written, %d were named",
                        arguments + (w->out ? 1 : 0));
    }
    w->out = argv[1];
    for (int i = 0; table[i].name; i++) {
        given[i] = table[i].target == (const void *)&w->out;
    }
    return bst_outputs_check(ctx, table, given, 0, NULL);
}

static bst_status check(bst_ctx *ctx, const bst_new_request *q) {
    bst_time start;
    if (q->focal_m > 0.0 && q->pixel_arcsec > 0.0) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "--pixel-scale and --focal-length say the same; give one of them");
    }
    if (q->start && bst_time_from_utc(ctx, q->start, &start) != BST_OK) {
        return bst_fail_prefix(ctx, BST_ERR_ARGUMENT, "--start");
    }
    return BST_OK;
}

#define TEXT_OPTION(name_, target_, path_, argument_, doc_)                          \
    {                                                                                \
        .name = name_, .kind = BST_OPTION_TEXT, .target = &(target_), .path = path_, \
        .argument = argument_, .doc = doc_                                           \
    }
#define REAL_OPTION(name_, target_, argument_, least, most, doc_)                       \
    {                                                                                   \
        .name = name_, .kind = BST_OPTION_REAL, .target = &(target_), .minimum = least, \
        .maximum = most, .argument = argument_, .doc = doc_                             \
    }

int bst_cmd_new(int argc, char **argv) {
    bst_new_order w = {.observer = "39089", .target = "44801", .request = {.aperture_m = 0.15}};
    bst_new_request *q = &w.request;
    bool help = false;
    const bst_option table[] = {
        TEXT_OPTION("out", w.out, BST_PATH_OUTPUT, "FILE", "the same as FILE.json"),
        {.name = "overwrite",
         .kind = BST_OPTION_FLAG,
         .target = &w.overwrite,
         .doc = "replace the file where there is one"},
        TEXT_OPTION("observer-tle", w.observer, BST_PATH_INPUT, "SATELLITE",
                    "who looks (default 39089, NEOSSat)"),
        TEXT_OPTION("target-tle", w.target, BST_PATH_INPUT, "SATELLITE",
                    "at what (default 44801, INMARSAT GX5)"),
        REAL_OPTION("aperture", q->aperture_m, "M", 0.001, 20,
                    "diameter of the telescope in metres (default 0.15)"),
        REAL_OPTION("pixel-scale", q->pixel_arcsec, "ARCSEC", 0.01, 120,
                    "size of a pixel in the sky (default 3 to 10, by the target's rate and the "
                    "known stars)"),
        REAL_OPTION("focal-length", q->focal_m, "M", 0.01, 200,
                    "instead of it: focal length in metres, with pixels of 13 um"),
        REAL_OPTION("period", q->period_s, "S", 0.02, 10,
                    "seconds from frame to frame (default 1 to 0.1 by the target's rate)"),
        REAL_OPTION("duration", q->duration_s, "S", 10, 86400,
                    "simulated time in seconds (default 120, or 60 periods)"),
        TEXT_OPTION("start", q->start, BST_PATH_NONE, "UTC",
                    "look for a time in the two days from then, as 2022-06-16T22:10:00Z"),
        {.name = "help", .kind = BST_OPTION_FLAG, .target = &help, .doc = "print this"},
        {.name = NULL},
    };
    const bst_command_line line = {"new", help_text, table, &help};
    bst_ctx ctx;
    bst_ctx_init(&ctx, bst_cli_log, NULL, BST_LOG_WARNING);
    int arguments = 0, code = BST_EXIT_OK;
    if (!bst_command_line_read(&ctx, &line, argc, argv, &arguments, &code)) {
        return code;
    }
    if (take_out(&ctx, table, arguments, argv, &w) != BST_OK || check(&ctx, q) != BST_OK) {
        return bst_options_misuse(&ctx, "new");
    }
    return bst_command_line_end(&ctx, bst_new_scenario_make(&ctx, &w, table));
}
