/* boresight pd: probability of detection, false alarms and errors of location over SNR. */
#include "sim/analysis/pd/pd_measurement.h"
#include "sim/app/app.h"
#include "sim/cli/command_line.h"
#include "sim/cli/stop_signals.h"
#include "sim/io/plot.h"

static const char help_text[] =
    "usage: boresight pd SCENARIO.json [options]\n\n"
    "Measures the detector of a scenario against theory. Frames of the scenario's camera are\n"
    "filled with targets at random places, kept apart, of all SNRs in turn; its image\n"
    "processing finds what it finds. Printed for each SNR: probability of detection with its\n"
    "95 % interval and the ideal one, Q(Q^-1(Pfa) - SNR), at the false alarms per frame that\n"
    "were measured without targets; errors of place and flux over the Cramer-Rao bound. The\n"
    "loss is 20 log10 of the SNR needed over the ideal one, at Pd 0.5 and 0.9.\n\n"
    "With --pair, a fifth of the targets are pairs of sources in random directions. Printed for\n"
    "each SNR of both: the separation at which they are found as two with probability 0.9, with\n"
    "its standard deviation; the bound of a test that knows separation, direction and ratio, and\n"
    "of one that estimates them, at the stated share of false splits; the share of single\n"
    "sources that are found as two, with its 95 % interval.\n\n"
    "SNR is sqrt(sum s^2) over the noise of a pixel without the source's own light. A\n"
    "detection counts within one FWHM of the true place; along a streak within its half\n"
    "length.\n\n"
    "  boresight pd scenarios/neossat_geo_stare.json --snr 3:9:0.5 --trials 2000 --plot "
    "pd.png\n"
    "  boresight pd scenarios/neossat_geo_stare.json --streak 20 --known-rate --json "
    "pd.json\n"
    "  boresight pd scenarios/neossat_geo_stare.json --pair --false-splits 0.01 --streak 20 --plot "
    "pair.png\n\n"
    "options:\n";

int bst_cmd_pd(int argc, char **argv) {
    bst_pd_request r = BST_PD_REQUEST_DEFAULTS;
    bst_option table[BST_OPTIONS_MAX];
    bst_options_bind(bst_pd_option_table, &r, table);
    bst_ctx ctx;
    bst_ctx_init(&ctx, bst_cli_log, NULL, BST_LOG_WARNING);
    const bst_command_line line = {"pd", help_text, table, &r.help};
    int arguments = 0, code = BST_EXIT_OK;
    if (!bst_command_line_read(&ctx, &line, argc, argv, &arguments, &code)) {
        return code;
    }
    if (bst_plot_check_path(&ctx, r.plot) != BST_OK) {
        return bst_options_misuse(&ctx, "pd");
    }
    if (arguments != 1) {
        bst_fail(&ctx, BST_ERR_ARGUMENT, "one scenario file is expected, %d were given", arguments);
        return bst_options_misuse(&ctx, "pd");
    }
    if (bst_pd_request_settle(&ctx, &r, table) != BST_OK) {
        return bst_options_misuse(&ctx, "pd");
    }
    bst_stop_catch_signals();
    bst_json *json = NULL;
    bst_scenario scenario;
    bst_status status = bst_load_scenario(&ctx, argv[1], &r.load, &json, &scenario);
    if (status == BST_OK) {
        status = bst_pd_measure(&ctx, &r, &scenario);
        bst_scenario_free(&scenario);
        bst_json_free(json);
    }
    return bst_command_line_end(&ctx, status);
}
