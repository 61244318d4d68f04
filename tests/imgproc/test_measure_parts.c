/* Parts of the measurement of sources, each against another way: stamps, neighbours by looking at
 * every pair, charge, order on the sensor, errors of places at the filter's peak. */
#include "boresight/vec.h"
#include "imgproc/measure/cosmic_ray.h"
#include "imgproc/measure/deblend.h"
#include "imgproc/measure/peak_centroid.h"
#include "imgproc/measure/sensor_order.h"
#include "tests/test_support.h"

static double draw(uint64_t *state) {
    *state = *state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return ((double)(*state >> 11) + 0.5) * 0x1p-53;
}

/* Pixels whose centres are within the reach of the path, cut to the frame and to the largest side.
 */
static void stamps(void **state) {
    (void)state;
    uint64_t seed = 5;
    int cut = 0, limited = 0;
    for (int round = 0; round < 3000; round++) {
        const double reach = 3.0 + floor(6 * draw(&seed));
        const int width = 90, height = 70, side = 32;
        bst_imgproc_source s = {.shape = {.x_px = 110 * draw(&seed) - 10,
                                          .y_px = 90 * draw(&seed) - 10,
                                          .dx_px = 50 * draw(&seed) - 25,
                                          .dy_px = 50 * draw(&seed) - 25,
                                          .bend_x_px = 4 * draw(&seed) - 2,
                                          .bend_y_px = 4 * draw(&seed) - 2}};
        bst_imgproc_stamp stamp = bst_fit_stamp(&s, reach, side, width, height);
        double r[2] = {fabs(s.shape.dx_px) / 2 + fabs(s.shape.bend_x_px) + reach,
                       fabs(s.shape.dy_px) / 2 + fabs(s.shape.bend_y_px) + reach};
        const double at[2] = {s.shape.x_px, s.shape.y_px};
        const int size[2] = {width, height}, first[2] = {stamp.x0, stamp.y0},
                  count[2] = {stamp.width, stamp.height};
        for (int a = 0; a < 2; a++) {
            limited += r[a] > 15;
            r[a] = r[a] > 15 ? 15 : r[a];
            int low = 0, n = 0;
            for (int p = size[a] - 1; p >= 0; p--) {
                /* a pixel reaches half a pixel beyond its centre */
                if (p - at[a] > -r[a] - 0.5 && p - at[a] <= r[a] + 0.5) {
                    low = p;
                    n++;
                }
            }
            cut += n < (int)(2 * r[a]);
            assert_int_equal(count[a], n);
            if (n > 0) {
                assert_int_equal(first[a], low);
            }
        }
    }
    assert_true(cut > 500 && limited > 500);
}

typedef struct bench {
    bst_imgproc_locator l;
    bst_locate_frame f;
} bench;

enum { WIDTH = 120, HEIGHT = 90, MOST = 80 };

static void open_bench(bench *b) {
    bst_ctx ctx = {0};
    const bst_imgproc_locator_limits limits = {
        .threads = 1, .capacity = MOST, .max_width = WIDTH, .max_height = HEIGHT, .max_side = 64};
    memset(b, 0, sizeof *b);
    bst_assert_ok(&ctx, bst_imgproc_locator_create(&ctx, NULL, &limits, &b->l));
    b->f = (bst_locate_frame){.width = WIDTH, .height = HEIGHT, .excess = 1.0, .sigma_px = 0.9};
}

/* Sources with stamps that share pixels: free if centred on the stamp, else fixed, brightest first.
 */
