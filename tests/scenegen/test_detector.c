/* Each effect of the detector against its closed form or exact statistics. */
#include <unistd.h>

#include "scenegen/detector/detector.h"
#include "scenegen/detector/fixed_pattern_noise.h"
#include "tests/scenegen/scene_support.h"
#include "tests/test_support.h"

enum { SIDE = 256, PIXELS = SIDE * SIDE };

typedef struct fixture {
    bst_ctx ctx;
    bst_device *device;
    bst_camera camera;
    bst_renderer *renderer;
    bst_render_request request;
    bst_los_track track;
    double time_s[2];
    bst_quat q[2];
} fixture;

static fixture *open_with(void **state, double background_e, double dark_e) {
    fixture *f = *state;
    f->camera = scene_camera(SIDE, SIDE);
    f->camera.detector.dark_doubling_k = 6.5;
    f->time_s[1] = 0.5;
    f->q[0] = f->q[1] = BST_QUAT_IDENTITY;
    f->track = (bst_los_track){2, f->time_s, f->q};
    f->request = (bst_render_request){.window = {0, 0, SIDE, SIDE},
                                      .track = &f->track,
                                      .background_e = background_e + dark_e,
                                      .dark_e = dark_e,
                                      .key = {{3, 4}}};
    return f;
}

static void make(fixture *f) {
    bst_renderer_free(f->renderer);
    bst_renderer_options options = bst_renderer_default_options();
    options.pattern = (bst_rng_key){{21, 22}};
    /* compiled once, not for each effect; test_cosmic_rays.c compares with the camera's own */
    options.shared_program = true;
    bst_assert_ok(&f->ctx,
                  bst_renderer_create(&f->ctx, f->device, &f->camera, &options, &f->renderer));
}

/* Frame `id` in electrons from the offset on; returns its pixels' number. */
static int expose(fixture *f, int64_t id, float *electrons) {
    bst_frame *frame;
    const uint16_t *pixels;
    f->request.exposure_id = id;
    bst_assert_ok(&f->ctx, bst_renderer_render(&f->ctx, f->renderer, &f->request, &frame));
    bst_assert_ok(&f->ctx, bst_frame_map(frame, &f->ctx, &pixels));
    int count = frame->width * frame->height;
    for (int i = 0; i < count; i++) {
        electrons[i] = (float)((pixels[i] - f->camera.offset_dn) * f->camera.gain_e_per_dn);
    }
    bst_frame_unmap(frame);
    bst_frame_release(frame);
    return count;
}

/* Per-pixel mean of n frames. */
static void mean_of(fixture *f, int n, double *mean) {
    static float frame[PIXELS];
    memset(mean, 0, PIXELS * sizeof *mean);
    for (int k = 0; k < n; k++) {
        int count = expose(f, k, frame);
        for (int i = 0; i < count; i++) {
            mean[i] += (double)frame[i] / n;
        }
    }
}

typedef struct moments {
    double mean, var, kurtosis; /* kurtosis: excess */
} moments;

static moments moments_of(const double *x, int n) {
    moments m = {0};
    double fourth = 0.0;
    for (int i = 0; i < n; i++) {
        m.mean += x[i] / n;
    }
    for (int i = 0; i < n; i++) {
        double d = x[i] - m.mean;
        m.var += d * d / n;
        fourth += d * d * d * d / n;
    }
    m.kurtosis = fourth / (m.var * m.var) - 3.0;
    return m;
}

static moments moments_of_frame(fixture *f, int64_t id) {
    static float frame[PIXELS];
    static double values[PIXELS];
    int n = expose(f, id, frame);
    for (int i = 0; i < n; i++) {
        values[i] = (double)frame[i];
    }
    return moments_of(values, n);
}

