/* The charts of a sensor, read back from the page and compared with the frames that they draw. */
#include "boresight/messages.h"
#include "boresight/vec.h"
#include "sim/export/frame_marks.h"
#include "sim/io/chart.h"
#include "sim/io/fits_reader.h"
#include "sim/report/report.h"
#include "tests/report/run_tables.h"
#include "tests/report/svg_chart.h"

enum { N = 60, MANY = 2300 };

#define LINE(colour) "l c" #colour "\" stroke"
#define DASHED(colour) "l s c" #colour
#define DOTS(colour) "l o c" #colour

static double draw(uint64_t *state) {
    *state = *state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return ((double)(*state >> 11) + 0.5) * 0x1p-53;
}

/* A sensor whose every frame differs from the others in each quantity. */
static void make_sensor(bst_report_sensor *s, int count, uint64_t seed) {
    uint64_t r = seed;
    *s = (bst_report_sensor){.exposures = count, .every = 1, .pixel_scale_arcsec = 3.0};
    snprintf(s->name, sizeof s->name, "eye/camera");
    s->frames = calloc((size_t)count, sizeof *s->frames);
    s->count = (size_t)count;
    s->has_truth = s->has_tracks = true;
    for (int i = 0; i < count; i++) {
        bst_report_frame *f = &s->frames[i];
        double mid = 10.0 * i + 3.0 * draw(&r);
        *f = (bst_report_frame){.exposure_id = 100 + i, .mid_s = mid, .end_s = mid + 0.5};
        double size = pow(10.0, 2.0 * draw(&r) - 1.0), angle = 2 * BST_PI * draw(&r);
        f->error_px = size;
        f->error_x_px = size * cos(angle);
        f->error_y_px = size * sin(angle);
        f->known = i % 11 != 10;
        f->visible = i % 5 != 4;
        f->occulted = i % 10 == 4;
        f->dark = i % 10 == 9;
        f->in_field = i % 3 != 0;
        f->in_track = i % 4 != 3;
        f->attitude = i % 7 != 2;
        f->settled = i > 6;
        f->mode = i < 3 ? BST_MODE_SLEW : i % 9 == 8 ? BST_MODE_COAST : BST_MODE_TRACK;
        f->updated = i % 6 != 1;
        f->snr = i % 8 == 5 ? NAN : 4.0 + 20.0 * draw(&r);
        f->track_snr = i % 6 == 1 ? NAN : 3.0 + 20.0 * draw(&r);
        f->detections = 20.0 + floor(30.0 * draw(&r));
        f->stars = 5.0 + floor(14.0 * draw(&r));
        f->track_east_arcsec = 2.0 * draw(&r) - 1.0;
        f->track_north_arcsec = 5.0 * draw(&r) - 2.0;
        f->track_sigma_arcsec = 0.2 + 2.0 * draw(&r);
        f->nees = -2.0 * log(draw(&r));
        f->v_mag = 9.0 + 4.0 * draw(&r);
        f->range_m = 1e6 * (30.0 + 10.0 * draw(&r));
        f->phase_rad = 0.3 + draw(&r);
        f->ra_deg = fmod(350.0 + 0.4 * i + draw(&r), 360.0);
        f->dec_deg = -20.0 + 0.3 * i + draw(&r);
        f->apparent_ra_deg = fmod(f->ra_deg + 2.0 + draw(&r), 360.0);
        f->apparent_dec_deg = f->dec_deg - 3.0 + draw(&r);
        f->sun_rad = 1.0 + draw(&r);
        f->limb_rad = 0.4 * draw(&r) - 0.1;
        f->latitude_rad = 1.5 * draw(&r) - 0.7;
        f->longitude_rad = 6.0 * draw(&r) - 3.0;
    }
    s->loop = (bst_loop_figures){.pointing_frames = 37,
                                 .pointing_rms_px = 0.211,
                                 .pointing_median_px = 0.182,
                                 .pointing_p95_px = 0.363,
                                 .pointing_p99_px = 0.444,
                                 .pointing_max_px = 0.615};
    s->track_frames = 41;
    s->track_rms_px = 0.721;
    s->track_median_px = 0.672;
    s->track_p95_px = 1.23;
    s->track_max_px = 1.94;
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

typedef double (*quantity)(const bst_report_frame *f);

/* The drawn points are those of the frames that have the quantity, in their order. */
static void expect_points(const svg_chart *c, const char *class_of, int number,
                          const bst_report_sensor *s, quantity x_of, quantity y_of) {
    double x[MANY], y[MANY];
    int count = svg_points(c, class_of, number, x, y, MANY), k = 0;
    double x_unit = fabs(c->x.slope), y_unit = fabs(c->y.slope);
    for (size_t i = 0; i < s->count; i++) {
        double ex = x_of(&s->frames[i]), ey = y_of(&s->frames[i]);
        if (isnan(ex) || isnan(ey)) {
            continue;
        }
        if (k >= count) {
            fail_msg("%s: %d points, more are expected", class_of, count);
        }
        /* positions are rounded to 0.1 units, and so are those of the numbers at the axes */
        bst_assert_close(x[k], ex, 0.3 * x_unit);
        if (c->y.logarithmic) {
            bst_assert_close(log10(y[k]), log10(ey), 0.4 * y_unit);
        } else {
            bst_assert_close(y[k], ey, 0.4 * y_unit);
        }
        k++;
    }
    assert_int_equal(k, count);
}

static double time_s(const bst_report_frame *f) {
    return f->mid_s;
}
static double error_seen(const bst_report_frame *f) {
    return f->visible ? f->error_px : NAN;
}
static double error_unseen(const bst_report_frame *f) {
    return f->visible ? NAN : f->error_px;
}
static bool points(const bst_report_frame *f) {
    return f->known && f->visible && f->settled && f->mode == BST_MODE_TRACK;
}
static double x_pointing(const bst_report_frame *f) {
    return points(f) ? f->error_x_px : NAN;
}
static double y_pointing(const bst_report_frame *f) {
    return points(f) ? f->error_y_px : NAN;
}
static double track_error(const bst_report_frame *f) {
    return sqrt(f->track_east_arcsec * f->track_east_arcsec +
                f->track_north_arcsec * f->track_north_arcsec);
}
static double track_sigma(const bst_report_frame *f) {
    return f->track_sigma_arcsec;
}
static double nees_all(const bst_report_frame *f) {
    return f->nees;
}
static double snr_true(const bst_report_frame *f) {
    return f->snr;
}
static double snr_measured(const bst_report_frame *f) {
    return f->track_snr;
}
static double found_all(const bst_report_frame *f) {
    return f->detections;
}
static double found_stars(const bst_report_frame *f) {
    return f->stars;
}
static double found_others(const bst_report_frame *f) {
    return f->detections - f->stars;
}

static int ascending(const void *a, const void *b) {
    double p = *(const double *)a, q = *(const double *)b;
    return (p > q) - (p < q);
}

/* The finite values of a quantity, ascending. */
static int sorted(const bst_report_sensor *s, quantity of, double out[MANY]) {
    int n = 0;
    for (size_t i = 0; i < s->count; i++) {
        double v = of(&s->frames[i]);
        if (!isnan(v)) {
            out[n++] = v;
        }
    }
    qsort(out, (size_t)n, sizeof *out, ascending);
    return n;
}

static void charts_over_time(void **state) {
    (void)state;
    bst_report_sensor s;
    make_sensor(&s, N, 5);
    char *page = page_of(&s, 700.0);
    double v[MANY];
    svg_chart c = svg_need(page, "Distance from the boresight", false, true);
    expect_points(&c, LINE(0), 0, &s, time_s, error_seen);
    expect_points(&c, LINE(7), 0, &s, time_s, error_unseen);
    bst_assert_close(svg_low_x(&c), 0.0, 0.5);
    bst_assert_close(svg_high_x(&c), 700.0, 0.5);
    svg_expect_number(c.caption, "In the", 37, 2);
    svg_expect_number(c.caption, "settling on: RMS", 0.211, 3);
    svg_expect_number(c.caption, ", median", 0.182, 3);
    svg_expect_number(c.caption, "95 % below", 0.363, 3);
    svg_expect_number(c.caption, "99 % below", 0.444, 3);
    svg_expect_number(c.caption, "largest", 0.615, 3);
    c = svg_need(page, "Pointing error along the sensor", false, false);
    expect_points(&c, LINE(0), 0, &s, time_s, x_pointing);
    expect_points(&c, LINE(1), 0, &s, time_s, y_pointing);
    c = svg_need(page, "Error of the track of interest", false, true);
    expect_points(&c, LINE(0), 0, &s, time_s, track_error);
    expect_points(&c, LINE(3), 0, &s, time_s, track_sigma);
    svg_expect_number(c.caption, "In the", 41, 2);
    svg_expect_number(c.caption, "RMS", 0.721, 3);
    svg_expect_number(c.caption, ", median", 0.672, 3);
    svg_expect_number(c.caption, "95 % below", 1.23, 3);
    svg_expect_number(c.caption, "largest", 1.94, 3);
    assert_null(svg_after(c.caption, strstr(c.caption, "</figcaption>"), "99 % below"));
    c = svg_need(page, "Signal-to-noise ratio", false, false);
    expect_points(&c, LINE(0), 0, &s, time_s, snr_true);
    expect_points(&c, DOTS(1), 0, &s, time_s, snr_measured);
    double high = 0.0;
    high = fmax(v[sorted(&s, snr_true, v) - 1], high);
    high = fmax(v[sorted(&s, snr_measured, v) - 1], high);
    bst_assert_close(svg_low_y(&c), -0.05 * high, 0.01 * high);
    bst_assert_close(svg_high_y(&c), 1.05 * high, 0.01 * high);
    c = svg_need(page, "Detections per frame", false, false);
    expect_points(&c, LINE(0), 0, &s, time_s, found_all);
    expect_points(&c, LINE(2), 0, &s, time_s, found_stars);
    expect_points(&c, LINE(1), 0, &s, time_s, found_others);
    double means[2] = {0};
    for (int i = 0; i < N; i++) {
        means[0] += s.frames[i].detections / N;
        means[1] += s.frames[i].stars / N;
    }
    svg_expect_number(c.caption, "Detections per frame:", means[0], 3);
    svg_expect_number(c.caption, "of which", means[1], 3);
    svg_expect_number(c.caption, "as stars and", means[0] - means[1], 3);
    free(page);
    bst_report_sensor_free(&s);
}

/* Largest error on the axes: no more than four times the one that 95 % stay below. */
static void a_transient_does_not_flatten_the_axes(void **state) {
    (void)state;
    bst_report_sensor s;
    make_sensor(&s, N, 6);
    double sizes[2 * N];
    int n = 0;
    s.frames[20].error_x_px = 5000.0;
    for (int i = 0; i < N; i++) {
        if (points(&s.frames[i])) {
            sizes[n++] = fabs(s.frames[i].error_x_px);
            sizes[n++] = fabs(s.frames[i].error_y_px);
        }
    }
    assert_true(points(&s.frames[20]));
    qsort(sizes, (size_t)n, sizeof *sizes, ascending);
    double limit = 4.0 * sizes[(int)ceil(0.95 * n) - 1]; /* nearest rank */
    assert_true(limit < 5000.0);
    char *page = page_of(&s, 700.0);
    svg_chart c = svg_need(page, "Pointing error along the sensor", false, false);
    bst_assert_close(svg_high_y(&c), 1.1 * limit, 0.01 * limit);
    bst_assert_close(svg_low_y(&c), -1.1 * limit, 0.01 * limit);
    free(page);
    bst_report_sensor_free(&s);
}

static void nees_and_its_interval(void **state) {
    (void)state;
    bst_report_sensor s;
    make_sensor(&s, N, 7);
    char *page = page_of(&s, 700.0);
    svg_chart c = svg_need(page, "Normalised error squared", false, true);
    expect_points(&c, LINE(0), 0, &s, time_s, nees_all);
    /* quantiles of chi-square with two degrees of freedom at 2.5 and 97.5 % (tables) */
    const double ends[2] = {0.0506356, 7.377759};
    const char *rule = c.from;
    for (int k = 0; k < 2; k++) {
        double x, y;
        rule = svg_after(rule, c.to, "<path class=\"r c3\" d=\"M");
        assert_true(rule && sscanf(rule, "%lf %lf", &x, &y) == 2);
        bst_assert_close(log10(svg_value(&c.y, y)), log10(ends[k]), 0.2 * fabs(c.y.slope));
    }
    double v[MANY], sum = 0.0;
    int n = 0, inside = 0;
    for (int i = 0; i < N; i++) {
        if (s.frames[i].updated) {
            v[n++] = s.frames[i].nees;
            sum += s.frames[i].nees;
            inside += s.frames[i].nees > ends[0] && s.frames[i].nees < ends[1];
        }
    }
    qsort(v, (size_t)n, sizeof *v, ascending);
    svg_expect_number(c.caption, "In the", n, 2);
    svg_expect_number(c.caption, "mean", sum / n, 3);
    svg_expect_number(c.caption, "detection: mean", sum / n, 3);
    svg_expect_number(c.caption, ", median", v[(n + 1) / 2 - 1], 3);
    bst_assert_close(svg_number_after(c.caption, "(1.39),"), 100.0 * inside / n, 0.51);
    free(page);
    bst_report_sensor_free(&s);
}

/* Bars are counts; the curve has the law's share of them. */
static void expect_histogram(const char *page, const char *name, const double *values, int n,
                             double low, double high, int bins,
                             double (*law)(double from, double to, const double *p),
                             const double *p) {
    svg_chart c = svg_need(page, name, false, false);
    svg_bar bars[64];
    int count = svg_bars(&c, -1, bars, 64);
    double width = (high - low) / bins, total = 0.0;
    bst_assert_close(svg_low_x(&c), low, 0.005 * (high - low));
    bst_assert_close(svg_high_x(&c), high, 0.005 * (high - low));
    for (int k = 0; k < count; k++) {
        double middle = 0.5 * (bars[k].x0 + bars[k].x1);
        int bin = (int)floor((middle - low) / width), own = 0, edge = 0;
        for (int i = 0; i < n; i++) {
            double at = (values[i] - low) / width - bin;
            own += at >= 0.0 && at < 1.0;
            edge += fabs(at) < 1e-9 || fabs(at - 1.0) < 1e-9; /* the median is an edge */
        }
        bst_assert_close(bars[k].x1 - bars[k].x0, width, 0.04 * width);
        bst_assert_close(middle, low + (bin + 0.5) * width, 0.04 * width);
        bst_assert_close(bars[k].y1, own, 0.02 + edge);
        bst_assert_close(bars[k].y0, 0.0, 0.02);
        total += bars[k].y1;
    }
    int inside = 0;
    for (int i = 0; i < n; i++) {
        inside += values[i] >= low && values[i] < high;
    }
    bst_assert_close(total, inside, 0.5);
    double x[200], y[200];
    int points_of_curve = svg_points(&c, LINE(3), 0, x, y, 200);
    assert_true(points_of_curve > 100);
    for (int k = 0; k < points_of_curve; k++) {
        if (x[k] < low + 0.5 * width) {
            continue;
        }
        double share = law(x[k] - 0.5 * width, x[k] + 0.5 * width, p);
        /* the curve is the density: over a bin it bends by a few percent of its height */
        bst_assert_close(y[k], n * share, 0.03 * n * law(-0.5 * width, 0.5 * width, NULL) + 0.1);
    }
}

static double normal_share(double from, double to, const double *p) {
    double mean = p ? p[0] : 0.0, sigma = p ? p[1] : 1.0;
    return 0.5 * (erf((to - mean) / sigma / sqrt(2.0)) - erf((from - mean) / sigma / sqrt(2.0)));
}

static double chi2_share(double from, double to, const double *p) {
    (void)p;
    return exp(-0.5 * fmax(from, 0.0)) - exp(-0.5 * fmax(to, 0.0));
}

static void histograms(void **state) {
    (void)state;
    bst_report_sensor s;
    make_sensor(&s, N, 8);
    char *page = page_of(&s, 700.0);
    static const struct {
        const char *name;
        quantity of;
    } axes[] = {{"pointing error in x, px", x_pointing}, {"pointing error in y, px", y_pointing}};
    for (int k = 0; k < 2; k++) {
        double v[MANY], sum = 0.0, sum2 = 0.0;
        int n = sorted(&s, axes[k].of, v);
        for (int i = 0; i < n; i++) {
            sum += v[i];
            sum2 += v[i] * v[i];
        }
        /* nearest ranks; the inner 68 % are one sigma on either side */
        double median = v[(n + 1) / 2 - 1];
        double sigma = 0.5 * (v[(int)ceil(0.8413 * n) - 1] - v[(int)ceil(0.1587 * n) - 1]);
        const double p[2] = {median, sigma};
        svg_chart c = svg_need(page, axes[k].name, false, false);
        bst_assert_close(svg_low_x(&c), median - 5 * sigma, 0.02 * sigma);
        bst_assert_close(svg_high_x(&c), median + 5 * sigma, 0.02 * sigma);
        svg_expect_number(c.caption, "Mean", sum / n, 2);
        svg_expect_number(c.caption, "RMS", sqrt(sum2 / n), 3);
        expect_histogram(page, axes[k].name, v, n, median - 5 * sigma, median + 5 * sigma, 40,
                         normal_share, p);
    }
    double v[MANY];
    int n = 0;
    for (int i = 0; i < N; i++) {
        if (s.frames[i].updated) {
            v[n++] = s.frames[i].nees;
        }
    }
    expect_histogram(page, "NEES of the track", v, n, 0.0, 12.0, 40, chi2_share, NULL);
    free(page);
    bst_report_sensor_free(&s);
    make_sensor(&s, 19, 8); /* fewer than 20 values: none */
    page = page_of(&s, 700.0);
    svg_chart none;
    assert_false(svg_find(page, "NEES of the track", false, false, &none));
    assert_false(svg_find(page, "pointing error in x, px", false, false, &none));
    free(page);
    bst_report_sensor_free(&s);
}

static void no_frames(void **state) {
    (void)state;
    bst_report_sensor s = {.count = 0};
    char *page = page_of(&s, 10.0);
    assert_non_null(strstr(page, "No frame is recorded."));
    free(page);
    make_sensor(&s, N, 9);
    for (int i = 0; i < N; i++) {
        s.frames[i].error_px = 1e-8;
    }
    page = page_of(&s, 700.0);
    assert_non_null(strstr(page, "The boresight is on the true target."));
    svg_chart none;
    assert_false(svg_find(page, "Distance from the boresight", false, true, &none));
    free(page);
    bst_report_sensor_free(&s);
}

/* A run shorter than its last frame, and units of time by its length. */
static void the_axis_of_time(void **state) {
    (void)state;
    bst_report_sensor s;
    make_sensor(&s, N, 10);
    char *page = page_of(&s, 1.0);
    svg_chart c = svg_need(page, "Detections per frame", false, false);
    bst_assert_close(svg_high_x(&c), s.frames[N - 1].mid_s, 1.0);
    assert_non_null(strstr(page, "time since the epoch, s<"));
    free(page);
    const struct {
        double span_s, unit_s;
        const char *name;
    } units[] = {{1199, 1, "s"}, {1200, 60, "min"}, {14400, 3600, "h"}, {432000, 86400, "d"}};
    for (int k = 0; k < 4; k++) {
        char label[60];
        page = page_of(&s, units[k].span_s);
        c = svg_need(page, "Detections per frame", false, false);
        bst_assert_close(svg_high_x(&c), units[k].span_s / units[k].unit_s,
                         1e-3 * units[k].span_s / units[k].unit_s);
        snprintf(label, sizeof label, "time since the epoch, %s<", units[k].name);
        assert_non_null(strstr(page, label));
        free(page);
    }
    bst_report_sensor_free(&s);
}

/* ---- pictures of frames: the file and the marks are these ---- */

enum { WIDE = 120, HIGH = 80, IN_FILE = 11, MARKS = 420 };
static uint16_t pixels[WIDE * HIGH];
static bst_io_overlay_mark marks[MARKS];
static int64_t frames_read[16];
static int read_count;

bst_status bst_fits_reader_open(bst_ctx *ctx, const char *path, bst_fits_reader **out) {
    (void)ctx;
    *out = strstr(path, "frames.fits") ? (bst_fits_reader *)pixels : NULL;
    return *out ? BST_OK : BST_ERR_NOT_FOUND;
}

void bst_fits_reader_close(bst_fits_reader *reader) {
    (void)reader;
}

const bst_fits_file_info *bst_fits_reader_info(const bst_fits_reader *reader) {
    static const bst_fits_file_info info = {.frames = IN_FILE, .width = WIDE, .height = HIGH};
    (void)reader;
    return &info;
}

bst_status bst_fits_reader_id(bst_ctx *ctx, bst_fits_reader *reader, int64_t index, int64_t *id) {
    (void)ctx;
    (void)reader;
    *id = 100 + index;
    return BST_OK;
}

bst_status bst_fits_reader_frame(bst_ctx *ctx, bst_fits_reader *reader, int64_t index,
                                 bst_fits_read_frame *out) {
    (void)ctx;
    (void)reader;
    frames_read[read_count++] = index;
    *out = (bst_fits_read_frame){pixels, WIDE, HIGH, 100 + index};
    return BST_OK;
}

bst_status bst_frame_marks_create(bst_ctx *ctx, const bst_run_reader *run, int64_t sensor,
                                  const char *target, bst_frame_marks **out) {
    (void)ctx;
    (void)run;
    assert_int_equal(sensor, 1);
    assert_string_equal(target, "PREY");
    *out = (bst_frame_marks *)marks;
    return BST_OK;
}

void bst_frame_marks_free(bst_frame_marks *m) {
    (void)m;
}

bst_status bst_frame_marks_exposure(bst_ctx *ctx, bst_frame_marks *m, int64_t index, int64_t *id) {
    (void)m;
    (void)index;
    (void)id;
    return bst_fail(ctx, BST_ERR_STATE, "every frame has its number");
}

bst_status bst_frame_marks_get(bst_ctx *ctx, bst_frame_marks *m, int64_t id, bst_io_overlay *out) {
    (void)ctx;
    (void)m;
    *out = (bst_io_overlay){
        .marks = marks, .count = id == 104 ? MARKS : 4, .caption = id == 104 ? "many" : "few"};
    return BST_OK;
}

static void expect_mark(const char *page, const char *format, ...) BST_PRINTF(2, 3);
static void expect_mark(const char *page, const char *format, ...) {
    char text[200];
    va_list numbers_of;
    va_start(numbers_of, format);
    vsnprintf(text, sizeof text, format, numbers_of);
    va_end(numbers_of);
    if (!strstr(page, text)) {
        fail_msg("no %s", text);
    }
}

/* Frames of 120 x 80 px drawn 352 wide, beside 48 x 48 px about the target drawn 180 wide: places
 * of marks in both, which frames are chosen, and what is said of them. */
static void pictures_of_frames(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    run_tables t;
    run_tables_begin(&t, "run.sqlite");
    run_tables_file(&t, "manifest.json", "{}");
    run_tables_file(&t, "scenario.json", "{}");
    bst_run_reader *run = run_tables_open(&t);
    marks[0] = (bst_io_overlay_mark){
        .kind = BST_OVERLAY_TARGET, .x_px = 100.25, .y_px = 30.5, .label = "PREY"};
    marks[1] = (bst_io_overlay_mark){.kind = BST_OVERLAY_TRACK, .x_px = 90.0, .y_px = 20.25};
    marks[2] = (bst_io_overlay_mark){.kind = BST_OVERLAY_BORESIGHT, .x_px = 59.5, .y_px = 39.5};
    for (int i = 3; i < MARKS; i++) {
        marks[i] = (bst_io_overlay_mark){
            .kind = BST_OVERLAY_DETECTION, .x_px = 12.0, .y_px = 50.0, .radius_px = 3.0};
    }
    bst_report_frame facts[2] = {{.exposure_id = 102, .in_track = false},
                                 {.exposure_id = 103,
                                  .in_track = true,
                                  .known = true,
                                  .error_px = 2.345,
                                  .snr = 9.81,
                                  .track_snr = 8.74,
                                  .detections = 1.0,
                                  .stars = 4.0}};
    bst_report_sensor s = {.frames = facts, .count = 2, .has_tracks = true};
    s.sensor.index = 1;
    snprintf(s.sensor.file, sizeof s.sensor.file, "frames.fits");
    snprintf(s.sensor.target, sizeof s.sensor.target, "PREY");
    char *page;
    size_t bytes;
    FILE *out = open_memstream(&page, &bytes);
    bst_assert_ok(&ctx, bst_report_frames(&ctx, out, run, &s));
    fclose(out);
    /* evenly spaced, with the first one in track as the second */
    const int64_t chosen[] = {0, 3, 4, 6, 8, 10};
    assert_int_equal(read_count, 6);
    assert_memory_equal(frames_read, chosen, sizeof chosen);
    /* pixels count from their middles: (100.25 + 0.5) 352 / 120 = 295.5, 90.9; half side 7 */
    const double a = 352.0 / 120.0, b = 180.0 / 48.0;
    expect_mark(page, "viewBox=\"0 0 540 264\"");
    expect_mark(page, "M%.1f %.1fh14.0v14.0h-14.0z", 100.75 * a - 7.0, 31.0 * a - 7.0);
    expect_mark(page, "M%.1f %.1fl11.0 11.0l-11.0 11.0l-11.0 -11.0z", 90.5 * a, 20.75 * a - 11.0);
    expect_mark(page, "M%.1f %.1fH%.1f", 60.0 * a - 11.0, 40.0 * a, 60.0 * a - 4.0);
    expect_mark(page, "M%.1f %.1fV%.1f", 60.0 * a, 40.0 * a + 4.0, 40.0 * a + 11.0);
    expect_mark(page, "<circle cx=\"%.1f\" cy=\"%.1f\" r=\"%.1f\"", 12.5 * a, 50.5 * a, 3.0 * a);
    expect_mark(page, "x=\"%.1f\" y=\"%.1f\" text-anchor=\"end\"", 100.75 * a - 14.0,
                31.0 * a + 11.0);
    /* as near to the target as the right edge allows: columns from 72, rows from 31 - 24 */
    expect_mark(page, "<rect x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\"", 72.0 * a,
                7.0 * a, 48.0 * a, 48.0 * a);
    expect_mark(page, "M%.1f %.1fh30.8", (100.75 - 72.0) * b - 15.4, (31.0 - 7.0) * b - 15.4);
    expect_mark(page, "<image x=\"360.0\" y=\"0.0\" width=\"180.0\" height=\"180.0\"");
    expect_mark(page, "<image x=\"0.0\" y=\"0.0\" width=\"352.0\" height=\"%.1f\"", 80.0 * a);
    expect_mark(page, "many   400 of 417 detections drawn");
    const char *const said[] = {"2.35 px from the boresight", "SNR 9.8, measured 8.7",
                                "1 detection, 4 stars identified", "in track"};
    for (int i = 0; i < 4; i++) {
        expect_mark(page, "<text x=\"360.0\" y=\"%.1f\">%s", 201.0 + 19.0 * i, said[i]);
    }
    free(page);
    run_tables_end(&t);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(pictures_of_frames),
        cmocka_unit_test(charts_over_time),
        cmocka_unit_test(a_transient_does_not_flatten_the_axes),
        cmocka_unit_test(nees_and_its_interval),
        cmocka_unit_test(histograms),
        cmocka_unit_test(no_frames),
        cmocka_unit_test(the_axis_of_time),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
