#include <stdio.h>
#include <stdlib.h>

#include <cjson/cJSON.h>

#include "sim/analysis/check/scenario_rules.h"
#include "sim/app/app.h"
#include "sim/cli/load.h"
#include "sim/cli/plugins.h"
#include "sim/engine/simulation.h"

static int print_json(cJSON *node) {
    char *text = node ? cJSON_Print(node) : NULL;
    cJSON_Delete(node);
    if (!text) {
        fprintf(stderr, "boresight: out of memory\n");
        return BST_EXIT_FAILED;
    }
    int written = printf("%s\n", text);
    free(text);
    if (written < 0 || fflush(stdout) != 0) {
        fprintf(stderr, "boresight: the output cannot be written\n");
        return BST_EXIT_FAILED;
    }
    return BST_EXIT_OK;
}

int bst_cmd_check(int argc, char **argv) {
    bool help = false, quiet = false, list_rules = false;
    bst_load_options load = BST_LOAD_DEFAULTS;
    const bst_option table[] = {
        BST_LOAD_OPTIONS(load),
        {.name = "rules",
         .kind = BST_OPTION_FLAG,
         .target = &list_rules,
         .doc = "list what check and run warn of, and stop"},
        {.name = "quiet",
         .kind = BST_OPTION_FLAG,
         .target = &quiet,
         .doc = "print nothing when the scenario is right"},
        {.name = "help", .kind = BST_OPTION_FLAG, .target = &help, .doc = "print this"},
        {.name = NULL},
    };
    bst_ctx ctx;
    bst_ctx_init(&ctx, bst_cli_log, NULL, BST_LOG_ERROR);
    int arguments = 0;
    if (bst_options_parse(&ctx, table, argc, argv, &arguments) != BST_OK) {
        return bst_options_misuse(&ctx, "check");
    }
    if (help) {
        printf(
            "usage: boresight check SCENARIO.json [options]\n\n"
            "Reads and validates a scenario, opens what it names (orbits, star catalogue), wires "
            "its modules, and\n"
            "prints the scenario with every default written out. Warns of what a scenario hardly "
            "means (--rules\n"
            "lists it). Nothing is written to disk.\n\n"
            "  boresight check scenarios/neossat_geo_track.json --set "
            "/duration_s=60\n\noptions:\n");
        bst_options_print(stdout, table);
        return BST_EXIT_OK;
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
    const bst_simulation_options options = {0};
    int code = BST_EXIT_OK;
    if (bst_simulation_create(&ctx, &scenario, &options, &sim) != BST_OK) {
        bst_json_name_file(&ctx, json);
        fprintf(stderr, "boresight: %s\n", ctx.message);
        code = BST_EXIT_FAILED;
    } else {
        ctx.log_level = BST_LOG_WARNING;
        if (bst_check_rules_apply(&ctx, &scenario, sim) != BST_OK) {
            fprintf(stderr, "boresight: %s\n", ctx.message);
            code = BST_EXIT_FAILED;
        } else {
            code = quiet ? BST_EXIT_OK : print_json(bst_scenario_echo(&scenario));
        }
    }
    bst_simulation_free(sim);
    bst_scenario_free(&scenario);
    bst_json_free(json);
    return code;
}

int bst_cmd_schema(int argc, char **argv) {
    bool help = false;
    bst_option_list plugins = {0};
    const bst_option table[] = {
        {.name = "plugin",
         .kind = BST_OPTION_LIST,
         .target = &plugins,
         .path = BST_PATH_INPUT,
         .argument = "FILE",
         .doc = "with the keys of this shared library's modules and stages; may be given several "
                "times"},
        {.name = "help", .kind = BST_OPTION_FLAG, .target = &help, .doc = "print this"},
        {.name = NULL},
    };
    bst_ctx ctx = {0};
    int arguments = 0;
    if (bst_options_parse(&ctx, table, argc, argv, &arguments) != BST_OK) {
        return bst_options_misuse(&ctx, "schema");
    }
    if (help) {
        printf(
            "usage: boresight schema [SCENARIO.json] [options]\n\n"
            "Prints the JSON Schema (draft 2020-12) of scenarios. Editors check and complete a "
            "scenario that names it:\n\n"
            "  boresight schema > scenarios/boresight.schema.json\n"
            "  {\"$schema\": \"boresight.schema.json\", \"boresight\": 1, ...}\n\n"
            "With SCENARIO.json it knows the keys of the plug-ins which that scenario names.\n\n"
            "options:\n");
        bst_options_print(stdout, table);
        return BST_EXIT_OK;
    }
    if (arguments > 1) {
        bst_fail(&ctx, BST_ERR_ARGUMENT, "one scenario file at most is expected, %d were given",
                 arguments);
        return bst_options_misuse(&ctx, "schema");
    }
    bst_status status = BST_OK;
    for (int i = 0; i < plugins.count && status == BST_OK; i++) {
        status = bst_plugins_add(&ctx, plugins.items[i]);
    }
    bst_scenario_registry registry;
    if (status == BST_OK) {
        status = bst_plugins_registry(&ctx, &registry);
    }
    if (status != BST_OK) {
        fprintf(stderr, "boresight: %s\n", ctx.message);
        return BST_EXIT_FAILED;
    }
    if (arguments == 1 && bst_plugins_of_scenario(&ctx, argv[1], &registry) != BST_OK) {
        fprintf(stderr, "boresight: %s\n", ctx.message);
        bst_plugins_free(&registry);
        return BST_EXIT_FAILED;
    }
    int code = print_json(bst_scenario_schema(&registry));
    bst_plugins_free(&registry);
    return code;
}
