/* A pending exposure comes back from its saved state; damaged ones are refused. */
#include "obsgen/pending_exposure.h"
#include "tests/archive_support.h"

enum { SOURCES = 40, STEPS = 17, GHOSTS = 3 };

static bst_status archive_pending(void *pending, bst_archive *archive) {
    return bst_obsgen_pending_archive(pending, GHOSTS, archive);
}

static bst_obsgen_pending make(bst_ctx *ctx, bool own_response) {
    bst_obsgen_pending p = {.exposure_id = 5, .sigma_px = 0.85, .own_response = own_response};
    bst_assert_ok(ctx, bst_obsgen_pending_reserve(ctx, &p, SOURCES));
    memset(p.truth, 0, sizeof *p.truth);
    p.truth->exposure_id = 5;
    p.truth->background_e = 3.5;
    p.truth->count = SOURCES;
    for (int i = 0; i < SOURCES; i++) {
        p.truth->items[i] = (bst_truth_item){.id = (uint32_t)i, .electrons = 100.0 * i};
        p.ghost[i] = i % (GHOSTS + 1) - 1;
    }
    bst_assert_ok(ctx, bst_obsgen_pending_reserve_path(ctx, &p, STEPS));
    p.path_count = STEPS;
    for (int i = 0; i < STEPS; i++) {
        p.path_x_px[i] = 0.1 * i;
        p.path_y_px[i] = -0.2 * i;
    }
    if (own_response) {
        p.response.falloff_scale = 0.9;
        p.response.falloff.value[7] = 0.25f;
        bst_crlb_table_init(&p.image_bound, 0.8);
        bst_crlb_table_init(&p.onboard_bound, 0.9);
    }
    return p;
}

static void comes_back(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    for (int own = 0; own < 2; own++) {
        bst_obsgen_pending p = make(&ctx, own), q = {.exposure_id = -1};
        test_saved saved = test_save(archive_pending, &p);
        bst_assert_ok(&ctx, test_restore(&ctx, archive_pending, &q, saved));
        assert_int_equal(q.exposure_id, 5);
        assert_true(q.sigma_px == 0.85 && q.own_response == own);
        assert_int_equal(q.path_count, STEPS);
        assert_memory_equal(q.truth, p.truth, sizeof *p.truth + SOURCES * sizeof p.truth->items[0]);
        assert_memory_equal(q.ghost, p.ghost, SOURCES * sizeof *p.ghost);
        assert_memory_equal(q.path_x_px, p.path_x_px, STEPS * sizeof *p.path_x_px);
        assert_memory_equal(q.path_y_px, p.path_y_px, STEPS * sizeof *p.path_y_px);
        if (own) {
            assert_memory_equal(&q.response, &p.response, sizeof p.response);
            assert_memory_equal(&q.image_bound, &p.image_bound, sizeof p.image_bound);
            assert_memory_equal(&q.onboard_bound, &p.onboard_bound, sizeof p.onboard_bound);
        }
        free(saved.bytes);
        bst_obsgen_pending_free(&p);
        bst_obsgen_pending_free(&q);
    }
}

/* A camera of one ghost, as after an edit of a live run. */
static bst_status archive_with_one_ghost(void *pending, bst_archive *archive) {
    return bst_obsgen_pending_archive(pending, 1, archive);
}

/* Ghosts that the camera no longer has give no light; all else comes back. */
static void ghosts_that_are_gone(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_obsgen_pending p = make(&ctx, false), q = {.exposure_id = -1};
    test_saved saved = test_save(archive_pending, &p);
    bst_assert_ok(&ctx, test_restore(&ctx, archive_with_one_ghost, &q, saved));
    assert_int_equal(q.truth->count, SOURCES);
    for (int i = 0; i < SOURCES; i++) {
        const bool gone = p.ghost[i] > 0;
        assert_int_equal(q.ghost[i], gone ? -1 : p.ghost[i]);
        assert_true(q.truth->items[i].electrons == (gone ? 0.0 : p.truth->items[i].electrons));
    }
    assert_int_equal(q.path_count, STEPS);
    free(saved.bytes);
    bst_obsgen_pending_free(&p);
    bst_obsgen_pending_free(&q);
}

/* None is waiting: nothing else is saved, and what another exposure left does not matter. */
static void none(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_obsgen_pending p = {.exposure_id = -1}, q = make(&ctx, false);
    test_saved saved = test_save(archive_pending, &p);
    bst_assert_ok(&ctx, test_restore(&ctx, archive_pending, &q, saved));
    assert_int_equal(q.exposure_id, -1);
    free(saved.bytes);
    bst_obsgen_pending_free(&q);
}

static void damage_is_refused(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_obsgen_pending p = make(&ctx, true), q = {.exposure_id = -1};
    test_saved saved = test_save(archive_pending, &p);
    test_restore_damaged(archive_pending, &q, saved, 1);
    /* the header's number of sources alone: nothing is allocated for it */
    size_t at = saved.size;
    for (size_t i = 0; i + sizeof(bst_truth) <= saved.size && at == saved.size; i++) {
        at = memcmp(saved.bytes + i, p.truth, sizeof(bst_truth)) == 0 ? i : at;
    }
    assert_true(at < saved.size);
    const int32_t many = 1 << 30;
    memcpy(saved.bytes + at + offsetof(bst_truth, count), &many, sizeof many);
    assert_int_equal(test_restore(&ctx, archive_pending, &q, saved), BST_ERR_FORMAT);
    assert_true(q.room < 1000);
    free(saved.bytes);
    bst_obsgen_pending_free(&p);
    bst_obsgen_pending_free(&q);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(comes_back),
        cmocka_unit_test(ghosts_that_are_gone),
        cmocka_unit_test(none),
        cmocka_unit_test(damage_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
