/* The parts of the search for streaks, each against sums written out: the filtered map, the lines
 * of the bank, the threshold's law, and what the two searches keep. */
#include <stdlib.h>

#include "boresight/vec.h"
#include "imgproc/streak/streak_search.h"
#include "tests/test_support.h"

/* Wider than a tile of the bank, 512 x 256, and not square. */
enum { WIDTH = 560, HEIGHT = 300, PIXELS = WIDTH * HEIGHT };

static const double SIGMA_PX = 0.9, MAX_PX = 64.0, NOISE_E = 3.0;

typedef struct fixture {
    bst_ctx ctx;
    bst_streak_search search;
    bst_background background;
    float *image;
} fixture;

static int setup(void **state) {
    fixture *f = calloc(1, sizeof *f);
    assert_non_null(f);
    f->image = calloc(PIXELS, sizeof *f->image);
    assert_non_null(f->image);
    bst_assert_ok(&f->ctx,
                  bst_streak_search_create(&f->ctx, NULL, WIDTH, HEIGHT, MAX_PX, &f->search));
    bst_assert_ok(&f->ctx, bst_background_create(&f->ctx, 64, WIDTH, HEIGHT, 1, &f->background));
    f->image[1] = 1.0f;
    bst_background_estimate(&f->background, f->image, WIDTH, HEIGHT, 0.1f);
    for (int k = 0; k < f->background.columns * f->background.rows; k++) {
        f->background.level[k] = 0.0f;
        f->background.noise[k] = (float)NOISE_E;
    }
    f->image[1] = 0.0f;
    *state = f;
    return 0;
}

static int teardown(void **state) {
    fixture *f = *state;
    bst_streak_search_free(&f->search);
    bst_background_free(&f->background);
    free(f->image);
    free(f);
    return 0;
}

/* Share of a Gaussian about 0 in the pixel i of one axis. */
static double share_of(double i, double sigma) {
    double root = sigma * sqrt(2.0);
    return 0.5 * (erf((i + 0.5) / root) - erf((i - 0.5) / root));
}

/* Adds a streak of the given width, of `snr` for the ideal filter of its own image; ends at x0, y0
 * and x1, y1. */
static void add_streak(fixture *f, const double end[4], double sigma, double snr) {
    enum { PARTS = 300 };
    double *light = calloc(PIXELS, sizeof *light), square = 0.0;
    assert_non_null(light);
    for (int n = 0; n < PARTS; n++) {
        double u = (n + 0.5) / PARTS, x = end[0] + u * (end[2] - end[0]),
               y = end[1] + u * (end[3] - end[1]);
        int reach = (int)ceil(5.0 * sigma), cx = (int)lround(x), cy = (int)lround(y);
        for (int j = cy - reach; j <= cy + reach; j++) {
            for (int i = cx - reach; i <= cx + reach; i++) {
                if (i >= 0 && j >= 0 && i < WIDTH && j < HEIGHT) {
                    light[j * WIDTH + i] += share_of(i - x, sigma) * share_of(j - y, sigma) / PARTS;
                }
            }
        }
    }
    for (int i = 0; i < PIXELS; i++) {
        square += light[i] * light[i];
    }
    for (int i = 0; i < PIXELS; i++) {
        f->image[i] += (float)(snr * NOISE_E / sqrt(square) * light[i]);
    }
    free(light);
}

static void clear(fixture *f) {
    memset(f->image, 0, PIXELS * sizeof *f->image);
}

static void fill(fixture *f) {
    bst_streak_search_fill(&f->search, f->image, WIDTH, HEIGHT, &f->background, SIGMA_PX);
}

/* Value of the map at (x, y), sigma. */
static double at(const fixture *f, int plane, int x, int y) {
    const bst_streak_map *map = &f->search.map;
    int column = plane ? y : x, row = plane ? x : y;
    return (double)bst_streak_map_plane(map, plane)[(long)row * map->stride[plane] + column] /
           BST_STREAK_QUANTA;
}

/* Each pixel: signal over noise, with the PSF's weights of unit norm, up to 5 sigma; pixels without
 * a measurement count as background, and so does what lies beyond the frame. */
