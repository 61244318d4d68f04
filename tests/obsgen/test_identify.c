/* Which generated detections are labelled as stars: magnitudes, numbers that chance does not
 * explain, neighbours that are mistaken. */
#include "obsgen/identify.h"
#include "tests/test_support.h"

enum { MOST = 400 };

typedef struct fixture {
    bst_ctx ctx;
    bst_identify_options options;
    bst_generator_frame frame;
    bst_truth *truth;
    bst_obsgen_generated generated[MOST];
    bst_detection items[MOST];
    int count, identified;
} fixture;

/* `stars` detected ones on a grid and `others` that are no star. */
static fixture *make(int stars, int others) {
    fixture *f = test_calloc(1, sizeof *f);
    f->truth = test_calloc(1, sizeof *f->truth + MOST * sizeof f->truth->items[0]);
    f->frame =
        (bst_generator_frame){.truth = f->truth, .window = {64, 32, 1000, 800}, .binning = 1};
    f->options = (bst_identify_options){.search_radius_px = 50,
                                        .match_tolerance_px = 5,
                                        .probability = 1,
                                        .v_limit = 12,
                                        .key = {{1, 2}}};
    f->truth->count = stars;
    f->count = stars + others;
    for (int i = 0; i < f->count; i++) {
        double x = 100 + 40.0 * (i % 20), y = 60 + 40.0 * (i / 20);
        if (i < stars) {
            f->truth->items[i] = (bst_truth_item){.kind = BST_SOURCE_STAR,
                                                  .id = (uint32_t)(1000 + i),
                                                  .x_centroid_px = x,
                                                  .y_centroid_px = y,
                                                  .v_mag = 9};
        }
        f->generated[i].item = i < stars ? i : -1;
        /* 0.2 mag of noise: 2.5 / ln 10 of 0.1842 */
        f->items[i] = (bst_detection){.x_px = x,
                                      .y_px = y,
                                      .cov_xx = 0.05,
                                      .cov_yy = 0.0475,
                                      .flux_e = 1000,
                                      .flux_sigma_e = 184.20680743952366,
                                      .v_mag = 9};
    }
    return f;
}

static void finish(fixture *f) {
    test_free(f->truth);
    test_free(f);
}

static void identify(fixture *f) {
    bst_assert_ok(&f->ctx, bst_obsgen_identify(&f->ctx, &f->options, &f->frame, f->generated,
                                               f->items, f->count, &f->identified));
}

static void magnitudes_agree(void **state) {
    (void)state;
    fixture *f = make(60, 0);
    /* 1 + 3 x 0.2 mag; what is cut may have lost 2.5 more */
    static const struct {
        double excess;
        uint32_t flags;
        bool star;
    } cases[] = {{1.59, 0, true},
                 {1.61, 0, false},
                 {-1.59, 0, true},
                 {-1.61, 0, false},
                 {4.09, BST_DETECTION_SATURATED, true},
                 {4.11, BST_DETECTION_SATURATED, false},
                 {4.09, BST_DETECTION_EDGE, true},
                 {-1.61, BST_DETECTION_EDGE, false}};
    for (int i = 0; i < 8; i++) {
        f->items[i].v_mag = 9 + cases[i].excess;
        f->items[i].flags = cases[i].flags;
    }
    f->items[8].flux_sigma_e = 1e6; /* no more than a magnitude of noise counts */
    f->items[8].v_mag = 12.9;
    f->items[9].flux_sigma_e = 1e6;
    f->items[9].v_mag = 13.1;
    f->truth->items[10].v_mag = 12.01; /* not in the catalogue on board */
    f->items[10].v_mag = 12.01;
    f->truth->items[11].id |= 0x80000000u; /* in no catalogue */
    f->truth->items[12].kind = BST_SOURCE_OBJECT;
    f->items[13].label = BST_LABEL_ARTEFACT; /* known already */
    identify(f);
    for (int i = 0; i < 60; i++) {
        bool star = i < 8 ? cases[i].star : i == 8 || i > 13;
        assert_int_equal(f->items[i].label == BST_LABEL_STAR, star);
        assert_int_equal(f->items[i].star_id, star ? 1000 + i : 0);
    }
    assert_int_equal(f->identified, 46 + 1 + 4);
    finish(f);
}

/* Votes below which a hundredth of the frames would have as many by chance, by sums of exact terms:
 * pairs of a star and a detection within cells of 4 x 4 px, in all cells of the search. */
static int least_votes(double radius_px, int detections) {
    double wide = 1000 + 2 * radius_px, high = 800 + 2 * radius_px;
    for (int n = 1;; n++) {
        double stars = fmin(n * wide * high / 8e5, 150), tail = 1;
        double mean = 0.4 * stars * fmin(detections, 150) * 16 / (wide * high);
        for (int k = 0; k < n; k++) {
            tail -= exp(k * log(mean) - mean - lgamma(k + 1.0));
        }
        if (fmax(4 * radius_px * radius_px / 16, 1) * tail < 0.01) {
            return n;
        }
    }
}

static void chance_is_excluded(void **state) {
    (void)state;
    static const double radii[] = {50, 200, 10};
    for (int k = 0; k < 3; k++) {
        int n = least_votes(radii[k], 120);
        assert_in_range(n, 2, 10);
        for (int votes = n - 1; votes <= n; votes++) {
            fixture *f = make(votes, 120 - votes);
            f->options.search_radius_px = k == 2 ? 1000 : radii[k];
            f->options.locked = k == 2; /* then 10 px are tried first */
            f->options.shift_px = k == 2 ? 9.9 : 0.99 * radii[k];
            identify(f);
            assert_int_equal(f->identified, votes == n ? n : 0);
            finish(f);
        }
    }
    fixture *f = make(60, 0);
    f->options.shift_px = 50.1; /* beyond the search */
    identify(f);
    assert_int_equal(f->identified, 0);
    finish(f);
}

