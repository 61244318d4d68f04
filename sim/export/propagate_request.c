#include "sim/export/propagate_request.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/astro/tle.h"

const bst_option bst_propagate_options[] = {
    {.name = "elements",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(bst_propagate_request, states.elements),
     .path = BST_PATH_INPUT,
     .argument = "FILE",
     .doc = "element sets: TLE, or OMM as JSON or CSV (required)"},
    {.name = "tle",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(bst_propagate_request, states.elements),
     .path = BST_PATH_INPUT,
     .argument = "FILE",
     .doc = "the same"},
    {.name = "norad",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(bst_propagate_request, norad_text),
     .argument = "N",
     .doc = "only the satellite with this catalogue number, also as Alpha-5"},
    {.name = "start",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(bst_propagate_request, start_text),
     .argument = "UTC",
     .doc = "first time, as 2022-06-16T22:10:00Z",
     .required = true},
    {.name = "stop",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(bst_propagate_request, stop_text),
     .argument = "UTC",
     .doc = "last time",
     .required = true},
    {.name = "step",
     .kind = BST_OPTION_REAL,
     .offset = offsetof(bst_propagate_request, step_s),
     .argument = "S",
     .doc = "seconds between rows, whole microseconds",
     .required = true,
     .minimum = 1e-6,
     .maximum = 1e9},
    {.name = "frame",
     .kind = BST_OPTION_CHOICE,
     .offset = offsetof(bst_propagate_request, states.frame),
     .argument = "teme|gcrf",
     .doc = "default: teme"},
    {.name = "format",
     .kind = BST_OPTION_CHOICE,
     .offset = offsetof(bst_propagate_request, states.format),
     .argument = "csv|oem|czml",
     .doc = "comma-separated (default), CCSDS OEM 2.0, or CZML"},
    {.name = "gravity",
     .kind = BST_OPTION_CHOICE,
     .offset = offsetof(bst_propagate_request, states.gravity),
     .argument = "wgs72|wgs84",
     .doc = "default: wgs72, which element sets are made with"},
    {.name = "opsmode",
     .kind = BST_OPTION_CHOICE,
     .offset = offsetof(bst_propagate_request, states.mode),
     .argument = "i|a",
     .doc = "improved (default), or as the operational code"},
    {.name = "eop",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(bst_propagate_request, states.eop_path),
     .path = BST_PATH_INPUT,
     .argument = "FILE",
     .doc = "Earth orientation, an IERS EOP C04 file, for gcrf"},
    {.name = "output",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(bst_propagate_request, states.output),
     .path = BST_PATH_OUTPUT,
     .argument = "FILE",
     .doc = "write there instead of to the standard output"},
    {.name = "help",
     .kind = BST_OPTION_FLAG,
     .offset = offsetof(bst_propagate_request, help),
     .doc = "this text"},
    {.name = NULL},
};

/* Most rows of a satellite. They are 9 GB of CSV; more is a mistake in --step. */
static const double MOST_ROWS = 1e8;

static bst_status read_time(bst_ctx *ctx, const char *option, const char *text, bst_time *out) {
    bst_status status = bst_time_from_utc(ctx, text, out);
    return status == BST_OK ? status : bst_fail_prefix(ctx, status, "--%s", option);
}

/* Reads a number, or five characters of which the first is a letter (Alpha-5). */
static bst_status read_norad(bst_ctx *ctx, bst_propagate_request *q) {
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
static bst_status read_times(bst_ctx *ctx, bst_propagate_request *q) {
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
    /* half a tick is added because the span is exact to 1e-10 s only */
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

bst_status bst_propagate_request_settle(bst_ctx *ctx, bst_propagate_request *q) {
    bst_export_states_request *states = &q->states;
    if (!states->elements) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "--elements is missing: add --elements FILE");
    }
    bool czml = states->format == BST_EXPORT_STATES_CZML;
    if (czml && states->frame == BST_EXPORT_STATES_TEME) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "--format czml is always in GCRF: leave --frame teme out");
    }
    if (states->frame == BST_PROPAGATE_FRAME_DEFAULT) {
        states->frame = czml ? BST_EXPORT_STATES_GCRF : BST_EXPORT_STATES_TEME;
    }
    if (states->eop_path && states->frame == BST_EXPORT_STATES_TEME) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "--eop has no effect in TEME: add --frame gcrf or leave --eop out");
    }
    BST_TRY(read_norad(ctx, q));
    return read_times(ctx, q);
}