/* The mean of many flats is the map; the map has its RMS, dead pixels and columns. */
static void response_differs_from_pixel_to_pixel(void **state) {
    static float gain[PIXELS];
    static double mean[PIXELS];
    enum { FRAMES = 32 };
    fixture *f = open_with(state, 20000.0, 0.0);
    f->camera.detector.prnu_rms = 0.02;
    f->camera.detector.dead_fraction = 0.01;
    f->camera.detector.bad_columns = 3;
    make(f);
    bst_assert_ok(&f->ctx, bst_fixed_pattern_noise_gain(&f->ctx, &f->camera,
                                                        (bst_rng_key){{21, 22}}, NULL, SIDE, gain));
    mean_of(f, FRAMES, mean);
    double chi2 = 0.0, sum = 0.0, sum2 = 0.0;
    int dead = 0, columns = 0;
    for (int i = 0; i < PIXELS; i++) {
        double want = 20000.0 * (double)gain[i];
        double var = (want + 64.0 + 1.0 / 12.0) / FRAMES;
        chi2 += (mean[i] - want) * (mean[i] - want) / var;
        if (gain[i] > 0.0f) {
            sum += (double)gain[i] - 1.0;
            sum2 += ((double)gain[i] - 1.0) * ((double)gain[i] - 1.0);
        } else {
            dead++;
        }
    }
    for (int x = 0; x < SIDE; x++) {
        columns += gain[(SIDE - 1) * SIDE + x] == 0.0f && gain[(SIDE - 2) * SIDE + x] == 0.0f;
    }
    /* chi-square of n degrees: standard deviation sqrt(2n); four of them */
    bst_assert_close(chi2 / PIXELS, 1.0, 4.0 * sqrt(2.0 / PIXELS));
    bst_assert_close(sum / PIXELS, 0.0, 4.0 * 0.02 / sqrt(PIXELS));
    /* RMS of n draws: relative standard deviation 1 / sqrt(2n) */
    bst_assert_close(sqrt(sum2 / (PIXELS - dead)), 0.02, 4.0 * 0.02 / sqrt(2.0 * PIXELS));
    assert_in_range(columns, 2, 4); /* two may fall on one, a chance of two dead pixels adds one */
    assert_in_range(dead, 500, 500 + 3 * SIDE + 300);
}

static void dark_current_differs_from_pixel_to_pixel(void **state) {
    static float dark[PIXELS];
    static double logs[PIXELS];
    fixture *f = open_with(state, 0.0, 20.0);
    f->camera.dark_current_e_per_s = 40.0;
    f->camera.detector.dsnu_rms = 0.3;
    bst_rng_key key = {{21, 22}};
    bst_assert_ok(&f->ctx,
                  bst_fixed_pattern_noise_dark(&f->ctx, &f->camera, key, NULL, SIDE, dark));
    double sum = 0.0, sum2 = 0.0;
    for (int i = 0; i < PIXELS; i++) {
        sum += (double)dark[i] / 40.0 / PIXELS;
        sum2 += pow((double)dark[i] / 40.0 - 1.0, 2.0) / PIXELS;
    }
    bst_assert_close(sum, 1.0, 4.0 * 0.3 / sqrt(PIXELS));
    bst_assert_close(sqrt(sum2), 0.3, 0.3 * 4.0 * sqrt(1.5 / PIXELS)); /* kurtosis of 1.6 */

    /* hot pixels: share, and a log-normal law of their rates */
    f->camera.dark_current_e_per_s = 0.0;
    f->camera.detector = (bst_detector_config){
        .hot_fraction = 0.05, .hot_median_e_per_s = 200.0, .hot_spread_dex = 0.4};
    bst_assert_ok(&f->ctx,
                  bst_fixed_pattern_noise_dark(&f->ctx, &f->camera, key, NULL, SIDE, dark));
    int hot = 0;
    for (int i = 0; i < PIXELS; i++) {
        if (dark[i] > 0.0f) {
            logs[hot++] = log10((double)dark[i]);
        }
    }
    bst_assert_close(hot, 0.05 * PIXELS, 4.0 * sqrt(0.05 * PIXELS));
    moments m = moments_of(logs, hot);
    bst_assert_close(m.mean, log10(200.0), 4.0 * 0.4 / sqrt(hot));
    bst_assert_close(sqrt(m.var), 0.4, 4.0 * 0.4 / sqrt(2.0 * hot));

    /* the frame's mean follows the map and the exposure time; the uniform dark current is the map's
     */
    make(f);
    static double mean[PIXELS];
    enum { FRAMES = 16 };
    mean_of(f, FRAMES, mean);
    double chi2 = 0.0;
    for (int i = 0; i < PIXELS; i++) {
        double want = 0.5 * (double)dark[i];
        chi2 += (mean[i] - want) * (mean[i] - want) * FRAMES / (want + 64.0 + 1.0 / 12.0);
    }
    bst_assert_close(chi2 / PIXELS, 1.0, 4.0 * sqrt(2.0 / PIXELS));
}

