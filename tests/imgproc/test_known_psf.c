/* The PSF that is known on board: its images against the Fourier sum and against a Gaussian's, and
 * what image processing makes of frames that have it. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "imgproc/detect/low_rank.h"
#include "imgproc/measure/sharpness.h"
#include "imgproc/measure/source_profile.h"
#include "sim/core/simd.h"
#include "sim/optics/psf_image.h"
#include "tests/imgproc/synthetic.h"
#include "tests/test_support.h"

enum { SENSOR = 256, SIDE = 64, PER_PX = 8, REACH_PX = 10, IMAGE = 2 * PER_PX * REACH_PX + 1 };

/* A telescope's PSF with vanes and aberrations that turn over from one corner to the next. */
static const bst_psf_field_node corners[4] = {
    {.zernike_waves.waves[5 - 2] = 0.06, .zernike_waves.waves[7 - 2] = -0.05},
    {.zernike_waves.waves[5 - 2] = -0.06, .zernike_waves.waves[7 - 2] = -0.05},
    {.zernike_waves.waves[5 - 2] = -0.06, .zernike_waves.waves[7 - 2] = 0.05},
    {.zernike_waves.waves[5 - 2] = 0.06, .zernike_waves.waves[7 - 2] = 0.05},
};

static bst_camera telescope(int size) {
    bst_camera camera = {.width_px = size,
                         .height_px = size,
                         .pixel_scale_arcsec = 3.0,
                         .aperture_m = 0.15,
                         .psf_fwhm_px = 2.0,
                         .optics = {.psf = BST_PSF_DIFFRACTION,
                                    .q = 1.6,
                                    .band_nm = {450.0, 850.0},
                                    .wavelengths = 4,
                                    .central_obstruction = 0.35,
                                    .spiders = {.count = 4, .width_m = 0.003, .angle_deg = 28.0},
                                    .diffusion_px = 0.15,
                                    .field_columns = 2,
                                    .field_rows = 2}};
    camera.optics.field.items = (void *)corners;
    camera.optics.field.count = 4;
    return camera;
}

static bst_psf *psf_of(const bst_camera *camera) {
    bst_ctx ctx = {0};
    bst_psf *psf;
    bst_assert_ok(&ctx, bst_psf_create(&ctx, camera, &psf));
    return psf;
}

/* The PSF of telescope(SENSOR), made once: it takes most of the time of this program. */
static bst_psf *telescope_psf(void) {
    static bst_psf *psf;
    if (!psf) {
        const bst_camera camera = telescope(SENSOR);
        psf = psf_of(&camera);
    }
    return psf;
}

static void low_rank_finds_the_products_of_an_image(void **state) {
    (void)state;
    enum { N = 12 };
    double image[N * N], down[5 * N], across[5 * N], work[5 * N];
    for (int j = 0; j < N; j++) {
        for (int i = 0; i < N; i++) {
            image[j * N + i] = exp(-0.1 * (i - 5) * (i - 5)) * cos(0.3 * j) + 0.01 * i * j * j;
        }
    }
    /* a sum of two products is no more than two */
    const bst_low_rank_images images = {image, 1, N};
    assert_int_equal(bst_low_rank(&images, 5, 1e-12, down, across, work), 2);
    assert_int_equal(bst_low_rank(&images, 5, 0.9, down, across, work), 1);
    int terms = bst_low_rank(&images, 5, 1e-12, down, across, work);
    for (int k = 0; k < N * N; k++) {
        double sum = 0.0;
        for (int t = 0; t < terms; t++) {
            sum += down[t * N + k / N] * across[t * N + k % N];
        }
        bst_assert_close(sum, image[k], 1e-12 * 200.0); /* rounding; the largest is 17 */
    }
}

typedef struct rendered {
    bst_imgproc_gauss psf;
    bst_source_profiles profiles;
    float *scratch;
    float planes[BST_IMAGE_MOTION_PLANES * SIDE * SIDE];
} rendered;

