/* Pixels of stars for a PSF, from frames that are no square, in windows off the corner; and what is
 * written of a PSF with two nodes. Linked with wraps of what reads frames, fits and writes. */
#include <stdlib.h>

#include "sim/analysis/camera/camera_psf.h"
#include "sim/io/fits_reader.h"
#include "sim/io/psf_fits.h"
#include "tests/test_support.h"

#define WRAP(type, name, arguments) \
    type __wrap_##name arguments;   \
    type __wrap_##name arguments

enum { WIDTH = 50, HEIGHT = 34, HALF = 6, SIDE = 2 * HALF + 1, STARS = 6, FRAMES = 3 };
enum { PARTS = BST_EFFECTIVE_PSF_PARTS };

static uint16_t counts[FRAMES][WIDTH * HEIGHT];
static bst_fits_file_info info;
static int reads, closed;
static int64_t first_index;
static double read_noise_e;

WRAP(bst_status, bst_fits_reader_open, (bst_ctx * ctx, const char *path, bst_fits_reader **out)) {
    (void)ctx;
    assert_string_equal(path, "frames.fits");
    *out = (void *)&info;
    return BST_OK;
}

WRAP(const bst_fits_file_info *, bst_fits_reader_info, (const bst_fits_reader *reader)) {
    (void)reader;
    return &info;
}

WRAP(bst_status, bst_fits_reader_frame,
     (bst_ctx * ctx, bst_fits_reader *reader, int64_t index, bst_fits_read_frame *out)) {
    (void)ctx;
    (void)reader;
    assert_in_range(index, 0, FRAMES - 1);
    reads++;
    *out = (bst_fits_read_frame){.pixels = counts[index], .width = WIDTH, .height = HEIGHT};
    return BST_OK;
}

WRAP(void, bst_fits_reader_close, (bst_fits_reader * reader)) {
    (void)reader;
    closed++;
}

/* Stars of sensor pixels; window of frame k; the third frame has no star for a PSF. */
static const int windows[FRAMES][2] = {{100, 20}, {7, 60}, {0, 0}};
static const struct {
    int frame;
    double x, y;
} places[STARS] = {{0, 110.3, 30.4}, {0, 130.6, 40.7}, {0, 104.0, 35.0}, /* at the left border */
                   {2, 20.0, 15.0},  {1, 50.1, 86.9},  {1, 33.2, 68.2}};
static const int taken[] = {0, 1, 4, 5};

static double count_at(int frame, int x, int y) {
    return 500.0 + 7.0 * ((x * 31 + y * 17 + frame * 5) % 23) + 40.0 * ((x + 2 * y) % 3 == 0);
}

