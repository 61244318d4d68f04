/* Timeline, bands of the modes and paths of a sensor, read back from the page. */
#include "boresight/messages.h"
#include "boresight/vec.h"
#include "sim/io/chart.h"
#include "sim/report/report.h"
#include "tests/report/svg_chart.h"

enum { N = 50, MANY = 2300, ROWS = 5, INTERVALS = 230 };

typedef struct fixture {
    bst_report_sensor sensor;
    char *page;
} fixture;

/* States of frames that change at different times, so that no lane equals another one. */
static void make(fixture *f, int count, double step_s, const bst_report_mode *modes,
                 size_t mode_count, double span_s) {
    bst_ctx ctx = {0};
    size_t bytes;
    f->sensor = (bst_report_sensor){
        .count = (size_t)count, .every = 1, .has_truth = true, .has_tracks = true};
    f->sensor.frames = calloc((size_t)count, sizeof *f->sensor.frames);
    for (int i = 0; i < count; i++) {
        bst_report_frame *r = &f->sensor.frames[i];
        *r = (bst_report_frame){.exposure_id = i,
                                .mid_s = step_s * (i + 0.5),
                                .end_s = step_s * (i + 0.7),
                                .mode = -1,
                                .known = i % 23 != 22,
                                .occulted = i % 40 < 9,
                                .dark = i % 40 >= 9 && i % 40 < 15,
                                .visible = i % 40 >= 18,
                                .in_field = i % 30 > 12,
                                .in_track = i % 37 > 20,
                                .attitude = i % 50 > 16};
        double *numbers[] = {
            &r->snr,     &r->track_snr,         &r->detections,         &r->stars,
            &r->nees,    &r->track_east_arcsec, &r->track_north_arcsec, &r->track_sigma_arcsec,
            &r->error_px};
        for (size_t k = 0; k < sizeof numbers / sizeof *numbers; k++) {
            *numbers[k] = NAN;
        }
        r->ra_deg = fmod(355.0 + 0.3 * i, 360.0);
        r->dec_deg = -30.0 + 0.05 * i + 4.0 * sin(0.3 * i);
        r->apparent_ra_deg = i % 6 == 5 ? NAN : fmod(352.0 + 0.31 * i, 360.0);
        r->apparent_dec_deg = i % 6 == 5 ? NAN : -20.0 + 3.0 * cos(0.21 * i);
        r->latitude_rad = 1.4 * sin(0.2 * i);
        r->longitude_rad = fmod(0.37 * i, 6.2) - 3.1;
        r->range_m = 1e6 * (40.0 + 2.0 * sin(0.4 * i));
        r->phase_rad = 0.5 + 0.3 * cos(0.3 * i);
        r->v_mag = 11.0 + sin(0.5 * i);
        r->sun_rad = 1.0 + 0.2 * sin(0.6 * i);
        r->limb_rad = 0.1 - 0.3 * cos(0.7 * i);
    }
    f->sensor.modes = calloc(mode_count + 1, sizeof *modes);
    memcpy(f->sensor.modes, modes, mode_count * sizeof *modes);
    f->sensor.mode_count = mode_count;
    FILE *out = open_memstream(&f->page, &bytes);
    assert_non_null(out);
    bst_assert_ok(&ctx, bst_report_plots(&ctx, out, &f->sensor, span_s));
    fclose(out);
}

static void unmake(fixture *f) {
    free(f->page);
    bst_report_sensor_free(&f->sensor);
}

static const bst_report_mode few[] = {{3, BST_MODE_IDLE},
                                      {20, BST_MODE_SLEW},
                                      {45, BST_MODE_TRACK},
                                      {60, BST_MODE_COAST},
                                      {70, BST_MODE_TRACK}};

/* State of a lane in a frame: its place in the lists of colours below; -1: none. */
static int state_of(int lane, const bst_report_frame *r) {
    switch (lane) {
        case 0:
            return !r->known ? -1 : r->occulted ? 1 : r->dark ? 2 : r->visible ? 0 : 3;
        case 1:
            return r->in_field ? 0 : -1;
        case 2:
            return r->in_track ? 0 : -1;
        default:
            return r->attitude ? 0 : -1;
    }
}

static const int colours[4][4] = {
    {BST_CHART_GREEN, BST_CHART_GREY, BST_CHART_VIOLET, BST_CHART_BROWN},
    {BST_CHART_BLUE, -1, -1, -1},
    {BST_CHART_GREEN, -1, -1, -1},
    {BST_CHART_CYAN, -1, -1, -1}};
static const char *const words[4][4] = {
    {"visible", "behind the Earth", "in the Earth's shadow", "gives no light"},
    {"in the field"},
    {"in track"},
    {"attitude"}};

