/* Messages of a WebSocket client: heads of frames, what is refused before its content comes, and
 * the bounds of time. */
#include <arpa/inet.h>
#include <pthread.h>
#include <stdlib.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include "sim/core/wall_clock.h"
#include "tests/test_support.h"
#include "view/socket_frames.h"

static const unsigned char mask[4] = {0x12, 0x34, 0x56, 0x78};

/* Writes a masked frame as a client does; returns its bytes. */
static size_t frame(unsigned char first, const void *content, size_t bytes, unsigned char *out) {
    const size_t head = bst_view_write_head(first & 0x0f, bytes, out);
    out[0] = first;
    out[1] |= 0x80;
    memcpy(out + head, mask, sizeof mask);
    for (size_t i = 0; i < bytes; i++) {
        out[head + 4 + i] = ((const unsigned char *)content)[i] ^ mask[i % 4];
    }
    return head + 4 + bytes;
}

static void heads_are_read_as_they_are_written(void **state) {
    (void)state;
    static const size_t sizes[] = {0, 1, 125, 126, 127, 8191, 8192};
    static unsigned char content[BST_VIEW_CONTENT_BYTES], out[16384];
    for (size_t i = 0; i < sizeof content; i++) {
        content[i] = (unsigned char)(i * 7);
    }
    for (size_t k = 0; k < sizeof sizes / sizeof *sizes; k++) {
        const size_t bytes = frame(0x81, content, sizes[k], out);
        for (size_t part = 0; part < bytes; part++) { /* it comes in pieces */
            const bst_view_frame_head head = bst_view_read_head(out, part);
            assert_false(head.complete);
            assert_int_equal(head.close, BST_VIEW_CLOSE_NOT);
        }
        const bst_view_frame_head head = bst_view_read_head(out, bytes);
        assert_true(head.complete);
        assert_int_equal(head.opcode, BST_VIEW_TEXT);
        assert_int_equal(head.content_bytes, sizes[k]);
        bst_view_unmask(&head, out + head.head_bytes);
        assert_memory_equal(out + head.head_bytes, content, sizes[k]);
    }
    /* the lengths of the standard's examples (RFC 6455, section 5.7) */
    assert_int_equal(bst_view_write_head(BST_VIEW_BINARY, 256, out), 4);
    assert_memory_equal(out, "\x82\x7e\x01\x00", 4);
    assert_int_equal(bst_view_write_head(BST_VIEW_BINARY, 65536, out), 10);
    assert_memory_equal(out, "\x82\x7f\x00\x00\x00\x00\x00\x01\x00\x00", 10);
}

static void a_head_alone_is_refused(void **state) {
    (void)state;
    static const struct {
        const char *bytes;
        size_t count;
        bst_view_close_code close;
    } cases[] = {
        {"\x81\x05", 2, BST_VIEW_CLOSE_MALFORMED},                        /* not masked */
        {"\xc1\x85", 2, BST_VIEW_CLOSE_MALFORMED},                        /* reserved bit */
        {"\x89\xfe", 2, BST_VIEW_CLOSE_MALFORMED},                        /* a long ping */
        {"\x09\x80", 2, BST_VIEW_CLOSE_MALFORMED},                        /* a ping in fragments */
        {"\x01\x85", 2, BST_VIEW_CLOSE_UNSUPPORTED},                      /* fragments */
        {"\x80\x85", 2, BST_VIEW_CLOSE_UNSUPPORTED},                      /* the end of some */
        {"\x82\x85", 2, BST_VIEW_CLOSE_UNSUPPORTED},                      /* binary */
        {"\x83\x85", 2, BST_VIEW_CLOSE_UNSUPPORTED},                      /* unknown */
        {"\x81\xfe\x20\x01", 4, BST_VIEW_CLOSE_TOO_BIG},                  /* 8193 bytes */
        {"\x81\xff\0\0\0\0\x7f\xff\xff\xff", 10, BST_VIEW_CLOSE_TOO_BIG}, /* 2 GB */
        {"\x81\xff\xff\xff\xff\xff\xff\xff\xff\xff", 10, BST_VIEW_CLOSE_TOO_BIG},
    };
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        const bst_view_frame_head head =
            bst_view_read_head((const unsigned char *)cases[k].bytes, cases[k].count);
        assert_int_equal(head.close, cases[k].close);
        assert_false(head.complete);
    }
}

