#include "tests/link/link_scene.h"

#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>
#include <zmq.h>

#include "sim/core/wall_clock.h"
#include "sim/link/crc32c.h"

/* A port that nothing uses now: one by the number of the process may be in use by another program.
 */
static int free_port(void) {
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t size = sizeof at;
    int probe = socket(AF_INET, SOCK_STREAM, 0);
    assert_true(probe >= 0);
    assert_int_equal(bind(probe, (struct sockaddr *)&at, size), 0);
    assert_int_equal(getsockname(probe, (struct sockaddr *)&at, &size), 0);
    close(probe);
    return ntohs(at.sin_port);
}

void scene_open(link_scene *s, bool tcp, double timeout_s, bst_link_silence on_timeout,
                bool shared_memory) {
    memset(s, 0, sizeof *s);
    bst_test_template(s->folder, "boresight_link");
    assert_non_null(mkdtemp(s->folder));
    if (tcp) {
        snprintf(s->address, sizeof s->address, "tcp://127.0.0.1:%d", free_port());
    } else {
        snprintf(s->address, sizeof s->address, "ipc://%.80s/socket", s->folder);
    }
    bst_link_config config = {.timeout_s = timeout_s,
                              .connect_timeout_s = timeout_s,
                              .on_timeout = on_timeout,
                              .shared_memory = shared_memory};
    snprintf(config.address, sizeof config.address, "%s", s->address);
    bst_link_run run = {.scenario = "test",
                        .tick_rate_hz = 1000,
                        .duration_ticks = 100000,
                        .pixel_bytes = sizeof s->pixels};
    bst_assert_ok(&s->ctx, bst_time_from_utc(&s->ctx, "2026-01-01T00:00:00Z", &run.epoch));
    bst_link_part part = {.instance = "craft/camera/imgproc", .role = "imgproc", .width_px = 64};
    bst_assert_ok(&s->ctx, bst_link_create(&s->ctx, &config, &run, &s->link));
    bst_assert_ok(&s->ctx, bst_link_add(&s->ctx, s->link, &part, &s->part));
    bst_assert_ok(&s->ctx, bst_link_open(&s->ctx, s->link));
    for (int i = 0; i < SCENE_PIXELS; i++) {
        s->pixels[i] = (uint16_t)(i * 21);
    }
}

void scene_close(link_scene *s) {
    bst_link_close(s->link, 0, "the test is over");
    scene_join(s);
    char path[BST_TEST_PATH + 16];
    snprintf(path, sizeof path, "%s/socket", s->folder);
    unlink(path);
    assert_int_equal(rmdir(s->folder), 0);
}

void scene_start(link_scene *s, void *(*play)(void *scene)) {
    assert_int_equal(pthread_create(&s->peer, NULL, play, s), 0);
    s->has_peer = true;
}

void scene_join(link_scene *s) {
    if (s->has_peer) {
        pthread_join(s->peer, NULL);
        s->has_peer = false;
    }
}

bst_status scene_step(link_scene *s) {
    int64_t id = s->frames++;
    const bst_link_frame frame = {.exposure_id = id,
                                  .start_tick = 100 * id,
                                  .end_tick = 100 * id + 50,
                                  .binning = 1,
                                  .bits = 16,
                                  .width = SCENE_WIDTH,
                                  .height = SCENE_HEIGHT};
    const bst_link_input input = {.type = BST_LINK_FRAME,
                                  .payload = &frame,
                                  .tick = frame.end_tick,
                                  .pixels = s->pixels,
                                  .pixel_bytes = sizeof s->pixels};
    bst_link_output output = {
        .type = BST_LINK_DETECTIONS, .payload = &s->detections, .capacity = 4};
    const bst_link_messages messages = {&input, 1, &output, 1};
    bst_status status =
        bst_link_exchange(&s->ctx, s->link, s->part, frame.end_tick, &messages, &s->answered);
    s->given = output.given;
    s->dropped = output.dropped;
    return status;
}

int64_t scene_count(const link_scene *s, const char *counter) {
    const char *name;
    int64_t count;
    for (int i = 0; bst_link_counter(s->link, i, &name, &count); i++) {
        if (strcmp(name, counter) == 0) {
            return count;
        }
    }
    fail_msg("there is no counter %s", counter);
    return -1;
}