/* The height of a lane's bars of a colour at a time; rows are 1 / ROWS high, the mode on top. */
static double height_at(const svg_bar *bars, int count, int lane, double at) {
    double sum = 0.0;
    for (int k = 0; k < count; k++) {
        double middle = 0.5 * ROWS * (bars[k].y0 + bars[k].y1);
        if ((int)floor(middle) == ROWS - 2 - lane && bars[k].x0 <= at && bars[k].x1 >= at) {
            sum += ROWS * (bars[k].y1 - bars[k].y0);
        }
    }
    return sum;
}

static svg_bar bars[20000];

/* Compares up to an apostrophe, which a page writes in another way. */
static bool begins_so(const char *title, const char *text) {
    return strncmp(title, text, strcspn(text, "'")) == 0;
}

static void lanes_frame_by_frame(void **state) {
    (void)state;
    fixture f;
    make(&f, N, 2.0, few, 5, 110.0);
    svg_chart c = svg_need(f.page, "Timeline of the mode", false, false);
    for (int lane = 0; lane < 4; lane++) {
        for (int s = 0; s < 4 && colours[lane][s] >= 0; s++) {
            int count = svg_bars(&c, colours[lane][s], bars, 20000);
            /* a state lasts from its frame to the next one, the last to the end of the run */
            for (int i = 0; i < N; i++) {
                bool own = state_of(lane, &f.sensor.frames[i]) == s;
                double from = f.sensor.frames[i].mid_s;
                bst_assert_close(height_at(bars, count, lane, from + 0.3), own ? 0.64 : 0.0, 0.01);
                bst_assert_close(height_at(bars, count, lane, from + 1.7), own ? 0.64 : 0.0, 0.01);
            }
            bool last = state_of(lane, &f.sensor.frames[N - 1]) == s;
            bst_assert_close(height_at(bars, count, lane, 109.0), last ? 0.64 : 0.0, 0.01);
            bst_assert_close(height_at(bars, count, lane, 0.5), 0.0, 0.0);
            for (int k = 0; k < count; k++) {
                double from, to;
                if ((int)floor(0.5 * ROWS * (bars[k].y0 + bars[k].y1)) != ROWS - 2 - lane) {
                    continue;
                }
                /* centred in its row: 0.18 below and above */
                bst_assert_close(ROWS * bars[k].y0, ROWS - 2 - lane + 0.18, 0.01);
                if (c.width * (bars[k].x1 - bars[k].x0) / svg_high_x(&c) < 3.2) {
                    continue; /* too narrow for a title */
                }
                assert_true(begins_so(bars[k].title, words[lane][s]));
                assert_int_equal(sscanf(bars[k].title, "%*[^:]: %lf s to %lf s", &from, &to), 2);
                bst_assert_close(from, bars[k].x0, 0.15);
                bst_assert_close(to, bars[k].x1, 0.15);
            }
        }
    }
    unmake(&f);
}

/* More than 460 frames: the height of a bar is the share of its interval's frames. */
static void lanes_by_shares(void **state) {
    (void)state;
    fixture f;
    const double span = 2.0 * MANY;
    make(&f, MANY, 2.0, few, 5, span);
    svg_chart c = svg_need(f.page, "Timeline of the mode", false, false);
    double unit = svg_high_x(&c) / span; /* of the axis, minutes */
    for (int lane = 0; lane < 4; lane++) {
        for (int s = 0; s < 4 && colours[lane][s] >= 0; s++) {
            int count = svg_bars(&c, colours[lane][s], bars, 20000);
            for (int v = 0; v < INTERVALS; v++) {
                int all = 0, own = 0;
                for (int i = 0; i < MANY; i++) {
                    if ((int)(f.sensor.frames[i].mid_s / span * INTERVALS) == v) {
                        all++;
                        own += state_of(lane, &f.sensor.frames[i]) == s;
                    }
                }
                double at = (v + 0.5) * span / INTERVALS * unit;
                bst_assert_close(height_at(bars, count, lane, at), 0.64 * own / all, 0.01);
            }
            int titled = 0;
            for (int k = 0; k < count; k++) {
                double share, from, to;
                int frames;
                if (sscanf(bars[k].title, "%*[^:]: %lf %% of %d frames from %lf s to %lf s", &share,
                           &frames, &from, &to) == 4 &&
                    begins_so(bars[k].title, words[lane][s]) &&
                    (int)floor(0.5 * ROWS * (bars[k].y0 + bars[k].y1)) == ROWS - 2 - lane) {
                    titled++;
                    bst_assert_close(0.64 * share / 100, ROWS * (bars[k].y1 - bars[k].y0), 0.01);
                    bst_assert_close(from * unit, bars[k].x0,
                                     0.01 * span * unit / INTERVALS + 0.02);
                    bst_assert_close(to * unit, bars[k].x1, 0.01 * span * unit / INTERVALS + 0.02);
                    assert_int_equal(frames, MANY / INTERVALS);
                }
            }
            assert_true(titled > 0);
        }
    }
    unmake(&f);
}