static void the_map_is_filtered(void **state) {
    fixture *f = *state;
    clear(f);
    const double ends[4] = {100.0, 40.0, 130.0, 90.0};
    add_streak(f, ends, 2.0, 30.0);
    f->image[7 * WIDTH + 3] = 12.0f; /* near a corner */
    f->image[(HEIGHT - 1) * WIDTH + WIDTH - 2] = -9.0f;
    f->image[50 * WIDTH + 400] = 1000.0f;
    f->image[65 * WIDTH + 115] = BST_PIXEL_BAD;
    f->image[66 * WIDTH + 117] = BST_PIXEL_SATURATED;
    fill(f);
    const double places[][2] = {{2, 6},    {0, 7},    {3, 9},    {558, 299}, {559, 298},
                                {400, 50}, {401, 50}, {400, 52}, {115, 65},  {116, 65},
                                {118, 67}, {110, 55}, {102, 40}, {130, 93},  {2, 100},
                                {115, 63}, {115, 64}, {130, 128}};
    double norm = 0.0;
    for (int i = -3; i <= 3; i++) {
        norm += share_of(i, SIGMA_PX) * share_of(i, SIGMA_PX);
    }
    for (size_t n = 0; n < sizeof places / sizeof *places; n++) {
        int x = (int)places[n][0], y = (int)places[n][1];
        double sum = 0.0;
        for (int j = -3; j <= 3; j++) {
            for (int i = -3; i <= 3; i++) {
                if (x + i < 0 || y + j < 0 || x + i >= WIDTH || y + j >= HEIGHT) {
                    continue;
                }
                double v = (double)f->image[(y + j) * WIDTH + x + i];
                sum +=
                    v < -1e20 ? 0.0 : v / NOISE_E * share_of(i, SIGMA_PX) * share_of(j, SIGMA_PX);
            }
        }
        /* half of a sixteenth */
        bst_assert_close(at(f, 0, x, y), fmin(sum / norm, 5.0), 0.5 / BST_STREAK_QUANTA + 1e-4);
    }
    for (int i = 0; i < PIXELS; i++) {
        assert_true(at(f, 0, i % WIDTH, i / WIDTH) == at(f, 1, i % WIDTH, i / WIDTH));
    }
    /* correlation of unit noise at lags along an axis */
    for (int lag = 0; lag <= 6; lag++) {
        double sum = 0.0;
        for (int i = -3; i + lag <= 3; i++) {
            sum += share_of(i, SIGMA_PX) * share_of(i + lag, SIGMA_PX);
        }
        bst_assert_close(f->search.map.correlation[lag], sum / norm, 1e-9);
    }
    /* a strip about a segment, in both planes, and nothing else */
    bst_streak_map_blank(&f->search.map, 104.0, 46.0, 116.0, 66.0, 4.0);
    double before = at(f, 0, 122, 77), length = hypot(12.0, 20.0);
    assert_true(before > 1.0);
    for (int y = 35; y < 85; y++) {
        for (int x = 90; x < 135; x++) {
            double along = ((x - 104.0) * 12.0 + (y - 46.0) * 20.0) / length;
            double across = ((y - 46.0) * 12.0 - (x - 104.0) * 20.0) / length;
            double beyond = fmax(fmax(-along, along - length), 0.0);
            bool inside = hypot(beyond, across) <= 4.0;
            assert_true(!inside || at(f, 0, x, y) == 0.0);
            assert_true(at(f, 0, x, y) == at(f, 1, x, y));
        }
    }
    double kept = 0.0;
    for (int k = 0; k < 20; k++) { /* just beside it */
        kept += fabs(at(f, 0, 121 + k % 3, 70 + k % 7));
    }
    assert_true(kept > 10.0);
}

/* SNR of the straight line of a hit: the map between pixels, over the noise of the sum of pixels
 * that are nearest to it. */
static double snr_of(const fixture *f, const bst_streak_hit *h) {
    const bst_streak_map *map = &f->search.map;
    double u0 = (double)(h->plane ? h->y0 : h->x0), u1 = (double)(h->plane ? h->y1 : h->x1);
    double top = (double)(h->plane ? h->x0 : h->y0), sum = 0.0, variance = 0.0;
    double slope = (u1 - u0) / h->rows;
    int column[BST_STREAK_MAX_ROWS];
    for (int i = 0; i < h->rows; i++) {
        double u = u0 + slope * (i + 0.5), part = u - floor(u);
        int row = (int)lround(top + 0.5) + i, left = (int)floor(u);
        column[i] = (int)floor(u + 0.5);
        for (int side = 0; side < 2; side++) {
            int a = left + side, x = h->plane ? row : a, y = h->plane ? a : row;
            bool inside = x >= 0 && y >= 0 && x < WIDTH && y < HEIGHT;
            sum += inside ? (side ? part : 1.0 - part) * at(f, h->plane, x, y) : 0.0;
        }
    }
    for (int i = 0; i < h->rows; i++) {
        for (int k = 0; k < h->rows; k++) {
            int lag = abs(i - k), across = abs(column[i] - column[k]);
            if (lag < 64 && across < 64) {
                variance += map->correlation[lag] * map->correlation[across];
            }
        }
    }
    return sum / sqrt(variance);
}

