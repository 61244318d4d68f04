/* Whatever a peer does is counted and answered, and no step takes longer than its time-out. */
#include "tests/link/link_scene.h"

#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>
#include <zmq.h>

#include "sim/core/wall_clock.h"
#include "sim/link/crc32c.h"

/* How the answer to a step is spoilt before the right one is given. */
typedef struct spoilt {
    const char *counter; /* without "link_" */
    void (*send)(raw_peer *raw, raw_message *m);
    int gaps;    /* numbers that the peer leaves out, or that cannot be read */
    bool unread; /* so that the answer does not name the number */
} spoilt;

static void bad_crc(raw_peer *raw, raw_message *m) {
    m->payload[9] ^= 1;
    raw_send(raw, m);
}
static void bad_header_crc(raw_peer *raw, raw_message *m) {
    m->text[3] ^= 1;
    raw_send(raw, m);
}
static void bad_header(raw_peer *raw, raw_message *m) {
    m->text_bytes = (size_t)snprintf(m->text, sizeof m->text, "hello");
    raw_send(raw, m);
}
static void bad_version(raw_peer *raw, raw_message *m) {
    m->text[11] = '0'; /* {"version":0 */
    bst_link_header_seal(m->text, m->text_bytes);
    raw_send(raw, m);
}
static void too_short(raw_peer *raw, raw_message *m) {
    m->payload_bytes -= 8;
    raw_seal(m);
    raw_send(raw, m);
}
static void other_than_stated(raw_peer *raw, raw_message *m) {
    m->payload_bytes -= 8;
    raw_send(raw, m);
}
static void header_alone(raw_peer *raw, raw_message *m) {
    zmq_send(raw->socket, m->text, m->text_bytes, 0);
}
static void three_parts(raw_peer *raw, raw_message *m) {
    zmq_send(raw->socket, m->text, m->text_bytes, ZMQ_SNDMORE);
    zmq_send(raw->socket, m->payload, m->payload_bytes, ZMQ_SNDMORE);
    zmq_send(raw->socket, "more", 4, 0);
}
static void forty_parts(raw_peer *raw, raw_message *m) {
    zmq_send(raw->socket, m->text, m->text_bytes, ZMQ_SNDMORE);
    for (int i = 0; i < 40; i++) {
        zmq_send(raw->socket, m->payload, m->payload_bytes, i < 39 ? ZMQ_SNDMORE : 0);
    }
}
static void empty_part(raw_peer *raw, raw_message *m) {
    (void)m;
    zmq_send(raw->socket, "", 0, 0);
}
static void change(raw_peer *raw, raw_message *m, const char *field, const double *value, int n) {
    const bst_wire_field *table = bst_wire_message_of(m->header.type)->record;
    for (const bst_wire_field *f = table; f->name; f++) {
        if (strcmp(f->name, field) == 0) {
            memcpy(m->payload + bst_wire_offset(table, f), value, (size_t)n * sizeof *value);
        }
    }
    raw_seal(m);
    raw_send(raw, m);
}
static void nan_quaternion(raw_peer *raw, raw_message *m) {
    const double q[4] = {0.0, 0.0, (double)NAN, 1.0};
    change(raw, m, "q_cam_from_gcrf", q, 4);
}
static void long_quaternion(raw_peer *raw, raw_message *m) {
    const double q[4] = {1.0, 1.0, 1.0, 1.0};
    change(raw, m, "q_cam_from_gcrf", q, 4);
}
static void unknown_type(raw_peer *raw, raw_message *m) {
    char *type = strstr(m->text, "detections");
    memcpy(type, "rejections", 10);
    bst_link_header_seal(m->text, m->text_bytes);
    raw_send(raw, m);
}
static void type_of_the_simulation(raw_peer *raw, raw_message *m) {
    raw_make(raw, m, BST_LINK_STEP, &(bst_link_step){.inputs = 1});
    raw_send(raw, m);
    raw->sequence++;
}
static void output_of_another_role(raw_peer *raw, raw_message *m) {
    raw_make(raw, m, BST_LINK_LOS_COMMAND, &(bst_los_command){.direction_gcrf = {0, 0, 1}});
    raw_send(raw, m);
    raw->sequence++;
}
static void make_health(raw_message *m) {
    const bst_link_health health = {.state = 1, .text = "slow"};
    m->header.type = BST_LINK_HEALTH;
    m->payload_bytes = bst_wire_encode(bst_wire_message_of(BST_LINK_HEALTH), &health, m->payload);
    raw_seal(m);
}
static void duplicate(raw_peer *raw, raw_message *m) {
    make_health(m);
    raw_send(raw, m);
    raw_send(raw, m);
}
static void out_of_order(raw_peer *raw, raw_message *m) {
    m->header.sequence = raw->sequence++; /* one later than it should: a gap, which is taken */
    make_health(m);
    raw_send(raw, m);
    m->header.sequence--;
    make_health(m);
    raw_send(raw, m);
}
static void earlier_step(raw_peer *raw, raw_message *m) {
    m->header.step--;
    raw_seal(m);
    raw_send(raw, m);
}
static void other_part(raw_peer *raw, raw_message *m) {
    memcpy(m->header.instance, "craft/camera/control", 21);
    raw_seal(m);
    raw_send(raw, m);
}
static void done_too_early(raw_peer *raw, raw_message *m) {
    raw_make(raw, m, BST_LINK_DONE, &(bst_link_done){.outputs = 1});
    raw_send(raw, m);
    raw->sequence++;
}

