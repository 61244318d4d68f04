/* Element sets written as two lines, against the lines of a catalogue. */
#include <stdlib.h>

#include "boresight/vec.h"
#include "sim/astro/tle.h"
#include "tests/test_support.h"

/* What may differ between two writers of the same numbers: the classification, the sign of a zero's
 * exponent, a zero before the point, the checksum that follows from it; an ephemeris type. */
static void put_alike(char *line) {
    if (line[0] == '1') {
        line[7] = 'U';
        line[62] = '0';
        line[33] = line[33] == '0' ? ' ' : line[33];
        for (int at = 44; at <= 53; at += 9) {
            if (strncmp(line + at, " 00000", 6) == 0) {
                memcpy(line + at + 6, "+0", 2);
            }
        }
    }
    line[68] = '\0';
}

/* All of 5,000 public sets come out as the lines that they were read from. */
static void test_catalogue(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    FILE *file = fopen("scenarios/objects_2022-06.tle", "r");
    char line[2][200];
    int sets = 0;
    assert_non_null(file);
    while (fgets(line[0], sizeof line[0], file)) {
        if (strncmp(line[0], "1 ", 2) != 0) {
            continue;
        }
        assert_non_null(fgets(line[1], sizeof line[1], file));
        char out[2][BST_TLE_CHARS + 1];
        bst_elements set, again;
        bst_assert_ok(&ctx, bst_tle_parse(&ctx, line[0], line[1], &set));
        bst_assert_ok(&ctx, bst_tle_format(&ctx, &set, out[0], out[1]));
        bst_assert_ok(&ctx, bst_tle_parse(&ctx, out[0], out[1], &again));
        assert_memory_equal(&set, &again, sizeof set);
        for (int k = 0; k < 2; k++) {
            put_alike(line[k]);
            put_alike(out[k]);
            assert_string_equal(out[k], line[k]);
        }
        sets++;
    }
    fclose(file);
    assert_in_range(sets, 5000, 6000);
}

static bst_elements sample(void) {
    bst_elements set = {.norad = 44801,
                        .designator = "98067A",
                        .epoch_utc_jd1 = 2459746.5, /* 2022-06-16 */
                        .epoch_utc_jd2 = 0.25,
                        .inclination_rad = 51.6 * BST_DEG_RAD,
                        .eccentricity = 0.001,
                        .mean_motion_radpmin = 15.5 * 2.0 * BST_PI / 1440.0};
    return set;
}

/* Values at the edges of the columns. Day 167 is 16 June; leap years and their ends by the
 * calendar. */
static void test_edges(void **state) {
    (void)state;
    static const struct {
        double jd;
        double fraction;
        const char *epoch;
    } epochs[] = {{2459746.5, 0.25, "22167.25000000"},        {2451544.5, 0.0, "00001.00000000"},
                  {2451909.5, 0.5, "00366.50000000"},         {2451910.5, 0.0, "01001.00000000"},
                  {2451909.5, 0.999999999, "01001.00000000"}, {2435839.5, 0.0, "57001.00000000"},
                  {2472363.5, 0.0, "56366.00000000"}};
    bst_ctx ctx = {0};
    char lines[2][BST_TLE_CHARS + 1];
    for (size_t i = 0; i < sizeof epochs / sizeof *epochs; i++) {
        bst_elements set = sample();
        set.epoch_utc_jd1 = epochs[i].jd;
        set.epoch_utc_jd2 = epochs[i].fraction;
        bst_assert_ok(&ctx, bst_tle_format(&ctx, &set, lines[0], lines[1]));
        lines[0][32] = '\0';
        assert_string_equal(lines[0] + 18, epochs[i].epoch);
    }
    bst_elements set = sample();
    set.norad = 339999;
    set.bstar = -0.99999999;
    set.nddot_rev_day3 = 1.2345e-12;
    set.ndot_rev_day2 = -0.00012345;
    set.raan_rad = 359.99999 * BST_DEG_RAD;
    set.arg_perigee_rad = -10.0 * BST_DEG_RAD;
    set.inclination_rad = BST_PI;
    bst_assert_ok(&ctx, bst_tle_format(&ctx, &set, lines[0], lines[1]));
    assert_memory_equal(lines[0],
                        "1 Z9999U 98067A   22167.25000000 -.00012345  00123-9 -10000+1 0    0", 68);
    assert_memory_equal(lines[1],
                        "2 Z9999 180.0000   0.0000 0010000 350.0000   0.0000 15.50000000    0", 68);
    bst_elements again;
    bst_assert_ok(&ctx, bst_tle_parse(&ctx, lines[0], lines[1], &again));
    assert_int_equal(again.norad, 339999);
}

/* What two lines cannot hold is refused. */
static void test_refused(void **state) {
    (void)state;
    char lines[2][BST_TLE_CHARS + 1];
    for (int i = 0; i < 5; i++) {
        bst_ctx ctx = {0};
        bst_elements set = sample();
        set.norad = i == 0 ? 340000 : set.norad;
        set.epoch_utc_jd1 = i == 1 ? 2435838.5 : i == 2 ? 2472364.5 : set.epoch_utc_jd1;
        set.bstar = i == 3 ? 1e10 : 0.0;
        set.mean_motion_radpmin = i == 4 ? 1.0 : set.mean_motion_radpmin; /* 229 rev/day */
        assert_int_equal(bst_tle_format(&ctx, &set, lines[0], lines[1]), BST_ERR_RANGE);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_catalogue),
        cmocka_unit_test(test_edges),
        cmocka_unit_test(test_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
