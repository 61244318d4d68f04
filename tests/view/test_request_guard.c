/* Which requests the viewer answers: token, Host, Origin, paths, queries. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "view/request_guard.h"

#define TOKEN "0123456789abcdef0123456789abcdef"

/* A request that is answered. */
static const bst_view_request right = {
    .method = "GET", .target = "/" TOKEN "/api/run?a=1", .host = "127.0.0.1:8080", .hosts = 1};

static int guard(bst_view_request request, char route[BST_VIEW_ROUTE_BYTES]) {
    return bst_view_guard(&request, TOKEN, route);
}

static void test_answered(void **state) {
    (void)state;
    char route[BST_VIEW_ROUTE_BYTES];
    assert_int_equal(guard(right, route), BST_HTTP_OK);
    assert_string_equal(route, "api/run");
    bst_view_request r = right;
    r.target = "/" TOKEN "/";
    r.method = "HEAD";
    assert_int_equal(guard(r, route), BST_HTTP_OK);
    assert_string_equal(route, "");
    /* other ports come from ssh -L */
    static const char *const hosts[] = {"localhost", "LOCALHOST:1", "127.0.0.1", "[::1]:65535"};
    for (size_t i = 0; i < sizeof hosts / sizeof *hosts; i++) {
        char origin[64] = "http://";
        r.host = hosts[i];
        r.origin = NULL;
        assert_int_equal(guard(r, route), BST_HTTP_OK);
        r.origin = strcat(origin, hosts[i]);
        r.origins = 1;
        assert_int_equal(guard(r, route), BST_HTTP_OK);
    }
}

static void test_hosts(void **state) {
    (void)state;
    static const char *const hosts[] = {"",
                                        "evil.example",
                                        "evil.example:8080",
                                        "127.0.0.1.evil.example",
                                        "localhost.evil.example:8080",
                                        "localhost:8080@evil.example",
                                        "127.0.0.1:",
                                        "127.0.0.1:123456",
                                        "127.0.0.1:80 80",
                                        "127.0.0.2",
                                        "0.0.0.0:8080",
                                        "[::1",
                                        "[::1]x",
                                        " localhost"};
    char route[BST_VIEW_ROUTE_BYTES];
    bst_view_request r = right;
    for (size_t i = 0; i < sizeof hosts / sizeof *hosts; i++) {
        r.host = hosts[i];
        assert_int_equal(guard(r, route), BST_HTTP_FORBIDDEN);
        assert_string_equal(route, "");
    }
    r.host = NULL;
    r.hosts = 0;
    assert_int_equal(guard(r, route), BST_HTTP_BAD_REQUEST);
    r = right;
    r.hosts = 2;
    assert_int_equal(guard(r, route), BST_HTTP_BAD_REQUEST);
}

static void test_origins(void **state) {
    (void)state;
    static const char *const origins[] = {"",
                                          "null",
                                          "http://evil.example",
                                          "http://evil.example:8080",
                                          "https://127.0.0.1:8080",
                                          "http://127.0.0.1",
                                          "http://127.0.0.1:80801",
                                          "http://127.0.0.1:8080/",
                                          "http://localhost:8080",
                                          "127.0.0.1:8080"};
    char route[BST_VIEW_ROUTE_BYTES];
    bst_view_request r = right;
    r.origins = 1;
    for (size_t i = 0; i < sizeof origins / sizeof *origins; i++) {
        r.origin = origins[i];
        assert_int_equal(guard(r, route), BST_HTTP_FORBIDDEN);
    }
    r.origin = "http://127.0.0.1:8080";
    assert_int_equal(guard(r, route), BST_HTTP_OK);
    r.origins = 2;
    assert_int_equal(guard(r, route), BST_HTTP_BAD_REQUEST);
}