/* A FITS image of 32-bit floats, written by hand (FITS 4.0, section 3.3). */
static void write_map(const char *path, int width, int height, float (*value)(int x, int y)) {
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    char header[2881];
    memset(header, ' ', sizeof header);
    const char *names[] = {"SIMPLE", "BITPIX", "NAXIS", "NAXIS1", "NAXIS2"};
    int values[] = {1, -32, 2, width, height};
    for (int i = 0; i < 5; i++) {
        char card[81];
        int n = i == 0 ? snprintf(card, sizeof card, "%-8s= %20s", names[i], "T")
                       : snprintf(card, sizeof card, "%-8s= %20d", names[i], values[i]);
        memcpy(header + 80 * i, card, (size_t)n);
    }
    memcpy(header + 400, "END", 3);
    fwrite(header, 1, 2880, file);
    size_t bytes = 0;
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++) {
            float v = value(x, y);
            uint32_t u;
            memcpy(&u, &v, sizeof u);
            unsigned char b[4] = {(unsigned char)(u >> 24), (unsigned char)(u >> 16),
                                  (unsigned char)(u >> 8), (unsigned char)u};
            bytes += fwrite(b, 1, 4, file);
        }
    }
    for (; bytes % 2880 != 0; bytes++) {
        fputc(0, file);
    }
    fclose(file);
}

static float ramp(int x, int y) {
    return 0.5f + (float)x / SIDE + 0.001f * (float)y;
}

static float negative(int x, int y) {
    return x == 3 && y == 5 ? -1.0f : 1.0f;
}

static void maps_come_from_files(void **state) {
    static float map[PIXELS];
    fixture *f = open_with(state, 0.0, 0.0);
    bst_rng_key key = {{0, 0}};
    char *path = f->camera.detector.prnu_map;
    snprintf(path, 512, "/tmp/bst_detector_map_%d.fits", (int)getpid());
    write_map(path, SIDE, SIDE, ramp);
    bst_assert_ok(&f->ctx, bst_fixed_pattern_noise_gain(&f->ctx, &f->camera, key, NULL, SIDE, map));
    for (int i = 0; i < PIXELS; i += 997) {
        assert_true(map[i] == ramp(i % SIDE, i / SIDE)); /* as written, to the bit */
    }
    snprintf(f->camera.detector.dark_map, 512, "%s", path);
    f->camera.detector.temperature_c = 6.5; /* one doubling */
    bst_assert_ok(&f->ctx, bst_fixed_pattern_noise_dark(&f->ctx, &f->camera, key, NULL, SIDE, map));
    assert_true(map[1000] == 2.0f * ramp(1000 % SIDE, 1000 / SIDE));

    write_map(path, SIDE, SIDE, negative);
    assert_int_equal(bst_fixed_pattern_noise_gain(&f->ctx, &f->camera, key, NULL, SIDE, map),
                     BST_ERR_CONFIG);
    assert_non_null(strstr(f->ctx.message, "column 3, row 5"));
    write_map(path, SIDE, SIDE / 2, ramp);
    assert_int_equal(bst_fixed_pattern_noise_gain(&f->ctx, &f->camera, key, NULL, SIDE, map),
                     BST_ERR_CONFIG);
    assert_non_null(strstr(f->ctx.message, "256 x 128"));
    remove(path);
}