static const spoilt ways[] = {
    {"bad_crc", bad_crc, 0, false},
    {"bad_crc", bad_header_crc, 1, true},
    {"bad_header", bad_header, 1, true},
    {"bad_header", empty_part, 1, true},
    {"bad_version", bad_version, 0, false},
    {"bad_length", too_short, 0, false},
    {"bad_length", other_than_stated, 0, false},
    {"bad_length", header_alone, 0, false},
    {"bad_length", three_parts, 0, false},
    {"bad_length", forty_parts, 0, false},
    {"bad_value", nan_quaternion, 0, false},
    {"bad_value", long_quaternion, 0, false},
    {"unexpected", unknown_type, 0, false},
    {"unexpected", type_of_the_simulation, 1, false},
    {"unexpected", output_of_another_role, 1, false},
    {"duplicate", duplicate, 0, false},
    {"out_of_order", out_of_order, 1, false},
    {"late", earlier_step, 0, false},
    {"late", other_part, 0, false},
    {"incomplete", done_too_early, 1, false},
};
enum { WAYS = sizeof ways / sizeof *ways };

static void *spoil_each_first(void *user) {
    link_scene *s = user;
    raw_peer raw;
    raw_open(&raw, s->address, "*");
    for (int i = 0; i < WAYS && raw_await(&raw, BST_LINK_STEP, 10.0, NULL); i++) {
        raw_message m;
        struct {
            bst_detections head;
            bst_detection item;
        } found;
        raw_detections(&found, 1);
        raw_make(&raw, &m, BST_LINK_DETECTIONS, &found);
        raw.sequence++;
        ways[i].send(&raw, &m);
        bst_link_error error = {.sequence = 0};
        bool reported = raw_await(&raw, BST_LINK_ERROR, 10.0, &error) &&
                        strcmp(error.fault, ways[i].counter) == 0 && *error.text &&
                        (error.sequence == -1) == ways[i].unread;
        if (!reported) {
            fprintf(stderr, "way %d: reported \"%s\" of %lld (%s)\n", i, error.fault,
                    (long long)error.sequence, error.text);
            break; /* the step will not be answered */
        }
        raw_answer(&raw);
    }
    raw_await(&raw, BST_LINK_END, 10.0, NULL);
    raw_close(&raw);
    return NULL;
}

