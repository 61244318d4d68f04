/* Which of apt's sources are taken over, and as what. */
#define _XOPEN_SOURCE 700 /* mkdtemp */
#include "tests/test_support.h"

#include <stdlib.h>
#include <sys/stat.h>
#include <unistd.h>

#include "sim/catalogue/star_fetch.h"

typedef struct folder {
    char root[BST_TEST_PATH], parts[BST_TEST_PATH + 32];
} folder;

static folder make_folder(void) {
    folder f = {"", ""};
    bst_test_template(f.root, "bst_apt");
    assert_non_null(mkdtemp(f.root));
    snprintf(f.parts, sizeof f.parts, "%s/sources.list.d", f.root);
    assert_int_equal(mkdir(f.parts, 0700), 0);
    return f;
}

static void put(const char *in, const char *name, const char *text) {
    char path[512];
    snprintf(path, sizeof path, "%s/%s", in, name);
    FILE *f = fopen(path, "w");
    assert_non_null(f);
    assert_true(fputs(text, f) >= 0);
    assert_int_equal(fclose(f), 0);
}

static void drop(const char *in, const char *name) {
    char path[512];
    snprintf(path, sizeof path, "%s/%s", in, name);
    assert_int_equal(remove(path), 0);
}

static void convert(bst_ctx *ctx, const char *root, bst_status expected, int count, char *list,
                    char *sources, size_t bytes) {
    FILE *l = tmpfile(), *s = tmpfile();
    assert_non_null(l);
    assert_non_null(s);
    int n = -1;
    assert_int_equal(bst_star_fetch_sources(ctx, root, l, s, &n), expected);
    assert_int_equal(n, count);
    rewind(l);
    rewind(s);
    list[fread(list, 1, bytes - 1, l)] = '\0';
    sources[fread(sources, 1, bytes - 1, s)] = '\0';
    fclose(l);
    fclose(s);
}

static void test_both_formats(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    folder f = make_folder();
    char list[2048], sources[2048];
    put(f.root, "sources.list",
        "# deb http://mirror.example/debian bookworm main\n"
        "deb http://mirror.example/debian bookworm main contrib # a comment\n"
        "  deb [arch=amd64 signed-by=/usr/share/keyrings/debian-archive-keyring.gpg] "
        "http://cache.example/x bookworm-updates main\n"
        "deb [signed-by=/etc/apt/keyrings/other.gpg] http://other.example/debian bookworm main\n"
        "deb http://other.example/linux/debian bookworm stable\n"
        "deb cdrom:[Official]/ bookworm main\n");
    put(f.parts, "debian.sources",
        "# by the installer\n"
        "Types: deb\n"
        "URIs: http://mirror.example/debian\n"
        "Suites: bookworm\n"
        " bookworm-updates\n"
        "Components: main\n"
        "Signed-By: /usr/share/keyrings/debian-archive-keyring.gpg\n"
        "\n\n"
        "types:\n deb\n deb-src\n"
        "uris: http://mirror.example/debian-security\n"
        "suites: bookworm-security\n"
        "components: contrib main\n"
        "\n"
        "Enabled: no\n"
        "Types: deb\n"
        "URIs: http://off.example/debian\n"
        "Suites: sid\n"
        "Components: main\n"
        "\n"
        "Types: deb\n"
        "URIs: http://other.example/debian\n"
        "Suites: nodistro\n"
        "Components: main\n"
        "Signed-By:\n"
        " -----BEGIN PGP PUBLIC KEY BLOCK-----\n"
        " .\n"
        " -----END PGP PUBLIC KEY BLOCK-----\n");
    put(f.parts, "ignored.sources.save",
        "Types: deb\nURIs: http://x/debian\nSuites: a\nComponents: main\n");
    convert(&ctx, f.root, BST_OK, 4, list, sources, sizeof list);
    assert_string_equal(
        list,
        "deb-src http://mirror.example/debian bookworm main contrib \n"
        "deb-src [arch=amd64 signed-by=/usr/share/keyrings/debian-archive-keyring.gpg] "
        "http://cache.example/x bookworm-updates main\n");
    assert_string_equal(sources,
                        "Types: deb-src\n"
                        "URIs: http://mirror.example/debian\n"
                        "Suites: bookworm\n"
                        " bookworm-updates\n"
                        "Components: main\n"
                        "Signed-By: /usr/share/keyrings/debian-archive-keyring.gpg\n"
                        "\n"
                        "Types: deb-src\n"
                        "uris: http://mirror.example/debian-security\n"
                        "suites: bookworm-security\n"
                        "components: contrib main\n"
                        "\n");
    drop(f.root, "sources.list");
    drop(f.parts, "debian.sources");
    drop(f.parts, "ignored.sources.save");
    assert_int_equal(rmdir(f.parts), 0);
    assert_int_equal(rmdir(f.root), 0);
}

static void test_no_debian_source(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    folder f = make_folder();
    char list[64], sources[64], message[512];
    convert(&ctx, f.root, BST_ERR_NOT_FOUND, 0, list, sources, sizeof list);
    snprintf(message, sizeof message,
             "none of apt's sources in %s is Debian's: get tycho2_2.orig.tar.xz of Debian's source "
             "package tycho2 by hand and run `boresight stars import tycho2_2.orig.tar.xz`",
             f.root);
    assert_string_equal(ctx.message, message);
    assert_int_equal(rmdir(f.parts), 0);
    assert_int_equal(rmdir(f.root), 0);
}

static void test_verify(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    folder f = make_folder();
    char path[512], message[1024];
    put(f.root, "abc", "abc");
    snprintf(path, sizeof path, "%s/abc", f.root);
    /* FIPS 180-4, appendix of examples: SHA-256 of "abc". */
    const char *sum = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
    bst_assert_ok(&ctx, bst_star_fetch_verify(&ctx, path, sum));
    assert_int_equal(bst_star_fetch_verify(&ctx, path, BST_STAR_TARBALL_SHA256), BST_ERR_FORMAT);
    snprintf(message, sizeof message, "%s is damaged: SHA-256 %s, expected %s", path, sum,
             BST_STAR_TARBALL_SHA256);
    assert_string_equal(ctx.message, message);
    drop(f.root, "abc");
    assert_int_equal(bst_star_fetch_verify(&ctx, path, sum), BST_ERR_NOT_FOUND);
    assert_int_equal(rmdir(f.parts), 0);
    assert_int_equal(rmdir(f.root), 0);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_both_formats),
        cmocka_unit_test(test_no_debian_source),
        cmocka_unit_test(test_verify),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
