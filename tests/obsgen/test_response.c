/* The answer of a filter to images that it was not made for, against sums over pixels. */
#include "boresight/vec.h"
#include "obsgen/model/response.h"
#include "sim/optics/psf_image.h"
#include "tests/test_support.h"

static double pixel_share(double from, double sigma) {
    double s = sigma * sqrt(2.0);
    return 0.5 * (erf((from + 0.5) / s) - erf((from - 0.5) / s));
}

/* Mean over places in the pixel of sum p q, of Gaussians. */
static double product_of(double p, double q) {
    enum { PHASES = 8, REACH = 9 };
    double one_axis = 0.0;
    for (int k = 0; k < PHASES; k++) {
        double at = (k + 0.5) / PHASES - 0.5;
        for (int x = -REACH; x <= REACH; x++) {
            one_axis += pixel_share(x - at, p) * pixel_share(x - at, q) / PHASES;
        }
    }
    return one_axis * one_axis;
}

static void gaussians_of_other_widths_lose_by_their_product(void **state) {
    (void)state;
    const double filter = 0.85, sources[] = {0.85, 1.0, 1.31, 2.0};
    const bst_obsgen_path_px rest = {0.0, 0.0};
    for (int i = 0; i < 4; i++) {
        bst_response r;
        const bst_response_side s = {NULL, sources[i]}, f = {NULL, filter};
        bst_response_set(&r, &s, &f, 1, 0.0, 0.0);
        double expected = product_of(sources[i], filter) /
                          sqrt(product_of(sources[i], sources[i]) * product_of(filter, filter));
        /* 1/12 px^2 stands for the pixel: right to 0.2 % */
        bst_assert_close(bst_response_efficiency(&r, rest, rest), expected, 0.002);
        /* the same, widened from the filter's own width */
        const bst_response_side same = {NULL, filter};
        bst_response_set(&r, &same, &f, 1, 0.0, 0.0);
        r = bst_response_widened(&r, sources[i] * sources[i] - filter * filter);
        bst_assert_close(bst_response_efficiency(&r, rest, rest), expected, 0.002);
    }
    /* in binned pixels images are half as wide */
    bst_response r;
    const bst_response_side s = {NULL, 2.0}, f = {NULL, 1.4};
    bst_response_set(&r, &s, &f, 2, 0.0, 0.0);
    bst_assert_close(bst_response_efficiency(&r, rest, rest),
                     product_of(1.0, 0.7) / sqrt(product_of(1.0, 1.0) * product_of(0.7, 0.7)),
                     0.003);
}

typedef struct fine_image {
    int side, per_px;
    double *share;
} fine_image;

/* Mean over places of the sum of squares of an image that moved by `length` along x, and of its
 * gradients along x and y. */
static void squares_of(const fine_image *m, double length, double out[3]) {
    int half = (int)lround(0.5 * length * m->per_px);
    out[0] = out[1] = out[2] = 0.0;
    double *row = calloc((size_t)m->side * (size_t)m->side, sizeof *row);
    assert_non_null(row);
    for (int j = 0; j < m->side; j++) {
        for (int i = 0; i < m->side; i++) {
            for (int k = -half; k <= half; k++) {
                double weight = half > 0 ? (abs(k) == half ? 0.25 : 0.5) / half : 1.0;
                if (i - k >= 0 && i - k < m->side) {
                    row[j * m->side + i] += weight * m->share[j * m->side + i - k];
                }
            }
        }
    }
    double area = 1.0 / ((double)m->per_px * m->per_px), slope = 0.5 * m->per_px;
    for (int j = 1; j + 1 < m->side; j++) {
        for (int i = 1; i + 1 < m->side; i++) {
            const double *p = row + j * m->side + i;
            double gx = slope * (p[1] - p[-1]), gy = slope * (p[m->side] - p[-m->side]);
            out[0] += area * p[0] * p[0];
            out[1] += area * gx * gx;
            out[2] += area * gy * gy;
        }
    }
    free(row);
}

