/* Files that are no catalogue, or one no longer: refused with a message that says what to do. */
#define _XOPEN_SOURCE 700 /* mkstemp, setenv */
#include "tests/test_support.h"

#include <stdlib.h>
#include <sys/stat.h>
#include <unistd.h>

#include "sim/catalogue/star_index.h"
#include "sim/catalogue/stars.h"

#define SOURCE "sim/catalogue/data/embedded.stars"

typedef struct file_bytes {
    unsigned char *data;
    size_t bytes;
    char path[BST_TEST_PATH];
} file_bytes;

static int setup(void **state) {
    file_bytes *f = calloc(1, sizeof *f);
    FILE *in = fopen(SOURCE, "rb");
    struct stat st;
    if (!f || !in || fstat(fileno(in), &st) != 0) {
        return -1;
    }
    f->bytes = (size_t)st.st_size;
    f->data = malloc(f->bytes);
    size_t n = fread(f->data, 1, f->bytes, in);
    fclose(in);
    bst_test_template(f->path, "bst_file");
    close(mkstemp(f->path));
    *state = f;
    return n == f->bytes ? 0 : -1;
}

static int teardown(void **state) {
    file_bytes *f = *state;
    unlink(f->path);
    free(f->data);
    free(f);
    return 0;
}

/* Opens the first `bytes` bytes as a file of their own and compares the message after the path. */
static void refuse(file_bytes *f, size_t bytes, const char *format) {
    FILE *out = fopen(f->path, "wb");
    assert_non_null(out);
    assert_int_equal(fwrite(f->data, 1, bytes, out), bytes);
    assert_int_equal(fclose(out), 0);
    bst_ctx ctx = {0};
    bst_stars *stars = (bst_stars *)f;
    assert_int_equal(bst_stars_open(&ctx, f->path, &stars), BST_ERR_FORMAT);
    assert_null(stars);
    char message[BST_MESSAGE_BYTES];
    snprintf(message, sizeof message,
             "star catalogue %s %s: run `boresight stars fetch` to make it again", f->path, format);
    assert_string_equal(ctx.message, message);
}

static void test_truncated(void **state) {
    file_bytes *f = *state;
    char text[128];
    snprintf(text, sizeof text, "is truncated or overlong (%zu bytes of %zu)", f->bytes - 1,
             f->bytes);
    refuse(f, f->bytes - 1, text);
    refuse(f, 40, "is truncated (40 bytes)");
    snprintf(text, sizeof text, "is truncated or overlong (%zu bytes of %zu)",
             sizeof(bst_star_header), f->bytes);
    refuse(f, sizeof(bst_star_header), text);
}

static void test_damaged(void **state) {
    file_bytes *f = *state;
    bst_star_header header;
    memcpy(&header, f->data, sizeof header);
    size_t skip = offsetof(bst_star_header, checksum) + sizeof header.checksum;
    /* One bit, in the header's tail, the cells, a record, the last byte. */
    size_t places[] = {40, 300000, f->bytes - 20000, f->bytes - 1};
    for (size_t i = 0; i < 4; i++) {
        f->data[places[i]] ^= 0x10;
        char text[160];
        snprintf(text, sizeof text, "is damaged (checksum %016llx, expected %016llx)",
                 (unsigned long long)bst_star_checksum(f->data + skip, f->bytes - skip),
                 (unsigned long long)header.checksum);
        refuse(f, f->bytes, text);
        f->data[places[i]] ^= 0x10;
    }
}

/* Not a number at a place, with the right checksum. */
static void refuse_nan(file_bytes *f, size_t place, bool is_double, const char *what) {
    bst_star_header h;
    const float single = NAN;
    const double twofold = NAN;
    char text[100], kept[8];
    size_t bytes = is_double ? sizeof twofold : sizeof single;
    size_t skip = offsetof(bst_star_header, checksum) + sizeof h.checksum;
    memcpy(kept, f->data + place, bytes);
    memcpy(f->data + place, is_double ? (const void *)&twofold : (const void *)&single, bytes);
    memcpy(&h, f->data, sizeof h);
    h.checksum = bst_star_checksum(f->data + skip, f->bytes - skip);
    memcpy(f->data, &h, sizeof h);
    snprintf(text, sizeof text, "is damaged (%s)", what);
    refuse(f, f->bytes, text);
    memcpy(f->data + place, kept, bytes);
}