static void neighbours(void **state) {
    (void)state;
    bench b;
    uint64_t seed = 8;
    int most_free = 0, most_fixed = 0;
    open_bench(&b);
    for (int round = 0; round < 60; round++) {
        b.l.count = 5 + (int)((MOST - 5) * draw(&seed));
        b.l.longest_px = 0;
        for (int i = 0; i < b.l.count; i++) {
            bst_imgproc_found *q = &b.l.found[i];
            *q =
                (bst_imgproc_found){.peak_x = (int)(WIDTH * draw(&seed)),
                                    .peak_y = (int)(HEIGHT * draw(&seed)),
                                    .dropped = draw(&seed) < 0.1,
                                    .label = draw(&seed) < 0.1 ? BST_LABEL_HIT : BST_LABEL_UNKNOWN};
            q->source.shape = (bst_imgproc_shape){.x_px = q->peak_x + draw(&seed) - 0.5,
                                                  .y_px = q->peak_y + draw(&seed) - 0.5,
                                                  .dx_px = i % 4 ? 0 : 14 * draw(&seed) - 7,
                                                  .dy_px = i % 4 ? 0 : 14 * draw(&seed) - 7,
                                                  .sigma_px = 0.9};
            b.l.longest_px = fmax(
                b.l.longest_px, fmax(fabs(q->source.shape.dx_px), fabs(q->source.shape.dy_px)) / 2);
        }
        bst_deblend_index(&b.l, &b.f);
        double reach = bst_deblend_reach(&b.f);
        bst_assert_close(reach, 4, 0); /* 3.6 sigma, whole pixels, at least 3 */
        for (int i = 0; i < b.l.count; i++) {
            const bst_imgproc_source *own = &b.l.found[i].source;
            bst_imgproc_stamp s = bst_deblend_stamp(&b.l, &b.f, own);
            bst_deblend out;
            bst_deblend_gather(&b.l, &b.f, i, own, &s, &out);
            int free_count = 1, fixed_count = 0, listed = 0;
            assert_ptr_equal(out.free[0], own);
            for (int k = 0; k < b.l.count; k++) {
                const bst_imgproc_found *q = &b.l.found[k];
                bst_imgproc_stamp o = bst_fit_stamp(&q->source, reach, 64, WIDTH, HEIGHT);
                bool shares = false;
                for (int y = o.y0; y < o.y0 + o.height && !shares; y++) {
                    for (int x = o.x0; x < o.x0 + o.width && !shares; x++) {
                        shares =
                            x >= s.x0 && y >= s.y0 && x < s.x0 + s.width && y < s.y0 + s.height;
                    }
                }
                if (k == i || q->dropped || q->label == BST_LABEL_HIT || !shares ||
                    listed == BST_FIT_MAX_FREE + BST_DEBLEND_MAX_FIXED) {
                    continue;
                }
                listed++;
                double x = q->source.shape.x_px - s.x0, y = q->source.shape.y_px - s.y0;
                bool inside = x >= -1.5 && y >= -1.5 && x <= s.width + 0.5 && y <= s.height + 0.5;
                if (inside && free_count < BST_FIT_MAX_FREE) {
                    assert_true(free_count < out.free_count);
                    assert_ptr_equal(out.free[free_count++], &q->source);
                } else if (fixed_count < BST_DEBLEND_MAX_FIXED) {
                    assert_true(fixed_count < out.fixed_count);
                    assert_ptr_equal(out.fixed[fixed_count++], &q->source);
                }
            }
            assert_int_equal(out.free_count, free_count);
            assert_int_equal(out.fixed_count, fixed_count);
            most_free += free_count == BST_FIT_MAX_FREE;
            most_fixed += fixed_count > 2;
        }
    }
    assert_true(most_free > 0 && most_fixed > 0);
    bst_imgproc_locator_free(&b.l);
}

