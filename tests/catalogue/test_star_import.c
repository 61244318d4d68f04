/* Rows of Tycho-2, each with one of the catalogue's traps, into a catalogue file and out again.
 * The rows are the catalogue's own (Hog et al. 2000). */
#define _XOPEN_SOURCE 700 /* mkstemp */
#include "tests/test_support.h"

#include <stdlib.h>
#include <unistd.h>

#include "sim/catalogue/star_import.h"
#include "sim/catalogue/stars.h"
#include "sim/world/world_internal.h"

#define NORMAL                                                                                    \
    "0001 00008 1| |  2.31750494|  2.23184345|  -16.3|   -9.0| 68| 73| 1.7| 1.8|1958.89|1951.94|" \
    " 4|1.0|1.0|0.9|1.0|12.146|0.158|12.146|0.223|999| |         |  2.31754222|  "                \
    "2.23186444|1.67|1.54| 88.0|100.8| |-0.2\n"
#define NO_MEAN_POSITION                                                                          \
    "0001 00041 1|X|            |            |       |       |   |   |    |    |       |       |" \
    "  |   |   |   |   |13.035|0.320|12.235|0.220|999| |         |  1.80874194|  "                \
    "2.31573611|1.75|1.77|112.2|148.2| | 0.0\n"
#define NO_BT                                                                                     \
    "0077 01286 1| | 63.94277263|  3.26324035|   -4.9|  -10.1| 53| 55| 1.7| 1.7|1967.98|1965.43|" \
    " 5|0.5|0.2|0.5|0.2|      |     |11.189|0.131|999| |         | 63.94277139|  "                \
    "3.26326528|1.82|1.75|129.1|147.5| |-0.1\n"
#define NO_VT                                                                                     \
    "0077 00412 1| | 64.92261166|  3.76889045|   23.5|   -6.6| 95|106| 2.7| 2.7|1969.49|1961.52|" \
    " 2|   |   |   |   |11.690|0.132|      |     |999| |         | 64.92255667|  "                \
    "3.76890611|1.62|1.44|111.5|133.6| |-0.1\n"
#define DOUBLE_A                                                                                  \
    "0049 01674 1| | 39.65333898|  3.44319968|   31.7|    5.9|  4|  4| 0.9| 1.0|1991.30|1991.35|" \
    "21|1.2|1.0|1.2|1.1| 7.507|0.015| 6.348|0.010|  9|T| 12318A  | 39.65326611|  "                \
    "3.44318583|1.76|1.73|  3.6|  4.3| |-0.2\n"
#define DOUBLE_B                                                                                 \
    "0049 01674 1|H|039.65311086|+03.44338599|   34.9|    7.9| 36.8| 24.6|  1.2|  1.2|H|      |" \
    "     |10.511|0.130|  9|T| 12318B\n"
#define PHOTOCENTRE                                                                          \
    "0001 00017 1|P|  0.05059802|  1.77144349|   32.1|  -20.7| 21| 31| 1.6| 1.6|1989.29|198" \
    "5.38| 5|1.4|0.6|1.4|0.6|11.318|0.070|10.521|0.051| 18|T|         |  0.05086583|  1.771" \
    "51389|1.78|1.55| 30.0| 45.6|D|-0.2\n"
#define SIRIUS_HP                                                                                \
    "5949 02777 1|H|101.28854105|-16.71314306| -546.0|-1223.1|  1.2|  1.0|  1.3|  1.2|H|      |" \
    "     |-1.088|0.002|999| | 32349 \n"
#define TYCHO1_NO_MOTION                                                                         \
    "0002 00580 1|T|003.03708871|+01.57351477|       |       | 42.9| 39.5|     |     | |11.688|" \
    "0.122|11.171|0.121|999|T|       \n"

typedef struct sample {
    char path[BST_TEST_PATH];
    bst_ctx ctx;
    bst_stars *stars;
} sample;

static bst_status import_text(bst_ctx *ctx, const char *text,
                              const bst_star_import_options *options, const char *path,
                              long long *written) {
    FILE *rows = tmpfile();
    assert_non_null(rows);
    assert_true(fputs(text, rows) >= 0);
    rewind(rows);
    bst_status status = bst_star_import_rows(ctx, rows, options, path, written);
    fclose(rows);
    return status;
}

