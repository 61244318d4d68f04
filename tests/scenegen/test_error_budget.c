/* The error budget of a frame against sums by hand: which sources share a pixel, and what their
 * errors add up to there. Motion at a slant of 3 : 4, longer than wide. No device. */
#include "scenegen/smear/error_budget.h"
#include "tests/test_support.h"

/* Noise of a dark pixel 10 e-. Half a box: (20 + 3 x 1.2 + 1) / 2 px along, (4 + 4.6) / 2 across.
 */
static const double DARK_E = 10.0, ALONG_PX = 12.3, ACROSS_PX = 4.3;
/* Share of the box that a path of 20 px covers: (20 + 4.6) x 4.6 / (24.6 x 8.6). */
static const double COVERED = 4.6 / 8.6;

typedef struct fixture {
    bst_ctx ctx;
    bst_error_budget *budget;
} fixture;

static int setup(void **state) {
    fixture *f = calloc(1, sizeof *f);
    assert_non_null(f);
    bst_assert_ok(&f->ctx, bst_error_budget_create(&f->ctx, &f->budget));
    *state = f;
    return 0;
}

static int teardown(void **state) {
    fixture *f = *state;
    bst_error_budget_free(f->budget);
    free(f);
    return 0;
}

static void begin(fixture *f) {
    const bst_error_budget_motion motion = {.direction = {0.6, 0.8},
                                            .length_px = 20.0,
                                            .width_px = 4.0,
                                            .way_px = 20.0,
                                            .sigma_px = 1.2,
                                            .dark_variance_e2 = DARK_E * DARK_E};
    bst_error_budget_begin(f->budget, &motion);
}

/* Adds a source at a distance along the motion and across it; errors in units of the dark noise,
 * peak 0. */
static void add(fixture *f, double along, double across, double nodes, double border) {
    const bst_error_budget_source s = {.x_px = (float)(0.6 * along - 0.8 * across),
                                       .y_px = (float)(0.8 * along + 0.6 * across),
                                       .nodes_e = (float)(DARK_E * nodes),
                                       .predicted_e = (float)(DARK_E * nodes),
                                       .border_e = (float)(DARK_E * border)};
    bst_assert_ok(&f->ctx, bst_error_budget_add(&f->ctx, f->budget, &s));
}

/* Compares with the error by hand; sums of float. */
static void expect(fixture *f, double sigma) {
    bst_assert_close(bst_error_budget_bound_sigma(f->budget), sigma, 1e-5 * sigma);
    bst_assert_close(bst_error_budget_error_sigma(f->budget), sigma, 1e-5 * sigma);
}

/* Errors of nodes, of the shared track and of light taken from beyond the stamp add up in the lit
 * pixel; light that is missing lies in a dark one. */
static void one_source(void **state) {
    fixture *f = *state;
    bst_error_budget_source s = {.x_px = 7.0f,
                                 .y_px = -3.0f,
                                 .peak_e = 44.0f, /* noise sqrt(44 + 100) = 12 */
                                 .nodes_e = 3.0f,
                                 .predicted_e = 3.0f,
                                 .shared_e = 2.0f,
                                 .excess_e = 1.0f,
                                 .border_e = 0.5f};
    begin(f);
    bst_assert_ok(&f->ctx, bst_error_budget_add(&f->ctx, f->budget, &s));
    expect(f, (3.0 + 2.0 + 1.0) / 12.0);
    s.border_e = 5.0f;
    begin(f);
    bst_assert_ok(&f->ctx, bst_error_budget_add(&f->ctx, f->budget, &s));
    expect(f, 5.0 / 10.0 + 2.0 / 12.0);
    /* light missing everywhere adds to that */
    bst_error_budget_miss(f->budget, 1.5);
    bst_error_budget_miss(f->budget, 0.5);
    expect(f, 5.0 / 10.0 + 2.0 / 12.0 + 2.0 / 10.0);
    begin(f);
    expect(f, 0.0);
}