/* Of fits that came to one place the fainter ones are dropped; charge and light are two things. */
static void doubles(void **state) {
    (void)state;
    bench b;
    uint64_t seed = 21;
    int dropped = 0;
    open_bench(&b);
    double radius = 0.6 * 2.354820045 * b.f.sigma_px;
    for (int round = 0; round < 100; round++) {
        bool gone[MOST] = {false};
        b.l.count = MOST;
        b.l.longest_px = 0;
        for (int i = 0; i < MOST; i++) {
            bst_imgproc_found *q = &b.l.found[i];
            *q =
                (bst_imgproc_found){.peak_x = (int)(40 * draw(&seed)),
                                    .peak_y = (int)(40 * draw(&seed)),
                                    .label = draw(&seed) < 0.3 ? BST_LABEL_HIT : BST_LABEL_UNKNOWN};
            q->source.shape = (bst_imgproc_shape){.x_px = q->peak_x + 2 * draw(&seed) - 1,
                                                  .y_px = q->peak_y + 2 * draw(&seed) - 1,
                                                  .sigma_px = 0.9};
        }
        bst_deblend_index(&b.l, &b.f);
        int end = 60;
        for (int i = 0; i < end; i++) {
            for (int k = 0; k < i; k++) {
                const bst_imgproc_found *p = &b.l.found[i], *q = &b.l.found[k];
                double x = p->source.shape.x_px - q->source.shape.x_px,
                       y = p->source.shape.y_px - q->source.shape.y_px;
                gone[i] = gone[i] ||
                          (!gone[k] && p->label == q->label && x * x + y * y < radius * radius);
            }
        }
        bst_deblend_drop_doubles(&b.l, &b.f, end);
        for (int i = 0; i < MOST; i++) {
            assert_int_equal(b.l.found[i].dropped, gone[i]);
            dropped += gone[i];
        }
    }
    assert_true(dropped > 200);
    bst_imgproc_locator_free(&b.l);
}

static const bst_imgproc_found *sorted_by;

static int on_sensor(const void *a, const void *b) {
    const bst_imgproc_shape *p = &sorted_by[*(const int *)a].source.shape,
                            *q = &sorted_by[*(const int *)b].source.shape;
    int rows = (p->y_px > q->y_px) - (p->y_px < q->y_px),
        columns = (p->x_px > q->x_px) - (p->x_px < q->x_px);
    return rows ? rows : columns ? columns : *(const int *)a - *(const int *)b;
}

/* By y, then x, then index, outside of the frame too. */
static void order_on_the_sensor(void **state) {
    (void)state;
    enum { N = 200, ROWS = 30 };
    static bst_imgproc_found found[N];
    uint64_t seed = 2;
    for (int round = 0; round < 30; round++) {
        int order[N], expected[N], swap[N], row[ROWS + 1];
        for (int i = 0; i < N; i++) {
            /* whole numbers: many are equal in y, some in both */
            found[i].source.shape.x_px = floor(20 * draw(&seed));
            found[i].source.shape.y_px = floor(40 * draw(&seed)) - 5;
            order[i] = expected[i] = i;
        }
        for (int i = N - 1; i > 0; i--) {
            int k = (int)(draw(&seed) * (i + 1)), other = order[i];
            order[i] = order[k];
            order[k] = other;
        }
        sorted_by = found;
        qsort(expected, N, sizeof *expected, on_sensor);
        bst_sensor_order(found, N, ROWS, order, swap, row);
        for (int i = 0; i < N; i++) {
            assert_int_equal(order[i], expected[i]);
        }
    }
}

/* What charge is taken for: odds, flux and its variance, place and shape. */
static void charge(void **state) {
    (void)state;
    bst_imgproc_found found = {.noise_e = 3.0,
                               .streak = true,
                               .flags = BST_DETECTION_BLEND,
                               .charge = {.pixels = 4,
                                          .sharpness = 4.0,
                                          .x_px = 10.5,
                                          .y_px = 20.25,
                                          .electrons = 500,
                                          .snr = 90,
                                          .length_px = 3,
                                          .width_px = 1,
                                          .angle_rad = 0.5}};
    found.source.shape = (bst_imgproc_shape){1, 2, 3, 4, 5, 6, 0.9, NULL};
    bst_cosmic_ray_take(&found);
    /* a normal tail of 4 sigma, with one in e^7 */
    bst_assert_close(found.label_probability, exp(1) / (1 + exp(1)), 1e-12);
    assert_int_equal(found.label, BST_LABEL_HIT);
    bst_assert_close(found.source.flux_e, 500, 0);
    bst_assert_close(found.source.flux_variance, 4 * 9 + 500, 1e-12);
    bst_assert_close(found.source.cov_xx, 1.0 / 12, 1e-15);
    bst_assert_close(found.source.cov_yy, 1.0 / 12, 1e-15);
    const double shape[] = {found.source.shape.x_px,
                            found.source.shape.y_px,
                            found.source.shape.dx_px,
                            found.source.shape.dy_px,
                            found.source.shape.bend_x_px,
                            found.source.shape.bend_y_px,
                            found.length_px,
                            found.width_px,
                            found.angle_rad,
                            found.snr};
    const double expected[] = {10.5, 20.25, 0, 0, 0, 0, 3, 1, 0.5, 90};
    for (int k = 0; k < 10; k++) {
        bst_assert_close(shape[k], expected[k], 0);
    }
    assert_true(!found.streak && found.flags == 0);
    found.charge.pixels = 1;
    found.charge.sharpness = 100;
    bst_cosmic_ray_take(&found);
    assert_int_equal(found.label, BST_LABEL_HOT_PIXEL);
    bst_assert_close(found.label_probability, 1, 1e-9);
}

