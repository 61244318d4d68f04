/* CCSDS AEM: attitudes against rotation matrices by ERFA, and what is refused. */
#include <erfa.h>

#include "sim/astro/aem.h"
#include "tests/test_support.h"

#define HEAD "CCSDS_AEM_VERS = 2.0\nCREATION_DATE = 2022-06-16T00:00:00\nORIGINATOR = TEST\n"
#define HEAD_1 "CCSDS_AEM_VERS = 1.0\nCREATION_DATE = 2022-06-16T00:00:00\nORIGINATOR = TEST\n"
#define META(more)                                                                            \
    "META_START\nCOMMENT a comment\nOBJECT_NAME = SAT\nOBJECT_ID = 2020-001A\nCENTER_NAME = " \
    "EARTH\nTIME_SYSTEM = UTC\nSTART_TIME = 2022-06-16T00:00:00\nSTOP_TIME = "                \
    "2022-06-16T01:00:00\n" more "\nMETA_STOP\n"
#define FRAMES "REF_FRAME_A = GCRF\nREF_FRAME_B = SC_BODY_1\n"
#define DATA(rows) "\nDATA_START\n" rows "\nDATA_STOP\n"
#define QUATERNIONS FRAMES "ATTITUDE_TYPE = QUATERNION"

static bst_time epoch(void) {
    bst_ctx ctx = {0};
    bst_time t;
    bst_assert_ok(&ctx, bst_time_from_utc(&ctx, "2022-06-16T00:00:00Z", &t));
    return t;
}

static bst_attitude_row first_of(const char *text, const char *object, int rows) {
    bst_ctx ctx = {0};
    bst_attitude_row *list;
    int count;
    assert_true(bst_aem_is(text, strlen(text)));
    bst_assert_ok(&ctx,
                  bst_aem_read(&ctx, "f.aem", text, strlen(text), object, epoch(), &list, &count));
    assert_int_equal(count, rows);
    bst_attitude_row first = list[0];
    free(list);
    return first;
}

/* The quaternion turns coordinates as the matrix does. */
static void assert_turns(bst_quat q, double m[3][3]) {
    const bst_vec3 v[] = {{1, 0, 0}, {0, 1, 0}, {0.3, -0.4, 0.5}};
    for (int i = 0; i < 3; i++) {
        double in[3] = {v[i].x, v[i].y, v[i].z}, out[3];
        eraRxp(m, in, out);
        bst_vec3 got = bst_quat_rotate(q, v[i]);
        bst_assert_close(got.x, out[0], 1e-9); /* the digits of the files below */
        bst_assert_close(got.y, out[1], 1e-9);
        bst_assert_close(got.z, out[2], 1e-9);
    }
}

/* The body is turned by 60 degrees about z of GCRF: R3(60 degrees) turns coordinates. */
static void a_quaternion_turns_the_frame(void **state) {
    (void)state;
    double m[3][3];
    eraIr(m);
    eraRz(60 * BST_DEG_RAD, m);
    static const char *const texts[] = {
        HEAD META(QUATERNIONS) DATA("2022-06-16T00:00:10 0 0 0.5 0.8660254037844387"),
        HEAD META(FRAMES "ATTITUDE_TYPE = QUATERNION/ANGVEL\nANGVEL_FRAME = SC_BODY_1")
            DATA("2022-06-16T00:00:10 0 0 0.5 0.8660254037844387 0 0 0.1"),
        HEAD_1 META(QUATERNIONS "\nATTITUDE_DIR = A2B\nQUATERNION_TYPE = FIRST")
            DATA("2022-06-16T00:00:10 0.8660254037844387 0 0 0.5"),
        HEAD_1 META(QUATERNIONS "\nATTITUDE_DIR = B2A\nQUATERNION_TYPE = LAST")
            DATA("2022-06-16T00:00:10 0 0 -0.5 0.8660254037844387"),
        HEAD META("REF_FRAME_A = SC_BODY\nREF_FRAME_B = ICRF\nATTITUDE_TYPE = QUATERNION")
            DATA("2022-06-16T00:00:10 0 0 -0.5 0.8660254037844387")};
    for (int i = 0; i < 5; i++) {
        bst_attitude_row row = first_of(texts[i], i % 2 ? "2020-001A" : "", 1);
        bst_assert_close(row.seconds, 10, 1e-9); /* rounding of dates */
        assert_turns(row.q_body_from_gcrf, m);
    }
}