static rendered *open_rendered(const bst_known_psf *known) {
    bst_ctx ctx = {0};
    rendered *r = calloc(1, sizeof *r);
    assert_non_null(r);
    bst_imgproc_gauss_init(&r->psf);
    bst_assert_ok(&ctx, bst_source_profiles_create(&ctx, known, &r->profiles));
    r->scratch = calloc(bst_source_profile_scratch(SIDE), sizeof(float));
    assert_non_null(r->scratch);
    return r;
}

static void close_rendered(rendered *r) {
    bst_source_profiles_free(&r->profiles);
    free(r->scratch);
    free(r);
}

/* The general code on a PSF for which there is another: planes, binning and streaks. */
static void a_known_gaussian_has_a_gaussians_images(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_camera camera = telescope(256);
    camera.optics = (bst_optics_config){.psf = BST_PSF_GAUSSIAN};
    bst_psf *psf = psf_of(&camera);
    bst_known_psf *known;
    double jitter = 0.3, sigma = hypot(2.0 / 2.3548200450309493, jitter);
    bst_assert_ok(&ctx, bst_known_psf_create(&ctx, psf, 256.0, 256.0, jitter, &known));
    assert_int_equal(known->terms, 1);
    bst_assert_close(known->sigma_px, sigma, 0.02); /* the search's last interval is 1 % */
    rendered *got = open_rendered(known);
    const bst_imgproc_shape shapes[3] = {
        {.x_px = 30.31, .y_px = 20.77},
        {.x_px = 31.0, .y_px = 22.4, .dx_px = 9.0, .dy_px = -4.0},
        {.x_px = 29.5, .y_px = 24.5, .dx_px = 3.0, .dy_px = 7.0, .bend_x_px = 0.4}};
    double want[4][SIDE * SIDE];
    for (int binning = 1; binning <= 2; binning++) {
        for (int k = 0; k < 3; k++) {
            bst_imgproc_stamp stamp = {16, 8, 29, 32};
            bst_imgproc_shape shape = shapes[k];
            shape.sigma_px = sigma / binning;
            bst_source_profiles_on(&got->profiles, 0.0, 0.0, binning);
            bst_source_profiles_set(&got->profiles, &got->psf, shape.sigma_px);
            bst_source_profile_render(&got->profiles, &got->psf, &shape, &stamp, got->scratch,
                                      got->planes);
            bst_imgproc_gauss_render(&got->psf, &shape, &stamp, want[0], want[1], want[2], want[3]);
            int stride = bst_simd_layout_round_up(stamp.width);
            for (int part = 0; part < 4; part++) {
                double peak = 0.0, worst = 0.0;
                for (int i = 0; i < stamp.width * stamp.height; i++) {
                    int at = i / stamp.width * stride + i % stamp.width;
                    double e = want[part][i];
                    double g = (double)got->planes[part * stride * stamp.height + at];
                    peak = fmax(peak, fabs(e));
                    worst = fmax(worst, fabs(g - e));
                }
                /* as test_source_profile.c allows the Gaussian's own code */
                double allowed = part == 0 ? 2e-4 : part < 3 ? 1e-3 : 4e-3;
                if (!(worst <= allowed * peak)) {
                    fail_msg("binning %d, shape %d, part %d: %g of the peak", binning, k, part,
                             worst / peak);
                }
            }
        }
    }
    close_rendered(got);
    bst_known_psf_free(known);
    bst_psf_free(psf);
}

/* The sharpness test of binned pixels is that of these pixels, also if the frame before had another
 * binning and the same least sigma: a frame's result does not depend on earlier frames. */