static void offsets_of_columns_and_rows(void **state) {
    static double mean[PIXELS];
    static float frame[PIXELS];
    enum { FRAMES = 16 };
    fixture *f = open_with(state, 100.0, 0.0);
    f->camera.detector.column_offset_rms_e = 6.0;
    f->camera.detector.row_offset_rms_e = 4.0;
    make(f);
    mean_of(f, FRAMES, mean);
    float columns[SIDE], rows[SIDE];
    bst_rng_key key = {{21, 22}};
    bst_fixed_pattern_noise_offsets(&f->camera, key, "columns", SIDE, columns);
    bst_fixed_pattern_noise_offsets(&f->camera, key, "rows", SIDE, rows);
    double chi2 = 0.0, c2 = 0.0, r2 = 0.0;
    for (int i = 0; i < PIXELS; i++) {
        double want = 100.0 + (double)columns[i % SIDE] + (double)rows[i / SIDE];
        chi2 += (mean[i] - want) * (mean[i] - want) * FRAMES / (164.0 + 1.0 / 12.0);
    }
    for (int i = 0; i < SIDE; i++) {
        c2 += (double)columns[i] * (double)columns[i] / SIDE;
        r2 += (double)rows[i] * (double)rows[i] / SIDE;
    }
    bst_assert_close(chi2 / PIXELS, 1.0, 4.0 * sqrt(2.0 / PIXELS));
    bst_assert_close(sqrt(c2), 6.0, 4.0 * 6.0 / sqrt(2.0 * SIDE));
    bst_assert_close(sqrt(r2), 4.0, 4.0 * 4.0 / sqrt(2.0 * SIDE));

    /* row noise: each row's mean moves by it from frame to frame, on top of the pixels' noise */
    f->camera.detector = (bst_detector_config){.row_noise_e = 5.0};
    make(f);
    double sum2 = 0.0;
    for (int k = 0; k < FRAMES; k++) {
        expose(f, k, frame);
        for (int y = 0; y < SIDE; y++) {
            double row = 0.0;
            for (int x = 0; x < SIDE; x++) {
                row += ((double)frame[y * SIDE + x] - 100.0) / SIDE;
            }
            sum2 += row * row / (SIDE * FRAMES);
        }
    }
    bst_assert_close(sum2, 25.0 + 164.0 / SIDE, 4.0 * 26.0 * sqrt(2.0 / (SIDE * FRAMES)));
}

/* A share p of reads has the variance r^2 + t^2: variance r^2 + p t^2, excess kurtosis
 * 3 p (1 - p) t^4 / variance^2. */
static void read_noise_has_a_tail(void **state) {
    static double values[8 * PIXELS];
    static float frame[PIXELS];
    fixture *f = open_with(state, 0.0, 0.0);
    f->camera.offset_dn = 1000.0;
    f->camera.detector.telegraph_noise_fraction = 0.02;
    f->camera.detector.telegraph_noise_rms_e = 30.0;
    make(f);
    for (int k = 0; k < 8; k++) {
        expose(f, k, frame);
        for (int i = 0; i < PIXELS; i++) {
            values[k * PIXELS + i] = (double)frame[i];
        }
    }
    moments m = moments_of(values, 8 * PIXELS);
    double var = 64.0 + 0.02 * 900.0 + 1.0 / 12.0;
    double kurtosis = 3.0 * 0.02 * 0.98 * 30.0 * 30.0 * 30.0 * 30.0 / (var * var);
    bst_assert_close(m.mean, 0.0, 4.0 * sqrt(var / (8 * PIXELS)));
    bst_assert_close(m.var, var, 4.0 * var * sqrt((kurtosis + 2.0) / (8 * PIXELS)));
    /* the eighth moment of the mixture gives the kurtosis a standard deviation of about 0.09 */
    bst_assert_close(m.kurtosis, kurtosis, 0.4);
}

/* Chi-square that `degrees` of freedom exceed once in 10,000 times (Wilson and Hilferty 1931). */
static double rare_chi2(double degrees) {
    double v = 2.0 / (9.0 * degrees);
    return degrees * pow(1.0 - v + 3.72 * sqrt(v), 3.0);
}

/* Reads whose error only the tail can give: as many as there should be, in no place more than in
 * another, and none because of its neighbour. */