static void what_is_wrong_is_counted_and_said_and_the_step_goes_on(void **state) {
    (void)state;
    link_scene s;
    scene_open(&s, false, 10.0, BST_LINK_STOP, false);
    scene_start(&s, spoil_each_first);
    for (int i = 0; i < WAYS; i++) {
        char counter[40];
        snprintf(counter, sizeof counter, "link_%s", ways[i].counter);
        int64_t before = scene_count(&s, counter), gaps = scene_count(&s, "link_gap");
        bst_assert_ok(&s.ctx, scene_step(&s));
        assert_true(s.answered && s.given);
        bst_assert_close(s.detections.items[0].x_px, 1.5, 0.0);
        bst_assert_close(s.detections.items[0].extent.size_px, 20.0, 0.0);
        bst_assert_close(s.detections.items[0].extent.range_m, 345.5, 0.0);
        assert_int_equal(scene_count(&s, counter), before + 1);
        assert_int_equal(scene_count(&s, "link_gap"), gaps + ways[i].gaps);
    }
    int notes = 0;
    while (bst_link_note(s.link)) {
        notes++;
    }
    /* hello, and the gaps after headers that could not be read */
    assert_true(notes > WAYS + 2 || notes == 32);
    scene_close(&s);
}

static void *more_than_there_is_room_for(void *user) {
    link_scene *s = user;
    raw_peer raw;
    raw_open(&raw, s->address, "*");
    raw_await(&raw, BST_LINK_STEP, 10.0, NULL);
    raw_message m;
    struct {
        bst_detections head;
        bst_detection items[4];
    } found;
    raw_detections(&found, 4);
    raw_make(&raw, &m, BST_LINK_DETECTIONS, &found);
    size_t item = bst_wire_bytes(bst_wire_message_of(BST_LINK_DETECTIONS)->items);
    /* two more of the last one, and the count to go with them */
    memcpy(m.payload + m.payload_bytes, m.payload + m.payload_bytes - item, item);
    m.payload_bytes += item;
    const bst_wire_message *about = bst_wire_message_of(BST_LINK_DETECTIONS);
    for (const bst_wire_field *f = about->record; f->name; f++) {
        if (f->check == BST_WIRE_COUNT) {
            m.payload[bst_wire_offset(about->record, f)] = 5;
        }
    }
    raw_seal(&m);
    raw_send(&raw, &m);
    raw.sequence++;
    raw_make(&raw, &m, BST_LINK_DETECTIONS, &found); /* a second one: the first holds */
    raw_send(&raw, &m);
    raw.sequence++;
    raw_make(&raw, &m, BST_LINK_DONE, &(bst_link_done){.outputs = 1});
    raw_send(&raw, &m);
    raw_await(&raw, BST_LINK_END, 10.0, NULL);
    raw_close(&raw);
    return NULL;
}

static void items_beyond_the_room_are_counted(void **state) {
    (void)state;
    link_scene s;
    scene_open(&s, false, 10.0, BST_LINK_STOP, false);
    scene_start(&s, more_than_there_is_room_for);
    bst_assert_ok(&s.ctx, scene_step(&s));
    assert_true(s.given && s.detections.head.count == 4 && s.dropped == 1);
    assert_int_equal(scene_count(&s, "link_items_dropped"), 1);
    assert_int_equal(scene_count(&s, "link_repeated"), 1);
    scene_close(&s);
}

static void nobody_comes(void **state) {
    (void)state;
    link_scene s;
    scene_open(&s, false, 0.2, BST_LINK_STOP, false);
    double began = bst_wall_seconds();
    assert_int_equal(scene_step(&s), BST_ERR_IO);
    assert_non_null(strstr(s.ctx.message, "no peer plays craft/camera/imgproc"));
    assert_true(bst_wall_seconds() - began < 30.0); /* a hang, not a slow machine */
    assert_int_equal(scene_count(&s, "link_unanswered"), 1);
    scene_close(&s);
}