static int by_value(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

WRAP(bst_status, bst_effective_psf_fit,
     (bst_ctx * ctx, const bst_effective_psf_star *stars, int count,
      const bst_effective_psf_options *o, bst_effective_psf *out)) {
    (void)ctx;
    (void)out;
    assert_int_equal(o->half_px, HALF);
    assert_int_equal(count, 4);
    for (int k = 0; k < 4; k++) {
        const bst_effective_psf_star *s = &stars[k];
        int f = places[taken[k]].frame;
        double x = places[taken[k]].x, y = places[taken[k]].y, border[4 * SIDE - 4];
        int n = 0, x0 = (int)round(x) - HALF, y0 = (int)round(y) - HALF; /* on the sensor */
        for (int i = 0; i < SIDE * SIDE; i++) {
            int u = i % SIDE, v = i / SIDE;
            double e = 1.5 * count_at(f, x0 + u - windows[f][0], y0 + v - windows[f][1]);
            bst_assert_close((double)s->pixels[i], e, 0.0);
            if (u == 0 || v == 0 || u == SIDE - 1 || v == SIDE - 1) {
                border[n++] = e;
            }
        }
        qsort(border, (size_t)n, sizeof *border, by_value);
        double middle = border[n / 2];
        for (int i = 0; i < n; i++) {
            border[i] = fabs(border[i] - middle);
        }
        qsort(border, (size_t)n, sizeof *border, by_value);
        /* at least half of the read noise */
        bst_assert_close(s->noise_e, fmax(1.4826 * border[n / 2], 0.5 * read_noise_e), 1e-9);
        bst_assert_close(s->x_px, x - round(x), 1e-9);
        bst_assert_close(s->y_px, y - round(y), 1e-9);
        bst_assert_close(s->field_x, x / 199.0, 1e-12);
        bst_assert_close(s->field_y, y / 149.0, 1e-12);
        assert_int_equal(s->part, (900 + 13 * taken[k]) % PARTS);
    }
    return BST_OK;
}

static void pixels_of_stars(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_camera camera = {.width_px = 200, .height_px = 150, .gain_e_per_dn = 1.5};
    bst_camera_fit_star stars[STARS] = {{.id = 0}};
    int64_t index[STARS];
    int window[2 * STARS];
    for (int f = 0; f < FRAMES; f++) {
        for (int i = 0; i < WIDTH * HEIGHT; i++) {
            counts[f][i] = (uint16_t)count_at(f, i % WIDTH, i / WIDTH);
        }
    }
    for (int cube = 0; cube < 2; cube++) {
        info = (bst_fits_file_info){.frames = FRAMES, .cube = cube};
        camera.read_noise_e = read_noise_e = cube ? 900.0 : 4.0;
        first_index = cube ? 0 : 1; /* extensions count from 1 */
        for (int i = 0; i < STARS; i++) {
            int f = places[i].frame;
            stars[i].id = 900 + 13 * i;
            stars[i].x_px = places[i].x;
            stars[i].y_px = places[i].y;
            index[i] = f == 2 ? -1 : f + first_index;
            window[2 * i] = windows[f][0];
            window[2 * i + 1] = windows[f][1];
        }
        reads = closed = 0;
        const bst_camera_psf_stars all = {"frames.fits", &camera, stars, index, window, STARS};
        const bst_effective_psf_options options = {.columns = 1, .rows = 1, .half_px = HALF};
        bst_effective_psf psf;
        bst_assert_ok(&ctx, bst_camera_psf_fit(&ctx, &all, &options, &psf));
        assert_int_equal(reads, 2); /* each frame once */
        assert_int_equal(closed, 1);
    }
}

/* ---------------------------------------------------------------- files */

enum { OVER = BST_EFFECTIVE_PSF_OVERSAMPLING, S = 2 * HALF * OVER + 1, SAMPLES = S * S, NODES = 2 };
static float written[2][NODES * SAMPLES];
static int files;

WRAP(bst_status, bst_psf_fits_write, (bst_ctx * ctx, const char *path, const bst_psf_samples *p)) {
    (void)ctx;
    assert_string_equal(path, files ? "out/psf_sigma.fits" : "out/psf.fits");
    memcpy(written[files++], p->samples, sizeof written[0]);
    return BST_OK;
}

/* A Gaussian over pixels, wider along x by node and part. */
static void plane_of(int node, int part, double *plane) {
    double sx = (0.9 + 0.2 * node + 0.01 * part) * sqrt(2.0), sy = (0.8 - 0.005 * part) * sqrt(2.0);
    for (int k = 0; k < SAMPLES; k++) {
        double u = (k % S - S / 2) / (double)OVER, v = (k / S - S / 2) / (double)OVER;
        plane[k] = 0.25 * (erf((u + 0.5) / sx) - erf((u - 0.5) / sx)) *
                   (erf((v + 0.5) / sy) - erf((v - 0.5) / sy));
    }
}

static double jackknife(const double *without) {
    double mean = 0.0, sum = 0.0;
    for (int p = 0; p < PARTS; p++) {
        mean += without[p] / PARTS;
    }
    for (int p = 0; p < PARTS; p++) {
        sum += (without[p] - mean) * (without[p] - mean);
    }
    return sqrt((PARTS - 1.0) / PARTS * sum);
}

static double number(const cJSON *node, const char *key, const char *field) {
    const cJSON *item = cJSON_GetObjectItem(cJSON_GetObjectItem(node, key), field);
    assert_non_null(item);
    return cJSON_IsNumber(item) ? item->valuedouble : strtod(item->valuestring, NULL);
}

static void files_of_two_nodes(void **state) {
    (void)state;
    static double value[NODES * SAMPLES], without[PARTS * NODES * SAMPLES], plane[SAMPLES],
        undone[1 + PARTS][SAMPLES], errors[SAMPLES], pooled[SAMPLES];
    bst_ctx ctx = {0};
    bst_effective_psf psf = {.options = {.columns = 2, .rows = 1, .half_px = HALF},
                             .side = S,
                             .value = value,
                             .without = without,
                             .stars = 55,
                             .iterations = 17,
                             .chi_squared = 0.97,
                             .form_error = 0.012};
    for (int n = 0; n < NODES; n++) {
        plane_of(n, 0, value + n * SAMPLES);
        for (int p = 0; p < PARTS; p++) {
            plane_of(n, 1 + p, without + (p * NODES + n) * SAMPLES);
        }
    }
    cJSON *report = cJSON_CreateObject();
    bst_assert_ok(&ctx, bst_camera_psf_write(&ctx, "out", &psf, report));
    assert_int_equal(files, 2);
    const cJSON *root = cJSON_GetObjectItem(report, "psf_file");
    static const char *const keys[] = {"stars",     "iterations",     "columns",   "rows",
                                       "radius_px", "chi2_per_pixel", "form_error"};
    const double expected[] = {55, 17, 2, 1, HALF, 0.97, 0.012};
    for (int k = 0; k < 7; k++) {
        const cJSON *item = cJSON_GetObjectItem(root, keys[k]);
        bst_assert_close(cJSON_IsNumber(item) ? item->valuedouble : strtod(item->valuestring, NULL),
                         expected[k], 1e-12);
    }
    for (int n = 0; n < NODES; n++) {
        const cJSON *node = cJSON_GetArrayItem(cJSON_GetObjectItem(root, "nodes"), n);
        double xx[PARTS], yy[PARTS], light[PARTS];
        for (int p = 0; p <= PARTS; p++) {
            plane_of(n, p, plane);
            bst_assert_ok(&ctx, bst_effective_psf_undo_pixel(&ctx, plane, S, undone[p]));
            bst_effective_psf_figures f = bst_effective_psf_measure(undone[p], S);
            if (p == 0) {
                double sx = 0.9 + 0.2 * n;
                /* a Gaussian, 0.5 % wider by what limits the noise */
                bst_assert_close(number(node, "xx_px2", "value"), sx * sx, 0.01);
                bst_assert_close(number(node, "yy_px2", "value"), 0.64, 0.01);
                bst_assert_close(number(node, "xy_px2", "value"), 0.0, 1e-6);
                bst_assert_close(number(node, "encircled_1.5_px", "value"), f.encircled[2], 1e-12);
            } else {
                xx[p - 1] = f.xx_px2;
                yy[p - 1] = f.yy_px2;
                light[p - 1] = f.encircled[2];
            }
        }
        bst_assert_close(number(node, "xx_px2", "standard_error"), jackknife(xx), 1e-12);
        bst_assert_close(number(node, "yy_px2", "standard_error"), jackknife(yy), 1e-12);
        bst_assert_close(number(node, "encircled_1.5_px", "standard_error"), jackknife(light),
                         1e-12);
        for (int k = 0; k < SAMPLES; k++) {
            double parts[PARTS];
            for (int p = 0; p < PARTS; p++) {
                parts[p] = undone[1 + p][k];
            }
            errors[k] = jackknife(parts);
        }
        bst_effective_psf_pool_errors(errors, S, pooled);
        for (int k = 0; k < SAMPLES; k++) {
            bst_assert_close((double)written[0][n * SAMPLES + k], undone[0][k], 1e-8); /* floats */
            bst_assert_close((double)written[1][n * SAMPLES + k], pooled[k], 1e-6 * pooled[k]);
        }
    }
    cJSON_Delete(report);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(pixels_of_stars),
                                       cmocka_unit_test(files_of_two_nodes)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
