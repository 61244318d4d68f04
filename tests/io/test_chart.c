#include "sim/io/chart.h"
#include "sim/io/html.h"
#include "tests/test_support.h"

/* What a function writes to a stream. */
static char *written(void (*write)(FILE *out, void *user), void *user) {
    char *text = NULL;
    size_t bytes;
    FILE *out = open_memstream(&text, &bytes);
    assert_non_null(out);
    write(out, user);
    assert_int_equal(fclose(out), 0);
    return text;
}

static void write_text(FILE *out, void *user) {
    bst_html_text(out, user);
}

static void check_text(const char *given, const char *expected) {
    char *text = written(write_text, (void *)(uintptr_t)given);
    assert_string_equal(text, expected);
    free(text);
}

static void text_cannot_become_markup(void **state) {
    (void)state;
    check_text("a<b>&\"c'", "a&lt;b&gt;&amp;&quot;c&#39;");
    check_text("</title><script>", "&lt;/title&gt;&lt;script&gt;");
    check_text("\xC3\xA9 \xE2\x82\xAC \xF0\x9F\x9B\xB0", "\xC3\xA9 \xE2\x82\xAC \xF0\x9F\x9B\xB0");
    check_text("a\tb\nc", "a\tb\nc");
    check_text("", "");
    check_text(NULL, "");
#define R "\xEF\xBF\xBD"
    /* RFC 3629: overlong forms, surrogates, beyond U+10FFFF, a lone continuation, a cut character
     */
    check_text("\xC0\xBC", R R);
    check_text("\xED\xA0\x80", R R R);
    check_text("\xF4\x90\x80\x80", R R R R);
    check_text("x\x80y", "x" R "y");
    check_text("\xE2\x82", R R);
    check_text("\x01\x7F\xC2\x85", R R R);
#undef R
}

typedef struct bytes {
    const char *data;
    size_t count;
} bytes;

static void write_base64(FILE *out, void *user) {
    const bytes *b = user;
    bst_html_base64(out, b->data, b->count);
}

/* The test vectors of RFC 4648, section 10. */
static void base64_of_the_standard(void **state) {
    (void)state;
    static const char *const expected[] = {"",         "Zg==",     "Zm8=",    "Zm9v",
                                           "Zm9vYg==", "Zm9vYmE=", "Zm9vYmFy"};
    for (size_t n = 0; n <= 6; n++) {
        bytes b = {"foobar", n};
        char *text = written(write_base64, &b);
        assert_string_equal(text, expected[n]);
        free(text);
    }
    bytes high = {"\xFB\xFF\x00", 3};
    char *text = written(write_base64, &high);
    assert_string_equal(text, "+/8A");
    free(text);
}

/* Steps are 1, 2 or 5 times a power of ten, inside the axis, about as many as wanted. */
static void ticks_are_round(void **state) {
    (void)state;
    static const double ranges[][2] = {{0, 300},       {-0.37, 0.41}, {1e-7, 3e-7}, {12.99, 13.07},
                                       {-1e9, 2.5e10}, {0, 86400},    {5, 5.000001}};
    for (size_t i = 0; i < sizeof ranges / sizeof *ranges; i++) {
        double ticks[40];
        int decimals,
            n = bst_chart_ticks(ranges[i][0], ranges[i][1], false, 8, ticks, 40, &decimals);
        assert_in_range(n, 4, 17);
        double step = ticks[1] - ticks[0], unit = pow(10.0, floor(log10(step) + 1e-6));
        double lead = step / unit;
        /* differences of doubles near 5 with a step of 1e-7 carry 1e-8 of it */
        assert_true(fabs(lead - 1) < 1e-6 || fabs(lead - 2) < 1e-6 || fabs(lead - 5) < 1e-6);
        double slack = 1e-6 * step;
        for (int k = 0; k < n; k++) {
            assert_true(ticks[k] >= ranges[i][0] - slack && ticks[k] <= ranges[i][1] + slack);
            char text[2][40];
            if (decimals >= 0 && k > 0) { /* neighbours read differently */
                snprintf(text[0], sizeof text[0], "%.*f", decimals, ticks[k - 1]);
                snprintf(text[1], sizeof text[1], "%.*f", decimals, ticks[k]);
                assert_string_not_equal(text[0], text[1]);
            }
        }
    }
}

