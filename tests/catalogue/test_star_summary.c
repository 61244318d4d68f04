/* The summary of a catalogue, against a count of its stars, and refusals of the import. */
#include "sim/catalogue/star_install.h"
#include "sim/catalogue/star_summary.h"
#include "tests/test_support.h"

static void test_counts(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_stars *stars = NULL;
    bst_stars_info info;
    char *text = NULL;
    size_t bytes = 0;
    bst_assert_ok(&ctx, bst_stars_open(&ctx, "embedded", &stars));
    bst_stars_get_info(stars, &info);
    FILE *stream = open_memstream(&text, &bytes);
    assert_non_null(stream);
    bst_assert_ok(&ctx, bst_stars_print_summary(&ctx, stars, stream));
    assert_int_equal(fclose(stream), 0);

    bst_star *all = malloc((size_t)info.count * sizeof *all);
    assert_non_null(all);
    int count = 0;
    bst_assert_ok(&ctx, bst_stars_query(&ctx, stars, (bst_vec3){0.0, 0.0, 1.0}, BST_PI, INFINITY,
                                        2000.0, all, (int)info.count, &count));
    assert_int_equal(count, info.count);
    int rows = 0, last = 0;
    for (const char *line = strstr(text, "counts"); line; line = strchr(line + 1, '\n')) {
        int v, printed, fewest = 0, most = 0;
        if (sscanf(line, " %d %d", &v, &printed) != 2) {
            continue;
        }
        for (int i = 0; i < count; i++) {
            /* magnitudes are rounded to float; only stars on the limit itself are that near */
            fewest += all[i].v_mag < v - 1e-5;
            most += all[i].v_mag < v + 1e-5;
        }
        assert_int_equal(v, rows);
        assert_in_range(printed, fewest, most);
        assert_true(most - fewest < 100);
        last = printed;
        rows++;
    }
    assert_true(rows >= 9); /* to V 9, the limit of the embedded stars, at least */
    assert_true(last == info.count || rows == 16); /* to V 15, or until all are counted */
    assert_non_null(strstr(text, "path      (in the program)\n"));
    int patches = 0;
    for (const char *line = text; (line = strstr(line, "all of Tycho-2 to V")); line++) {
        patches++;
    }
    assert_int_equal(patches, info.patches);
    free(all);
    free(text);
    bst_stars_close(stars);
}

static void test_install_refuses(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    char path[512];
    long long stars = -1;
    const bst_star_install_request no_subset = {
        .tarball = "no.tar.xz", .subset = "no_subset.txt", .out = "/nowhere/out.stars"};
    assert_int_not_equal(bst_star_install(&ctx, &no_subset, path, sizeof path, &stars), BST_OK);
    assert_non_null(strstr(ctx.message, "no_subset.txt"));
    const bst_star_install_request no_tarball = {.tarball = "no.tar.xz",
                                                 .out = "/nowhere/out.stars"};
    assert_int_not_equal(bst_star_install(&ctx, &no_tarball, path, sizeof path, &stars), BST_OK);
    assert_non_null(strstr(ctx.message, "no.tar.xz"));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_counts),
        cmocka_unit_test(test_install_refuses),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