static void sharpness_follows_the_binning(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_psf *psf = telescope_psf();
    bst_known_psf *known;
    bst_assert_ok(&ctx, bst_known_psf_create(&ctx, psf, SENSOR, SENSOR, 0.0, &known));
    bst_imgproc_gauss *gauss = malloc(sizeof *gauss);
    assert_non_null(gauss);
    bst_imgproc_gauss_init(gauss);
    bst_sharpness fresh = {0}, after = {0};
    bst_sharpness_set(&fresh, gauss, known, 4, 0.2);
    bst_sharpness_set(&after, gauss, known, 2, 0.2);
    assert_true(after.ratio[1][2] != fresh.ratio[1][2]);
    bst_sharpness_set(&after, gauss, known, 4, 0.2);
    assert_memory_equal(after.ratio, fresh.ratio, sizeof fresh.ratio);
    assert_memory_equal(after.floor, fresh.floor, sizeof fresh.floor);
    free(gauss);
    bst_known_psf_free(known);
}

/* Two opposite neighbours give the light of the pixel between them, in each of four directions, for
 * an image that is longer along a slant: what they hold are shares of the PSF in their places. */
static void neighbours_of_a_slanting_image(void **state) {
    (void)state;
    static const int way[4][2] = {{1, 0}, {0, 1}, {1, 1}, {-1, 1}};
    bst_ctx ctx = {0};
    bst_camera camera = telescope(SENSOR);
    camera.optics.field_columns = camera.optics.field_rows = 0;
    camera.optics.field.count = 0;
    camera.optics.spiders.count = 0;
    camera.optics.wavelengths = 1;
    camera.optics.zernike_waves.waves[4 - 2] = 0.12; /* out of focus and astigmatic: a line */
    camera.optics.zernike_waves.waves[5 - 2] = 0.04;
    camera.optics.zernike_waves.waves[6 - 2] = 0.1;
    bst_psf *psf = psf_of(&camera);
    bst_known_psf *known;
    bst_assert_ok(&ctx, bst_known_psf_create(&ctx, psf, SENSOR, SENSOR, 0.0, &known));
    bst_imgproc_gauss *gauss = malloc(sizeof *gauss);
    assert_non_null(gauss);
    bst_imgproc_gauss_init(gauss);
    for (int binning = 1; binning <= 2; binning++) {
        bst_sharpness sharp = {0};
        bst_sharpness_set(&sharp, gauss, known, binning, known->sigma_px / binning);
        double light[4], most = 0.0, least = 1.0;
        for (int g = 0; g < 4; g++) {
            light[g] = bst_known_psf_share(known, known->nodes, binning, way[g][0], way[g][1]) +
                       bst_known_psf_share(known, known->nodes, binning, -way[g][0], -way[g][1]);
            most = g < 2 ? fmax(most, light[g]) : most;
            least = g < 2 ? fmin(least, light[g]) : least;
        }
        double own = bst_known_psf_share(known, known->nodes, binning, 0.0, 0.0);
        assert_true(most > 1.3 * least && fabs(light[2] / light[3] - 1.0) > 0.1);
        for (int g = 0; g < 4; g++) {
            bst_assert_close((double)sharp.factor[g + 1] * light[g], own, 2e-7 * own);
        }
    }
    free(gauss);
    bst_known_psf_free(known);
    bst_psf_free(psf);
}

