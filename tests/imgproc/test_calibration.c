/* Calibration maps that come from files: what is refused and in which words, and what they do to
 * photometry. */
#include <fitsio.h>

#include "imgproc/calibrate/bad_map.h"
#include "imgproc/calibrate/calibration.h"
#include "tests/imgproc/module_support.h"
#include "tests/io/scratch.h"

static const char *write_map(scratch *place, const char *name, const float *map, int width,
                             int height) {
    const char *path = scratch_path(place, name);
    fitsfile *file = NULL;
    int code = 0;
    long size[2] = {width, height};
    fits_create_diskfile(&file, path, &code);
    fits_create_img(file, FLOAT_IMG, 2, size, &code);
    fits_write_img(file, TFLOAT, 1, (LONGLONG)width * height, (void *)(uintptr_t)map, &code);
    fits_close_file(file, &code);
    assert_int_equal(code, 0);
    return path;
}

typedef struct fixture {
    bst_ctx ctx;
    scratch place;
    bst_camera camera;
    bst_imgproc_config config;
    float map[6]; /* 3 x 2 */
} fixture;

static fixture begin(void) {
    fixture f = {.camera = {.width_px = 3, .height_px = 2}};
    scratch_make(&f.place);
    for (int i = 0; i < 6; i++) {
        f.map[i] = 1.0f;
    }
    return f;
}

static void refuse(fixture *f, bst_status status, const char *key, const char *path,
                   const char *reason) {
    char message[1200];
    bst_imgproc_maps maps;
    assert_int_equal(bst_calibration_load(&f->ctx, &f->config, &f->camera, &maps), status);
    snprintf(message, sizeof message, "%s: %s: %s", key, path, reason);
    assert_string_equal(f->ctx.message, message);
    assert_null(maps.dark_e_per_s);
    assert_null(maps.flat);
    assert_null(maps.bad);
}

static void wrong_maps_are_refused(void **state) {
    (void)state;
    fixture f = begin();
    char *const files[] = {f.config.dark_file, f.config.flat_file, f.config.bad_pixel_file};
    static const char *const keys[] = {"dark_file", "flat_file", "bad_pixel_file"};
    for (int i = 0; i < 3; i++) {
        snprintf(files[i], 512, "%.511s", scratch_path(&f.place, "absent.fits"));
        refuse(&f, BST_ERR_NOT_FOUND, keys[i], files[i],
               "cannot be opened: No such file or directory; give a FITS file");
        char name[16];
        snprintf(name, sizeof name, "turned%d", i);
        snprintf(files[i], 512, "%.511s", write_map(&f.place, name, f.map, 2, 3));
        refuse(&f, BST_ERR_CONFIG, keys[i], files[i],
               "an image of 2 x 3 pixels (allowed: the sensor's 3 x 2)");
        files[i][0] = '\0';
    }
    f.map[5] = NAN;
    snprintf(f.config.dark_file, 512, "%.511s", write_map(&f.place, "nan.fits", f.map, 3, 2));
    refuse(&f, BST_ERR_CONFIG, "dark_file", f.config.dark_file,
           "pixel (2, 1) is nan (allowed: finite numbers; or mark it in bad_pixel_file)");
    f.config.dark_file[0] = '\0';
    snprintf(f.config.flat_file, 512, "%.511s", scratch_path(&f.place, "nan.fits"));
    refuse(&f, BST_ERR_CONFIG, "flat_file", f.config.flat_file,
           "pixel (2, 1) is nan (allowed: finite numbers above 0; or mark it in bad_pixel_file)");
    f.map[1] = 0.0f;
    snprintf(f.config.flat_file, 512, "%.511s", write_map(&f.place, "zero.fits", f.map, 3, 2));
    refuse(&f, BST_ERR_CONFIG, "flat_file", f.config.flat_file,
           "pixel (1, 0) is 0 (allowed: finite numbers above 0; or mark it in bad_pixel_file)");
    /* pixels that are bad anyway may have any value; blank means bad */
    float bad[6] = {0, 1, 0, 0, 0, NAN};
    snprintf(f.config.bad_pixel_file, 512, "%.511s", write_map(&f.place, "bad.fits", bad, 3, 2));
    bst_imgproc_maps maps;
    bst_assert_ok(&f.ctx, bst_calibration_load(&f.ctx, &f.config, &f.camera, &maps));
    static const uint8_t expected[6] = {0, 1, 0, 0, 0, 1};
    assert_memory_equal(maps.bad, expected, 6);
    assert_null(maps.dark_e_per_s);
    bst_assert_close(maps.flat[0], 1.0f, 0.0);
    bst_calibration_free(&maps);
    scratch_remove(&f.place);
}