static void *silent_then_back(void *user) {
    link_scene *s = user;
    raw_peer raw;
    raw_open(&raw, s->address, "*");
    raw_await(&raw, BST_LINK_STEP, 10.0, NULL);
    raw_answer(&raw);
    raw_await(&raw, BST_LINK_STEP, 10.0, NULL); /* says nothing to this one in time */
    struct timespec nap = {0, 500000000};
    nanosleep(&nap, NULL);
    raw_answer(&raw);
    raw_await(&raw, BST_LINK_ERROR, 10.0, NULL);
    raw_close(&raw);
    raw_open(&raw, s->address, "*");
    while (raw_await(&raw, BST_LINK_STEP, 3.0, NULL)) {
        raw_answer(&raw);
    }
    raw_close(&raw);
    return NULL;
}

static void silence_stops_the_run_or_not(void **state) {
    (void)state;
    for (int go_on = 0; go_on < 2; go_on++) {
        link_scene s;
        scene_open(&s, false, 0.3, go_on ? BST_LINK_GO_ON : BST_LINK_STOP, false);
        scene_start(&s, silent_then_back);
        bst_assert_ok(&s.ctx, scene_step(&s));
        bst_status status = scene_step(&s);
        assert_false(s.given || s.answered);
        assert_int_equal(scene_count(&s, "link_unanswered"), 1);
        assert_int_equal(status, go_on ? BST_OK : BST_ERR_IO);
        if (!go_on) {
            assert_non_null(strstr(s.ctx.message, "\"raw\" has not answered step 1"));
        }
        /* it is taken again when it has said hello, and not waited for until then */
        double began = bst_wall_seconds();
        while (go_on && !s.answered && bst_wall_seconds() - began < 10.0) {
            bst_assert_ok(&s.ctx, scene_step(&s));
            struct timespec nap = {0, 5000000};
            nanosleep(&nap, NULL);
        }
        assert_true(!go_on || (s.answered && s.given));
        assert_int_equal(scene_count(&s, "link_stranger") > 0, go_on); /* the late answer */
        scene_close(&s);
    }
}

static void *keeps_saying_that_it_is_well(void *user) {
    link_scene *s = user;
    raw_peer raw;
    raw_open(&raw, s->address, "*");
    raw_await(&raw, BST_LINK_STEP, 10.0, NULL);
    for (int i = 0; i < 40 && !raw_await(&raw, BST_LINK_END, 0.05, NULL); i++) {
        raw_message m;
        raw_make(&raw, &m, BST_LINK_HEALTH, &(bst_link_health){.text = "working"});
        raw_send(&raw, &m);
        raw.sequence++;
    }
    raw_close(&raw);
    return NULL;
}

/* Ten time-outs of 0.1 s, however often a peer says that it is well. */
static void a_step_is_prolonged_ten_times_at_most(void **state) {
    (void)state;
    link_scene s;
    scene_open(&s, false, 0.1, BST_LINK_STOP, false);
    scene_start(&s, keeps_saying_that_it_is_well);
    double began = bst_wall_seconds();
    assert_int_equal(scene_step(&s), BST_ERR_IO);
    double took = bst_wall_seconds() - began;
    assert_true(took > 0.11 && took < 30.0);
    scene_close(&s);
}

static void *says_that_it_has_failed(void *user) {
    link_scene *s = user;
    raw_peer raw;
    raw_open(&raw, s->address, "*");
    raw_await(&raw, BST_LINK_STEP, 10.0, NULL);
    raw_message m;
    raw_make(&raw, &m, BST_LINK_HEALTH, &(bst_link_health){.state = 2, .text = "no memory"});
    raw_send(&raw, &m);
    raw_await(&raw, BST_LINK_END, 10.0, NULL);
    raw_close(&raw);
    return NULL;
}

