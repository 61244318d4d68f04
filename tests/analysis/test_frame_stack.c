/* Frames reduced one by one, against sums over all of them at once: an image section off the file's
 * corner, rows from the bottom, an overscan, noise common to rows and to neighbours, radiation
 * hits. Linked with wraps of what reads frames. */
#include <stdlib.h>

#include "sim/analysis/characterize/clipped_moments.h"
#include "sim/analysis/characterize/frame_stack.h"
#include "tests/test_support.h"

enum { FILE_WIDTH = 131, FILE_HEIGHT = 91, X0 = 9, Y0 = 4, NX = 104, NY = 80, PIXELS = NX * NY };
enum { OVERSCAN_X = 120, OVERSCAN = 7, FRAMES = 5, FILE_PIXELS = FILE_WIDTH * FILE_HEIGHT };

#define WRAP(type, name, arguments) \
    type __wrap_##name arguments;   \
    type __wrap_##name arguments

static float image[FRAMES][FILE_PIXELS]; /* as the file has them */
static double exposures_s[FRAMES];
static int selected, trim_width;

WRAP(bst_status, bst_recorded_frames_select,
     (bst_ctx * ctx, bst_recorded_frames *frames, int64_t index,
      const bst_recorded_options *options, bst_recorded_frame *out)) {
    (void)ctx;
    (void)frames;
    assert_string_equal(options->map->image_section, "");
    assert_int_equal(options->map->first_row, BST_KEYWORD_TOP);
    selected = (int)index;
    *out = (bst_recorded_frame){
        .path = "frames.fits",
        .width = FILE_WIDTH,
        .height = FILE_HEIGHT,
        .values = {.exposure_s = exposures_s[index],
                   .gain_e_per_dn = 1.7,
                   .start = bst_time_add((bst_time){0}, 20.0 * (double)index)}};
    return BST_OK;
}

WRAP(bst_frame_source *, bst_recorded_frames_source, (bst_recorded_frames * frames)) {
    (void)frames;
    return NULL;
}

WRAP(bst_status, bst_keyword_section,
     (bst_ctx * ctx, const char *keyword, bst_frame_source *source, const bst_frame_place *frame,
      int box[4])) {
    (void)ctx;
    (void)source;
    (void)frame;
    const int trim[4] = {X0, Y0, selected == 3 ? trim_width : NX, NY};
    const int bias[4] = {OVERSCAN_X, Y0, OVERSCAN, NY};
    memcpy(box, strcmp(keyword, "TRIM") == 0 ? trim : bias, sizeof trim);
    return BST_OK;
}

WRAP(bst_status, bst_recorded_frames_pixels,
     (bst_ctx * ctx, bst_recorded_frames *frames, const bst_recorded_options *options,
      bst_recorded_frame *frame, const float **pixels)) {
    (void)ctx;
    (void)frames;
    (void)options;
    (void)frame;
    *pixels = image[selected];
    return BST_OK;
}

static uint64_t state_of_draws = 3;

static double uniform(void) {
    state_of_draws = state_of_draws * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return (double)(state_of_draws >> 12) / 4503599627370496.0 - 0.5;
}

/* Even noise has no outliers beyond 5 standard deviations: nothing of it is clipped. */
static void draw(void) {
    static double own[FILE_PIXELS + 1];
    for (int f = 0; f < FRAMES; f++) {
        exposures_s[f] = 2.5;
        for (int i = 0; i <= FILE_PIXELS; i++) {
            own[i] = uniform();
        }
        for (int y = 0; y < FILE_HEIGHT; y++) {
            double row = 6.0 * uniform();
            for (int x = 0; x < FILE_WIDTH; x++) {
                int i = y * FILE_WIDTH + x;
                double sigma = 8.0 + 0.1 * x + 0.05 * y; /* other noise in each block */
                image[f][i] = (float)(500.0 + 3.0 * f + 0.3 * x + 0.2 * y + row +
                                      sigma * (own[i] + 0.4 * own[i + 1]));
            }
        }
    }
    trim_width = NX;
}

/* Pixel of a frame in the camera's order of rows, the first at the bottom. */
static double pixel(int frame, int x, int y) {
    return (double)image[frame][(Y0 + NY - 1 - y) * FILE_WIDTH + X0 + x];
}

static const bst_keyword_map map = {
    .image_section = "TRIM", .bias_section = "BIAS", .first_row = BST_KEYWORD_BOTTOM};

/* Difference of frames 2 k and 2 k + 1, and the means of its rows. */
typedef struct difference {
    double d[NY][NX], row[NY];
} difference;

static void difference_of(int pair, difference *out) {
    for (int y = 0; y < NY; y++) {
        out->row[y] = 0.0;
        for (int x = 0; x < NX; x++) {
            out->d[y][x] = pixel(2 * pair + 1, x, y) - pixel(2 * pair, x, y);
            out->row[y] += out->d[y][x] / NX;
        }
    }
}

