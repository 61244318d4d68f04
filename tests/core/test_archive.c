/* Archives: what is saved comes back; damaged, foreign and short ones are errors. */
#include <string.h>

#include "sim/core/archive.h"
#include "tests/test_support.h"

typedef struct motor {
    double angle_rad;
    int count;
    float items[8];
} motor;

/* One function for both directions, as modules have. */
static void archive_motor(bst_archive *archive, motor *m) {
    BST_ARCHIVE(archive, m->angle_rad);
    m->count = bst_archive_count(archive, m->count, 8);
    bst_archive_bytes(archive, m->items, (size_t)m->count * sizeof *m->items);
}

static void save_two(bst_ctx *ctx, bst_archive *archive) {
    motor a = {0.1, 3, {1.0f, 2.0f, 3.0f}}, b = {-7.0, 0, {0.0f}};
    assert_int_equal(bst_archive_begin(ctx, archive, "a"), BST_OK);
    archive_motor(archive, &a);
    assert_int_equal(bst_archive_end(ctx, archive), BST_OK);
    assert_int_equal(bst_archive_begin(ctx, archive, "b"), BST_OK);
    archive_motor(archive, &b);
    assert_int_equal(bst_archive_end(ctx, archive), BST_OK);
}

static void comes_back(void **state) {
    (void)state;
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    bst_archive *saved, *read;
    assert_int_equal(bst_archive_create(&ctx, &saved), BST_OK);
    save_two(&ctx, saved);
    size_t size;
    const void *bytes = bst_archive_data(saved, &size);
    assert_int_equal(bst_archive_open(&ctx, bytes, size, &read), BST_OK);
    assert_true(bst_archive_is_restoring(read) && !bst_archive_is_restoring(saved));
    motor m = {5.0, 1, {9.0f}};
    assert_int_equal(bst_archive_begin(&ctx, read, "a"), BST_OK);
    archive_motor(read, &m);
    assert_int_equal(bst_archive_end(&ctx, read), BST_OK);
    assert_true(m.angle_rad == 0.1 && m.count == 3 && m.items[2] == 3.0f);
    assert_int_equal(bst_archive_skip(&ctx, read, "b"), BST_OK);
    /* no third record */
    assert_int_equal(bst_archive_begin(&ctx, read, "c"), BST_ERR_FORMAT);
    bst_archive_free(read);
    bst_archive_free(saved);
}

static void foreign_records_are_refused(void **state) {
    (void)state;
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    bst_archive *saved, *read;
    assert_int_equal(bst_archive_create(&ctx, &saved), BST_OK);
    save_two(&ctx, saved);
    size_t size;
    const void *bytes = bst_archive_data(saved, &size);
    motor m = {0.0, 0, {0.0f}};
    /* another name */
    assert_int_equal(bst_archive_open(&ctx, bytes, size, &read), BST_OK);
    assert_int_equal(bst_archive_begin(&ctx, read, "x"), BST_ERR_FORMAT);
    assert_non_null(strstr(ctx.message, "\"a\""));
    bst_archive_free(read);
    /* read only in part */
    assert_int_equal(bst_archive_open(&ctx, bytes, size, &read), BST_OK);
    assert_int_equal(bst_archive_begin(&ctx, read, "a"), BST_OK);
    BST_ARCHIVE(read, m.angle_rad);
    assert_int_equal(bst_archive_end(&ctx, read), BST_ERR_FORMAT);
    bst_archive_free(read);
    /* read beyond its end: zeros, never the next record */
    assert_int_equal(bst_archive_open(&ctx, bytes, size, &read), BST_OK);
    assert_int_equal(bst_archive_begin(&ctx, read, "a"), BST_OK);
    archive_motor(read, &m);
    double beyond = 1.0;
    BST_ARCHIVE(read, beyond);
    assert_true(beyond == 0.0);
    assert_int_equal(bst_archive_end(&ctx, read), BST_ERR_FORMAT);
    bst_archive_free(read);
    /* more items than there is room for */
    assert_int_equal(bst_archive_open(&ctx, bytes, size, &read), BST_OK);
    assert_int_equal(bst_archive_begin(&ctx, read, "a"), BST_OK);
    BST_ARCHIVE(read, m.angle_rad);
    assert_int_equal(bst_archive_count(read, 0, 2), 0);
    assert_int_equal(bst_archive_end(&ctx, read), BST_ERR_FORMAT);
    assert_non_null(strstr(ctx.message, "the number 3 where 0 to 2"));
    bst_archive_free(read);
    bst_archive_free(saved);
}