/* Bands of a mode in a chart over time: those from which to which times. */
static int bands(const svg_chart *c, int mode, double from[100], double to[100]) {
    char mark[60];
    snprintf(mark, sizeof mark, "<path class=\"b c%d\" ", BST_CHART_MODE + mode);
    const char *p = svg_after(svg_after(c->from, c->to, mark), c->to, " d=\"");
    int count = 0;
    while (p && *p == 'M') {
        double x, y, width, bottom, back;
        int used;
        assert_int_equal(
            sscanf(p, "M%lf %lfh%lfV%lfh%lfz%n", &x, &y, &width, &bottom, &back, &used), 5);
        p += used;
        assert_true(count < 100);
        from[count] = svg_value(&c->x, x);
        to[count++] = svg_value(&c->x, x + width);
        bst_assert_close(y, c->top, 0.06);
        bst_assert_close(bottom, c->top + c->height, 0.06);
        bst_assert_close(back, -width, 0.0);
    }
    if (p) {
        char title[40];
        snprintf(title, sizeof title, "\"><title>%s</title>", bst_mode_name(mode));
        assert_int_equal(strncmp(p, title, strlen(title)), 0);
    }
    return count;
}

static void modes_as_bands(void **state) {
    (void)state;
    fixture f;
    make(&f, N, 2.0, few, 5, 110.0);
    for (int i = 0; i < N; i++) {
        f.sensor.frames[i].detections = 10 + i % 7;
        f.sensor.frames[i].stars = 3;
    }
    free(f.page);
    bst_ctx ctx = {0};
    size_t bytes;
    FILE *out = open_memstream(&f.page, &bytes);
    bst_assert_ok(&ctx, bst_report_plots(&ctx, out, &f.sensor, 110.0));
    fclose(out);
    svg_chart c = svg_need(f.page, "Detections per frame", false, false);
    double from[100], to[100];
    assert_int_equal(bands(&c, BST_MODE_IDLE, from, to), 1);
    bst_assert_close(from[0], 3, 0.1);
    bst_assert_close(to[0], 20, 0.1);
    assert_int_equal(bands(&c, BST_MODE_TRACK, from, to), 2);
    bst_assert_close(from[0], 45, 0.1);
    bst_assert_close(to[0], 60, 0.1);
    bst_assert_close(from[1], 70, 0.1);
    bst_assert_close(to[1], 110, 0.1);
    assert_int_equal(bands(&c, BST_MODE_COAST, from, to), 1);
    bst_assert_close(from[0], 60, 0.1);
    assert_int_equal(bands(&c, BST_MODE_SEARCH, from, to), 0);
    c = svg_need(f.page, "Timeline of the mode", false, false);
    int count = svg_bars(&c, (int)BST_CHART_MODE + (int)BST_MODE_SLEW, bars, 20000);
    assert_int_equal(count, 1);
    bst_assert_close(bars[0].x0, 20, 0.1);
    bst_assert_close(bars[0].x1, 45, 0.1);
    bst_assert_close(ROWS * bars[0].y0, 4.18, 0.01);
    bst_assert_close(ROWS * bars[0].y1, 4.82, 0.01);
    unmake(&f);
}

/* More changes than can be drawn: of each of 512 parts of the run the mode at its middle. */
static void very_many_modes(void **state) {
    (void)state;
    enum { CHANGES = 700 };
    bst_report_mode modes[CHANGES];
    fixture f;
    for (int i = 0; i < CHANGES; i++) {
        /* an hour in which the mode rests, and quick changes */
        modes[i] = (bst_report_mode){i < 350 ? i : 600.0 + i, i % 3 == 0   ? BST_MODE_TRACK
                                                              : i % 3 == 1 ? BST_MODE_COAST
                                                                           : BST_MODE_REACQUIRE};
    }
    make(&f, N, 25.0, modes, CHANGES, 1400.0);
    svg_chart c = svg_need(f.page, "Timeline of the mode", false, false);
    double unit = svg_high_x(&c) / 1400.0;
    for (int part = 0; part < 512; part += 3) {
        double at = (part + 0.5) * 1400.0 / 512;
        int mode = -1;
        for (int i = 0; i < CHANGES && modes[i].from_s <= at; i++) {
            mode = modes[i].mode;
        }
        int count = svg_bars(&c, BST_CHART_MODE + mode, bars, 20000), there = 0;
        for (int k = 0; k < count; k++) {
            there += bars[k].x0 <= at * unit && bars[k].x1 >= at * unit;
        }
        assert_int_equal(there, 1);
    }
    unmake(&f);
}

