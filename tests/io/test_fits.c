/* Frame files: written here, read by astropy (check_fits.py). */
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>

#include "sim/io/fits_frames.h"
#include "tests/io/scratch.h"
#include "tests/io/sky_fixture.h"

/* odd sizes: rows and planes that do not fill FITS blocks */
enum { WIDTH = 61, HEIGHT = 37, FRAMES = 5 };

static uint16_t pixel(int64_t frame, int x, int y) {
    return (uint16_t)(frame * 9001 + y * 1777 + x * 13);
}

static void fill(uint16_t *pixels, int64_t frame, int width, int height) {
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++) {
            pixels[y * width + x] = pixel(frame, x, y);
        }
    }
}

static bst_camera small_camera(void) {
    bst_camera camera = fixture_camera();
    camera.width_px = WIDTH;
    camera.height_px = HEIGHT;
    camera.pixel_scale_arcsec = 50.0; /* half a degree: a field worth a WCS */
    camera.dark_current_e_per_s = 0.3;
    return camera;
}

static bst_fits_info make_info(const bst_camera *camera) {
    return (bst_fits_info){.observer = "neossat",
                           .instrument = "telescope",
                           .object = "O'Target",
                           .program = "boresight test",
                           .checksums = true,
                           .camera = camera};
}

/* Which of the three kinds of file. */
typedef enum file_kind { EXTENSIONS, RICE, CUBE } file_kind;

static bst_fits_frame make_frame(bst_ctx *ctx, const bst_camera *camera, int64_t id) {
    bst_fits_frame frame = {.id = id,
                            .exposure_s = 0.5,
                            .window = {0, 0, WIDTH, HEIGHT},
                            .binning = 1,
                            .bits = 14,
                            .has_wcs = true,
                            .has_observer = true,
                            .observer_gcrf_m = {7.0e6 + (double)id, -1.0e5, 2.5e5},
                            .observer_gcrf_mps = {10.0, 7400.0, -120.5},
                            .body_fraction = {0.25, 0.125, 0.0625}};
    bst_time epoch;
    bst_assert_ok(ctx, bst_time_from_utc(ctx, "2022-06-16T23:59:58.25Z", &epoch));
    frame.start = bst_time_add(epoch, (double)id);
    bst_light light = fixture_light();
    bst_quat q = bst_quat_look(bst_vec3_from_radec(1.0 + 0.001 * (double)id, -0.3),
                               (bst_vec3){0.3, 0.1, 1.0});
    bst_assert_ok(ctx, bst_wcs_fit(ctx, camera, q, &light, &frame.wcs));
    return frame;
}

/* Writes `count` frames, the last of them a binned window when `window` is set. */
static bst_fits *write_frames(bst_ctx *ctx, const char *path, file_kind kind, int count) {
    bst_camera camera = small_camera();
    bst_fits_info info = make_info(&camera);
    info.compression = kind == RICE ? BST_FITS_RICE : BST_FITS_RAW;
    bst_fits_layout layout = kind == CUBE ? BST_FITS_CUBE : BST_FITS_EXTENSIONS;
    bst_fits *fits;
    bst_assert_ok(ctx, bst_fits_create(ctx, path, layout, &info, &fits));
    uint16_t pixels[WIDTH * HEIGHT];
    for (int64_t i = 0; i < count; i++) {
        fill(pixels, i, WIDTH, HEIGHT);
        bst_fits_frame frame = make_frame(ctx, &camera, i);
        int64_t index;
        bst_assert_ok(ctx, bst_fits_write(ctx, fits, &frame, pixels, WIDTH, HEIGHT, &index));
        assert_int_equal(index, layout == BST_FITS_CUBE ? i : i + 1);
    }
    return fits;
}

static void write_window(bst_ctx *ctx, bst_fits *fits) {
    bst_camera camera = small_camera();
    bst_fits_frame frame = make_frame(ctx, &camera, FRAMES);
    frame.window = (bst_window){.x0 = 10, .y0 = 4, .width = 40, .height = 20};
    frame.binning = 2;
    frame.bits = 8;
    uint16_t pixels[20 * 10];
    fill(pixels, FRAMES, 20, 10);
    bst_assert_ok(ctx, bst_fits_write(ctx, fits, &frame, pixels, 20, 10, NULL));
}

/* A child that writes frames and kills itself. */
static void write_and_die(const char *path, file_kind kind, int count) {
    pid_t child = fork();
    if (child == 0) {
        bst_ctx ctx;
        bst_ctx_init(&ctx, NULL, NULL, BST_LOG_INFO);
        bst_fits *fits = write_frames(&ctx, path, kind, count);
        bst_status flushed = bst_fits_flush(&ctx, fits);
        raise(flushed == BST_OK ? SIGKILL : SIGABRT);
    }
    int status;
    waitpid(child, &status, 0);
    assert_true(WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL);
}

