/* boresight propagate: positions and velocities from element sets, by SGP4. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/app/app.h"
#include "sim/astro/sgp4.h"
#include "sim/astro/tle.h"
#include "sim/cli/options.h"
#include "sim/export/export_states.h"

static const char HELP[] =
    "boresight propagate: positions and velocities from element sets, by SGP4\n"
    "\n"
    "  boresight propagate --elements FILE --start UTC --stop UTC --step S [options]\n"
    "\n";

static const char HELP_END[] =
    "\n"
    "Rows hold UTC, position in km and velocity in km/s; times run from --start in steps of "
    "--step\n"
    "SI seconds, through leap seconds, up to and with --stop. All satellites of the file come one\n"
    "after another, in the file's order; of several sets of one satellite, the one whose epoch is\n"
    "nearest to --start is taken. GCRF needs the Earth's orientation: a table of 2020 to 2025 is\n"
    "part of the program, another one is read with --eop.\n"
    "\n"
    "Element sets are read as TLE, as three lines each, and as OMM in JSON or CSV; which of them "
    "a\n"
    "file holds is seen from its content. CZML is for Cesium, and always in GCRF.\n"
    "\n"
    "Examples:\n"
    "  boresight propagate --elements scenarios/catalogue_2022-06.tle --norad 39089 \\\n"
    "      --start 2022-06-16T22:10:00Z --stop 2022-06-16T22:15:00Z --step 60 --frame gcrf\n"
    "  boresight propagate --elements scenarios/catalogue_2022-06.tle --format oem --output "
    "all.oem \\\n"
    "      --start 2022-06-16T00:00:00Z --stop 2022-06-17T00:00:00Z --step 300\n"
    "\n"
    "Exit code: 0 done; 1 failed, or SGP4 ended early for a satellite (rows before that are\n"
    "written); 2 wrong usage.\n";

enum { FRAME_DEFAULT = -1 };

/* 9 GB of CSV: more is a slip of --step */
static const double MOST_ROWS = 1e8;

typedef struct propagate_request {
    bst_export_states_request states;
    const char *start_text, *stop_text, *norad_text;
    double step_s;
    bool help;
} propagate_request;

static bst_status read_time(bst_ctx *ctx, const char *option, const char *text, bst_time *out) {
    bst_status status = bst_time_from_utc(ctx, text, out);
    return status == BST_OK ? status : bst_fail_prefix(ctx, status, "--%s", option);
}

/* A number, or five characters of which the first is a letter. */
static bst_status read_norad(bst_ctx *ctx, propagate_request *q) {
    const char *text = q->norad_text;
    if (!text) {
        return BST_OK;
    }
    size_t length = strlen(text), digits = strspn(text, "0123456789");
    bool number = length > 0 && digits == length && length <= 9;
    q->states.norad = number ? (int)strtol(text, NULL, 10) : 0;
    if (length == 5 && digits == 0 && !bst_tle_decode_number(text, &q->states.norad)) {
        q->states.norad = 0;
    }
    return q->states.norad > 0
               ? BST_OK
               : bst_fail(ctx, BST_ERR_ARGUMENT,
                          "--norad %s: give an integer from 1 to %d, or Alpha-5: a letter "
                          "other than I and O and 4 digits",
                          text, BST_NORAD_MAX);
}

/* The grid of times from the texts. */
static bst_status read_times(bst_ctx *ctx, propagate_request *q) {
    bst_time stop;
    BST_TRY(read_time(ctx, "start", q->start_text, &q->states.start));
    BST_TRY(read_time(ctx, "stop", q->stop_text, &stop));
    double span_s = bst_time_diff(stop, q->states.start);
    if (span_s < 0.0) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "--stop %s is before --start %s: exchange them",
                        q->stop_text, q->start_text);
    }
    double ticks = q->step_s * (double)BST_EXPORT_STATES_TICKS_PER_SECOND;
    q->states.step_ticks = llround(ticks);
    if (fabs(ticks - (double)q->states.step_ticks) > 1e-9 * ticks) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "--step %.15g: give whole microseconds", q->step_s);
    }
    /* half a tick of room: the span is exact to 1e-10 s only */
    double steps = floor((span_s * (double)BST_EXPORT_STATES_TICKS_PER_SECOND + 0.5) /
                         (double)q->states.step_ticks);
    if (steps >= MOST_ROWS) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "--step %.15g: from --start to --stop that is %.4g rows of each satellite "
                        "(allowed: %.0f); give a longer step or a shorter time",
                        q->step_s, steps + 1.0, MOST_ROWS);
    }
    q->states.rows = (int64_t)steps + 1;
    char text[40];
    bst_time_to_utc(q->states.start, 9, text, sizeof text);
    bool whole_ms = q->states.step_ticks % 1000 == 0 && strstr(text, "000000Z");
    q->states.time_digits = whole_ms ? 3 : 9;
    return BST_OK;
}

