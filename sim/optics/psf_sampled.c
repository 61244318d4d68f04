#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/fft.h"
#include "sim/optics/psf_internal.h"

/* maximum side of samples, and of the transform grid */
enum { LONGEST_SAMPLES = 2048, LONGEST_GRID = 4096 };

/* OTF level below which a sampled PSF is cut off: the noise of single-precision samples */
#define CUT 1e-6

typedef struct transform {
    int side;
    double *image;              /* [side][side] */
    bst_fft_complex_f64 *value; /* [side][side / 2 + 1] */
    bst_fft *fft;
} transform;

static void transform_free(transform *t) {
    bst_fft_free(t->fft);
    bst_fft_array_free(t->image);
    bst_fft_array_free(t->value);
}

static bst_status transform_create(bst_ctx *ctx, int longest, transform *t) {
    int side = 64;
    while (side < 4 * longest && side < LONGEST_GRID) {
        side *= 2;
    }
    t->side = side;
    t->image = bst_fft_array((size_t)side * (size_t)side * sizeof *t->image);
    t->value = bst_fft_array((size_t)side * (size_t)(side / 2 + 1) * sizeof *t->value);
    if (!t->image || !t->value) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the transform of a PSF");
    }
    return bst_fft_create_f64(ctx, BST_FFT_REAL_FORWARD, side, side, t->image, *t->value, &t->fft);
}

/* Sum and centroid of PSF samples. */
static bst_status measure(bst_ctx *ctx, const float *p, int width, int height, int plane,
                          double *sum, double centre[2]) {
    double total = 0.0, x = 0.0, y = 0.0;
    for (int j = 0; j < height; j++) {
        for (int i = 0; i < width; i++) {
            double v = (double)p[(size_t)j * (size_t)width + (size_t)i];
            if (!isfinite(v)) {
                return bst_fail(ctx, BST_ERR_CONFIG,
                                "sample (%d, %d) of plane %d of the PSF is not a number", i, j,
                                plane);
            }
            total += v;
            x += v * i;
            y += v * j;
        }
    }
    if (!(total > 0.0)) {
        return bst_fail(ctx, BST_ERR_CONFIG, "plane %d of the PSF has no light (its sum is %g)",
                        plane, total);
    }
    *sum = total;
    centre[0] = x / total;
    centre[1] = y / total;
    return BST_OK;
}

/* OTF at integer multiples of the grid frequency, kx >= 0; ky and kx periodic; shifted so that
 * `centre` is the origin. */
static void at_node(const transform *t, double sum, const double centre[2], int kx, int ky,
                    double out[2]) {
    int n = t->side, x = ((kx % n) + n) % n, y = ((ky % n) + n) % n;
    double conjugate = 1.0;
    if (x > n / 2) {
        x = n - x;
        y = (n - y) % n;
        conjugate = -1.0;
    }
    const double *v = t->value[(size_t)y * (size_t)(n / 2 + 1) + (size_t)x];
    double phase = 2.0 * BST_PI * (kx * centre[0] + ky * centre[1]) / n;
    double c = cos(phase) / sum, s = sin(phase) / sum, im = conjugate * v[1];
    out[0] = v[0] * c - im * s;
    out[1] = v[0] * s + im * c;
}

static bst_status make_plane(bst_ctx *ctx, const transform *t, const bst_psf_samples *samples,
                             int plane, int32_t file_centre, bst_psf_node *node) {
    int w = samples->width, h = samples->height, n = t->side;
    const float *p = samples->samples + (size_t)plane * (size_t)w * (size_t)h;
    double sum = 0.0, centre[2] = {0.0, 0.0};
    BST_TRY(measure(ctx, p, w, h, plane, &sum, centre));
    if (file_centre == BST_PSF_ARRAY) {
        centre[0] = 0.5 * (w - 1);
        centre[1] = 0.5 * (h - 1);
    }
    memset(t->image, 0, (size_t)n * (size_t)n * sizeof *t->image);
    for (int j = 0; j < h; j++) {
        for (int i = 0; i < w; i++) {
            t->image[(size_t)j * (size_t)n + (size_t)i] =
                (double)p[(size_t)j * (size_t)w + (size_t)i];
        }
    }
    bst_fft_run(t->fft);
    double reach2 = 0.0;
    for (int ky = -n / 2; ky < n / 2; ky++) {
        for (int kx = 0; kx <= n / 2; kx++) {
            const double *v = t->value[(size_t)((ky + n) % n) * (size_t)(n / 2 + 1) + (size_t)kx];
            double r2 = (double)kx * kx + (double)ky * ky;
            if (r2 > reach2 && v[0] * v[0] + v[1] * v[1] > CUT * CUT * sum * sum) {
                reach2 = r2;
            }
        }
    }
    int reach = (int)fmin(ceil(sqrt(reach2)), n / 2);
    BST_TRY(bst_optics_grid_otf_create(ctx, samples->oversampling / n, reach, &node->grid));
    for (int ky = -reach - BST_GRID_MARGIN; ky <= reach + BST_GRID_MARGIN; ky++) {
        for (int kx = 0; kx <= reach + BST_GRID_MARGIN; kx++) {
            double v[2];
            at_node(t, sum, centre, kx, ky, v);
            float *to = bst_optics_grid_otf_node(&node->grid, kx, ky);
            to[0] = (float)v[0];
            to[1] = (float)v[1];
        }
    }
    bst_optics_grid_otf_mirror(&node->grid);
    return BST_OK;
}

bst_status bst_psf_make_sampled(bst_ctx *ctx, const bst_camera *camera,
                                const bst_psf_samples *samples, bst_psf *psf) {
    int nodes = bst_psf_node_count(psf);
    if (!samples) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "the PSF of optics/psf_file is needed here: hand its samples over");
    }
    int longest = samples->width > samples->height ? samples->width : samples->height;
    if (samples->width < 1 || samples->height < 1 || longest > LONGEST_SAMPLES ||
        !(samples->oversampling > 0.0)) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "a PSF of %d x %d samples, %g per pixel, cannot be used: sides go up to "
                        "%d, and samples per pixel must be above 0",
                        samples->width, samples->height, samples->oversampling, LONGEST_SAMPLES);
    }
    if (samples->planes != nodes) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "the PSF has %d planes where the field grid has %d nodes: set "
                        "optics/field_columns and optics/field_rows",
                        samples->planes, nodes);
    }
    psf->reach_px = hypot(samples->width, samples->height) / samples->oversampling;
    transform t = {0};
    bst_status status = transform_create(ctx, longest, &t);
    for (int k = 0; k < nodes && status == BST_OK; k++) {
        bst_psf_node *node = &psf->nodes[k];
        status = make_plane(ctx, &t, samples, k, camera->optics.file_centre, node);
        if (status == BST_OK) {
            double side = node->grid.step * node->grid.reach;
            psf->cutoff = fmax(psf->cutoff, side * sqrt(2.0));
        }
    }
    transform_free(&t);
    return status;
}
