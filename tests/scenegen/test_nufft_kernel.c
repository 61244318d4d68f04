/* The grid of the Fourier path: its spreading kernel, sizes, errors and the wings that wrap around,
 * against integrals and sums written out. No device. */
#include "boresight/vec.h"
#include "scenegen/fourier/alias_correction.h"
#include "scenegen/fourier/batch_fft.h"
#include "scenegen/fourier/fourier_error.h"
#include "tests/test_support.h"

/* A Gaussian's modulus on both axes of a band up to 0.8 cycles/px. */
static bst_nufft_kernel_band band_of(double sigma) {
    bst_nufft_kernel_band band = {.step = 0.8 / BST_SPREAD_BINS};
    double sum = 0.0;
    for (int i = 0; i < BST_SPREAD_BINS; i++) {
        double f = (i + 0.5) * band.step;
        band.weight[i] = exp(-2.0 * BST_PI * BST_PI * sigma * sigma * f * f);
        sum += band.weight[i];
    }
    for (int i = 0; i < BST_SPREAD_BINS; i++) {
        band.weight[i] /= sum;
    }
    return band;
}

/* phi(t), as Barnett, Magland and af Klinteberg (2019) define it, times z^(2k). */
static double phi(const bst_nufft_kernel *s, double t, int k) {
    double z = 2.0 * t / s->taps;
    return fabs(z) < 1.0 ? exp(s->beta * (sqrt(1.0 - z * z) - 1.0)) * pow(z, 2 * k) : 0.0;
}

/* Fourier integral of that, by the midpoint rule in t. */
static double integral(const bst_nufft_kernel *s, double nu, int k) {
    enum { STEPS = 3000 };
    double sum = 0.0;
    for (int i = 0; i < STEPS; i++) {
        double t = s->taps * ((i + 0.5) / STEPS - 0.5);
        sum += phi(s, t, k) * cos(2.0 * BST_PI * nu * t) * s->taps / STEPS;
    }
    return sum;
}

static void values_and_transforms(void **state) {
    (void)state;
    for (int taps = 2; taps <= 8; taps += 3) {
        const bst_nufft_kernel s = {taps, 1.9 * taps};
        const bst_nufft_kernel_shape shape = {{1.0, -0.4, 0.3}};
        for (double t = -4.2; t < 4.2; t += 0.17) {
            bst_assert_close(bst_nufft_kernel_value(&s, t), phi(&s, t, 0), 1e-14);
            bst_assert_close(bst_nufft_kernel_shape_value(&s, &shape, t),
                             phi(&s, t, 0) - 0.4 * phi(&s, t, 1) + 0.3 * phi(&s, t, 2), 1e-14);
        }
        for (double nu = -1.3; nu < 1.4; nu += 0.21) {
            /* the rule's own error goes down to exp(-beta); steps at the ends of the integral */
            bst_assert_close(bst_nufft_kernel_transform(&s, nu), integral(&s, nu, 0),
                             exp(-s.beta) * taps + 1e-6);
        }
    }
}

/* A point at x0 samples, spread over the grid, its transform over that of the kernel: the largest
 * error at a frequency over places. */
static double error_at(const bst_nufft_kernel *s, double nu) {
    double worst = 0.0, own = integral(s, nu, 0);
    for (int phase = 0; phase < 8; phase++) {
        double x0 = phase / 8.0, re = 0.0, im = 0.0;
        for (int k = -8; k <= 8; k++) {
            re += phi(s, k - x0, 0) * cos(2.0 * BST_PI * nu * (k - x0)) / own;
            im += phi(s, k - x0, 0) * sin(2.0 * BST_PI * nu * (k - x0)) / own;
        }
        worst = fmax(worst, hypot(re - 1.0, im));
    }
    return worst;
}

/* The stated bound is that of points anywhere between samples, frequency by frequency, and
 * the kernel's beta is as good as any. */