/* Against the sum that defines the image, at a corner of the field and where all four mix. */
static void images_are_those_of_the_place_in_the_field(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_psf *psf = telescope_psf();
    bst_known_psf *known;
    bst_assert_ok(&ctx, bst_known_psf_create(&ctx, psf, SENSOR, SENSOR, 0.0, &known));
    double *image = malloc(4 * sizeof *image * IMAGE * IMAGE);
    assert_non_null(image);
    for (int n = 0; n < 4; n++) {
        bst_assert_ok(&ctx, bst_psf_image(&ctx, psf, n, 0.0, PER_PX, REACH_PX,
                                          image + (size_t)n * IMAGE * IMAGE));
    }
    /* least squares of a Gaussian's flux to the mean image of the field */
    double both = 0.0, gauss = 0.0, root = known->sigma_px * sqrt(2.0);
    for (int i = 0; i < 19 * 19; i++) {
        int x = i % 19 - 9, y = i / 19 - 9;
        double p = 0.0, g = 0.25 * (erf((x + 0.5) / root) - erf((x - 0.5) / root)) *
                            (erf((y + 0.5) / root) - erf((y - 0.5) / root));
        for (int n = 0; n < 4; n++) {
            p += 0.25 *
                 image[(n * IMAGE + (y + REACH_PX) * PER_PX) * IMAGE + (x + REACH_PX) * PER_PX];
        }
        both += p * g;
        gauss += g * g;
    }
    bst_assert_close(known->like_flux, both / gauss, 0.003); /* the decomposition: 1e-4 of energy */
    rendered *got = open_rendered(known);
    bst_source_profiles_on(&got->profiles, 0.0, 0.0, 1);
    bst_source_profiles_set(&got->profiles, &got->psf, known->sigma_px);
    /* places on the grid of the samples; the middle's are half a sample from equal shares */
    const double place[2][2] = {{2.25, 1.5}, {127.5, 127.5}};
    for (int k = 0; k < 2; k++) {
        bst_imgproc_shape shape = {
            .x_px = place[k][0], .y_px = place[k][1], .sigma_px = known->sigma_px};
        bst_imgproc_stamp stamp = {(int)shape.x_px - 6, (int)shape.y_px - 6, 13, 13};
        bst_source_profile_render(&got->profiles, &got->psf, &shape, &stamp, got->scratch,
                                  got->planes);
        int node[4],
            n = bst_psf_weights(psf, shape.x_px, shape.y_px, node, (double[4]){0.0, 0.0, 0.0, 0.0});
        double weight[4], missed = 0.0, all = 0.0;
        n = bst_psf_weights(psf, shape.x_px, shape.y_px, node, weight);
        for (int i = 0; i < 13 * 13; i++) {
            int u = (int)lround((stamp.x0 + i % 13 - shape.x_px + REACH_PX) * PER_PX);
            int v = (int)lround((stamp.y0 + i / 13 - shape.y_px + REACH_PX) * PER_PX);
            double want = 0.0;
            for (int m = 0; m < n; m++) {
                want +=
                    weight[m] * image[((size_t)node[m] * IMAGE + (size_t)v) * IMAGE + (size_t)u];
            }
            double g = (double)got->planes[i / 13 * bst_simd_layout_round_up(13) + i % 13];
            missed += (g - want) * (g - want);
            all += want * want;
        }
        /* the header's bound, in the mean over places in the pixel; a single one: three times */
        assert_true(missed < 3e-4 * all);
    }
    close_rendered(got);
    free(image);
    bst_known_psf_free(known);
}

/* Share of a source's light with a changed path, on the stamp. */
static void render_changed(rendered *r, const bst_imgproc_shape *shape,
                           const bst_imgproc_stamp *stamp, const double change_px[4],
                           float *share) {
    bst_imgproc_shape changed = *shape;
    changed.dx_px += change_px[0];
    changed.dy_px += change_px[1];
    changed.bend_x_px += change_px[2];
    changed.bend_y_px += change_px[3];
    bst_source_profile_render(&r->profiles, &r->psf, &changed, stamp, r->scratch, r->planes);
    int n = bst_simd_layout_round_up(stamp->width) * stamp->height;
    memcpy(share, r->planes, (size_t)n * sizeof *share);
}

/* The derivatives by the motion of all streaks, from which image processing measures the motion,
 * are those of the known PSF's images: against central differences. */
