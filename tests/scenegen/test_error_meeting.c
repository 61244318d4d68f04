/* Predicted errors by where paths meet, against those of the budget, which knows boxes only. Paths
 * are an arc of a quarter turn; no device. */
#include "boresight/vec.h"
#include "scenegen/smear/error_meeting.h"
#include "tests/test_support.h"

enum { SOURCES = 3, BLOCKS = 2, NODES = BLOCKS * BST_BLOCK };
static const double DARK_E = 10.0, SIGMA_PX = 1.0, RADIUS_PX = 40.0;

typedef struct fixture {
    bst_ctx ctx;
    bst_error_budget *budget;
    float table[BLOCKS * BST_TABLE_ROWS * BST_BLOCK];
    bst_kernel_source_record sources[SOURCES];
    bst_error_meeting_paths paths;
    bst_error_meeting *meeting;
} fixture;

/* Nodes of a camera that rolls by a quarter about a point: x' = x cos - y sin. */
static int setup(void **state) {
    fixture *f = calloc(1, sizeof *f);
    assert_non_null(f);
    bst_assert_ok(&f->ctx, bst_error_budget_create(&f->ctx, &f->budget));
    for (int n = 0; n < NODES; n++) {
        double angle = 1.5707963267948966 * n / (NODES - 1);
        float *t = f->table + n / BST_BLOCK * BST_TABLE_ROWS * BST_BLOCK + n % BST_BLOCK;
        const double rows[9] = {
            cos(angle) - 1.0, -sin(angle), 0.0, sin(angle), cos(angle) - 1.0, 0.0, 0.0, 0.0, 1.0};
        for (int i = 0; i < 9; i++) {
            t[i * BST_BLOCK] = (float)rows[i];
        }
    }
    const bst_error_budget_motion motion = {.direction = {1.0, 0.0},
                                            .length_px = 60.0,
                                            .width_px = 60.0,
                                            .way_px = 63.0,
                                            .sigma_px = SIGMA_PX,
                                            .dark_variance_e2 = DARK_E * DARK_E};
    bst_error_budget_begin(f->budget, &motion);
    f->paths = (bst_error_meeting_paths){.sources = f->sources, .table = f->table, .binning = 1};
    *state = f;
    return 0;
}

static int teardown(void **state) {
    fixture *f = *state;
    bst_error_meeting_free(f->meeting);
    bst_error_budget_free(f->budget);
    free(f);
    return 0;
}

/* A source at a distance from the pole; errors in units of the dark noise. */
static void add_bright(fixture *f, int i, double radius_px, double predicted, double grid,
                       double peak_e) {
    const bst_error_budget_source s = {.x_px = (float)radius_px,
                                       .peak_e = (float)peak_e,
                                       .nodes_e = (float)(DARK_E * predicted),
                                       .predicted_e = (float)(DARK_E * predicted),
                                       .grid_e = (float)(DARK_E * grid)};
    f->sources[i] = (bst_kernel_source_record){.x_px = s.x_px, .blocks = BLOCKS};
    bst_assert_ok(&f->ctx, bst_error_budget_add(&f->ctx, f->budget, &s));
}

static void add(fixture *f, int i, double radius_px, double predicted, double grid) {
    add_bright(f, i, radius_px, predicted, grid, 0.0);
}

/* Arcs about one centre do not meet if they are further apart than errors reach. */
static void arcs_side_by_side_do_not_add(void **state) {
    fixture *f = *state;
    add(f, 0, RADIUS_PX, 0.5, 0.0);
    add(f, 1, RADIUS_PX + 12.0, 0.4, 0.0);
    f->paths.gaussian = true;
    bst_assert_close(bst_error_budget_error_sigma(f->budget), 0.5 + 0.4 * 0.4, 1e-6);
    /* a tenth of the other's at 3 sigma, less by the sixth power */
    double far = 0.1 * pow(3.0 / (12.0 - 1.8), 6.0) * 0.4;
    bst_assert_close(bst_error_meeting_sigma(&f->meeting, f->budget, &f->paths), 0.5 + far, 1e-4);
    f->paths.gaussian = false;
    far = 0.3 * pow(3.0 / (12.0 - 1.8), 3.0) * 0.4;
    bst_assert_close(bst_error_meeting_sigma(&f->meeting, f->budget, &f->paths), 0.5 + far, 1e-4);
}

/* What comes from a neighbour is compared with the noise where it lands, whichever of both is
 * bright: here with twice the noise of the dark. */
static void noise_is_that_of_the_place(void **state) {
    fixture *f = *state;
    add_bright(f, 0, RADIUS_PX, 1.2, 0.0, 3.0 * DARK_E * DARK_E);
    add(f, 1, RADIUS_PX + 12.0, 0.3, 0.0);
    double part = 0.3 * pow(3.0 / (12.0 - 1.8), 3.0);
    bst_assert_close(bst_error_meeting_sigma(&f->meeting, f->budget, &f->paths),
                     0.6 + part * 0.3 / 2.0, 1e-4);
}

static void near_arcs_add(void **state) {
    fixture *f = *state;
    add(f, 0, RADIUS_PX, 0.5, 0.0);
    add(f, 1, RADIUS_PX + 3.0, 0.4, 0.0);
    add(f, 2, RADIUS_PX + 30.0, 0.1, 0.0);
    double all = bst_error_budget_error_sigma(f->budget);
    double meeting = bst_error_meeting_sigma(&f->meeting, f->budget, &f->paths);
    bst_assert_close(meeting, 0.5 + 0.4 * 0.4, 1e-3);
    assert_true(meeting <= all);
}

