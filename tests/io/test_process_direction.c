/* Which end of a curved streak came first, by the rates of turn in the header. */
#include "sim/process/process_internal.h"
#include "tests/test_support.h"

enum { NODES = 5 };

/* A path that bends and gets faster, as the camera's turns about x and y. */
static void make(bst_process_node *nodes) {
    for (int i = 0; i < NODES; i++) {
        double u = i / (NODES - 1.0), along = u + 0.5 * u * u;
        nodes[i].share = 0.9 * u; /* not symmetric, so that the shares' turn shows */
        nodes[i].q_cam_from_gcrf =
            bst_quat_from_rotvec((bst_vec3){1e-3 * along, 4e-4 * u * (1.0 - u), 0.0});
    }
}

static void nodes_follow_the_rates(void **state) {
    (void)state;
    bst_process_node made[NODES], nodes[NODES];
    make(made);
    /* trend and standard error of the header; whether it decides, and whether it turns the order */
    const struct {
        double trend, sigma;
        bool decides, turns;
    } cases[] = {{0.4, 0.01, true, false},
                 {-0.4, 0.01, true, true},
                 {-0.4, 0.2, false, false},
                 {-0.04, 0.0, false, false},
                 {NAN, NAN, false, false}};
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        memcpy(nodes, made, sizeof nodes);
        bst_process_frame f = {.nodes = nodes,
                               .node_count = NODES,
                               .rate_trend = cases[c].trend,
                               .rate_trend_sigma = cases[c].sigma};
        assert_int_equal(bst_process_orient_by_rates(&f), cases[c].decides);
        assert_int_equal(f.reversed, cases[c].turns);
        for (int i = 0; i < NODES; i++) {
            int k = cases[c].turns ? NODES - 1 - i : i;
            double share = cases[c].turns ? 1.0 - made[k].share : made[k].share;
            bst_assert_close(nodes[i].share, share, 1e-15);
            bst_assert_close(nodes[i].q_cam_from_gcrf.x, made[k].q_cam_from_gcrf.x, 0.0);
            bst_assert_close(nodes[i].q_cam_from_gcrf.y, made[k].q_cam_from_gcrf.y, 0.0);
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(nodes_follow_the_rates)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