static void derivatives_by_motion_are_those_of_the_images(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_psf *psf = telescope_psf();
    bst_known_psf *known;
    bst_assert_ok(&ctx, bst_known_psf_create(&ctx, psf, SENSOR, SENSOR, 0.14, &known));
    assert_true(known->terms > 1);
    rendered *got = open_rendered(known), *other = open_rendered(known);
    const bst_imgproc_stamp stamp = {100, 40, 18, 22};
    const bst_imgproc_shape shape = {.x_px = 108.3,
                                     .y_px = 50.6,
                                     .dx_px = 1.3,
                                     .dy_px = 7.8,
                                     .bend_x_px = -0.1,
                                     .bend_y_px = -0.2,
                                     .sigma_px = known->sigma_px};
    const double length = hypot(1.3, 7.8), ux = 1.3 / length, uy = 7.8 / length, h = 0.05;
    const double along[2] = {ux, uy};
    const struct {
        int plane;
        double step[4];
    } by[3] = {{BST_IMAGE_BY_LENGTH, {h * ux, h * uy, 0.0, 0.0}},
               {BST_IMAGE_BY_ACROSS, {-h * uy, h * ux, 0.0, 0.0}},
               {BST_IMAGE_BY_BEND, {0.0, 0.0, h * ux, h * uy}}};
    bst_source_profiles_set(&got->profiles, &got->psf, shape.sigma_px);
    bst_source_profiles_set(&other->profiles, &other->psf, shape.sigma_px);
    bst_source_profile_render_motion(&got->profiles, &got->psf, &shape, &stamp, along, got->scratch,
                                     got->planes);
    float share[2][SIDE * SIDE];
    int stride = bst_simd_layout_round_up(stamp.width), n = stride * stamp.height;
    for (int k = 0; k < 3; k++) {
        double back[4], peak = 0.0, worst = 0.0;
        for (int i = 0; i < 4; i++) {
            back[i] = -by[k].step[i];
        }
        render_changed(other, &shape, &stamp, by[k].step, share[0]);
        render_changed(other, &shape, &stamp, back, share[1]);
        for (int i = 0; i < n; i++) {
            double want = ((double)share[0][i] - (double)share[1][i]) / (2.0 * h);
            bool inside = i % stride < stamp.width;
            peak = fmax(peak, inside ? fabs(want) : 0.0);
            worst =
                fmax(worst, inside ? fabs((double)got->planes[by[k].plane * n + i] - want) : 0.0);
        }
        /* the differences' own error is (h / 0.7 px)^2 / 6, 0.1 %; the profiles' interpolation */
        bst_assert_close(worst, 0.0, 0.01 * peak);
    }
    close_rendered(got);
    close_rendered(other);
    bst_known_psf_free(known);
}