/* Sum of the products of an image with itself, moved by so many fine pixels. */
static double correlation(const fine_image *m, int dx, int dy) {
    double sum = 0.0;
    for (int j = dy; j < m->side; j++) {
        for (int i = dx; i < m->side; i++) {
            sum += m->share[j * m->side + i] * m->share[(j - dy) * m->side + i - dx];
        }
    }
    return sum / ((double)m->per_px * m->per_px);
}

static void a_psf_goes_by_its_own_image(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_camera camera = {.width_px = 512,
                         .height_px = 512,
                         .pixel_scale_arcsec = 2.0,
                         .aperture_m = 0.15,
                         .psf_fwhm_px = 2.0,
                         .optics = {.psf = BST_PSF_DIFFRACTION,
                                    .q = 2.2,
                                    .band_nm = {550.0, 551.0},
                                    .wavelengths = 1,
                                    .diffusion_px = 0.2,
                                    .zernike_nm = 550.0,
                                    .fill_factor = {1.0, 1.0},
                                    .field_columns = 1,
                                    .field_rows = 1}};
    bst_psf *psf;
    bst_assert_ok(&ctx, bst_psf_create(&ctx, &camera, &psf));
    bst_response r;
    const bst_response_side side = {psf, 0.0};
    bst_response_set(&r, &side, &side, 1, 255.5, 255.5);
    const bst_obsgen_path_px rest = {0.0, 0.0};
    /* King's area; the sum over frequencies is right to 0.3 % */
    double area = 4.0 * BST_PI * r.source.across_px * r.source.along_px;
    bst_assert_close(area, bst_psf_noise_area_px2(psf, 0), 0.003 * area);
    bst_assert_close(bst_response_efficiency(&r, rest, rest), 1.0, 1e-9);
    fine_image m = {.per_px = 4};
    enum { REACH = 20 };
    m.side = bst_psf_image_side(m.per_px, REACH);
    m.share = calloc((size_t)m.side * (size_t)m.side, sizeof *m.share);
    assert_non_null(m.share);
    bst_assert_ok(&ctx, bst_psf_image(&ctx, psf, 0, 0.0, m.per_px, REACH, m.share));
    double squares[3];
    squares_of(&m, 0.0, squares);
    /* differences over a quarter of a pixel are short by 2 % */
    double steep = sqrt(squares[1] * squares[2]) / squares[0];
    bst_assert_close(r.maxima_sigma_px, sqrt(0.5 / steep), 0.025 * r.maxima_sigma_px);
    for (double length = 3.0; length < 13.0; length += 3.0) {
        squares_of(&m, length, squares);
        double sigma = sqrt(r.source.across_px * r.source.along_px);
        bst_obsgen_path_px path = {length, 0.0};
        double plain = sqrt(bst_matched_product(path, path, sigma));
        /* two widths in the place of an Airy pattern: 1.5 %; one width is 3 to 5 % off */
        bst_assert_close(plain * bst_response_norm_ratio(&r, length), sqrt(squares[0]),
                         0.015 * plain);
        assert_true(plain > 1.025 * sqrt(squares[0]));
    }
    /* beside its place the output is the correlation of the image with itself, which falls off
     * faster than a Gaussian's of the same area */
    squares_of(&m, 0.0, squares);
    const int steps[][2] = {{4, 0}, {3, 3}, {8, 0}, {6, 6}, {14, 0}, {10, 10}};
    for (int n = 0; n < 6; n++) {
        double x = (double)steps[n][0] / m.per_px, y = (double)steps[n][1] / m.per_px;
        double expected = correlation(&m, steps[n][0], steps[n][1]) / squares[0];
        /* of the mean over the directions along the pixels and across them are 0.01 off */
        bst_assert_close(bst_response_falloff(&r, x, y, 0.0), expected, 0.012);
    }
    double sigma = sqrt(r.both.across_px * r.both.along_px);
    assert_true(bst_response_falloff(&r, 3.5, 0.0, 0.0) <
                bst_matched_falloff(3.5, 0.0, 0.0, sigma) - 0.01);
    bst_assert_close(bst_response_falloff(&r, 0.0, 0.0, 6.0), 1.0, 1e-6);
    /* faint light at a distance moves the maximum of the output by its weight */
    for (double far = 0.8; far < 3.0; far += 0.7) {
        const double light = 0.02;
        double best = 0.0, most = 0.0;
        for (double x = -0.1; x < 0.2; x += 1e-3) {
            /* outputs between the table's distances by the parabola about the maximum */
            double curve = 1.0 - bst_response_falloff(&r, 1.0 / BST_FALLOFF_PER_PX, 0.0, 0.0);
            double own = 1.0 - curve * x * x * BST_FALLOFF_PER_PX * BST_FALLOFF_PER_PX;
            double sum = own + light * bst_response_falloff(&r, far - x, 0.0, 0.0);
            best = sum > most ? x : best;
            most = fmax(most, sum);
        }
        /* linear pieces of the table: a twentieth */
        bst_assert_close(best / (light * far), bst_response_pull(&r, far), 0.06);
    }
    assert_true(bst_response_pull(&r, 2.9) < bst_response_falloff(&r, 2.9, 0.0, 0.0) - 0.015);
    free(m.share);
    bst_psf_free(psf);
}

