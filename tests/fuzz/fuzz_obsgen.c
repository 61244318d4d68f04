/* The reader of the generator's calibration on any bytes. What is accepted is written as something
 * that is read again as the same, and its tables have values everywhere. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "obsgen/calibration.h"
#include "tests/fuzz/input_file.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes);

static void check(bst_ctx *ctx, const bst_obsgen_calibration *c) {
    for (double at = -1.0; at < 400.0; at += 13.0) {
        if (!isfinite(bst_obsgen_between(bst_obsgen_lengths_px, c->gain, BST_OBSGEN_LENGTHS, at)) ||
            !isfinite(bst_obsgen_between(bst_obsgen_snrs, c->across_factor, BST_OBSGEN_SNRS, at))) {
            abort();
        }
    }
    const char *path = fuzz_write_file("again.obsgen", "", 0);
    bst_obsgen_calibration again;
    memset(&again, 0, sizeof again);
    if (bst_obsgen_calibration_write(ctx, path, c) != BST_OK ||
        bst_obsgen_calibration_read(ctx, path, &again) != BST_OK ||
        memcmp(c, &again, sizeof again) != 0) {
        abort();
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes) {
    bst_ctx ctx;
    bst_obsgen_calibration calibration;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    memset(&calibration, 0, sizeof calibration);
    bst_status status = bst_obsgen_calibration_read(
        &ctx, fuzz_write_file("input.obsgen", data, bytes), &calibration);
    FUZZ_CHECK_REASON(ctx, status);
    if (status == BST_OK) {
        check(&ctx, &calibration);
    }
    return 0;
}