static bool stopped;

/* A client's end and the server's. */
static bst_view_peer connect_pair(int *client) {
    int ends[2];
    assert_int_equal(socketpair(AF_UNIX, SOCK_STREAM, 0, ends), 0);
    *client = ends[1];
    return (bst_view_peer){.fd = ends[0],
                           .stopped = &stopped,
                           .first_s = 0.2,
                           .idle_s = 0.2,
                           .frame_s = 0.1,
                           .send_s = 0.1,
                           .least_rate = 1e6};
}

static void disconnect(const bst_view_peer *peer, int client) {
    close(peer->fd);
    close(client);
}

static void texts_are_handed_over_and_pings_answered(void **state) {
    (void)state;
    int client;
    bst_view_peer peer = connect_pair(&client);
    unsigned char out[256], back[16];
    const char *text;
    size_t n = frame(0x81, "one", 3, out), bytes;
    n += frame(0x89, "abc", 3, out + n); /* between two texts, in one write */
    n += frame(0x8a, "", 0, out + n);
    n += frame(0x81, "second", 6, out + n);
    n += frame(0x88, "", 0, out + n);
    assert_int_equal(write(client, out, n), n);
    assert_true(bst_view_next_text(&peer, &text, &bytes));
    assert_int_equal(bytes, 3);
    assert_memory_equal(text, "one", 3);
    assert_true(bst_view_next_text(&peer, &text, &bytes));
    assert_int_equal(bytes, 6);
    assert_memory_equal(text, "second", 6);
    assert_int_equal(read(client, back, 5), 5);
    assert_memory_equal(back,
                        "\x8a\x03"
                        "abc",
                        5);
    assert_false(bst_view_next_text(&peer, &text, &bytes));
    assert_int_equal(read(client, back, 4), 4);
    assert_memory_equal(back, "\x88\x02\x03\xe8", 4); /* 1000 */
    disconnect(&peer, client);
}

/* What a client sends before it waits, for how long it may at least, s, and the code that it gets;
 * 0: none. */
static void expect_end(const void *data, size_t count, double least_s, int code) {
    int client;
    bst_view_peer peer = connect_pair(&client);
    const char *text;
    size_t bytes;
    unsigned char back[8];
    assert_int_equal(write(client, data, count), count);
    const double begin = bst_wall_seconds();
    assert_false(bst_view_next_text(&peer, &text, &bytes));
    assert_true(bst_wall_seconds() - begin >= least_s);
    if (code) {
        assert_int_equal(read(client, back, 4), 4);
        assert_int_equal(back[2] << 8 | back[3], code);
    }
    disconnect(&peer, client);
}

static void half_a_frame_ends_the_connection(void **state) {
    (void)state;
    expect_end("", 0, 0.2, 0);                   /* nothing */
    expect_end("\x81", 1, 0.1, 0);               /* half a head */
    expect_end("\x81\x85\1\2\3\4he", 8, 0.1, 0); /* half a text */
    expect_end("\x81\xff\0\0\0\0\x7f\xff\xff\xff", 10, 0.0, 1009);
    expect_end("\x81\x05hello", 7, 0.0, 1002);
}

/* Each silence has a limit of its own: before the first frame, between two, within one. */
static void silences_of_three_lengths(void **state) {
    (void)state;
    const double limit_s[3] = {1.2, 0.6, 0.05}; /* far apart: other programs delay this one */
    unsigned char out[64];
    for (int k = 0; k < 3; k++) {
        int client;
        bst_view_peer peer = connect_pair(&client);
        peer.first_s = limit_s[0];
        peer.idle_s = limit_s[1];
        peer.frame_s = limit_s[2];
        const char *text;
        size_t bytes, n = k > 0 ? frame(0x81, "one", 3, out) : 0;
        assert_int_equal(write(client, out, n), n);
        assert_true(k == 0 || bst_view_next_text(&peer, &text, &bytes));
        assert_int_equal(write(client, out, k == 2), k == 2);
        const double begin = bst_wall_seconds();
        assert_false(bst_view_next_text(&peer, &text, &bytes));
        const double waited = bst_wall_seconds() - begin;
        assert_true(waited >= limit_s[k] - 1e-3 && (k == 0 || waited < limit_s[k - 1]));
        disconnect(&peer, client);
    }
}

