/* Pictures, plots and the quicklook. With BST_KEEP_PICTURES=folder the pictures are left there. */
#include <stdint.h>

#include "boresight/messages.h"
#include "boresight/rng.h"
#include "sim/io/picture.h"
#include "sim/io/plot.h"
#include "sim/io/quicklook.h"
#include "tests/io/plot_script.h"

enum { SIZE = 512 };

/* Width and height from the header of a PNG (ISO/IEC 15948, section 11.2.2); false when it is none.
 */
static bool png_size(const char *path, unsigned size[2]) {
    static const unsigned char magic[8] = {0x89, 'P', 'N', 'G', 13, 10, 26, 10};
    unsigned char b[24] = {0};
    FILE *f = fopen(path, "rb");
    bool ok = f && fread(b, 1, sizeof b, f) == sizeof b && memcmp(b, magic, 8) == 0;
    if (f) {
        fclose(f);
    }
    for (int i = 0; i < 2; i++) {
        const unsigned char *p = b + 16 + 4 * i;
        size[i] = (unsigned)p[0] << 24 | (unsigned)p[1] << 16 | (unsigned)p[2] << 8 | p[3];
    }
    return ok;
}

static void keep(const char *path, const char *name) {
    const char *folder = getenv("BST_KEEP_PICTURES");
    if (folder) {
        char to[1024];
        snprintf(to, sizeof to, "%s/%s", folder, name);
        if (rename(path, to) != 0) {
            print_message("%s: not kept\n", to);
        }
    }
}

/* A sky of streaked stars and a target, so that the picture can be judged by eye. */
static void draw_sky(uint16_t *pixels, double target_x, double target_y, uint64_t frame,
                     bst_io_mark *marks, int stars) {
    bst_rng_key key = bst_rng_make_key(1, 0, "test", "sky");
    float *sky = calloc((size_t)SIZE * SIZE, sizeof *sky);
    assert_non_null(sky);
    for (int s = 0; s <= stars; s++) {
        bool target = s == stars;
        double x = target ? target_x : SIZE * bst_rng_uniform(key, frame, 3 * (uint64_t)s);
        double y = target ? target_y : SIZE * bst_rng_uniform(key, frame, 3 * (uint64_t)s + 1);
        double flux =
            target ? 1200.0 : 150.0 * pow(bst_rng_uniform(key, frame, 3 * (uint64_t)s + 2), -1.2);
        int steps = target ? 1 : 9;
        marks[s] = (bst_io_mark){
            .x_px = x, .y_px = y, .kind = target ? BST_MARK_DETECTION : BST_MARK_STAR};
        for (int k = 0; k < steps; k++) {
            double cx = x + (target ? 0.0 : 1.2 * (k - 4)), cy = y + (target ? 0.0 : 0.5 * (k - 4));
            for (int j = (int)cy - 6; j <= (int)cy + 6; j++) {
                for (int i = (int)cx - 6; i <= (int)cx + 6; i++) {
                    if (i >= 0 && j >= 0 && i < SIZE && j < SIZE) {
                        double r2 = (i - cx) * (i - cx) + (j - cy) * (j - cy);
                        sky[j * SIZE + i] +=
                            (float)(flux / steps / (2 * BST_PI * 0.72) * exp(-r2 / (2 * 0.72)));
                    }
                }
            }
        }
    }
    bst_rng_key noise = bst_rng_make_key(1, 0, "test", "noise");
    for (uint64_t i = 0; i < SIZE * SIZE; i++) {
        double v = 300.0 + sky[i] + 9.0 * bst_rng_normal(noise, frame, i);
        pixels[i] = (uint16_t)fmin(fmax(v, 0.0), 65535.0);
    }
    free(sky);
}