static double of_time(const bst_report_frame *r) {
    return r->mid_s;
}
static double of_range(const bst_report_frame *r) {
    return r->range_m / 1000.0;
}
static double of_phase(const bst_report_frame *r) {
    return r->phase_rad * 180.0 / BST_PI;
}
static double of_v(const bst_report_frame *r) {
    return r->dark ? NAN : r->v_mag;
}
static double of_sun(const bst_report_frame *r) {
    return r->sun_rad * 180.0 / BST_PI;
}
static double of_limb(const bst_report_frame *r) {
    return r->limb_rad * 180.0 / BST_PI;
}
static double of_latitude(const bst_report_frame *r) {
    return r->latitude_rad * 180.0 / BST_PI;
}
static double of_longitude(const bst_report_frame *r) {
    return r->longitude_rad * 180.0 / BST_PI;
}
/* the path crosses 360 degrees upwards: it goes on beyond */
static double of_ra(const bst_report_frame *r) {
    return r->ra_deg < 180.0 ? r->ra_deg + 360.0 : r->ra_deg;
}
static double of_dec(const bst_report_frame *r) {
    return r->dec_deg;
}
static double of_target_ra(const bst_report_frame *r) {
    return r->apparent_ra_deg < 180.0 ? r->apparent_ra_deg + 360.0 : r->apparent_ra_deg;
}
static double of_target_dec(const bst_report_frame *r) {
    return r->apparent_dec_deg;
}

typedef double (*quantity)(const bst_report_frame *r);

static void expect_points(const fixture *f, const char *name, const char *class_of, quantity x_of,
                          quantity y_of) {
    svg_chart c = svg_need(f->page, name, false, false);
    double x[MANY], y[MANY];
    int count = svg_points(&c, class_of, 0, x, y, MANY), k = 0;
    for (size_t i = 0; i < f->sensor.count; i++) {
        double ex = x_of(&f->sensor.frames[i]), ey = y_of(&f->sensor.frames[i]);
        if (isnan(ex) || isnan(ey)) {
            continue;
        }
        assert_true(k < count);
        bst_assert_close(x[k], ex, 0.3 * fabs(c.x.slope));
        bst_assert_close(y[k], ey, 0.3 * fabs(c.y.slope));
        k++;
    }
    assert_int_equal(k, count);
}

static void paths_and_angles(void **state) {
    (void)state;
    fixture f;
    make(&f, N, 2.0, few, 5, 110.0);
    const char *sky = "Paths of the boresight and of the target";
    expect_points(&f, sky, "l o c1", of_ra, of_dec);
    expect_points(&f, sky, "l o c0", of_target_ra, of_target_dec);
    expect_points(&f, "Path of the observer", "l o c2", of_longitude, of_latitude);
    svg_chart ground = svg_need(f.page, "Path of the observer", false, false);
    bst_assert_close(svg_low_x(&ground), -180, 0.5);
    bst_assert_close(svg_high_y(&ground), 90, 0.5);
    bst_assert_close(svg_low_y(&ground), -90, 0.5);
    expect_points(&f, "Distance of the target", "l c0\" stroke", of_time, of_range);
    expect_points(&f, "Angle Sun - target", "l c0\" stroke", of_time, of_phase);
    expect_points(&f, "Brightness of the target", "l c0\" stroke", of_time, of_v);
    expect_points(&f, "Angle from the boresight to the Sun", "l c0\" stroke", of_time, of_sun);
    expect_points(&f, "Angle from the boresight to the Earth", "l c0\" stroke", of_time, of_limb);
    unmake(&f);
}

/* What turns right round the sky is drawn from 0 to 360 degrees. */
static void a_path_round_the_sky(void **state) {
    (void)state;
    fixture f;
    make(&f, 400, 2.0, few, 5, 800.0);
    for (int i = 0; i < 400; i++) {
        f.sensor.frames[i].ra_deg = fmod(100.0 + 2.0 * i, 360.0);
        f.sensor.frames[i].apparent_ra_deg = fmod(90.0 + 2.0 * i, 360.0);
    }
    free(f.page);
    bst_ctx ctx = {0};
    size_t bytes;
    FILE *out = open_memstream(&f.page, &bytes);
    bst_assert_ok(&ctx, bst_report_plots(&ctx, out, &f.sensor, 800.0));
    fclose(out);
    svg_chart c = svg_need(f.page, "Paths of the boresight", false, false);
    bst_assert_close(svg_low_x(&c), 0, 0.5);
    bst_assert_close(svg_high_x(&c), 360, 0.5);
    unmake(&f);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(lanes_frame_by_frame), cmocka_unit_test(lanes_by_shares),
        cmocka_unit_test(modes_as_bands),       cmocka_unit_test(very_many_modes),
        cmocka_unit_test(paths_and_angles),     cmocka_unit_test(a_path_round_the_sky),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
