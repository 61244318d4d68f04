/* The reader of curves (spectral responses, light curves, stray light) on any bytes. What is
 * accepted ascends, is in its range, and has a value everywhere. */
#include <math.h>
#include <stdlib.h>

#include "sim/astro/curve_file.h"
#include "tests/fuzz/input_file.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes);

static void check(const bst_curve *curve, const bst_curve_format *f) {
    for (int i = 0; i < curve->count; i++) {
        double x = curve->x[i], y = curve->y[i];
        if (!(x >= f->x_min && x <= f->x_max && y >= f->y_min && y <= f->y_max) ||
            (i > 0 && !(x > curve->x[i - 1]))) {
            abort();
        }
    }
    /* the ends, what is beyond, and inside; 1e-6: the rounding of a line between two values */
    double low = curve->x[0], high = curve->x[curve->count - 1];
    double margin = 1e-6 * (f->y_max - f->y_min);
    for (int i = -1; i <= 5; i++) {
        double y = bst_curve_at(curve, low + 0.25 * i * (high - low));
        if (!(y >= f->y_min - margin && y <= f->y_max + margin)) {
            abort();
        }
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes) {
    static const char *const x_names[] = {"wavelength_um", "time_s", "angle_deg", NULL};
    static const char *const y_names[] = {"response", "magnitude", "pst", NULL};
    static const bst_curve_format formats[] = {{"a curve", x_names, y_names, -1e9, 1e9, -40.0, 1e6},
                                               {"a curve", x_names, y_names, 0.1, 20.0, 0.0, 1.0}};
    const char *path = fuzz_write_file("input.csv", data, bytes);
    for (int i = 0; i < 2; i++) {
        bst_ctx ctx;
        bst_curve curve;
        bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
        bst_status status = bst_curve_load(&ctx, path, &formats[i], &curve);
        FUZZ_CHECK_REASON(ctx, status);
        if (status == BST_OK && curve.count < 1) {
            abort();
        }
        if (status == BST_OK) {
            check(&curve, &formats[i]);
        }
        bst_curve_free(&curve);
    }
    return 0;
}