static void a_peer_that_has_failed_ends_the_run(void **state) {
    (void)state;
    link_scene s;
    scene_open(&s, false, 10.0, BST_LINK_GO_ON, false);
    scene_start(&s, says_that_it_has_failed);
    assert_int_equal(scene_step(&s), BST_ERR_IO);
    assert_non_null(strstr(s.ctx.message, "no memory"));
    scene_close(&s);
}

static void *flood(void *user) {
    link_scene *s = user;
    raw_peer good, bad;
    raw_open(&bad, s->address, "nothing");
    raw_open(&good, s->address, "*");
    raw_await(&good, BST_LINK_STEP, 10.0, NULL);
    raw_message m;
    raw_make(&bad, &m, BST_LINK_HEALTH, &(bst_link_health){.text = "hello?"});
    for (int i = 0; i < 12000; i++) {
        raw_send(&bad, &m);
    }
    raw_answer(&good);
    for (int i = 0; i < 5 && raw_await(&good, BST_LINK_STEP, 10.0, NULL); i++) {
        raw_answer(&good);
    }
    raw_await(&good, BST_LINK_END, 10.0, NULL);
    /* libzmq 4.3.4 aborts in session_base.cpp when a socket is closed with a half-sent message at
     * the moment at which its connection breaks: the link is closed first */
    struct timespec nap = {0, 700000000};
    nanosleep(&nap, NULL);
    raw_close(&bad);
    raw_close(&good);
    return NULL;
}

static void who_floods_is_not_heard(void **state) {
    (void)state;
    link_scene s;
    scene_open(&s, false, 20.0, BST_LINK_STOP, false);
    scene_start(&s, flood);
    for (int i = 0; i < 6; i++) {
        bst_assert_ok(&s.ctx, scene_step(&s));
        assert_true(s.answered && s.given);
    }
    assert_true(scene_count(&s, "link_flooded") > 0);
    assert_true(scene_count(&s, "link_stranger") <= 10000);
    scene_close(&s);
}

static void *too_large(void *user) {
    link_scene *s = user;
    raw_peer bad, good;
    raw_open(&bad, s->address, "*");
    raw_await(&bad, BST_LINK_STEP, 10.0, NULL);
    size_t bytes = 17u << 20;
    void *large = calloc(1, bytes);
    zmq_send(bad.socket, large, bytes, 0);
    free(large);
    struct timespec nap = {0, 200000000};
    nanosleep(&nap, NULL);
    raw_open(&good, s->address, "*");
    while (raw_await(&good, BST_LINK_STEP, 3.0, NULL)) {
        raw_answer(&good);
    }
    raw_close(&bad);
    raw_close(&good);
    return NULL;
}

static void who_sends_too_much_at_once_is_disconnected(void **state) {
    (void)state;
    link_scene s;
    scene_open(&s, false, 10.0, BST_LINK_STOP, false);
    scene_start(&s, too_large);
    bst_assert_ok(&s.ctx, scene_step(&s));
    assert_true(s.answered && s.given);
    assert_true(scene_count(&s, "link_disconnected") >= 1);
    scene_close(&s);
}

/* A client of TCP that speaks as ZeroMQ does (ZMTP 3.0) and announces a part of 2 GB. */
static void *two_gigabytes(void *user) {
    link_scene *s = user;
    int port = atoi(strrchr(s->address, ':') + 1);
    struct sockaddr_in to = {.sin_family = AF_INET, .sin_port = htons((uint16_t)port)};
    to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    int fd = socket(AF_INET, SOCK_STREAM, 0);
    bool ok = connect(fd, (struct sockaddr *)&to, sizeof to) == 0;
    char greeting[64] = {(char)0xff, 0, 0, 0, 0, 0, 0, 0, 1, 0x7f, 3, 0, 'N', 'U', 'L', 'L'};
    const char ready[] = "\x04\x19\x05READY\x0bSocket-Type\0\0\0\6DEALER";
    char got[256];
    ok = ok && write(fd, greeting, sizeof greeting) == sizeof greeting;
    ok = ok && write(fd, ready, sizeof ready - 1) == sizeof ready - 1;
    const unsigned char large[9 + 16] = {2, 0, 0, 0, 0, 0x80, 0, 0, 0};
    ok = ok && write(fd, large, sizeof large) == sizeof large;
    while (ok && read(fd, got, sizeof got) > 0) { /* until it is cut off */
    }
    close(fd);
    raw_peer good;
    raw_open(&good, s->address, "*");
    while (raw_await(&good, BST_LINK_STEP, 3.0, NULL)) {
        raw_answer(&good);
    }
    raw_close(&good);
    return NULL;
}