static void the_error_of_a_grid(void **state) {
    (void)state;
    const struct {
        int taps;
        double sigma, density;
    } cases[] = {{3, 0.9, 2.0}, {4, 0.9, 1.6}, {4, 0.7, 2.2}, {6, 0.9, 1.2}};
    for (size_t n = 0; n < sizeof cases / sizeof *cases; n++) {
        bst_nufft_kernel_band band = band_of(cases[n].sigma);
        bst_nufft_kernel s = {cases[n].taps, 0.0};
        double reported = bst_nufft_kernel_choose(&s, &band, cases[n].density), sum = 0.0;
        for (int i = 0; i < BST_SPREAD_BINS; i++) {
            double nu = (i + 0.5) * band.step / cases[n].density;
            sum += band.weight[i] * (nu < 0.5 ? fmin(error_at(&s, nu), 2.0) : 1.0);
        }
        assert_true(reported > 0.95 * sum - 1e-7); /* aliases of the third order are left out */
        assert_true(reported < 1.1 * sum + 1e-7);  /* aliases in phase, at eight places */
        double best = reported;
        for (double beta = 0.8; beta < 2.6; beta += 0.1) {
            const bst_nufft_kernel other = {cases[n].taps, beta * cases[n].taps};
            double found = 0.0;
            for (int i = 0; i < BST_SPREAD_BINS; i++) {
                double nu = (i + 0.5) * band.step / cases[n].density;
                found += band.weight[i] * (nu < 0.5 ? fmin(error_at(&other, nu), 2.0) : 1.0);
            }
            best = fmin(best, found);
        }
        assert_true(sum < 1.06 * best + 1e-7); /* sixteen values of beta */
    }
}

/* Nodes widened by a Gaussian: flux is kept, and the error reported is what the band's frequencies
 * have. No other coefficients have less in the mean square. */
static void widened_nodes(void **state) {
    (void)state;
    bst_nufft_kernel_band band = band_of(0.9);
    const double density = 1.7;
    for (int taps = 4; taps <= 6; taps += 2) {
        bst_nufft_kernel s = {taps, 0.0};
        bst_nufft_kernel_shape shape;
        bst_nufft_kernel_choose(&s, &band, density);
        bst_assert_close(bst_nufft_kernel_widen(&s, &band, density, 0.0, &shape), 0.0, 0.0);
        assert_true(shape.c[0] == 1.0 && shape.c[1] == 0.0 && shape.c[2] == 0.0);
        for (double variance = 0.05; variance < 1.0; variance *= 2.5) {
            double reported = bst_nufft_kernel_widen(&s, &band, density, variance, &shape);
            double t0[3], sums[9] = {0.0}, error = 0.0, flux = 0.0;
            for (int k = 0; k < 3; k++) {
                t0[k] = integral(&s, 0.0, k);
                flux += shape.c[k] * t0[k];
            }
            bst_assert_close(flux / t0[0], 1.0, 1e-4);
            for (double nu = 0.0; nu < 0.5; nu += 0.07) { /* same integrals, another rule */
                double got = 0.0, own = integral(&s, nu, 0);
                for (int k = 0; k < 3; k++) {
                    got += shape.c[k] * integral(&s, nu, k) / own;
                }
                bst_assert_close(bst_nufft_kernel_shape_transform(&s, &shape, nu), got, 1e-4);
            }
            for (int i = 0; i < BST_SPREAD_BINS; i++) {
                double nu = (i + 0.5) * band.step / density, own[3];
                for (int k = 0; k < 3; k++) {
                    own[k] = integral(&s, nu, k);
                }
                double want = exp(-2.0 * BST_PI * BST_PI * variance * nu * nu);
                for (int trial = 0; trial < 9 && nu < 0.5; trial++) {
                    double c1 = shape.c[1] + 0.02 * (trial % 3 - 1);
                    double c2 = shape.c[2] + 0.02 * (trial / 3 - 1);
                    double c0 = 1.0 - (c1 * t0[1] + c2 * t0[2]) / t0[0];
                    double got = (c0 * own[0] + c1 * own[1] + c2 * own[2]) / own[0];
                    sums[trial] += band.weight[i] * (got - want) * (got - want);
                    error += trial == 4 ? band.weight[i] * fabs(got - want) : 0.0;
                }
            }
            bst_assert_close(reported, error, 0.02 * error + 1e-5);
            for (int trial = 0; trial < 9; trial++) {
                assert_true(sums[trial] >= sums[4] * (1.0 - 1e-3));
            }
        }
    }
}

