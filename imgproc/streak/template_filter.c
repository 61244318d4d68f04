#include "imgproc/streak/template_filter.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/fft.h"

/* Least share of the template inside the frame at which a neighbour of a maximum is looked at. */
static const float LEAST_NEIGHBOUR = 0.05f;
/* Position error beside the noise: the template is itself an image of one star. */
static const double SYSTEMATIC_PX = 0.3;

struct bst_template_filter {
    int width, height, columns, rows;
    int side_x, side_y, stride; /* of the transforms; floats per row of `plane` */
    float *values;              /* [rows][columns] */
    float *plane;               /* [side_y][stride] in place of its spectrum */
    float *spectrum;            /* of the template */
    float *inside;              /* [side_y][side_x] energy inside the frame */
    bst_fft *forward, *inverse;
};

/* Next product of 2, 3 and 5. */
static int fast_size(int least) {
    for (int n = least;; n++) {
        int m = n;
        for (int p = 2; p <= 5; p += p == 2 ? 1 : 2) {
            while (m % p == 0) {
                m /= p;
            }
        }
        if (m == 1) {
            return n;
        }
    }
}

static size_t plane_floats(const bst_template_filter *f) {
    return (size_t)f->side_y * (size_t)f->stride;
}

/* Multiplies the plane's spectrum by the conjugate of another and transforms back. */
static void correlate(bst_template_filter *f, const float *spectrum) {
    float scale = 1.0f / ((float)f->side_x * (float)f->side_y);
    for (size_t i = 0; i < plane_floats(f); i += 2) {
        float a = f->plane[i], b = f->plane[i + 1], c = spectrum[i], d = -spectrum[i + 1];
        f->plane[i] = (a * c - b * d) * scale;
        f->plane[i + 1] = (a * d + b * c) * scale;
    }
    bst_fft_run(f->inverse);
}

/* Spectrum of the template or of its square. */
static void transform_template(bst_template_filter *f, bool square) {
    memset(f->plane, 0, plane_floats(f) * sizeof *f->plane);
    for (int y = 0; y < f->rows; y++) {
        for (int x = 0; x < f->columns; x++) {
            float v = f->values[y * f->columns + x];
            f->plane[y * f->stride + x] = square ? v * v : v;
        }
    }
    bst_fft_run(f->forward);
    memcpy(f->spectrum, f->plane, plane_floats(f) * sizeof *f->plane);
}

static void load(bst_template_filter *f, const float *image) {
    memset(f->plane, 0, plane_floats(f) * sizeof *f->plane);
    for (int y = 0; y < f->height; y++) {
        for (int x = 0; x < f->width; x++) {
            f->plane[y * f->stride + x] = image ? image[y * f->width + x] : 1.0f;
        }
    }
    bst_fft_run(f->forward);
}

bst_status bst_template_filter_create(bst_ctx *ctx, int width, int height, const float *values,
                                      int columns, int rows, bst_template_filter **out) {
    *out = NULL;
    bst_template_filter *f = calloc(1, sizeof *f);
    if (!f) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a matched filter");
    }
    *f = (bst_template_filter){.width = width,
                               .height = height,
                               .columns = columns,
                               .rows = rows,
                               .side_x = fast_size(width + columns + 2),
                               .side_y = fast_size(height + rows + 2)};
    f->stride = 2 * (f->side_x / 2 + 1);
    size_t cells = (size_t)columns * (size_t)rows, bytes = plane_floats(f) * sizeof(float);
    f->values = malloc(cells * sizeof *f->values);
    f->plane = bst_fft_array(bytes);
    f->spectrum = bst_fft_array(bytes);
    f->inside = malloc((size_t)f->side_x * (size_t)f->side_y * sizeof *f->inside);
    bst_status status = f->values && f->plane && f->spectrum && f->inside
                            ? bst_fft_create_f32(ctx, BST_FFT_REAL_FORWARD, f->side_y, f->side_x,
                                                 f->plane, f->plane, &f->forward)
                            : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a matched filter");
    if (status == BST_OK) {
        status = bst_fft_create_f32(ctx, BST_FFT_REAL_INVERSE, f->side_y, f->side_x, f->plane,
                                    f->plane, &f->inverse);
    }
    if (status != BST_OK) {
        bst_template_filter_free(f);
        return status;
    }
    memcpy(f->values, values, cells * sizeof *f->values);
    transform_template(f, true);
    load(f, NULL);
    correlate(f, f->spectrum);
    for (int y = 0; y < f->side_y; y++) {
        memcpy(&f->inside[y * f->side_x], &f->plane[y * f->stride],
               (size_t)f->side_x * sizeof *f->inside);
    }
    transform_template(f, false);
    *out = f;
    return BST_OK;
}