static void reads_of_the_tail_are_independent(void **state) {
    static float frame[PIXELS];
    static bool struck[PIXELS];
    const double shares[2] = {0.02, 0.6};
    for (int s = 0; s < 2; s++) {
        fixture *f = open_with(state, 0.0, 0.0);
        f->camera.offset_dn = 30000.0;
        f->camera.detector.telegraph_noise_fraction = shares[s];
        f->camera.detector.telegraph_noise_rms_e = 3000.0;
        make(f);
        /* beyond 60 e: 7.5 standard deviations of the other reads */
        double p = shares[s] * erfc(60.0 / sqrt(2.0 * (3000.0 * 3000.0 + 64.0)));
        double total = 0.0, right = 0.0, above = 0.0, rows[16] = {0}, columns[64] = {0};
        enum { FRAMES = 8 };
        for (int k = 0; k < FRAMES; k++) {
            expose(f, k, frame);
            for (int i = 0; i < PIXELS; i++) {
                struck[i] = fabsf(frame[i]) > 60.0f;
            }
            for (int i = 0; i < PIXELS; i++) {
                total += struck[i];
                rows[i / SIDE % 16] += struck[i];
                columns[i % 64] += struck[i];
                right += i % SIDE > 0 && struck[i] && struck[i - 1];
                above += i >= SIDE && struck[i] && struck[i - SIDE];
            }
        }
        double n = (double)FRAMES * PIXELS, pairs = n * (SIDE - 1.0) / SIDE;
        bst_assert_close(total, n * p, 4.0 * sqrt(n * p * (1.0 - p)));
        /* variance of the number of pairs in a chain of independent reads */
        double var = pairs * (p * p - pow(p, 4.0) + 2.0 * (p * p * p - pow(p, 4.0)));
        bst_assert_close(right, pairs * p * p, 4.0 * sqrt(var));
        bst_assert_close(above, pairs * p * p, 4.0 * sqrt(var));
        double by_row = 0.0, by_column = 0.0;
        for (int i = 0; i < 16; i++) {
            by_row += pow(rows[i] - n * p / 16.0, 2.0) / (n * p * (1.0 - p) / 16.0);
        }
        for (int i = 0; i < 64; i++) {
            by_column += pow(columns[i] - n * p / 64.0, 2.0) / (n * p * (1.0 - p) / 64.0);
        }
        assert_true(by_row < rare_chi2(16.0));
        assert_true(by_column < rare_chi2(64.0));
    }
}

static void response_bends(void **state) {
    const double c[3] = {-0.05, 0.02, -0.01};
    /* little and much read noise for the full well: added before the amplifier bends, and after */
    const double read_noises[2] = {5.0, 8.0}, full_wells_e[2] = {4e5, 65000.0};
    for (int k = 0; k < 2; k++) {
        fixture *f = open_with(state, 0.5 * full_wells_e[k], 0.0);
        f->camera.read_noise_e = read_noises[k];
        f->camera.full_well_e = full_wells_e[k];
        f->camera.gain_e_per_dn = full_wells_e[k] / 50000.0;
        memcpy(f->camera.detector.nonlinearity, c, sizeof c);
        make(f);
        moments m = moments_of_frame(f, 1);
        double u = 0.5, n = u * full_wells_e[k], step = f->camera.gain_e_per_dn;
        double bend = 1.0 + c[0] * u + c[1] * u * u + c[2] * u * u * u;
        double slope = 1.0 + 2.0 * c[0] * u + 3.0 * c[1] * u * u + 4.0 * c[2] * u * u * u;
        /* curvature / 2 times the variance, below a thousandth of an electron's share: 0.05 e- */
        double var = slope * slope * n + read_noises[k] * read_noises[k] + step * step / 12.0;
        bst_assert_close(m.mean, n * bend, 4.0 * sqrt(var / PIXELS) + 0.05);
        bst_assert_close(m.var, var, 4.0 * var * sqrt(2.0 / PIXELS));
    }
}

/* A star that fills wells: with blooming the charge is kept and runs along its columns. */
static void full_wells_bloom(void **state) {
    static float clipped[PIXELS], bloomed[PIXELS];
    fixture *f = open_with(state, 0.0, 0.0);
    f->camera.full_well_e = 1000.0;
    f->camera.read_noise_e = 5.0; /* less would be compiled for this test alone */
    bst_scene_source star = scene_star(&f->camera, 100.0, 120.0, 2.0 * 60000.0);
    f->request.sources = &star;
    f->request.count = 1;
    make(f);
    expose(f, 0, clipped);
    f->camera.detector.saturation = BST_WELL_BLOOM;
    make(f);
    expose(f, 0, bloomed);
    double total = 0.0, cut = 0.0, above = 0.0, below = 0.0, highest = 0.0;
    enum { LEFT = 84, RIGHT = 116, COLUMNS = RIGHT - LEFT + 1 }; /* all of the star's light */
    for (int i = 0; i < PIXELS; i++) {
        if (i % SIDE < LEFT || i % SIDE > RIGHT) {
            continue;
        }
        total += (double)bloomed[i];
        cut += (double)clipped[i];
        highest = fmax(highest, (double)bloomed[i]);
        above += i / SIDE > 120 ? (double)bloomed[i] : 0.0;
        below += i / SIDE < 120 ? (double)bloomed[i] : 0.0;
    }
    /* 60000 e- with shot noise, and read noise of the columns' pixels */
    double noise = sqrt(60000.0 + COLUMNS * SIDE * (25.0 + 1.0 / 12.0));
    bst_assert_close(total, 60000.0, 4.0 * noise);
    assert_true(cut < 30000.0);
    bst_assert_close(highest, 1000.0, 30.0); /* full wells differ by read noise only: 6 sigma */
    bst_assert_close(above, below, 8.0 * noise);
    /* neighbours outside the star's columns stay dark */
    double beside = 0.0;
    for (int y = 0; y < SIDE; y++) {
        beside += (double)bloomed[y * SIDE + 130] / SIDE;
    }
    bst_assert_close(beside, 0.0, 4.0 * 5.01 / sqrt(SIDE));
    long long saturated;
    bst_assert_ok(&f->ctx, bst_renderer_saturated(&f->ctx, f->renderer, &saturated));
    assert_in_range(saturated, 45, 60); /* 60000 / 1000, less the columns' ends */

    /* charge that reaches the end of its column is lost */
    star = scene_star(&f->camera, 100.0, 120.0, 2.0 * 10.0 * SIDE * 1000.0);
    expose(f, 0, bloomed);
    for (int y = 0; y < SIDE; y++) {
        bst_assert_close((double)bloomed[y * SIDE + 100], 1000.0, 30.0);
    }
}

