/* The streak map against direct sums over pixels: frames of several sizes and widths of the PSF one
 * after the other, both planes, limits, correlation, and segments that are set to zero. */
#include <stdlib.h>

#include "boresight/vec.h"
#include "imgproc/streak/streak_map.h"
#include "tests/test_support.h"

enum { MOST_WIDTH = 150, MOST_HEIGHT = 140, CLAMP = 77 };

static double draw(uint64_t *state) {
    *state = *state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return ((double)(*state >> 11) + 0.5) * 0x1p-53;
}

/* Share of a Gaussian in the pixel at `d`, by Simpson's rule over its density: 1e-9. */
static double share_of(double d, double sigma) {
    enum { STEPS = 200 };
    double sum = 0.0;
    for (int k = 0; k <= STEPS; k++) {
        double u = (d - 0.5 + (double)k / STEPS) / sigma;
        sum += (k == 0 || k == STEPS ? 1.0 : k % 2 ? 4.0 : 2.0) * exp(-0.5 * u * u);
    }
    return sum / (3.0 * STEPS) / (sigma * sqrt(2.0 * BST_PI));
}

typedef struct bench {
    bst_streak_map map;
    bst_background background;
    bst_parallel *pool;
    int width, height;
    float *signal, *sum;
    double *own; /* SNR of each pixel */
} bench;

/* A frame with noise that grows to the lower right, bright and dark pixels, and some without a
 * measurement. */
static void make_frame(bench *b, int width, int height, uint64_t *seed) {
    b->width = width;
    b->height = height;
    for (int i = 0; i < width * height; i++) {
        double gauss = -6.0;
        for (int k = 0; k < 12; k++) {
            gauss += draw(seed);
        }
        double noise = 5.0 + 0.05 * (i % width) + 0.1 * (double)(i / width);
        b->signal[i] = (float)(noise * gauss);
    }
    bst_background_estimate(&b->background, b->signal, width, height, 0.5f);
    for (int k = 0; k < 60; k++) {
        int at = (int)(draw(seed) * width * height);
        b->signal[at] = k % 3 == 0   ? BST_PIXEL_BAD
                        : k % 3 == 1 ? (float)(60.0 + 900.0 * draw(seed))
                                     : (float)(-400.0 * draw(seed));
    }
    static float level[MOST_WIDTH], inverse[MOST_WIDTH];
    for (int y = 0; y < height; y++) {
        bst_background_row(&b->background, y, level, inverse);
        for (int x = 0; x < width; x++) {
            float v = b->signal[y * width + x];
            b->own[y * width + x] = v > BST_PIXEL_NONE ? (double)(v * inverse[x]) : 0.0;
        }
    }
}

/* Kernel of unit norm along an axis, about `r`; returns r. */
static int kernel_of(double sigma, double k[64]) {
    const int r = (int)ceil(3.2 * sigma);
    double square = 0.0;
    for (int i = -r; i <= r; i++) {
        k[i + r] = share_of(i, sigma);
        square += k[i + r] * k[i + r];
    }
    for (int i = 0; i <= 2 * r; i++) {
        k[i] /= sqrt(square);
    }
    return r;
}

/* Value of the map at a pixel: the SNR of the PSF's matched filter. */
static double filtered(const bench *b, const double *k, int r, int x, int y) {
    double sum = 0.0;
    for (int v = -r; v <= r; v++) {
        for (int u = -r; u <= r; u++) {
            if (x + u >= 0 && y + v >= 0 && x + u < b->width && y + v < b->height) {
                sum += k[u + r] * k[v + r] * b->own[(y + v) * b->width + x + u];
            }
        }
    }
    return sum;
}

/* Each value is that sum in quanta, rounded (0.5, and 0.01 of single precision), between -6 sigma
 * and the clamp. */
