/* Measured surfaces (tables of a BRDF) of any bytes. What is accepted gives finite values. */
#include <math.h>
#include <stdlib.h>

#include "sim/satellite/brdf.h"
#include "tests/fuzz/input_file.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes) {
    const char *path = fuzz_write_file("brdf.csv", data, bytes);
    bst_ctx ctx;
    bst_brdf_table *table;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    bst_status status = bst_brdf_table_load(&ctx, path, &table);
    FUZZ_CHECK_REASON(ctx, status);
    for (int i = 0; status == BST_OK && i <= 4; i++) {
        for (int k = -4; k <= 4; k++) {
            double v = bst_brdf_table_value(table, 0.25 * i, 0.25 * k);
            if (!(v >= 0.0 && isfinite(v))) {
                abort();
            }
        }
    }
    bst_brdf_table_free(table);
    return 0;
}