/* No light beside the charge: a fit that failed, below an SNR of 4, or with an excess of chi-square
 * of 5 sigma and a tenth of the squared SNR. */
static void charge_alone(void **state) {
    (void)state;
    static const struct {
        bool fitted;
        double flux, variance, chi, pixels;
        bool alone;
    } cases[] = {{false, 100, 100, 50, 50, true},
                 {true, 41, 100, 50, 50, false},
                 {true, 39, 100, 50, 50, true},
                 {true, 100, 100, 50 + 50 + 9.9, 50, false},
                 {true, 100, 100, 50 + 50 + 10.1, 50, true}};
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        bst_imgproc_found f = {.source = {.fitted = cases[k].fitted,
                                          .flux_e = cases[k].flux,
                                          .flux_variance = cases[k].variance,
                                          .chi_square = cases[k].chi,
                                          .pixels = (int)cases[k].pixels}};
        assert_int_equal(bst_cosmic_ray_alone(&f), cases[k].alone);
    }
}

/* The light of a Gaussian about the charge, of the pixels that are left: its SNR in a matched
 * filter of 5 x 5. */
static void light_about_charge(void **state) {
    (void)state;
    enum { W = 20, H = 16 };
    float signal[W * H];
    const double sigma = 0.9, cx = 9.3, cy = 7.8;
    const bst_locate_frame f = {
        .signal = signal, .width = W, .height = H, .excess = 1.0, .sigma_px = sigma};
    bst_imgproc_found found = {
        .noise_e = 4, .peak_x = 9, .peak_y = 8, .charge = {.x_px = cx, .y_px = cy}};
    uint64_t seed = 4;
    for (int at_edge = 0; at_edge < 2; at_edge++) {
        double sum = 0, norm = 0;
        found.peak_x = at_edge ? 1 : 9;
        found.peak_y = at_edge ? H - 1 : 8;
        found.charge.x_px = at_edge ? 0.6 : cx;
        found.charge.y_px = at_edge ? H - 1.3 : cy;
        for (int i = 0; i < W * H; i++) {
            signal[i] = i % 7 == 3 ? BST_PIXEL_BAD : (float)(50 * draw(&seed));
            double x = i % W - found.charge.x_px, y = i / W - found.charge.y_px;
            if (signal[i] != BST_PIXEL_BAD && abs(i % W - found.peak_x) <= 3 &&
                abs(i / W - found.peak_y) <= 3) {
                double w = exp(-(x * x + y * y) / 2 / (sigma * sigma + 1.0 / 12));
                sum += w * (double)signal[i];
                norm += w * w;
            }
        }
        bst_assert_close(bst_cosmic_ray_light(&f, &found), sum / sqrt(norm) / 4, 1e-9);
    }
}

static void masked_charge_on_a_stamp(void **state) {
    (void)state;
    int at[] = {3 * 50 + 10, 7 * 50 + 20};
    const bst_imgproc_locator l = {.charged = at, .charged_count = 2};
    static const struct {
        bst_imgproc_stamp stamp;
        bool in;
    } cases[] = {{{10, 3, 1, 1}, true},  {{11, 3, 5, 5}, false}, {{9, 3, 1, 1}, false},
                 {{10, 2, 1, 1}, false}, {{10, 4, 5, 5}, false}, {{15, 5, 6, 3}, true},
                 {{15, 5, 5, 3}, false}, {{15, 5, 6, 2}, false}};
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        assert_int_equal(bst_cosmic_ray_in(&l, 50, &cases[k].stamp), cases[k].in);
    }
}

