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

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(median_is_the_middle_value),
        cmocka_unit_test(maxima_exceed_their_neighbours),
        cmocka_unit_test(combinations_are_sums),
        cmocka_unit_test(normalised_is_signal_over_noise),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
