#include "sim/optics/psf.h"

#include <math.h>
#include <string.h>

#include "sim/optics/zernike.h"
#include "tests/test_support.h"

static bst_camera camera_of(int32_t model) {
    return (bst_camera){.width_px = 512,
                        .height_px = 256,
                        .pixel_scale_arcsec = 2.0,
                        .aperture_m = 0.1,
                        .psf_fwhm_px = 2.0,
                        .optics = {.psf = model, .q = 2.0, .wavelengths = 1}};
}

static bst_psf *psf_of(const bst_camera *camera) {
    bst_ctx ctx = {0};
    bst_psf *psf;
    bst_assert_ok(&ctx, bst_psf_create(&ctx, camera, &psf));
    return psf;
}

static double sinc(double x) {
    return x == 0.0 ? 1.0 : sin(BST_PI * x) / (BST_PI * x);
}

/* Integral of the OTF without the pixel, over its disc: the intensity at the nominal place. */
static double centre_intensity(const bst_psf *psf) {
    enum { N = 400 };
    double limit = bst_psf_cutoff(psf), step = limit / N, sum = 0.0;
    for (int j = -N; j < N; j++) {
        for (int i = 0; i < N; i++) {
            double fx = (i + 0.5) * step, fy = (j + 0.5) * step, h[2];
            bst_psf_otf(psf, 0, fx, fy, h);
            sum += h[0] / (sinc(fx) * sinc(fy));
        }
    }
    return 2.0 * sum * step * step;
}

static double strehl(const bst_camera *aberrated) {
    bst_camera perfect = *aberrated;
    memset(&perfect.optics.zernike_waves, 0, sizeof perfect.optics.zernike_waves);
    perfect.optics.defocus_um = 0.0;
    bst_psf *a = psf_of(aberrated), *b = psf_of(&perfect);
    double ratio = centre_intensity(a) / centre_intensity(b);
    bst_psf_free(a);
    bst_psf_free(b);
    return ratio;
}

static void a_gaussian_is_a_gaussian_with_a_pixel(void **state) {
    (void)state;
    bst_camera camera = camera_of(BST_PSF_GAUSSIAN);
    camera.optics.diffusion_px = 0.4;
    bst_psf *psf = psf_of(&camera);
    double sigma, want = hypot(2.0 / 2.3548200450309493, 0.4), h[2];
    assert_true(bst_psf_gaussian(psf, &sigma));
    bst_assert_close(sigma, want, 1e-15); /* rounding */
    for (int k = 0; k < 50; k++) {
        double fx = 0.013 * k, fy = 0.4 - 0.011 * k;
        bst_psf_otf(psf, 0, fx, fy, h);
        double g = exp(-2.0 * BST_PI * BST_PI * want * want * (fx * fx + fy * fy));
        bst_assert_close(h[0], g * sinc(fx) * sinc(fy), 1e-14); /* rounding */
        assert_true(h[1] == 0.0);
    }
    double cutoff = bst_psf_cutoff(psf);
    assert_true(exp(-2.0 * BST_PI * BST_PI * want * want * cutoff * cutoff) < 1.001e-9);
    bst_psf_free(psf);
}

/* x = 2 pi alpha f: K of order 1/2 and 3/2 are elementary (Abramowitz and Stegun 10.2.15, 17). */
static void moffat_profiles_have_closed_forms(void **state) {
    (void)state;
    for (int k = 0; k < 2; k++) {
        bst_camera camera = camera_of(BST_PSF_MOFFAT);
        camera.optics.moffat_beta = k ? 2.5 : 1.5;
        bst_psf *psf = psf_of(&camera);
        double alpha = 1.0 / sqrt(pow(2.0, 1.0 / camera.optics.moffat_beta) - 1.0), worst = 0.0;
        for (double f = 0.0; f < 1.2 * bst_psf_cutoff(psf); f += 0.00371) {
            double x = 2.0 * BST_PI * alpha * f, h[2], fx = 0.6 * f, fy = -0.8 * f;
            bst_psf_otf(psf, 0, fx, fy, h);
            double want = (k ? 1.0 + x : 1.0) * exp(-x) * sinc(fx) * sinc(fy);
            worst = fmax(worst, fabs(h[0] - want));
        }
        assert_true(worst < 1e-8); /* beyond the cut-off 1e-9; interpolation less */
        bst_psf_free(psf);
    }
}