/* A path that shakes widens a diffraction pattern as a Gaussian does: the core widens and rings
 * disappear, but wings keep their light. Truth: the OTF with the Gaussian's in it. */
static void wings_keep_their_light_when_widened(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_camera camera = {.width_px = 512,
                         .height_px = 512,
                         .pixel_scale_arcsec = 2.0,
                         .aperture_m = 0.15,
                         .psf_fwhm_px = 2.0,
                         .optics = {.psf = BST_PSF_DIFFRACTION,
                                    .q = 1.39,
                                    .central_obstruction = 0.3,
                                    .band_nm = {550.0, 551.0},
                                    .wavelengths = 1,
                                    .zernike_nm = 550.0,
                                    .fill_factor = {1.0, 1.0},
                                    .field_columns = 1,
                                    .field_rows = 1}};
    bst_psf *psf;
    bst_assert_ok(&ctx, bst_psf_create(&ctx, &camera, &psf));
    const bst_response_side sharp = {psf, 0.0}, filter = {psf, 0.3};
    bst_response base;
    bst_response_set(&base, &sharp, &filter, 1, 255.5, 255.5);
    /* the last two are wider than the tables, which are stretched there */
    /* the fitted PSF's slope and curvature are those of its values, within each piece of its table
     */
    const double h = 1e-3;
    for (double r = 0.03; r < 12.0; r += 0.29) {
        double slope, curvature, off[2];
        double middle = bst_response_model_share(&base, r, &slope, &curvature);
        double less = bst_response_model_share(&base, r - h, &off[0], &off[1]);
        double more = bst_response_model_share(&base, r + h, &off[0], &off[1]);
        bst_assert_close((more - less) / (2.0 * h), slope,
                         1e-5); /* h^2 times the third derivative */
        bst_assert_close((more - 2.0 * middle + less) / (h * h), curvature, 1e-3);
    }
    const double jitter_px[] = {0.2, 0.6, 0.95, 1.4, 3.0, 5.0};
    for (int k = 0; k < 6; k++) {
        const double v = jitter_px[k] * jitter_px[k];
        const bst_response_side shaken = {psf, jitter_px[k]};
        bst_response truth, twice = bst_response_widened(&base, 0.3 * v);
        bst_response_set(&truth, &shaken, &filter, 1, 255.5, 255.5);
        twice = bst_response_widened(&twice, 0.7 * v);
        for (double r = 0.5; r < 23.0; r += 0.5) {
            /* interpolation: 1e-4 of the peak, where wings have 1e-3 to 1e-2 of it; stretched
             * tables keep the share of the wings: up to 1e-2 */
            bst_assert_close(bst_response_falloff(&twice, r, 0.0, 0.0),
                             bst_response_falloff(&truth, r, 0.0, 0.0), k < 4 ? 1e-4 : 1e-2);
        }
    }
    bst_psf_free(psf);
}

