#include "tests/test_support.h"
#include "tracker/attitude/photocentre.h"

#define AS BST_ARCSEC_RAD

static bst_star at(uint32_t id, double east_arcsec, double v_mag) {
    bst_vec3 d = {1.0, east_arcsec * AS, 0.0};
    return (bst_star){.icrs = bst_vec3_unit(d), .v_mag = (float)v_mag, .id = id};
}

/* Two magnitudes and a half are a factor of ten: the centroid lies at 1/11 of the way. */
static void a_companion_draws_the_image(void **state) {
    (void)state;
    bst_star list[] = {at(7, 0.0, 8.0), at(8, 4.4, 10.5), at(9, 6.6, 3.0)};
    bst_vec3 c = bst_photocentre(&list[0], list, 2, 6.0 * AS);
    bst_assert_close(c.y / AS, 0.4, 1e-5); /* magnitudes are floats */
    /* what lies farther is an image of its own, however bright */
    c = bst_photocentre(&list[0], list, 3, 6.0 * AS);
    bst_assert_close(c.y / AS, 0.4, 1e-5);
    /* equals meet in the middle, also when the catalogue gives both one identity */
    bst_star twin[] = {at(7, 0.0, 8.0), at(7, 2.0, 8.0)};
    c = bst_photocentre(&twin[0], twin, 2, 6.0 * AS);
    bst_assert_close(c.y / AS, 1.0, 1e-9);
    c = bst_photocentre(&twin[0], twin, 1, 6.0 * AS);
    bst_assert_close(c.y, 0.0, 0.0);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(a_companion_draws_the_image)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