/* A Moffat of large exponent is the Gaussian of the same width, to 1 / beta. */
static void a_steep_moffat_is_a_gaussian(void **state) {
    (void)state;
    bst_camera camera = camera_of(BST_PSF_MOFFAT);
    camera.optics.moffat_beta = 100.0;
    bst_psf *psf = psf_of(&camera);
    double s = 2.0 / 2.3548200450309493;
    for (double f = 0.0; f < 0.6; f += 0.05) {
        double h[2];
        bst_psf_otf(psf, 0, f, 0.0, h);
        bst_assert_close(h[0], exp(-2.0 * BST_PI * BST_PI * s * s * f * f) * sinc(f), 0.01);
    }
    bst_psf_free(psf);
}

static void the_clear_circle_has_its_closed_form(void **state) {
    (void)state;
    bst_camera camera = camera_of(BST_PSF_DIFFRACTION);
    bst_psf *psf = psf_of(&camera);
    bst_assert_close(bst_psf_cutoff(psf), 0.5, 1e-15); /* 1 / Q */
    double worst = 0.0;
    for (int k = 0; k <= 20000; k++) {
        double s = k / 19000.0, f = 0.5 * s, fx = f * cos(k), fy = f * sin(k), h[2];
        bst_psf_otf(psf, 0, fx, fy, h);
        double want = s < 1.0 ? 2.0 / BST_PI * (acos(s) - s * sqrt(1.0 - s * s)) : 0.0;
        worst = fmax(worst, fabs(h[0] - want * sinc(fx) * sinc(fy)) + fabs(h[1]));
    }
    assert_true(worst < 2e-7); /* cubic through nodes; worst at the cut-off's power 3/2 */
    bst_psf_free(psf);
}

/* O'Neill 1956, J. Opt. Soc. Am. 46, 285 (with the erratum, 1096): r in cut-offs, e the ratio of
 * diameters. */
static double oneill(double e, double r) {
    double a = 0.0, b = 0.0, c = 0.0;
    if (r < 1.0) {
        a = 2.0 / BST_PI * (acos(r) - r * sqrt(1.0 - r * r));
    }
    if (r < e) {
        b = 2.0 * e * e / BST_PI * (acos(r / e) - r / e * sqrt(1.0 - r * r / (e * e)));
    }
    if (r < 0.5 * (1.0 - e)) {
        c = -2.0 * e * e;
    } else if (r < 0.5 * (1.0 + e)) {
        double phi = acos((1.0 + e * e - 4.0 * r * r) / (2.0 * e));
        c = 2.0 * e / BST_PI * sin(phi) + (1.0 + e * e) / BST_PI * phi -
            2.0 * (1.0 - e * e) / BST_PI * atan((1.0 + e) / (1.0 - e) * tan(0.5 * phi)) -
            2.0 * e * e;
    }
    return (a + b + c) / (1.0 - e * e);
}

static void the_annulus_has_its_closed_form(void **state) {
    (void)state;
    const double ratios[] = {0.1, 0.3333, 0.5, 0.8};
    for (int n = 0; n < 4; n++) {
        bst_camera camera = camera_of(BST_PSF_DIFFRACTION);
        camera.obscuration = ratios[n] * ratios[n];
        bst_psf *psf = psf_of(&camera);
        double worst = 0.0;
        for (int k = 1; k <= 9973; k++) {
            double s = k / 9973.0, fx = 0.3 * s, fy = 0.4 * s, h[2];
            bst_psf_otf(psf, 0, fx, fy, h);
            worst = fmax(worst, fabs(h[0] - oneill(ratios[n], s) * sinc(fx) * sinc(fy)));
        }
        assert_true(worst < 8e-7); /* as above, and the inner circle's own square roots */
        bst_psf_free(psf);
    }
}