void bst_template_filter_free(bst_template_filter *f) {
    if (!f) {
        return;
    }
    bst_fft_free(f->forward);
    bst_fft_free(f->inverse);
    free(f->values);
    bst_fft_array_free(f->plane);
    bst_fft_array_free(f->spectrum);
    free(f->inside);
    free(f);
}

/* SNR at a position, modulo the transform's size; negative: too little is inside. */
static float snr_at(const bst_template_filter *f, int x, int y, float least) {
    x = (x + f->side_x) % f->side_x;
    y = (y + f->side_y) % f->side_y;
    float inside = f->inside[y * f->side_x + x];
    return inside < least ? -1.0f : f->plane[y * f->stride + x] / sqrtf(inside);
}

/* Offset of a parabola's vertex through three values, and its curvature. */
static double vertex(float before, float here, float after, double *curvature) {
    double bend = 2.0 * (double)here - (double)before - (double)after;
    *curvature = fmax(bend, 1e-6);
    double offset = 0.5 * ((double)after - (double)before) / *curvature;
    return fmax(fmin(offset, 0.5), -0.5);
}

bool bst_template_filter_peak(bst_template_filter *f, const float *image, double least_inside,
                              bst_template_peak *out) {
    assert(f && image && out);
    load(f, image);
    correlate(f, f->spectrum);
    float best = 0.0f;
    int bx = 0, by = 0;
    for (int y = 0; y < f->side_y; y++) {
        for (int x = 0; x < f->side_x; x++) {
            float v = snr_at(f, x, y, (float)least_inside);
            if (v > best) {
                best = v;
                bx = x;
                by = y;
            }
        }
    }
    if (!(best > 0.0f)) {
        return false;
    }
    float n[3][3];
    bool whole = true;
    for (int k = 0; k < 9; k++) {
        n[k / 3][k % 3] = snr_at(f, bx + k % 3 - 1, by + k / 3 - 1, LEAST_NEIGHBOUR);
        whole = whole && n[k / 3][k % 3] >= 0.0f && n[k / 3][k % 3] <= best;
    }
    double xx, yy, xy = 0.25 * (double)(n[0][0] + n[2][2] - n[0][2] - n[2][0]);
    double dx = vertex(n[1][0], best, n[1][2], &xx), dy = vertex(n[0][1], best, n[2][1], &yy);
    /* Fisher information of the position: SNR times the curvature of the SNR */
    double a = (double)best * xx, b = (double)best * yy, c = -(double)best * xy;
    double det = fmax(a * b - c * c, 0.05 * a * b), s2 = SYSTEMATIC_PX * SYSTEMATIC_PX;
    *out = (bst_template_peak){
        .x_px = (bx > f->width ? bx - f->side_x : bx) + dx,
        .y_px = (by > f->height ? by - f->side_y : by) + dy,
        .amplitude = (double)best / sqrt((double)f->inside[by * f->side_x + bx]),
        .snr = (double)best,
        .cov_xx = b / det + s2,
        .cov_xy = -c / det,
        .cov_yy = a / det + s2,
        .whole = whole};
    return true;
}

/* Value of the template at a point; 0 outside. */
static double value_at(const bst_template_filter *f, double x, double y) {
    int i = (int)floor(x), j = (int)floor(y);
    double u = x - i, v = y - j, sum = 0.0;
    for (int k = 0; k < 4; k++) {
        int p = i + k % 2, q = j + k / 2;
        if (p >= 0 && q >= 0 && p < f->columns && q < f->rows) {
            sum += (k % 2 ? u : 1.0 - u) * (k / 2 ? v : 1.0 - v) *
                   (double)f->values[q * f->columns + p];
        }
    }
    return sum;
}

void bst_template_filter_subtract(const bst_template_filter *f, float *image,
                                  const bst_template_peak *peak) {
    int x0 = (int)floor(peak->x_px), y0 = (int)floor(peak->y_px);
    for (int y = y0 < 0 ? 0 : y0; y <= y0 + f->rows && y < f->height; y++) {
        for (int x = x0 < 0 ? 0 : x0; x <= x0 + f->columns && x < f->width; x++) {
            image[y * f->width + x] -=
                (float)(peak->amplitude * value_at(f, x - peak->x_px, y - peak->y_px));
        }
    }
}