static void test_tokens(void **state) {
    (void)state;
    char target[] = "/" TOKEN "/api/run", route[BST_VIEW_ROUTE_BYTES];
    bst_view_request r = right;
    r.target = target;
    for (int i = 1; i <= BST_VIEW_TOKEN_DIGITS; i++) { /* each digit counts */
        char digit = target[i];
        target[i] = (char)(digit ^ 1);
        assert_int_equal(guard(r, route), BST_HTTP_FORBIDDEN);
        assert_string_equal(route, "");
        target[i] = digit;
    }
    assert_int_equal(guard(r, route), BST_HTTP_OK);
    static const char *const targets[] = {"/",
                                          "/x",
                                          "/" TOKEN,
                                          "/" TOKEN "0/",
                                          "//" TOKEN "/",
                                          "/api/run",
                                          "/?" TOKEN "/",
                                          "/0123456789ABCDEF0123456789ABCDEF/"};
    for (size_t i = 0; i < sizeof targets / sizeof *targets; i++) {
        r.target = targets[i];
        assert_int_equal(guard(r, route), BST_HTTP_FORBIDDEN);
    }
}

static void test_paths(void **state) {
    (void)state;
    static const char *const paths[] = {
        "..",
        "../",
        "../../etc/passwd",
        "api/../../x",
        "%2e%2e/x",
        "a%2fb",
        "/etc/passwd",
        "a//b",
        "..\\x",
        "a b",
        "A",
        "index.html%00",
        "a\nb",
        "\xc3\xa9",
        "x#y",
        "aaaaaaaaaabbbbbbbbbbccccccccccddddddddddeeeeeeeeeeffffffffffgggg"};
    char route[BST_VIEW_ROUTE_BYTES], target[256];
    bst_view_request r = right;
    r.target = target;
    for (size_t i = 0; i < sizeof paths / sizeof *paths; i++) {
        strcat(strcpy(target, "/" TOKEN "/"), paths[i]);
        assert_int_equal(guard(r, route), BST_HTTP_NOT_FOUND);
        assert_string_equal(route, "");
    }
}

static void test_methods_and_bodies(void **state) {
    (void)state;
    static const char *const methods[] = {"PUT", "DELETE", "OPTIONS", "get", "GETX", "post", ""};
    char route[BST_VIEW_ROUTE_BYTES];
    bst_view_request r = right;
    for (size_t i = 0; i < sizeof methods / sizeof *methods; i++) {
        r.method = methods[i];
        assert_int_equal(guard(r, route), BST_HTTP_BAD_METHOD);
    }
    r = right;
    r.body_bytes = 1;
    assert_int_equal(guard(r, route), BST_HTTP_TOO_LARGE);
    r.method = "POST"; /* a form of a foreign page may lack an Origin */
    assert_int_equal(guard(r, route), BST_HTTP_FORBIDDEN);
    r.origin = "http://127.0.0.1:8080";
    r.origins = 1;
    assert_int_equal(guard(r, route), BST_HTTP_OK);
    r.body_bytes = BST_VIEW_BODY_BYTES;
    assert_int_equal(guard(r, route), BST_HTTP_OK);
    r.body_bytes = BST_VIEW_BODY_BYTES + 1;
    assert_int_equal(guard(r, route), BST_HTTP_TOO_LARGE);
    r.target = "/" TOKEN "/" BST_VIEW_FILE_ROUTE "?name=a.fits";
    r.body_bytes = BST_VIEW_FILE_BYTES;
    assert_int_equal(guard(r, route), BST_HTTP_OK);
    r.body_bytes = BST_VIEW_FILE_BYTES + 1;
    assert_int_equal(guard(r, route), BST_HTTP_TOO_LARGE);
    r.target = "/" TOKEN "/" BST_VIEW_FILE_ROUTE "s"; /* another route */
    r.body_bytes = BST_VIEW_BODY_BYTES + 1;
    assert_int_equal(guard(r, route), BST_HTTP_TOO_LARGE);
    r = right;
    r.method = NULL;
    assert_int_equal(guard(r, route), BST_HTTP_BAD_REQUEST);
    r = right;
    r.target = NULL;
    assert_int_equal(guard(r, route), BST_HTTP_BAD_REQUEST);
    r.target = "http://127.0.0.1:8080/" TOKEN "/";
    assert_int_equal(guard(r, route), BST_HTTP_BAD_REQUEST);
}