static void check_rows(const bst_frame_stack *s, const difference d[2]) {
    double rows2 = 0.0, covariance[BST_STACK_LAGS] = {0}, right = 0.0, above = 0.0;
    for (int p = 0; p < 2; p++) {
        double mean = 0.0, within = 0.0;
        for (int y = 0; y < NY; y++) {
            double square = 0.0;
            mean += d[p].row[y] / NY;
            for (int x = 0; x < NX; x++) {
                double v = d[p].d[y][x] - d[p].row[y];
                square += v * v;
                for (int lag = 1; lag <= BST_STACK_LAGS && x + lag < NX; lag++) {
                    covariance[lag - 1] +=
                        v * (d[p].d[y][x + lag] - d[p].row[y]) / (NX - lag) / NY / 4.0;
                }
                above += y + 1 < NY ? v * (d[p].d[y + 1][x] - d[p].row[y + 1]) / NX / (NY - 1) / 4.0
                                    : 0.0;
            }
            within += square / (NX - 1) / NX / NY;
            right += square / NX / NX / NY / 4.0; /* of the row's mean, which is subtracted */
        }
        for (int y = 0; y < NY; y++) {
            rows2 += (d[p].row[y] - mean) * (d[p].row[y] - mean) / (NY - 1) / 4.0;
        }
        rows2 -= within / 4.0;
    }
    bst_assert_close(s->row_variance, rows2, 1e-4 * rows2); /* floats */
    for (int k = 0; k < BST_STACK_LAGS; k++) {
        bst_assert_close(s->covariance[k], covariance[k], 1e-4 * covariance[0]);
    }
    bst_assert_close(s->neighbours.covariance[0], covariance[0] + right, 1e-4 * covariance[0]);
    bst_assert_close(bst_neighbour_covariance_along(&s->neighbours, 1), above,
                     1e-4 * covariance[0]);
}

static void sums_over_all_frames(void **state) {
    (void)state;
    static difference d[2];
    bst_ctx ctx = {0};
    bst_frame_stack s;
    draw();
    bst_assert_ok(&ctx, bst_frame_stack_reduce(&ctx, "dark", (void *)&ctx, 0, FRAMES, &map, &s));
    assert_int_equal(s.count, FRAMES);
    assert_int_equal(s.width, NX);
    assert_int_equal(s.height, NY);
    assert_int_equal(s.pairs, 2);
    assert_int_equal(s.overscan_width, OVERSCAN);
    assert_int_equal(s.hits.count, 0);
    assert_false(s.integer);
    bst_assert_close(s.start_s, 80.0, 1e-9);
    bst_assert_close(s.exposure_s, 2.5, 0.0);
    bst_assert_close(s.gain_e_per_dn, 1.7, 0.0);
    for (int f = 0; f < FRAMES; f++) {
        double level = 0.0;
        for (int i = 0; i < PIXELS; i++) {
            level += pixel(f, i % NX, i / NX) / PIXELS;
        }
        bst_assert_close(s.levels[f], level, 1e-4);
    }
    for (int y = 0; y < NY; y++) {
        for (int x = 0; x < NX; x++) {
            double mean = 0.0;
            for (int f = 0; f < FRAMES; f++) {
                mean += pixel(f, x, y) / FRAMES;
            }
            bst_assert_close((double)s.mean[y * NX + x], mean, 1e-4); /* a float of 600 */
            bst_assert_close((double)s.last[y * NX + x], pixel(FRAMES - 1, x, y), 0.0);
        }
        for (int x = 0; x < OVERSCAN; x++) {
            bst_assert_close((double)s.overscan[y * OVERSCAN + x],
                             pixel(FRAMES - 1, OVERSCAN_X - X0 + x, y), 0.0);
        }
    }
    difference_of(0, &d[0]);
    difference_of(1, &d[1]);
    check_rows(&s, d);
    /* blocks of 13 x 10 pixels */
    for (int b = 0; b < BST_STACK_BLOCKS; b++) {
        double variance = 0.0;
        for (int p = 0; p < 2; p++) {
            double sum = 0.0, sum2 = 0.0;
            for (int i = 0; i < 130; i++) {
                int x = b % 8 * 13 + i % 13, y = b / 8 * 10 + i / 13;
                double v = d[p].d[y][x] - d[p].row[y];
                sum += v;
                sum2 += v * v;
            }
            variance += (sum2 - sum * sum / 130) / 129 / (1.0 - 1.0 / NX) / 4.0;
        }
        bst_assert_close(s.variance[b], variance, 1e-4 * variance);
    }
    bst_frame_stack_free(&s);
}

