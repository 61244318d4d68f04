#include "sim/analysis/check/check_run.h"

#include "sim/analysis/check/scenario_rules.h"

bst_status bst_check_run_file(bst_ctx *ctx, const char *path, bst_load_options load,
                              const bst_option *table, const bst_simulation_options *simulation,
                              const bst_run_request *run) {
    bst_json *json = NULL;
    bst_scenario scenario;
    bst_simulation *sim = NULL;
    BST_TRY(bst_load_check(ctx, &load, table));
    BST_TRY(bst_load_scenario(ctx, path, &load, &json, &scenario));
    bst_status status = bst_simulation_create(ctx, &scenario, simulation, &sim);
    if (status == BST_OK) {
        status = bst_check_rules_apply(ctx, &scenario, sim);
    }
    if (status == BST_OK) {
        status = bst_run_scenario(ctx, &scenario, sim, run, NULL);
    }
    bst_simulation_free(sim);
    bst_scenario_free(&scenario);
    bst_json_free(json);
    return status;
}
