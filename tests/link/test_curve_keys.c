/* Files of keys: what is made is read back; what is none, or open to others, is refused. */
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "sim/link/curve_keys.h"
#include "tests/io/scratch.h"
#include "tests/test_support.h"

static scratch place;
static char path[1024];

static int begin(void **state) {
    (void)state;
    scratch_make(&place);
    snprintf(path, sizeof path, "%s", scratch_path(&place, "keys"));
    return 0;
}

static int end(void **state) {
    (void)state;
    scratch_remove(&place);
    return 0;
}

static void what_is_made_is_read(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_curve_keys keys;
    struct stat info;
    bst_assert_ok(&ctx, bst_curve_keys_make(&ctx, path));
    assert_int_equal(stat(path, &info), 0);
    assert_int_equal(info.st_mode & 0777, 0600);
    bst_assert_ok(&ctx, bst_curve_keys_read(&ctx, path, &keys));
    assert_int_equal(strlen(keys.simulation_public), 40);
    assert_string_not_equal(keys.simulation_public, keys.peer_public);
    assert_string_not_equal(keys.simulation_secret, keys.peer_secret);
    assert_int_equal(bst_curve_keys_make(&ctx, path), BST_ERR_IO); /* never written over */
    assert_int_equal(chmod(path, 0604), 0);
    assert_int_equal(bst_curve_keys_read(&ctx, path, &keys), BST_ERR_ARGUMENT);
    assert_non_null(strstr(ctx.message, "found mode 0604; allowed: 0600"));
}

static void what_is_no_file_of_keys_is_refused(void **state) {
    (void)state;
#define KEY                                                                               \
    "rq:rM>}U?@Lns47E1%kR.o@n%FcmmsL/@{H8]yf7" /* RFC 32's Z85, as zmq_curve(7) prints it \
                                                */
    static const char *const texts[][2] = {
        {"", "has no line simulation_public"},
        {"garbage\n", ":1: is no line of a file of keys"},
        {"# a remark\n\nsimulation_public abc\n", ":3: is no line"},
        {"simulation_public " KEY "x\n", ":1: is no line"},
        {"simulation_public " KEY "\nsimulation_secret " KEY "\npeer_public " KEY "\n",
         "has no line peer_secret"},
    };
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++) {
        bst_ctx ctx = {0};
        bst_curve_keys keys;
        unlink(path);
        int fd = open(path, O_WRONLY | O_CREAT, 0600);
        assert_int_equal(write(fd, texts[i][0], strlen(texts[i][0])), strlen(texts[i][0]));
        close(fd);
        assert_int_equal(bst_curve_keys_read(&ctx, path, &keys), BST_ERR_FORMAT);
        if (!strstr(ctx.message, texts[i][1])) {
            fail_msg("\"%s\" does not say \"%s\"", ctx.message, texts[i][1]);
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_is_made_is_read),
        cmocka_unit_test(what_is_no_file_of_keys_is_refused),
    };
    return cmocka_run_group_tests(tests, begin, end);
}
