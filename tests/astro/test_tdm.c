/* TDM files read: forms that the standard allows, and what is wrong with others. */
#include "boresight/vec.h"
#include "sim/astro/tdm.h"
#include "tests/test_support.h"

static const char whole[] =
    "CCSDS_TDM_VERS = 2.0\n"
    "COMMENT a comment\n"
    "CREATION_DATE = 2026-01-02T03:04:05\n"
    "ORIGINATOR = TEST\n"
    "META_START\n"
    "TIME_SYSTEM = UTC\n"
    "PARTICIPANT_1 = EYE\n"
    "PARTICIPANT_2 = BODY\n"
    "MODE = SEQUENTIAL\n"
    "PATH = 2,1\n"
    "EPHEMERIS_NAME_1 = eye.oem\n"
    "ANGLE_TYPE = RADEC\n"
    "REFERENCE_FRAME = ICRF\n"
    "META_STOP\n"
    "DATA_START\n"
    "ANGLE_1 = 2022-06-16T22:10:00.500 359.5\n"
    "ANGLE_2 = 2022-06-16T22:10:00.500 -45.25\n"
    "MAG = 2022-06-16T22:10:00.500 12.5\n"
    "ANGLE_1 = 2022-06-16T22:10:01.500 -0.25\n"
    "ANGLE_2 = 2022-06-16T22:10:01.500 -45.5\n"
    "DATA_STOP\n";

static bst_tdm *read_text(bst_ctx *ctx, const char *text) {
    bst_tdm *tdm;
    bst_assert_ok(ctx, bst_tdm_read_buffer(ctx, "x.tdm", text, strlen(text), &tdm));
    return tdm;
}

static void pairs_of_angles(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_time t;
    bst_tdm *tdm = read_text(&ctx, whole);
    assert_int_equal(bst_tdm_pair_count(tdm), 1);
    const bst_tdm_pair *p = bst_tdm_pair_at(tdm, 0);
    assert_string_equal(p->observer, "EYE");
    assert_string_equal(p->object, "BODY");
    assert_string_equal(p->ephemeris, "eye.oem");
    assert_int_equal(p->count, 2);
    bst_assert_ok(&ctx, bst_time_from_utc(&ctx, "2022-06-16T22:10:00.5Z", &t));
    bst_assert_close(bst_time_diff(p->items[0].time, t), 0.0, 1e-9); /* a time's resolution */
    /* rounding through the vector */
    bst_assert_close(p->items[0].ra_rad, 359.5 * BST_DEG_RAD, 1e-14);
    bst_assert_close(p->items[0].dec_rad, -45.25 * BST_DEG_RAD, 1e-15);
    bst_assert_close(p->items[0].mag, 12.5, 0.0);
    bst_assert_close(p->items[1].ra_rad, 359.75 * BST_DEG_RAD, 1e-14);
    assert_true(isnan(p->items[1].mag));
    bst_tdm_free(tdm);
}

/* Keyword by keyword, participants the other way round, EME2000, a correction that is still to be
 * added, times of the exposure's start. */
static void other_forms(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_tdm *tdm;
    bst_time t;
    bst_assert_ok(&ctx, bst_tdm_load(&ctx, "tests/fuzz/corpus/tdm/by_keyword.tdm", &tdm));
    const bst_tdm_pair *p = bst_tdm_pair_at(tdm, 0);
    assert_string_equal(p->observer, "STATION");
    assert_string_equal(p->object, "TARGET");
    assert_int_equal(p->count, 2);
    bst_assert_ok(&ctx, bst_time_from_utc(&ctx, "2022-06-16T22:11:01Z", &t));
    bst_assert_close(bst_time_diff(p->items[1].time, t), 0.0, 1e-9);
    /* the frame bias is 23 mas */
    double off = remainder(p->items[0].ra_rad - 0.15 * BST_DEG_RAD, 2.0 * BST_PI);
    bst_assert_close(off, 0.0, 0.03 * BST_ARCSEC_RAD);
    assert_true(fabs(off) > 0.01 * BST_ARCSEC_RAD);
    bst_assert_close(p->items[1].mag, 12.5, 0.0);
    bst_tdm_free(tdm);
}

static void mistakes_are_named(void **state) {
    (void)state;
    static const struct {
        const char *from, *to, *message;
    } faults[] = {
        {"CCSDS_TDM_VERS = 2.0", "CCSDS_OEM_VERS = 2.0", "x.tdm:1: the file does not begin"},
        {"ANGLE_TYPE = RADEC", "ANGLE_TYPE = AZEL", "x.tdm:16: angles of this kind"},
        {"REFERENCE_FRAME = ICRF", "REFERENCE_FRAME = ITRF2000", "x.tdm:16: angles in this frame"},
        {"TIME_SYSTEM = UTC\n", "", "x.tdm:13: the metadata lack TIME_SYSTEM"},
        {"PATH = 2,1", "PATH = 2,2", "x.tdm:10: is no path"},
        {"-45.25", "-95", "x.tdm:17: the angle is out of range"},
        {"-45.25", "nan", "x.tdm:17: the value is no number"},
        {"22:10:01.500 -45.5", "22:10:02.500 -45.5", "x.tdm:19: ANGLE_1 has no ANGLE_2"},
        {"ANGLE_1 = 2022-06-16T22:10:01.500", "ANGLE_1 = 2022-06-16T22:10:00.500", "x.tdm:19"},
        {"DATA_STOP\n", "", "x.tdm:20: the file ends before its data do"},
        {"2022-06-16T22:10:00.500 359.5", "2022-06-16T25:10:00.500 359.5", "x.tdm:16"},
        {"DATA_START", "DATA_BEGIN", "x.tdm:15: is not a line"},
    };
    for (size_t i = 0; i < sizeof faults / sizeof *faults; i++) {
        char text[2048];
        bst_ctx ctx = {0};
        bst_tdm *tdm;
        const char *at = strstr(whole, faults[i].from);
        assert_non_null(at);
        snprintf(text, sizeof text, "%.*s%s%s", (int)(at - whole), whole, faults[i].to,
                 at + strlen(faults[i].from));
        assert_int_equal(bst_tdm_read_buffer(&ctx, "x.tdm", text, strlen(text), &tdm),
                         BST_ERR_FORMAT);
        assert_null(tdm);
        if (strncmp(ctx.message, faults[i].message, strlen(faults[i].message)) != 0) {
            fail_msg("%s, not %s", ctx.message, faults[i].message);
        }
    }
    /* cut anywhere: never accepted before the last line is whole */
    for (size_t n = 0; n + 2 < sizeof whole; n++) {
        bst_ctx ctx = {0};
        bst_tdm *tdm;
        bst_status status = bst_tdm_read_buffer(&ctx, "x.tdm", whole, n, &tdm);
        assert_int_equal(status, BST_ERR_FORMAT);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(pairs_of_angles),
        cmocka_unit_test(other_forms),
        cmocka_unit_test(mistakes_are_named),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