/* Noll 1976, table I, and Born and Wolf for the higher orders. */
static void noll_indices_and_polynomials_are_the_published_ones(void **state) {
    (void)state;
    const int n[] = {0, 1, 1, 2, 2, 2, 3, 3, 3, 3, 4, 4, 4, 4, 4, 5, 5, 5, 5, 5, 5};
    const int m[] = {0, 1, -1, 0, -2, 2, -1, 1, -3, 3, 0, 2, -2, 4, -4, 1, -1, 3, -3, 5, -5};
    for (int j = 1; j <= 21; j++) {
        int a, b;
        bst_zernike_noll(j, &a, &b);
        assert_int_equal(a, n[j - 1]);
        assert_int_equal(b, m[j - 1]);
    }
    int a, b;
    bst_zernike_noll(37, &a, &b);
    assert_int_equal(a, 8);
    assert_int_equal(b, 0);
    for (int k = 0; k < 40; k++) {
        double r = k / 39.0, t = 0.7 * k, x = r * cos(t), y = r * sin(t);
        const struct {
            int j;
            double value;
        } want[] = {
            {4, sqrt(3.0) * (2 * r * r - 1)},
            {5, sqrt(6.0) * r * r * sin(2 * t)},
            {8, sqrt(8.0) * (3 * r * r * r - 2 * r) * cos(t)},
            {9, sqrt(8.0) * r * r * r * sin(3 * t)},
            {11, sqrt(5.0) * (6 * pow(r, 4) - 6 * r * r + 1)},
            {13, sqrt(10.0) * (4 * pow(r, 4) - 3 * r * r) * sin(2 * t)},
            {22, sqrt(7.0) * (20 * pow(r, 6) - 30 * pow(r, 4) + 12 * r * r - 1)},
            {37, 3 * (70 * pow(r, 8) - 140 * pow(r, 6) + 90 * pow(r, 4) - 20 * r * r + 1)},
        };
        for (size_t i = 0; i < sizeof want / sizeof *want; i++) {
            bst_zernike_polynomial z = {0};
            bst_zernike_add(&z, want[i].j, 1.0);
            bst_assert_close(bst_zernike_at(&z, x, y), want[i].value, 1e-12); /* rounding */
        }
    }
}

/* Each key is the term that its description says: degree and order by Noll's indices. */
static void keys_say_their_terms(void **state) {
    (void)state;
    const bst_config_desc *terms = NULL;
    for (const bst_config_desc *d = bst_optics_config_table; d->key; d++) {
        terms = strcmp(d->key, "zernike_waves") == 0 ? d->children : terms;
    }
    assert_non_null(terms);
    for (int j = 2; j <= 37; j++, terms++) {
        int key, said, n, m, degree, order;
        assert_int_equal(sscanf(terms->key, "z%d", &key), 1);
        assert_int_equal(
            sscanf(terms->doc, "RMS of Noll's term %d, n = %d, m = %d.", &said, &n, &m), 3);
        bst_zernike_noll(j, &degree, &order);
        assert_true(key == j && said == j && n == degree && m == order);
    }
    assert_null(terms->key);
}

static void zernike_terms_are_orthonormal(void **state) {
    (void)state;
    /* Simpson in r^2 would do; the rule here is uniform in angle (exact) and midpoints in r^2 */
    enum { R = 4000, T = 24 };
    bst_zernike_polynomial z[36] = {0};
    for (int j = 2; j <= 37; j++) {
        bst_zernike_add(&z[j - 2], j, 1.0);
    }
    static double sum[36][36];
    for (int a = 0; a < R; a += 1) {
        for (int b = 0; b < T; b++) {
            double r = sqrt((a + 0.5) / R), t = 2.0 * BST_PI * b / T, v[36];
            for (int i = 0; i < 36; i++) {
                v[i] = bst_zernike_at(&z[i], r * cos(t), r * sin(t));
            }
            for (int i = 0; i < 36; i++) {
                for (int k = 0; k <= i; k++) {
                    sum[i][k] += v[i] * v[k] / ((double)R * T);
                }
            }
        }
    }
    for (int i = 0; i < 36; i++) {
        for (int k = 0; k <= i; k++) {
            bst_assert_close(sum[i][k], i == k, 5e-6); /* midpoint rule: (degree / R)^2 */
        }
    }
}