static void values(void **state) {
    (void)state;
    static const struct {
        int width, height;
        double sigma;
    } frames[] = {{97, 131, 0.8}, {97, 131, 1.7}, {150, 70, 1.7}, {61, 140, 0.9}};
    bst_ctx ctx = {0};
    bench b = {0};
    uint64_t seed = 11;
    size_t most = (size_t)MOST_WIDTH * MOST_HEIGHT;
    b.signal = calloc(most, sizeof *b.signal);
    b.sum = calloc(most, sizeof *b.sum);
    b.own = calloc(most, sizeof *b.own);
    assert_true(b.signal && b.sum && b.own);
    bst_assert_ok(&ctx, bst_parallel_create(&ctx, 1, &b.pool));
    bst_assert_ok(&ctx, bst_background_create(&ctx, 32, MOST_WIDTH, MOST_HEIGHT, 1, &b.background));
    bst_assert_ok(&ctx, bst_streak_map_create(&ctx, MOST_WIDTH, MOST_HEIGHT, true, &b.map));
    int cut[2] = {0, 0};
    for (size_t n = 0; n < sizeof frames / sizeof frames[0]; n++) {
        const double sigma = frames[n].sigma;
        double k[64];
        const int r = kernel_of(sigma, k);
        make_frame(&b, frames[n].width, frames[n].height, &seed);
        const bst_streak_map_input input = {b.signal, b.width, b.height, &b.background, sigma};
        for (int i = 0; i < b.width * b.height; i++) {
            b.sum[i] = 2.0f;
        }
        bst_streak_map_filter(&b.map, b.pool, &input, CLAMP, b.sum);
        for (int i = 0; i < b.width * b.height; i++) {
            bst_assert_close((double)b.sum[i], 2.0 + fmax(-6.0, fmin(b.own[i], 6.0)), 1e-5);
        }
        for (int full = 0; full < 2; full++) {
            double clamp = full ? 5.0 * BST_STREAK_QUANTA : CLAMP;
            if (full) {
                bst_streak_map_fill(&b.map, b.pool, &input);
            }
            const int16_t *plane[2] = {bst_streak_map_plane(&b.map, 0),
                                       bst_streak_map_plane(&b.map, 1)};
            for (int y = -3; y < b.height + 3; y++) {
                for (int x = -3; x < b.width + 3; x++) {
                    bool on = x >= 0 && y >= 0 && x < b.width && y < b.height;
                    double v = on ? BST_STREAK_QUANTA * filtered(&b, k, r, x, y) : 0.0;
                    double is = plane[0][(long)y * b.map.stride[0] + x];
                    cut[0] += v > clamp;
                    cut[1] += v < -6.0 * BST_STREAK_QUANTA;
                    v = fmax(-6.0 * BST_STREAK_QUANTA, fmin(v, clamp));
                    bst_assert_close(is, v, 0.51);
                    if (full) {
                        assert_int_equal(plane[1][(long)x * b.map.stride[1] + y], (int)is);
                    }
                }
            }
        }
        /* correlation of neighbours that the filter makes of independent pixels */
        for (int lag = 0; lag < 8; lag++) {
            double sum = 0.0;
            for (int i = 0; i + lag <= 2 * r; i++) {
                sum += k[i] * k[i + lag];
            }
            bst_assert_close(b.map.correlation[lag], sum, 1e-8);
        }
    }
    assert_true(cut[0] > 100 && cut[1] > 20);
    bst_streak_map_free(&b.map);
    bst_background_free(&b.background);
    bst_parallel_free(b.pool);
    free(b.signal);
    free(b.sum);
    free(b.own);
}

/* Distance of a point from a segment, by the nearest of many points of it: 0.005 px. */
static double distance(const double s[4], double x, double y) {
    double least = INFINITY;
    for (int k = 0; k <= 4000; k++) {
        double t = k / 4000.0;
        least = fmin(least, hypot(s[0] + t * (s[2] - s[0]) - x, s[1] + t * (s[3] - s[1]) - y));
    }
    return least;
}

/* Pixels within the radius of a segment are zero in both planes, and no others; segments that leave
 * the frame are cut. */
static void blank_segments(void **state) {
    (void)state;
    enum { WIDTH = 47, HEIGHT = 31 };
    static const double all[][5] = {{10.2, 5.7, 33.1, 20.4, 3.3}, {40.0, 3.0, 12.0, 29.5, 2.2},
                                    {-8.0, 12.0, 5.0, 15.0, 4.1}, {30.0, 25.0, 60.0, 44.0, 5.2},
                                    {21.4, 9.6, 21.4, 9.6, 4.6},  {44.5, -3.0, 45.5, 40.0, 1.7}};
    for (size_t n = 0; n < sizeof all / sizeof all[0]; n++) {
        bst_ctx ctx = {0};
        bst_streak_map map;
        bst_assert_ok(&ctx, bst_streak_map_create(&ctx, WIDTH, HEIGHT, true, &map));
        map.width = WIDTH;
        map.height = HEIGHT;
        map.stride[0] = WIDTH + 2 * BST_STREAK_PAD;
        map.stride[1] = HEIGHT + 2 * BST_STREAK_PAD;
        for (int plane = 0; plane < 2; plane++) {
            for (int i = 0; i < map.stride[0] * map.stride[1]; i++) {
                map.memory[plane][i] = 9;
            }
        }
        const double *s = all[n];
        bst_streak_map_blank(&map, s[0], s[1], s[2], s[3], s[4]);
        int zero = 0;
        for (int y = -6; y < HEIGHT + 6; y++) {
            for (int x = -6; x < WIDTH + 6; x++) {
                double d = distance(s, x, y);
                int a = bst_streak_map_plane(&map, 0)[(long)y * map.stride[0] + x];
                int b = bst_streak_map_plane(&map, 1)[(long)x * map.stride[1] + y];
                bool on = x >= 0 && y >= 0 && x < WIDTH && y < HEIGHT;
                if (fabs(d - s[4]) > 0.006) {
                    assert_int_equal(a, on && d < s[4] ? 0 : 9);
                    assert_int_equal(b, a);
                    zero += a == 0;
                }
            }
        }
        assert_true(zero > 30);
        bst_streak_map_free(&map);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(values), cmocka_unit_test(blank_segments)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