/* Right checksum, wrong content: what a faulty writer could leave. */
static void test_inconsistent(void **state) {
    file_bytes *f = *state;
    bst_star_header original, h;
    memcpy(&original, f->data, sizeof original);
    size_t skip = offsetof(bst_star_header, checksum) + sizeof h.checksum;
    h = original;
    h.star_count += UINT64_C(1) << 62; /* times 20 wraps to the same size */
    memcpy(f->data, &h, sizeof h);
    h.checksum = bst_star_checksum(f->data + skip, f->bytes - skip);
    memcpy(f->data, &h, sizeof h);
    refuse(f, f->bytes, "is damaged (numbers in the header)");
    h = original;
    memcpy(f->data, &h, sizeof h);
    size_t cell = sizeof h + h.patch_count * sizeof(bst_star_patch) + 500 * sizeof(bst_star_cell) +
                  offsetof(bst_star_cell, first);
    f->data[cell] ^= 1;
    h.checksum = bst_star_checksum(f->data + skip, f->bytes - skip);
    memcpy(f->data, &h, sizeof h);
    refuse(f, f->bytes, "is damaged (sky cell 500)");
    f->data[cell] ^= 1;
    refuse_nan(f, offsetof(bst_star_header, complete_to_v_mag), true, "numbers in the header");
    static const size_t places[] = {
        offsetof(bst_star_cell, centre[0]), offsetof(bst_star_cell, centre[1]),
        offsetof(bst_star_cell, centre[2]), offsetof(bst_star_cell, radius_rad),
        offsetof(bst_star_cell, pm_max_radpyr)};
    for (size_t i = 0; i < sizeof places / sizeof *places; i++) {
        refuse_nan(f, cell - offsetof(bst_star_cell, first) + places[i], false, "sky cell 500");
    }
    static const size_t of_patch[] = {offsetof(bst_star_patch, ra_deg),
                                      offsetof(bst_star_patch, dec_deg),
                                      offsetof(bst_star_patch, radius_deg)};
    for (size_t i = 0; i < sizeof of_patch / sizeof *of_patch; i++) {
        refuse_nan(f, sizeof h + 2 * sizeof(bst_star_patch) + of_patch[i], true, "patch 2");
    }
    memcpy(f->data, &original, sizeof original);
}

static void test_other_machine_and_version(void **state) {
    file_bytes *f = *state;
    bst_star_header original, h;
    memcpy(&original, f->data, sizeof original);
    h = original;
    h.endian = 0x04030201u;
    memcpy(f->data, &h, sizeof h);
    refuse(f, f->bytes, "was written on a machine of the other byte order");
    h = original;
    h.version = 7;
    memcpy(f->data, &h, sizeof h);
    refuse(f, f->bytes, "has format version 7, this program reads 1 to 3");
    memcpy(f->data, &original, sizeof original);
}

static void test_foreign_and_missing(void **state) {
    file_bytes *f = *state;
    bst_ctx ctx = {0};
    bst_stars *stars = NULL;
    char message[BST_MESSAGE_BYTES];
    static const char *const contents[] = {"", "short", "SIMPLE  =                    T"};
    for (size_t i = 0; i < 3; i++) {
        FILE *out = fopen(f->path, "wb");
        assert_non_null(out);
        fputs(contents[i], out);
        fclose(out);
        assert_int_equal(bst_stars_open(&ctx, f->path, &stars), BST_ERR_FORMAT);
        snprintf(message, sizeof message,
                 "%s is not a Boresight star catalogue: run `boresight stars fetch` to make one",
                 f->path);
        assert_string_equal(ctx.message, message);
    }
    assert_int_equal(bst_stars_open(&ctx, "/nonexistent/x.stars", &stars), BST_ERR_NOT_FOUND);
    assert_string_equal(
        ctx.message,
        "star catalogue: /nonexistent/x.stars: cannot be opened: No such file or directory; give a "
        "star catalogue: `boresight stars fetch` makes the full one, and \"embedded\" names the "
        "one "
        "in the program");
}

