/* What a peer answered, recorded, and a run that is answered from there. */
#include "tests/link/link_scene.h"

#include <unistd.h>

enum { STEPS = 6 };

/* Answers each frame but the third, whose answer has no detections; with as many as the step's
 * number. */
static void *answer(void *scene) {
    link_scene *s = scene;
    bst_ctx ctx = {0};
    bst_link_hello hello = {.name = "peer", .serves = "imgproc"};
    bst_link_peer *peer = NULL;
    bst_link_received got;
    assert_int_equal(bst_link_peer_open(&ctx, s->address, NULL, &hello, &peer), BST_OK);
    while (bst_link_peer_receive(&ctx, peer, 5.0, &got) == BST_OK &&
           got.header.type != BST_LINK_END) {
        if (got.header.type != BST_LINK_STEP) {
            continue;
        }
        int count = (int)(got.header.tick / 100) % 5;
        struct {
            bst_detections head;
            bst_detection items[4];
        } found;
        raw_detections(&found, count);
        found.head.exposure_id = got.header.tick;
        found.head.background_e = 0.1 * (double)got.header.tick; /* no binary fraction */
        for (int i = 0; i < count; i++) {
            found.items[i].y_px = 7.7 * i;
        }
        bst_link_done done = {.outputs = count != 2};
        if (count != 2) {
            assert_int_equal(
                bst_link_peer_send(&ctx, peer, BST_LINK_DETECTIONS, &found, &got.header), BST_OK);
        }
        assert_int_equal(bst_link_peer_send(&ctx, peer, BST_LINK_DONE, &done, &got.header), BST_OK);
    }
    bst_link_peer_close(peer);
    return NULL;
}

static void check_answer(const link_scene *s, int i) {
    assert_true(s->answered);
    assert_true(s->given == (i % 5 != 2));
    if (s->given) {
        assert_int_equal(s->detections.head.exposure_id, 100 * i + 50);
        assert_int_equal(s->detections.head.count, i % 5);
        assert_true(s->detections.head.background_e == 0.1 * (100 * i + 50));
        for (int k = 0; k < i % 5; k++) {
            assert_true(s->detections.items[k].x_px == 1.5 + k);
            assert_true(s->detections.items[k].y_px == 7.7 * k);
        }
    }
}

static char recording[BST_TEST_PATH];

/* The recording of STEPS steps, with a frame of the camera's that is dropped before each odd one.
 */
static void record(void) {
    bst_test_template(recording, "boresight_packets");
    int fd = mkstemp(recording);
    assert_true(fd >= 0);
    close(fd);
    link_scene s;
    scene_open(&s, false, 10.0, BST_LINK_STOP, false);
    bst_assert_ok(&s.ctx, bst_link_record(&s.ctx, s.link, recording));
    assert_false(bst_link_replays(s.link));
    assert_int_equal(bst_link_record(&s.ctx, s.link, recording), BST_ERR_STATE);
    scene_start(&s, answer);
    for (int i = 0; i < STEPS; i++) {
        bool dropped = i % 2 == 1, said = dropped;
        bst_assert_ok(&s.ctx,
                      bst_link_keep_drop(&s.ctx, s.link, "craft/camera/exposure", 100 * i, &said));
        assert_true(said == dropped);
        bst_assert_ok(&s.ctx, scene_step(&s));
        check_answer(&s, i);
    }
    bst_assert_ok(&s.ctx, bst_link_record_end(&s.ctx, s.link));
    bst_assert_ok(&s.ctx, bst_link_record_end(&s.ctx, s.link)); /* nothing is left to do */
    scene_close(&s);
}

/* A link without a peer. */
static void open_replay(link_scene *s, const char *path) {
    memset(s, 0, sizeof *s);
    bst_link_config config = {.address = "ipc:///nowhere/at/all", .timeout_s = 0.1};
    bst_link_run run = {.scenario = "test",
                        .tick_rate_hz = 1000,
                        .duration_ticks = 100000,
                        .pixel_bytes = sizeof s->pixels};
    bst_link_part part = {.instance = "craft/camera/imgproc", .role = "imgproc", .width_px = 64};
    bst_assert_ok(&s->ctx, bst_link_create(&s->ctx, &config, &run, &s->link));
    bst_assert_ok(&s->ctx, bst_link_add(&s->ctx, s->link, &part, &s->part));
    bst_assert_ok(&s->ctx, bst_link_replay(&s->ctx, s->link, path));
    assert_true(bst_link_replays(s->link));
}