void raw_open(raw_peer *raw, const char *address, const char *serves) {
    memset(raw, 0, sizeof *raw);
    raw->context = zmq_ctx_new();
    raw->socket = zmq_socket(raw->context, ZMQ_DEALER);
    int linger = 0;
    zmq_setsockopt(raw->socket, ZMQ_LINGER, &linger, sizeof linger);
    assert_int_equal(zmq_connect(raw->socket, address), 0);
    bst_link_hello hello = {.name = "raw"};
    snprintf(hello.serves, sizeof hello.serves, "%s", serves);
    raw_message m;
    raw_make(raw, &m, BST_LINK_HELLO, &hello);
    raw_send(raw, &m);
    raw->sequence++;
}

void raw_close(raw_peer *raw) {
    zmq_close(raw->socket);
    zmq_ctx_term(raw->context);
}

bool raw_await(raw_peer *raw, bst_link_type type, double timeout_s, bst_link_error *error) {
    double end = bst_wall_seconds() + timeout_s;
    for (double left = timeout_s; left > 0.0; left = end - bst_wall_seconds()) {
        zmq_pollitem_t item = {.socket = raw->socket, .events = ZMQ_POLLIN};
        if (zmq_poll(&item, 1, (long)(left * 1e3) + 1) <= 0) {
            continue;
        }
        char text[BST_LINK_HEADER_BYTES];
        static _Thread_local uint8_t rest[8192];
        bst_ctx ctx = {0};
        bst_link_header header = {.type = BST_LINK_TYPES};
        int n = zmq_recv(raw->socket, text, sizeof text, 0), more = 1, parts = 0;
        if (n > 0) {
            (void)!bst_link_header_read(&ctx, text, (size_t)n, &header);
        }
        size_t size = sizeof more;
        zmq_getsockopt(raw->socket, ZMQ_RCVMORE, &more, &size);
        while (more) {
            n = zmq_recv(raw->socket, rest, sizeof rest, 0);
            if (parts++ == 0 && header.type == BST_LINK_ERROR && error) {
                (void)!bst_wire_decode(&ctx, bst_wire_message_of(BST_LINK_ERROR), rest, (size_t)n,
                                       error, 0, NULL);
            }
            zmq_getsockopt(raw->socket, ZMQ_RCVMORE, &more, &size);
        }
        if (header.type == BST_LINK_STEP) {
            raw->step = header;
        }
        if (header.type == type || header.type == BST_LINK_END) {
            return header.type == type;
        }
    }
    return false;
}

void raw_seal(raw_message *m) {
    m->header.parts = 1;
    m->header.lengths[0] = (int64_t)m->payload_bytes;
    m->header.crcs[0] = bst_crc32c(m->payload, m->payload_bytes);
    m->text_bytes = bst_link_header_write(&m->header, m->text);
}

void raw_make(const raw_peer *raw, raw_message *m, bst_link_type type, const void *payload) {
    m->header = raw->step;
    m->header.type = type;
    m->header.sequence = raw->sequence;
    m->header.slot = -1;
    m->payload_bytes = bst_wire_encode(bst_wire_message_of(type), payload, m->payload);
    raw_seal(m);
}

void raw_send(raw_peer *raw, const raw_message *m) {
    zmq_send(raw->socket, m->text, m->text_bytes, ZMQ_SNDMORE);
    zmq_send(raw->socket, m->payload, m->payload_bytes, 0);
}

void raw_detections(void *detections, int count) {
    bst_detections *d = detections;
    memset(d, 0, sizeof *d + (size_t)count * sizeof(bst_detection));
    d->count = count;
    for (int i = 0; i < count; i++) {
        d->items[i].x_px = 1.5 + i;
        d->items[i].flags = BST_DETECTION_EXTENDED;
        d->items[i].extent.size_px = 20.0;
        d->items[i].extent.range_m = 345.5 + i;
    }
}

void raw_answer(raw_peer *raw) {
    raw_message m;
    struct {
        bst_detections head;
        bst_detection item;
    } found;
    raw_detections(&found, 1);
    raw_make(raw, &m, BST_LINK_DETECTIONS, &found);
    raw_send(raw, &m);
    raw->sequence++;
    raw_make(raw, &m, BST_LINK_DONE, &(bst_link_done){.outputs = 1});
    raw_send(raw, &m);
    raw->sequence++;
}