/* Axes of their own for x and y: as coarse as the tolerance permits, and of the cheapest sizes. */
static void sizes_of_a_grid(void **state) {
    (void)state;
    bst_fourier_band band = {.cutoff = 0.8};
    band.axis[0] = band_of(0.9);
    band.axis[1] = band_of(0.6);
    double density[2];
    for (int axis = 0; axis < 2; axis++) {
        density[axis] = bst_fourier_density(&band, axis, 5, 1e-4);
        bst_nufft_kernel s = {5, 0.0};
        assert_true(bst_nufft_kernel_choose(&s, &band.axis[axis], density[axis]) <= 1e-4);
        assert_true(bst_nufft_kernel_choose(&s, &band.axis[axis], 0.99 * density[axis]) > 1e-4);
        for (int least = 100; least < 1500; least += 333) {
            bst_fourier_axis a = bst_fourier_axis_choose(&band, axis, 5, least, density[axis]);
            assert_true(a.pixels >= least && a.pixels % 16 == 0 && a.samples % 16 == 0);
            assert_true(a.samples >= density[axis] * a.pixels - 1e-6 && a.samples >= 64);
            assert_true(a.error <= 1e-4 && a.spread.taps == 5);
            double cost = bst_batch_fft_cost(a.pixels) + bst_batch_fft_cost(a.samples);
            for (int pixels = (least + 15) / 16 * 16; pixels <= least + least / 3; pixels += 16) {
                for (int samples = 64; samples <= 6 * least; samples += 16) {
                    bool allowed = samples >= density[axis] * pixels &&
                                   samples <= 1.3 * density[axis] * pixels;
                    assert_true(!allowed ||
                                bst_batch_fft_cost(pixels) + bst_batch_fft_cost(samples) >=
                                    cost - 1e-9 * cost);
                }
            }
        }
    }
    assert_true(density[1] > 1.1 * density[0]);
    /* not to be had: the finest */
    bst_assert_close(bst_fourier_density(&band, 0, 2, 1e-12), 5.0, 1e-12);
}

/* Frequencies up to 1 cycle/px either way, and the first aliases of a grid axis there: OTF of a
 * Gaussian in pixels times the ratio of the kernel's transforms. */
enum { FREQUENCIES = 320 };
static void aliases_of(const bst_fourier_axis *axis, double sigma, double out[FREQUENCIES][2]) {
    double density = (double)axis->samples / axis->pixels;
    for (int i = 0; i < FREQUENCIES; i++) {
        double f = (i + 0.5) * 2.0 / FREQUENCIES - 1.0, nu = f / density;
        double otf =
            exp(-2.0 * BST_PI * BST_PI * sigma * sigma * f * f) * sin(BST_PI * f) / BST_PI / f;
        bool kept = otf > 1e-12 && fabs(nu) < 0.5;
        for (int m = 0; m < 2; m++) {
            out[i][m] = kept ? otf * integral(&axis->spread, nu + 2.0 * m - 1.0, 0) /
                                   integral(&axis->spread, nu, 0)
                             : 0.0;
        }
    }
}

/* Their light x px from a point at x0 samples. */
static double alias_at(double aliases[FREQUENCIES][2], double x, double x0) {
    double sum = 0.0;
    for (int i = 0; i < FREQUENCIES; i++) {
        double f = (i + 0.5) * 2.0 / FREQUENCIES - 1.0;
        for (int m = 0; m < 2; m++) {
            sum += aliases[i][m] * cos(2.0 * BST_PI * ((2.0 * m - 1.0) * x0 + f * x)) * 2.0 /
                   FREQUENCIES;
        }
    }
    return sum;
}

/* By brightness, the errors of a point anywhere between the samples of a grid that is coarse along
 * one axis only: those of its aliases there, times 1.7, and not those of the other axis. */
