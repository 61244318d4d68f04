#include "sim/astro/state_table.h"

#include <stdbool.h>
#include <stdlib.h>

#include "tests/astro/damaged_file.h"
#include "tests/test_support.h"

#define COLUMNS                                                                             \
    "start_x_m,start_y_m,start_z_m,start_vx_mps,start_vy_mps,start_vz_mps,end_x_m,end_y_m," \
    "end_z_m,end_vx_mps,end_vy_mps,end_vz_mps"
#define HEADER "object,start_s,end_s," COLUMNS "\n"

static const bst_time epoch = {2459746.5, 0.25};

static bst_status read_text(bst_ctx *ctx, const char *text, bst_state_table **out) {
    return bst_state_table_read_buffer(ctx, "x.csv", text, strlen(text), epoch, out);
}

/* The frame of a circle of radius 7,000 km at 1.1e-3 rad/s. */
static void circle(double t, bst_vec3 *r, bst_vec3 *v) {
    const double a = 7e6, w = 1.1e-3;
    *r = (bst_vec3){a * cos(w * t), a * sin(w * t), 0.0};
    *v = (bst_vec3){-a * w * sin(w * t), a * w * cos(w * t), 0.0};
}

static size_t print_frame(char *out, size_t bytes, const char *name, double start, double end) {
    bst_vec3 r, v, q, w;
    circle(start, &r, &v);
    circle(end, &q, &w);
    return (size_t)snprintf(out, bytes,
                            "%s,%.17g,%.17g,%.17g,%.17g,0,%.17g,%.17g,0,%.17g,%.17g,0,%.17g,%.17g,"
                            "0\n",
                            name, start, end, r.x, r.y, v.x, v.y, q.x, q.y, w.x, w.y);
}

/* Frames of 0.5 s every 4 s, two objects in turn. */
static void a_cubic_within_and_between_frames(void **state) {
    (void)state;
    enum { FRAMES = 30 };
    char *text = malloc(65536);
    assert_non_null(text);
    size_t used = (size_t)snprintf(text, 65536, "# a comment\n%s", HEADER);
    for (int i = 0; i < FRAMES; i++) {
        used += print_frame(text + used, 65536 - used, "B", 4.0 * i, 4.0 * i + 0.5);
        used += print_frame(text + used, 65536 - used, "A", 4.0 * i + 0.1, 4.0 * i + 0.6);
    }
    bst_ctx ctx = {0};
    bst_state_table *injected;
    int object;
    double from_s, to_s;
    bst_assert_ok(&ctx, read_text(&ctx, text, &injected));
    assert_int_equal(bst_state_table_object_count(injected), 2);
    bst_assert_ok(&ctx, bst_state_table_find(&ctx, injected, "B", &object));
    assert_string_equal(bst_state_table_object_name(injected, object), "B");
    bst_state_table_span(injected, object, &from_s, &to_s);
    assert_true(from_s == 0.0 && to_s == 4.0 * (FRAMES - 1) + 0.5);
    bst_vec3 r, v, true_r, true_v;
    for (double t = 0.0; t <= to_s; t += 0.017) {
        bst_assert_ok(&ctx, bst_state_table_state(&ctx, injected, object, t, &r, &v));
        circle(t, &true_r, &true_v);
        /* a w^4 h^4 / 384 over the 3.5 s between frames is 4.0e-6 m; its slope's bound is
         * sqrt(3) / 216 a w^4 h^3 = 3.5e-6 m/s */
        bst_assert_close(bst_vec3_norm(bst_vec3_sub(r, true_r)), 0.0, 4.1e-6);
        bst_assert_close(bst_vec3_norm(bst_vec3_sub(v, true_v)), 0.0, 3.6e-6);
    }
    assert_int_equal(bst_state_table_state(&ctx, injected, object, -0.25, &r, &v), BST_ERR_NUMERIC);
    assert_string_equal(ctx.message,
                        "x.csv: no state of \"B\" -0.250000 s after the epoch: the "
                        "file covers 0.000000 s to 116.500000 s");
    assert_int_equal(bst_state_table_state(&ctx, injected, object, NAN, &r, &v), BST_ERR_NUMERIC);
    assert_int_equal(bst_state_table_find(&ctx, injected, "", &object), BST_ERR_NOT_FOUND);
    assert_string_equal(ctx.message, "x.csv: no object \"\" among 2 (the first: \"A\")");
    bst_state_table_free(injected);
    free(text);
}