/* For every corner and the middle of each frame: our pixel of the WCS's place, and the pixel that
 * ERFA's path gives. check_fits.py compares astropy's pixel with both. */
static void write_places(bst_ctx *ctx, const char *path) {
    FILE *f = fopen(path, "w");
    assert_non_null(f);
    bst_camera camera = small_camera();
    bst_light light = fixture_light();
    for (int64_t i = 0; i < FRAMES; i++) {
        bst_fits_frame frame = make_frame(ctx, &camera, i);
        bst_quat q = bst_quat_look(bst_vec3_from_radec(1.0 + 0.001 * (double)i, -0.3),
                                   (bst_vec3){0.3, 0.1, 1.0});
        for (int k = 0; k < 9; k++) {
            double ra, dec, x = NAN, y = NAN;
            bst_wcs_px_to_sky(&frame.wcs, 30.0 * (k % 3), 18.0 * (double)(k / 3), &ra, &dec);
            assert_true(fixture_project(&camera, q, &light, ra, dec, &x, &y));
            fprintf(f, "%d %.15g %.15g %.15g %.15g\n", (int)i, ra / BST_DEG_RAD, dec / BST_DEG_RAD,
                    x, y);
        }
    }
    assert_int_equal(fclose(f), 0);
}

static void test_astropy_reads(void **state) {
    (void)state;
    scratch s;
    scratch_make(&s);
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_INFO);
    /* brackets are cfitsio's extended syntax, and no more than a name to us */
    bst_fits *fits = write_frames(&ctx, scratch_path(&s, "ext[1].fits"), EXTENSIONS, FRAMES);
    write_window(&ctx, fits);
    bst_assert_ok(&ctx, bst_fits_close(&ctx, fits));
    fits = write_frames(&ctx, scratch_path(&s, "cube.fits"), CUBE, FRAMES);
    bst_assert_ok(&ctx, bst_fits_close(&ctx, fits));
    fits = write_frames(&ctx, scratch_path(&s, "window_cube.fits"), CUBE, 0);
    write_window(&ctx, fits);
    bst_assert_ok(&ctx, bst_fits_close(&ctx, fits));
    fits = write_frames(&ctx, scratch_path(&s, "empty_cube.fits"), CUBE, 0);
    bst_assert_ok(&ctx, bst_fits_close(&ctx, fits));
    write_and_die(scratch_path(&s, "killed_ext.fits"), EXTENSIONS, FRAMES);
    write_and_die(scratch_path(&s, "killed_cube.fits"), CUBE, FRAMES);
    write_and_die(scratch_path(&s, "killed_rice.fits"), RICE, FRAMES);
    for (int i = 0; i < 2; i++) {
        fits = write_frames(&ctx, scratch_path(&s, i == 0 ? "rice.fits" : "rice_again.fits"), RICE,
                            FRAMES);
        write_window(&ctx, fits);
        bst_assert_ok(&ctx, bst_fits_close(&ctx, fits));
    }
    write_places(&ctx, scratch_path(&s, "places.txt"));
    assert_false(scratch_has(scratch_path(&s, "empty_cube.fits")));
    assert_int_equal(scratch_count(s.folder), 9); /* no table file is left by anyone */

    char command[700];
    snprintf(command, sizeof command, "/usr/bin/python3 tests/io/check_fits.py '%s'", s.folder);
    assert_int_equal(system(command), 0);
    scratch_remove(&s);
}