/* Light of a streak about (0, 0) in a pixel: the mean of points along it. */
static double streak_in_pixel(double sigma, double dx, double dy, double x, double y) {
    enum { POINTS = 60 };
    double sum = 0.0, u = 1.0 / (sigma * sqrt(2.0));
    for (int k = 0; k < POINTS; k++) {
        double t = (k + 0.5) / POINTS - 0.5, a = x - t * dx, b = y - t * dy;
        sum += 0.25 / POINTS * (erf((a + 0.5) * u) - erf((a - 0.5) * u)) *
               (erf((b + 0.5) * u) - erf((b - 0.5) * u));
    }
    return sum;
}

/* Covariance of a place: that of white noise, inverse of the slopes' products; and the mean of its
 * two axes' photon noise relative to it, with the image's light as weight. */
static void law_by_sums(double sigma, double dx, double dy, bst_imgproc_peak_law *law) {
    const double h = 1e-3;
    double s[3] = {0}, k[3] = {0};
    for (int y = -16; y <= 16; y++) {
        for (int x = -16; x <= 16; x++) {
            double p = streak_in_pixel(sigma, dx, dy, x, y);
            double a = (streak_in_pixel(sigma, dx, dy, x + h, y) - p) / h,
                   b = (streak_in_pixel(sigma, dx, dy, x, y + h) - p) / h;
            const double products[3] = {a * a, a * b, b * b};
            for (int i = 0; i < 3; i++) {
                s[i] += products[i];
                k[i] += products[i] * p;
            }
        }
    }
    double det = s[0] * s[2] - s[1] * s[1];
    *law = (bst_imgproc_peak_law){.xx = s[2] / det, .xy = -s[1] / det, .yy = s[0] / det};
    /* half of the trace of K S^-1, K with photons as weights */
    law->photons = 0.5 * (k[0] * law->xx + 2.0 * k[1] * law->xy + k[2] * law->yy);
}

/* Law of a place: white noise over the slopes of the image, and photons of the source itself. For a
 * Gaussian that is wide against a pixel: 8 pi sigma^4 on noise over flux squared; sum p^2 is
 * 1 / (4 pi sigma^2), sum p^3 / sum p^2 is 1 / (3 pi sigma^2) ... of half that in the place. */
