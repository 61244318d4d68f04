/* The reader of tables of places of ghosts on any bytes. What is accepted is a grid that ascends,
 * with a finite place and an intensity of 0 or more everywhere. */
#include <math.h>
#include <stdlib.h>

#include "sim/optics/ghost_map.h"
#include "tests/fuzz/input_file.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes) {
    const char *path = fuzz_write_file("input.csv", data, bytes);
    bst_ctx ctx;
    bst_ghost_map m;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    bst_status status = bst_ghost_map_load(&ctx, path, "", &m);
    FUZZ_CHECK_REASON(ctx, status);
    if (status != BST_OK) {
        return 0;
    }
    if (m.columns < 2 || m.rows < 2) {
        abort();
    }
    for (int i = 1; i < m.columns; i++) {
        if (!(m.source_x[i] > m.source_x[i - 1])) {
            abort();
        }
    }
    for (int i = -1; i <= 5; i++) {
        double x = m.source_x[0] + 0.25 * i * (m.source_x[m.columns - 1] - m.source_x[0]);
        double y = m.source_y[0] + 0.25 * i * (m.source_y[m.rows - 1] - m.source_y[0]), to[2];
        bst_ghost_map_place(&m, x, y, to);
        if (!isfinite(to[0]) || !isfinite(to[1]) || !(bst_ghost_map_intensity(&m, x, y) >= 0.0)) {
            abort();
        }
    }
    bst_ghost_map_free(&m);
    return 0;
}
