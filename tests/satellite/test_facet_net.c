/* Facets that others cross, of a round end with many corners and a small plate that stands in it
 * near its rim, all round. */
#include "sim/satellite/facet_net.h"
#include "tests/satellite/satellite_support.h"

/* Value of `apart` of the upper end of a drum of radius 1, where a plate of 0.2 m stands upright at
 * a place of that end. */
static int apart_of_the_end(double distance_m, double azimuth) {
    char text[600];
    snprintf(text, sizeof text,
             "{\"materials\": [{\"name\": \"a\", \"diffuse\": 0.5}], \"parts\": [{\"name\": "
             "\"drum\", \"kind\": \"cylinder\", \"radius_m\": 1, \"length_m\": 2, "
             "\"segments\": 24, \"material\": \"a\"}, {\"name\": \"fin\", \"kind\": \"plate\", "
             "\"size_m\": [0.2, 0.2, 1], \"position_m\": [%.9g, %.9g, 1], \"rotation_deg\": "
             "[90, 0, 0], \"material\": \"a\"}]}",
             distance_m * cos(azimuth), distance_m * sin(azimuth));
    bst_ctx ctx = {0};
    bst_test_model m = bst_test_model_open(text);
    bst_facet_net net;
    bst_assert_ok(&ctx, bst_facet_net_make(&ctx, m.satellite, &net));
    bst_assert_ok(&ctx, bst_facet_net_find_apart(&ctx, &net));
    int end = -1;
    for (int f = 0; f < m.satellite->facet_count; f++) {
        const bst_facet *facet = &m.satellite->facets[f];
        if (facet->normal.z > 0.999 && facet->count > 12) {
            assert_int_equal(end, -1);
            end = f;
        }
    }
    assert_true(end >= 0);
    int apart = net.apart[end];
    bst_facet_net_free(&net);
    bst_test_model_close(&m);
    return apart;
}

static void a_plate_crosses_a_round_end(void **state) {
    (void)state;
    for (int k = 0; k < 24; k++) {
        const double azimuth = 2.0 * BST_PI * (k + 0.3) / 24.0;
        /* the plate reaches 0.1 m to either side along x */
        assert_int_equal(apart_of_the_end(0.85, azimuth), 0);
        assert_int_not_equal(apart_of_the_end(1.15, azimuth), 0);
    }
}

/* Sizes of facets are their diagonals, whichever corners they connect. */
static void facets_have_the_size_of_their_diagonal(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_test_model m = bst_test_model_open(
        "{\"materials\": [{\"name\": \"a\", \"diffuse\": 0.5}], \"parts\": [{\"name\": \"b\", "
        "\"kind\": \"box\", \"size_m\": [1, 2, 4], \"material\": \"a\"}]}");
    bst_facet_net net;
    bst_assert_ok(&ctx, bst_facet_net_make(&ctx, m.satellite, &net));
    assert_int_equal(m.satellite->facet_count, 6);
    for (int f = 0; f < 6; f++) {
        bst_vec3 n = m.satellite->facets[f].normal;
        double want = fabs(n.x) > 0.5 ? sqrt(20) : fabs(n.y) > 0.5 ? sqrt(17) : sqrt(5);
        bst_assert_close((double)net.size_m[f], want, 1e-6);
    }
    bst_facet_net_free(&net);
    bst_test_model_close(&m);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(a_plate_crosses_a_round_end),
                                       cmocka_unit_test(facets_have_the_size_of_their_diagonal)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
