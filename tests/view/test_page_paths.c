#define _XOPEN_SOURCE 700 /* realpath */
/* Paths of the run's folder do not stand in an exported page. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "view/page_paths.h"

/* `text` in a list in an object, after the paths of `folder` were cut. */
static void expect(const char *folder, const char *text, const char *cut) {
    cJSON *root = cJSON_CreateObject(), *list = cJSON_AddArrayToObject(root, "problems");
    cJSON_AddItemToArray(list, cJSON_CreateNumber(1.0));
    cJSON_AddItemToArray(list, cJSON_CreateString(text));
    bst_view_cut_path(root, folder);
    assert_string_equal(cJSON_GetArrayItem(list, 1)->valuestring, cut);
    cJSON_Delete(root);
}

static void test_paths_are_cut(void **state) {
    (void)state;
    expect("/some/one/x", "/some/one/x/frames.fits: cannot be opened",
           "x/frames.fits: cannot be opened");
    expect("/some/one/x.partial//", "'/some/one/x.partial' and /some/one/x/run.sqlite",
           "'x.partial' and x/run.sqlite");
    expect("runs/x", "runs/x/frames.fits", "x/frames.fits");
    expect("/some/one/x", "/some/one/some/one/x", "some/one/x");
}

static void test_other_texts_stay(void **state) {
    (void)state;
    expect("/some/one/x", "/data/some/one/x: no such file", "/data/some/one/x: no such file");
    expect("runs/x", "other_runs/x, 3/4 of /tmp/runs/x", "other_runs/x, 3/4 of /tmp/runs/x");
    expect("x", "a/x and x/frames.fits", "a/x and x/frames.fits");
    expect("/x", "/usr/share/x", "/usr/share/x");
    expect("", "a/x", "a/x");
    bst_view_cut_path(NULL, "/some/one/x");
}

/* A folder that is named from the working directory stands with its whole path in messages. */
static void test_absolute_path(void **state) {
    (void)state;
    char *here = realpath(".", NULL), text[5000];
    assert_non_null(here);
    snprintf(text, sizeof text, "%s/frames.fits", here);
    const char *name = strrchr(here, '/') + 1;
    char cut[5000];
    snprintf(cut, sizeof cut, "%s/frames.fits", name);
    expect(".", text, cut);
    free(here);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_paths_are_cut),
                                       cmocka_unit_test(test_other_texts_stay),
                                       cmocka_unit_test(test_absolute_path)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