static void frames_that_meet_may_jump(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_state_table *injected;
    bst_assert_ok(&ctx, read_text(&ctx,
                                  HEADER "X,0,1,0,0,0,1,0,0,1,0,0,1,0,0\r\n"
                                         "\"X\",1,2,5,0,0,2,0,0,7,0,0,2,0,0",
                                  &injected));
    int object;
    bst_vec3 r, v;
    bst_assert_ok(&ctx, bst_state_table_find(&ctx, injected, "", &object));
    static const double cases[][3] = {{0.5, 0.5, 1}, {1.0, 5.0, 2}, {1.5, 6.0, 2}, {2.0, 7.0, 2}};
    for (size_t i = 0; i < 4; i++) {
        bst_assert_ok(&ctx, bst_state_table_state(&ctx, injected, object, cases[i][0], &r, &v));
        bst_assert_close(r.x, cases[i][1], 1e-14); /* rounding */
        bst_assert_close(v.x, cases[i][2], 1e-14);
    }
    bst_state_table_free(injected);
}

static void times_may_be_utc(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_state_table *injected;
    /* the epoch is 2022-06-16T05:59:23 UTC: TAI - UTC is 37 s */
    bst_assert_ok(&ctx, read_text(&ctx,
                                  "start_utc,end_utc,object," COLUMNS "\n2022-06-16T05:59:23.5,"
                                  "2022-167T05:59:24.75Z,X,1,2,3,4,5,6,7,8,9,10,11,12\n",
                                  &injected));
    double from_s, to_s;
    bst_state_table_span(injected, 0, &from_s, &to_s);
    bst_assert_close(from_s, 0.5, 1e-10); /* resolution of bst_time */
    bst_assert_close(to_s, 1.75, 1e-10);
    bst_state_table_free(injected);
}