/* Every truncation and every changed byte of the heads is an error or other data, never a crash. */
static void damage_is_an_error(void **state) {
    (void)state;
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    bst_archive *saved, *read;
    assert_int_equal(bst_archive_create(&ctx, &saved), BST_OK);
    save_two(&ctx, saved);
    size_t size;
    const unsigned char *bytes = bst_archive_data(saved, &size);
    unsigned char copy[512];
    assert_true(size <= sizeof copy);
    for (size_t cut = 0; cut < size; cut++) {
        for (int flip = 0; flip < 2; flip++) {
            memcpy(copy, bytes, size);
            copy[cut] ^= flip ? 0xff : 0;
            motor m = {0.0, 0, {0.0f}};
            assert_int_equal(bst_archive_open(&ctx, copy, flip ? size : cut, &read), BST_OK);
            bst_status status = bst_archive_begin(&ctx, read, "a");
            if (status == BST_OK) {
                archive_motor(read, &m);
                status = bst_archive_end(&ctx, read);
            }
            if (status == BST_OK) {
                status = bst_archive_skip(&ctx, read, "b");
            }
            assert_true(flip || status == BST_ERR_FORMAT);
            assert_in_range(m.count, 0, 8);
            bst_archive_free(read);
        }
    }
    bst_archive_free(saved);
}

/* Flags come back as true or false, and integers within their limits. */
static void flags_and_integers(void **state) {
    (void)state;
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    bst_archive *saved, *read;
    bool flag = true, other = false;
    assert_int_equal(bst_archive_create(&ctx, &saved), BST_OK);
    assert_int_equal(bst_archive_begin(&ctx, saved, "a"), BST_OK);
    bst_archive_bool(saved, &flag);
    bst_archive_bool(saved, &other);
    assert_int_equal(bst_archive_integer(saved, -5, -9, 7), -5);
    unsigned char damaged = 0x5a;
    BST_ARCHIVE(saved, damaged);
    assert_int_equal(bst_archive_integer(saved, INT64_MAX, 0, INT64_MAX), INT64_MAX);
    assert_int_equal(bst_archive_end(&ctx, saved), BST_OK);
    size_t size;
    const void *bytes = bst_archive_data(saved, &size);
    assert_int_equal(bst_archive_open(&ctx, bytes, size, &read), BST_OK);
    assert_int_equal(bst_archive_begin(&ctx, read, "a"), BST_OK);
    flag = false;
    other = true;
    bst_archive_bool(read, &flag);
    bst_archive_bool(read, &other);
    assert_true(flag && !other);
    assert_int_equal(bst_archive_integer(read, 0, -9, 7), -5);
    flag = false;
    bst_archive_bool(read, &flag);
    assert_true(flag); /* not 0x5a */
    /* the least value takes the place of one that is out of range */
    assert_int_equal(bst_archive_integer(read, 0, 3, 100), 3);
    assert_int_equal(bst_archive_end(&ctx, read), BST_ERR_FORMAT);
    assert_non_null(strstr(ctx.message, "9223372036854775807 where 3 to 100"));
    bst_archive_free(read);
    bst_archive_free(saved);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(comes_back),
        cmocka_unit_test(foreign_records_are_refused),
        cmocka_unit_test(damage_is_an_error),
        cmocka_unit_test(flags_and_integers),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