/* On the axis, defocus has the closed form (sin(pi W) / (pi W))^2, W waves across the open annulus
 * (Born and Wolf 8.8). */
static void defocus_has_its_closed_form_on_the_axis(void **state) {
    (void)state;
    for (int n = 0; n < 4; n++) {
        bst_camera camera = camera_of(BST_PSF_DIFFRACTION);
        double e2 = n % 2 ? 0.16 : 0.0, a4 = n < 2 ? 0.1 : 0.4;
        camera.obscuration = e2;
        camera.optics.band_nm[0] = 540.0;
        camera.optics.band_nm[1] = 560.0;
        camera.optics.zernike_waves.waves[4 - 2] = a4;
        double w = sinc(2.0 * sqrt(3.0) * a4 * (1.0 - e2));
        bst_assert_close(strehl(&camera), w * w, 3e-5); /* cells of 1/384 of the aperture */
    }
}

static void a_detector_out_of_focus_is_term_4(void **state) {
    (void)state;
    bst_camera camera = camera_of(BST_PSF_DIFFRACTION);
    camera.optics.f_number = 4.0;
    camera.optics.defocus_um = 20.0;
    /* W020 = dz / (8 F^2) = 0.15625 um at 551 nm (middle of the default band) */
    double w = sinc(20e-6 / (8.0 * 16.0) / 551e-9);
    bst_assert_close(strehl(&camera), w * w, 3e-5); /* as above */
}

/* Marechal: 1 - (2 pi sigma)^2 to second order, whatever the terms. */
static void small_aberrations_have_marechals_strehl(void **state) {
    (void)state;
    const int terms[] = {5, 8, 11, 16, 29, 37};
    for (int n = 0; n < 6; n++) {
        bst_camera camera = camera_of(BST_PSF_DIFFRACTION);
        camera.optics.zernike_nm = 551.0;
        camera.optics.zernike_waves.waves[terms[n] - 2] = 0.02;
        double v = 4.0 * BST_PI * BST_PI * 0.0004;
        /* next order: v^2 / 2 with the terms' kurtosis, 1.2e-4 */
        bst_assert_close(strehl(&camera), exp(-v), 2e-4);
    }
}

static void tilt_moves_the_image(void **state) {
    (void)state;
    bst_camera camera = camera_of(BST_PSF_DIFFRACTION);
    camera.optics.zernike_nm = 551.0;
    camera.optics.zernike_waves.waves[2 - 2] = 0.25;
    bst_psf *psf = psf_of(&camera);
    camera.optics.zernike_waves.waves[2 - 2] = 0.0;
    bst_psf *still = psf_of(&camera);
    for (int k = -9; k < 10; k++) {
        double fx = 0.05 * k, fy = 0.03, h[2], s[2];
        bst_psf_otf(psf, 0, fx, fy, h);
        bst_psf_otf(still, 0, fx, fy, s);
        /* 4 x 0.25 waves across the aperture are one lambda F: Q = 2 px towards +x */
        bst_assert_close(h[0], s[0] * cos(4.0 * BST_PI * fx), 2e-5); /* cells of 1/384 */
        bst_assert_close(h[1], -s[0] * sin(4.0 * BST_PI * fx), 2e-5);
    }
    bst_psf_free(psf);
    bst_psf_free(still);
}

/* The centroid lies where the mean slope of the wavefront points: 4 a lambda F of tilt a, and for
 * coma, sqrt(8) (3 r^3 - 2 r) cos t, 2 sqrt(8) a (1 + 3 e^2) lambda F, on an annulus of inner
 * radius e (mean of r^2: (1 + e^2) / 2). Terms 2 and 8 are along x, 3 and 7 along y; lambda F is 2
 * px. */