static void law_of_a_place(void **state) {
    (void)state;
    bench b;
    open_bench(&b);
    const double sigma = 2.0, s2 = sigma * sigma + 1.0 / 12;
    b.f.sigma_px = sigma;
    bst_locate_prepare(&b.l, &b.f);
    const bst_imgproc_worker w = {&b.l, &b.f, &b.l.fits[0]};
    bst_imgproc_shape shape = {.sigma_px = sigma};
    bst_imgproc_peak_law law = bst_peak_centroid_law_of(&w, &shape);
    bst_assert_close(law.xx, 8 * BST_PI * s2 * s2, 0.01 * law.xx);
    bst_assert_close(law.yy, law.xx, 1e-3 * law.xx);
    bst_assert_close(law.xy, 0, 1e-3 * law.xx);
    bst_assert_close(law.norm2, 1 / (4 * BST_PI * s2), 0.01 * law.norm2);
    bst_assert_close(law.flux_photons, 1 / (3 * BST_PI * s2), 0.01 * law.flux_photons);
    /* integral of (dp/dx)^2 p over that of (dp/dx)^2: 4 / 9 of the centre's light 1 / (2 pi s2) */
    bst_assert_close(law.photons, 4.0 / 9 / (2 * BST_PI * s2), 0.01 * law.photons);
    bst_assert_close(law.floor_px2, 0.012 * 0.012, 1e-12);
    /* a streak along 3, 4: worse along it, and the axes are coupled so */
    shape.dx_px = 9;
    shape.dy_px = 12;
    law = bst_peak_centroid_law_of(&w, &shape);
    double c = 0.6, s = 0.8, along = c * c * law.xx + 2 * c * s * law.xy + s * s * law.yy,
           across = s * s * law.xx - 2 * c * s * law.xy + c * c * law.yy;
    assert_true(along > 5 * across && law.xy > 0);
    bst_imgproc_peak_law sums;
    law_by_sums(sigma, 9, 12, &sums);
    bst_assert_close(law.xx / sums.xx, 1.0, 0.01);
    bst_assert_close(law.xy / sums.xx, sums.xy / sums.xx, 0.01);
    bst_assert_close(law.yy / sums.yy, 1.0, 0.01);
    bst_assert_close(law.photons / sums.photons, 1.0, 0.01);
    bst_assert_close(law.floor_px2, pow(0.012 + 0.0013 * 15, 2), 1e-12);
    /* the place of a source takes them */
    b.l.law[0] = (bst_imgproc_peak_law){.xx = 50,
                                        .xy = -7,
                                        .yy = 30,
                                        .photons = 0.02,
                                        .norm2 = 0.04,
                                        .flux_photons = 0.03,
                                        .floor_px2 = 1e-3};
    b.l.count = 1;
    b.l.found[0] = (bst_imgproc_found){.noise_e = 5, .peak_x = 50, .peak_y = 40};
    b.l.found[0].source = (bst_imgproc_source){.flux_e = 200, .shape = {50, 40, 0, 0, 0, 0, sigma}};
    bst_deblend_index(&b.l, &b.f);
    bst_imgproc_found found = b.l.found[0];
    bst_peak_centroid_place(&w, 0, &found);
    double scale = 25.0 / 40000 + 0.02 / 200;
    bst_assert_close(found.source.cov_xx, scale * 50 + 1e-3, 1e-12);
    bst_assert_close(found.source.cov_xy, scale * -7, 1e-12);
    bst_assert_close(found.source.cov_yy, scale * 30 + 1e-3, 1e-12);
    bst_assert_close(found.source.flux_variance, (25 + 0.03 * 200) / 0.04, 1e-9);
    assert_true(found.rough && found.source.fitted && !found.dropped && found.flags == 0);
    bst_imgproc_locator_free(&b.l);
}

/* Moments of a Gaussian of any axes under the window of a narrower, moving source: its own; with
 * a pixel that is missing there are none. */
static void moments_of_a_gaussian(void **state) {
    (void)state;
    static float image[WIDTH * HEIGHT];
    const double covariances[3][3] = {{4.0, 1.2, 2.6}, {2.0, -0.9, 5.0}, {1.1, 0.0, 1.1}};
    bench b;
    open_bench(&b);
    bst_source_profiles_set(&b.l.profiles, &b.l.psf, 0.9);
    for (int k = 0; k < 3; k++) {
        const double *s = covariances[k], x0 = 61.3, y0 = 40.6;
        double det = s[0] * s[2] - s[1] * s[1];
        for (int i = 0; i < WIDTH * HEIGHT; i++) {
            double x = i % WIDTH - x0, y = i / WIDTH - y0;
            image[i] =
                (float)(900.0 *
                        exp(-0.5 * (s[2] * x * x - 2.0 * s[1] * x * y + s[0] * y * y) / det));
        }
        const bst_imgproc_source source = {
            .shape = {.x_px = x0, .y_px = y0, .dx_px = 4.0, .dy_px = 1.5, .sigma_px = 0.9},
            .flux_e = 9000.0};
        bst_imgproc_stamp stamp = {.x0 = 46, .y0 = 27, .width = 31, .height = 28};
        bst_fit_data data = {image, WIDTH, HEIGHT, 5.0, 1.0};
        double m[3];
        assert_true(bst_fit_moments(&b.l.fits[0], &data, &stamp, &source, NULL, 0, m));
        for (int i = 0; i < 3; i++) {
            bst_assert_close(m[i], s[i], 2e-3); /* of single precision */
        }
        image[42 * WIDTH + 60] = BST_PIXEL_BAD;
        assert_false(bst_fit_moments(&b.l.fits[0], &data, &stamp, &source, NULL, 0, m));
    }
    bst_imgproc_locator_free(&b.l);
}

