/* Values in the elements of a chart: what a script of the page reads. */
#include <math.h>

#include "sim/io/chart_values.h"
#include "tests/test_support.h"

/* A chart of 400 by 200 units over 0 to 10, with what a function draws. */
static char *drawn(void (*draw)(const bst_chart *chart, const void *user), const void *user,
                   bst_chart chart) {
    char *text = NULL;
    size_t bytes;
    FILE *out = open_memstream(&text, &bytes);
    assert_non_null(out);
    chart.out = out;
    bst_chart_begin(&chart);
    draw(&chart, user);
    bst_chart_end(&chart);
    assert_int_equal(fclose(out), 0);
    return text;
}

static bst_chart chart_of(double width) {
    return (bst_chart){.name = "chart",
                       .width = width,
                       .height = 200,
                       .x = {.label = "time, min", .low = 0, .high = 10, .unit_s = 60},
                       .y = {.label = "y", .low = 0, .high = 2}};
}

/* Value of the n-th attribute of this name (from 0), in a buffer of its own; NULL: there is none.
 */
static char *attribute(const char *text, const char *name, int n) {
    char head[40];
    snprintf(head, sizeof head, " %s=\"", name);
    for (const char *at = text; (at = strstr(at, head)); n--) {
        at += strlen(head);
        if (n == 0) {
            size_t length = strcspn(at, "\"");
            char *value = calloc(length + 1, 1);
            assert_non_null(value);
            memcpy(value, at, length);
            return value;
        }
    }
    return NULL;
}

static void check(const char *text, const char *name, int n, const char *expected) {
    char *value = attribute(text, name, n);
    assert_non_null(value);
    assert_string_equal(value, expected);
    free(value);
}

typedef struct series {
    const double *x, *y;
    size_t n;
} series;

static void draw_series(const bst_chart *chart, const void *user) {
    const series *s = user;
    bst_chart_line(chart, s->x, s->y, s->n, BST_CHART_BLUE, false);
    bst_chart_dots(chart, s->x, s->y, s->n, BST_CHART_RED);
}

static void what_is_no_number_is_a_gap(void **state) {
    (void)state;
    const double x[6] = {0, 1, 2, 3, 4, 5}, y[6] = {0.1, NAN, INFINITY, -INFINITY, -0.0, 1e300};
    char *text = drawn(draw_series, &(series){x, y, 6}, chart_of(400));
    for (int k = 0; k < 2; k++) { /* line and dots; the svg element has its own data-x */
        check(text, "data-x", 1 + k, "0 1 2 3 4 5");
        check(text, "data-y", 1 + k, "0.1 - - - 0 1e+300");
    }
    assert_null(strstr(text, "nan"));
    assert_null(strstr(text, "inf"));
    free(text);
}

static void an_empty_series_has_empty_lists(void **state) {
    (void)state;
    char *text = drawn(draw_series, &(series){NULL, NULL, 0}, chart_of(400));
    check(text, "data-x", 1, "");
    check(text, "data-y", 1, "");
    free(text);
}

static void names_stay_text(void **state) {
    (void)state;
    bst_chart chart = chart_of(400);
    chart.name = "</script><script>alert(1)</script>";
    chart.y.label = "\" onfocus=\"alert(1)";
    char *text = drawn(draw_series, &(series){NULL, NULL, 0}, chart);
    assert_null(strstr(text, "<script"));
    assert_null(strstr(text, "</script"));
    assert_null(strstr(text, "\" onfocus"));
    check(text, "data-y-label", 0, "&quot; onfocus=&quot;alert(1)");
    check(text, "data-x", 0, "0 10");
    check(text, "data-unit-s", 0, "60");
    free(text);
}

/* Reads "LOW" or "LOW:HIGH" behind a space; returns the place behind it. */
static const char *next_extent(const char *at, double *low, double *high) {
    char *end;
    *low = *high = strtod(at, &end);
    assert_ptr_not_equal(end, at);
    if (*end == ':') {
        *high = strtod(end + 1, &end);
    }
    return end;
}

enum { LONG = 86400 };

/* Of a day the page has the extremes of each column, in bounded space. */
static void long_series_keep_extremes(void **state) {
    (void)state;
    static double x[LONG], y[LONG];
    for (int i = 0; i < LONG; i++) {
        x[i] = 10.0 * i / LONG;
        y[i] = 1.0 + 0.5 * sin(0.01 * i);
    }
    y[12345] = 77.5; /* a spike of one sample */
    y[54321] = -33.25;
    static const double widths[2] = {400, 1100};
    static const int columns[2] = {BST_CHART_COLUMNS, BST_CHART_COLUMNS_WIDE};
    for (int k = 0; k < 2; k++) {
        char *text = drawn(draw_series, &(series){x, y, LONG}, chart_of(widths[k]));
        char *times = attribute(text, "data-x", 1), *values = attribute(text, "data-y", 1);
        const char *time = times, *value = values;
        double lowest = INFINITY, highest = -INFINITY;
        int count = 0;
        while (*value) {
            char *end;
            double at = strtod(time, &end), low, high;
            time = end;
            value = next_extent(value, &low, &high);
            /* middles of the columns; the list has 9 digits */
            bst_assert_close(at, (count + 0.5) * 10.0 / columns[k], 1e-7);
            assert_true(low <= high);
            if (high == 77.5) {
                bst_assert_close(at, x[12345], 0.5 * 10.0 / columns[k] + 1e-7);
            }
            lowest = fmin(lowest, low);
            highest = fmax(highest, high);
            count++;
        }
        assert_int_equal(count, columns[k]);
        assert_true(lowest == -33.25 && highest == 77.5);
        /* "-1.2346e-05:-1.2346e-05 " at most */
        assert_in_range(strlen(values), 1, 24 * (size_t)columns[k]);
        free(times);
        free(values);
        free(text);
    }
}

