/* A kernel cache that cannot be written is said to be the reason, before and behind the device. */
#define _XOPEN_SOURCE 700 /* setenv */
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "sim/device/kernel_cache.h"
#include "sim/device/kernel_cache_check.h"
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

static void write_bytes(const char *path, const void *bytes, size_t count) {
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(bytes, 1, count, file), count);
    fclose(file);
}

/* Programs of which a file is cut, empty, no ELF or bitcode, another user's, or not as it was noted
 * are removed; the others stay. The whole ELF file is this test's own program. */
static void damaged_programs_are_removed(void **state) {
    (void)state;
    enum { PROGRAMS = 8, MOST = 1 << 24 };
    scratch place;
    scratch_make(&place);
    char program[PROGRAMS][700], path[PROGRAMS][900];
    char *whole = malloc(MOST);
    FILE *self = fopen("/proc/self/exe", "rb");
    size_t bytes = fread(whole, 1, MOST, self);
    fclose(self);
    assert_in_range(bytes, 5000, MOST - 1);
    mkdir(scratch_path(&place, "AB"), 0700);
    for (int i = 0; i < PROGRAMS; i++) {
        snprintf(program[i], sizeof program[i], "%s/AB/PROGRAM%d", place.folder, i);
        assert_int_equal(mkdir(program[i], 0700), 0);
        snprintf(path[i], sizeof path[i], "%.690s/kernel", program[i]);
        assert_int_equal(mkdir(path[i], 0700), 0);
        snprintf(path[i], sizeof path[i], "%.690s/kernel/%s", program[i], i == 6 ? "p.bc" : "k.so");
        write_bytes(path[i], i == 6 ? "BC\xC0\xDE++++" : whole, i == 6 ? 8 : bytes);
    }
    bst_kernel_cache_note(place.folder, time(NULL) - 100);
    assert_int_equal(bst_kernel_cache_repair(place.folder), 0);
    /* 0 stays; 1 lost its note, which is no damage */
    char sums[800];
    for (int i = 1; i < 5; i++) {
        snprintf(sums, sizeof sums, "%.690s/boresight.sums", program[i]);
        assert_int_equal(unlink(sums), 0);
    }
    assert_int_equal(truncate(path[2], (off_t)bytes / 2), 0);
    write_bytes(path[3], "", 0);
    write_bytes(path[4], "garbage", 7);
    whole[bytes / 2] ^= 1; /* in the middle, where only the checksum detects it */
    write_bytes(path[5], whole, bytes);
    write_bytes(path[6], "garbage ", 8);
    bool root = geteuid() == 0;
    assert_int_equal(root ? chown(path[7], 12345, 12345) : chmod(path[7], 0702), 0);
    assert_int_equal(bst_kernel_cache_repair(place.folder), 6);
    for (int i = 0; i < PROGRAMS; i++) {
        assert_int_equal(scratch_has(program[i]), i < 2);
    }
    free(whole);
    scratch_remove(&place);
}

/* Only a folder of this user's own is used; without HOME one that no other user can write to. */
static void caches_of_others_are_not_used(void **state) {
    (void)state;
    scratch place;
    scratch_make(&place);
    bst_ctx ctx = {0};
    char path[2048];
    snprintf(path, sizeof path, "%s/open", place.folder);
    assert_int_equal(mkdir(path, 0700), 0);
    assert_int_equal(chmod(path, 0777), 0);
    setenv("POCL_CACHE_DIR", path, 1);
    assert_int_equal(bst_kernel_cache_prepare(&ctx), BST_ERR_DEVICE);
    assert_non_null(strstr(ctx.message, "is not safe: "));
    assert_non_null(strstr(ctx.message, "can be written to by others"));
    assert_non_null(strstr(ctx.message, "set POCL_CACHE_DIR to a folder of your own"));
    unsetenv("POCL_CACHE_DIR");
    unsetenv("XDG_CACHE_HOME");
    unsetenv("HOME");
    bst_assert_ok(&ctx, bst_kernel_cache_prepare(&ctx));
    snprintf(path, sizeof path, "/tmp/boresight-%ld/kcache", (long)geteuid());
    assert_string_equal(getenv("POCL_CACHE_DIR"), path);
    struct stat info;
    assert_int_equal(stat(path, &info), 0);
    assert_int_equal(info.st_mode & 0077, 0);
    unsetenv("POCL_CACHE_DIR");
    scratch_remove(&place);
}

