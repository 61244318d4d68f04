/* Dates of an OEM's metadata against those of its states. */
#include <string.h>

#include "sim/astro/oem.h"
#include "tests/test_support.h"

#define HEAD                                                                           \
    "CCSDS_OEM_VERS = 2.0\nCREATION_DATE = 2022-06-16T00:00:00\nORIGINATOR = TEST\n"   \
    "META_START\nOBJECT_NAME = SAT\nOBJECT_ID = 2022-001A\nCENTER_NAME = EARTH\n"      \
    "REF_FRAME = GCRF\nTIME_SYSTEM = UTC\nSTART_TIME = 2022-06-16T00:00:00\nSTOP_TIME" \
    " = 2022-06-16T00:02:00\nMETA_STOP\n"

/* A table may begin and end a step inside of its dates: the longest of its steps, wherever it is.
 */
static void tables_may_begin_and_end_within_a_step(void **state) {
    (void)state;
    static const struct {
        const char *seconds[4]; /* of the states, from the start */
        bool good;
    } cases[] = {{{"00:30", "01:30", "01:31", NULL}, true},
                 {{"00:29", "00:30", "01:30", NULL}, true},
                 {{"00:59", "01:00", "01:58", "01:59"}, false}, /* 59 s after the start; 58 s */
                 {{"00:58", "01:00", "01:58", "01:59"}, true},
                 {{"00:00", "00:40", "01:19", NULL}, false}, /* 41 s before the end; 40 s */
                 {{"00:00", "00:41", "01:19", NULL}, true}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char text[1200] = HEAD;
        for (int k = 0; k < 4 && cases[i].seconds[k]; k++) {
            char row[100];
            snprintf(row, sizeof row, "2022-06-16T00:%s 7000 %d 0 0 7.5 1\n", cases[i].seconds[k],
                     100 * k);
            strcat(text, row);
        }
        bst_ctx ctx = {0};
        bst_oem *oem = NULL;
        const bst_status status = bst_oem_read_buffer(&ctx, "x", text, strlen(text), &oem);
        assert_int_equal(status, cases[i].good ? BST_OK : BST_ERR_FORMAT);
        assert_true(cases[i].good ||
                    strstr(ctx.message, "the states do not reach from START_TIME"));
        bst_oem_free(oem);
    }
}

/* Segments of an object in the order of their usable spans, not of their first states: the one that
 * begins first is usable last. */
static void segments_follow_one_another_by_their_use(void **state) {
    (void)state;
    static const char meta[] =
        "META_START\nOBJECT_NAME = SAT\nOBJECT_ID = 2022-001A\nCENTER_NAME = "
        "EARTH\nREF_FRAME = GCRF\nTIME_SYSTEM = UTC\n";
    char text[2000];
    snprintf(text, sizeof text,
             "CCSDS_OEM_VERS = 2.0\nCREATION_DATE = 2022-06-16T00:00:00\nORIGINATOR = TEST\n"
             "%sSTART_TIME = 2022-06-16T00:00:00\nUSEABLE_START_TIME = 2022-06-16T00:05:00\n"
             "STOP_TIME = 2022-06-16T00:10:00\nMETA_STOP\n"
             "2022-06-16T00:00:00 7000 0 0 0 0 0\n2022-06-16T00:10:00 7000 0 0 0 0 0\n"
             "%sSTART_TIME = 2022-06-16T00:02:00\nSTOP_TIME = 2022-06-16T00:05:00\nMETA_STOP\n"
             "2022-06-16T00:02:00 8000 0 0 0 0 0\n2022-06-16T00:05:00 8000 0 0 0 0 0\n",
             meta, meta);
    bst_ctx ctx = {0};
    bst_oem *oem = NULL;
    bst_assert_ok(&ctx, bst_oem_read_buffer(&ctx, "x", text, strlen(text), &oem));
    static const struct {
        const char *utc;
        double x_m;
    } at[] = {{"2022-06-16T00:02:30Z", 8e6},
              {"2022-06-16T00:04:50Z", 8e6},
              {"2022-06-16T00:05:10Z", 7e6},
              {"2022-06-16T00:09:00Z", 7e6}};
    for (int i = 0; i < 4; i++) {
        bst_time t;
        bst_vec3 place, velocity;
        bst_assert_ok(&ctx, bst_time_from_utc(&ctx, at[i].utc, &t));
        bst_assert_ok(&ctx, bst_oem_state(&ctx, oem, 0, NULL, t, &place, &velocity));
        bst_assert_close(place.x, at[i].x_m, 1e-3);
    }
    bst_time start, stop, first;
    bst_oem_span(oem, 0, &start, &stop);
    bst_assert_ok(&ctx, bst_time_from_utc(&ctx, "2022-06-16T00:02:00Z", &first));
    bst_assert_close(bst_time_diff(start, first), 0.0, 1e-6);
    bst_oem_free(oem);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(tables_may_begin_and_end_within_a_step),
                                       cmocka_unit_test(segments_follow_one_another_by_their_use)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