/* Broad light, so that it does not matter which of two pixels a line takes: SNRs of all hits, of
 * every direction, length and tile, are those of their lines. */
static void hits_are_sums_along_their_lines(void **state) {
    fixture *f = *state;
    int octaves[4] = {0}, planes[2] = {0}, windows[9] = {0};
    double square = 0.0, mean = 0.0, all = 0.0;
    for (int k = 0; k < 12; k++) { /* by 15 deg; some across the tiles' borders at 512 and 256 */
        double angle = BST_PI * (k + 0.2) / 12.0, x = 45.0 + 94.0 * (k % 6);
        double y = k < 6 ? 70.0 : 245.0, c = 26.0 * cos(angle), s = 26.0 * sin(angle);
        const double ends[4] = {x - c, y - s, x + c, y + s};
        clear(f);
        add_streak(f, ends, 4.0, 55.0);
        fill(f);
        int count = bst_streak_bank_run(&f->search.bank, NULL, &f->search.map, 0, 9.0), large = 0;
        assert_true(count > 300 && count < bst_streak_bank_capacity(&f->search.bank));
        for (int n = 0; n < count; n++) {
            const bst_streak_hit *h = &f->search.bank.hits[n];
            double dx = fabs((double)(h->x1 - h->x0)), dy = fabs((double)(h->y1 - h->y0));
            /* longer along the axis of its plane; no longer than is asked for, to half a piece */
            assert_true(h->plane ? dx == h->rows && dy < dx : dy == h->rows && dx <= dy);
            int octave = h->rows < 8 ? 0 : h->rows < 16 ? 1 : h->rows < 32 ? 2 : 3;
            assert_int_equal(h->rows % (1 << octave), 0);
            assert_true(hypot(dx, dy) <= MAX_PX + 1.5 * (1 << octave));
            assert_true((double)h->snr > 9.0);
            double ratio = (double)h->snr / snr_of(f, h);
            square += (ratio - 1.0) * (ratio - 1.0);
            mean += ratio;
            all += 1.0;
            octaves[octave]++;
            planes[h->plane]++;
            windows[h->rows >> octave]++;
            large += h->rows >= 16;
        }
        /* from the third octave on: lines of 16 rows and more, the same ones */
        int fewer = bst_streak_bank_run(&f->search.bank, NULL, &f->search.map, 2, 9.0);
        assert_int_equal(fewer, large);
        for (int n = 0; n < fewer; n++) {
            assert_true(f->search.bank.hits[n].rows >= 16);
        }
    }
    /* values in sixteenths of a sigma on slopes of 1 sigma in 3 px; pixels next to a line change
     * the noise of its sum */
    assert_true(sqrt(square / all) < 0.02);
    bst_assert_close(mean / all, 1.0, 0.01);
    assert_true(octaves[0] > 20 && octaves[1] > 20 && octaves[2] > 20 && octaves[3] > 20);
    assert_true(planes[0] > 300 && planes[1] > 300 && windows[8] > 20);
    assert_true(windows[4] > 50 && windows[5] > 50 && windows[6] > 50 && windows[7] > 50);
}

/* Every line that by straight sums is well above the threshold has a hit that begins in its row, as
 * strong and of its slope: of each octave, some slopes, in both planes. */
