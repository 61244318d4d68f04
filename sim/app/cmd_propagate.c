/* boresight propagate: positions and velocities from element sets, by SGP4. */
#include <stdio.h>

#include "sim/app/app.h"
#include "sim/export/propagate_request.h"

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

int bst_cmd_propagate(int argc, char **argv) {
    bst_propagate_request q = BST_PROPAGATE_REQUEST_DEFAULTS;
    bst_option table[BST_OPTIONS_MAX];
    bst_options_bind(bst_propagate_options, &q, table);
    bst_ctx ctx;
    bst_ctx_init(&ctx, bst_cli_log, NULL, BST_LOG_WARNING);
    if (bst_options_parse(&ctx, table, argc, argv, NULL) != BST_OK) {
        return bst_options_misuse(&ctx, "propagate");
    }
    if (q.help) {
        fputs(HELP, stdout);
        bst_options_print(stdout, table);
        fputs(HELP_END, stdout);
        return BST_EXIT_OK;
    }
    if (bst_propagate_request_settle(&ctx, &q) != BST_OK) {
        return bst_options_misuse(&ctx, "propagate");
    }
    bool complete = true;
    if (bst_export_states(&ctx, &q.states, &complete) != BST_OK) {
        fprintf(stderr, "boresight propagate: %s\n", ctx.message);
        return BST_EXIT_FAILED;
    }
    return complete ? BST_EXIT_OK : BST_EXIT_FAILED;
}