static void odd_aberrations_move_the_centroid(void **state) {
    (void)state;
    for (int n = 0; n < 4; n++) {
        bst_camera camera = camera_of(BST_PSF_DIFFRACTION);
        double e2 = n % 2 ? 0.16 : 0.0, *z = camera.optics.zernike_waves.waves;
        camera.obscuration = e2;
        camera.optics.zernike_nm = 551.0;
        z[2 - 2] = n < 2 ? 0.0 : 0.05;
        z[3 - 2] = n < 2 ? 0.0 : -0.08;
        z[8 - 2] = 0.06;
        z[7 - 2] = -0.03;
        double coma = 2 * sqrt(8.0) * (1 + 3 * e2) * 2, shift[2];
        bst_psf *psf = psf_of(&camera);
        const float white[BST_PSF_COLOURS] = {0};
        bst_psf_centroid_px(psf, white, 50, 25, shift);
        /* cells of 1/384 of the aperture, and the OTF's phase from two low frequencies */
        bst_assert_close(shift[0], 8 * z[2 - 2] + coma * 0.06, 0.01);
        bst_assert_close(shift[1], 8 * z[3 - 2] - coma * 0.03, 0.01);
        bst_psf_free(psf);
    }
}

/* A PSF reaches as far as its longest wavelength makes it, in proportion to the wavelength; slopes
 * of the wavefront are too many waves at the shortest. */
static void the_ends_of_a_band_count(void **state) {
    (void)state;
    double reach[2];
    for (int wide = 0; wide < 2; wide++) {
        bst_camera camera = camera_of(BST_PSF_DIFFRACTION);
        camera.optics.q = 0.0; /* by aperture and scale: lambda / (0.1 m * 2 arcsec) */
        camera.optics.wavelengths = 8;
        camera.optics.band_nm[0] = wide ? 400.0 : 979.0;
        camera.optics.band_nm[1] = wide ? 1000.0 : 981.0;
        bst_psf *psf = psf_of(&camera);
        reach[wide] = bst_psf_reach_px(psf, 1e-9);
        /* mean light decreases as the third power; a pixel is added to either */
        bst_assert_close((reach[wide] - 1.0) / (bst_psf_reach_px(psf, 1e-6) - 1.0), 10.0, 1e-9);
        bst_psf_free(psf);
    }
    /* eight wavelengths of a rule whose last one is 12 nm from the end */
    bst_assert_close(reach[1] / reach[0], 988.0 / 980.0, 0.005);
    /* a tilt of 4 * 15 waves of 500 nm a diameter: 64 are too many, of the shortest wavelength */
    bst_camera camera = camera_of(BST_PSF_DIFFRACTION);
    bst_ctx ctx = {0};
    bst_psf *psf;
    camera.optics.zernike_nm = 500.0;
    camera.optics.wavelengths = 8;
    camera.optics.band_nm[0] = 250.0;
    camera.optics.band_nm[1] = 1000.0;
    camera.optics.zernike_waves.waves[2 - 2] = 15.0;
    assert_int_equal(bst_psf_create(&ctx, &camera, &psf), BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "aberrations with slopes of"));
}