/* Sends a byte of a long frame each 20 ms. */
static void *drip(void *user) {
    const int fd = *(const int *)user;
    static const unsigned char head[4] = {0x81, 0xfe, 0x10, 0x00};
    for (size_t i = 0; i < 1000 && send(fd, i < 4 ? &head[i] : mask, 1, MSG_NOSIGNAL) == 1; i++) {
        nanosleep(&(struct timespec){.tv_nsec = 20000000}, NULL);
    }
    return NULL;
}

static void a_slow_frame_ends_the_connection(void **state) {
    (void)state;
    int client;
    pthread_t thread;
    bst_view_peer peer = connect_pair(&client);
    const char *text;
    size_t bytes;
    assert_int_equal(pthread_create(&thread, NULL, drip, &client), 0);
    assert_false(bst_view_next_text(&peer, &text, &bytes));
    assert_true(peer.bytes > 0 && peer.bytes < 900); /* long before it was complete */
    shutdown(peer.fd, SHUT_RDWR);
    pthread_join(thread, NULL);
    disconnect(&peer, client);
}

static void who_takes_nothing_is_given_up(void **state) {
    (void)state;
    int client;
    bst_view_peer peer = connect_pair(&client);
    const size_t bytes = (size_t)4 << 20;
    void *content = calloc(1, bytes);
    assert_false(bst_view_send_frame(&peer, BST_VIEW_BINARY, content, bytes));
    free(content);
    disconnect(&peer, client);
    peer = connect_pair(&client);
    stopped = true;
    const char *text;
    size_t count;
    assert_false(bst_view_next_text(&peer, &text, &count)); /* the server ends */
    stopped = false;
    disconnect(&peer, client);
}

static void sockets_are_found_by_their_ports(void **state) {
    (void)state;
    struct sockaddr_in own = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)},
                       far = own;
    socklen_t length = sizeof own;
    const int listener = socket(AF_INET, SOCK_STREAM, 0), client = socket(AF_INET, SOCK_STREAM, 0);
    assert_int_equal(bind(listener, (struct sockaddr *)&own, sizeof own), 0);
    assert_int_equal(listen(listener, 1), 0);
    assert_int_equal(getsockname(listener, (struct sockaddr *)&own, &length), 0);
    assert_int_equal(connect(client, (struct sockaddr *)&own, sizeof own), 0);
    const int accepted = accept(listener, NULL, NULL);
    length = sizeof far;
    assert_int_equal(getsockname(client, (struct sockaddr *)&far, &length), 0);
    const int port = ntohs(own.sin_port), peer = ntohs(far.sin_port);
    assert_int_equal(bst_view_find_socket(peer, port), accepted);
    assert_int_equal(bst_view_find_socket(port, peer), client);
    assert_int_equal(bst_view_find_socket(port, port), -1);
    /* also while no descriptor is left */
    struct rlimit before, few;
    assert_int_equal(getrlimit(RLIMIT_NOFILE, &before), 0);
    few = (struct rlimit){64, before.rlim_max};
    assert_int_equal(setrlimit(RLIMIT_NOFILE, &few), 0);
    int filled[64], count = 0;
    while (count < 64 && (filled[count] = dup(listener)) >= 0) {
        count++;
    }
    assert_int_equal(bst_view_find_socket(peer, port), accepted);
    while (count > 0) {
        close(filled[--count]);
    }
    assert_int_equal(setrlimit(RLIMIT_NOFILE, &before), 0);
    close(accepted);
    close(client);
    close(listener);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(heads_are_read_as_they_are_written),
        cmocka_unit_test(a_head_alone_is_refused),
        cmocka_unit_test(texts_are_handed_over_and_pings_answered),
        cmocka_unit_test(half_a_frame_ends_the_connection),
        cmocka_unit_test(silences_of_three_lengths),
        cmocka_unit_test(a_slow_frame_ends_the_connection),
        cmocka_unit_test(who_takes_nothing_is_given_up),
        cmocka_unit_test(sockets_are_found_by_their_ports),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
