/* Loops over rows against what they say, one element at a time. */
#include <stdlib.h>

#include "boresight/rng.h"
#include "imgproc/detect/background.h"
#include "imgproc/detect/row_kernels.h"
#include "tests/test_support.h"

enum { PAD = 40, MOST = 150, LINE = MOST + 2 * PAD, ROWS = 16 };

static bst_rng_key key(void) {
    return bst_rng_make_key(31, 0, "test", "rows");
}

static void fill(float *row, int count, uint64_t number) {
    for (int x = 0; x < count; x++) {
        double z[2];
        bst_rng_normal2(key(), number, (uint64_t)x, z);
        row[x] = (float)z[0];
    }
}

static int ascending(const void *a, const void *b) {
    float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

/* To the eight bits of its fraction that count. */
static void median_is_the_middle_value(void **state) {
    (void)state;
    for (int count = 1; count <= BST_ROW_MEDIAN; count++) {
        float v[BST_ROW_MEDIAN], sorted[BST_ROW_MEDIAN];
        fill(v, count, (uint64_t)count);
        for (int i = 0; i < count; i++) {
            v[i] = roundf(2.0f * v[i]); /* many equal ones */
            sorted[i] = v[i];
        }
        qsort(sorted, (size_t)count, sizeof *sorted, ascending);
        float middle = sorted[count / 2];
        assert_float_equal(bst_row_median(v, count), middle, fabsf(middle) / 256.0f + 1e-38f);
    }
}

static bool is_top(const float *map, int y, int x, float threshold) {
    float v = map[y * LINE + x];
    for (int j = -1; j <= 1; j++) {
        for (int i = -1; i <= 1; i++) {
            float other = map[(y + j) * LINE + x + i];
            bool before = j < 0 || (j == 0 && i < 0);
            if ((i != 0 || j != 0) && (before ? other >= v : other > v)) {
                return false;
            }
        }
    }
    return v > threshold;
}

/* Exact, for widths that leave rests of lanes, with ties and maxima at both ends. */
static void maxima_exceed_their_neighbours(void **state) {
    (void)state;
    static const int widths[] = {1, 7, 16, 31, 64, 65, 150};
    for (size_t k = 0; k < sizeof widths / sizeof *widths; k++) {
        for (int dense = 0; dense < 2; dense++) {
            static float map[ROWS * LINE];
            memset(map, 0, sizeof map);
            for (int y = 1; y < ROWS - 1; y++) {
                fill(map + y * LINE + PAD, widths[k], (uint64_t)(100 + y));
                for (int x = 0; x < widths[k]; x++) {
                    map[y * LINE + PAD + x] = roundf(4.0f * map[y * LINE + PAD + x]) * 0.25f;
                }
            }
            float threshold = dense ? 0.2f : 1.8f;
            for (int y = 1; y < ROWS - 1; y++) {
                int32_t x[MOST];
                float value[MOST];
                const float *row = map + y * LINE + PAD;
                int n = bst_row_maxima(row - LINE, row, row + LINE, widths[k], threshold, x, value);
                int next = 0;
                for (int i = 0; i < widths[k]; i++) {
                    if (is_top(map, y, PAD + i, threshold)) {
                        assert_true(next < n && x[next] == i && value[next] == row[i]);
                        next++;
                    }
                }
                assert_int_equal(next, n);
            }
        }
    }
}

/* 1e-5: a few roundings of sums of up to nine numbers of order one. */
static void combinations_are_sums(void **state) {
    (void)state;
    static float rows[ROWS][MOST], out[4 * LINE];
    const float *in[ROWS];
    for (int t = 0; t < ROWS; t++) {
        fill(rows[t], MOST, (uint64_t)(200 + t));
        in[t] = rows[t];
    }
    static const float weight[] = {0.5f, 0.3f, 0.2f, -0.1f, 0.05f};
    static const int widths[] = {3, 16, 50, 64, 150};
    for (size_t k = 0; k < sizeof widths / sizeof *widths; k++) {
        for (int radius = 1; radius <= 4; radius++) {
            bst_row_even_4(out, LINE, widths[k], in + radius, weight, radius);
            for (int row = 0; row < 4; row++) {
                for (int x = 0; x < widths[k]; x++) {
                    double sum = 0.0;
                    for (int t = -radius; t <= radius; t++) {
                        sum += (double)weight[abs(t)] * (double)rows[radius + row + t][x];
                    }
                    bst_assert_close((double)out[row * LINE + x], sum, 1e-5);
                }
            }
        }
        for (int taps = 1; taps <= 5; taps++) {
            float *copy = taps % 2 ? out + LINE : NULL;
            bst_row_streak(out, copy, widths[k], in, weight, taps, rows[7]);
            assert_true(!copy || memcmp(copy, out, (size_t)widths[k] * sizeof *out) == 0);
            for (int x = 0; x < widths[k]; x++) {
                double sum = 0.0;
                for (int t = 0; t < taps; t++) {
                    sum += (double)weight[t] * (double)rows[t][x];
                }
                bst_assert_close((double)out[x], fmax(sum, (double)rows[7][x]), 1e-5);
            }
        }
    }
}

/* 1e-4 of a level of 100: single precision on a slope. */
static void normalised_is_signal_over_noise(void **state) {
    (void)state;
    enum { WIDTH = 100 };
    uint16_t raw[WIDTH];
    float electrons[WIDTH + 16], signal[2 * WIDTH + 16], normalised[WIDTH + 16];
    const bst_row_part parts[] = {{32, 100.0f, 0.0f, 0.1f, 0.0f},
                                  {71, 84.0f, 0.5f, 0.2f, -0.001f},
                                  {WIDTH, 119.5f, 0.0f, 0.129f, 0.0f}};
    fill(electrons, WIDTH, 300);
    for (int x = 0; x < WIDTH; x++) {
        electrons[x] = x % 17 == 3 ? BST_PIXEL_BAD : 100.0f + 10.0f * electrons[x];
        raw[x] = x % 13 == 5 ? 60000 : 500;
    }
    bst_row_normalise(&(bst_row_input){raw, NULL, electrons, 60000}, parts, 3, signal, normalised);
    /* from digital numbers: the same operations */
    const bst_row_gain gain = {20.0f, 0.25f};
    float by_gain[WIDTH], same_signal[WIDTH], same[WIDTH], other[WIDTH], *direct = signal + WIDTH;
    bst_row_electrons(raw, WIDTH, gain.offset, gain.gain, by_gain);
    bst_row_normalise(&(bst_row_input){raw, NULL, by_gain, 60000}, parts, 3, same_signal, same);
    bst_row_normalise(&(bst_row_input){raw, &gain, NULL, 60000}, parts, 3, direct, other);
    assert_memory_equal(direct, same_signal, sizeof same_signal);
    assert_memory_equal(other, same, sizeof same);
    for (int x = 0; x < WIDTH; x++) {
        const bst_row_part *p = x < 32 ? &parts[0] : x < 71 ? &parts[1] : &parts[2];
        double d = (double)electrons[x] - ((double)p->level + (double)p->level_slope * x);
        double n = d * ((double)p->inverse + (double)p->inverse_slope * x);
        bool bad = x % 17 == 3;
        bst_assert_close((double)normalised[x], bad ? 0.0 : n, 1e-4);
        if (bad || raw[x] == 60000) {
            assert_true(signal[x] == (bad ? BST_PIXEL_BAD : BST_PIXEL_SATURATED));
        } else {
            bst_assert_close((double)signal[x], d, 1e-4);
        }
    }
}

/* Weighted sums of 1 to 40 rows, which are taken by eights, fours and twos; and symmetric ones. */
static void rows_are_combined(void **state) {
    (void)state;
    enum { TAPS = 40 };
    static float rows[TAPS][MOST];
    const float *in[TAPS];
    float weight[TAPS], out[MOST];
    for (int t = 0; t < TAPS; t++) {
        fill(rows[t], MOST, 1000 + (uint64_t)t);
        in[t] = rows[t];
    }
    fill(weight, TAPS, 2000);
    for (int taps = 1; taps <= TAPS; taps++) {
        int count = 1 + 37 * taps % MOST;
        bst_row_combine(out, count, in, weight, taps);
        for (int x = 0; x < count; x++) {
            double sum = 0.0;
            for (int t = 0; t < taps; t++) {
                sum += (double)weight[t] * (double)rows[t][x];
            }
            bst_assert_close(out[x], sum, 1e-5); /* rounding of up to 40 terms */
        }
    }
    for (int radius = 0; radius <= 12; radius++) {
        int count = 1 + 53 * radius % MOST;
        bst_row_even(out, count, in + 20, weight, radius);
        for (int x = 0; x < count; x++) {
            double sum = (double)weight[0] * (double)rows[20][x];
            for (int t = 1; t <= radius; t++) {
                sum += (double)weight[t] * ((double)rows[20 - t][x] + (double)rows[20 + t][x]);
            }
            bst_assert_close(out[x], sum, 1e-5);
        }
    }
}

/* Count, sum and sum of squares of what lies within a limit of a level, both ends included, added
 * to what is there, for widths that are no multiple of the lanes. */
static void clipped_sums_are_of_what_is_within(void **state) {
    (void)state;
    enum { HIGH = 5, STRIDE = MOST + 3 };
    static float pixels[HIGH * STRIDE];
    fill(pixels, HIGH * STRIDE, 3000);
    for (int width = 1; width <= MOST; width += 13) {
        const float level = 0.25f, limit = 1.5f;
        pixels[0] = level + limit;
        pixels[STRIDE] = level - limit;
        bst_row_sums sums;
        memset(&sums, 0, sizeof sums);
        sums.count[0] = 2.0f;
        sums.sum[0] = 3.0f;
        sums.square[0] = 5.0f;
        bst_row_clipped_sums(pixels, width, HIGH, STRIDE, level, limit, &sums);
        double n = 2.0, sum = 3.0, square = 5.0, got[3] = {0.0, 0.0, 0.0};
        for (int i = 0; i < HIGH * width; i++) {
            double d = (double)(pixels[i / width * STRIDE + i % width] - level);
            bool within = fabs(d) <= 1.5;
            n += within;
            sum += within ? d : 0.0;
            square += within ? d * d : 0.0;
        }
        for (size_t k = 0; k < sizeof sums.sum / sizeof *sums.sum; k++) {
            got[0] += (double)sums.count[k];
            got[1] += (double)sums.sum[k];
            got[2] += (double)sums.square[k];
        }
        bst_assert_close(got[0], n, 0.0);
        bst_assert_close(got[1], sum, 1e-4);
        bst_assert_close(got[2], square, 1e-4);
    }
}

/* A bright pixel hides those within two columns and two rows of it, and no others. */
static void neighbours_of_bright_pixels_are_masked(void **state) {
    (void)state;
    enum { NEAR = BST_ROW_NEAR, HIGH = 2 * BST_ROW_NEAR + 1 };
    static float rows[HIGH][LINE];
    const float *in[HIGH];
    float out[LINE];
    for (int n = 0; n < 40; n++) {
        int count = 3 + 17 * n % (MOST - 3), bright_row = n % HIGH, at = 11 * n % (count + 4) - 2;
        for (int k = 0; k < HIGH; k++) {
            fill(rows[k], LINE, 4000 + (uint64_t)k);
            in[k] = rows[k] + PAD;
        }
        rows[bright_row][PAD + at] = 9.0f;
        for (int x = 0; x < count + 1; x++) {
            out[x] = 1.0f;
        }
        bst_row_mask(in, count, 8.0f, out);
        for (int x = 0; x < count; x++) {
            bool near = abs(x - at) <= NEAR;
            assert_true(out[x] == (near ? BST_PIXEL_BAD : 1.0f));
        }
        assert_true(out[count] == 1.0f);
        out[0] = 1.0f;
        bst_row_mask(in, 1, 10.0f, out); /* nothing exceeds it */
        assert_true(out[0] == 1.0f);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(rows_are_combined),
        cmocka_unit_test(clipped_sums_are_of_what_is_within),
        cmocka_unit_test(neighbours_of_bright_pixels_are_masked),
        cmocka_unit_test(median_is_the_middle_value),
        cmocka_unit_test(maxima_exceed_their_neighbours),
        cmocka_unit_test(combinations_are_sums),
        cmocka_unit_test(normalised_is_signal_over_noise),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