static void ticks_of_logarithms(void **state) {
    (void)state;
    double ticks[40];
    int decimals;
    assert_int_equal(bst_chart_ticks(0.01, 10000, true, 8, ticks, 40, &decimals), 7);
    /* exact powers of ten: pow(10, k) of glibc is right to the last digit for these */
    bst_assert_close(ticks[0], 0.01, 1e-17);
    bst_assert_close(ticks[6], 1e4, 1e-11);
    /* less than two decades: 2 and 5 too */
    assert_int_equal(bst_chart_ticks(1, 10, true, 8, ticks, 40, &decimals), 4);
    bst_assert_close(ticks[1], 2.0, 1e-15);
    bst_assert_close(ticks[2], 5.0, 1e-15);
    /* 40 decades do not give 40 ticks */
    assert_in_range(bst_chart_ticks(1e-20, 1e20, true, 8, ticks, 40, &decimals), 6, 14);
    /* no axis, no ticks */
    assert_int_equal(bst_chart_ticks(3, 3, false, 8, ticks, 40, &decimals), 0);
    assert_int_equal(bst_chart_ticks(NAN, 3, false, 8, ticks, 40, &decimals), 0);
    assert_int_equal(bst_chart_ticks(-1, 3, true, 8, ticks, 40, &decimals), 0);
}

static void axes_of_any_range(void **state) {
    (void)state;
    static const double ranges[][2] = {{INFINITY, -INFINITY}, {3, 3}, {0, 0}, {1, 2}, {1e12, 1e12}};
    for (size_t i = 0; i < sizeof ranges / sizeof *ranges; i++) {
        for (int logarithmic = 0; logarithmic < 2; logarithmic++) {
            bst_chart_axis axis = {.label = "", .logarithmic = logarithmic};
            if (logarithmic && ranges[i][0] == 0.0) {
                continue; /* bst_chart_widen takes no zero there */
            }
            bst_chart_fit(&axis, ranges[i][0], ranges[i][1], 0.05);
            assert_true(isfinite(axis.low) && isfinite(axis.high) && axis.high > axis.low);
            assert_true(!logarithmic || axis.low > 0.0);
            assert_true(!(ranges[i][0] <= ranges[i][1]) ||
                        (axis.low <= ranges[i][0] && axis.high >= ranges[i][1]));
        }
    }
}

/* Axes hold exactly the finite values: a margin on either side, or whole decades that a round value
 * does not push further. */
static void axes_of_values(void **state) {
    (void)state;
    const double values[7] = {NAN, 3.0, -2.0, 0.25, INFINITY, 0.0, 5.0};
    double low = INFINITY, high = -INFINITY;
    bst_chart_widen(values, 7, false, &low, &high);
    assert_true(low == -2.0 && high == 5.0);
    bst_chart_axis axis = {.label = ""};
    bst_chart_fit(&axis, low, high, 0.05);
    bst_assert_close(axis.low, -2.35, 1e-12);
    bst_assert_close(axis.high, 5.35, 1e-12);
    low = INFINITY, high = -INFINITY;
    bst_chart_widen(values, 7, true, &low, &high);
    assert_true(low == 0.25 && high == 5.0);
    static const double decades[][4] = {
        {0.25, 5.0, 0.1, 10.0}, {1.0, 1000.0, 1.0, 1000.0}, {1e-3, 2e-3, 1e-3, 1e-2}};
    axis.logarithmic = true;
    for (int i = 0; i < 3; i++) {
        bst_chart_fit(&axis, decades[i][0], decades[i][1], 0.05);
        bst_assert_close(axis.low / decades[i][2], 1.0, 1e-12);
        bst_assert_close(axis.high / decades[i][3], 1.0, 1e-12);
    }
}

enum { LONG = 43200, COLUMNS = 400 };

