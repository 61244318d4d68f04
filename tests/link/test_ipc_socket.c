/* The socket of ipc://PATH: what is at the path is never taken away, but for a dead socket. */
#include <errno.h>
#include <fcntl.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include "sim/link/ipc_socket.h"
#include "sim/link/link.h"
#include "tests/io/scratch.h"
#include "tests/test_support.h"

static scratch place;

static int begin(void **state) {
    (void)state;
    scratch_make(&place);
    return 0;
}

static int end(void **state) {
    (void)state;
    scratch_remove(&place);
    return 0;
}

static bst_status open_link(bst_ctx *ctx, const char *path, bst_link **link) {
    bst_link_config config = {.timeout_s = 1.0, .connect_timeout_s = 1.0};
    const bst_link_run run = {.scenario = "s", .tick_rate_hz = 100, .duration_ticks = 1};
    const bst_link_part part = {.instance = "o/s/imgproc", .role = "imgproc"};
    int number;
    snprintf(config.address, sizeof config.address, "ipc://%.110s", path);
    BST_TRY(bst_link_create(ctx, &config, &run, link));
    bst_status status = bst_link_add(ctx, *link, &part, &number);
    if (status == BST_OK) {
        status = bst_link_open(ctx, *link);
    }
    return status;
}

static void refused(const char *path, const char *why) {
    bst_ctx ctx = {0};
    bst_link *link = NULL;
    assert_int_equal(open_link(&ctx, path, &link), BST_ERR_IO);
    if (!strstr(ctx.message, why)) {
        fail_msg("\"%s\" does not say \"%s\"", ctx.message, why);
    }
    bst_link_close(link, 2, "");
}

/* A file, a folder, a link to a file, a link that leads nowhere: all are there afterwards. */
static void what_is_no_socket_stays(void **state) {
    (void)state;
    char path[4][1024];
    static const char *const names[] = {"thesis", "folder", "link", "dangling"};
    for (int i = 0; i < 4; i++) {
        snprintf(path[i], sizeof path[i], "%s", scratch_path(&place, names[i]));
    }
    int fd = open(path[0], O_WRONLY | O_CREAT, 0600);
    assert_int_equal(write(fd, "mine", 4), 4);
    close(fd);
    assert_int_equal(mkdir(path[1], 0700), 0);
    assert_int_equal(symlink(path[0], path[2]), 0);
    assert_int_equal(symlink("nowhere", path[3]), 0);
    for (int i = 0; i < 4; i++) {
        refused(path[i], "a file that is no socket is there, and is left alone");
        assert_true(scratch_has(path[i]));
    }
    struct stat info;
    assert_int_equal(stat(path[0], &info), 0);
    assert_int_equal(info.st_size, 4);
    refused(scratch_path(&place, "none/socket"), "its folder cannot be opened: No such file");
}

static void a_live_socket_is_not_stolen(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_link *link;
    char path[1024];
    struct stat before, after;
    snprintf(path, sizeof path, "%s", scratch_path(&place, "live"));
    bst_assert_ok(&ctx, open_link(&ctx, path, &link));
    assert_int_equal(lstat(path, &before), 0);
    assert_int_equal(before.st_mode & 0777, 0600); /* for this user alone */
    refused(path, "another program listens there; choose another path");
    assert_int_equal(lstat(path, &after), 0);
    assert_true(before.st_ino == after.st_ino);
    bst_link_close(link, 0, "");
    assert_false(scratch_has(path)); /* removed afterwards */
}

static void a_dead_socket_makes_way(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_link *link;
    char path[1024];
    snprintf(path, sizeof path, "%s", scratch_path(&place, "dead"));
    bst_ipc_socket dead;
    bst_assert_ok(&ctx, bst_ipc_socket_open(&ctx, path, &dead));
    close(dead.fd); /* as when its program is killed */
    assert_true(scratch_has(path));
    bst_assert_ok(&ctx, open_link(&ctx, path, &link));
    bst_ipc_socket_remove(&dead); /* not the one that it made: left alone */
    assert_true(scratch_has(path));
    bst_link_close(link, 0, "");
    assert_false(scratch_has(path));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_is_no_socket_stays),
        cmocka_unit_test(a_live_socket_is_not_stolen),
        cmocka_unit_test(a_dead_socket_makes_way),
    };
    return cmocka_run_group_tests(tests, begin, end);
}