/* The module's own error carries key and file through the engine. */
static void the_module_says_which_file(void **state) {
    (void)state;
    bench b;
    bench_init(&b);
    onboard_add_telemetry(&b.o, 0, 0);
    bst_assert_ok(&b.o.ctx, bench_configure(&b, "{\"flat_file\": \"absent.fits\"}"));
    assert_int_equal(bench_load(&b, 1000, 1000, false), BST_ERR_NOT_FOUND);
    assert_string_equal(b.o.ctx.message,
                        "imgproc: flat_file: absent.fits: cannot be opened: No such file or "
                        "directory; give a FITS file");
    bench_free(&b);
}

enum { HOT_COLUMN = 130, LIGHTS = 25, FIRST_X = 90, SPACING = 80, DEAD_X = 300, DEAD_Y = 200 };

/* Sources of 20,000 e- on a grid; every fifth lies on the hot column. */
static void place_of(int i, double *x, double *y) {
    *x = i % 5 == 0 ? HOT_COLUMN + 0.3 : FIRST_X + SPACING * (i % 5) + 0.37;
    *y = FIRST_X + SPACING * (i / 5) + 0.21;
}

/* Mean of (measured - true) / true flux, over all sources; those on the hot column in *hot. */
static double bias_of(const bst_detections *d, double flux, double *hot) {
    double sum = 0.0, hot_sum = 0.0;
    for (int i = 0; i < LIGHTS; i++) {
        double x, y;
        place_of(i, &x, &y);
        int n = synthetic_nearest(d, x, y, 1.5);
        assert_true(n >= 0);
        double error = d->items[n].flux_e / flux - 1.0;
        sum += error / LIGHTS;
        hot_sum += i % 5 == 0 ? error / 5 : 0.0;
    }
    *hot = hot_sum;
    return sum;
}

/* A column of 400 e-/s (15 sigma a pixel), a flat that falls to 0.6 in the corners, and a dead
 * pixel that reads nothing. */