/* Sources of SNR 30 to 150 all over a frame without noise: places and light that come back. */
static void places_and_light_are_right(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    enum { CELL = 32, COUNT = (SENSOR / CELL) * (SENSOR / CELL) };
    synthetic s;
    synthetic_init(&s, SENSOR, SENSOR);
    bst_psf *psf = telescope_psf();
    double *image = malloc(4 * sizeof *image * IMAGE * IMAGE);
    assert_non_null(image);
    for (int n = 0; n < 4; n++) {
        bst_assert_ok(&ctx, bst_psf_image(&ctx, psf, n, 0.0, PER_PX, REACH_PX,
                                          image + (size_t)n * IMAGE * IMAGE));
    }
    double x[COUNT], y[COUNT], flux[COUNT];
    bst_rng_key key = bst_rng_make_key(11, 0, "test", "known psf");
    synthetic_clear(&s);
    for (int k = 0; k < COUNT; k++) {
        x[k] = k % (SENSOR / CELL) * CELL + 12.0 +
               floor(8.0 * PER_PX * bst_rng_uniform(key, (uint64_t)k, 0)) / PER_PX;
        y[k] = k / (SENSOR / CELL) * CELL + 12.0 +
               floor(8.0 * PER_PX * bst_rng_uniform(key, (uint64_t)k, 1)) / PER_PX;
        flux[k] = 2000.0 * pow(5.0, bst_rng_uniform(key, (uint64_t)k, 2));
        int node[4];
        double weight[4];
        int n = bst_psf_weights(psf, x[k], y[k], node, weight);
        for (int j = (int)ceil(y[k]) - REACH_PX; j <= (int)floor(y[k]) + REACH_PX; j++) {
            for (int i = (int)ceil(x[k]) - REACH_PX; i <= (int)floor(x[k]) + REACH_PX; i++) {
                int u = (int)lround((i - x[k] + REACH_PX) * PER_PX);
                int v = (int)lround((j - y[k] + REACH_PX) * PER_PX);
                for (int m = 0; m < n && u >= 0 && v >= 0 && u < IMAGE && v < IMAGE; m++) {
                    s.mean_e[j * SENSOR + i] +=
                        flux[k] * weight[m] *
                        image[((size_t)node[m] * IMAGE + (size_t)v) * IMAGE + (size_t)u];
                }
            }
        }
    }
    synthetic_expose(&s, key, 0);
    bst_imgproc_maps maps = {.psf = psf};
    bst_imgproc *ip;
    bst_detections *found = synthetic_detections(1000);
    bst_imgproc_frame frame = synthetic_frame(&s);
    bst_assert_ok(&ctx, bst_imgproc_create(&ctx, &s.camera, 1e6, &s.config, &maps, &ip));
    bst_assert_ok(&ctx, bst_imgproc_detect(&ctx, ip, &frame, NULL, found, 1000));
    assert_true(synthetic_sound(found));
    double chi2[2] = {0.0}, off = 0.0, off_weight = 0.0;
    for (int k = 0; k < COUNT; k++) {
        int d = synthetic_nearest(found, x[k], y[k], 1.0);
        assert_true(d >= 0);
        const bst_detection *item = &found->items[d];
        chi2[0] += (item->x_px - x[k]) * (item->x_px - x[k]) / item->cov_xx +
                   (item->y_px - y[k]) * (item->y_px - y[k]) / item->cov_yy;
        double e = (item->flux_e - flux[k]) / item->flux_sigma_e;
        chi2[1] += e * e;
        off += (item->flux_e / flux[k] - 1.0) * pow(flux[k] / item->flux_sigma_e, 2.0);
        off_weight += pow(flux[k] / item->flux_sigma_e, 2.0);
    }
    /* chi-square of 2 x 64 and 64 degrees of freedom: within four deviations of the mean */
    bst_assert_close(chi2[0] / (2.0 * COUNT), 1.0, 4.0 * sqrt(2.0 / (2.0 * COUNT)));
    bst_assert_close(chi2[1] / COUNT, 1.0, 4.0 * sqrt(2.0 / COUNT));
    /* a mean of 64 fluxes, each good to a percent or three: a Gaussian is 10 % and more off */
    bst_assert_close(off / off_weight, 0.0, 4.0 / sqrt(off_weight));
    assert_true(4.0 / sqrt(off_weight) < 0.01);
    bst_imgproc_free(ip);
    free(found);
    free(image);
    synthetic_free(&s);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(low_rank_finds_the_products_of_an_image),
        cmocka_unit_test(a_known_gaussian_has_a_gaussians_images),
        cmocka_unit_test(sharpness_follows_the_binning),
        cmocka_unit_test(neighbours_of_a_slanting_image),
        cmocka_unit_test(images_are_those_of_the_place_in_the_field),
        cmocka_unit_test(derivatives_by_motion_are_those_of_the_images),
        cmocka_unit_test(places_and_light_are_right),
    };
    int failed = 0;
    for (int width = 4; width <= 16; width *= 2) { /* of vectors, where the processor has them */
        bst_simd_limit(width);
        failed += cmocka_run_group_tests(tests, NULL, NULL);
    }
    bst_psf_free(telescope_psf());
    return failed;
}