/* All pixels of a column collect its light for the time of one row. */
static void frame_transfer_smears(void **state) {
    static double mean[PIXELS];
    enum { FRAMES = 16 };
    fixture *f = open_with(state, 10.0, 0.0);
    bst_scene_source star = scene_star(&f->camera, 100.0, 120.0, 2.0 * 1e6);
    f->camera.full_well_e = 1e7;
    f->camera.bits = 16;
    f->camera.gain_e_per_dn = 20.0;
    f->camera.detector.frame_transfer_s = 0.01;
    f->request.sources = &star;
    f->request.count = 1;
    make(f);
    mean_of(f, FRAMES, mean);
    double share = 0.01 / SIDE / 0.5, bright = 0.0, dark = 0.0;
    for (int y = 0; y < SIDE; y++) {
        if (abs(y - 120) > 12) {
            for (int x = 90; x <= 110; x++) {
                bright += mean[y * SIDE + x];
            }
            dark += mean[y * SIDE + 30];
        }
    }
    int rows = SIDE - 25;
    double sky = 10.0 * (1.0 + share * (SIDE - 1));
    double want = rows * (1e6 * share + 21.0 * sky);
    double var = (want + rows * 21.0 * (64.0 + 400.0 / 12.0)) / FRAMES;
    bst_assert_close(bright, want, 4.0 * sqrt(var));
    bst_assert_close(dark, rows * sky, 4.0 * sqrt(rows * (sky + 64.0 + 400.0 / 12.0) / FRAMES));
}

static void binning_adds_before_reading(void **state) {
    for (int b = 2; b <= 4; b *= 2) {
        fixture *f = open_with(state, 50.0, 0.0);
        f->request.binning = b;
        make(f);
        double n = PIXELS / (b * b), mean = 50.0 * b * b, var = mean + 64.0 + 1.0 / 12.0;
        moments m = moments_of_frame(f, 7);
        bst_assert_close(m.mean, mean, 4.0 * sqrt(var / n));
        bst_assert_close(m.var, var, 4.0 * var * sqrt(2.0 / n));
        /* a star keeps its place and light */
        static float frame[PIXELS];
        bst_scene_source star = scene_star(&f->camera, 101.0, 57.0, 2.0 * 3e4);
        f->request.sources = &star;
        f->request.count = 1;
        f->request.window = (bst_window){64, 32, 2 * SIDE / 4, SIDE / 4};
        int count = expose(f, 8, frame), width = SIDE / 2 / b;
        assert_int_equal(count, width * (SIDE / 4 / b));
        double sum = 0.0, x = 0.0, y = 0.0;
        for (int i = 0; i < count; i++) {
            double e = (double)frame[i] - mean;
            sum += e;
            x += e * (i % width);
            y += e * (i / width);
        }
        double noise = sqrt(3e4 + count * var);
        bst_assert_close(sum, 3e4, 4.0 * noise);
        /* centre of the binned pixels, from the window's corner; moments of the noise over 64 / b
         * px */
        double tolerance = 4.0 * sqrt(count * var) * width / 3e4;
        bst_assert_close(x / sum, (101.0 - 64.0 - 0.5 * (b - 1)) / b, tolerance);
        bst_assert_close(y / sum, (57.0 - 32.0 - 0.5 * (b - 1)) / b, tolerance);
    }
}

