/* The user's full catalogue, where it has been fetched (boresight stars fetch). */
#include "tests/test_support.h"

#include "sim/catalogue/stars.h"

/* Stars that bright_stars_table.inc leaves with V 15, since their light is in their primary's. */
enum { COMPANIONS = 4 };

static void test_counts_of_the_full_catalogue(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    char path[512];
    bst_assert_ok(&ctx, bst_stars_default_path(&ctx, path, sizeof path));
    bst_stars *stars = NULL;
    bst_status status = bst_stars_open(&ctx, path, &stars);
    if (status == BST_ERR_NOT_FOUND) {
        print_message("no %s: run `boresight stars fetch` first\n", path);
        skip();
    }
    bst_assert_ok(&ctx, status);
    bst_stars_info info;
    bst_stars_get_info(stars, &info);
    assert_int_equal(info.count, 2557501);
    assert_false(info.embedded);
    assert_true(info.complete_to_v_mag == 11.0);
    /* See test_stars.c for the two counts. */
    static const struct {
        double v;
        int count;
    } known[] = {{6, 5028}, {8, 45631}, {9, 130727}, {10, 357171}, {11, 946002}, {12, 2083513}};
    for (size_t i = 0; i < sizeof known / sizeof known[0]; i++) {
        int below = 0, within = 0;
        bst_vec3 pole = {0, 0, 1};
        bst_assert_ok(&ctx, bst_stars_query(&ctx, stars, pole, BST_PI, known[i].v - 5e-6, 2000.0,
                                            NULL, 0, &below));
        bst_assert_ok(
            &ctx, bst_stars_query(&ctx, stars, pole, BST_PI, known[i].v, 2000.0, NULL, 0, &within));
        assert_in_range(known[i].count - COMPANIONS, below, within);
    }
    bst_stars_close(stars);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_counts_of_the_full_catalogue)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
