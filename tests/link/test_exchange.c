/* Steps with peers that are as they should be. */
#include "tests/link/link_scene.h"

#include "sim/core/wall_clock.h"

/* Sums the pixels of each frame and answers with a detection that holds the sum. */
static void serve(link_scene *s, const char *name, bool shared, int leave_after) {
    bst_ctx ctx = {0};
    bst_link_hello hello = {.serves = "imgproc", .shared_memory = shared};
    snprintf(hello.name, sizeof hello.name, "%s", name);
    bst_link_peer *peer = NULL;
    bst_link_received got;
    double sum = 0.0;
    bool by_slot = false;
    assert_int_equal(bst_link_peer_open(&ctx, s->address, NULL, &hello, &peer), BST_OK);
    while (bst_link_peer_receive(&ctx, peer, 5.0, &got) == BST_OK &&
           got.header.type != BST_LINK_END) {
        if (got.header.type == BST_LINK_FRAME) {
            sum = 0.0;
            by_slot = got.header.slot >= 0;
            for (int i = 0; i < SCENE_PIXELS; i++) {
                sum += got.pixels[i];
            }
        } else if (got.header.type == BST_LINK_STEP) {
            char utc[40]; /* of a tick of 1 ms, as the scene's epoch and rate are */
            snprintf(utc, sizeof utc, "2026-01-01T00:00:%02d.%03d000Z", (int)got.header.tick / 1000,
                     (int)got.header.tick % 1000);
            assert_string_equal(got.header.utc, utc);
            struct {
                bst_detections head;
                bst_detection items[2];
            } found;
            raw_detections(&found, 2);
            found.head.exposure_id = got.header.step;
            found.head.items[0].x_px = sum;
            found.head.items[1].x_px = by_slot;
            found.head.items[1].y_px = leave_after;
            bst_link_done done = {.outputs = 1};
            assert_int_equal(
                bst_link_peer_send(&ctx, peer, BST_LINK_DETECTIONS, &found, &got.header), BST_OK);
            assert_int_equal(bst_link_peer_send(&ctx, peer, BST_LINK_DONE, &done, &got.header),
                             BST_OK);
            if (--leave_after == 0) {
                bst_link_end end = {.reason = 3, .text = "enough"};
                assert_int_equal(bst_link_peer_send(&ctx, peer, BST_LINK_END, &end, NULL), BST_OK);
                break;
            }
        }
    }
    bst_link_peer_close(peer);
}

static void *by_socket(void *s) {
    serve(s, "socket", false, -1);
    return NULL;
}
static void *by_memory(void *s) {
    serve(s, "memory", true, -1);
    return NULL;
}
static void *three_then_another(void *s) {
    serve(s, "first", true, 3);
    serve(s, "second", false, -1);
    return NULL;
}

static void check_steps(link_scene *s, bool slot) {
    for (int i = 0; i < 20; i++) {
        s->pixels[i] = (uint16_t)(s->pixels[i] + 17 * i);
        double sum = 0.0;
        for (int k = 0; k < SCENE_PIXELS; k++) {
            sum += s->pixels[k];
        }
        bst_assert_ok(&s->ctx, scene_step(s));
        assert_true(s->answered && s->given);
        assert_int_equal(s->detections.head.count, 2);
        assert_int_equal(s->detections.head.exposure_id, i);
        bst_assert_close(s->detections.items[0].x_px, sum, 0.0); /* integers below 2^53 */
        bst_assert_close(s->detections.items[1].x_px, slot, 0.0);
    }
    const char *name;
    int64_t count;
    for (int i = 0; bst_link_counter(s->link, i, &name, &count); i++) {
        bool usual = strcmp(name, "link_messages") == 0 || strcmp(name, "link_hello") == 0 ||
                     strcmp(name, "link_connected") == 0;
        if (!usual) {
            assert_int_equal(count, 0);
        }
    }
    assert_int_equal(scene_count(s, "link_messages"), 41); /* hello, and two a step */
    assert_int_equal(scene_count(s, "link_connected"), 1);
}

static void frames_go_out_and_detections_come_in(void **state) {
    (void)state;
    for (int tcp = 0; tcp < 2; tcp++) {
        link_scene s;
        scene_open(&s, tcp, 10.0, BST_LINK_STOP, false);
        scene_start(&s, by_socket);
        check_steps(&s, false);
        scene_close(&s);
    }
}