static int lines_of(const fixture *f, int octave, int i, int plane, int count,
                    const double box[4]) {
    int a = 1 << octave, checked = 0;
    double slope = (i - 4 * a) / (4.0 * a);
    int first = (int)box[plane ? 0 : 1] / (2 * a) * 2 * a, last = (int)box[plane ? 2 : 3];
    for (int y = first; y < last && y + 5 * a <= (plane ? WIDTH : HEIGHT); y += 2 * a) {
        double best = 0.0;
        for (int x = (int)box[plane ? 1 : 0]; x < (int)box[plane ? 3 : 2]; x += 2) {
            double u0 = x - 0.5 * slope * a, v0 = y - 0.5, u1 = u0 + slope * 5.0 * a;
            double v1 = v0 + 5.0 * a;
            const bst_streak_hit h = {.plane = (int16_t)plane,
                                      .rows = (int16_t)(5 * a),
                                      .x0 = (float)(plane ? v0 : u0),
                                      .y0 = (float)(plane ? u0 : v0),
                                      .x1 = (float)(plane ? v1 : u1),
                                      .y1 = (float)(plane ? u1 : v1)};
            best = fmax(best, snr_of(f, &h));
        }
        if (best < 8.0) {
            continue;
        }
        checked++;
        bool met = false;
        for (int n = 0; n < count && !met; n++) {
            const bst_streak_hit *h = &f->search.bank.hits[n];
            double du = (double)(plane ? h->y1 - h->y0 : h->x1 - h->x0);
            double top = (double)(plane ? h->x0 : h->y0);
            met = h->plane == plane && fabs(top + 0.5 - y) < 0.1 &&
                  fabs(du / h->rows - slope) < 1e-3 && (double)h->snr > 0.95 * best;
        }
        assert_true(met);
    }
    return checked;
}

static void no_line_is_missed(void **state) {
    fixture *f = *state;
    const double ends[2][4] = {{470.0, 220.0, 522.0, 262.0}, {90.0, 60.0, 120.0, 20.0}};
    const double boxes[2][4] = {{440.0, 190.0, 560.0, 300.0}, {50.0, 0.0, 160.0, 100.0}};
    int checked[4] = {0};
    for (int k = 0; k < 2; k++) {
        clear(f);
        add_streak(f, ends[k], 4.0, 40.0);
        fill(f);
        int count = bst_streak_bank_run(&f->search.bank, NULL, &f->search.map, 0, 7.0);
        for (int octave = 0; octave < 4; octave++) {
            for (int i = 0; i <= 8 << octave; i += 3) {
                for (int plane = 0; plane < 2; plane++) {
                    if (plane == 0 || i % (8 << octave) > 0) { /* diagonals: of the first plane */
                        checked[octave] += lines_of(f, octave, i, plane, count, boxes[k]);
                    }
                }
            }
        }
    }
    assert_true(checked[1] > 20 && checked[2] > 100 && checked[3] > 100);
}

/* Largest distance of a line's ends from those of a streak. */
static double end_error(const bst_streak_line *l, const double e[4]) {
    double same = fmax(hypot(l->x0 - e[0], l->y0 - e[1]), hypot(l->x1 - e[2], l->y1 - e[3]));
    double turned = fmax(hypot(l->x0 - e[2], l->y0 - e[3]), hypot(l->x1 - e[0], l->y1 - e[1]));
    return fmin(same, turned);
}

/* A frame that is higher than wide, in a search made for wide ones: a streak in each corner of it,
 * in the last tile of each plane. */
static void a_high_frame_is_searched_to_its_end(void **state) {
    fixture *f = *state;
    const double ends[4][4] = {
        {281.0, 546.0, 297.0, 549.0}, /* found by lines that begin beyond 256 alone */
        {20.0, 530.0, 24.0, 556.0},
        {270.0, 6.0, 296.0, 12.0},
        {8.0, 8.0, 20.0, 30.0}};
    bst_streak_search search;
    bst_assert_ok(&f->ctx, bst_streak_search_create(&f->ctx, NULL, HEIGHT, WIDTH, MAX_PX, &search));
    for (int k = 0; k < 4; k++) {
        clear(f);
        const double turned[4] = {ends[k][1], ends[k][0], ends[k][3], ends[k][2]};
        add_streak(f, turned, SIGMA_PX, k == 0 ? 9.5 : 12.0);
        float *high = calloc(PIXELS, sizeof *high);
        assert_non_null(high);
        for (int i = 0; i < PIXELS; i++) {
            high[i % WIDTH * HEIGHT + i / WIDTH] = f->image[i];
        }
        bst_background background;
        bst_assert_ok(&f->ctx, bst_background_create(&f->ctx, 64, HEIGHT, WIDTH, 1, &background));
        bst_background_estimate(&background, high, HEIGHT, WIDTH, 0.1f);
        for (int i = 0; i < background.columns * background.rows; i++) {
            background.level[i] = 0.0f;
            background.noise[i] = (float)NOISE_E;
        }
        bst_streak_search_fill(&search, high, HEIGHT, WIDTH, &background, SIGMA_PX);
        assert_int_equal(bst_streak_search_bright(&search), 1);
        assert_true(end_error(&search.found[0], ends[k]) < 1.2);
        bst_background_free(&background);
        free(high);
    }
    bst_streak_search_free(&search);
}

