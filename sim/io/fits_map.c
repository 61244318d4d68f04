/* Writes maps and PSFs as FITS files. */
#include <assert.h>
#include <fitsio.h>
#include <string.h>

#include "sim/io/fits_image.h"
#include "sim/io/fits_internal.h"
#include "sim/io/manifest.h"
#include "sim/io/psf_fits.h"

/* An image or a cube. */
typedef struct planes {
    int width, height, count;
    const float *pixels;
    const char *unit;    /* NULL: no BUNIT */
    double oversampling; /* 0: no OVERSAMP */
} planes;

/* Makes the file in memory; false: see *code. */
static bool make(bst_fits_memory *memory, const planes *p, int *code) {
    long size[3] = {p->width, p->height, p->count};
    bst_fits_memory_open(memory, false, code);
    fits_create_img(memory->file, FLOAT_IMG, p->count > 1 ? 3 : 2, size, code);
    if (p->unit) {
        fits_update_key_str(memory->file, "BUNIT", p->unit, "unit of the pixels", code);
    }
    if (p->oversampling > 0.0) {
        fits_update_key_dbl(memory->file, "OVERSAMP", p->oversampling, 10,
                            "samples per detector pixel and axis", code);
    }
    /* cfitsio's declaration lacks const */
    fits_write_img(memory->file, TFLOAT, 1, (LONGLONG)p->width * p->height * p->count,
                   (float *)(uintptr_t)p->pixels, code);
    return *code == 0;
}

static bst_status write_planes(bst_ctx *ctx, const char *path, const planes *p) {
    bst_fits_memory memory = {0};
    char *bytes = NULL;
    long long count = 0;
    int code = 0;
    bst_status status;
    if (make(&memory, p, &code)) {
        bst_fits_memory_hdu(&memory, &bytes, &count, &code);
    }
    if (code != 0) {
        char reason[FLEN_STATUS];
        fits_get_errstatus(code, reason);
        status = bst_fail(ctx, BST_ERR_IO, "%.400s: cannot be made: %s", path, reason);
    } else {
        status = bst_io_write_file_atomic(ctx, path, bytes, (size_t)count);
    }
    bst_fits_memory_close(&memory, &code);
    bst_fits_memory_free(&memory);
    return status;
}

bst_status bst_fits_write_map(bst_ctx *ctx, const char *path, int width, int height,
                              const float *pixels, const char *unit) {
    assert(path && width > 0 && height > 0 && pixels && unit && strlen(unit) <= 60);
    const planes p = {.width = width, .height = height, .count = 1, .pixels = pixels, .unit = unit};
    return write_planes(ctx, path, &p);
}

bst_status bst_psf_fits_write(bst_ctx *ctx, const char *path, const bst_psf_samples *psf) {
    assert(path && psf && psf->samples && psf->width > 0 && psf->height > 0 && psf->planes > 0);
    const planes p = {.width = psf->width,
                      .height = psf->height,
                      .count = psf->planes,
                      .pixels = psf->samples,
                      .oversampling = psf->oversampling};
    return write_planes(ctx, path, &p);
}
