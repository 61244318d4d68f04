/* The charts of a report's geometry, read back from the page and compared with the frames. */
#include "boresight/vec.h"
#include "sim/report/report.h"
#include "tests/report/svg_chart.h"

enum { N = 40 };

static double draw(uint64_t *state) {
    *state = *state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return ((double)(*state >> 11) + 0.5) * 0x1p-53;
}

/* Frames from `first_deg` of right ascension on, so many degrees apart. */
static void make_sensor(bst_report_sensor *s, double first_deg, double step_deg) {
    uint64_t r = 12;
    *s = (bst_report_sensor){.exposures = N, .every = 1, .pixel_scale_arcsec = 3.0, .count = N};
    s->frames = calloc(N, sizeof *s->frames);
    assert_non_null(s->frames);
    for (int i = 0; i < N; i++) {
        bst_report_frame *f = &s->frames[i];
        double mid = 400.0 * i + 30.0 * draw(&r);
        *f = (bst_report_frame){.exposure_id = i, .mid_s = mid, .end_s = mid + 0.5};
        f->dark = i % 10 == 9;
        f->v_mag = 9.0 + 4.0 * draw(&r);
        f->range_m = 1e6 * (30.0 + 10.0 * draw(&r));
        f->phase_rad = 0.3 + draw(&r);
        f->ra_deg = fmod(first_deg + step_deg * i, 360.0);
        f->dec_deg = -20.0 + 0.3 * i + draw(&r);
        f->apparent_ra_deg = i % 13 == 6 ? NAN : fmod(f->ra_deg + 2.0 + draw(&r), 360.0);
        f->apparent_dec_deg = i % 13 == 6 ? NAN : f->dec_deg - 3.0 + draw(&r);
        f->sun_rad = 1.0 + draw(&r);
        f->limb_rad = 0.4 * draw(&r) - 0.1;
        f->latitude_rad = 1.5 * draw(&r) - 0.7;
        f->longitude_rad = 6.0 * draw(&r) - 3.0;
    }
}

static char *page_of(const bst_report_sensor *s, double span_s) {
    bst_ctx ctx = {0};
    char *text = NULL;
    size_t bytes;
    FILE *out = open_memstream(&text, &bytes);
    assert_non_null(out);
    bst_assert_ok(&ctx, bst_report_plots(&ctx, out, s, span_s));
    fclose(out);
    return text;
}

/* The n-th path of a class goes through these points; positions are rounded to 0.1 units. */
static void expect_points(const svg_chart *c, const char *class_of, int number, const double *ex,
                          const double *ey) {
    double x[N], y[N];
    int count = svg_points(c, class_of, number, x, y, N), k = 0;
    for (int i = 0; i < N; i++) {
        if (!isnan(ex[i]) && !isnan(ey[i])) {
            assert_true(k < count);
            bst_assert_close(x[k], ex[i], 0.3 * fabs(c->x.slope));
            bst_assert_close(y[k], ey[i], 0.4 * fabs(c->y.slope));
            k++;
        }
    }
    assert_int_equal(k, count);
}

/* The axis reaches the least and the greatest of the numbers and so much of their range beyond. */
static void expect_range(double low, double high, const double *v, const double *w, double more) {
    double least = INFINITY, most = -INFINITY;
    for (int i = 0; i < N; i++) {
        least = fmin(least, fmin(v[i], w[i]));
        most = fmax(most, fmax(v[i], w[i]));
    }
    double range = most - least;
    bst_assert_close(low, least - more * range, 0.005 * range);
    bst_assert_close(high, most + more * range, 0.005 * range);
}

static void quantities_over_time(void **state) {
    (void)state;
    static const char *const names[] = {
        "Distance of the target", "Angle Sun - target - observer", "Brightness of the target",
        "Angle from the boresight to the Sun", "Angle from the boresight to the Earth"};
    bst_report_sensor s;
    make_sensor(&s, 10.0, 0.2);
    char *page = page_of(&s, 18000.0);
    double hours[N], v[5][N];
    for (int i = 0; i < N; i++) {
        const bst_report_frame *f = &s.frames[i];
        hours[i] = f->mid_s / 3600.0;
        v[0][i] = f->range_m / 1000.0;
        v[1][i] = f->phase_rad * 180.0 / BST_PI;
        v[2][i] = f->dark ? NAN : f->v_mag;
        v[3][i] = f->sun_rad * 180.0 / BST_PI;
        v[4][i] = f->limb_rad * 180.0 / BST_PI;
    }
    for (int k = 0; k < 5; k++) {
        svg_chart c = svg_need(page, names[k], false, false);
        bst_assert_close(svg_low_x(&c), 0.0, 0.02);
        bst_assert_close(svg_high_x(&c), 5.0, 0.02);
        expect_points(&c, "l c0\" stroke", 0, hours, v[k]);
        expect_range(svg_low_y(&c), svg_high_y(&c), v[k], v[k], 0.06);
    }
    free(page);
    bst_report_sensor_free(&s);
}

/* Right ascensions pass 360 degrees without a jump, and a full turn has its fixed axis. */
static void paths(void **state) {
    (void)state;
    for (int turn = 0; turn < 2; turn++) {
        bst_report_sensor s;
        make_sensor(&s, 350.0, turn ? 8.9 : 0.4);
        char *page = page_of(&s, 18000.0);
        double ra[2][N], dec[2][N], place[2][N];
        for (int i = 0; i < N; i++) {
            const bst_report_frame *f = &s.frames[i];
            const double angles[2] = {f->ra_deg, f->apparent_ra_deg};
            for (int k = 0; k < 2; k++) {
                ra[k][i] = !turn && angles[k] < 180.0 ? angles[k] + 360.0 : angles[k];
                dec[k][i] = k == 0 ? f->dec_deg : f->apparent_dec_deg;
            }
            place[0][i] = f->longitude_rad * 180.0 / BST_PI;
            place[1][i] = f->latitude_rad * 180.0 / BST_PI;
        }
        svg_chart c = svg_need(page, "Paths of the boresight and of the target", false, false);
        expect_points(&c, "l o c1", 0, ra[0], dec[0]);
        expect_points(&c, "l o c0", 0, ra[1], dec[1]);
        if (turn) {
            bst_assert_close(svg_low_x(&c), 0.0, 0.5);
            bst_assert_close(svg_high_x(&c), 360.0, 0.5);
        } else {
            expect_range(svg_low_x(&c), svg_high_x(&c), ra[0], ra[1], 0.05);
        }
        expect_range(svg_low_y(&c), svg_high_y(&c), dec[0], dec[1], 0.06);
        c = svg_need(page, "Path of the observer", false, false);
        expect_points(&c, "l o c2", 0, place[0], place[1]);
        bst_assert_close(svg_low_x(&c), -180.0, 0.5);
        bst_assert_close(svg_high_x(&c), 180.0, 0.5);
        bst_assert_close(svg_low_y(&c), -90.0, 0.5);
        bst_assert_close(svg_high_y(&c), 90.0, 0.5);
        free(page);
        bst_report_sensor_free(&s);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(quantities_over_time),
        cmocka_unit_test(paths),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