static void test_quicklook(void **state) {
    (void)state;
    scratch s;
    scratch_make(&s);
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_INFO);
    uint16_t *pixels[2];
    bst_io_mark marks[2][61];
    for (int i = 0; i < 2; i++) {
        pixels[i] = malloc(sizeof(uint16_t) * SIZE * SIZE);
        assert_non_null(pixels[i]);
    }
    draw_sky(pixels[0], 400.2, 90.0, 0, marks[0], 60);
    draw_sky(pixels[1], 255.8, 255.4, 1, marks[1], 60);
    bst_quicklook_frame frames[2] = {
        {.title = "First frame",
         .time = "2022-06-16T22:10:00.250Z   t = 0.25 s",
         .mode = "search",
         .track_label = "none"},
        {.title = "Last frame",
         .time = "2022-06-16T22:14:59.250Z   t = 299.25 s",
         .mode = "track",
         .has_track = true,
         .track_label = "track 1   SNR 13.2   error 0.31 px"},
    };
    for (int i = 0; i < 2; i++) {
        frames[i].pixels = pixels[i];
        frames[i].width = frames[i].height = SIZE;
        frames[i].detections = marks[i];
        frames[i].detection_count = 61;
        frames[i].has_target = true;
        frames[i].target_x_px = frames[i].track_x_px = marks[i][60].x_px;
        frames[i].target_y_px = frames[i].track_y_px = marks[i][60].y_px;
        frames[i].boresight_x_px = frames[i].boresight_y_px = (SIZE - 1) / 2.0;
        frames[i].pixel_scale_arcsec = 3.0;
    }
    frames[1].track_x_px += 0.2;
    char path[700];
    snprintf(path, sizeof path, "%s/quicklook.png", s.folder);
    bst_assert_ok(&ctx, bst_quicklook_write(&ctx, path, "neossat_geo_track: NEOSSat follows GX5",
                                            &frames[0], &frames[1]));
    unsigned two[2], one[2];
    assert_true(png_size(path, two));
    assert_int_equal(scratch_count(s.folder), 1);
    keep(path, "quicklook.png");
    /* the target beside the frame: an arrow shows where */
    frames[0].target_x_px = 900.0;
    bst_assert_ok(&ctx, bst_quicklook_write(&ctx, path, "Target outside", &frames[0], &frames[1]));
    assert_true(png_size(path, one));
    keep(path, "quicklook_outside.png");
    /* hostile input: marks that are nowhere, a flat frame, a tiny frame, no second panel */
    marks[0][0].x_px = NAN;
    marks[0][1].x_px = 1e300;
    frames[0].target_x_px = -INFINITY;
    memset(pixels[0], 0, sizeof(uint16_t) * SIZE * SIZE);
    bst_assert_ok(&ctx, bst_quicklook_write(&ctx, path, NULL, &frames[0], NULL));
    assert_true(png_size(path, one));
    /* under one panel the legend takes a row more */
    assert_true(one[0] < two[0] && one[1] == two[1] + 24);
    frames[0].width = 1;
    frames[0].height = 3;
    bst_assert_ok(&ctx, bst_quicklook_write(&ctx, path, NULL, &frames[0], NULL));
    /* a slit: its panel is narrower than the inset's usual side */
    const int slit[2] = {64, 1024};
    for (int i = 0; i < 2; i++) {
        frames[0].width = slit[i];
        frames[0].height = slit[1 - i];
        frames[0].boresight_x_px = 0.5 * (frames[0].width - 1);
        frames[0].boresight_y_px = 0.5 * (frames[0].height - 1);
        bst_assert_ok(&ctx, bst_quicklook_write(&ctx, path, NULL, &frames[0], NULL));
    }
    frames[0].width = 0;
    assert_int_equal(bst_quicklook_write(&ctx, path, NULL, &frames[0], NULL), BST_ERR_ARGUMENT);
    free(pixels[0]);
    free(pixels[1]);
    scratch_remove(&s);
}

/* Sorted by importance; equal ones and places that are not numbers do no harm. */
static void test_mark_sort(void **state) {
    (void)state;
    bst_io_mark marks[5] = {{.importance = 3.0, .x_px = NAN},
                            {.importance = INFINITY, .x_px = 1},
                            {.importance = 0.0},
                            {.importance = 7.5},
                            {.importance = 3.0}};
    bst_io_mark_sort(marks, 5);
    const double expected[5] = {INFINITY, 7.5, 3.0, 3.0, 0.0};
    for (int i = 0; i < 5; i++) {
        assert_true(marks[i].importance == expected[i]);
    }
    assert_true(marks[0].x_px == 1);
}

static void test_stretch(void **state) {
    (void)state;
    /* a normal background: median and the sigma from the lower quartile, known in closed form */
    enum { N = 256 };
    uint16_t *pixels = malloc(sizeof(uint16_t) * N * N);
    assert_non_null(pixels);
    bst_rng_key key = bst_rng_make_key(2, 0, "test", "stretch");
    for (uint64_t i = 0; i < N * N; i++) {
        pixels[i] = (uint16_t)lround(1000.0 + 20.0 * bst_rng_normal(key, 0, i));
    }
    bst_io_stretch s = bst_io_stretch_of(pixels, N, N);
    /* whole DN: 1 DN of the median, 1.5 DN of 1.4826 times the quartile */
    bst_assert_close(s.black, 1000.0 - 20.0, 3.0);
    bst_assert_close(s.softening, 30.0, 3.5);
    assert_true(s.white > s.black);
    memset(pixels, 0, sizeof(uint16_t) * N * N);
    s = bst_io_stretch_of(pixels, N, N);
    assert_true(s.white > s.black && s.softening > 0.0);
    free(pixels);
}