/* At one position light and errors are summed before they are divided by the noise. */
static void sources_within_a_sigma_are_one(void **state) {
    fixture *f = *state;
    begin(f);
    const bst_error_budget_source s[2] = {{.x_px = 10.1f,
                                           .y_px = 20.2f,
                                           .peak_e = 200.0f,
                                           .nodes_e = 3.0f,
                                           .predicted_e = 3.0f,
                                           .shared_e = 1.0f},
                                          {.x_px = 10.4f,
                                           .y_px = 20.3f,
                                           .peak_e = 100.0f,
                                           .nodes_e = 5.0f,
                                           .predicted_e = 5.0f,
                                           .excess_e = 3.0f}};
    for (int i = 0; i < 2; i++) {
        bst_assert_ok(&f->ctx, bst_error_budget_add(&f->ctx, f->budget, &s[i]));
    }
    expect(f, (3.0 + 5.0 + 1.0 + 3.0) / 20.0);
}

/* Another source in the box of motion and PSF adds 0.4 of its error, which is the second worst; one
 * outside of it nothing. */
static void the_second_worst_of_a_box_counts(void **state) {
    fixture *f = *state;
    const struct {
        double along, across;
        bool shares; /* a box with a source at (6, 2) px */
    } at[] = {{6.0, 2.0 + 0.9 * ACROSS_PX, true},     {6.0, 2.0 - 0.9 * ACROSS_PX, true},
              {6.0 + 0.9 * ALONG_PX, 2.0, true},      {6.0 - 0.9 * ALONG_PX, 2.0, true},
              {6.0, 2.0 + 2.1 * ACROSS_PX, false},    {6.0, 2.0 - 2.1 * ACROSS_PX, false},
              {6.0 + 2.1 * ALONG_PX, 2.0, false},     {6.0 - 2.1 * ALONG_PX, 2.0, false},
              {6.0 + ALONG_PX, 2.0 + ACROSS_PX, true}};
    for (size_t k = 0; k < sizeof at / sizeof *at; k++) {
        for (int first = 0; first < 2; first++) { /* in either order */
            begin(f);
            add(f, first ? at[k].along : 6.0, first ? at[k].across : 2.0, first ? 0.3 : 0.5, 0.0);
            add(f, first ? 6.0 : at[k].along, first ? 2.0 : at[k].across, first ? 0.5 : 0.3, 0.0);
            expect(f, 0.5 + (at[k].shares ? 0.4 * 0.3 : 0.0));
        }
    }
}

/* Sources no closer than 1.75 px to each other, all in one cell: none are one. */
enum { ROWS = 3, COLUMNS = 7, CROWD = ROWS * COLUMNS };
static void add_crowd(fixture *f, double nodes, double border, double excess) {
    for (int i = 0; i < CROWD; i++) {
        add(f, 0.2 + 1.75 * (i % COLUMNS), 0.2 + 1.85 * (i / COLUMNS), i == 4 ? 2.0 * nodes : nodes,
            i == 4 ? 2.0 * border : border);
        if (excess > 0.0) {
            const bst_error_budget_source s = {.x_px = (float)(0.6 * (0.2 + 1.75 * (i % COLUMNS)) -
                                                               0.8 * (0.2 + 1.85 * (i / COLUMNS))),
                                               .y_px = (float)(0.8 * (0.2 + 1.75 * (i % COLUMNS)) +
                                                               0.6 * (0.2 + 1.85 * (i / COLUMNS))),
                                               .excess_e = (float)(DARK_E * excess)};
            bst_assert_ok(&f->ctx, bst_error_budget_add(&f->ctx, f->budget, &s));
        }
    }
}