static void errors_say_where_and_what(void **state) {
    (void)state;
    static const struct {
        const char *text, *message;
    } cases[] = {
        {"",
         "x.csv:1: the file holds no states (expected a header row and a row per object and "
         "frame)"},
        {HEADER,
         "x.csv:1: the file holds no states (expected a header row and a row per object "
         "and frame)"},
        {"object,start_s,end_s,start_x_km\n",
         "x.csv:1: the column is not known (found \"start_x_km\", expected start_x_m)"},
        {"object,object\n",
         "x.csv:1: a column comes twice (found \"object\", expected each column once)"},
        {"object,start_s,end_s\n", "x.csv:1: the column start_x_m is missing"},
        {"object,end_s," COLUMNS "\n",
         "x.csv:1: one column of start_s and start_utc is expected, not none"},
        {"object,start_s,end_s,end_utc," COLUMNS "\n",
         "x.csv:1: one column of end_s and end_utc is expected, not both"},
        {HEADER "X,0,1\n",
         "x.csv:2: 3 fields, where the header row has 15 (found \"X,0,1\", "
         "expected one field for each column)"},
        {HEADER "X,0,1,0,0,zero,0,0,0,0,0,0,0,0,0\n",
         "x.csv:2: start_z_m is not a number (found \"zero\", expected m or m/s)"},
        {HEADER "X,0,1,0,0,inf,0,0,0,0,0,0,0,0,0\n",
         "x.csv:2: start_z_m is not a number (found \"inf\", expected m or m/s)"},
        {HEADER "X,0,1,0,0,,0,0,0,0,0,0,0,0,0\n",
         "x.csv:2: start_z_m is not a number (found \"\", expected m or m/s)"},
        {HEADER "X,1e10,1,0,0,0,0,0,0,0,0,0,0,0,0\n",
         "x.csv:2: start_s is not a number in the range (found \"1e10\", expected -1e9 to 1e9 "
         "seconds after the epoch)"},
        {HEADER "X,1,1,0,0,0,0,0,0,0,0,0,0,0,0\n",
         "x.csv:2: the frame does not end after it starts"},
        {HEADER ",0,1,0,0,0,0,0,0,0,0,0,0,0,0\n",
         "x.csv:2: object is not a name (found \"\", expected 1 to 63 characters of printable "
         "ASCII without quotes)"},
        {HEADER "X,0,1,0,0,0,0,0,0,0,0,0,0,0,0\n\nX,0.9,2,0,0,0,0,0,0,0,0,0,0,0,0\n",
         "x.csv:4: the frame of \"X\" starts before the one of line 2 ends"},
        {HEADER "\"X,0,1,0,0,0,0,0,0,0,0,0,0,0,0\n",
         "x.csv:2: a quoted field does not end (found \"\"X,0,1,0,0,0,0,0,0,0,0,0,0,0,0\", "
         "expected "
         "\"field\", with \"\" for a quote within)"},
        {"object,start_utc,end_s," COLUMNS "\nX,2022-13-01T00:00:00,1,0,0,0,0,0,0,0,0,0,0,0,0\n",
         "x.csv:2: start_utc: \"2022-13-01T00:00:00\" has no month in 01..12"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        bst_ctx ctx = {0};
        bst_state_table *injected = (bst_state_table *)&ctx;
        bst_status status = read_text(&ctx, cases[i].text, &injected);
        assert_string_equal(ctx.message, cases[i].message);
        assert_int_equal(status, BST_ERR_FORMAT);
        assert_null(injected);
    }
    bst_ctx ctx = {0};
    bst_state_table *injected;
    assert_int_equal(bst_state_table_load(&ctx, "no/such", epoch, &injected), BST_ERR_NOT_FOUND);
    assert_int_equal(bst_state_table_load(&ctx, "tests", epoch, &injected), BST_ERR_IO);
    assert_string_equal(ctx.message, "tests: is a folder; give a file of states per frame (CSV)");
}

/* What is accepted must evaluate. */
static void read_damaged(const char *data, size_t size) {
    bst_ctx ctx = {0};
    bst_state_table *injected;
    bst_status status = bst_state_table_read_buffer(&ctx, "x", data, size, epoch, &injected);
    assert_true((status == BST_OK) == (injected != NULL) &&
                (status == BST_OK) == (ctx.message[0] == '\0'));
    for (int o = 0; injected && o < bst_state_table_object_count(injected); o++) {
        double from_s, to_s;
        bst_vec3 r, v;
        bst_state_table_span(injected, o, &from_s, &to_s);
        bst_assert_ok(&ctx, bst_state_table_state(&ctx, injected, o, from_s, &r, &v));
        bst_assert_ok(&ctx, bst_state_table_state(&ctx, injected, o, to_s, &r, &v));
    }
    bst_state_table_free(injected);
}

static void survives_damaged_files(void **state) {
    (void)state;
    const char *good = HEADER
        "X,0,1,0,0,0,1,0,0,1,0,0,1,0,0\n\"X\",1,2,5,0,0,2,0,0,7,0,0,2,0,0\n"
        "Y,1,2,5,0,0,2,0,0,7,0,0,2,0,0\n";
    const unsigned char bytes[] = {0x00, 0x0a, '"', ',', '9', 0xff};
    bst_damage(good, bytes, sizeof bytes, read_damaged);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_cubic_within_and_between_frames),
        cmocka_unit_test(frames_that_meet_may_jump),
        cmocka_unit_test(times_may_be_utc),
        cmocka_unit_test(errors_say_where_and_what),
        cmocka_unit_test(survives_damaged_files),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