static void test_picture_errors(void **state) {
    (void)state;
    scratch s;
    scratch_make(&s);
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_INFO);
    bst_picture *p;
    assert_int_equal(bst_picture_create(&ctx, 0, 5, (bst_io_colour){0, 0, 0}, &p),
                     BST_ERR_ARGUMENT);
    bst_assert_ok(&ctx, bst_picture_create(&ctx, 40, 30, (bst_io_colour){0, 0, 0}, &p));
    const uint16_t dot = 5;
    const bst_io_stretch stretch = {0, 10, 1};
    assert_int_equal(
        bst_picture_frame(&ctx, p, (bst_io_box){30, 0, 20, 20}, &dot, 1, 1, 0, 0, 1, 1, stretch),
        BST_ERR_ARGUMENT);
    /* a part that lies outside the frame is black, not a crash */
    bst_assert_ok(&ctx, bst_picture_frame(&ctx, p, (bst_io_box){0, 0, 20, 20}, &dot, 1, 1, -50, 80,
                                          4, 4, stretch));
    double narrow = bst_picture_text(p, 1, 20, 8, (bst_io_colour){255, 255, 255}, false, "I");
    assert_true(bst_picture_text_width(8, false, "III") > 2.5 * narrow);
    assert_int_equal(bst_picture_save(&ctx, p, scratch_path(&s, "no/a.png")), BST_ERR_IO);
    bst_assert_ok(&ctx, bst_picture_save(&ctx, p, scratch_path(&s, "a.png")));
    unsigned size[2];
    assert_true(png_size(scratch_path(&s, "a.png"), size));
    assert_int_equal(size[0], 40);
    assert_int_equal(size[1], 30);
    bst_picture_free(p);
    scratch_remove(&s);
}

static void count_log(void *user, bst_log_level level, const char *message) {
    *(int *)user += level == BST_LOG_WARNING && strstr(message, "gnuplot") != NULL;
}

static void test_pointing_plot(void **state) {
    (void)state;
    scratch s;
    scratch_make(&s);
    int warnings = 0;
    bst_ctx ctx;
    bst_ctx_init(&ctx, count_log, &warnings, BST_LOG_INFO);
    enum { N = 300 };
    bst_io_pointing_point points[N];
    bst_rng_key key = bst_rng_make_key(3, 0, "test", "plot");
    for (int i = 0; i < N; i++) {
        double n[2];
        bst_rng_normal2(key, 0, (uint64_t)i, n);
        double lead = i < 4 ? 720.0 : i < 22 ? 600.0 - 25.0 * i : 40.0 * exp(-(i - 22) / 3.0);
        points[i] = (bst_io_pointing_point){.time_s = i + 0.25,
                                            .dx_px = lead + 0.25 * n[0],
                                            .dy_px = 0.3 * lead + 0.25 * n[1],
                                            .mode = i < 4    ? BST_MODE_SLEW
                                                    : i < 22 ? BST_MODE_SEARCH
                                                    : i < 30 ? BST_MODE_ACQUIRE
                                                             : BST_MODE_TRACK,
                                            .in_track = i >= 34,
                                            .counted = i >= 36,
                                            .visible = i != 100};
    }
    char path[700];
    /* a name that needs quoting */
    snprintf(path, sizeof path, "%s/it's \"pointing\".png", s.folder);
    bool made = false;
    bst_assert_ok(&ctx,
                  bst_io_pointing_plot(&ctx, path, "neossat_geo_track: boresight to true target",
                                       "pointing RMS 0.2 px", points, N, 0.5, &made));
    if (!made && system("command -v gnuplot > /dev/null") != 0) {
        /* gnuplot is an optional program: without it a warning, and no file */
        assert_int_equal(warnings, 1);
        assert_int_equal(scratch_count(s.folder), 0);
        scratch_remove(&s);
        return;
    }
    assert_true(made);
    unsigned size[2];
    assert_true(png_size(path, size));
    assert_int_equal(size[0], 1200);
    assert_int_equal(scratch_count(s.folder), 1);
    keep(path, "pointing.png");

    /* never in track, all points at one place */
    for (int i = 0; i < N; i++) {
        points[i] = (bst_io_pointing_point){.time_s = i, .visible = true, .mode = BST_MODE_STARE};
    }
    bst_assert_ok(&ctx, bst_io_pointing_plot(&ctx, path, NULL, NULL, points, N, 0.0, &made));
    assert_true(made);
    assert_int_equal(bst_io_pointing_plot(&ctx, path, NULL, NULL, points, 1, 0.0, &made),
                     BST_ERR_ARGUMENT);
    assert_false(made);
    assert_int_equal(
        bst_io_pointing_plot(&ctx, scratch_path(&s, "no/a.png"), NULL, NULL, points, N, 0.0, &made),
        BST_ERR_IO);
    /* without gnuplot: a warning, success, and nothing left behind */
    unlink(path);
    char *search = strdup(getenv("PATH"));
    assert_non_null(search);
    setenv("PATH", s.folder, 1);
    warnings = 0;
    bst_status status = bst_io_pointing_plot(&ctx, path, NULL, NULL, points, N, 0.0, &made);
    setenv("PATH", search, 1);
    free(search);
    assert_int_equal(status, BST_OK);
    assert_false(made);
    assert_int_equal(warnings, 1);
    assert_int_equal(scratch_count(s.folder), 0);
    scratch_remove(&s);
}