static bst_status replay_step(link_scene *s, int i) {
    bool dropped = false;
    bst_status status =
        bst_link_keep_drop(&s->ctx, s->link, "craft/camera/exposure", 100 * i, &dropped);
    if (status != BST_OK) {
        return status;
    }
    assert_true(dropped == (i % 2 == 1));
    return scene_step(s);
}

static void a_recording_answers_as_the_peer_did(void **state) {
    (void)state;
    record();
    link_scene s;
    open_replay(&s, recording);
    for (int i = 0; i < STEPS; i++) {
        bst_assert_ok(&s.ctx, replay_step(&s, i));
        check_answer(&s, i);
    }
    assert_int_equal(replay_step(&s, STEPS), BST_ERR_FORMAT);
    assert_non_null(strstr(s.ctx.message, "the recorded run was shorter"));
    bst_link_close(s.link, 0, "");
    /* asked another thing than then */
    open_replay(&s, recording);
    bst_assert_ok(&s.ctx, replay_step(&s, 0));
    assert_int_equal(scene_step(&s), BST_ERR_FORMAT); /* the camera's frame comes first */
    assert_non_null(strstr(s.ctx.message,
                           "craft/camera/exposure at tick 100, where this run asks "
                           "craft/camera/imgproc at tick 150"));
    bst_link_close(s.link, 0, "");
    open_replay(&s, recording);
    bst_assert_ok(&s.ctx, replay_step(&s, 0));
    assert_int_equal(replay_step(&s, 3), BST_ERR_FORMAT);
    assert_non_null(strstr(s.ctx.message, "packet 3 of"));
    bst_link_close(s.link, 0, "");
    unlink(recording);
}

static void damage(long at, int cut) {
    FILE *f = fopen(recording, "rb+");
    assert_non_null(f);
    if (cut) {
        assert_int_equal(ftruncate(fileno(f), at), 0);
    } else {
        fseek(f, at, SEEK_SET);
        int c = fgetc(f);
        fseek(f, at, SEEK_SET);
        fputc(c ^ 0x55, f);
    }
    fclose(f);
}

static void damaged_recordings_are_refused(void **state) {
    (void)state;
    record();
    FILE *f = fopen(recording, "rb");
    unsigned char ahead[8];
    assert_int_equal(fread(ahead, 1, 8, f), 8);
    fseek(f, 0, SEEK_END);
    long whole = ftell(f);
    fclose(f);
    long header = ahead[0] + 256L * ahead[1], payload = ahead[4] + 256L * ahead[5];
    assert_true(header > 50 && payload > 0 && 8 + header + payload < whole);
    link_scene s;
    damage(8 + header, 0); /* the first payload's first byte */
    open_replay(&s, recording);
    assert_int_equal(replay_step(&s, 0), BST_ERR_FORMAT);
    assert_non_null(strstr(s.ctx.message, "packet 0"));
    bst_link_close(s.link, 0, "");
    damage(8 + header, 0); /* back again; then a length of gigabytes */
    damage(7, 0);
    open_replay(&s, recording);
    assert_int_equal(replay_step(&s, 0), BST_ERR_FORMAT);
    assert_non_null(strstr(s.ctx.message, "is damaged behind packet 0"));
    bst_link_close(s.link, 0, "");
    damage(7, 0);
    damage(whole - 1, 1);
    open_replay(&s, recording);
    for (int i = 0; i < STEPS - 1; i++) {
        bst_assert_ok(&s.ctx, replay_step(&s, i));
    }
    assert_int_equal(replay_step(&s, STEPS - 1), BST_ERR_FORMAT);
    assert_non_null(strstr(s.ctx.message, "its file is cut"));
    bst_link_close(s.link, 0, "");
    unlink(recording);
    bst_link_config config = {.address = "ipc:///nowhere/at/all"};
    bst_link_run run = {.scenario = "test", .tick_rate_hz = 1000};
    bst_assert_ok(&s.ctx, bst_link_create(&s.ctx, &config, &run, &s.link));
    assert_int_equal(bst_link_replay(&s.ctx, s.link, recording), BST_ERR_NOT_FOUND);
    assert_non_null(strstr(s.ctx.message, "only a run with modules of type \"external\" has it"));
    assert_int_equal(bst_link_record(&s.ctx, s.link, "/nowhere/at/all"), BST_ERR_IO);
    assert_false(bst_link_replays(s.link));
    bst_link_close(s.link, 0, "");
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_recording_answers_as_the_peer_did),
        cmocka_unit_test(damaged_recordings_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