/* Every column keeps its lowest and highest value, and the ends of the series stay. */
static void thinning_keeps_extremes(void **state) {
    (void)state;
    static double x[LONG], y[LONG];
    static bst_chart_point out[5 * COLUMNS + 1];
    uint32_t random = 1;
    for (int i = 0; i < LONG; i++) {
        random = random * 1664525u + 1013904223u;
        x[i] = i;
        y[i] = sin(1e-3 * i) + 1e-9 * random;
    }
    y[12345] = 500.0; /* a spike of one point */
    y[23456] = -500.0;
    size_t n = bst_chart_thin(x, y, LONG, 0.0, LONG - 1, COLUMNS, out);
    assert_in_range(n, COLUMNS, 4 * COLUMNS);
    for (size_t i = 1; i < n; i++) {
        assert_true(out[i].x > out[i - 1].x);
    }
    assert_true(out[0].x == x[0] && out[0].y == y[0]);
    assert_true(out[n - 1].x == x[LONG - 1] && out[n - 1].y == y[LONG - 1]);
    double scale = COLUMNS / (LONG - 1.0);
    size_t next = 0;
    for (int column = 0; column < COLUMNS; column++) {
        double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
        for (int i = 0; i < LONG; i++) {
            if ((int)fmin(floor(x[i] * scale), COLUMNS - 1) == column) {
                low[0] = fmin(low[0], y[i]);
                high[0] = fmax(high[0], y[i]);
            }
        }
        for (; next < n && (int)fmin(floor(out[next].x * scale), COLUMNS - 1) == column; next++) {
            low[1] = fmin(low[1], out[next].y);
            high[1] = fmax(high[1], out[next].y);
        }
        assert_true(low[0] == low[1] && high[0] == high[1]);
    }
    assert_int_equal(next, n);
}

static void thinning_breaks_at_gaps(void **state) {
    (void)state;
    static double x[LONG], y[LONG];
    static bst_chart_point out[5 * COLUMNS + 1];
    for (int i = 0; i < LONG; i++) {
        x[i] = i;
        y[i] = i >= 10000 && i < 20000 ? NAN : 1.0;
    }
    size_t n = bst_chart_thin(x, y, LONG, 0.0, LONG, COLUMNS, out), breaks = 0;
    for (size_t i = 0; i < n; i++) {
        breaks += isnan(out[i].y) ? 1 : 0;
        /* a part is 108 long: nothing is drawn inside the gap but near its ends */
        assert_true(isnan(out[i].y) || out[i].x < 10000 || out[i].x >= 20000);
    }
    assert_int_equal(breaks, 1);
    /* few points remain as they are, infinities as breaks */
    double few_x[3] = {0, 1, 2}, few_y[3] = {1, INFINITY, 3};
    assert_int_equal(bst_chart_thin(few_x, few_y, 3, 0, 2, COLUMNS, out), 3);
    assert_true(isnan(out[1].y) && out[2].y == 3.0);
    /* what lies outside is left out, nothing is read twice */
    n = bst_chart_thin(x, y, LONG, 30000, 30010, 16, out);
    assert_int_equal(n, 11);
    assert_int_equal(bst_chart_thin(x, y, 0, 0, 1, COLUMNS, out), 0);
}

static void write_chart(FILE *out, void *user) {
    (void)user;
    double x[4] = {0, 1, 2, 3}, y[4] = {1, NAN, 1e300, -1e300}, low[4] = {0, NAN, 0, 1};
    bst_chart c = {.out = out,
                   .name = "<\"name\">",
                   .width = 400,
                   .height = 200,
                   .x = {.label = "x & y", .low = 0, .high = 3},
                   .y = {.label = "'label'", .low = 0, .high = 2}};
    bst_chart_begin(&c);
    double from[2] = {-5, 2}, to[2] = {1, NAN};
    bst_chart_bands(&c, from, to, 2, BST_CHART_MODE, "band <b>");
    bst_chart_line(&c, x, y, 4, BST_CHART_BLUE, true);
    bst_chart_dots(&c, x, y, 4, BST_CHART_RED);
    bst_chart_area(&c, x, low, y, 4, BST_CHART_BLUE);
    bst_chart_whiskers(&c, x, low, y, 4, BST_CHART_BLUE);
    bst_chart_bar(&c, NAN, 2, 0, INFINITY, BST_CHART_GREEN, NULL);
    bst_chart_rule(&c, 1, BST_CHART_GREY);
    bst_chart_mark(&c, 99, BST_CHART_GREY);
    bst_chart_word(&c, 1, 1, 2, 2, "start", "a<b");
    bst_chart_end(&c);
    bst_chart_legend(out, BST_KEY_LINE, BST_CHART_BLUE, "a&b");
    bst_chart_style(out);
}

