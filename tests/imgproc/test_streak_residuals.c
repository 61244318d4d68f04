/* What is found beside streaks: a point on a slanted path, and light that lies on a brighter star's
 * path; on a frame that is no square. Linked with wraps of the filter. */
#include "imgproc/streak/common_streak_internal.h"
#include "tests/test_support.h"

enum { WIDTH = 90, HEIGHT = 60, PIXELS = WIDTH * HEIGHT };

static struct {
    int left_out, subtracted;
    double x, y, amplitude;
} seen;

void __wrap_bst_path_filter_leave_out(bst_path_filter *filter, const bst_path_filter_peak *peak,
                                      double radius_px);
void __wrap_bst_path_filter_leave_out(bst_path_filter *filter, const bst_path_filter_peak *peak,
                                      double radius_px) {
    (void)filter;
    (void)peak;
    (void)radius_px;
    seen.left_out++;
}

void __wrap_bst_path_filter_subtract_point(bst_path_filter *filter, double x_px, double y_px,
                                           double amplitude);
void __wrap_bst_path_filter_subtract_point(bst_path_filter *filter, double x_px, double y_px,
                                           double amplitude) {
    (void)filter;
    seen.subtracted++;
    seen.x = x_px;
    seen.y = y_px;
    seen.amplitude = amplitude;
}

static float smooth[PIXELS], cover[PIXELS];

/* A path of 9 samples along (3, -1), 2 px apart, and an empty frame. */
static bst_streak_finder *make(void) {
    static bst_streak_finder f;
    memset(&f, 0, sizeof f);
    memset(smooth, 0, sizeof smooth);
    memset(cover, 0, sizeof cover);
    memset(&seen, 0, sizeof seen);
    f.width = WIDTH;
    f.height = HEIGHT;
    f.psf_sigma_px = 1.0;
    f.smooth = smooth;
    f.scratch = cover;
    f.path.count = 9;
    for (int k = 0; k < 9; k++) {
        f.path.place[k][0] = 6.0 / sqrt(10.0) * (k - 4);
        f.path.place[k][1] = -2.0 / sqrt(10.0) * (k - 4);
        f.path.light[k] = 1.0;
    }
    return &f;
}

static void put(int x, int y, double light) {
    for (int j = -5; j <= 5; j++) {
        for (int i = -5; i <= 5; i++) {
            if (x + i >= 0 && x + i < WIDTH && y + j >= 0 && y + j < HEIGHT) {
                smooth[(y + j) * WIDTH + x + i] +=
                    (float)(light * exp(-0.25 * (i * i + j * j))); /* of two PSFs */
            }
        }
    }
}

static void a_point_on_the_path_is_removed(void **state) {
    (void)state;
    static const int places[][2] = {{44, 29}, {39, 32}, {47, 28}};
    for (int n = 0; n < 3; n++) {
        bst_streak_finder *f = make();
        int x = places[n][0], y = places[n][1];
        put(x, y, 20.0);
        smooth[10 * WIDTH + 80] = 50.0F; /* brighter, and elsewhere */
        const bst_path_filter_peak peak = {.x_px = 42.0, .y_px = 30.0, .amplitude = 4.0};
        assert_true(bst_streak_finder_remove_point(f, NULL, &peak));
        assert_int_equal(seen.subtracted, 1);
        bst_assert_close(seen.x, x, 0.0);
        bst_assert_close(seen.y, y, 0.0);
        bst_assert_close(seen.amplitude, 20.0, 1e-5);
        for (int i = 0; i < PIXELS; i++) { /* 3.5 sigma about it are empty */
            int dx = abs(i % WIDTH - x), dy = abs(i / WIDTH - y);
            if (dx <= 4 && dy <= 4) {
                assert_true(smooth[i] == 0.0F);
            }
        }
        assert_true(smooth[y * WIDTH + x + 5] > 0.0F && smooth[(y + 5) * WIDTH + x] > 0.0F);
        bst_assert_close(smooth[10 * WIDTH + 80], 50.0, 0.0);
    }
}