static void test_errors(void **state) {
    (void)state;
    scratch s;
    scratch_make(&s);
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_INFO);
    bst_camera camera = small_camera();
    bst_fits_info info = make_info(&camera);
    bst_fits *fits;
    assert_int_equal(
        bst_fits_create(&ctx, scratch_path(&s, "no/a.fits"), BST_FITS_EXTENSIONS, &info, &fits),
        BST_ERR_IO);
    assert_non_null(strstr(ctx.message, "no/a.fits"));
    assert_non_null(strstr(ctx.message, strerror(ENOENT)));
    info.compression = BST_FITS_RICE;
    assert_int_equal(
        bst_fits_create(&ctx, scratch_path(&s, "rice.fits"), BST_FITS_CUBE, &info, &fits),
        BST_ERR_ARGUMENT);
    assert_non_null(strstr(ctx.message, "rice.fits: a cube is not compressed"));
    info.compression = BST_FITS_RAW;
    fits = write_frames(&ctx, scratch_path(&s, "cube.fits"), CUBE, 1);
    bst_fits_frame frame = make_frame(&ctx, &camera, 1);
    uint16_t pixels[WIDTH * HEIGHT] = {0};
    assert_int_equal(bst_fits_write(&ctx, fits, &frame, pixels, WIDTH, HEIGHT - 1, NULL),
                     BST_ERR_ARGUMENT);
    assert_non_null(strstr(ctx.message, "extensions"));
    assert_int_equal(bst_fits_write(&ctx, fits, &frame, pixels, 0, 0, NULL), BST_ERR_ARGUMENT);
    bst_assert_ok(&ctx, bst_fits_close(&ctx, fits));
    /* an existing file is not overwritten */
    assert_int_equal(
        bst_fits_create(&ctx, scratch_path(&s, "cube.fits"), BST_FITS_CUBE, &info, &fits),
        BST_ERR_IO);
    scratch_remove(&s);
}

/* A full disk, played by a limit on the size of files: the error names file and reason, and the
 * frames before it stay, whole. */
static void full_disk(scratch *s, int number, file_kind kind, rlim_t bytes) {
    char name[] = "a0.fits";
    name[1] = (char)('0' + number);
    pid_t child = fork();
    if (child == 0) {
        bst_ctx ctx;
        bst_ctx_init(&ctx, NULL, NULL, BST_LOG_INFO);
        signal(SIGXFSZ, SIG_IGN);
        const struct rlimit limit = {bytes, bytes};
        bst_fits *fits = write_frames(&ctx, scratch_path(s, name), kind, 1);
        bst_camera camera = small_camera();
        uint16_t pixels[WIDTH * HEIGHT] = {0};
        if (bst_fits_flush(&ctx, fits) != BST_OK || setrlimit(RLIMIT_FSIZE, &limit) != 0) {
            _exit(1);
        }
        bst_status status = BST_OK;
        for (int64_t i = 1; i < 100 && status == BST_OK; i++) {
            fill(pixels, i, WIDTH, HEIGHT);
            bst_fits_frame frame = make_frame(&ctx, &camera, i);
            status = bst_fits_write(&ctx, fits, &frame, pixels, WIDTH, HEIGHT, NULL);
        }
        bool said = strstr(ctx.message, name) && strstr(ctx.message, strerror(EFBIG));
        /* a failure stays one for who asks later */
        bst_status again = kind == RICE ? bst_fits_flush(NULL, fits) : BST_ERR_IO;
        bst_status closed = bst_fits_close(&ctx, fits);
        (void)closed; /* must neither crash nor hang; it may or may not succeed */
        _exit(status != BST_ERR_IO || again != BST_ERR_IO ? 2 : said ? 0 : 3);
    }
    int status;
    waitpid(child, &status, 0);
    assert_true(WIFEXITED(status));
    assert_int_equal(WEXITSTATUS(status), 0);
}

static void test_full_disk(void **state) {
    (void)state;
    scratch s;
    scratch_make(&s);
    full_disk(&s, 0, EXTENSIONS, 40000);
    full_disk(&s, 1, RICE, 60000);
    full_disk(&s, 2, CUBE, 40000);
    char command[700];
    snprintf(command, sizeof command, "/usr/bin/python3 tests/io/check_fits.py '%s' full",
             s.folder);
    assert_int_equal(system(command), 0);
    scratch_remove(&s);
}

/* More extensions than the tables of cfitsio hold at first. */
static void test_many_extensions(void **state) {
    (void)state;
    scratch s;
    scratch_make(&s);
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_INFO);
    bst_camera camera = small_camera();
    bst_fits_info info = make_info(&camera);
    bst_fits *fits;
    bst_assert_ok(
        &ctx, bst_fits_create(&ctx, scratch_path(&s, "a.fits"), BST_FITS_EXTENSIONS, &info, &fits));
    uint16_t dot[4] = {0, 1, 32768, 65535};
    bst_fits_frame frame = make_frame(&ctx, &camera, 0);
    int64_t index = 0;
    for (int i = 0; i < 1200; i++) {
        bst_assert_ok(&ctx, bst_fits_write(&ctx, fits, &frame, dot, 2, 2, &index));
    }
    assert_int_equal(index, 1200);
    bst_assert_ok(&ctx, bst_fits_close(&ctx, fits));
    scratch_remove(&s);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_astropy_reads),
        cmocka_unit_test(test_errors),
        cmocka_unit_test(test_full_disk),
        cmocka_unit_test(test_many_extensions),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