/* Numbers far off the axes and what is none give numbers still; texts are escaped. */
static void charts_are_sound(void **state) {
    (void)state;
    char *text = written(write_chart, NULL), *again = written(write_chart, NULL);
    assert_string_equal(text, again);
    assert_null(strstr(text, "nan"));
    assert_null(strstr(text, "inf"));
    assert_null(strstr(text, "<b>"));
    assert_non_null(strstr(text, "aria-label=\"&lt;&quot;name&quot;&gt;\""));
    assert_non_null(strstr(text, ">x &amp; y</text>"));
    assert_non_null(strstr(text, "prefers-color-scheme:dark"));
    int opened = 0, closed = 0;
    for (const char *s = text; (s = strstr(s, "<svg")); s++) {
        opened++;
    }
    for (const char *s = text; (s = strstr(s, "</svg>")); s++) {
        closed++;
    }
    assert_int_equal(opened, closed);
    assert_int_equal(opened, 4); /* the chart, and the areas that cut line, dots and area */
    free(text);
    free(again);
}

static void time_units(void **state) {
    (void)state;
    const char *name;
    assert_true(bst_chart_time_unit(300, &name) == 1.0);
    assert_string_equal(name, "s");
    assert_true(bst_chart_time_unit(86400, &name) == 3600.0);
    assert_string_equal(name, "h");
    assert_true(bst_chart_time_unit(30 * 86400.0, &name) == 86400.0);
    assert_string_equal(name, "d");
}

static void write_axes(FILE *out, void *user) {
    bst_chart *c = user;
    c->out = out;
    bst_chart_begin(c);
    bst_chart_end(c);
}

/* Numbers of both axes stand apart, and are many enough, on charts that lie and that stand. */
static void numbers_by_the_shape_of_the_chart(void **state) {
    (void)state;
    static const double shapes[][2] = {{900, 160}, {240, 700}};
    for (int k = 0; k < 2; k++) {
        bst_chart c = {.width = shapes[k][0],
                       .height = shapes[k][1],
                       .x = {.label = "x", .low = 0, .high = 100},
                       .y = {.label = "y", .low = 0, .high = 100}};
        char *text = written(write_axes, &c);
        double last = NAN, nearest = INFINITY;
        int count = 0;
        for (const char *at = text; (at = strstr(at, "<path class=\"g\" d=\"M")); at++) {
            double x, y, to;
            if (sscanf(at, "<path class=\"g\" d=\"M%lf %lfH%lf", &x, &y, &to) == 3) {
                nearest = isnan(last) ? nearest : fmin(nearest, fabs(y - last));
                last = y;
                count++;
                bst_assert_close(to - x, c.inner_width, 0.11);
            }
        }
        assert_true(nearest >= 16.0); /* 1.5 lines */
        assert_true(count >= 2 && count >= (int)(c.inner_height / 80.0));
        free(text);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(text_cannot_become_markup),
        cmocka_unit_test(base64_of_the_standard),
        cmocka_unit_test(ticks_are_round),
        cmocka_unit_test(ticks_of_logarithms),
        cmocka_unit_test(axes_of_any_range),
        cmocka_unit_test(axes_of_values),
        cmocka_unit_test(numbers_by_the_shape_of_the_chart),
        cmocka_unit_test(thinning_keeps_extremes),
        cmocka_unit_test(thinning_breaks_at_gaps),
        cmocka_unit_test(charts_are_sound),
        cmocka_unit_test(time_units),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