/* A hit is 8 standard deviations of a difference high, of which 6 are needed. */
static void hits_are_taken_out(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_frame_stack s, without;
    draw();
    bst_assert_ok(&ctx, bst_frame_stack_reduce(&ctx, "dark", (void *)&ctx, 0, 4, &map, &without));
    /* in the camera's pixels (40, 21) and (41, 21) of frame 2 */
    int at = (Y0 + NY - 1 - 21) * FILE_WIDTH + X0 + 40;
    double sigma = sqrt(2.0 * without.variance[3 + 8 * 2]);
    image[2][at] = image[3][at] + (float)(8.0 * sigma);
    image[2][at + 1] = image[3][at + 1] + (float)(5.0 * sigma);
    bst_assert_ok(&ctx, bst_frame_stack_reduce(&ctx, "dark", (void *)&ctx, 0, 4, &map, &s));
    assert_int_equal(s.hits.count, 1);
    assert_int_equal(s.hits.used, 1);
    assert_int_equal(s.hits.items[0].pixels, 2);
    bst_assert_close((double)s.hits.items[0].charge_dn, 13.0 * sigma,
                     1.5 * sigma); /* rows differ */
    for (int x = 40; x <= 41; x++) {
        /* the third frame's pixel counts as the fourth one's, less the rows' difference */
        double mean = (pixel(0, x, 21) + pixel(1, x, 21) + 2.0 * pixel(3, x, 21)) / 4.0;
        bst_assert_close((double)s.mean[21 * NX + x], mean, 1.5);
    }
    bst_assert_close((double)s.mean[21 * NX + 42], (double)without.mean[21 * NX + 42], 0.0);
    /* the block's variance has no hit: without 12 of its 130 pixels */
    bst_assert_close(s.variance[3 + 8 * 2], without.variance[3 + 8 * 2],
                     0.06 * without.variance[3 + 8 * 2]);
    bst_frame_stack_free(&s);
    /* in flats 4 standard deviations begin a hit */
    image[2][at] = image[3][at] + (float)(5.2 * sigma);
    image[2][at + 1] = image[3][at + 1];
    bst_assert_ok(&ctx, bst_frame_stack_reduce(&ctx, "dark", (void *)&ctx, 0, 4, &map, &s));
    assert_int_equal(s.hits.count, 0);
    bst_frame_stack_free(&s);
    bst_assert_ok(&ctx, bst_frame_stack_reduce(&ctx, "flat", (void *)&ctx, 0, 4, &map, &s));
    assert_int_equal(s.hits.count, 1);
    bst_frame_stack_free(&s);
    bst_frame_stack_free(&without);
}

static void frames_of_other_kinds(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_frame_stack s;
    draw();
    for (int i = 0; i < FILE_PIXELS; i++) {
        for (int f = 0; f < FRAMES; f++) {
            image[f][i] = roundf(image[f][i]);
        }
    }
    bst_assert_ok(&ctx, bst_frame_stack_reduce(&ctx, "bias", (void *)&ctx, 1, 4, &map, &s));
    assert_true(s.integer);
    bst_assert_close(s.start_s, 60.0, 1e-9);
    bst_assert_close((double)s.last[5], pixel(4, 5, 0), 0.0);
    bst_frame_stack_free(&s);
    exposures_s[2] = 2.51;
    assert_int_equal(bst_frame_stack_reduce(&ctx, "dark", (void *)&ctx, 0, 4, &map, &s),
                     BST_ERR_ARGUMENT);
    assert_non_null(strstr(ctx.message, "gives 2.51 s, the first dark frame has 2.5 s"));
    bst_frame_stack_free(&s);
    exposures_s[2] = 2.502; /* within a thousandth */
    bst_assert_ok(&ctx, bst_frame_stack_reduce(&ctx, "dark", (void *)&ctx, 0, 4, &map, &s));
    bst_frame_stack_free(&s);
    trim_width = NX - 1;
    assert_int_equal(bst_frame_stack_reduce(&ctx, "flat", (void *)&ctx, 0, 4, &map, &s),
                     BST_ERR_ARGUMENT);
    assert_non_null(strstr(ctx.message, "103 x 80 pixels, those of the first flat frame are 104"));
    bst_frame_stack_free(&s);
    trim_width = 63;
    assert_int_equal(bst_frame_stack_reduce(&ctx, "bias", (void *)&ctx, 3, 1, &map, &s),
                     BST_ERR_ARGUMENT);
    assert_non_null(strstr(ctx.message, "a bias frame of 63 x 80 pixels"));
    bst_frame_stack_free(&s);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(sums_over_all_frames),
                                       cmocka_unit_test(hits_are_taken_out),
                                       cmocka_unit_test(frames_of_other_kinds)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
