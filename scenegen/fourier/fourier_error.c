#include "scenegen/fourier/fourier_error.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/fft.h"

/* LATTICE: frequencies per axis over the PSF's band. SIDE: image samples, four per period of the
 * highest frequency. */
enum { LATTICE = 96, SIDE = 192 };

/* Images: whole OTF, first aliases along x and y, frequencies beyond the cut-off, what the widening
 * kernel differs by. */
enum { WHOLE, ALIAS_X, ALIAS_Y, LOST, WIDENED, IMAGES };

typedef struct lattice {
    const bst_psf *psf;
    double step, cutoff, alias[2][LATTICE];
    double read[LATTICE];                       /* means over the side of a read-out pixel */
    double wide[2][LATTICE], ideal[2][LATTICE]; /* widening kernel, and the Gaussian that it fits */
    bst_fft_complex_f64 *room;                  /* [SIDE][SIDE] */
    bst_fft *inverse;
    double *image; /* [IMAGES][SIDE][SIDE] */
} lattice;

static double frequency(const lattice *l, int i) {
    return (i - LATTICE / 2) * l->step;
}

/* Rounding of the kernel's float values, relative to its transform at 0. */
#define ROUNDED 0x1p-24

/* Ratio of the first alias to the kernel's transform at the lattice frequencies of an axis, with
 * its sign, which changes beyond the transform's main lobe. A point between samples only changes
 * the phase. */
static void find_aliases(lattice *l, const bst_fourier_axis *axis, int a) {
    double density = (double)axis->samples / axis->pixels;
    double whole = bst_nufft_kernel_transform(&axis->spread, 0.0);
    for (int i = 0; i < LATTICE; i++) {
        double nu = frequency(l, i) / density;
        double own = fabs(bst_nufft_kernel_transform(&axis->spread, nu));
        double next = bst_nufft_kernel_transform(&axis->spread, nu + 1.0);
        /* beyond the grid's band everything is lost */
        l->alias[a][i] =
            fabs(nu) >= 0.5 ? 1.0 : copysign(fmin((fabs(next) + ROUNDED * whole) / own, 1.0), next);
    }
}

/* Transforms of the widening kernel at the lattice frequencies of an axis, for a variance in px^2.
 */
static void find_widening(lattice *l, const bst_fourier_axis *axis,
                          const bst_nufft_kernel_band *band, double variance, int a) {
    double density = (double)axis->samples / axis->pixels;
    bst_nufft_kernel_shape shape;
    (void)bst_nufft_kernel_widen(&axis->spread, band, density, variance * density * density,
                                 &shape);
    for (int i = 0; i < LATTICE; i++) {
        double f = frequency(l, i), nu = f / density;
        bool inside = fabs(nu) < 0.5; /* beyond the grid's band everything is lost */
        l->ideal[a][i] = exp(-2.0 * BST_PI * BST_PI * variance * f * f);
        l->wide[a][i] =
            inside ? bst_nufft_kernel_shape_transform(&axis->spread, &shape, nu) : l->ideal[a][i];
    }
}

static void find_read_means(lattice *l, int binning) {
    for (int i = 0; i < LATTICE; i++) {
        l->read[i] = bst_psf_binned(frequency(l, i), binning);
    }
}

/* Renders one of the images of a field node by FFT. */
static void make_image(lattice *l, int node, int what) {
    double area = l->step * l->step, *image = l->image + what * SIDE * SIDE;
    memset(l->room, 0, sizeof *l->room * SIDE * SIDE);
    for (int j = 0; j < LATTICE; j++) {
        for (int i = 0; i < LATTICE; i++) {
            double v[2], fx = frequency(l, i), fy = frequency(l, j);
            double f = area * l->read[i] * l->read[j];
            bool kept = hypot(fx, fy) <= l->cutoff;
            if (what != WHOLE && kept != (what != LOST)) {
                continue;
            }
            f *= what == ALIAS_X   ? l->alias[0][i]
                 : what == ALIAS_Y ? l->alias[1][j]
                 : what == WIDENED ? l->wide[0][i] * l->wide[1][j] - l->ideal[0][i] * l->ideal[1][j]
                                   : 1.0;
            bst_psf_otf(l->psf, node, fx, fy, v);
            double *z =
                l->room[((j - LATTICE / 2 + SIDE) % SIDE) * SIDE + (i - LATTICE / 2 + SIDE) % SIDE];
            z[0] = v[0] * f;
            z[1] = v[1] * f;
        }
    }
    bst_fft_run(l->inverse);
    for (int i = 0; i < SIDE * SIDE; i++) {
        image[i] = what == WHOLE ? l->room[i][0] : hypot(l->room[i][0], l->room[i][1]);
    }
}

/* Safety factor: faint pixels in a bright star's column had up to 1.7 times this error
 * (tests/scenegen/test_tolerance_sweep.c, scene 171). */
#define SAFE 1.7