/* Random bytes behind the token never give a route with a character or a form that is not allowed,
 * and never one longer than its room (the sanitizers watch). */
static void test_random_targets(void **state) {
    (void)state;
    uint64_t seed = 20261127;
    char target[256], route[BST_VIEW_ROUTE_BYTES];
    static const char letters[] = "abz09_-./%?&=\\ \x01\xff..//";
    for (int trial = 0; trial < 20000; trial++) {
        size_t n = strlen(strcpy(target, "/" TOKEN "/"));
        seed = seed * 6364136223846793005u + 1442695040888963407u; /* Knuth's MMIX generator */
        size_t length = (seed >> 40) % 100;
        for (size_t i = 0; i < length; i++) {
            seed = seed * 6364136223846793005u + 1442695040888963407u;
            target[n++] = letters[(seed >> 33) % (sizeof letters - 1)];
        }
        target[n] = '\0';
        bst_view_request r = right;
        r.target = target;
        if (guard(r, route) == BST_HTTP_OK) {
            assert_null(strstr(route, ".."));
            assert_true(route[0] != '/' && !strpbrk(route, "%\\ \x01\xff?&="));
        }
    }
}

static void test_queries(void **state) {
    (void)state;
    int64_t n = -7;
    double x = -7.0;
    char word[8] = "old";
    assert_true(bst_view_query_int(NULL, "a", 0, 9, &n) && n == -7);
    assert_true(bst_view_query_int("b=1&c=2", "a", 0, 9, &n) && n == -7);
    assert_true(bst_view_query_int("aa=3&a=5&b=1", "a", 0, 9, &n) && n == 5);
    assert_true(bst_view_query_int("a=-2", "a", -5, 9, &n) && n == -2);
    static const char *const bad[] = {
        "a=",   "a=10",  "a=-1",  "a=1x",    "a= 1",
        "a=+1", "a=1.0", "a=0x1", "a=1&a=1", "a=99999999999999999999"};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        assert_false(bst_view_query_int(bad[i], "a", 0, 9, &n));
    }
    assert_int_equal(n, -2);
    assert_true(bst_view_query_real("a=-1.5e3", "a", &x) && x == -1500.0); /* exact in binary */
    static const char *const unreal[] = {"a=",      "a=nan", "a=inf",  "a=1e999",
                                         "a=0x1p3", "a=1 ",  "a=1&a=2"};
    for (size_t i = 0; i < sizeof unreal / sizeof *unreal; i++) {
        assert_false(bst_view_query_real(unreal[i], "a", &x));
    }
    assert_true(bst_view_query_word("b=x&a=snr_1", "a", word, sizeof word));
    assert_string_equal(word, "snr_1");
    static const char *const unread[] = {"a=",    "a=UPPER",    "a=a-b",
                                         "a=%41", "a=12345678", "a=x&a=x"};
    for (size_t i = 0; i < sizeof unread / sizeof *unread; i++) {
        assert_false(bst_view_query_word(unread[i], "a", word, sizeof word));
    }
    assert_string_equal(word, "snr_1");
    char longest[200] = "a=";
    memset(longest + 2, '1', sizeof longest - 3);
    assert_false(bst_view_query_int(longest, "a", 0, 9, &n));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_answered),       cmocka_unit_test(test_hosts),
        cmocka_unit_test(test_origins),        cmocka_unit_test(test_tokens),
        cmocka_unit_test(test_paths),          cmocka_unit_test(test_methods_and_bodies),
        cmocka_unit_test(test_random_targets), cmocka_unit_test(test_queries),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
