#include "sim/run/run_link.h"

#include <stdio.h>

#include "sim/cli/stop_signals.h"

static bool stop(void *user) {
    (void)user;
    return bst_stop_requested();
}

/* Binds the address of the link; stop signals end its waits. */
static bst_status link_open(bst_ctx *ctx, bst_simulation *simulation) {
    bst_link *link = bst_simulation_link(simulation);
    if (!link) {
        return BST_OK;
    }
    bst_link_on_wait(link, stop, NULL);
    return bst_link_open(ctx, link);
}

/* Checks that the options --link and --link-keys have an effect. */
static bst_status link_check(bst_ctx *ctx, const bst_load_options *load,
                             const bst_scenario *scenario, bst_simulation *simulation) {
    if ((!load->link && !load->link_keys) || bst_simulation_link(simulation)) {
        return BST_OK;
    }
    const char *option = load->link ? "link" : "link-keys";
    return bst_fail(ctx, BST_ERR_ARGUMENT,
                    "--%s: no module of %s is of type \"external\", so that no peer would be "
                    "waited for: add --external MODULE,... or leave --%s out",
                    option, scenario->file, option);
}

static const char tape[] = "link.packets";

/* Takes the recorded answers of the run in a folder. */
static bst_status link_replay(bst_ctx *ctx, bst_simulation *simulation, const char *folder) {
    bst_link *link = bst_simulation_link(simulation);
    char path[600];
    if (!link) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "--replay: no module of the scenario is of type \"external\"; what has no "
                        "peer is repeated by running it");
    }
    snprintf(path, sizeof path, "%.500s/%s", folder, tape);
    return bst_link_replay(ctx, link, path);
}

bst_status bst_run_link_prepare(bst_ctx *ctx, const bst_load_options *load,
                                const bst_scenario *scenario, bst_simulation *simulation,
                                const char *folder) {
    BST_TRY(link_check(ctx, load, scenario, simulation));
    return folder ? link_replay(ctx, simulation, folder) : link_open(ctx, simulation);
}

bst_status bst_run_link_record(bst_ctx *ctx, bst_simulation *simulation, const char *folder) {
    bst_link *link = bst_simulation_link(simulation);
    char path[600];
    snprintf(path, sizeof path, "%.500s/%s", folder, tape);
    return link && !bst_link_replays(link) ? bst_link_record(ctx, link, path) : BST_OK;
}

bst_status bst_run_link_recorded(bst_ctx *ctx, bst_simulation *simulation) {
    bst_link *link = bst_simulation_link(simulation);
    return link ? bst_link_record_end(ctx, link) : BST_OK;
}

void bst_run_link_end(bst_simulation *simulation, bst_status status, const char *message) {
    bst_link *link = bst_simulation_link(simulation);
    if (link) {
        int reason = status == BST_OK ? 0 : status == BST_ERR_INTERRUPTED ? 1 : 2;
        bst_link_set_end(link, reason, status == BST_OK ? "complete" : message);
    }
}
