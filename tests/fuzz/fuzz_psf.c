/* The readers of point spread functions (FITS) on any bytes. What is accepted has a width, and
 * makes a PSF to render with or says why not. */
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

#include "sim/io/psf_fits.h"
#include "tests/fuzz/input_file.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes);

enum { MOST_SAMPLES = 1 << 14 }; /* to render with: more would take a second and more */

/* Checks whether a PSF of this input is to be prepared for rendering. With sanitizers that takes
 * 40 ms, a hundred times as long as to read it, and hardly depends on the bytes: the fuzzer
 * prepares one input of 128, by FNV-1a of its bytes, the replay of the corpus all. */
static bool is_prepared(const uint8_t *data, size_t bytes) {
#ifdef FUZZ_SAMPLES_SLOW_STEPS
    uint32_t hash = 2166136261U;
    for (size_t i = 0; i < bytes; i++) {
        hash = (hash ^ data[i]) * 16777619U;
    }
    return (hash >> 16) % 128 == 0;
#else
    (void)data;
    (void)bytes;
    return true;
#endif
}

static void prepare(const bst_psf_samples *samples) {
    const bst_camera camera = {
        .width_px = 32, .height_px = 32, .psf_fwhm_px = 2.0, .optics = {.psf = BST_PSF_FILE}};
    const bst_psf_inputs inputs = {.samples = samples};
    bst_ctx ctx;
    bst_psf *psf = NULL;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    bst_status status = bst_psf_create_from(&ctx, &camera, &inputs, &psf);
    FUZZ_CHECK_REASON(ctx, status);
    if (status == BST_OK) {
        if (!(bst_psf_equivalent_fwhm_px(psf, 15.5, 15.5) > 0.0)) {
            abort();
        }
        bst_psf_free(psf);
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes) {
    const char *path = fuzz_write_file("psf.fits", data, bytes);
    const bool is_chosen = is_prepared(data, bytes);
    for (int i = 0; i < 2; i++) {
        double oversampling = i == 0 ? 0.0 : 2.0;
        bst_ctx ctx;
        bst_psf_summary summary;
        bst_psf_samples samples;
        bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
        bst_status status = bst_psf_fits_read(&ctx, path, oversampling, &summary);
        FUZZ_CHECK_REASON(ctx, status);
        if (status == BST_OK && (!(summary.fwhm_px > 0.0) || !isfinite(summary.fwhm_px) ||
                                 summary.width < 1 || summary.height < 1)) {
            abort();
        }
        bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
        status = bst_psf_fits_samples(&ctx, path, oversampling, &samples);
        FUZZ_CHECK_REASON(ctx, status);
        if (status == BST_OK && is_chosen && samples.width <= 64 && samples.height <= 64 &&
            samples.width * samples.height * samples.planes <= MOST_SAMPLES) {
            samples.planes = 1; /* as a sensor without a field grid takes it */
            prepare(&samples);
        }
        free((float *)(uintptr_t)samples.samples);
    }
    return 0;
}