/* A worker's cache begins with the kernels of the user's, keeps its own, and takes nothing from a
 * cache that others can write to, and no program with a symbolic link or with code that is not as
 * it was noted. */
static void workers_begin_with_the_users_kernels(void **state) {
    (void)state;
    scratch place;
    scratch_make(&place);
    char cache[700], worker[800], path[1000], both[2][1000];
    snprintf(cache, sizeof cache, "%s/cache", place.folder);
    snprintf(worker, sizeof worker, "%s/worker-0", cache);
    const char *const folders[] = {"",
                                   "/AB",
                                   "/AB/ONE",
                                   "/AB/ONE/kernel",
                                   "/CD",
                                   "/CD/TWO",
                                   "/worker-0",
                                   "/worker-0/AB",
                                   "/worker-0/AB/ONE",
                                   "/worker-1",
                                   "/worker-1/AB",
                                   "/EF",
                                   "/EF/LINK",
                                   "/EF/CHANGED"};
    for (size_t i = 0; i < sizeof folders / sizeof *folders; i++) {
        snprintf(path, sizeof path, "%s%s", cache, folders[i]);
        assert_int_equal(mkdir(path, 0700), 0);
    }
    const char *const files[] = {"AB/ONE/program.bc",          "AB/ONE/kernel/k.bc",
                                 "CD/TWO/program.bc",          "CD/TWO/last_accessed",
                                 "worker-0/AB/ONE/program.bc", "worker-1/AB/other.bc",
                                 "EF/CHANGED/program.bc"};
    for (size_t i = 0; i < sizeof files / sizeof *files; i++) {
        snprintf(path, sizeof path, "%s/%s", cache, files[i]);
        write_bytes(path, "BC\xC0\xDE++++", 8);
    }
    bst_kernel_cache_note(cache, time(NULL) - 100);
    write_bytes(path, "BC\xC0\xDE+-++", 8);
    const struct timespec then[2] = {{1000, 0},
                                     {1000, 0}}; /* a time of its own at any resolution */
    assert_int_equal(utimensat(AT_FDCWD, path, then, 0), 0);
    snprintf(path, sizeof path, "%s/EF/LINK/program.bc", cache);
    assert_int_equal(symlink("../../AB/ONE/program.bc", path), 0);
    assert_int_equal(chmod(cache, 0777), 0);
    setenv("POCL_CACHE_DIR", cache, 1);
    bst_kernel_cache_take(worker);
    assert_string_equal(getenv("POCL_CACHE_DIR"), worker);
    snprintf(path, sizeof path, "%s/CD", worker);
    assert_false(scratch_has(path));

    assert_int_equal(chmod(cache, 0700), 0);
    setenv("POCL_CACHE_DIR", cache, 1);
    bst_kernel_cache_take(worker);
    for (int i = 0; i < 3; i++) {
        struct stat info[2];
        snprintf(both[0], sizeof both[0], "%s/%s", cache, files[i]);
        snprintf(both[1], sizeof both[1], "%s/%s", worker, files[i]);
        assert_int_equal(stat(both[0], &info[0]), 0);
        assert_int_equal(stat(both[1], &info[1]), 0);
        assert_int_equal(info[0].st_ino == info[1].st_ino, i != 0); /* the worker's own stays */
    }
    snprintf(path, sizeof path, "%s/CD/TWO/last_accessed", worker);
    assert_false(scratch_has(path));
    snprintf(path, sizeof path, "%s/EF", worker);
    assert_false(scratch_has(path));
    snprintf(path, sizeof path, "%s/EF/CHANGED", cache); /* linking removes nothing */
    assert_true(scratch_has(path));
    snprintf(path, sizeof path, "%s/worker-1", worker);
    assert_false(scratch_has(path));
    unsetenv("POCL_CACHE_DIR");
    scratch_remove(&place);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(workers_begin_with_the_users_kernels),
                                       cmocka_unit_test(names_folder_and_reason),
                                       cmocka_unit_test(damaged_programs_are_removed),
                                       cmocka_unit_test(caches_of_others_are_not_used)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
