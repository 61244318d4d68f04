/* What a link saves of its parts: nothing where a peer plays them, the commands that wait where the
 * program itself does. */
#include "sim/link/link.h"
#include "tests/archive_support.h"

static bst_link *make_link(bst_ctx *ctx, bool local) {
    bst_link *link = NULL;
    int part;
    const bst_link_config config = {.address = "tcp://127.0.0.1:5555"};
    const bst_link_run run = {.scenario = "s", .tick_rate_hz = 6000};
    const bst_link_part about = {.instance = "o/s/imgproc", .role = "imgproc"};
    bst_assert_ok(ctx, local ? bst_link_create_local(ctx, &run, &link)
                             : bst_link_create(ctx, &config, &run, &link));
    bst_assert_ok(ctx, bst_link_add(ctx, link, &about, &part));
    return link;
}

static void a_peer_has_its_own_state(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_archive *archive;
    bst_link *link = make_link(&ctx, false);
    bst_assert_ok(&ctx, bst_archive_create(&ctx, &archive));
    assert_int_equal(bst_link_archive(link, 0, archive), BST_ERR_STATE);
    assert_non_null(strstr(ctx.message, "another program plays o/s/imgproc"));
    assert_non_null(strstr(ctx.message, "use a built-in type"));
    bst_archive_free(archive);
    bst_link_close(link, 0, "");
}

static void waiting_commands_come_back(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_archive *saved, *read;
    bst_link *link = make_link(&ctx, true), *other = make_link(&ctx, true);
    bst_detections *given = test_calloc(1, sizeof *given + 3 * sizeof *given->items);
    given->exposure_id = 41;
    given->count = 3;
    given->items[2].x_px = 12.5;
    bst_assert_ok(&ctx, bst_link_put(&ctx, link, "o/s", BST_LINK_DETECTIONS, given));
    bst_assert_ok(&ctx, bst_archive_create(&ctx, &saved));
    bst_assert_ok(&ctx, bst_archive_begin(&ctx, saved, "x"));
    bst_assert_ok(&ctx, bst_link_archive(link, 0, saved));
    bst_assert_ok(&ctx, bst_archive_end(&ctx, saved));
    size_t size;
    const void *bytes = bst_archive_data(saved, &size);
    bst_assert_ok(&ctx, bst_archive_open(&ctx, bytes, size, &read));
    bst_assert_ok(&ctx, bst_archive_begin(&ctx, read, "x"));
    bst_assert_ok(&ctx, bst_link_archive(other, 0, read));
    bst_assert_ok(&ctx, bst_archive_end(&ctx, read));
    /* both links answer the next step with it, and the one after with nothing */
    bst_link *both[] = {link, other};
    bst_detections *taken = test_calloc(1, sizeof *taken + 2 * sizeof *taken->items);
    for (int i = 0; i < 2; i++) {
        bool answered;
        /* room for two of the three items */
        bst_link_output output = {.type = BST_LINK_DETECTIONS, .payload = taken, .capacity = 2};
        const bst_link_messages messages = {.outputs = &output, .output_count = 1};
        bst_assert_ok(&ctx, bst_link_exchange(&ctx, both[i], 0, 5, &messages, &answered));
        assert_true(answered && output.given && output.dropped == 1);
        assert_int_equal(taken->exposure_id, 41);
        assert_int_equal(taken->count, 2);
        bst_assert_ok(&ctx, bst_link_exchange(&ctx, both[i], 0, 6, &messages, &answered));
        assert_false(output.given);
        memset(taken, 0, sizeof *taken);
    }
    test_free(taken);
    test_free(given);
    bst_archive_free(read);
    bst_archive_free(saved);
    bst_link_close(link, 0, "");
    bst_link_close(other, 0, "");
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(a_peer_has_its_own_state),
                                       cmocka_unit_test(waiting_commands_come_back)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