static void frames_go_by_shared_memory_where_both_want_it(void **state) {
    (void)state;
    for (int offered = 0; offered < 2; offered++) {
        link_scene s;
        scene_open(&s, false, 10.0, BST_LINK_STOP, offered);
        scene_start(&s, by_memory);
        check_steps(&s, offered);
        scene_close(&s);
    }
    link_scene s;
    scene_open(&s, false, 10.0, BST_LINK_STOP, true);
    scene_start(&s, by_socket);
    check_steps(&s, false);
    scene_close(&s);
}

static void a_part_is_taken_up_by_the_next_peer(void **state) {
    (void)state;
    link_scene s;
    scene_open(&s, false, 10.0, BST_LINK_STOP, true);
    scene_start(&s, three_then_another);
    for (int i = 0; i < 8; i++) {
        bst_assert_ok(&s.ctx, scene_step(&s));
        assert_true(s.answered && s.given);
        bst_assert_close(s.detections.items[1].x_px, i < 3, 0.0);
    }
    /* `end`; and when the next step found it gone before that was read */
    assert_true(scene_count(&s, "link_left") >= 1);
    assert_int_equal(scene_count(&s, "link_hello"), 2);
    scene_close(&s);
}

static int held;
static void hold(void *owner) {
    __atomic_fetch_add((int *)owner, 1, __ATOMIC_SEQ_CST);
}
static void release(void *owner) {
    __atomic_fetch_sub((int *)owner, 1, __ATOMIC_SEQ_CST);
}

/* What is lent to ZeroMQ comes back, also from a peer that never reads. */
static void frames_that_were_lent_come_back(void **state) {
    (void)state;
    link_scene s;
    scene_open(&s, false, 0.05, BST_LINK_GO_ON, false);
    raw_peer raw;
    raw_open(&raw, s.address, "*");
    const bst_link_frame frame = {.width = 64, .height = 48, .binning = 1, .bits = 16};
    const bst_link_input input = {.type = BST_LINK_FRAME,
                                  .payload = &frame,
                                  .pixels = s.pixels,
                                  .pixel_bytes = sizeof s.pixels,
                                  .hold = hold,
                                  .release = release,
                                  .owner = &held};
    const bst_link_messages messages = {&input, 1, NULL, 0};
    bst_assert_ok(&s.ctx, bst_link_exchange(&s.ctx, s.link, s.part, 0, &messages, &s.answered));
    assert_false(s.answered);
    raw_close(&raw);
    scene_close(&s);
    assert_int_equal(held, 0);
}

static bool at_once(void *user) {
    ++*(int *)user;
    return true;
}

static void waiting_can_be_ended(void **state) {
    (void)state;
    link_scene s;
    int asked = 0;
    scene_open(&s, false, 60.0, BST_LINK_STOP, false);
    bst_link_on_wait(s.link, at_once, &asked);
    double began = bst_wall_seconds();
    assert_int_equal(scene_step(&s), BST_ERR_INTERRUPTED);
    assert_true(asked == 1 && bst_wall_seconds() - began < 30.0);
    scene_close(&s);
}

static void an_address_is_used_once(void **state) {
    (void)state;
    link_scene s, other;
    scene_open(&s, true, 1.0, BST_LINK_STOP, false);
    memset(&other, 0, sizeof other);
    bst_link_config config = {.timeout_s = 1.0, .connect_timeout_s = 1.0};
    snprintf(config.address, sizeof config.address, "%s", s.address);
    bst_link_run run = {.scenario = "other", .tick_rate_hz = 1000};
    bst_assert_ok(&s.ctx, bst_link_create(&s.ctx, &config, &run, &other.link));
    assert_int_equal(bst_link_open(&s.ctx, other.link), BST_ERR_IO);
    assert_non_null(strstr(s.ctx.message, "choose another port"));
    bst_link_close(other.link, 0, "");
    scene_close(&s);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(frames_go_out_and_detections_come_in),
        cmocka_unit_test(frames_go_by_shared_memory_where_both_want_it),
        cmocka_unit_test(a_part_is_taken_up_by_the_next_peer),
        cmocka_unit_test(frames_that_were_lent_come_back),
        cmocka_unit_test(waiting_can_be_ended),
        cmocka_unit_test(an_address_is_used_once),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
