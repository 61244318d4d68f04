/* Pairs of true sources and detections against a look at every pair, brightest source first. */
#include "boresight/vec.h"
#include "sim/analysis/calibration/pairing.h"
#include "tests/test_support.h"

enum { MOST = 40 };

static double draw(uint64_t *state) {
    *state = *state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return ((double)(*state >> 11) + 0.5) * 0x1p-53;
}

/* Distance relative to what is allowed: an ellipse of FWHM across and along, or `part` of half the
 * length more along. */
static double distance(const bst_truth_item *t, const bst_detection *d, double fwhm, double part) {
    double dx = d->x_px - t->x_centroid_px, dy = d->y_px - t->y_centroid_px;
    double angle = atan2(t->y_end_px - t->y_start_px, t->x_end_px - t->x_start_px);
    double length = hypot(t->x_end_px - t->x_start_px, t->y_end_px - t->y_start_px);
    double along = cos(angle) * dx + sin(angle) * dy, across = cos(angle) * dy - sin(angle) * dx;
    double a = fwhm + part * length / 2;
    return sqrt(along * along / a / a + across * across / fwhm / fwhm);
}

static void against_every_pair(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_pairing p = {0};
    uint64_t seed = 11;
    int paired = 0, contested = 0;
    bst_truth *truth = test_calloc(1, sizeof *truth + MOST * sizeof truth->items[0]);
    bst_detections *found = test_calloc(1, sizeof *found + MOST * sizeof found->items[0]);
    for (int round = 0; round < 300; round++) {
        double fwhm = 1.5 + 2 * draw(&seed);
        int of_item[MOST], of_detection[MOST];
        bool hidden[MOST] = {false}, done[MOST] = {false};
        truth->count = (int)(MOST * draw(&seed));
        found->count = (int)(MOST * draw(&seed));
        for (int i = 0; i < truth->count; i++) {
            double length = i % 3 ? 0.0 : 20 * draw(&seed), angle = 6.28 * draw(&seed);
            bst_truth_item *t = &truth->items[i];
            *t = (bst_truth_item){.x_centroid_px = 40 * draw(&seed),
                                  .y_centroid_px = 40 * draw(&seed),
                                  .snr = 10 * draw(&seed),
                                  .flags = BST_TRUTH_IN_FIELD};
            t->x_start_px = t->x_centroid_px - 0.5 * length * cos(angle);
            t->x_end_px = t->x_centroid_px + 0.5 * length * cos(angle);
            t->y_start_px = t->y_centroid_px - 0.5 * length * sin(angle);
            t->y_end_px = t->y_centroid_px + 0.5 * length * sin(angle);
            /* none of these shows */
            int why = (int)(25 * draw(&seed));
            t->flags = why == 0 ? 0 : why == 1 ? BST_TRUTH_IN_FIELD | BST_TRUTH_OCCULTED : t->flags;
            t->snr = why == 2 ? 0.0 : t->snr;
            t->x_start_px = why == 3 ? NAN : t->x_start_px;
            t->x_end_px = why == 4 ? INFINITY : t->x_end_px;
            hidden[i] = why <= 4;
            of_item[i] = -1;
        }
        for (int i = 0; i < found->count; i++) {
            found->items[i] = (bst_detection){.x_px = 40 * draw(&seed), .y_px = 40 * draw(&seed)};
            of_detection[i] = -1;
        }
        memcpy(done, hidden, sizeof done);
        for (int part = 0; part < 2;) { /* first what is at the middle, then along the streaks */
            int brightest = -1, nearest = -1;
            for (int i = 0; i < truth->count; i++) {
                if (!done[i] &&
                    (brightest < 0 || truth->items[i].snr > truth->items[brightest].snr)) {
                    brightest = i;
                }
            }
            if (brightest < 0) {
                part++;
                memcpy(done, hidden, sizeof done);
                continue;
            }
            done[brightest] = true;
            if (of_item[brightest] >= 0) {
                continue;
            }
            double least = 1.0;
            for (int k = 0; k < found->count; k++) {
                double own = distance(&truth->items[brightest], &found->items[k], fwhm, part);
                contested += own < 1.0 && of_detection[k] >= 0;
                if (of_detection[k] < 0 && own < least) {
                    least = own;
                    nearest = k;
                }
            }
            if (nearest >= 0) {
                of_item[brightest] = nearest;
                of_detection[nearest] = brightest;
                paired++;
            }
        }
        bst_assert_ok(&ctx, bst_pairing_make(&ctx, &p, truth, found, fwhm));
        for (int i = 0; i < truth->count; i++) {
            assert_int_equal(p.detection_of[i], of_item[i]);
        }
        for (int k = 0; k < found->count; k++) {
            assert_int_equal(p.item_of[k], of_detection[k]);
        }
    }
    assert_true(paired > 500 && contested > 200);
    bst_pairing_free(&p);
    test_free(truth);
    test_free(found);
}

/* A faint streak's detection is not taken for that of a bright one 7 px further along, which has
 * none, and a bright one that rested keeps its own at its end. */
static void neighbours_on_one_line(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_pairing p = {0};
    bst_truth *truth = test_calloc(1, sizeof *truth + 2 * sizeof truth->items[0]);
    bst_detections *found = test_calloc(1, sizeof *found + 2 * sizeof found->items[0]);
    truth->count = 2;
    for (int i = 0; i < 2; i++) {
        double x = i == 0 ? 50.0 : 57.0;
        truth->items[i] = (bst_truth_item){.x_centroid_px = x,
                                           .x_start_px = x - 10,
                                           .x_end_px = x + 10,
                                           .snr = i == 0 ? 12 : 9,
                                           .flags = BST_TRUTH_IN_FIELD};
    }
    found->count = 1;
    found->items[0].x_px = 56.8;
    bst_assert_ok(&ctx, bst_pairing_make(&ctx, &p, truth, found, 2.0));
    assert_int_equal(p.detection_of[0], -1);
    assert_int_equal(p.detection_of[1], 0);
    found->count = 2;
    found->items[1].x_px = 43.0;
    bst_assert_ok(&ctx, bst_pairing_make(&ctx, &p, truth, found, 2.0));
    assert_int_equal(p.detection_of[0], 1);
    assert_int_equal(p.detection_of[1], 0);
    bst_pairing_free(&p);
    test_free(truth);
    test_free(found);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(against_every_pair),
                                       cmocka_unit_test(neighbours_on_one_line)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