static const bst_option OPTIONS[] = {
    {.name = "elements",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(propagate_request, states.elements),
     .path = BST_PATH_INPUT,
     .argument = "FILE",
     .doc = "element sets: TLE, or OMM as JSON or CSV (required)"},
    {.name = "tle",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(propagate_request, states.elements),
     .path = BST_PATH_INPUT,
     .argument = "FILE",
     .doc = "the same"},
    {.name = "norad",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(propagate_request, norad_text),
     .argument = "N",
     .doc = "only the satellite with this catalogue number, also as Alpha-5"},
    {.name = "start",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(propagate_request, start_text),
     .argument = "UTC",
     .doc = "first time, as 2022-06-16T22:10:00Z",
     .required = true},
    {.name = "stop",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(propagate_request, stop_text),
     .argument = "UTC",
     .doc = "last time",
     .required = true},
    {.name = "step",
     .kind = BST_OPTION_REAL,
     .offset = offsetof(propagate_request, step_s),
     .argument = "S",
     .doc = "seconds between rows, whole microseconds",
     .required = true,
     .minimum = 1e-6,
     .maximum = 1e9},
    {.name = "frame",
     .kind = BST_OPTION_CHOICE,
     .offset = offsetof(propagate_request, states.frame),
     .argument = "teme|gcrf",
     .doc = "default: teme"},
    {.name = "format",
     .kind = BST_OPTION_CHOICE,
     .offset = offsetof(propagate_request, states.format),
     .argument = "csv|oem|czml",
     .doc = "comma-separated (default), CCSDS OEM 2.0, or CZML"},
    {.name = "gravity",
     .kind = BST_OPTION_CHOICE,
     .offset = offsetof(propagate_request, states.gravity),
     .argument = "wgs72|wgs84",
     .doc = "default: wgs72, which element sets are made with"},
    {.name = "opsmode",
     .kind = BST_OPTION_CHOICE,
     .offset = offsetof(propagate_request, states.mode),
     .argument = "i|a",
     .doc = "improved (default), or as the operational code"},
    {.name = "eop",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(propagate_request, states.eop_path),
     .path = BST_PATH_INPUT,
     .argument = "FILE",
     .doc = "Earth orientation, an IERS EOP C04 file, for gcrf"},
    {.name = "output",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(propagate_request, states.output),
     .path = BST_PATH_OUTPUT,
     .argument = "FILE",
     .doc = "write there instead of to the standard output"},
    {.name = "help",
     .kind = BST_OPTION_FLAG,
     .offset = offsetof(propagate_request, help),
     .doc = "this text"},
    {.name = NULL},
};

int bst_cmd_propagate(int argc, char **argv) {
    propagate_request q = {
        .states = {.frame = FRAME_DEFAULT, .gravity = BST_SGP4_WGS72, .mode = BST_SGP4_IMPROVED}};
    bst_option table[sizeof OPTIONS / sizeof *OPTIONS];
    bst_options_bind(OPTIONS, &q, table);
    bst_ctx ctx;
    bst_ctx_init(&ctx, bst_cli_log, NULL, BST_LOG_WARNING);
    if (bst_options_parse(&ctx, table, argc, argv, NULL) != BST_OK) {
        return bst_options_misuse(&ctx, "propagate");
    }
    if (q.help) {
        fputs(HELP, stdout);
        bst_options_print(stdout, table);
        fputs(HELP_END, stdout);
        return 0;
    }
    if (!q.states.elements) {
        (void)bst_fail(&ctx, BST_ERR_ARGUMENT, "--elements is missing: add --elements FILE");
        return bst_options_misuse(&ctx, "propagate");
    }
    if (q.states.format == BST_EXPORT_STATES_CZML && q.states.frame == BST_EXPORT_STATES_TEME) {
        bst_fail(&ctx, BST_ERR_ARGUMENT, "--format czml is always in GCRF: leave --frame teme out");
        return bst_options_misuse(&ctx, "propagate");
    }
    q.states.frame = q.states.frame == FRAME_DEFAULT
                         ? (q.states.format == BST_EXPORT_STATES_CZML ? BST_EXPORT_STATES_GCRF
                                                                      : BST_EXPORT_STATES_TEME)
                         : q.states.frame;
    if (q.states.eop_path && q.states.frame == BST_EXPORT_STATES_TEME) {
        bst_fail(&ctx, BST_ERR_ARGUMENT,
                 "--eop has no effect in TEME: add --frame gcrf or leave "
                 "--eop out");
        return bst_options_misuse(&ctx, "propagate");
    }
    if (read_norad(&ctx, &q) != BST_OK || read_times(&ctx, &q) != BST_OK) {
        return bst_options_misuse(&ctx, "propagate");
    }
    bool complete = true;
    if (bst_export_states(&ctx, &q.states, &complete) != BST_OK) {
        fprintf(stderr, "boresight propagate: %s\n", ctx.message);
        return 1;
    }
    return complete ? 0 : 1;
}