static void errors_of_a_coarse_axis(void **state) {
    (void)state;
    enum { CLASSES = 10, STEPS_X = 21 };
    bst_ctx ctx = {0};
    const double sigma = 2.4 / 2.3548200450309493, root = sigma * sqrt(2.0);
    const bst_camera camera = {.width_px = 512,
                               .height_px = 512,
                               .pixel_scale_arcsec = 3.0,
                               .aperture_m = 0.15,
                               .psf_fwhm_px = 2.4};
    bst_psf *psf;
    bst_fourier_band band;
    bst_assert_ok(&ctx, bst_psf_create(&ctx, &camera, &psf));
    bst_assert_ok(&ctx, bst_fourier_band_measure(&ctx, psf, 1e-7, &band));
    bst_fourier_axis coarse = {.pixels = 160, .samples = 224, .spread = {4, 8.0}};
    bst_fourier_axis fine = {.pixels = 160, .samples = 480, .spread = {8, 18.0}};
    static double error[STEPS_X], aliases[FREQUENCIES][2];
    aliases_of(&coarse, sigma, aliases);
    for (int i = 0; i < STEPS_X; i++) { /* places in steps of 0.25 px */
        for (int phase = 0; phase < 8; phase++) {
            error[i] = fmax(error[i], fabs(alias_at(aliases, 0.25 * i, phase / 8.0)));
        }
    }
    double want[CLASSES] = {0.0}, centre = erf(0.5 / root);
    for (int n = 0; n < STEPS_X * STEPS_X; n++) {
        double x = 0.25 * (n % STEPS_X), y = 0.25 * (n / STEPS_X);
        double u = 0.5 * (erf((x + 0.5) / root) - erf((x - 0.5) / root));
        double v = 0.5 * (erf((y + 0.5) / root) - erf((y - 0.5) / root));
        double light = u * v / (centre * centre);
        int k = (int)floor(-log2(light) - 1e-12);
        k = k < 0 ? 0 : k;
        if (k < CLASSES) {
            want[k] = fmax(want[k], 1.7 * error[n % STEPS_X] * v / (centre * centre));
        }
    }
    for (int axis = 0; axis < 2; axis++) {
        struct {
            bst_fourier_error error;
            double guard[32];
        } reported = {.guard = {0.0}};
        const bst_fourier_axis both[2] = {axis ? fine : coarse, axis ? coarse : fine};
        bst_assert_ok(&ctx,
                      bst_fourier_error_measure(&ctx, psf, &band, both, 1, 0.0, &reported.error));
        for (int k = 0; k < CLASSES; k++) {
            /* places in steps of 0.25 px, and the classes' borders between them */
            bst_assert_close(reported.error.most[k] / want[k], 1.1, 0.25);
        }
        /* what is darker than all classes belongs to the last one */
        assert_true(reported.error.most[BST_LIGHT_CLASSES - 1] > 0.0);
        for (int k = 0; k < BST_LIGHT_CLASSES; k++) { /* nothing is widened */
            assert_true(reported.error.widened[k] < 1e-12);
        }
        for (int k = 0; k < 32; k++) {
            assert_true(reported.guard[k] == 0.0);
        }
    }
    bst_psf_free(psf);
}

/* Errors by brightness over the noise of the darkest pixel of their class. */
static void errors_by_brightness(void **state) {
    (void)state;
    bst_fourier_error e = {.widest_px2 = 0.0};
    e.most[0] = 1e-3;
    e.most[8] = 4e-4;
    e.most[BST_LIGHT_CLASSES - 1] = 1e-4;
    const double peak = 1e5, dark = 100.0;
    bst_fourier_point all = {.peak_e = peak, .dark_variance_e2 = dark, .widening_px2 = 0.3};
    bst_fourier_point wings = all;
    wings.gap_px = 2.5 * BST_FAR_STEP_PX;
    e.far[1] = 2e-3;
    e.far[2] = 3e-4;
    e.far[BST_FAR_STEPS - 1] = 2e-5;
    double class0 = 100.0 / sqrt(0.5 * peak + dark), class8 = 40.0 / sqrt(peak / 512.0 + dark);
    double last = 10.0 / sqrt(dark);
    bst_assert_close(bst_fourier_error_sigma(&e, &all), class8, 1e-12);
    bst_assert_close(bst_fourier_error_sigma(&e, &wings), 3.0 * last, 1e-12);
    wings.gap_px = 1e3;
    bst_assert_close(bst_fourier_error_sigma(&e, &wings), 0.2 * last, 1e-12);
    e.most[8] = 0.0;
    bst_assert_close(bst_fourier_error_sigma(&e, &all), fmax(class0, last), 1e-12);
    e.most[0] = 4e-3;
    bst_assert_close(bst_fourier_error_sigma(&e, &all), 4.0 * class0, 1e-12);
    /* in proportion to the widening, in the same pixel */
    e.widened[0] = 6e-3;
    e.widest_px2 = 0.9;
    bst_assert_close(bst_fourier_error_sigma(&e, &all), (4.0 + 2.0) * class0, 1e-12);
    all.widening_px2 = 0.0;
    bst_assert_close(bst_fourier_error_sigma(&e, &all), 4.0 * class0, 1e-12);
}

/* Transforms along an axis of a Gaussian in pixels: widened by a Gaussian, and by the widening
 * kernel. */