static int setup(void **state) {
    sample *s = calloc(1, sizeof *s);
    bst_test_template(s->path, "bst_stars");
    int fd = mkstemp(s->path);
    close(fd);
    bst_star_import_options options = bst_star_import_all();
    options.expected_rows = 9;
    long long written = 0;
    /* Supplement first and out of order: the importer sorts. */
    bst_status status = import_text(&s->ctx,
                                    SIRIUS_HP DOUBLE_B TYCHO1_NO_MOTION NO_MEAN_POSITION NORMAL
                                        PHOTOCENTRE NO_BT NO_VT DOUBLE_A,
                                    &options, s->path, &written);
    *state = s;
    return status == BST_OK && written == 9 && bst_stars_open(&s->ctx, s->path, &s->stars) == BST_OK
               ? 0
               : -1;
}

static int teardown(void **state) {
    sample *s = *state;
    bst_stars_close(s->stars);
    unlink(s->path);
    free(s);
    return 0;
}

static bst_star find(sample *s, unsigned a, unsigned b, unsigned c, double year) {
    bst_star star;
    bst_assert_ok(&s->ctx,
                  bst_stars_find(&s->ctx, s->stars, bst_star_id_make(a, b, c), year, &star));
    return star;
}

/* 0.3 mas: the stored unit. */
static void assert_at(bst_star star, double ra_deg, double dec_deg) {
    bst_vec3 u = bst_vec3_from_radec(ra_deg * BST_DEG_RAD, dec_deg * BST_DEG_RAD);
    bst_assert_close(bst_vec3_angle(star.icrs, u) / BST_ARCSEC_RAD, 0.0, 0.3e-3);
}

static void test_main_table(void **state) {
    bst_star star = find(*state, 1, 8, 1, 2000.0);
    assert_at(star, 2.31750494, 2.23184345);
    bst_assert_close(star.v_mag, 12.146, 1e-6);   /* float */
    bst_assert_close(star.b_minus_v, 0.0, 1e-12); /* BT = VT */
    /* -16.3 and -9.0 mas/yr for 20 years; the cosine of the declination is the row's. */
    assert_at(find(*state, 1, 8, 1, 2020.0),
              2.31750494 - 0.0163 * 20.0 / 3600.0 / cos(2.23184345 * BST_DEG_RAD),
              2.23184345 - 0.0090 * 20.0 / 3600.0);
}

static void test_no_mean_position_gives_the_observed_one(void **state) {
    assert_at(find(*state, 1, 41, 1, 2000.0), 1.80874194, 2.31573611);
    assert_at(find(*state, 1, 41, 1, 2030.0), 1.80874194, 2.31573611);
    bst_star star = find(*state, 1, 41, 1, 2000.0);
    bst_assert_close(star.v_mag, 12.235 - 0.090 * 0.800, 1e-6); /* float */
    bst_assert_close(star.b_minus_v, 0.850 * 0.800, 1e-7);      /* float */
}

static void test_photocentre_gives_the_component(void **state) {
    /* Observed 1.78 and 1.55 years after 1990 in the two axes: their mean is the epoch. */
    double years = 10.0 - 0.5 * (1.78 + 1.55);
    assert_at(find(*state, 1, 17, 1, 2000.0),
              0.05086583 + 32.1 * 1e-3 / 3600.0 * years / cos(1.77151389 * BST_DEG_RAD),
              1.77151389 + -20.7 * 1e-3 / 3600.0 * years);
}

static void test_one_magnitude_only(void **state) {
    /* BT-VT is taken as 0.7. */
    bst_star no_bt = find(*state, 77, 1286, 1, 2000.0);
    bst_assert_close(no_bt.v_mag, 11.189 - 0.063, 1e-6); /* float */
    assert_true(isnan(no_bt.b_minus_v));
    bst_star no_vt = find(*state, 77, 412, 1, 2000.0);
    bst_assert_close(no_vt.v_mag, 11.690 - 0.7 - 0.063, 1e-6); /* float */
    assert_true(isnan(no_vt.b_minus_v));
}

/* A cell's cap lies about the middle of its stars and is no larger than they need; its motion is
 * that of the fastest. Cell 77 has two stars, 1.1 degrees apart; the second moves by 24.4 mas a
 * year. */
