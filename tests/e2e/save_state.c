/* Saves a simulation through the C API, for `boresight run --restore`.
 *
 *   save_state SCENARIO SECONDS FILE [/pointer=value...]
 */
#include <stdio.h>
#include <stdlib.h>

#include "boresight/boresight.h"

int main(int argc, char **argv) {
    if (argc < 4) {
        fprintf(stderr, "usage: save_state SCENARIO SECONDS FILE [/pointer=value...]\n");
        return 2;
    }
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    bst_model *model = NULL;
    bst_sim *sim = NULL;
    const bst_model_options options = {
        .assignments = (const char *const *)argv + 4, .assignment_count = argc - 4, .threads = 1};
    bst_status status = bst_model_load(&ctx, argv[1], &options, &model);
    if (status == BST_OK) {
        status = bst_sim_create(&ctx, model, NULL, &sim);
    }
    if (status == BST_OK) {
        status = bst_sim_run_until(&ctx, sim, strtod(argv[2], NULL));
    }
    if (status == BST_OK) {
        status = bst_sim_save_file(&ctx, sim, argv[3]);
    }
    if (status != BST_OK) {
        fprintf(stderr, "save_state: %s\n", ctx.message);
    }
    bst_sim_free(sim);
    bst_model_free(model);
    return status == BST_OK ? 0 : 1;
}
