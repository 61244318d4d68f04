/* Filters of a generated frame: the straight path nearest to a bent one, the output's noise beside
 * offsets of columns and rows, and the sky that bright stars leave, against sums of their own. */
#include "boresight/vec.h"
#include "obsgen/generator_internal.h"
#include "tests/test_support.h"

enum { NODES = 9 };

/* A path that bends across a telemetry path which is not that of the stars; weights of the ends are
 * half. */
static void straight_path_and_what_it_leaves(void **state) {
    (void)state;
    for (int streaks = 0; streaks < 2; streaks++) {
        static bst_generator generator;
        bst_generator *g = &generator;
        double x[NODES], y[NODES];
        double sxu = 0.0, syu = 0.0, suu = 0.0, total = 0.0, across = 0.0, both = 0.0, fit = 0.0;
        *g = (bst_generator){.binning = 1, .sigma = 1.4, .onboard_sigma_px = 1.4};
        g->star_path = (bst_obsgen_path_px){streaks ? 3.0 : 0.0, streaks ? 4.0 : 0.0};
        g->streak = streaks ? 5.0 : 0.0;
        g->fit_bend_x = 0.1;
        g->fit_bend_y = -0.06;
        for (int k = 0; k < NODES; k++) {
            double u = k / (NODES - 1.0) - 0.5;
            x[k] = 3.3 * u + 0.6 * (u * u - 1.0 / 12.0) + 0.3 * u * u * u;
            y[k] = 3.7 * u - 0.9 * (u * u - 1.0 / 12.0);
        }
        g->path_x = x;
        g->path_y = y;
        g->path = (bst_star_trail_path){x, y, NODES};
        bst_response response;
        const bst_response_side side = {NULL, 1.4};
        bst_response_set(&response, &side, &side, 1, 0.0, 0.0);
        const bst_generator_frame f = {.response = &response};
        bst_generator_set_response(g, &f);
        for (int k = 0; k < NODES; k++) {
            double u = k / (NODES - 1.0) - 0.5, w = k % (NODES - 1) ? 1.0 : 0.5;
            sxu += w * x[k] * u;
            syu += w * y[k] * u;
            suu += w * u * u;
            total += w;
        }
        bst_assert_close(g->straight_path.dx, sxu / suu, 1e-12);
        bst_assert_close(g->straight_path.dy, syu / suu, 1e-12);
        for (int k = 0; k < NODES; k++) {
            double u = k / (NODES - 1.0) - 0.5, w = (k % (NODES - 1) ? 1.0 : 0.5) / total;
            double dx = x[k] - sxu / suu * u, dy = y[k] - syu / suu * u;
            double bend = streaks ? 1.5 * (2.0 * u) * (2.0 * u) - 0.5 : 0.0; /* of mean 0 */
            double off = streaks ? dy * 0.6 - dx * 0.8 : 0.0;
            across += w * off * off;
            both += w * 0.5 * (dx * dx + dy * dy);
            fit += w * 0.5 *
                   (pow(dx - bend * g->fit_bend_x, 2.0) + pow(dy - bend * g->fit_bend_y, 2.0));
        }
        bst_assert_close(g->path_rms_px, sqrt(fit), 1e-12);
        bst_response want = bst_response_widened(&response, streaks ? across : both);
        bst_assert_close(g->response.source.across_px, want.source.across_px, 1e-12);
        bst_assert_close(g->response.source.along_px, want.source.along_px, 1e-12);
        bst_assert_close(g->response.both.along_px, want.both.along_px, 1e-12);
        assert_true(want.source.across_px > response.source.across_px + 1e-3);
        bst_response fitted = bst_response_widened(&response, fit);
        double ratio = sqrt(fitted.source.across_px * fitted.source.along_px /
                            (response.source.across_px * response.source.along_px));
        bst_assert_close(g->widening, ratio, 1e-12);
        assert_false(g->uneven);
    }
}

/* Area about each star of SNR above 3 in which its output is, two pixels wider: a Gaussian with the
 * variance of filter and image, dilated by a square and drawn along its path. */
static void open_sky_between_stars(void **state) {
    (void)state;
    enum { STARS = 30 };
    for (int n = 0; n < 3; n++) {
        static bst_generator generator;
        generator_source sources[STARS] = {0};
        bst_generator *g = &generator;
        double covered = 0.0, pixels = n == 1 ? 200.0 * 100.0 : 80.0 * 100.0;
        *g = (bst_generator){.width = n == 1 ? 200 : 80,
                             .height = 100,
                             .cross_sigma = 1.5,
                             .threshold = 5.0,
                             .sources = sources,
                             .source_count = STARS};
        double least = bst_generator_looks_from(g);
        for (int i = 0; i < STARS; i++) {
            sources[i].amplitude = i < 25 ? (n == 2 ? 1e3 : 1.0) * (least + 1.0 + i) : 2.9;
            sources[i].length = i % 4;
            if (i < 25) {
                double r = 3.0 * sqrt(log(sources[i].amplitude / 3.0));
                /* a circle and a square of 4 px: area, half the product of outlines, area */
                covered +=
                    BST_PI * r * r + 4.0 * 4.0 * r + 16.0 + 2.0 * (r + 2.0) * sources[i].length;
            }
        }
        double share = bst_generator_open_share(g);
        /* 25 maxima: crowded in 8000 px, not in 20,000 */
        bst_assert_close(share, n == 1 ? 1.0 : fmax(exp(-covered / pixels), 0.02), 1e-12);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(straight_path_and_what_it_leaves),
                                       cmocka_unit_test(open_sky_between_stars)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
