/* boresight export: frames, tables, orbits and observations of a run in formats that others read.
 */
#include "sim/app/app.h"
#include "sim/cli/command_line.h"
#include "sim/cli/stop_signals.h"
#include "sim/export/export_request.h"
#include "view/page_export.h"

static const char help_text[] =
    "usage: boresight export RUN [what] [options]\n"
    "\n"
    "Writes what a run recorded in formats that other programs read: frames as PNG pictures or a "
    "film, tables as\n"
    "CSV, the true orbits as CCSDS OEM or CZML (with the fields of view), the measured angles as "
    "CCSDS TDM, JSON\n"
    "or CSV, frames\n"
    "with annotations as SatNet has them; or one HTML page that opens without this program. "
    "Interrupted and killed runs are exported as far as they "
    "go. Files appear whole or not at all and replace earlier ones; the "
    "run itself is not\n"
    "changed.\n"
    "\n"
    "  boresight export runs/demo --frames png --annotate --every 10\n"
    "  boresight export runs/demo --frames mp4 --annotate --size 800 --fps 25\n"
    "  boresight export runs/demo --table csv --tables truth,tracks --out csv\n"
    "  boresight export runs/demo --orbits oem --observations tdm\n"
    "  boresight export runs/demo --orbits czml --objects 33278,42741\n"
    "  boresight export runs/demo --satnet training --split 80,10,10\n"
    "  boresight export runs/demo --page demo.html\n"
    "\n"
    "what and options:\n";

/* Writes the page that is asked for. */
static bst_status export_page(bst_ctx *ctx, const bst_export_parts *parts, const char *run) {
    const bst_view_page_request page = {.run = run,
                                        .file = parts->page,
                                        .first = parts->e.first,
                                        .last = parts->e.last,
                                        .every = parts->e.every,
                                        .longest_side = parts->e.longest_side,
                                        .limit_bytes = 1e6 * parts->page_limit_mb};
    if (!parts->page) {
        return BST_OK;
    }
    return bst_app_page
               ? bst_app_page->export_page(ctx, &page)
               : bst_fail(ctx, BST_ERR_ARGUMENT, "--page: only the program boresight has a viewer");
}

int bst_cmd_export(int argc, char **argv) {
    bst_export_request r = BST_EXPORT_REQUEST_DEFAULTS;
    bst_option options[BST_OPTIONS_MAX];
    bst_options_bind(bst_export_options, &r, options);
    bst_ctx ctx;
    bst_ctx_init(&ctx, bst_cli_log, NULL, BST_LOG_WARNING);
    const bst_command_line line = {"export", help_text, options, &r.help};
    int arguments = 0, code = BST_EXIT_OK;
    if (!bst_command_line_read(&ctx, &line, argc, argv, &arguments, &code)) {
        return code;
    }
    if (arguments != 1) {
        bst_fail(&ctx, BST_ERR_ARGUMENT, "one folder of a run is expected, %d were given",
                 arguments);
        return bst_options_misuse(&ctx, "export");
    }
    if (bst_export_request_settle(&ctx, &r) != BST_OK) {
        return bst_options_misuse(&ctx, "export");
    }
    bst_stop_catch_signals();
    bst_run_reader *run = NULL;
    bst_status status = bst_run_reader_open(&ctx, argv[1], &run);
    if (status == BST_OK) {
        r.parts.e.run = run;
        status = bst_export_run(&ctx, &r.parts);
        status = status == BST_OK ? export_page(&ctx, &r.parts, argv[1]) : status;
    }
    bst_run_reader_close(run);
    return bst_command_line_end(&ctx, status);
}
