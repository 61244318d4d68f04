/* The reader of a cluster's site file on any bytes. What is accepted is in its ranges. */
#include <stdlib.h>

#include "sim/studies/slurm.h"
#include "tests/fuzz/input_file.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes) {
    bst_ctx ctx;
    bst_slurm_site site;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    bst_status status = bst_slurm_site_load(&ctx, fuzz_write_file("site.json", data, bytes), &site);
    FUZZ_CHECK_REASON(ctx, status);
    if (status == BST_OK && (site.cpus_per_task < 1 || site.array_size < 1 || site.queue_size < 1 ||
                             site.time_min < 0 || site.memory_mib < 0 || !(site.poll_s > 0.0) ||
                             !(site.grace_s >= 0.0) || !(site.patience_s > 0.0))) {
        abort();
    }
    return 0;
}