/* Data, ranges and lines of the plot: errors that are larger in y, seven points of which four
 * count. */
static void test_pointing_plot_shows_its_points(void **state) {
    (void)state;
    static char text[20000];
    bst_ctx ctx = {0};
    bst_io_pointing_point points[7];
    for (int i = 0; i < 7; i++) {
        points[i] = (bst_io_pointing_point){.time_s = 2.0 + 0.5 * i,
                                            .dx_px = i < 3 ? 40.0 - i : 0.2 * i - 1.0,
                                            .dy_px = i < 3 ? -75.0 + i : 0.5 * i - 3.1,
                                            .mode = i < 2 ? BST_MODE_SLEW : BST_MODE_TRACK,
                                            .in_track = i >= 2,
                                            .counted = i >= 3,
                                            .visible = i != 1};
    }
    plot_script p;
    plot_script_begin(&p);
    bool made = false;
    char path[700];
    snprintf(path, sizeof path, "%s/plot.png", p.folder.folder);
    bst_assert_ok(&ctx, bst_io_pointing_plot(&ctx, path, "name", "label", points, 7, 0.9, &made));
    assert_true(made);
    plot_script_end(&p, text, sizeof text);
    const char *at = text;
    double row[6], range[2];
    plot_script_numbers(&at, "$points << BST_END\n", 6, row);
    for (int i = 0; i < 7; i++) {
        if (i > 0) {
            if (i == 1) { /* not visible: no error is drawn */
                plot_script_numbers(&at, "\n", 0, row);
                continue;
            }
            plot_script_numbers(&at, "\n", 6, row);
        }
        const double expected[6] = {points[i].time_s,   hypot(points[i].dx_px, points[i].dy_px),
                                    points[i].dx_px,    points[i].dy_px,
                                    points[i].in_track, points[i].counted};
        for (int k = 0; k < 6; k++) {
            bst_assert_close(row[k], expected[k], 1e-6 * fabs(expected[k]));
        }
    }
    plot_script_numbers(&at, "set xrange [", 2, range);
    bst_assert_close(range[0], 2.0, 0.0);
    bst_assert_close(range[1], 5.0, 0.0);
    plot_script_numbers(&at, "rectangle from first", 1, range);
    bst_assert_close(range[0], 2.0, 0.0);
    plot_script_numbers(&at, "to first", 1, range); /* the mode of the third point begins there */
    bst_assert_close(range[0], 3.0, 0.0);
    plot_script_numbers(&at, "set yrange [", 2, range); /* 85 px is the largest error */
    bst_assert_close(range[1], 100.0, 1e-9);
    plot_script_numbers(&at, "plot", 0, range);
    plot_script_numbers(&at, "set yrange [", 2, range); /* 1.6 px in y is the largest that counts */
    bst_assert_close(range[0], -1.45 * 1.6, 1e-6);
    bst_assert_close(range[1], 1.45 * 1.6, 1e-6);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_pointing_plot_shows_its_points),
        cmocka_unit_test(test_quicklook),
        cmocka_unit_test(test_mark_sort),
        cmocka_unit_test(test_stretch),
        cmocka_unit_test(test_picture_errors),
        cmocka_unit_test(test_pointing_plot),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
