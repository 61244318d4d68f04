/* boresight schema: prints the JSON Schema of scenarios. */
#include <stdio.h>

#include "sim/app/app.h"
#include "sim/cli/command_line.h"
#include "sim/cli/plugins.h"
#include "sim/cli/print_json.h"

static const char help_text[] =
    "usage: boresight schema [SCENARIO.json] [options]\n\n"
    "Prints the JSON Schema (draft 2020-12) of scenarios. Editors check and complete a "
    "scenario that names it:\n\n"
    "  boresight schema > scenarios/boresight.schema.json\n"
    "  {\"$schema\": \"boresight.schema.json\", \"boresight\": 1, ...}\n\n"
    "With SCENARIO.json it knows the keys of the plug-ins which that scenario names.\n\n"
    "options:\n";

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
    const bst_command_line line = {"schema", help_text, table, &help};
    int arguments = 0, code = BST_EXIT_OK;
    if (!bst_command_line_read(&ctx, &line, argc, argv, &arguments, &code)) {
        return code;
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
    code = bst_cli_print_json(bst_scenario_schema(&registry));
    bst_plugins_free(&registry);
    return code;
}