static void a_part_of_two_gigabytes_is_refused_unread(void **state) {
    (void)state;
    link_scene s;
    scene_open(&s, true, 20.0, BST_LINK_STOP, false);
    scene_start(&s, two_gigabytes);
    bst_assert_ok(&s.ctx, scene_step(&s));
    assert_true(s.answered && s.given);
    assert_true(scene_count(&s, "link_disconnected") >= 1);
    scene_close(&s);
}

/* Peers that vanish at any point of a step, one after the other; each time the next one gets the
 * step again. The number is that of BORESIGHT_DISCONNECTS, or 100. */
static void *come_and_go(void *user) {
    link_scene *s = user;
    const char *asked = getenv("BORESIGHT_DISCONNECTS");
    int times = asked ? atoi(asked) : 100;
    uint32_t random = 12345;
    for (int i = 0; i < times; i++) {
        raw_peer raw;
        raw_open(&raw, s->address, "*");
        random = random * 1664525u + 1013904223u;
        int where = (int)(random >> 29);
        raw_message m;
        if (where > 0 && raw_await(&raw, BST_LINK_STEP, 5.0, NULL)) {
            raw_make(&raw, &m, BST_LINK_DONE, &(bst_link_done){.outputs = 0});
            if (where == 2) {
                zmq_send(raw.socket, m.text, m.text_bytes, ZMQ_SNDMORE); /* half of a message */
            } else if (where == 3) {
                raw_send(&raw, &m);
            } else if (where > 4) {
                raw_answer(&raw);
                raw_await(&raw, BST_LINK_STEP, 5.0, NULL);
            }
        }
        raw_close(&raw);
    }
    raw_peer raw;
    raw_open(&raw, s->address, "*");
    while (raw_await(&raw, BST_LINK_STEP, 5.0, NULL)) {
        raw_answer(&raw);
    }
    raw_close(&raw);
    return NULL;
}

static void *watch_the_end(void *user) {
    come_and_go(user);
    return NULL;
}

static void peers_that_vanish_are_replaced(void **state) {
    (void)state;
    link_scene s;
    scene_open(&s, false, 10.0, BST_LINK_STOP, false);
    scene_start(&s, watch_the_end);
    /* the last peer stays: two hundred steps without a new one are its */
    int64_t hellos = 0;
    for (int quiet = 0; quiet < 200;) {
        bst_assert_ok(&s.ctx, scene_step(&s));
        int64_t now = scene_count(&s, "link_hello");
        quiet = now == hellos ? quiet + 1 : 0;
        hellos = now;
    }
    assert_true(hellos > 50);
    scene_close(&s);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_is_wrong_is_counted_and_said_and_the_step_goes_on),
        cmocka_unit_test(items_beyond_the_room_are_counted),
        cmocka_unit_test(nobody_comes),
        cmocka_unit_test(silence_stops_the_run_or_not),
        cmocka_unit_test(a_step_is_prolonged_ten_times_at_most),
        cmocka_unit_test(a_peer_that_has_failed_ends_the_run),
        cmocka_unit_test(who_floods_is_not_heard),
        cmocka_unit_test(who_sends_too_much_at_once_is_disconnected),
        cmocka_unit_test(a_part_of_two_gigabytes_is_refused_unread),
        cmocka_unit_test(peers_that_vanish_are_replaced),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