static void draw_twice(const bst_chart *chart, const void *user) {
    const series *s = user;
    bst_chart_line(chart, s->x, s->y, s->n, BST_CHART_BLUE, false);
    bst_chart_line(chart, s->x, s->x, s->n, BST_CHART_RED, false);
    bst_chart_line(chart, s->y, s->x, s->n, BST_CHART_RED, false);
}

/* The list of x is written once for each width; another list is never taken for it. */
static void lists_in_common_are_written_once(void **state) {
    (void)state;
    const double x[3] = {0, 1, 2}, y[3] = {1, 1.5, 2};
    bst_chart_common_x common = {.x = x, .n = 3, .number = 7};
    bst_chart chart = chart_of(400), wide = chart_of(1100);
    chart.common_x = wide.common_x = &common;
    char *text = drawn(draw_twice, &(series){x, y, 3}, chart);
    check(text, "id", 0, "x7");
    check(text, "data-x", 1, "0 1 2");
    check(text, "data-x", 2, "#x7");
    check(text, "data-x", 3, "1 1.5 2");
    free(text);
    text = drawn(draw_twice, &(series){x, y, 3}, wide);
    check(text, "id", 0, "x7w");
    check(text, "data-x", 2, "#x7w");
    free(text);
    text = drawn(draw_twice, &(series){x, y, 3}, chart);
    check(text, "data-x", 1, "#x7");
    free(text);
}

static void draw_dots(const bst_chart *chart, const void *user) {
    const series *s = user;
    bst_chart_dots(chart, s->x, s->y, s->n, BST_CHART_BLUE);
}

/* Dots in no order: those that show, at most BST_CHART_MOST_DOTS. */
static void dots_are_bounded(void **state) {
    (void)state;
    static double x[LONG], y[LONG];
    uint32_t random = 1;
    for (int i = 0; i < LONG; i++) {
        random = random * 1664525u + 1013904223u;
        x[i] = 10.0 * (random >> 16) / 65536.0;
        random = random * 1664525u + 1013904223u;
        y[i] = 2.0 * (random >> 16) / 65536.0;
    }
    char *text = drawn(draw_dots, &(series){x, y, LONG}, chart_of(1100));
    char *times = attribute(text, "data-x", 1), *values = attribute(text, "data-y", 1);
    size_t count = 1;
    for (const char *s = times; (s = strchr(s, ' ')); s++) {
        count++;
    }
    assert_in_range(count, BST_CHART_MOST_DOTS / 2, BST_CHART_MOST_DOTS);
    bst_assert_close(strtod(times, NULL), x[0], 1e-7);  /* 9 digits */
    bst_assert_close(strtod(values, NULL), y[0], 1e-5); /* 6 digits */
    free(times);
    free(values);
    free(text);
    const double few[4] = {3, 1, 1, 99}, heights[4] = {1, 0.5, 0.5, 1};
    text = drawn(draw_dots, &(series){few, heights, 4}, chart_of(400));
    check(text, "data-x", 1, "3 1");
    check(text, "data-y", 1, "1 0.5");
    free(text);
}

static void draw_others(const bst_chart *chart, const void *user) {
    (void)user;
    const double x[2] = {1, 2}, low[2] = {0.5, NAN}, high[2] = {1.5, INFINITY};
    bst_chart_bands(chart, x, high, 2, BST_CHART_MODE, "track");
    bst_chart_area(chart, x, low, high, 2, BST_CHART_BLUE);
    bst_chart_whiskers(chart, x, low, high, 2, BST_CHART_BLUE);
    bst_chart_bar(chart, NAN, 2, 0, INFINITY, BST_CHART_GREEN, NULL);
    bst_chart_rule(chart, 1, BST_CHART_GREY);
    bst_chart_mark(chart, 5, BST_CHART_GREY);
    bst_chart_word(chart, 1, 1, 2, -4, "start", "a<b");
}

static void other_shapes_have_their_values(void **state) {
    (void)state;
    bst_chart chart = chart_of(400);
    chart.y.logarithmic = true;
    chart.y.low = 0.1;
    chart.x.bare = true;
    char *text = drawn(draw_others, NULL, chart);
    check(text, "data-x", 0, "0 10 bare");
    check(text, "data-y", 0, "0.1 2 log");
    check(text, "data-from", 0, "1 2");
    check(text, "data-to", 0, "1.5 -");
    check(text, "data-low", 0, "0.5 -");
    check(text, "data-high", 1, "1.5 -");
    check(text, "data-bar", 0, "- 2 0 -");
    check(text, "data-rule", 0, "1");
    check(text, "data-mark", 0, "5");
    check(text, "data-word", 0, "1 1 2 -4");
    free(text);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_is_no_number_is_a_gap),
        cmocka_unit_test(an_empty_series_has_empty_lists),
        cmocka_unit_test(names_stay_text),
        cmocka_unit_test(long_series_keep_extremes),
        cmocka_unit_test(lists_in_common_are_written_once),
        cmocka_unit_test(dots_are_bounded),
        cmocka_unit_test(other_shapes_have_their_values),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
