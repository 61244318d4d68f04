#include "sim/app/run_link.h"

#include "sim/app/stop_signals.h"

static bool stop(void *user) {
    (void)user;
    return bst_stop_requested();
}

bst_status bst_run_link_open(bst_ctx *ctx, bst_simulation *simulation) {
    bst_link *link = bst_simulation_link(simulation);
    if (!link) {
        return BST_OK;
    }
    bst_link_on_wait(link, stop, NULL);
    return bst_link_open(ctx, link);
}

void bst_run_link_end(bst_simulation *simulation, bst_status status, const char *message) {
    bst_link *link = bst_simulation_link(simulation);
    if (link) {
        int reason = status == BST_OK ? 0 : status == BST_ERR_INTERRUPTED ? 1 : 2;
        bst_link_set_end(link, reason, status == BST_OK ? "complete" : message);
    }
}
