/* Saves an object to memory and restores another one from it, for tests of archive functions. */
#ifndef BST_TESTS_ARCHIVE_SUPPORT_H
#define BST_TESTS_ARCHIVE_SUPPORT_H

#include <stdlib.h>
#include <string.h>

#include "sim/core/archive.h"
#include "tests/test_support.h"

/* As bst_module_desc.archive. */
typedef bst_status (*test_archive_fn)(void *self, bst_archive *archive);

/* A saved state; free `bytes`. */
typedef struct test_saved {
    unsigned char *bytes;
    size_t size;
} test_saved;

static inline test_saved test_save(test_archive_fn archive, void *self) {
    bst_ctx ctx = {0};
    bst_archive *saved;
    bst_assert_ok(&ctx, bst_archive_create(&ctx, &saved));
    bst_assert_ok(&ctx, bst_archive_begin(&ctx, saved, "it"));
    bst_assert_ok(&ctx, archive(self, saved));
    bst_assert_ok(&ctx, bst_archive_end(&ctx, saved));
    test_saved out;
    const void *bytes = bst_archive_data(saved, &out.size);
    out.bytes = malloc(out.size);
    assert_non_null(out.bytes);
    memcpy(out.bytes, bytes, out.size);
    bst_archive_free(saved);
    return out;
}

static inline bst_status test_restore(bst_ctx *ctx, test_archive_fn archive, void *self,
                                      test_saved saved) {
    bst_archive *read;
    bst_assert_ok(ctx, bst_archive_open(ctx, saved.bytes, saved.size, &read));
    bst_status status = bst_archive_begin(ctx, read, "it");
    if (status == BST_OK) {
        status = archive(self, read);
        bst_status end = bst_archive_end(ctx, read);
        status = status == BST_OK ? end : status;
    }
    bst_archive_free(read);
    return status;
}

/* Restores a state with each byte (or every `stride`-th) changed in three ways, and each shorter
 * one: that is an error or another state, never a crash. At last it restores the state itself. */
static inline void test_restore_damaged(test_archive_fn archive, void *self, test_saved saved,
                                        size_t stride) {
    static const unsigned char changes[] = {0xff, 0x80, 0x01};
    bst_ctx ctx = {0};
    int errors = 0, others = 0;
    test_saved copy = {malloc(saved.size), saved.size};
    assert_non_null(copy.bytes);
    for (size_t i = 0; i < saved.size; i += stride) {
        memcpy(copy.bytes, saved.bytes, saved.size);
        for (size_t c = 0; c < sizeof changes; c++) {
            copy.bytes[i] = saved.bytes[i] ^ changes[c];
            bst_status status = test_restore(&ctx, archive, self, copy);
            assert_true(status == BST_OK || status == BST_ERR_FORMAT);
            errors += status != BST_OK;
            others += status == BST_OK;
        }
        copy.bytes[i] = saved.bytes[i];
        test_saved cut = {copy.bytes, i};
        assert_int_equal(test_restore(&ctx, archive, self, cut), BST_ERR_FORMAT);
    }
    assert_true(errors > 0 && others > 0);
    free(copy.bytes);
    bst_assert_ok(&ctx, test_restore(&ctx, archive, self, saved));
}

#endif