/* Octaves up to lines as long as the longest streak, and no longer than 128 rows. */
static void octaves_reach_the_longest_streak(void **state) {
    (void)state;
    const struct {
        double max_px;
        int rows, octaves; /* the last octave's lines have 8, 16, 32, 64, 128 rows at most */
    } cases[] = {{5.0, 7, 1}, {8.0, 8, 1},   {8.5, 9, 2},    {20.0, 20, 3},
                 {64, 64, 4}, {64.5, 65, 5}, {300.0, 128, 5}};
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        bst_ctx ctx = {0};
        bst_streak_bank bank;
        bst_assert_ok(&ctx, bst_streak_bank_create(&ctx, 64, 48, cases[k].max_px, 1, &bank));
        assert_int_equal(bank.max_rows, cases[k].rows);
        assert_int_equal(bank.octaves, cases[k].octaves);
        bst_streak_bank_free(&bank);
    }
}

/* More hits than a tile holds: the strongest are kept. */
static void a_full_tile_keeps_the_strongest(void **state) {
    fixture *f = *state;
    clear(f);
    for (int i = 0; i < PIXELS; i++) { /* a frame of waves: a hit on nearly every line */
        f->image[i] = (float)(4.0 * NOISE_E * cos(0.3 * (i % WIDTH)) * cos(0.23 * (i / WIDTH)));
    }
    const double ends[4] = {200.0, 100.0, 240.0, 130.0};
    add_streak(f, ends, 1.0, 120.0);
    fill(f);
    int count = bst_streak_bank_run(&f->search.bank, NULL, &f->search.map, 0, 3.0);
    assert_true(count > 1000 && count <= bst_streak_bank_capacity(&f->search.bank));
    double top = 0.0;
    for (int n = 0; n < count; n++) {
        top = fmax(top, (double)f->search.bank.hits[n].snr);
    }
    int few = bst_streak_bank_run(&f->search.bank, NULL, &f->search.map, 0, 0.9 * top);
    assert_true(few > 0 && few < count);
    double again = 0.0;
    for (int n = 0; n < few; n++) {
        again = fmax(again, (double)f->search.bank.hits[n].snr);
    }
    bst_assert_close(again, top, 0.0);
}

/* Expected excursions of the field of lines above the threshold: density as in the header, over the
 * area in which half a streak fits, with the measured power and share. */
static void the_threshold_gives_the_false_alarms(void **state) {
    (void)state;
    const struct {
        double alarms, width, height, sigma, max_px;
    } cases[] = {{1.0, 2048, 2048, 0.85, 64},
                 {0.01, 640, 480, 1.4, 40},
                 {20.0, 480, 640, 0.6, 120},
                 {0.5, 30, 900, 1.0, 100}};
    for (int k = 0; k < 4; k++) {
        double u = bst_streak_threshold(cases[k].alarms, cases[k].width, cases[k].height,
                                        cases[k].sigma, cases[k].max_px);
        double s = sqrt(cases[k].sigma * cases[k].sigma + 1.0 / 12.0), most = cases[k].max_px;
        double area =
            fmax(1.0, cases[k].width - 0.45 * most) * fmax(1.0, cases[k].height - 0.45 * most);
        double volume = 0.72 * most / (1.0 + most / 200.0) * BST_PI / 4.0 / sqrt(12.0 * BST_PI);
        double alarms =
            area * volume / pow(s, 2.35) * u * u * u * exp(-0.5 * u * u) / pow(2.0 * BST_PI, 2.5);
        bst_assert_close(alarms / cases[k].alarms, 1.0, 1e-6); /* 40 halvings of 9 sigma */
    }
}

/* Streaks without noise: each is found once, the brightest first, where it is and with its SNR. A
 * short one and a chain of points are left to the detection of points. */