static void hot_column_and_vignetting_are_taken_off(void **state) {
    (void)state;
    const double flux = 20000.0, column_e_per_s = 400.0;
    scratch place;
    scratch_make(&place);
    size_t count = (size_t)ONBOARD_SIDE * ONBOARD_SIDE;
    float *dark = calloc(count, sizeof *dark), *flat = calloc(count, sizeof *flat),
          *bad = calloc(count, sizeof *bad);
    assert_true(dark && flat && bad);
    double seconds = (double)BENCH_EXPOSURE / ONBOARD_RATE;
    char paths[3][512], text[2048];
    for (int y = 0; y < ONBOARD_SIDE; y++) {
        for (int x = 0; x < ONBOARD_SIDE; x++) {
            double r2 =
                ((x - 255.5) * (x - 255.5) + (y - 255.5) * (y - 255.5)) / (2 * 255.5 * 255.5);
            dark[y * ONBOARD_SIDE + x] = x == HOT_COLUMN ? (float)column_e_per_s : 0.0f;
            flat[y * ONBOARD_SIDE + x] = (float)(1.0 - 0.4 * r2);
        }
    }
    size_t dead = (size_t)DEAD_Y * ONBOARD_SIDE + DEAD_X;
    bad[dead] = 1.0f;
    flat[dead] = 0.0f;
    snprintf(paths[0], 512, "%.511s",
             write_map(&place, "dark.fits", dark, ONBOARD_SIDE, ONBOARD_SIDE));
    snprintf(paths[1], 512, "%.511s",
             write_map(&place, "flat.fits", flat, ONBOARD_SIDE, ONBOARD_SIDE));
    snprintf(paths[2], 512, "%.511s",
             write_map(&place, "bad.fits", bad, ONBOARD_SIDE, ONBOARD_SIDE));
    snprintf(text, sizeof text,
             "{\"dark_file\": \"%s\", \"flat_file\": \"%s\", \"bad_pixel_file\": \"%s\"}", paths[0],
             paths[1], paths[2]);
    for (int with = 0; with < 2; with++) {
        bench b;
        bench_init(&b);
        b.s.sky_e = 100.0;
        synthetic_clear(&b.s);
        for (int i = 0; i < LIGHTS; i++) {
            double x, y;
            place_of(i, &x, &y);
            synthetic_add(&b.s, x, y, flux, 0, 0);
        }
        for (size_t k = 0; k < count; k++) {
            b.s.mean_e[k] = b.s.mean_e[k] * (double)flat[k] + (double)dark[k] * seconds;
        }
        synthetic_expose(&b.s, bst_rng_make_key(9, 0, "test", "maps"), 1);
        onboard_add_telemetry(&b.o, 0, 0);
        bst_assert_ok(&b.o.ctx, bench_configure(&b, with ? text : "{}"));
        bst_assert_ok(&b.o.ctx, bench_load(&b, 1000, 1000, false));
        bst_assert_ok(&b.o.ctx, bst_engine_run(&b.o.ctx, b.o.engine, 1001));
        assert_int_equal(b.count, 1);
        double hot, bias = bias_of(b.kept[0], flux, &hot);
        if (with) {
            /* a source's flux is good to 1/sqrt(20000) and the sky's noise, together 1 %, on the
             * hot column (19 e- of noise a pixel) little more; means of 25 and 5, four sigma */
            bst_assert_close(bias, 0.0, 0.01);
            bst_assert_close(hot, 0.0, 0.02);
            /* nothing but the sources, the chance detections aside (one expected) */
            assert_true(b.kept[0]->count <= LIGHTS + 6);
            assert_true(synthetic_nearest(b.kept[0], DEAD_X, DEAD_Y, 2.0) < 0);
        } else {
            /* the flat's mean at the sources is 0.93; the column shows beside its sources */
            assert_true(bias < -0.03);
            assert_true(b.kept[0]->count > LIGHTS + 6);
        }
        bench_free(&b);
    }
    free(dark);
    free(flat);
    free(bad);
    scratch_remove(&place);
}

/* Listed pixels and those of a map, on sensors that are not square; pixels beyond either side are
 * refused. */
static void listed_bad_pixels(void **state) {
    (void)state;
    for (int tall = 0; tall < 2; tall++) {
        const int width = tall ? 30 : 47, height = tall ? 47 : 30;
        const bst_camera camera = {.width_px = width, .height_px = height};
        uint8_t map[30 * 47] = {0}, *out = NULL;
        map[5 * width + 28] = 1;
        bst_imgproc_bad_pixel all[3] = {{3, 11}, {width - 1, 0}, {7, height - 1}};
        const bst_config_list list = {all, 3};
        bst_imgproc_maps maps = {0};
        maps.bad = map;
        bst_ctx ctx = {0};
        bst_assert_ok(&ctx, bst_bad_map_create(&ctx, &camera, &maps, &list, &out));
        for (int y = 0; y < height; y++) {
            for (int x = 0; x < width; x++) {
                bool bad = x == 28 && y == 5;
                for (int k = 0; k < 3; k++) {
                    bad = bad || (x == all[k].x && y == all[k].y);
                }
                assert_int_equal(out[y * width + x], bad);
            }
        }
        free(out);
        for (int k = 0; k < 2; k++) { /* one beyond the shorter side alone */
            all[2] = (bst_imgproc_bad_pixel){k ? 0 : width, k ? height : 0};
            assert_int_equal(bst_bad_map_create(&ctx, &camera, &maps, &list, &out), BST_ERR_CONFIG);
            assert_non_null(strstr(ctx.message, "bad_pixels/2"));
            free(out);
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(wrong_maps_are_refused),
        cmocka_unit_test(listed_bad_pixels),
        cmocka_unit_test(the_module_says_which_file),
        cmocka_unit_test(hot_column_and_vignetting_are_taken_off),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