/* Of two sources the moments depend on the window, a Gaussian of twice the fitted image's variance:
 * PSF, widening, pixel and path, with its bend. By sums over the pixels. */
static void moments_under_the_window(void **state) {
    (void)state;
    static float image[WIDTH * HEIGHT];
    const struct {
        double dx, dy, bend_x, bend_y, widening;
    } cases[] = {{0, 0, 0, 0, 0.8}, {4, -1.5, 0, 0, -0.3}, {2, 5, 1.1, -0.7, 0.4}};
    const double x0 = 61.3, y0 = 40.6;
    bench b;
    open_bench(&b);
    bst_source_profiles_set(&b.l.profiles, &b.l.psf, 0.9);
    for (int k = 0; k < 3; k++) {
        double same = 2.0 * (0.81 + fmax(cases[k].widening, 0.0) + 1.0 / 12.0);
        double dx = cases[k].dx, dy = cases[k].dy, bx = cases[k].bend_x, by = cases[k].bend_y;
        double xx = same + dx * dx / 6.0 + bx * bx / 2.5, yy = same + dy * dy / 6.0 + by * by / 2.5;
        double xy = dx * dy / 6.0 + bx * by / 2.5, det = xx * yy - xy * xy, sum = 0.0;
        double i_xx = yy / det, i_xy = -xy / det, i_yy = xx / det, m[3] = {0}, out[3];
        const bst_imgproc_stamp stamp = {.x0 = 46, .y0 = 27, .width = 31, .height = 28};
        for (int i = 0; i < WIDTH * HEIGHT; i++) {
            int px = i % WIDTH, py = i / WIDTH;
            double x = px - x0, y = py - y0, u = x - 2.4, v = y - 1.1;
            double light =
                900.0 * exp(-0.4 * (x * x + y * y)) + 700.0 * exp(-0.3 * (u * u + v * v));
            image[i] = (float)light;
            if (px >= stamp.x0 && py >= stamp.y0 && px < stamp.x0 + stamp.width &&
                py < stamp.y0 + stamp.height) {
                light *= exp(-0.5 * (i_xx * x * x + 2.0 * i_xy * x * y + i_yy * y * y));
                sum += light;
                m[0] += light * x * x;
                m[1] += light * x * y;
                m[2] += light * y * y;
            }
        }
        double seen = (m[0] * m[2] - m[1] * m[1]) / sum;
        double c_xx = m[2] / seen - i_xx, c_xy = -m[1] / seen - i_xy, c_yy = m[0] / seen - i_yy;
        double c = c_xx * c_yy - c_xy * c_xy;
        const double asked[3] = {c_yy / c, -c_xy / c, c_xx / c};
        const bst_imgproc_source source = {.shape = {.x_px = x0,
                                                     .y_px = y0,
                                                     .dx_px = dx,
                                                     .dy_px = dy,
                                                     .bend_x_px = bx,
                                                     .bend_y_px = by,
                                                     .sigma_px = 0.9},
                                           .widening_px2 = cases[k].widening,
                                           .flux_e = 9000.0};
        bst_fit_data data = {image, WIDTH, HEIGHT, 5.0, 1.0};
        assert_true(bst_fit_moments(&b.l.fits[0], &data, &stamp, &source, NULL, 0, out));
        for (int i = 0; i < 3; i++) {
            bst_assert_close(out[i], asked[i], 5e-3);
        }
    }
    bst_imgproc_locator_free(&b.l);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(stamps),
        cmocka_unit_test(neighbours),
        cmocka_unit_test(doubles),
        cmocka_unit_test(order_on_the_sensor),
        cmocka_unit_test(charge),
        cmocka_unit_test(charge_alone),
        cmocka_unit_test(light_about_charge),
        cmocka_unit_test(masked_charge_on_a_stamp),
        cmocka_unit_test(law_of_a_place),
        cmocka_unit_test(moments_of_a_gaussian),
        cmocka_unit_test(moments_under_the_window),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