/* Errors of the grid lie at any distance. */
static void grid_errors_add_anywhere(void **state) {
    fixture *f = *state;
    add(f, 0, RADIUS_PX, 0.5, 0.0);
    add(f, 1, RADIUS_PX + 30.0, 0.4, 0.3);
    f->paths.gaussian = true;
    bst_assert_close(bst_error_meeting_sigma(&f->meeting, f->budget, &f->paths), 0.5 + 0.4 * 0.3,
                     1e-3);
}

/* Near a node behind the camera nothing is known. */
static void a_node_behind_the_camera_meets_all(void **state) {
    fixture *f = *state;
    add(f, 0, RADIUS_PX, 0.5, 0.0);
    add(f, 1, RADIUS_PX + 30.0, 0.4, 0.0);
    f->table[8 * BST_BLOCK] = -1.0f;
    bst_assert_close(bst_error_meeting_sigma(&f->meeting, f->budget, &f->paths),
                     bst_error_budget_error_sigma(f->budget), 1e-6);
}

/* Least distance of the nodes of two sources: a roll, and a shift along y that grows with it. */
static double gap_px(const bst_error_budget_source *a, int a_nodes,
                     const bst_error_budget_source *b, int b_nodes, double shift_px) {
    double least = INFINITY;
    for (int i = 0; i < a_nodes; i++) {
        for (int k = 0; k < b_nodes; k++) {
            double u = (double)i / (NODES - 1), v = (double)k / (NODES - 1);
            double c = cos(0.5 * BST_PI * u), s = sin(0.5 * BST_PI * u);
            double d = cos(0.5 * BST_PI * v), t = sin(0.5 * BST_PI * v);
            double p = (double)a->x_px, q = (double)a->y_px, r = (double)b->x_px;
            double x = c * p - s * q - d * r + t * (double)b->y_px;
            double y = s * p + c * q - t * r - d * (double)b->y_px + shift_px * (u - v);
            least = fmin(least, hypot(x, y));
        }
    }
    return least;
}

/* Sources of unequal numbers of blocks on paths that are no circles, whose places differ along both
 * axes: those near each other add in whole, others do not, by all pairs of their nodes. Of the
 * first and the last pair one of the second blocks meets the other path, and no first one does. */
static void paths_meet_by_their_nodes(void **state) {
    fixture *f = *state;
    const double shift_px = 50.0;
    const float places[][2] = {{6.0F, -31.0F}, {32.0F, -19.0F}, {41.0F, 36.0F}, {-38.0F, -47.0F}};
    int near = 0, far = 0;
    for (int n = 0; n < NODES; n++) {
        f->table[n / BST_BLOCK * BST_TABLE_ROWS * BST_BLOCK + n % BST_BLOCK + 5 * BST_BLOCK] =
            (float)(shift_px * n / (NODES - 1));
    }
    for (int c = 0; c < 8; c++) {
        bst_error_budget_source s[2];
        const int blocks[2] = {c % 2 ? 1 : BLOCKS, c % 2 ? BLOCKS : 1};
        const bst_error_budget_motion motion = {.direction = {1.0, 0.0},
                                                .length_px = 90.0,
                                                .width_px = 90.0,
                                                .way_px = 100.0,
                                                .sigma_px = SIGMA_PX,
                                                .dark_variance_e2 = DARK_E * DARK_E};
        bst_error_budget_begin(f->budget, &motion);
        for (int i = 0; i < 2; i++) {
            double error_e = DARK_E * (i ? 0.4 : 0.5);
            s[i] = (bst_error_budget_source){.x_px = i ? places[c / 2][0] : (float)RADIUS_PX,
                                             .y_px = i ? places[c / 2][1] : 0.0F,
                                             .nodes_e = (float)error_e,
                                             .predicted_e = (float)error_e};
            f->sources[i] = (bst_kernel_source_record){
                .x_px = s[i].x_px, .y_px = s[i].y_px, .blocks = blocks[i]};
            bst_assert_ok(&f->ctx, bst_error_budget_add(&f->ctx, f->budget, &s[i]));
        }
        double gap = gap_px(&s[0], blocks[0] * BST_BLOCK, &s[1], blocks[1] * BST_BLOCK, shift_px);
        double sigma = bst_error_meeting_sigma(&f->meeting, f->budget, &f->paths);
        bst_error_meeting_free(f->meeting);
        f->meeting = NULL;
        if (gap < 3.0) { /* within 3 sigma */
            bst_assert_close(sigma, 0.5 + 0.4 * 0.4, 1e-3);
        } else if (gap > 8.0) {
            assert_true(sigma < 0.6);
        }
        near += gap < 3.0;
        far += gap > 8.0;
    }
    assert_true(near >= 2 && far >= 2);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(arcs_side_by_side_do_not_add, setup, teardown),
        cmocka_unit_test_setup_teardown(noise_is_that_of_the_place, setup, teardown),
        cmocka_unit_test_setup_teardown(near_arcs_add, setup, teardown),
        cmocka_unit_test_setup_teardown(grid_errors_add_anywhere, setup, teardown),
        cmocka_unit_test_setup_teardown(paths_meet_by_their_nodes, setup, teardown),
        cmocka_unit_test_setup_teardown(a_node_behind_the_camera_meets_all, setup, teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