static void many_in_a_box_add_in_squares(void **state) {
    fixture *f = *state;
    begin(f);
    add_crowd(f, 0.1, 0.0, 0.0);
    expect(f, 0.2 + 0.4 * sqrt(COVERED * (CROWD - 1) * 0.01));
    /* light from beyond stamps is positive: the sum of what covers a pixel, one of them surely */
    begin(f);
    add_crowd(f, 0.1, 0.0, 0.03);
    expect(f, 0.2 + 0.4 * sqrt(COVERED * (CROWD - 1) * 0.01) + 0.03 + COVERED * (CROWD - 1) * 0.03);
    /* a tenth of the other borders, and two where they cross: the less of the two sums */
    begin(f);
    add_crowd(f, 0.5, 0.01, 0.0);
    expect(f, 1.0 + 0.4 * sqrt(COVERED * (CROWD - 1) * 0.25) + 0.1 * (CROWD - 1) * 0.01);
}

/* Borders of stamps cross where circles of up to two boxes meet; in one cell at most two of the
 * larger one. */
static void crossing_borders(void **state) {
    fixture *f = *state;
    const struct {
        double along, across, sigma;
    } at[] = {{1.0 + 4.9 * ALONG_PX, 1.0, 0.9},
              {1.0, 1.0 + 4.9 * ACROSS_PX, 0.9},
              {1.0, 1.0 - 4.9 * ACROSS_PX, 0.9},
              {1.0 - 4.9 * ALONG_PX, 1.0, 0.9},
              {1.0 + 6.1 * ALONG_PX, 1.0, 0.5},
              {1.0, 1.0 - 6.1 * ACROSS_PX, 0.5},
              {4.0, 1.0, 0.9}};
    for (size_t k = 0; k < sizeof at / sizeof *at; k++) {
        begin(f);
        add(f, 1.0, 1.0, 0.0, 0.5);
        add(f, at[k].along, at[k].across, 0.0, 0.4);
        expect(f, at[k].sigma);
    }
    /* five in one cell: twice the largest at most */
    begin(f);
    for (int i = 0; i < 5; i++) {
        add(f, 1.0 + 2.0 * i, 1.0, 0.0, i == 2 ? 0.5 : 0.3);
    }
    expect(f, 1.0);
}

/* A source that moves further than the stars shares no box with them; the lesser of both errors
 * counts 0.4. */
static void objects_on_their_own(void **state) {
    fixture *f = *state;
    const bst_error_budget_source lone = {.x_px = 1.0f,
                                          .peak_e = 300.0f,
                                          .nodes_e = 4.0f,
                                          .predicted_e = 4.0f,
                                          .shared_e = 1.0f,
                                          .excess_e = 3.0f,
                                          .border_e = 2.0f,
                                          .apart = true};
    begin(f);
    bst_assert_ok(&f->ctx, bst_error_budget_add(&f->ctx, f->budget, &lone));
    expect(f, 8.0 / 20.0);
    add(f, 1.0, 0.0, 0.1, 0.0);
    bst_error_budget_miss(f->budget, 0.0);
    expect(f, 8.0 / 20.0 + 0.4 * 0.1);
    begin(f);
    bst_error_budget_source border = lone;
    border.border_e = 6.0f;
    bst_assert_ok(&f->ctx, bst_error_budget_add(&f->ctx, f->budget, &border));
    add(f, 1.0, 0.0, 1.1, 0.0);
    expect(f, 1.1 + 0.4 * 0.6);
}

/* Bounds and predicted errors are summed by the same rules, apart from each other: which source is
 * worst may differ. */
static void predictions_are_summed_apart(void **state) {
    fixture *f = *state;
    begin(f);
    const bst_error_budget_source s[3] = {
        {.x_px = 0.0f, .nodes_e = 4.0f, .predicted_e = 1.0f},
        {.x_px = 2.0f, .nodes_e = 2.0f, .predicted_e = 3.0f},
        {.x_px = 1.0f, .nodes_e = 5.0f, .predicted_e = 2.0f, .apart = true}};
    for (int i = 0; i < 2; i++) {
        bst_assert_ok(&f->ctx, bst_error_budget_add(&f->ctx, f->budget, &s[i]));
    }
    bst_assert_close(bst_error_budget_bound_sigma(f->budget), 0.4 + 0.4 * 0.2, 1e-6);
    bst_assert_close(bst_error_budget_error_sigma(f->budget), 0.3 + 0.4 * 0.1, 1e-6);
    begin(f);
    for (int i = 0; i < 3; i++) {
        bst_assert_ok(&f->ctx, bst_error_budget_add(&f->ctx, f->budget, &s[i]));
    }
    bst_assert_close(bst_error_budget_error_sigma(f->budget), 0.34 + 0.4 * 0.2, 1e-6);
    bst_assert_close(bst_error_budget_bound_sigma(f->budget), 0.5 + 0.4 * 0.48, 1e-6);
}