static double sinc(double x) {
    return x == 0.0 ? 1.0 : sin(BST_PI * x) / (BST_PI * x);
}

/* A Gaussian PSF by its OTF, in pixels of b x b sensor pixels: there it is a Gaussian of sigma / b
 * on a whole pixel, whose products are sums of error functions. */
static void binned_pixels_have_their_own_products(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_camera camera = {.width_px = 64,
                         .height_px = 64,
                         .pixel_scale_arcsec = 2.0,
                         .aperture_m = 0.1,
                         .psf_fwhm_px = 2.8};
    const double sigma = 2.8 / 2.3548200450309493, more = 0.9, wide = hypot(sigma, more);
    bst_psf *psf;
    bst_assert_ok(&ctx, bst_psf_create(&ctx, &camera, &psf));
    const bst_response_side source = {psf, more}, filter = {psf, 0.0};
    for (int b = 1; b <= 4; b *= 2) {
        bst_response r;
        bst_response_set(&r, &source, &filter, b, 31.5, 31.5);
        const bst_obsgen_image_width *const widths[3] = {&r.source, &r.filter, &r.both};
        const double want[3] = {product_of(wide / b, wide / b), product_of(sigma / b, sigma / b),
                                product_of(wide / b, sigma / b)};
        for (int k = 0; k < 3; k++) {
            double area = 4.0 * BST_PI * widths[k]->across_px * widths[k]->along_px;
            bst_assert_close(area * want[k], 1.0, 0.003); /* steps of the sums, eight phases */
        }
        bst_response_nodes nodes;
        bst_response_nodes_at(&source, 31.5, 31.5, &nodes);
        for (int k = 0; k < 9; k++) {
            double fx = 0.1 * (k % 3), fy = 0.07 * (k / 3), otf[2];
            bst_response_otf(&source, &nodes, b, fx, fy, otf);
            double blur = exp(-2.0 * BST_PI * BST_PI * wide * wide * (fx * fx + fy * fy));
            bst_assert_close(otf[0], blur * sinc(b * fx) * sinc(b * fy), 1e-9);
            bst_assert_close(otf[1], 0.0, 1e-12);
        }
    }
    bst_psf_free(psf);
}

/* Products depend on the paths' lengths and the angle between them alone; where the longer one is
 * straight along x, the width along it counts along x. */
static void products_turn_with_the_paths(void **state) {
    (void)state;
    const bst_obsgen_image_width w = {0.8, 1.1};
    const bst_obsgen_path_px p = {6.0, 0.0}, q = {2.0, 1.0};
    /* by sums: Gaussians of variance 2 x 1.1^2 and 2 x 0.8^2 for the difference of two places */
    enum { PARTS = 200 };
    double sum = 0.0;
    for (int i = 0; i < PARTS; i++) {
        for (int k = 0; k < PARTS; k++) {
            double u = (i + 0.5) / PARTS - 0.5, v = (k + 0.5) / PARTS - 0.5;
            double x = u * p.dx - v * q.dx, y = u * p.dy - v * q.dy;
            sum += exp(-0.25 * (x * x / (1.1 * 1.1) + y * y / (0.8 * 0.8))) /
                   (4.0 * BST_PI * 1.1 * 0.8) / PARTS / PARTS;
        }
    }
    double straight = bst_response_product(&w, p, q);
    bst_assert_close(straight / sum, 1.0, 4e-3); /* bst_matched_product takes sums itself */
    for (int n = 1; n < 12; n++) {
        double c = cos(0.5 * n), s = sin(0.5 * n);
        const bst_obsgen_path_px a = {c * p.dx - s * p.dy, s * p.dx + c * p.dy};
        const bst_obsgen_path_px b = {c * q.dx - s * q.dy, s * q.dx + c * q.dy};
        bst_assert_close(bst_response_product(&w, a, b) / straight, 1.0, 1e-12);
        bst_assert_close(bst_response_product(&w, b, a) / straight, 1.0, 1e-12);
    }
}