static void angles_and_spins(void **state) {
    (void)state;
    double m[3][3];
    eraIr(m);
    eraRz(20 * BST_DEG_RAD, m);
    eraRy(-30 * BST_DEG_RAD, m);
    eraRx(50 * BST_DEG_RAD, m);
    static const char *const texts[] = {
        HEAD META(FRAMES "ATTITUDE_TYPE = EULER_ANGLE\nEULER_ROT_SEQ = ZYX")
            DATA("2022-06-16T00:00:10 20 -30 50"),
        HEAD_1 META(FRAMES "ATTITUDE_TYPE = EULER_ANGLE/RATE\nEULER_ROT_SEQ = 321\nATTITUDE_DIR = "
                           "A2B") DATA("2022-06-16T00:00:10 20 -30 50 1 2 3")};
    for (int i = 0; i < 2; i++) {
        assert_turns(first_of(texts[i], "SAT", 1).q_body_from_gcrf, m);
    }
    /* the axis of a spin is z at its right ascension and declination; x turns about it */
    bst_quat q =
        first_of(HEAD META(FRAMES "ATTITUDE_TYPE = SPIN") DATA("2022-06-16T00:00:10 40 25 0 6\n"
                                                               "2022-06-16T00:00:20 40 25 60 6"),
                 "", 2)
            .q_body_from_gcrf;
    bst_vec3 axis = bst_quat_rotate(bst_quat_conj(q), (bst_vec3){0, 0, 1});
    double a = 40 * BST_DEG_RAD, d = 25 * BST_DEG_RAD;
    bst_vec3 want = {cos(d) * cos(a), cos(d) * sin(a), sin(d)};
    bst_assert_close(bst_vec3_norm(bst_vec3_sub(axis, want)), 0, 1e-12);
    bst_vec3 x = bst_quat_rotate(bst_quat_conj(q), (bst_vec3){1, 0, 0});
    bst_assert_close(x.z, 0, 1e-12); /* the node on the equator */
    bst_assert_close(x.x, -sin(a), 1e-12);
}

/* EME2000 differs from GCRF by the frame bias, 17 milliarcseconds. */
static void the_frame_bias_is_taken_off(void **state) {
    (void)state;
    bst_quat q = first_of(HEAD META("REF_FRAME_A = EME2000\nREF_FRAME_B = SC_BODY\nATTITUDE_TYPE = "
                                    "QUATERNION") DATA("2022-06-16T00:00:10 0 0 0 1"),
                          "", 1)
                     .q_body_from_gcrf;
    double b[3][3], p[3][3], both[3][3];
    eraBp06(2451545.0, 0, b, p, both);
    assert_turns(q, b);
    assert_true(bst_vec3_norm(bst_quat_to_rotvec(q)) > 5e-8);
}

/* Two segments meet at an instant; a second object stands between them. */
static void segments_follow_each_other(void **state) {
    (void)state;
#define OTHER                                                                                 \
    "META_START\nOBJECT_NAME = B\nOBJECT_ID = 1\nREF_FRAME_A = GCRF\nREF_FRAME_B = SC_BODY\n" \
    "TIME_SYSTEM = TAI\nSTART_TIME = 2022-06-16T00:00:37\nSTOP_TIME = 2022-06-16T00:01:00\n"  \
    "ATTITUDE_TYPE = QUATERNION\nMETA_STOP\nDATA_START\n2022-06-16T00:00:37 0 1 0 0\nDATA_STOP\n"
    static const char text[] = HEAD META(QUATERNIONS)
        DATA("2022-06-16T00:00:00 0 0 0 1\n2022-06-16T00:00:10 0 0 0 1") OTHER META(QUATERNIONS)
            DATA("2022-06-16T00:00:10 1 0 0 0\n2022-06-16T00:00:20 1 0 0 0");
    (void)first_of(text, "SAT", 4);
    bst_attitude_row other = first_of(text, "B", 1);
    bst_assert_close(other.seconds, 0, 1e-9);
    bst_assert_close(fabs(other.q_body_from_gcrf.y), 1, 0);
}