static void bright_streaks_are_found_once(void **state) {
    fixture *f = *state;
    const double ends[5][4] = {{60.0, 60.0, 84.0, 78.0},
                               {300.0, 210.0, 288.0, 247.0},
                               {490.3, 235.6, 540.0, 266.0},
                               {180.0, 150.0, 180.0, 120.0},
                               {400.0, 100.0, 424.0, 100.0}};
    const double snr[5] = {11.0, 15.0, 14.0, 9.0, 12.5};
    clear(f);
    for (int k = 0; k < 5; k++) {
        add_streak(f, ends[k], SIGMA_PX, snr[k]);
    }
    const double small[4] = {250.0, 40.0, 255.0, 43.0};
    add_streak(f, small, SIGMA_PX, 14.0);
    for (int n = 0; n < 4; n++) { /* four points in line, 12 px apart */
        const double point[4] = {60.0 + 12.0 * n, 220.0, 60.0 + 12.0 * n, 220.0};
        add_streak(f, point, SIGMA_PX, 5.5);
    }
    fill(f);
    int found = bst_streak_search_bright(&f->search);
    assert_true(f->search.candidates < 20); /* one for each of 10 lights, and a few by chance */
    assert_int_equal(found, 5);
    bst_assert_close(f->search.threshold_snr, 7.5, 0.0);
    static const int order[5] = {1, 2, 4, 0, 3};
    for (int k = 0; k < 5; k++) {
        const bst_streak_line *l = &f->search.found[k];
        /* steps of a quarter across and a row along; the end of light that is a Gaussian wide */
        assert_true(end_error(l, ends[order[k]]) < 1.2);
        /* the loss of a straight sum of pixels against the image of a streak: 0.2 dB and its ends
         */
        bst_assert_close(l->snr / snr[order[k]], 0.97, 0.04);
        assert_true(l->filled > 0.85);
    }
    /* what was found is masked: a second search has nothing more */
    assert_int_equal(bst_streak_search_bright(&f->search), 0);
}

/* A faint streak must outweigh the two brightest points on it by the pairs of points that chance
 * brings together: 0.7 n undetected ones in the frame, within 9 px. */
static void faint_streaks_outweigh_pairs_of_points(void **state) {
    fixture *f = *state;
    const double ends[4] = {220.0, 140.0, 247.0, 176.0};
    const double alarms = 0.02;
    clear(f);
    add_streak(f, ends, SIGMA_PX, 7.2);
    const double point[4] = {227.0, 149.3, 227.0, 149.3};
    add_streak(f, point, SIGMA_PX, 2.0); /* one point is brighter than the other */
    fill(f);
    assert_int_equal(bst_streak_search_faint(&f->search, alarms, 0), 1);
    bst_assert_close(f->search.threshold_snr,
                     bst_streak_threshold(alarms, WIDTH, HEIGHT, SIGMA_PX, MAX_PX), 1e-12);
    const bst_streak_line l = f->search.found[0];
    assert_true(end_error(&l, ends) < 2.0);
    double more = l.snr * l.snr - l.point_snr[0] * l.point_snr[0] - l.point_snr[1] * l.point_snr[1];
    assert_true(more > 20.0 && l.point_snr[1] > 1.0);
    assert_true(l.point_snr[0] > 1.3 * l.point_snr[1]);
    /* ln(1 + pairs / alarms) = more / 2 */
    double pairs = alarms * (exp(0.5 * more) - 1.0);
    double points = sqrt(2.0 * pairs * PIXELS / (BST_PI * 81.0)) / 0.7;
    for (int k = 0; k < 2; k++) {
        fill(f);
        int found = bst_streak_search_faint(&f->search, alarms, (int)(points * (k ? 1.01 : 0.99)));
        assert_int_equal(found, k ? 0 : 1);
    }
    /* below the threshold there is none */
    clear(f);
    add_streak(f, ends, SIGMA_PX, 0.9 * f->search.threshold_snr);
    fill(f);
    assert_int_equal(bst_streak_search_faint(&f->search, alarms, 0), 0);
}

/* Two streaks side by side or in line are two; one that another's wings touch is none of its own.
 */