/* Mean over all directions of the image of a point at a distance: a Gaussian over a pixel. */
static double share_at(double distance, double sigma) {
    enum { WAYS = 48 };
    double sum = 0.0;
    for (int k = 0; k < WAYS; k++) {
        double angle = 2.0 * BST_PI * (k + 0.3) / WAYS;
        sum += pixel_share(distance * cos(angle), sigma) *
               pixel_share(distance * sin(angle), sigma) / WAYS;
    }
    return sum;
}

/* The same of the product with another image, by its own sum over pixels and phases. */
static double product_at(double distance, double p, double q) {
    enum { WAYS = 24, PHASES = 6, REACH = 9 };
    double sum = 0.0;
    for (int k = 0; k < WAYS; k++) {
        double angle = 0.5 * BST_PI * (k + 0.3) / WAYS;
        const double by[2] = {distance * cos(angle), distance * sin(angle)};
        double both = 1.0;
        for (int axis = 0; axis < 2; axis++) {
            double one = 0.0;
            for (int n = 0; n < PHASES; n++) {
                double at = (n + 0.5) / PHASES - 0.5;
                for (int x = -REACH; x <= REACH; x++) {
                    one += pixel_share(x - at, p) * pixel_share(x - at - by[axis], q) / PHASES;
                }
            }
            both *= one;
        }
        sum += both / WAYS;
    }
    return sum;
}

/* Images of a point by the source and by the filter, which differ, in binned pixels, and widened
 * ones; their widths and the falloff of their product. */
static void images_of_a_point_have_their_values(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_camera camera = {.width_px = 64,
                         .height_px = 48,
                         .pixel_scale_arcsec = 2.0,
                         .aperture_m = 0.1,
                         .psf_fwhm_px = 2.8};
    const double sigma = 2.8 / 2.3548200450309493, more = 0.9, wide = hypot(sigma, more);
    bst_psf *psf;
    bst_assert_ok(&ctx, bst_psf_create(&ctx, &camera, &psf));
    const bst_response_side source = {psf, more}, filter = {psf, 0.0};
    for (int b = 1; b <= 2; b++) {
        bst_response r;
        bst_response_set(&r, &source, &filter, b, 31.5, 23.5);
        bst_response widened = bst_response_widened(&r, 0.7);
        const double after = sqrt(wide * wide / b / b + 0.7);
        const double peak = product_at(0.0, wide / b, sigma / b);
        for (double d = 0.0; d < 5.0; d += 0.37) {
            double slope, curvature;
            /* cubic pieces of tables in single precision */
            bst_assert_close(bst_response_model_share(&r, d, &slope, &curvature),
                             share_at(d, sigma / b), 2e-4);
            bst_assert_close(bst_response_image_share(&r, d), share_at(d, wide / b), 2e-4);
            bst_assert_close(bst_response_image_share(&widened, d), share_at(d, after), 4e-4);
            /* linear ones */
            bst_assert_close(bst_response_falloff(&r, d, 0.0, 0.0),
                             product_at(d, wide / b, sigma / b) / peak, 4e-3);
        }
        bst_assert_close(r.nearest_sigma_px, sigma / b, 1e-3);
        /* curvature of the filter's product with itself: by differences */
        double h = 0.25, same = product_at(0.0, sigma / b, sigma / b),
               curve = 2.0 * (same - product_at(h, sigma / b, sigma / b)) / (h * h) / same;
        bst_assert_close(r.maxima_sigma_px, sqrt(0.5 / curve), 0.015 * r.maxima_sigma_px);
    }
    bst_psf_free(psf);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(images_of_a_point_have_their_values),
        cmocka_unit_test(binned_pixels_have_their_own_products),
        cmocka_unit_test(products_turn_with_the_paths),
        cmocka_unit_test(gaussians_of_other_widths_lose_by_their_product),
        cmocka_unit_test(a_psf_goes_by_its_own_image),
        cmocka_unit_test(wings_keep_their_light_when_widened),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