static const struct {
    const char *text, *object, *words[2];
} faults[] = {
    {"CCSDS_AEM_VERS = 3.0\n", "", {"f.aem:1:", "1.0 or 2.0"}},
    {HEAD "PLACE = x\n", "", {"f.aem:4:", "META_START"}},
    {HEAD META(FRAMES "ATTITUDE_TYPE = SPIN/NUTATION") DATA(""), "", {"f.aem:14:", "or SPIN"}},
    {HEAD META("REF_FRAME_A = TEME\nREF_FRAME_B = SC_BODY\nATTITUDE_TYPE = QUATERNION") DATA(""),
     "",
     {"f.aem:12:", "EME2000"}},
    {HEAD META("REF_FRAME_A = ICRF\nREF_FRAME_B = GCRF\nATTITUDE_TYPE = QUATERNION") DATA(""),
     "",
     {"f.aem:13:", "one inertial frame and one SC_BODY"}},
    {HEAD META(FRAMES) DATA(""), "", {"f.aem:4:", "ATTITUDE_TYPE is missing"}},
    {HEAD META(FRAMES "ATTITUDE_TYPE = EULER_ANGLE") DATA(""), "", {"f.aem:4:", "EULER_ROT_SEQ"}},
    {HEAD META(FRAMES "ATTITUDE_TYPE = EULER_ANGLE\nEULER_ROT_SEQ = 331") DATA(""),
     "",
     {"f.aem:15:", "as 321"}},
    {HEAD META(QUATERNIONS "\nWHAT = 1") DATA(""), "", {"f.aem:15:", "REF_FRAME_A"}},
    {HEAD META(QUATERNIONS) DATA("2022-06-16T00:00:00 0 0 0 1.1"),
     "",
     {"f.aem:18:", "a unit quaternion"}},
    {HEAD META(QUATERNIONS) DATA("2022-06-16T00:00:00 0 0 1"), "", {"f.aem:18:", "4 numbers"}},
    {HEAD META(QUATERNIONS) DATA("2022-06-16T00:00:00 0 0 0 1 5"), "", {"f.aem:18:", "4 numbers"}},
    {HEAD META(QUATERNIONS) DATA("2022-06-16T00:00:00 0 0 0 q"), "", {"f.aem:18:", "not a number"}},
    {HEAD META(QUATERNIONS) DATA("yesterday 0 0 0 1"), "", {"f.aem:18", "yesterday"}},
    {HEAD META(QUATERNIONS) DATA("2022-06-16T00:00:05 0 0 0 1\n2022-06-16T00:00:05 0 0 0 1"),
     "",
     {"f.aem:19:", "epochs that rise"}},
    {HEAD META(QUATERNIONS) DATA("2022-06-17T00:00:05 0 0 0 1"),
     "",
     {"f.aem:18:", "within the segment's span"}},
    {HEAD META(QUATERNIONS) DATA(""), "", {"f.aem:19:", "at least one row"}},
    {HEAD META(QUATERNIONS) "DATA_START\n2022-06-16T00:00:00 0 0 0 1",
     "",
     {"f.aem:17:", "DATA_STOP"}},
    {HEAD META(QUATERNIONS) DATA("2022-06-16T00:00:00 0 0 0 1"), "C", {"f.aem", "no object \"C\""}},
    {HEAD META(QUATERNIONS) DATA("2022-06-16T00:00:00 0 0 0 1") OTHER,
     "",
     {"f.aem:21:", "a second object"}},
    {HEAD META(FRAMES "ATTITUDE_TYPE = SPIN")
         DATA("2022-06-16T00:00:00 0 0 0 20\n2022-06-16T00:00:10 0 0 200 20"),
     "",
     {"f.aem:19:", "rows that stand closer"}},
};

static void faults_are_reported(void **state) {
    (void)state;
    for (size_t i = 0; i < sizeof faults / sizeof *faults; i++) {
        bst_ctx ctx = {0};
        bst_attitude_row *rows;
        int count;
        assert_int_not_equal(bst_aem_read(&ctx, "f.aem", faults[i].text, strlen(faults[i].text),
                                          faults[i].object, epoch(), &rows, &count),
                             BST_OK);
        assert_null(rows);
        for (int k = 0; k < 2; k++) {
            if (!strstr(ctx.message, faults[i].words[k])) {
                fail_msg("fault %zu: \"%s\" does not say \"%s\"", i, ctx.message,
                         faults[i].words[k]);
            }
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_quaternion_turns_the_frame),
        cmocka_unit_test(angles_and_spins),
        cmocka_unit_test(the_frame_bias_is_taken_off),
        cmocka_unit_test(segments_follow_each_other),
        cmocka_unit_test(faults_are_reported),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
