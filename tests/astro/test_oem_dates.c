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

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(tables_may_begin_and_end_within_a_step)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