static void neighbours_stay_apart(void **state) {
    fixture *f = *state;
    const double pairs[3][2][4] = {
        {{100.0, 100.0, 130.0, 110.0}, {98.0, 110.0, 128.0, 120.0}}, /* 10 px beside */
        {{300.0, 60.0, 310.0, 90.0}, {322.0, 126.0, 332.0, 156.0}},  /* 38 px behind */
        {{400.0, 200.0, 430.0, 200.0}, {440.0, 180.0, 440.0, 210.0}} /* at right angles */};
    clear(f);
    for (int k = 0; k < 3; k++) {
        add_streak(f, pairs[k][0], SIGMA_PX, 15.0);
        add_streak(f, pairs[k][1], SIGMA_PX, 14.0);
    }
    fill(f);
    int found = bst_streak_search_bright(&f->search);
    for (int k = 0; k < 6; k++) {
        int met = 0;
        for (int n = 0; n < found; n++) {
            met += end_error(&f->search.found[n], pairs[k / 2][k % 2]) < 2.5;
        }
        assert_int_equal(met, 1);
    }
    assert_int_equal(found, 6);
}

/* Streaks in eight directions, found in both planes: both ends lie on their line, and the two
 * brightest points are the greatest of the map along it that are 3.5 sigma apart. */
static void lines_follow_their_light(void **state) {
    fixture *f = *state;
    for (int k = 0; k < 8; k++) {
        double angle = BST_PI * (k + 0.4) / 8.0, c = cos(angle), n = sin(angle);
        const double x = 250.0, y = 150.0, half = 14.0;
        const double ends[4] = {x - half * c, y - half * n, x + half * c, y + half * n};
        const double bright[2][4] = {{x + 2.0 * c, y + 2.0 * n, x + 2.0 * c, y + 2.0 * n},
                                     {x - 2.2 * c, y - 2.2 * n, x - 2.2 * c, y - 2.2 * n}};
        clear(f);
        add_streak(f, ends, SIGMA_PX, 8.0);
        add_streak(f, bright[0], SIGMA_PX, 2.0); /* below 5 sigma, to which the map is limited */
        add_streak(f, bright[1], SIGMA_PX, 1.6);
        fill(f);
        assert_int_equal(bst_streak_search_faint(&f->search, 0.02, 0), 1);
        const bst_streak_line l = f->search.found[0];
        bst_assert_close((l.x0 - x) * n - (l.y0 - y) * c, 0.0, 0.25);
        bst_assert_close((l.x1 - x) * n - (l.y1 - y) * c, 0.0, 0.25);
        assert_true(end_error(&l, ends) < 2.0);
        fill(f); /* the search blanks what it has found */
        bool steep = fabs(l.y1 - l.y0) > fabs(l.x1 - l.x0);
        double top[2] = {0.0, 0.0};
        int first = 0, rows = (int)lround(steep ? fabs(l.y1 - l.y0) : fabs(l.x1 - l.x0));
        for (int pass = 0; pass < 2; pass++) {
            for (int i = 0; i < rows; i++) {
                double u = (i + 0.5) / rows, best = 0.0;
                double px = l.x0 + u * (l.x1 - l.x0), py = l.y0 + u * (l.y1 - l.y0);
                double apart = abs(i - first) * hypot(l.x1 - l.x0, l.y1 - l.y0) / rows;
                for (int across = -1; across <= 1; across++) {
                    best = fmax(best, at(f, 0, (int)lround(px) + (steep ? across : 0),
                                         (int)lround(py) + (steep ? 0 : across)));
                }
                if (best > top[pass] && (pass == 0 || apart >= 3.5 * SIGMA_PX)) {
                    top[pass] = best;
                    first = pass == 0 ? i : first;
                }
            }
            bst_assert_close(l.point_snr[pass], top[pass], 1e-9);
            assert_true(top[pass] > 3.5 && top[pass] < 4.9);
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(the_map_is_filtered, setup, teardown),
        cmocka_unit_test_setup_teardown(hits_are_sums_along_their_lines, setup, teardown),
        cmocka_unit_test_setup_teardown(no_line_is_missed, setup, teardown),
        cmocka_unit_test_setup_teardown(a_full_tile_keeps_the_strongest, setup, teardown),
        cmocka_unit_test_setup_teardown(a_high_frame_is_searched_to_its_end, setup, teardown),
        cmocka_unit_test(octaves_reach_the_longest_streak),
        cmocka_unit_test(the_threshold_gives_the_false_alarms),
        cmocka_unit_test_setup_teardown(bright_streaks_are_found_once, setup, teardown),
        cmocka_unit_test_setup_teardown(faint_streaks_outweigh_pairs_of_points, setup, teardown),
        cmocka_unit_test_setup_teardown(neighbours_stay_apart, setup, teardown),
        cmocka_unit_test_setup_teardown(lines_follow_their_light, setup, teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
