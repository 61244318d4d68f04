/* boresight check: validates a scenario and prints it with every default. */
#include <stdio.h>
#include <string.h>

#include "sim/analysis/check/check_figures.h"
#include "sim/analysis/check/check_preview.h"
#include "sim/analysis/check/scenario_rules.h"
#include "sim/app/app.h"
#include "sim/cli/command_line.h"
#include "sim/cli/load.h"
#include "sim/cli/print_json.h"
#include "sim/engine/simulation.h"

static const char help_text[] =
    "usage: boresight check SCENARIO.json [options]\n\n"
    "Reads and validates a scenario, opens what it names (orbits, star catalogue), wires "
    "its modules, and\n"
    "prints the scenario with every default written out. Warns of what a scenario hardly "
    "means (--rules\n"
    "lists it). Nothing is written to disk but what --figures names. - in place of the file: the "
    "standard input,\n"
    "whose files are relative to the current folder.\n\n"
    "  boresight check scenarios/neossat_geo_track.json --set "
    "/duration_s=60\n\noptions:\n";

/* Applies the rules, then prints the scenario, or its figures where they are asked for. */
static int report(bst_ctx *ctx, const bst_scenario *scenario, const bst_simulation *sim,
                  const char *figures, bool quiet) {
    ctx->log_level = BST_LOG_WARNING;
    bst_status status = bst_check_rules_apply(ctx, scenario, sim);
    if (status == BST_OK && figures) {
        cJSON *node;
        status = bst_check_figures(ctx, scenario, sim, &node);
        if (status == BST_OK) {
            status = bst_check_preview(ctx, scenario, sim, node);
            if (status != BST_OK) {
                cJSON_Delete(node);
            }
        }
        status = status == BST_OK ? bst_cli_write_json(ctx, figures, node) : status;
        quiet |= strcmp(figures, "-") == 0;
    }
    if (status != BST_OK) {
        fprintf(stderr, "boresight: %s\n", ctx->message);
        return BST_EXIT_FAILED;
    }
    return quiet ? BST_EXIT_OK : bst_cli_print_json(bst_scenario_echo(scenario));
}

int bst_cmd_check(int argc, char **argv) {
    bool help = false, quiet = false, list_rules = false;
    const char *figures = NULL;
    bst_load_options load = BST_LOAD_DEFAULTS;
    const bst_option table[] = {
        BST_LOAD_OPTIONS(load),
        {.name = "rules",
         .kind = BST_OPTION_FLAG,
         .target = &list_rules,
         .doc = "list what check and run warn of, and stop"},
        {.name = "figures",
         .kind = BST_OPTION_TEXT,
         .target = &figures,
         .path = BST_PATH_OUTPUT,
         .argument = "FILE",
         .doc =
             "write limiting magnitudes, SNR of the targets, their fields and day, and disk space "
             "as JSON; - prints "
             "them in place of the scenario"},
        {.name = "quiet",
         .kind = BST_OPTION_FLAG,
         .target = &quiet,
         .doc = "print nothing when the scenario is right"},
        {.name = "help", .kind = BST_OPTION_FLAG, .target = &help, .doc = "print this"},
        {.name = NULL},
    };
    bst_ctx ctx;
    bst_ctx_init(&ctx, bst_cli_log, NULL, BST_LOG_ERROR);
    const bst_command_line line = {"check", help_text, table, &help};
    int arguments = 0, code = BST_EXIT_OK;
    if (!bst_command_line_read(&ctx, &line, argc, argv, &arguments, &code)) {
        return code;
    }
    if (list_rules && (arguments > 0 || figures || quiet || load.set.count > 0 || load.seed ||
                       load.duration_s >= 0.0 || load.run >= 0)) {
        bst_fail(&ctx, BST_ERR_ARGUMENT,
                 "--rules lists the rules and checks no scenario: give it alone");
        return bst_options_misuse(&ctx, "check");
    }
    if (list_rules) {
        bst_check_rules_print(stdout);
        return BST_EXIT_OK;
    }
    if (arguments != 1) {
        bst_fail(&ctx, BST_ERR_ARGUMENT, "one scenario file is expected, %d were given", arguments);
        return bst_options_misuse(&ctx, "check");
    }
    if (bst_load_check(&ctx, &load, table) != BST_OK) {
        return bst_options_misuse(&ctx, "check");
    }
    bst_json *json = NULL;
    bst_scenario scenario;
    if (bst_load_scenario(&ctx, argv[1], &load, &json, &scenario) != BST_OK) {
        fprintf(stderr, "boresight: %s\n", ctx.message);
        return BST_EXIT_FAILED;
    }
    bst_simulation *sim = NULL;
    const bst_simulation_options options = {.never_steps = true};
    if (bst_simulation_create(&ctx, &scenario, &options, &sim) != BST_OK) {
        bst_json_name_file(&ctx, json);
        fprintf(stderr, "boresight: %s\n", ctx.message);
        code = BST_EXIT_FAILED;
    } else {
        code = report(&ctx, &scenario, sim, figures, quiet);
    }
    bst_simulation_free(sim);
    bst_scenario_free(&scenario);
    bst_json_free(json);
    return code;
}