static double brightest_of(const lattice *l) {
    double top = 0.0;
    for (int i = 0; i < SIDE * SIDE; i++) {
        top = fmax(top, l->image[i]);
    }
    return top;
}

/* Raises the errors of the brightness classes to those of a field node.
 *
 * Given:     peak  of the PSF in a pixel of the sensor */
static void add_node_errors(lattice *l, int node, int binning, double peak,
                            bst_fourier_error *out) {
    if (binning > 1) { /* peak of a read-out pixel, as a mean */
        find_read_means(l, 1);
        make_image(l, node, WHOLE);
        peak /= brightest_of(l);
        find_read_means(l, binning);
    }
    for (int what = 0; what < IMAGES; what++) {
        make_image(l, node, what);
    }
    double top = brightest_of(l);
    peak *= binning > 1 ? top : 1.0;
    for (int i = 0; i < SIDE * SIDE; i++) {
        int k = bst_light_class(l->image[i] / top);
        const double *at = l->image + i;
        /* aliases of orders 1 and -1 are complex conjugates */
        double error = SAFE * 2.0 * (at[ALIAS_X * SIDE * SIDE] + at[ALIAS_Y * SIDE * SIDE]) +
                       at[LOST * SIDE * SIDE];
        out->most[k] = fmax(out->most[k], error / peak);
        double widened = at[WIDENED * SIDE * SIDE] / peak;
        out->widened[k] = fmax(out->widened[k], widened);
        int x = abs((i + SIDE / 2) % SIDE - SIDE / 2),
            y = abs((i / SIDE + SIDE / 2) % SIDE - SIDE / 2);
        double steps = (x > y ? x : y) / (SIDE * l->step * BST_FAR_STEP_PX);
        int n = steps < BST_FAR_STEPS - 1 ? (int)steps : BST_FAR_STEPS - 1;
        out->far[n] = fmax(out->far[n], error / peak);
        out->far_widened[n] = fmax(out->far_widened[n], widened);
    }
    /* at least as far; nothing is known beyond the images */
    double known = 0.5 / (l->step * BST_FAR_STEP_PX);
    for (int n = BST_FAR_STEPS - 2; n >= 0; n--) {
        out->far[n] = fmax(out->far[n], out->far[n + 1]);
        out->far_widened[n] = fmax(out->far_widened[n], out->far_widened[n + 1]);
    }
    for (int n = (int)known; n < BST_FAR_STEPS; n++) {
        out->far[n] = out->far[(int)known - 1];
        out->far_widened[n] = out->far_widened[(int)known - 1];
    }
}

bst_status bst_fourier_error_measure(bst_ctx *ctx, const bst_psf *psf, const bst_fourier_band *band,
                                     const bst_fourier_axis axis[2], int binning, double widest_px2,
                                     bst_fourier_error *out) {
    assert(psf && band && axis && binning > 0 && widest_px2 >= 0.0 && out);
    lattice l = {.psf = psf,
                 .step = 2.0 * fmax(bst_psf_cutoff(psf), band->cutoff) / LATTICE,
                 .cutoff = band->cutoff,
                 .room = bst_fft_array(sizeof *l.room * SIDE * SIDE),
                 .image = malloc(sizeof *l.image * IMAGES * SIDE * SIDE)};
    *out = (bst_fourier_error){.widest_px2 = widest_px2};
    bst_status status =
        l.room && l.image
            ? bst_fft_create_f64(ctx, BST_FFT_INVERSE, SIDE, SIDE, *l.room, *l.room, &l.inverse)
            : bst_fail(ctx, BST_ERR_MEMORY, "no memory for the error of a grid");
    if (status == BST_OK) {
        for (int a = 0; a < 2; a++) {
            find_aliases(&l, &axis[a], a);
            find_widening(&l, &axis[a], &band->axis[a], widest_px2, a);
        }
        find_read_means(&l, binning);
        for (int n = 0; n < bst_psf_nodes(psf); n++) {
            add_node_errors(&l, n, binning, band->peak, out);
        }
    }
    bst_fft_free(l.inverse);
    bst_fft_array_free(l.room);
    free(l.image);
    return status;
}

double bst_fourier_error_sigma(const bst_fourier_error *error, const bst_fourier_point *point) {
    double worst = 0.0, light_e = point->peak_e;
    double widened = error->widest_px2 > 0.0 ? point->widening_px2 / error->widest_px2 : 0.0;
    if (point->gap_px > 0.0) {
        int n = (int)fmin(point->gap_px / BST_FAR_STEP_PX, BST_FAR_STEPS - 1.0);
        double part = error->far[n] + widened * error->far_widened[n];
        return part * point->peak_e / sqrt(point->dark_variance_e2);
    }
    for (int k = 0; k < BST_LIGHT_CLASSES; k++) {
        light_e = k + 1 < BST_LIGHT_CLASSES ? 0.5 * light_e : 0.0;
        double part = error->most[k] + widened * error->widened[k];
        worst = fmax(worst, part * point->peak_e / sqrt(light_e + point->dark_variance_e2));
    }
    return worst;
}