static void light_along_the_path_is_none(void **state) {
    (void)state;
    bst_streak_finder *f = make();
    const bst_path_filter_peak peak = {.x_px = 42.0, .y_px = 30.0, .amplitude = 4.0};
    for (int k = 0; k < 9; k++) {
        put((int)lround(42.0 + f->path.place[k][0]), (int)lround(30.0 + f->path.place[k][1]), 4.0);
    }
    assert_false(bst_streak_finder_remove_point(f, NULL, &peak));
    f = make(); /* faint light at one place: only the peak is left out */
    put(42, 30, 4.5);
    assert_true(bst_streak_finder_remove_point(f, NULL, &peak));
    assert_int_equal(seen.left_out, 1);
    assert_int_equal(seen.subtracted, 0);
    f = make(); /* light of the path where it is slow counts less than by its height */
    for (int k = 0; k < 9; k++) {
        f->path.light[k] = k < 6 ? 4.0 : 0.1;
    }
    for (int k = 0; k < 9; k++) {
        put((int)lround(42.0 + f->path.place[k][0]), (int)lround(30.0 + f->path.place[k][1]), 3.0);
    }
    const bst_path_filter_peak bright = {.x_px = 42.0, .y_px = 30.0, .amplitude = 6.0};
    assert_true(bst_streak_finder_remove_point(f, NULL, &bright));
}

static void paths_of_bright_stars_cover(void **state) {
    (void)state;
    bst_streak_finder *f = make();
    const bst_path_filter_peak star = {.x_px = 50.0, .y_px = 20.0, .amplitude = 100.0};
    bst_streak_finder_cover(f, &star);
    const bst_path_filter_peak weaker = {.x_px = 50.0, .y_px = 22.0, .amplitude = 60.0};
    bst_streak_finder_cover(f, &weaker); /* the brighter of two stays */
    for (int i = 0; i < PIXELS; i++) {
        bool near[2] = {false, false};
        for (int k = 0; k < 9; k++) {
            int x = (int)lround(50.0 + f->path.place[k][0]),
                y = (int)lround(20.0 + f->path.place[k][1]);
            near[0] = near[0] || (abs(i % WIDTH - x) <= 4 && abs(i / WIDTH - y) <= 4);
            y = (int)lround(22.0 + f->path.place[k][1]);
            near[1] = near[1] || (abs(i % WIDTH - x) <= 4 && abs(i / WIDTH - y) <= 4);
        }
        bst_assert_close(cover[i], near[0] ? 100.0 : near[1] ? 60.0 : 0.0, 0.0);
    }
    /* a fifth of the light, and half of the path */
    const struct {
        double x, y, amplitude;
        bool covered;
    } cases[] = {{51.0, 21.0, 19.9, true}, {51.0, 21.0, 20.1, false}, {50.0, 24.0, 19.9, true},
                 {50.0, 40.0, 1.0, false}, {60.0, 17.0, 5.0, true},   {63.5, 15.6, 5.0, false},
                 {36.5, 24.5, 5.0, false}, {20.0, 50.0, 5.0, false},  {50.0, 12.0, 1.0, false}};
    for (size_t n = 0; n < sizeof cases / sizeof *cases; n++) {
        const bst_path_filter_peak p = {
            .x_px = cases[n].x, .y_px = cases[n].y, .amplitude = cases[n].amplitude};
        int inside = 0, under = 0;
        for (int k = 0; k < 9; k++) {
            int x = (int)lround(p.x_px + f->path.place[k][0]),
                y = (int)lround(p.y_px + f->path.place[k][1]);
            inside++;
            under += p.amplitude < 0.2 * (double)cover[y * WIDTH + x];
        }
        assert_int_equal(2 * under > inside, cases[n].covered);
        assert_int_equal(bst_streak_finder_is_covered(f, &p), cases[n].covered);
    }
}

