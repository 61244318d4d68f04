/* A kernel cache that cannot be written is said to be the reason, before and behind the device. */
#define _XOPEN_SOURCE 700 /* setenv */
#include <sys/stat.h>

#include "sim/device/kernel_cache.h"
#include "tests/io/scratch.h"

static void expect(const char *path, const char *reason) {
    char text[800] = "", expected[2400] = "";
    bool bad = bst_kernel_cache_is_unusable(text, sizeof text);
    if (reason) {
        snprintf(expected, sizeof expected,
                 "PoCL cannot write its kernel cache %s: %s; set POCL_CACHE_DIR to a folder that "
                 "can be written",
                 path, reason);
    }
    assert_string_equal(text, expected);
    assert_int_equal(bad, reason != NULL);
}

static void names_folder_and_reason(void **state) {
    (void)state;
    scratch place;
    scratch_make(&place);
    char path[2048];
    setenv("POCL_CACHE_DIR", place.folder, 1);
    expect(place.folder, NULL);
    snprintf(path, sizeof path, "%s/not/there/yet", place.folder);
    setenv("POCL_CACHE_DIR", path, 1);
    expect(path, NULL);
    setenv("POCL_CACHE_DIR", "/dev/null/kcache", 1);
    expect("/dev/null/kcache", "Not a directory");
    setenv("POCL_CACHE_DIR", "/dev/null", 1);
    expect("/dev/null", "Not a directory");

    unsetenv("POCL_CACHE_DIR");
    setenv("XDG_CACHE_HOME", "/dev/null", 1);
    expect("/dev/null/pocl/kcache", "Not a directory");
    setenv("XDG_CACHE_HOME", place.folder, 1);
    expect(place.folder, NULL);
    unsetenv("XDG_CACHE_HOME");
    setenv("HOME", "/dev/null", 1);
    expect("/dev/null/.cache/pocl/kcache", "Not a directory");

    snprintf(path, sizeof path, "%s/read_only", place.folder);
    assert_int_equal(mkdir(path, 0500), 0);
    setenv("POCL_CACHE_DIR", path, 1);
    expect(path, geteuid() == 0 ? NULL : "Permission denied"); /* root may write anywhere */
    scratch_remove(&place);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(names_folder_and_reason)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
