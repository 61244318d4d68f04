/* Which addresses the link takes. */
#include "tests/test_support.h"

#include "sim/link/endpoint.h"

static void takes(const char *address, const char *expected) {
    bst_ctx ctx = {0};
    char out[BST_LINK_ENDPOINT_BYTES];
    bst_assert_ok(&ctx, bst_link_endpoint_check(&ctx, address, out));
    assert_string_equal(out, expected);
}

static void refuses(const char *address, const char *words) {
    bst_ctx ctx = {0};
    char out[BST_LINK_ENDPOINT_BYTES];
    assert_int_equal(bst_link_endpoint_check(&ctx, address, out), BST_ERR_ARGUMENT);
    if (!strstr(ctx.message, words)) {
        fail_msg("%s: \"%s\" does not say \"%s\"", address, ctx.message, words);
    }
}

static void loopback_is_taken(void **state) {
    (void)state;
    takes("tcp://127.0.0.1:5555", "tcp://127.0.0.1:5555");
    takes("tcp://127.1.2.3:1", "tcp://127.1.2.3:1");
    takes("tcp://localhost:65535", "tcp://127.0.0.1:65535");
    takes("tcp://[::1]:5555", "tcp://[::1]:5555");
    takes("ipc:///tmp/link", "ipc:///tmp/link");
    takes("ipc://link.socket", "ipc://link.socket");
}

static void what_others_can_reach_is_refused_with_the_tunnel(void **state) {
    (void)state;
    const char *const open[] = {"tcp://*:5555",
                                "tcp://0.0.0.0:5555",
                                "tcp://192.168.1.7:5555",
                                "tcp://eth0:5555",
                                "tcp://[::]:5555",
                                "tcp://128.0.0.1:5555",
                                "tcp://127.0.0.1.example.org:5555",
                                "tcp://127.0.0.256:5555",
                                "tcp://1270.0.1:5555",
                                "tcp://localhost.org:5555",
                                "tcp://127.0.0.1;0.0.0.0:5555"};
    for (size_t i = 0; i < sizeof open / sizeof *open; i++) {
        refuses(open[i], "ssh -L 5555:127.0.0.1:5555");
    }
}

static void what_is_no_address_is_refused(void **state) {
    (void)state;
    const char *const none[] = {"",
                                "5555",
                                "tcp://127.0.0.1",
                                "tcp://127.0.0.1:0",
                                "tcp://127.0.0.1:65536",
                                "tcp://127.0.0.1:99999999999999999999",
                                "tcp://127.0.0.1:55x5",
                                "tcp://127.0.0.1:*",
                                "tcp://:5555",
                                "ipc://",
                                "ipc://*",
                                "ipc://@abstract",
                                "udp://127.0.0.1:5555",
                                "inproc://x",
                                "pgm://127.0.0.1:5555"};
    for (size_t i = 0; i < sizeof none / sizeof *none; i++) {
        refuses(none[i], "is no address (allowed: tcp://127.0.0.1:PORT");
    }
    char path[200] = "ipc://";
    memset(path + 6, 'p', 108);
    refuses(path, "at most 107 bytes");
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(loopback_is_taken),
        cmocka_unit_test(what_others_can_reach_is_refused_with_the_tunnel),
        cmocka_unit_test(what_is_no_address_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