/* Puts light at some samples of a peak's path. */
static void put_along(const bst_streak_finder *f, const bst_path_filter_peak *peak, int from,
                      int to, double light) {
    for (int k = from; k < to; k++) {
        put((int)lround(peak->x_px + f->path.place[k][0]),
            (int)lround(peak->y_px + f->path.place[k][1]), light);
    }
}

/* What is left of a bright star beyond its ends has no light of its own over most of its path. */
static void peaks_beyond_the_ends(void **state) {
    (void)state;
    const bst_path_filter_peak peak = {.x_px = 42.0, .y_px = 30.0, .amplitude = 4.0};
    bst_streak_finder *f = make();
    put_along(f, &peak, 0, 9, 4.0);
    assert_false(bst_streak_finder_is_uneven(f, &peak));
    f = make();
    put_along(f, &peak, 0, 3, 12.0); /* the same light in a third of the path */
    assert_true(bst_streak_finder_is_uneven(f, &peak));
    /* a bright star whose path holds the first half: only the rest counts */
    const bst_path_filter_peak star = {
        .x_px = 42.0 + f->path.place[0][0], .y_px = 30.0 + f->path.place[0][1], .amplitude = 100.0};
    f = make();
    bst_streak_finder_cover(f, &star);
    put_along(f, &star, 0, 9, 100.0);
    assert_true(bst_streak_finder_is_uneven(f, &peak));
    put_along(f, &peak, 6, 9, 4.0);
    assert_false(bst_streak_finder_is_uneven(f, &peak));
    /* wholly on a bright star's path: bst_streak_finder_is_covered decides */
    f = make();
    const bst_path_filter_peak same = {.x_px = 42.0, .y_px = 30.0, .amplitude = 100.0};
    bst_streak_finder_cover(f, &same);
    assert_false(bst_streak_finder_is_uneven(f, &peak));
    assert_true(bst_streak_finder_is_covered(f, &peak));
}

/* At the corners only what is on the frame is touched, and counts. */
static void edges_of_the_frame(void **state) {
    (void)state;
    bst_streak_finder *f = make();
    const bst_path_filter_peak corner = {.x_px = 88.0, .y_px = 2.0, .amplitude = 30.0};
    bst_streak_finder_cover(f, &corner);
    assert_true(cover[2 * WIDTH + 88] == 30.0F && cover[0] == 0.0F);
    assert_true(cover[4 * WIDTH] == 0.0F && cover[WIDTH * 7] == 0.0F); /* no row wraps */
    const bst_path_filter_peak faint = {.x_px = 88.0, .y_px = 2.0, .amplitude = 5.0};
    assert_true(bst_streak_finder_is_covered(f, &faint));
    f = make();
    put(88, 2, 20.0);
    assert_true(bst_streak_finder_remove_point(f, NULL, &faint));
    bst_assert_close(seen.x, 88.0, 0.0);
    bst_assert_close(seen.y, 2.0, 0.0);
}

/* A faint source that only its lines show has no size, and is no candidate for the path. */
static void sources_without_bright_pixels(void **state) {
    (void)state;
    static float lines[PIXELS];
    static int label[PIXELS], stack[PIXELS];
    bst_streak_shape shapes[BST_STREAK_SHAPES];
    bst_streak_finder *f = make();
    f->lines = lines;
    f->label = label;
    f->stack = stack;
    for (int x = 20; x < 60; x++) {
        lines[20 * WIDTH + x] = lines[40 * WIDTH + x] = 7.0F;
        smooth[20 * WIDTH + x] = 2.9F;
        smooth[40 * WIDTH + x] = 3.1F;
    }
    assert_int_equal(bst_streak_finder_list_shapes(f, shapes), 1);
    assert_int_equal(shapes[0].x1 - shapes[0].x0, 39);
    assert_int_equal(shapes[0].y0, 40);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_point_on_the_path_is_removed),
        cmocka_unit_test(light_along_the_path_is_none),
        cmocka_unit_test(paths_of_bright_stars_cover),
        cmocka_unit_test(peaks_beyond_the_ends),
        cmocka_unit_test(edges_of_the_frame),
        cmocka_unit_test(sources_without_bright_pixels),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
