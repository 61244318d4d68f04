#include "scenegen/profile_table.h"

#include <math.h>
#include <stdlib.h>

#include "scenegen/kernels/scene_shared.h"
#include "scenegen/reference.h"

double bst_profile_error(double sigma_px, int phases) {
    return 0.25 / (sigma_px * sigma_px * phases * phases);
}

int bst_profile_phases(double sigma_px, double tolerance_sigma, double full_well_e) {
    int phases = 8;
    while (phases < 2048 &&
           bst_profile_error(sigma_px, phases) * sqrt(full_well_e) > 0.33 * tolerance_sigma) {
        phases *= 2;
    }
    return phases;
}

bst_status bst_profile_table(bst_ctx *ctx, cl_context context, double sigma_px, int taps,
                             int phases, cl_mem *out) {
    size_t rows = (size_t)(BST_WIDTHS + 1) * (size_t)(phases + 1),
           row_floats = (size_t)taps + 2 * BST_PROFILE_PAD;
    size_t bytes = rows * row_floats * sizeof(float);
    float *table = calloc(rows, row_floats * sizeof(float));
    if (!table) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the PSF table");
    }
    for (size_t row = 0; row < rows; row++) {
        size_t width = row / (size_t)(phases + 1), phase = row % (size_t)(phases + 1);
        double share = (double)width / BST_WIDTHS;
        double sigma = sigma_px * sqrt(1.0 + BST_WIDEST * share * share);
        for (int j = 0; j < taps; j++) {
            table[row * row_floats + BST_PROFILE_PAD + (size_t)j] =
                (float)bst_reference_pixel_share((double)phase / phases, sigma, j - (taps / 2 - 1));
        }
    }
    cl_int code;
    *out = clCreateBuffer(context, CL_MEM_READ_ONLY | CL_MEM_COPY_HOST_PTR, bytes, table, &code);
    free(table);
    return bst_device_check(ctx, code, "allocating the PSF table");
}