/* Something else beside a star of its brightness that was not detected: within 4 sqrt(0.05 + 0.0475
 * + 1/16) = 1.6 px. */
static void neighbours_are_mistaken(void **state) {
    (void)state;
    static const struct {
        double dx, dy, tolerance_px;
        bool taken;
    } cases[] = {{1.2, 1.0, 5, true}, {1.2, 1.12, 5, false}, {1.2, 1.0, 1.5, false}};
    for (int k = 0; k < 3; k++) {
        fixture *f = make(60, 1);
        bst_truth_item star = f->truth->items[0];
        star.id = 5000;
        star.x_centroid_px = f->items[60].x_px + cases[k].dx;
        star.y_centroid_px = f->items[60].y_px - cases[k].dy;
        f->truth->items[f->truth->count++] = star;
        f->options.match_tolerance_px = cases[k].tolerance_px;
        identify(f);
        assert_int_equal(f->identified, 60 + cases[k].taken);
        assert_int_equal(f->items[60].star_id, cases[k].taken ? 5000 : 0);
        finish(f);
    }
    fixture *f = make(61, 1); /* the star is detected itself */
    f->items[61].x_px = f->items[60].x_px + 1;
    f->items[61].y_px = f->items[60].y_px;
    identify(f);
    assert_int_equal(f->items[61].label, BST_LABEL_UNKNOWN);
    finish(f);
}

/* The catalogue on board is another one: a star whose place there is as far off as the match
 * tolerates, 1.6 px of 3 arcsec, is not found; for something else beside it both distances count.
 */
static void the_catalogue_on_board_has_other_places(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_stars *stars;
    bst_assert_ok(&ctx, bst_stars_open(&ctx, "embedded", &stars));
    static bst_star known[100];
    int count = 0;
    bst_assert_ok(&ctx, bst_stars_query(&ctx, stars, bst_vec3_from_radec(1.4, -0.1), 0.3, 6.5,
                                        2022.0, known, 100, &count));
    assert_in_range(count, 60, 1000);
    fixture *f = make(60, 2);
    bst_identify_options *o = &f->options;
    o->catalogue = stars;
    o->world_catalogue = (const bst_stars *)f; /* any other one */
    o->julian_year = 2022.0;
    f->truth->pixel_scale_arcsec = 3.0;
    for (int i = 0; i < 60; i++) {
        /* 1.3 to 1.9 px off, in right ascension or declination */
        double off_px = 1.305 + 0.01 * i, off_rad = off_px * 3.0 / 3600.0 * BST_PI / 180.0;
        double ra, dec;
        bst_vec3_to_radec(known[i].icrs, &ra, &dec);
        bst_truth_item *item = &f->truth->items[i];
        item->id = known[i].id;
        item->ra_rad = ra + (i % 2 ? off_rad / cos(dec) : 0.0);
        item->dec_rad = dec + (i % 2 ? 0.0 : off_rad);
    }
    f->truth->items[59].id = 1; /* in no catalogue */
    f->truth->items[59].ra_rad = 0.0;
    /* stars 0.25 px off on board, with something 1.3 px and 1.4 px beside them */
    for (int k = 0; k < 2; k++) {
        bst_truth_item star = f->truth->items[2];
        double ra;
        bst_vec3_to_radec(known[60 + k].icrs, &ra, &star.dec_rad);
        star.id = known[60 + k].id;
        star.ra_rad = ra;
        star.dec_rad += 0.25 * 3.0 / 3600.0 * BST_PI / 180.0;
        star.x_centroid_px = f->items[60 + k].x_px + 1.3 + 0.1 * k;
        star.y_centroid_px = f->items[60 + k].y_px;
        f->truth->items[f->truth->count++] = star;
    }
    identify(f);
    for (int i = 0; i < 60; i++) { /* 4 sqrt(0.05 + 0.0475 + 0.0625) = 1.6 */
        assert_int_equal(f->items[i].label == BST_LABEL_STAR, i < 30);
    }
    assert_int_equal(f->items[60].star_id, known[60].id);
    assert_int_equal(f->items[61].star_id, 0);
    bst_stars_close(stars);
    finish(f);
}

/* Of two undetected stars the nearer one is taken, whichever comes first. */
static void the_nearer_of_two_is_taken(void **state) {
    (void)state;
    for (int order = 0; order < 2; order++) {
        fixture *f = make(60, 1);
        for (int k = 0; k < 2; k++) {
            bst_truth_item star = f->truth->items[0];
            bool near = k == order;
            star.id = near ? 5001 : 5002;
            star.x_centroid_px = f->items[60].x_px + (near ? -0.6 : 0.3);
            star.y_centroid_px = f->items[60].y_px + (near ? 0.2 : 0.9);
            f->truth->items[f->truth->count++] = star;
        }
        identify(f);
        assert_int_equal(f->items[60].star_id, 5001);
        finish(f);
    }
}

static void some_are_missed(void **state) {
    (void)state;
    fixture *f = make(300, 0);
    f->options.probability = 0.7;
    identify(f);
    bst_assert_close(f->identified, 210, 4 * sqrt(300 * 0.7 * 0.3)); /* 4 sigma */
    finish(f);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(magnitudes_agree),
        cmocka_unit_test(chance_is_excluded),
        cmocka_unit_test(neighbours_are_mistaken),
        cmocka_unit_test(some_are_missed),
        cmocka_unit_test(the_catalogue_on_board_has_other_places),
        cmocka_unit_test(the_nearer_of_two_is_taken),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