static void keep_line(void *user, bst_log_level level, const char *message) {
    if (level == BST_LOG_WARNING) {
        snprintf(user, 512, "%s", message);
    }
}

static void test_default(void **state) {
    file_bytes *f = *state;
    bst_ctx ctx;
    char warning[512] = "", path[512], folder[BST_TEST_PATH + 32];
    bst_ctx_init(&ctx, keep_line, warning, BST_LOG_WARNING);
    char root[BST_TEST_PATH];
    bst_test_template(root, "bst_data");
    assert_non_null(mkdtemp(root));
    assert_int_equal(setenv("XDG_DATA_HOME", root, 1), 0);
    snprintf(folder, sizeof folder, "%s/boresight", root);
    assert_int_equal(mkdir(folder, 0700), 0);
    bst_assert_ok(&ctx, bst_stars_default_path(&ctx, path, sizeof path));
    assert_memory_equal(path, folder, strlen(folder));

    bst_stars *stars = NULL;
    bst_stars_info info;
    bst_assert_ok(&ctx, bst_stars_open(&ctx, "default", &stars));
    bst_stars_get_info(stars, &info);
    assert_true(info.embedded);
    assert_int_equal(ctx.warnings, 1);
    assert_string_equal(
        warning,
        "the full star catalogue is not there: using the stars embedded in the "
        "program (all to V 9.0, fainter in 6 patches of sky only); `boresight stars "
        "fetch` gets the full one");
    bst_stars_close(stars);

    /* A catalogue that is there is taken, and a damaged one is not passed over in silence. */
    FILE *out = fopen(path, "wb");
    assert_non_null(out);
    assert_int_equal(fwrite(f->data, 1, f->bytes, out), f->bytes);
    fclose(out);
    bst_assert_ok(&ctx, bst_stars_open(&ctx, "default", &stars));
    bst_stars_get_info(stars, &info);
    assert_false(info.embedded);
    assert_string_equal(info.path, path);
    assert_string_equal(info.source, "Tycho-2");
    bst_stars_close(stars);
    assert_int_equal(truncate(path, 1000), 0);
    assert_int_equal(bst_stars_open(&ctx, "default", &stars), BST_ERR_FORMAT);
    assert_int_equal(ctx.warnings, 1);

    unlink(path);
    rmdir(folder);
    rmdir(root);
    assert_int_equal(setenv("XDG_DATA_HOME", "relative", 1), 0);
    assert_int_equal(setenv("HOME", "/home/someone", 1), 0);
    bst_assert_ok(&ctx, bst_stars_default_path(&ctx, path, sizeof path));
    assert_string_equal(path, "/home/someone/.local/share/boresight/tycho2.stars");
    assert_int_equal(bst_stars_default_path(&ctx, path, 10), BST_ERR_ARGUMENT);
    assert_int_equal(unsetenv("HOME"), 0);
    assert_int_equal(bst_stars_default_path(&ctx, path, sizeof path), BST_ERR_NOT_FOUND);
    bst_assert_ok(&ctx, bst_stars_open(&ctx, "default", &stars));
    bst_stars_close(stars);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_truncated),
        cmocka_unit_test(test_damaged),
        cmocka_unit_test(test_inconsistent),
        cmocka_unit_test(test_other_machine_and_version),
        cmocka_unit_test(test_foreign_and_missing),
        cmocka_unit_test(test_default),
    };
    return cmocka_run_group_tests(tests, setup, teardown);
}