static void test_caps_of_cells(void **state) {
    const sample *s = *state;
    const bst_star_view *view = bst_stars_records(s->stars);
    const bst_star_cell *cell = &view->cells[77];
    assert_int_equal(cell->count, 2);
    bst_vec3 a = bst_vec3_from_radec(63.94277263 * BST_DEG_RAD, 3.26324035 * BST_DEG_RAD);
    bst_vec3 b = bst_vec3_from_radec(64.92261166 * BST_DEG_RAD, 3.76889045 * BST_DEG_RAD);
    bst_vec3 middle = bst_vec3_unit(bst_vec3_add(a, b));
    bst_vec3 centre = {cell->centre[0], cell->centre[1], cell->centre[2]};
    /* floats: 6e-8 on each axis, and 1e-6 of room for them */
    bst_assert_close(bst_vec3_norm(bst_vec3_sub(centre, middle)), 0, 2e-7);
    bst_assert_close(cell->radius_rad, 0.5 * bst_vec3_angle(a, b) + 1e-6, 2e-7);
    double mas = BST_ARCSEC_RAD / 1000;
    /* motions are kept to 0.1 mas */
    bst_assert_close(cell->pm_max_radpyr, hypot(23.5, 6.6) * mas, 0.1 * mas);
    cell = &view->cells[5949];
    assert_int_equal(cell->count, 1);
    bst_assert_close(cell->radius_rad, 1e-6, 2e-7);
    bst_assert_close(cell->pm_max_radpyr, hypot(546.0, 1223.1) * mas, 0.1 * mas);
    assert_int_equal(view->cells[100].count, 0);
}

static void test_supplement_is_moved_from_its_epoch(void **state) {
    bst_star sirius = find(*state, 5949, 2777, 1, 1991.25);
    assert_at(sirius, 101.28854105, -16.71314306);
    /* the Bright Star Catalogue's, not those of the row (Hp -1.088), in the file as well */
    bst_assert_close(sirius.v_mag, -1.46, 1e-6); /* float */
    bst_assert_close(sirius.b_minus_v, 0.0, 1e-6);
    const sample *file = *state;
    const bst_star_view *view = bst_stars_records(file->stars);
    bst_assert_close(bst_star_record_v(&view->records[view->cells[5949].first]) / 1e5, -1.46,
                     0.001); /* rounding of VT */
    assert_true((view->records[view->cells[5949].first].pm_dec_flags & BST_STAR_NO_COLOUR) == 0);
    /* Published for J2000 from the new reduction of Hipparcos, 06h45m08.91728 -16d42m58.0171:
     * 20 mas apart from the old one. */
    sirius = find(*state, 5949, 2777, 1, 2000.0);
    bst_vec3 u = bst_vec3_from_radec((6.0 + 45.0 / 60.0 + 8.91728 / 3600.0) * 15.0 * BST_DEG_RAD,
                                     -(16.0 + 42.0 / 60.0 + 58.0171 / 3600.0) * BST_DEG_RAD);
    bst_assert_close(bst_vec3_angle(sirius.icrs, u) / BST_ARCSEC_RAD, 0.0, 0.02);
    assert_at(find(*state, 2, 580, 1, 2020.0), 3.03708871, 1.57351477);
}

static void test_double_star_with_one_identity(void **state) {
    sample *s = *state;
    bst_star out[8];
    int count = 0;
    bst_star a = find(s, 49, 1674, 1, 2000.0);
    bst_assert_close(a.v_mag, 6.348 - 0.090 * 1.159, 1e-6); /* float */
    bst_assert_ok(&s->ctx, bst_stars_query(&s->ctx, s->stars, a.icrs, 2.0 * BST_ARCSEC_RAD, 20.0,
                                           2000.0, out, 8, &count));
    assert_int_equal(count, 2);
    assert_int_equal(out[0].id, out[1].id);
    assert_true(out[0].v_mag < out[1].v_mag);
}

static void test_subset(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    char text[BST_TEST_PATH], path[BST_TEST_PATH];
    bst_test_template(text, "bst_subset");
    bst_test_template(path, "bst_part");
    int fd = mkstemp(text);
    const char *content = "# a part\nsky 9\n\ncone 2.0 2.3 0.5 12.15 # one star\n";
    assert_int_equal(write(fd, content, strlen(content)), (ssize_t)strlen(content));
    close(fd);
    close(mkstemp(path));
    bst_star_import_options options = bst_star_import_all();
    options.expected_rows = 0;
    bst_assert_ok(&ctx, bst_star_subset_read(&ctx, text, &options.subset));
    long long written = 0;
    bst_assert_ok(&ctx, import_text(&ctx, NORMAL NO_MEAN_POSITION SIRIUS_HP TYCHO1_NO_MOTION,
                                    &options, path, &written));
    assert_int_equal(written, 2);
    bst_stars *stars = NULL;
    bst_assert_ok(&ctx, bst_stars_open(&ctx, path, &stars));
    bst_star star;
    bst_stars_info info;
    bst_assert_ok(&ctx,
                  bst_stars_find(&ctx, stars, bst_star_id_make(5949, 2777, 1), 2000.0, &star));
    bst_assert_ok(&ctx, bst_stars_find(&ctx, stars, bst_star_id_make(1, 8, 1), 2000.0, &star));
    bst_stars_get_info(stars, &info);
    assert_true(info.complete_to_v_mag == 9.0);
    assert_int_equal(info.patches, 1);
    bst_stars_close(stars);

    FILE *f = fopen(text, "w");
    assert_non_null(f);
    fputs("sky 9\ncone 400 0 1 12\n", f);
    fclose(f);
    char message[512];
    assert_int_equal(bst_star_subset_read(&ctx, text, &options.subset), BST_ERR_FORMAT);
    snprintf(message, sizeof message,
             "%s:2: expected one \"sky V\" and up to 64 \"cone RA DEC RADIUS V\" (degrees; RA 0 to "
             "360), found \"cone 400 0 1 12\"",
             text);
    assert_string_equal(ctx.message, message);
    unlink(text);
    unlink(path);
}

