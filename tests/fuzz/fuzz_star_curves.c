/* Light curves of variable stars (CSV) of any bytes. What is accepted ascends in time and is found
 * by its identity. */
#include <math.h>
#include <stdlib.h>

#include "sim/catalogue/star_curves.h"
#include "tests/fuzz/input_file.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes) {
    const char *path = fuzz_write_file("curves.csv", data, bytes);
    bst_ctx ctx;
    bst_star_curves curves;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    bst_status status = bst_star_curves_read(&ctx, path, &curves);
    FUZZ_CHECK_REASON(ctx, status);
    for (int i = 0; status == BST_OK && i < curves.count; i++) {
        const bst_star_curve_row *row = &curves.rows[i];
        int count;
        const bst_star_curve_row *first = bst_star_curves_of(&curves, row->source, &count);
        if (!first || count < 2 || row < first || row >= first + count ||
            !(fabs(row->mag) <= 20.0) || (row > first && !(row->time > row[-1].time))) {
            abort();
        }
    }
    bst_star_curves_free(&curves);
    return 0;
}
