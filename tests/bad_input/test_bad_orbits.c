/* Orbit files that are wrong as files: OMM, OEM, injected states. What is wrong in their content,
 * field by field: tests/astro. */
#include "sim/astro/elements.h"
#include "sim/astro/oem.h"
#include "sim/astro/state_table.h"
#include "tests/bad_input/faults.h"

static bst_status read_elements(bst_ctx *ctx, const char *path) {
    bst_elements *sets = NULL;
    int count = 0;
    bst_status status = bst_elements_load(ctx, path, NULL, &sets, &count);
    assert_true((status == BST_OK) == (sets != NULL && count > 0));
    free(sets);
    return status;
}

static bst_status read_oem(bst_ctx *ctx, const char *path) {
    bst_oem *oem = NULL;
    bst_status status = bst_oem_load(ctx, path, &oem);
    assert_true((status == BST_OK) == (oem != NULL));
    bst_oem_free(oem);
    return status;
}

static bst_status read_injected(bst_ctx *ctx, const char *path) {
    bst_time epoch;
    bst_state_table *states = NULL;
    bst_assert_ok(ctx, bst_time_from_utc(ctx, "2022-06-16T22:10:00Z", &epoch));
    bst_status status = bst_state_table_load(ctx, path, epoch, &states);
    assert_true((status == BST_OK) == (states != NULL));
    bst_state_table_free(states);
    return status;
}

static const bad_reader elements = {
    read_elements, "a file of element sets (TLE, or OMM as JSON or CSV)", "", 256 << 20};
static const bad_reader oem = {read_oem, "an OEM file (CCSDS 502.0, KVN)", "", 256 << 20};
static const bad_reader injected = {read_injected, "a file of states per frame (CSV)", "",
                                    128 << 20};

static void paths(void **state) {
    (void)state;
    bad_paths(&elements);
    bad_paths(&oem);
    bad_paths(&injected);
}

static void encodings(void **state) {
    (void)state;
    const bad_reader *const readers[] = {&elements, &oem, &injected};
    static const char text[] = "CCSDS_OEM_VERS = 2.0\n";
    char wide[100];
    for (size_t i = 0; i < 3; i++) {
        for (int big = 0; big < 2; big++) {
            bad_bytes(readers[i], wide, bad_utf16(text, true, big, wide), BST_ERR_FORMAT,
                      ":1: the file is UTF-16 text (allowed: ASCII or UTF-8)");
            bad_bytes(readers[i], wide, bad_utf16(text, false, big, wide), BST_ERR_FORMAT,
                      ":1: a zero byte: the file is not text (allowed: ASCII or UTF-8)");
        }
    }
}

/* Every cut of a good file is refused with a message, but for those that leave whole records. */
static void truncations(const char *corpus, int most_accepted,
                        bst_status (*read)(bst_ctx *ctx, const char *data, size_t bytes)) {
    char whole[8192];
    FILE *file = fopen(corpus, "rb");
    assert_non_null(file);
    size_t bytes = fread(whole, 1, sizeof whole, file);
    fclose(file);
    assert_true(bytes > 0 && bytes < sizeof whole);
    int accepted = 0;
    for (size_t n = 0; n <= bytes; n++) {
        char *copy = malloc(n + 1); /* exact size, for the sanitizer */
        assert_non_null(copy);
        memcpy(copy, whole, n);
        bst_ctx ctx = {0};
        bst_status status = read(&ctx, copy, n);
        if (n == bytes) {
            bst_assert_ok(&ctx, status);
        } else if (status == BST_OK) {
            accepted++;
        } else {
            assert_memory_equal(ctx.message, "x:", 2);
        }
        free(copy);
    }
    if (accepted > most_accepted) {
        fail_msg("%s: %d truncations were taken, at most %d were expected", corpus, accepted,
                 most_accepted);
    }
}

static bst_status cut_elements(bst_ctx *ctx, const char *data, size_t bytes) {
    bst_elements *sets = NULL;
    int count = 0;
    bst_status status = bst_elements_read_buffer(ctx, "x", data, bytes, NULL, &sets, &count);
    free(sets);
    return status;
}

static bst_status cut_oem(bst_ctx *ctx, const char *data, size_t bytes) {
    bst_oem *file = NULL;
    bst_status status = bst_oem_read_buffer(ctx, "x", data, bytes, &file);
    bst_oem_free(file);
    return status;
}

static bst_status cut_injected(bst_ctx *ctx, const char *data, size_t bytes) {
    bst_time epoch;
    bst_state_table *file = NULL;
    bst_assert_ok(ctx, bst_time_from_utc(ctx, "2022-06-16T22:10:00Z", &epoch));
    bst_status status = bst_state_table_read_buffer(ctx, "x", data, bytes, epoch, &file);
    bst_state_table_free(file);
    return status;
}

static void every_truncation(void **state) {
    (void)state;
    truncations("tests/fuzz/corpus/elements/omm.json", 1, cut_elements);
    truncations("tests/fuzz/corpus/elements/omm.csv", 2, cut_elements);
    truncations("tests/fuzz/corpus/oem/hermite.oem", 40, cut_oem);
    truncations("tests/fuzz/corpus/injected/utc.csv", 8, cut_injected);
}

static void nested_ten_thousand_deep(void **state) {
    (void)state;
    enum { DEPTH = 10000 };
    char *text = malloc(DEPTH);
    assert_non_null(text);
    memset(text, '[', DEPTH);
    bad_bytes(&elements, text, DEPTH, BST_ERR_FORMAT,
              ":1:65: nested too deep (allowed: 64 levels)");
    free(text);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(paths),
        cmocka_unit_test(encodings),
        cmocka_unit_test(every_truncation),
        cmocka_unit_test(nested_ten_thousand_deep),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