static void test_bad_rows(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    char path[BST_TEST_PATH];
    bst_test_template(path, "bst_none");
    close(mkstemp(path));
    unlink(path);
    bst_star_import_options options = bst_star_import_all();
    options.expected_rows = 0;
    assert_int_equal(import_text(&ctx, SIRIUS_HP "0001 00008 1| |\n", &options, path, NULL),
                     BST_ERR_FORMAT);
    assert_string_equal(ctx.message,
                        "Tycho-2 row 2: the row has 15 bytes; Tycho-2's rows have 206, its "
                        "supplement's 122");
    char row[256] = NORMAL;
    memcpy(row + 110, "12,146", 6);
    assert_int_equal(import_text(&ctx, row, &options, path, NULL), BST_ERR_FORMAT);
    assert_string_equal(ctx.message, "Tycho-2 row 1: bytes 111-116 hold \"12,146\", not a number");
    strcpy(row, SIRIUS_HP);
    memcpy(row + 15, "361", 3);
    assert_int_equal(import_text(&ctx, row, &options, path, NULL), BST_ERR_FORMAT);
    assert_string_equal(ctx.message,
                        "Tycho-2 row 1: right ascension 361.28854105 or declination -16.71314306 "
                        "out of range");
    strcpy(row, SIRIUS_HP);
    memcpy(row, "9538", 4);
    assert_int_equal(import_text(&ctx, row, &options, path, NULL), BST_ERR_FORMAT);
    assert_string_equal(ctx.message, "Tycho-2 row 1: TYC 9538-2777-1 is no Tycho-2 identity");
    strcpy(row, SIRIUS_HP);
    memcpy(row + 96, "      ", 6);
    assert_int_equal(import_text(&ctx, row, &options, path, NULL), BST_ERR_FORMAT);
    options.expected_rows = 3;
    assert_int_equal(import_text(&ctx, SIRIUS_HP NORMAL, &options, path, NULL), BST_ERR_FORMAT);
    assert_string_equal(ctx.message,
                        "found 2 stars where Tycho-2 has 3: this is not the whole catalogue; run "
                        "`boresight stars fetch`");
    /* No failed import leaves a file. */
    assert_int_equal(access(path, F_OK), -1);
}

static void test_tarball_that_is_none(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    char path[BST_TEST_PATH], message[512];
    bst_test_template(path, "bst_tar");
    close(mkstemp(path));
    bst_star_import_options options = bst_star_import_all();
    assert_int_equal(bst_star_import_tarball(&ctx, path, &options, "/tmp/bst_never", NULL),
                     BST_ERR_FORMAT);
    snprintf(message, sizeof message, "cannot unpack %s (tar ended with 2): ", path);
    assert_memory_equal(ctx.message, message, strlen(message));
    unlink(path);
    assert_int_equal(bst_star_import_tarball(&ctx, path, &options, "/tmp/bst_never", NULL),
                     BST_ERR_NOT_FOUND);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_main_table),
        cmocka_unit_test(test_no_mean_position_gives_the_observed_one),
        cmocka_unit_test(test_photocentre_gives_the_component),
        cmocka_unit_test(test_caps_of_cells),
        cmocka_unit_test(test_one_magnitude_only),
        cmocka_unit_test(test_supplement_is_moved_from_its_epoch),
        cmocka_unit_test(test_double_star_with_one_identity),
        cmocka_unit_test(test_subset),
        cmocka_unit_test(test_bad_rows),
        cmocka_unit_test(test_tarball_that_is_none),
    };
    return cmocka_run_group_tests(tests, setup, teardown);
}