/* The autocorrelation by brute force: a fine midpoint rule on the aperture's very outline. */
static void brute_otf(const bst_camera *camera, const double amounts[38], double sx, double sy,
                      double out[2]) {
    enum { N = 1400 };
    static unsigned char open[N][N];
    static double phase[N][N];
    const bst_optics_config *o = &camera->optics;
    bst_zernike_polynomial z = {0};
    for (int j = 2; j <= 37; j++) {
        bst_zernike_add(&z, j, amounts[j]);
    }
    double area = 0.0;
    int kx = (int)lround(sx * N), ky = (int)lround(sy * N);
    for (int j = 0; j < N; j++) {
        for (int i = 0; i < N; i++) {
            double x = (i + 0.5) / N - 0.5, y = (j + 0.5) / N - 0.5, r2 = x * x + y * y;
            bool light = r2 < 0.25 && r2 > 0.25 * camera->obscuration;
            for (int k = 0; k < o->spiders.count; k++) {
                double t =
                    (o->spiders.angle_deg + 360.0 * k / (double)o->spiders.count) / 180.0 * BST_PI;
                double along = x * cos(t) + y * sin(t), across = y * cos(t) - x * sin(t);
                light = light && !(along > 0.0 &&
                                   fabs(across) < 0.5 * o->spiders.width_m / camera->aperture_m);
            }
            open[j][i] = light;
            phase[j][i] = 2.0 * BST_PI * bst_zernike_at(&z, 2.0 * x, 2.0 * y);
            area += light;
        }
    }
    out[0] = out[1] = 0.0;
    for (int j = 0; j < N; j++) {
        for (int i = 0; i < N; i++) {
            int a = i + kx, b = j + ky;
            if (a >= 0 && a < N && b >= 0 && b < N && open[j][i] && open[b][a]) {
                double d = phase[j][i] - phase[b][a];
                out[0] += cos(d) / area;
                out[1] += sin(d) / area;
            }
        }
    }
}

static void an_aberrated_spidered_aperture_is_its_autocorrelation(void **state) {
    (void)state;
    bst_camera camera = camera_of(BST_PSF_DIFFRACTION);
    camera.obscuration = 0.09;
    camera.optics.zernike_nm = 551.0;
    camera.optics.spiders = (bst_optics_spiders){.count = 3, .width_m = 0.002, .angle_deg = 17.0};
    double amounts[38] = {0};
    amounts[4] = 0.12, amounts[6] = -0.08, amounts[7] = 0.1, amounts[9] = 0.05, amounts[11] = 0.04;
    for (int j = 2; j <= 37; j++) {
        camera.optics.zernike_waves.waves[j - 2] = amounts[j];
    }
    bst_psf *psf = psf_of(&camera);
    const int shifts[][2] = {{70, 0},    {0, 210}, {-300, 140}, {433, 77}, {-11, -29},
                             {640, 640}, {28, -9}, {1000, 500}, {0, 0}};
    for (int k = 0; k < 9; k++) {
        double sx = shifts[k][0] / 1400.0, sy = shifts[k][1] / 1400.0, want[2], h[2];
        brute_otf(&camera, amounts, sx, sy, want);
        double fx = sx / 2.0, fy = sy / 2.0, pixel = sinc(fx) * sinc(fy);
        bst_psf_otf(psf, 0, fx, fy, h);
        /* the brute force's own outline: 1/1400 per edge cell, random: 1e-4 */
        bst_assert_close(h[0] / pixel, want[0], 3e-4);
        bst_assert_close(h[1] / pixel, want[1], 3e-4);
    }
    bst_psf_free(psf);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_gaussian_is_a_gaussian_with_a_pixel),
        cmocka_unit_test(moffat_profiles_have_closed_forms),
        cmocka_unit_test(a_steep_moffat_is_a_gaussian),
        cmocka_unit_test(the_clear_circle_has_its_closed_form),
        cmocka_unit_test(the_annulus_has_its_closed_form),
        cmocka_unit_test(noll_indices_and_polynomials_are_the_published_ones),
        cmocka_unit_test(keys_say_their_terms),
        cmocka_unit_test(zernike_terms_are_orthonormal),
        cmocka_unit_test(defocus_has_its_closed_form_on_the_axis),
        cmocka_unit_test(a_detector_out_of_focus_is_term_4),
        cmocka_unit_test(small_aberrations_have_marechals_strehl),
        cmocka_unit_test(tilt_moves_the_image),
        cmocka_unit_test(odd_aberrations_move_the_centroid),
        cmocka_unit_test(the_ends_of_a_band_count),
        cmocka_unit_test(an_aberrated_spidered_aperture_is_its_autocorrelation),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
