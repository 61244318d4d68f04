/* Star catalogues and what they are made from, when they are wrong. The catalogue file's own
 * damage, field by field: tests/catalogue/test_star_file.c. */
#include "sim/catalogue/star_import.h"
#include "sim/catalogue/stars.h"
#include "tests/bad_input/faults.h"

static bst_status read_stars(bst_ctx *ctx, const char *path) {
    bst_stars *stars = NULL;
    bst_status status = bst_stars_open(ctx, path, &stars);
    assert_true((status == BST_OK) == (stars != NULL));
    bst_stars_close(stars);
    return status;
}

static bst_status read_subset(bst_ctx *ctx, const char *path) {
    bst_star_subset subset;
    return bst_star_subset_read(ctx, path, &subset);
}

static bst_status read_tarball(bst_ctx *ctx, const char *path) {
    const bst_star_import_options options = bst_star_import_all();
    return bst_star_import_tarball(ctx, path, &options, "/dev/null/stars", NULL);
}

static const bad_reader catalogue = {
    read_stars,
    "a star catalogue: `boresight stars fetch` makes the full one, and \"embedded\" names the one "
    "in the program",
    "star catalogue: ", (uint64_t)1 << 33};
static const bad_reader subset = {read_subset, "a file with lines \"sky V\" and \"cone ...\"", "",
                                  1 << 20};
static const bad_reader tarball = {read_tarball, "Debian's tycho2_2.orig.tar.xz", "", 1 << 30};

static void paths(void **state) {
    (void)state;
    bad_paths(&catalogue);
    bad_paths(&subset);
    bad_paths(&tarball);
}

#define REMEDY ": run `boresight stars fetch` to make it again"

/* The embedded catalogue, cut within its header, is refused at every length. */
static void truncated_catalogue(void **state) {
    (void)state;
    char data[sizeof(bst_star_header) + 100], message[200];
    FILE *file = fopen("sim/catalogue/data/embedded.stars", "rb");
    assert_non_null(file);
    assert_int_equal(fread(data, 1, sizeof data, file), sizeof data);
    fseek(file, 0, SEEK_END);
    long whole = ftell(file);
    fclose(file);
    bad_reader r = catalogue;
    for (size_t n = 0; n < sizeof data; n++) {
        bst_status status = BST_ERR_FORMAT;
        if (n < sizeof BST_STAR_MAGIC - 1) {
            r.prefix = "";
            bad_bytes(&r, data, n, status,
                      " is not a Boresight star catalogue: run `boresight stars fetch` to make "
                      "one");
            continue;
        }
        r.prefix = "star catalogue ";
        if (n < sizeof(bst_star_header)) {
            snprintf(message, sizeof message, " is truncated (%zu bytes)" REMEDY, n);
        } else {
            snprintf(message, sizeof message, " is truncated or overlong (%zu bytes of %ld)" REMEDY,
                     n, whole);
        }
        bad_bytes(&r, data, n, status, message);
    }
    bst_ctx ctx = {0};
    assert_int_equal(read_stars(&ctx, ""), BST_ERR_ARGUMENT);
    assert_string_equal(ctx.message,
                        "the star catalogue's name is empty (allowed: \"default\", \"embedded\" or "
                        "a path)");
}

#define SUBSET_FORM                                                                               \
    "expected one \"sky V\" and up to 64 \"cone RA DEC RADIUS V\" (degrees; RA 0 to 360), found " \
    "\""

static void wrong_subsets(void **state) {
    (void)state;
    static const struct {
        const char *text, *message;
    } cases[] = {
        {"", ": no line \"sky V\""},
        {"# sky 9\n", ": no line \"sky V\""},
        {"sky 9\nsky 9\n", ":2: " SUBSET_FORM "sky 9\""},
        {"sky nan\n", ":1: " SUBSET_FORM "sky nan\""},
        {"sky 1e400\n", ":1: " SUBSET_FORM "sky 1e400\""},
        {"sky nine\n", ":1: " SUBSET_FORM "sky nine\""},
        {"sky 9 9\n", ":1: " SUBSET_FORM "sky 9 9\""},
        {"sky 9\ncone 10 20\n", ":2: " SUBSET_FORM "cone 10 20\""},
        {"sky 9\ncone 360 0 1 9\n", ":2: " SUBSET_FORM "cone 360 0 1 9\""},
        {"sky 9\ncone 0 -90.1 1 9\n", ":2: " SUBSET_FORM "cone 0 -90.1 1 9\""},
        {"sky 9\ncone 0 0 0 9\n", ":2: " SUBSET_FORM "cone 0 0 0 9\""},
        {"sky 9\ncone 0 0 nan 9\n", ":2: " SUBSET_FORM "cone 0 0 nan 9\""},
        {"sky 9\ncone 0 0 1 9 x\n", ":2: " SUBSET_FORM "cone 0 0 1 9 x\""},
        {"\xFF\xFEs", ":1: the file is UTF-16 text (allowed: ASCII or UTF-8)"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        bad_text(&subset, cases[i].text, BST_ERR_FORMAT, cases[i].message);
    }
    char line[300];
    memset(line, ' ', sizeof line);
    bst_ctx ctx = {0};
    bst_star_subset out;
    assert_int_equal(bst_star_subset_read_buffer(&ctx, "x", line, sizeof line, &out),
                     BST_ERR_FORMAT);
    assert_memory_equal(ctx.message, "x:1: " SUBSET_FORM, strlen("x:1: " SUBSET_FORM));
}

static void wrong_tarballs(void **state) {
    (void)state;
    scratch place;
    scratch_make(&place);
    char path[1024], message[2200];
    snprintf(path, sizeof path, "%s", scratch_path(&place, "x"));
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    fputs("no tarball", file);
    fclose(file);
    bst_ctx ctx = {0};
    assert_int_equal(read_tarball(&ctx, path), BST_ERR_FORMAT);
    snprintf(message, sizeof message,
             "cannot unpack %s (tar ended with 2): it must be Debian's tycho2_2.orig.tar.xz, and "
             "the program xz must be there (Debian package xz-utils)",
             path);
    assert_string_equal(ctx.message, message);
    scratch_remove(&place);
}

/* Rows in excess are not read on and on: what unpacks to more than the catalogue is refused. */
static void too_many_rows(void **state) {
    (void)state;
    static const char row[] =
        "0002 00580 1|T|003.03708871|+01.57351477|       |       | 42.9| 39.5|     |     | "
        "|11.688|0.122|11.171|0.121|999|T|       \n";
    FILE *rows = tmpfile();
    assert_non_null(rows);
    for (int i = 0; i < 4; i++) {
        fputs(row, rows);
    }
    rewind(rows);
    bst_star_import_options options = bst_star_import_all();
    options.expected_rows = 2;
    bst_ctx ctx = {0};
    assert_int_equal(bst_star_import_rows(&ctx, rows, &options, "/dev/null/stars", NULL),
                     BST_ERR_FORMAT);
    assert_string_equal(ctx.message,
                        "found more than 2 stars, all that Tycho-2 has: this is not the "
                        "catalogue; run `boresight stars fetch`");
    assert_int_equal(ftell(rows), 3 * (long)strlen(row));
    fclose(rows);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(paths),         cmocka_unit_test(truncated_catalogue),
        cmocka_unit_test(wrong_subsets), cmocka_unit_test(wrong_tarballs),
        cmocka_unit_test(too_many_rows),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
