/* SHA-256 against the examples of FIPS 180-2, appendix B, and lengths about the padding's ends. */
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include "sim/core/sha256.h"
#include "tests/test_support.h"

static void known_digests(void **state) {
    (void)state;
    char text[BST_SHA256_TEXT];
    bst_sha256_text("", 0, text);
    assert_string_equal(text, "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
    bst_sha256_text("abc", 3, text);
    assert_string_equal(text, "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
    const char *two = "abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq";
    bst_sha256_text(two, strlen(two), text);
    assert_string_equal(text, "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
    char *million = malloc(1000000);
    assert_non_null(million);
    memset(million, 'a', 1000000);
    bst_sha256_text(million, 1000000, text);
    assert_string_equal(text, "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
    free(million);
}

/* 55 bytes still take their length into the same block, 56 do not; of coreutils' sha256sum. */
static void lengths_about_a_block(void **state) {
    (void)state;
    char zeros[64] = {0}, text[BST_SHA256_TEXT];
    bst_sha256_text(zeros, 55, text);
    assert_string_equal(text, "02779466cdec163811d078815c633f21901413081449002f24aa3e80f0b88ef7");
    bst_sha256_text(zeros, 56, text);
    assert_string_equal(text, "d4817aa5497628e7c77e6b606107042bbba3130888c5f47a375e6179be789fbb");
    bst_sha256_text(zeros, 64, text);
    assert_string_equal(text, "f5a5fd42d16a20302798ef6ed309979b43003d2320d9f0e8ea9831a92759fb4b");
}

static void files(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    char path[] = "/tmp/boresight-sha256-XXXXXX", text[BST_SHA256_TEXT];
    int fd = mkstemp(path);
    assert_true(fd >= 0);
    assert_int_equal(write(fd, "abc", 3), 3);
    close(fd);
    bst_assert_ok(&ctx, bst_sha256_file(&ctx, path, text));
    assert_string_equal(text, "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
    unlink(path);
    assert_int_equal(bst_sha256_file(&ctx, path, text), BST_ERR_NOT_FOUND);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(known_digests),
        cmocka_unit_test(lengths_about_a_block),
        cmocka_unit_test(files),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
