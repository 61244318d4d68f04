/* Frames in compressed tiles: those that astropy writes, with the pixels that it reads from them
 * (make_tiles.py). */
#include "sim/io/fits_source.h"
#include "tests/io/scratch.h"

enum { LEAST_FILES = 15, MOST_PIXELS = 60 * 40 };

/* Reads all frames of a file; returns their number. */
static int compare(const char *name, const char *expected) {
    bst_ctx ctx = {0};
    bst_fits_source *source;
    static float ours[MOST_PIXELS], theirs[MOST_PIXELS];
    bst_assert_ok(&ctx, bst_fits_source_open(&ctx, name, &source));
    FILE *file = fopen(expected, "rb");
    assert_non_null(file);
    int count = (int)bst_fits_source_count(source);
    for (int i = 0; i < count; i++) {
        bst_fits_source_frame frame;
        bst_assert_ok(&ctx, bst_fits_source_select(&ctx, source, i, &frame));
        assert_true(frame.compressed);
        size_t pixels = (size_t)(frame.width * frame.height);
        assert_true(pixels <= MOST_PIXELS);
        assert_int_equal(fread(theirs, sizeof *theirs, pixels, file), pixels);
        bst_assert_ok(&ctx, bst_fits_source_pixels(&ctx, source, ours));
        for (size_t k = 0; k < pixels; k++) {
            if (isnan(theirs[k])) {
                assert_true(isnan(ours[k]));
            } else if (!(fabsf(ours[k] - theirs[k]) <= 1e-6f * fabsf(theirs[k]) + 1e-5f)) {
                /* single precision */
                fail_msg("%s: frame %d: pixel %zu is %.9g, not %.9g", name, i, k, (double)ours[k],
                         (double)theirs[k]);
            }
        }
    }
    assert_int_equal(fgetc(file), EOF);
    fclose(file);
    bst_fits_source_close(source);
    return count;
}

static void tiles_of_every_kind(void **state) {
    (void)state;
    scratch s;
    scratch_make(&s);
    char command[1200], name[600];
    snprintf(command, sizeof command, "/usr/bin/python3 tests/io/make_tiles.py '%s' > '%s/said'",
             s.folder, s.folder);
    assert_int_equal(system(command), 0);
    int files = 0, frames = 0;
    for (;; files++) {
        snprintf(name, sizeof name, "%s/%d.fits", s.folder, files);
        if (!scratch_has(name)) {
            break;
        }
        char expected[600];
        snprintf(expected, sizeof expected, "%s/%d.f4", s.folder, files);
        frames += compare(name, expected);
    }
    assert_true(files >= LEAST_FILES && frames == files + 2 * 4); /* two are cubes of five */
    scratch_remove(&s);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(tiles_of_every_kind)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