static void widened_of(const bst_fourier_axis *axis, const bst_nufft_kernel_shape *shape,
                       double sigma, double variance, double out[FREQUENCIES][2]) {
    double density = (double)axis->samples / axis->pixels;
    for (int i = 0; i < FREQUENCIES; i++) {
        double f = (i + 0.5) * 2.0 / FREQUENCIES - 1.0, nu = f / density, ratio = 0.0;
        double otf =
            exp(-2.0 * BST_PI * BST_PI * sigma * sigma * f * f) * sin(BST_PI * f) / BST_PI / f;
        for (int k = 0; k < 3 && otf > 1e-9; k++) {
            ratio += shape->c[k] * integral(&axis->spread, nu, k);
        }
        ratio /= otf > 1e-9 ? integral(&axis->spread, nu, 0) : 1.0;
        out[i][0] = otf * exp(-2.0 * BST_PI * BST_PI * variance * f * f);
        out[i][1] = otf * ratio;
    }
}

/* Their light x px from a point. */
static void light_at(double transforms[FREQUENCIES][2], double x, double out[2]) {
    out[0] = out[1] = 0.0;
    for (int i = 0; i < FREQUENCIES; i++) {
        double f = (i + 0.5) * 2.0 / FREQUENCIES - 1.0;
        for (int k = 0; k < 2; k++) {
            out[k] += transforms[i][k] * cos(2.0 * BST_PI * f * x) * 2.0 / FREQUENCIES;
        }
    }
}

/* What a widened node differs by from the convolution with a Gaussian, by brightness: sums over
 * frequencies along each axis. Scene 294 of test_tolerance_sweep.c has more of it than of all other
 * errors. */
static void errors_of_widened_nodes(void **state) {
    (void)state;
    enum { CLASSES = 8, PLACES = 17 };
    bst_ctx ctx = {0};
    const double sigma = 2.4 / 2.3548200450309493, variance = 0.25, root = sigma * sqrt(2.0);
    const bst_camera camera = {.width_px = 512,
                               .height_px = 512,
                               .pixel_scale_arcsec = 3.0,
                               .aperture_m = 0.15,
                               .psf_fwhm_px = 2.4};
    bst_psf *psf;
    bst_fourier_band band;
    bst_fourier_error error;
    bst_assert_ok(&ctx, bst_psf_create(&ctx, &camera, &psf));
    bst_assert_ok(&ctx, bst_fourier_band_measure(&ctx, psf, 1e-7, &band));
    const bst_fourier_axis axis[2] = {{.pixels = 160, .samples = 320, .spread = {6, 12.0}},
                                      {.pixels = 160, .samples = 352, .spread = {6, 12.0}}};
    bst_assert_ok(&ctx, bst_fourier_error_measure(&ctx, psf, &band, axis, 1, variance, &error));
    assert_true(error.widest_px2 == variance);
    static double light[2][PLACES][2], transforms[FREQUENCIES][2];
    for (int a = 0; a < 2; a++) {
        double density = (double)axis[a].samples / axis[a].pixels;
        bst_nufft_kernel_shape shape;
        (void)bst_nufft_kernel_widen(&axis[a].spread, &band.axis[a], density,
                                     variance * density * density, &shape);
        widened_of(&axis[a], &shape, sigma, variance, transforms);
        for (int i = 0; i < PLACES; i++) {
            light_at(transforms, 0.25 * i, light[a][i]);
        }
    }
    double want[CLASSES] = {0.0}, centre = erf(0.5 / root), worst = 0.0;
    for (int n = 0; n < PLACES * PLACES; n++) {
        double x = 0.25 * (n % PLACES), y = 0.25 * (n / PLACES);
        double u = 0.5 * (erf((x + 0.5) / root) - erf((x - 0.5) / root));
        double v = 0.5 * (erf((y + 0.5) / root) - erf((y - 0.5) / root));
        int k = (int)fmax(floor(-log2(u * v / (centre * centre)) - 1e-12), 0.0);
        const double *a = light[0][n % PLACES], *b = light[1][n / PLACES];
        double missed = fabs(a[1] * b[1] - a[0] * b[0]) / (centre * centre);
        if (k < CLASSES) {
            want[k] = fmax(want[k], missed);
            worst = fmax(worst, missed);
        }
    }
    assert_true(worst > 1e-5);
    for (int k = 0; k < CLASSES; k++) {
        /* places in steps of 0.25 px, and the classes' borders between them */
        bst_assert_close(error.widened[k], want[k], 0.25 * want[k] + 0.1 * worst);
    }
    bst_psf_free(psf);
}

/* Moffat's wings, (b - 1) / (pi a^2) (1 + (r / a)^2)^-b. */
static double moffat(double x, double y, double fwhm, double b) {
    double a = 0.5 * fwhm / sqrt(pow(2.0, 1.0 / b) - 1.0);
    return (b - 1.0) / (BST_PI * a * a) * pow(1.0 + (x * x + y * y) / (a * a), -b);
}

