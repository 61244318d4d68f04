/* Peers that break off at any moment, in the middle of a frame or while the run ends: the
 * simulation outlives them. Argument: rounds. */
#include "tests/test_support.h"

#include <signal.h>
#include <sys/time.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "boresight/rng.h"
#include "sim/core/wall_clock.h"
#include "sim/link/link.h"

enum { SIDE = 2048, PIXELS = SIDE * SIDE };
static int rounds = 20;

/* Plays its part, slowly and not for long: an alarm ends the process wherever it is. */
static void play(const char *address, int end_us, int reads, int pause_us) {
    bst_ctx ctx = {0};
    bst_link_hello hello = {.name = "breaks", .serves = "*"};
    bst_link_peer *peer;
    bst_link_received got;
    const struct itimerval timer = {.it_value = {.tv_usec = end_us}};
    (void)setitimer(ITIMER_REAL, &timer, NULL);
    if (bst_link_peer_open(&ctx, address, NULL, &hello, &peer) != BST_OK) {
        _exit(1);
    }
    for (int i = 0; i < reads; i++) {
        if (bst_link_peer_receive(&ctx, peer, 1.0, &got) == BST_OK &&
            got.header.type == BST_LINK_STEP) {
            const bst_link_done done = {.outputs = 0};
            (void)!bst_link_peer_send(&ctx, peer, BST_LINK_DONE, &done, &got.header);
        }
        const struct timespec rest = {.tv_nsec = 1000L * pause_us};
        (void)nanosleep(&rest, NULL);
    }
    for (;;) { /* reads no more */
        pause();
    }
}

static void one_round(const char *folder, const uint16_t *pixels, int number) {
    bst_rng_key key = bst_rng_make_key(1, (uint64_t)number, "breaks", "round");
    double u[4];
    for (int i = 0; i < 4; i++) {
        u[i] = bst_rng_uniform(key, (uint64_t)i, 0);
    }
    char address[128];
    snprintf(address, sizeof address, "ipc://%.100s/socket", folder);
    int steps = 1 + (int)(4.0 * u[0]);
    pid_t child = fork(); /* this process has no threads between rounds */
    if (child == 0) {
        play(address, 1000 + (int)(60000.0 * u[1]), (int)(8.0 * u[2]), (int)(10000.0 * u[3]));
    }
    assert_true(child > 0);
    bst_ctx ctx = {0};
    bst_link_config config = {
        .timeout_s = 0.01, .connect_timeout_s = 0.05, .on_timeout = BST_LINK_GO_ON};
    snprintf(config.address, sizeof config.address, "%.127s", address);
    bst_link_run run = {.scenario = "breaks", .tick_rate_hz = 1000, .duration_ticks = 1000};
    bst_assert_ok(&ctx, bst_time_from_utc(&ctx, "2026-01-01T00:00:00Z", &run.epoch));
    bst_link *link;
    bst_link_part part = {.instance = "craft/camera/imgproc", .role = "imgproc"};
    int index;
    bst_assert_ok(&ctx, bst_link_create(&ctx, &config, &run, &link));
    bst_assert_ok(&ctx, bst_link_add(&ctx, link, &part, &index));
    double began = bst_wall_seconds();
    for (int i = 0; i < steps; i++) {
        const bst_link_frame frame = {.exposure_id = i,
                                      .window = {0, 0, SIDE, SIDE},
                                      .binning = 1,
                                      .bits = 16,
                                      .width = SIDE,
                                      .height = SIDE};
        const bst_link_input input = {.type = BST_LINK_FRAME,
                                      .payload = &frame,
                                      .tick = i,
                                      .pixels = pixels,
                                      .pixel_bytes = sizeof(uint16_t) * PIXELS};
        bool answered;
        const bst_link_messages messages = {&input, 1, NULL, 0};
        bst_assert_ok(&ctx, bst_link_exchange(&ctx, link, index, i, &messages, &answered));
    }
    bst_link_close(link, 0, "the round is over");
    assert_true(bst_wall_seconds() - began < 60.0); /* a hang, not a slow machine */
    kill(child, SIGKILL);
    waitpid(child, NULL, 0);
}

static void peers_break_off(void **state) {
    (void)state;
    char folder[BST_TEST_PATH];
    bst_test_template(folder, "boresight_breaks");
    assert_non_null(mkdtemp(folder));
    uint16_t *pixels = calloc(PIXELS, sizeof *pixels);
    assert_non_null(pixels);
    for (int i = 0; i < rounds; i++) {
        one_round(folder, pixels, i);
    }
    free(pixels);
    char path[BST_TEST_PATH + 16];
    snprintf(path, sizeof path, "%s/socket", folder);
    unlink(path);
    assert_int_equal(rmdir(folder), 0);
}

int main(int argc, char **argv) {
    rounds = argc > 1 ? atoi(argv[1]) : rounds;
    const struct CMUnitTest tests[] = {cmocka_unit_test(peers_break_off)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