/* Many sources, close together or far apart, with one pair among them: only the pair adds up, in
 * whatever way cells are kept. */
static void pairs_among_many(void **state) {
    fixture *f = *state;
    const int spacing[] = {3, 40};
    for (int k = 0; k < 2; k++) {
        for (int pair = -1; pair <= 1; pair++) {
            begin(f);
            for (int i = 0; i < 300; i++) {
                add(f, ALONG_PX * (spacing[k] * (i % 20 - 9) + 0.3),
                    ACROSS_PX * (spacing[k] * (i / 20 - 6) + 0.4), 0.2, 0.0);
            }
            if (pair != 0) {
                add(f, ALONG_PX * (spacing[k] * -4 + 0.3),
                    ACROSS_PX * (spacing[k] * 2 + 0.4 + pair), 0.3, 0.0);
            }
            expect(f, pair == 0 ? 0.2 : 0.3 + 0.4 * 0.2);
        }
    }
}

/* Extents along and across the line from start to end, with what roll adds to both; a tilt about x
 * moves images along -y, one about y along x. */
static void motion_of_a_path(void **state) {
    (void)state;
    const bst_smear_path_point path[] = {
        {{1.0, 2.0, 0.1}, 0.0}, {{3.0, 3.0, 0.6}, 0.4}, {{4.0, 6.0, -0.2}, 1.0}};
    for (int shift = 0; shift < 2; shift++) {
        bst_error_budget_motion m = bst_error_budget_motion_of(path, 3, shift);
        /* (2, 1) has 2.0 along (0.6, 0.8) and -1.0 across */
        bst_assert_close(m.length_px, 5.0 + 0.8, 1e-12);
        bst_assert_close(m.width_px, 1.0 + 0.8, 1e-12);
        bst_assert_close(m.way_px, sqrt(4.0 + 1.0 + 0.25) + sqrt(1.0 + 9.0 + 0.64), 1e-12);
        bst_assert_close(m.direction[0], shift ? 0.6 : 0.8, 1e-12);
        bst_assert_close(m.direction[1], shift ? 0.8 : -0.6, 1e-12);
    }
    /* back at its start: any direction, the extents about it */
    const bst_smear_path_point loop[] = {
        {{0.0, 0.0, 0.0}, 0.0}, {{2.0, -3.0, 0.0}, 0.5}, {{0.0, 0.0, 0.0}, 1.0}};
    bst_error_budget_motion m = bst_error_budget_motion_of(loop, 3, true);
    bst_assert_close(m.length_px, 2.0, 1e-12);
    bst_assert_close(m.width_px, 3.0, 1e-12);
    bst_assert_close(hypot(m.direction[0], m.direction[1]), 1.0, 1e-12);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(one_source, setup, teardown),
        cmocka_unit_test_setup_teardown(sources_within_a_sigma_are_one, setup, teardown),
        cmocka_unit_test_setup_teardown(the_second_worst_of_a_box_counts, setup, teardown),
        cmocka_unit_test_setup_teardown(many_in_a_box_add_in_squares, setup, teardown),
        cmocka_unit_test_setup_teardown(crossing_borders, setup, teardown),
        cmocka_unit_test_setup_teardown(predictions_are_summed_apart, setup, teardown),
        cmocka_unit_test_setup_teardown(objects_on_their_own, setup, teardown),
        cmocka_unit_test_setup_teardown(pairs_among_many, setup, teardown),
        cmocka_unit_test(motion_of_a_path),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