/* Codes of the square root: the step is that of the root; a table from a file. */
static void numbers_are_companded(void **state) {
    static uint16_t codes[65536];
    fixture *f = open_with(state, 0.0, 0.0);
    f->camera.bits = 12;
    bst_detector_quantisation_config *q = &f->camera.detector.quantisation;
    *q = (bst_detector_quantisation_config){.model = BST_QUANTISE_SQUARE_ROOT, .bits = 8};
    bst_assert_ok(&f->ctx, bst_fixed_pattern_noise_codes(&f->ctx, &f->camera, codes));
    assert_int_equal(codes[0], 0);
    assert_int_equal(codes[4095], 255);
    assert_int_equal(codes[1024], 128); /* 255 sqrt(1024 / 4095) = 127.52 */
    q->expand = true;
    bst_assert_ok(&f->ctx, bst_fixed_pattern_noise_codes(&f->ctx, &f->camera, codes));
    for (int dn = 0; dn < 4096; dn++) { /* half a step: 255 / sqrt(4095) codes per root of dn */
        bst_assert_close(codes[dn], dn, sqrt(dn) * sqrt(4095.0) / 255.0 + 1.0);
    }
    *q = (bst_detector_quantisation_config){.model = BST_QUANTISE_TABLE};
    snprintf(q->table, sizeof q->table, "/tmp/bst_detector_codes_%d.txt", (int)getpid());
    FILE *file = fopen(q->table, "w");
    fputs("# three codes\n0\n100\n\n2000\n", file);
    fclose(file);
    bst_assert_ok(&f->ctx, bst_fixed_pattern_noise_codes(&f->ctx, &f->camera, codes));
    assert_int_equal(codes[99], 0);
    assert_int_equal(codes[100], 1);
    assert_int_equal(codes[1999], 1);
    assert_int_equal(codes[4095], 2);
    /* and in the frame */
    f->camera.offset_dn = 1500.0;
    make(f);
    bst_frame *frame;
    const uint16_t *pixels;
    bst_assert_ok(&f->ctx, bst_renderer_render(&f->ctx, f->renderer, &f->request, &frame));
    bst_assert_ok(&f->ctx, bst_frame_map(frame, &f->ctx, &pixels));
    for (int i = 0; i < PIXELS; i++) {
        assert_int_equal(pixels[i], 1);
    }
    bst_frame_unmap(frame);
    bst_frame_release(frame);
    const char *wrong[] = {"0\n5\n5\n", "1\n", "0\nx\n", "0\n9999\n", "# nothing\n"};
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        file = fopen(q->table, "w");
        fputs(wrong[i], file);
        fclose(file);
        assert_int_equal(bst_fixed_pattern_noise_codes(&f->ctx, &f->camera, codes), BST_ERR_CONFIG);
        assert_non_null(strstr(f->ctx.message, "quantisation.table"));
    }
    remove(q->table);
}

static int open_device(void **state) {
    fixture *f = calloc(1, sizeof *f);
    *state = f;
    return f && bst_device_open(&f->ctx, "", 0, &f->device) == BST_OK ? 0 : -1;
}

static int close_device(void **state) {
    fixture *f = *state;
    bst_renderer_free(f->renderer);
    bst_device_close(f->device);
    free(f);
    return 0;
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(response_differs_from_pixel_to_pixel),
        cmocka_unit_test(dark_current_differs_from_pixel_to_pixel),
        cmocka_unit_test(maps_come_from_files),
        cmocka_unit_test(offsets_of_columns_and_rows),
        cmocka_unit_test(read_noise_has_a_tail),
        cmocka_unit_test(reads_of_the_tail_are_independent),
        cmocka_unit_test(response_bends),
        cmocka_unit_test(full_wells_bloom),
        cmocka_unit_test(frame_transfer_smears),
        cmocka_unit_test(binning_adds_before_reading),
        cmocka_unit_test(numbers_are_companded),
    };
    return cmocka_run_group_tests(tests, open_device, close_device);
}