/* The same, smoothed by a Gaussian of 4 px: sums in steps of 2 px. */
static double smooth_moffat(double x, double y, double fwhm, double b) {
    double sum = 0.0, weight = 0.0;
    for (int j = -6; j <= 6; j++) {
        for (int i = -6; i <= 6; i++) {
            double w = exp(-0.5 * (i * i + j * j) / 4.0);
            sum += w * moffat(x + 2.0 * i, y + 2.0 * j, fwhm, b);
            weight += w;
        }
    }
    return sum / weight;
}

/* Light in one cell of a frame that is wider than high: what its wings of other periods would add
 * to each cell, and is taken away. */
static void wings_of_other_periods(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    const bst_camera camera = {.width_px = 512,
                               .height_px = 512,
                               .pixel_scale_arcsec = 3.0,
                               .aperture_m = 0.15,
                               .psf_fwhm_px = 3.0,
                               .optics = {.psf = BST_PSF_MOFFAT, .moffat_beta = 2.0}};
    enum { CELLS_X = 24, CELLS_Y = 16 };
    const bst_alias_correction_axis x = {96, CELLS_X, 4.0, 80.0}, y = {64, CELLS_Y, 4.0, 52.0};
    bst_psf *psf;
    bst_alias_correction *c;
    bst_assert_ok(&ctx, bst_psf_create(&ctx, &camera, &psf));
    bst_assert_ok(&ctx, bst_alias_correction_create(&ctx, psf, 0, &x, &y, NULL, &c));
    assert_non_null(c);
    const int from[2][2] = {{2, 1}, {17, 11}};
    for (int k = 0; k < 2; k++) {
        float light[CELLS_X * CELLS_Y] = {0.0f};
        light[from[k][1] * CELLS_X + from[k][0]] = 1000.0f;
        bst_alias_correction_run(c, light);
        for (int j = 0; j < CELLS_Y; j++) {
            for (int i = 0; i < CELLS_X; i++) {
                double dx = 4.0 * (i - from[k][0]), dy = 4.0 * (j - from[k][1]), want = 0.0;
                if (fabs(dx) > 80.0 || fabs(dy) > 52.0) { /* no source is so far from a pixel */
                    bst_assert_close((double)light[j * CELLS_X + i], 0.0, 1e-6);
                    continue;
                }
                for (int q = -40; q <= 40; q++) {
                    for (int p = -40; p <= 40; p++) {
                        bool kept = p % 4 == 0 && q % 4 == 0; /* in the fourfold period too */
                        double u = dx + 96 * p, v = dy + 64 * q;
                        want -= kept                       ? 0.0
                                : abs(p) < 2 && abs(q) < 2 ? 1000.0 * smooth_moffat(u, v, 3.0, 2.0)
                                                           : 1000.0 * moffat(u, v, 3.0, 2.0);
                    }
                }
                double got = (double)light[j * CELLS_X + i];
                bst_assert_close(got / want, 1.0, fabs(dx) < 76.0 && fabs(dy) < 44.0 ? 0.05 : 0.12);
            }
        }
    }
    bst_alias_correction_free(c);
    bst_psf_free(psf);
    /* a Gaussian has no wings to speak of */
    bst_camera narrow = camera;
    narrow.optics.psf = BST_PSF_GAUSSIAN;
    const bst_alias_correction_axis wide_x = {192, 48, 4.0, 80.0}, wide_y = {160, 40, 4.0, 52.0};
    bst_assert_ok(&ctx, bst_psf_create(&ctx, &narrow, &psf));
    bst_assert_ok(&ctx, bst_alias_correction_create(&ctx, psf, 0, &wide_x, &wide_y, NULL, &c));
    if (c) { /* where it is kept at all, it is rounding */
        float light[48 * 40] = {0.0f};
        light[10 * 48 + 5] = 1000.0f;
        bst_alias_correction_run(c, light);
        for (int i = 0; i < 48 * 40; i++) {
            bst_assert_close(light[i], 0.0, 1e-3);
        }
    }
    bst_alias_correction_free(c);
    bst_psf_free(psf);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(values_and_transforms),   cmocka_unit_test(the_error_of_a_grid),
        cmocka_unit_test(widened_nodes),           cmocka_unit_test(sizes_of_a_grid),
        cmocka_unit_test(errors_of_a_coarse_axis), cmocka_unit_test(errors_by_brightness),
        cmocka_unit_test(errors_of_widened_nodes), cmocka_unit_test(wings_of_other_periods),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
