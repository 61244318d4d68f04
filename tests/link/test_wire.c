/* Packets: checksums, bytes, and what the decoder refuses. */
#include "tests/test_support.h"

#include "sim/core/fnv.h"
#include "sim/link/crc32c.h"
#include "sim/link/packet.h"
#include "sim/link/payloads.h"

/* RFC 3720, appendix B.4, and the usual check value of the polynomial. */
static void checksums_are_those_of_the_rfc(void **state) {
    (void)state;
    uint8_t bytes[32];
    memset(bytes, 0, sizeof bytes);
    assert_int_equal(bst_crc32c(bytes, 32), 0x8A9136AAu);
    memset(bytes, 0xff, sizeof bytes);
    assert_int_equal(bst_crc32c(bytes, 32), 0x62A8AB43u);
    for (int i = 0; i < 32; i++) {
        bytes[i] = (uint8_t)i;
    }
    assert_int_equal(bst_crc32c(bytes, 32), 0x46DD794Eu);
    for (int i = 0; i < 32; i++) {
        bytes[i] = (uint8_t)(31 - i);
    }
    assert_int_equal(bst_crc32c(bytes, 32), 0x113FDB5Cu);
    assert_int_equal(bst_crc32c("123456789", 9), 0xE3069283u);
    assert_int_equal(bst_crc32c("", 0), 0);
}

static void checksums_are_the_same_by_both_routes(void **state) {
    (void)state;
    enum { MOST = 9000 };
    uint8_t *bytes = malloc(MOST + 8);
    assert_non_null(bytes);
    uint32_t x = 1;
    for (int i = 0; i < MOST + 8; i++) {
        x = x * 1664525u + 1013904223u;
        bytes[i] = (uint8_t)(x >> 24);
    }
    for (size_t n = 0; n < MOST; n += n < 800 ? 1 : 61) {
        assert_int_equal(bst_crc32c(bytes + n % 8, n), bst_crc32c_portable(bytes + n % 8, n));
    }
    free(bytes);
}

/* Bytes written down by hand from the document. */
static void a_record_lies_as_documented(void **state) {
    (void)state;
    const uint8_t expected[] = {
        2,    0,    0,    0,    0, 0, 0,    0,    /* tick = 2 */
        4,    0,    0,    0,                      /* mode */
        0xff, 0,    0,    0,    0, 0, 0,    0,    /* target_id = 255 */
        0xff, 0xff, 0xff, 0xff,                   /* search_step = -1 */
        0,    0,    0,    0,    0, 0, 0xf8, 0x3f, /* 1.5 */
        0,    0,    0,    0,    0, 0, 0xf8, 0x7f, /* NaN */
    };
    const bst_control_status status = {.tick = 2,
                                       .mode = 4,
                                       .target_id = 255,
                                       .search_step = -1,
                                       .aim_error_px = {1.5, (double)NAN}};
    const bst_wire_message *m = bst_wire_message_of(BST_LINK_CONTROL_STATUS);
    uint8_t out[64];
    assert_int_equal(bst_wire_payload_bytes(m, 0), sizeof expected);
    assert_int_equal(bst_wire_encode(m, &status, out), sizeof expected);
    assert_memory_equal(out, expected, sizeof expected);
}

typedef struct found {
    bst_detections head;
    bst_detection items[3];
} found;

static void sample(found *f, int count) {
    memset(f, 0, sizeof *f);
    f->head.exposure_id = 7;
    f->head.q_cam_from_gcrf = (bst_quat){0.5, 0.5, -0.5, 0.5};
    f->head.count = count;
    for (int i = 0; i < count; i++) {
        bst_detection d = {.x_px = 10.25 + i, .y_px = 20.5, .cov_xx = 0.01, .cov_yy = 0.02};
        d.v_mag = (double)INFINITY;
        d.label = 5;
        d.label_probability = 1.0;
        d.star_id = 0xffffffffu;
        memcpy(&f->head.items[i], &d, sizeof d);
    }
}

static void what_is_encoded_is_decoded(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    const bst_wire_message *m = bst_wire_message_of(BST_LINK_DETECTIONS);
    uint8_t bytes[2048];
    found in, out;
    sample(&in, 3);
    memset(&out, 0, sizeof out);
    size_t n = bst_wire_encode(m, &in, bytes);
    int dropped = -1;
    assert_int_equal(bst_wire_decode(&ctx, m, bytes, n, &out, 3, &dropped), BST_WIRE_GOOD);
    assert_int_equal(dropped, 0);
    assert_memory_equal(&out, &in, sizeof in);
    /* room for two: the third is counted, and checked like the others */
    assert_int_equal(bst_wire_decode(&ctx, m, bytes, n, &out, 2, &dropped), BST_WIRE_GOOD);
    assert_int_equal(dropped, 1);
    assert_int_equal(out.head.count, 2);
    double nan = (double)NAN;
    memcpy(bytes + n - bst_wire_bytes(m->items), &nan, sizeof nan);
    assert_int_equal(bst_wire_decode(&ctx, m, bytes, n, &out, 2, &dropped), BST_WIRE_BAD_VALUE);
    assert_non_null(strstr(ctx.message, "x_px of item 2 is"));
}

static bst_wire_fault decode_changed(bst_link_type type, const void *payload, const char *field,
                                     const void *value, size_t bytes) {
    bst_ctx ctx = {0};
    const bst_wire_message *m = bst_wire_message_of(type);
    uint8_t packet[2048];
    found out;
    size_t n = bst_wire_encode(m, payload, packet);
    for (const bst_wire_field *f = m->record; f->name; f++) {
        if (strcmp(f->name, field) == 0) {
            memcpy(packet + bst_wire_offset(m->record, f), value, bytes);
        }
    }
    return bst_wire_decode(&ctx, m, packet, n, &out, 3, NULL);
}

static void wrong_values_are_refused(void **state) {
    (void)state;
    found f;
    sample(&f, 1);
    const double quaternions[][4] = {{(double)NAN, 0, 0, 1},
                                     {0, 0, 0, (double)INFINITY},
                                     {0, 0, 0, 1.001},
                                     {1e200, 1e200, 0, 0},
                                     {1e-3, 0, 0, 0}};
    for (size_t i = 0; i < sizeof quaternions / sizeof *quaternions; i++) {
        assert_int_equal(decode_changed(BST_LINK_DETECTIONS, &f, "q_cam_from_gcrf", quaternions[i],
                                        sizeof *quaternions),
                         BST_WIRE_BAD_VALUE);
    }
    const double zero[4] = {0}, unit[4] = {0, 0, 0, 1.0000001};
    assert_int_equal(decode_changed(BST_LINK_DETECTIONS, &f, "q_cam_from_gcrf", zero, sizeof zero),
                     BST_WIRE_GOOD);
    assert_int_equal(decode_changed(BST_LINK_DETECTIONS, &f, "q_cam_from_gcrf", unit, sizeof unit),
                     BST_WIRE_GOOD);
    const int32_t counts[] = {-1, 0, 2, 65537, INT32_MAX, INT32_MIN};
    for (size_t i = 0; i < sizeof counts / sizeof *counts; i++) {
        assert_int_equal(decode_changed(BST_LINK_DETECTIONS, &f, "count", &counts[i], 4),
                         BST_WIRE_BAD_LENGTH);
    }
    const int64_t ticks[] = {INT64_MAX, INT64_MIN, 9000000000000002};
    for (size_t i = 0; i < sizeof ticks / sizeof *ticks; i++) {
        assert_int_equal(decode_changed(BST_LINK_DETECTIONS, &f, "start_tick", &ticks[i], 8),
                         BST_WIRE_BAD_VALUE);
    }
    const bst_los_command command = {.direction_gcrf = {0, 0, 1}};
    const int32_t two = 2;
    assert_int_equal(decode_changed(BST_LINK_LOS_COMMAND, &command, "near_given", &two, 4),
                     BST_WIRE_BAD_VALUE);
    const bst_link_hello hello = {.name = "x", .serves = "*"};
    char name[BST_LINK_NAME_BYTES];
    memset(name, 'x', sizeof name); /* no zero at the end */
    assert_int_equal(decode_changed(BST_LINK_HELLO, &hello, "name", name, sizeof name),
                     BST_WIRE_BAD_VALUE);
    assert_int_equal(decode_changed(BST_LINK_HELLO, &hello, "name", "a\033[2J", 6),
                     BST_WIRE_BAD_VALUE);
    assert_int_equal(decode_changed(BST_LINK_HELLO, &hello, "name", "a\0b", 4), BST_WIRE_BAD_VALUE);
}

static void every_length_but_one_is_refused(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    const bst_wire_message *m = bst_wire_message_of(BST_LINK_DETECTIONS);
    uint8_t bytes[2048] = {0};
    found in, out;
    sample(&in, 2);
    size_t right = bst_wire_encode(m, &in, bytes);
    for (size_t n = 0; n <= sizeof bytes; n++) {
        assert_int_equal(bst_wire_decode(&ctx, m, bytes, n, &out, 3, NULL),
                         n == right ? BST_WIRE_GOOD : BST_WIRE_BAD_LENGTH);
    }
}

static bst_wire_fault read_text(const char *start, bst_link_header *out) {
    bst_ctx ctx = {0};
    char text[3000];
    int n = snprintf(text, sizeof text, "%s\"crc32c\":\"00000000\"}", start);
    bst_link_header_seal(text, (size_t)n);
    return bst_link_header_read(&ctx, text, (size_t)n, out);
}

static void headers_are_read(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    char text[BST_LINK_HEADER_BYTES];
    bst_link_header in = {.type = BST_LINK_FRAME,
                          .tick = -5,
                          .utc = "2026-01-01T00:00:00.000000Z",
                          .sequence = 999999999999999,
                          .step = 3,
                          .instance = "a/b/imgproc",
                          .parts = 2,
                          .lengths = {64, 8388608},
                          .crcs = {0x01234567u, 0xffffffffu},
                          .slot = -1},
                    out;
    size_t n = bst_link_header_write(&in, text);
    assert_int_equal(bst_link_header_read(&ctx, text, n, &out), BST_WIRE_GOOD);
    assert_memory_equal(&out, &in, sizeof in);
    /* in shared memory: one checksum, two lengths */
    in.slot = 12;
    in.crcs[1] = 0;
    n = bst_link_header_write(&in, text);
    assert_int_equal(bst_link_header_read(&ctx, text, n, &out), BST_WIRE_GOOD);
    assert_memory_equal(&out, &in, sizeof in);
    /* any order, white space, members of another program */
    assert_int_equal(
        read_text("{ \"crcs\" : [ \"0000000a\" ] , \"mine\":{\"a\":[1,{}],\"b\":\"}\"}, "
                  "\"lengths\":[16],\n\"sequence\":0,\"tick\":0, \"flag\":true,"
                  "\"type\":\"done\",\"version\":9, ",
                  &out),
        BST_WIRE_GOOD);
    assert_int_equal(out.crcs[0], 10);
    assert_int_equal(out.step, -1);
}

static void wrong_headers_are_refused(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_link_header out;
    const struct {
        const char *text;
        bst_wire_fault fault;
    } cases[] = {
        {"{\"version\":1,\"type\":\"done\",\"tick\":0,\"sequence\":0,\"lengths\":[16],\"crcs\":["
         "\"00000000\"],",
         BST_WIRE_BAD_VERSION},
        {"{\"type\":\"done\",\"tick\":0,\"sequence\":0,\"lengths\":[16],\"crcs\":[\"00000000\"],",
         BST_WIRE_BAD_VERSION},
        {"{\"version\":9,\"type\":\"dance\",\"tick\":0,\"sequence\":0,\"lengths\":[16],\"crcs\":["
         "\"00000000\"],",
         BST_WIRE_UNEXPECTED},
        {"{\"version\":9,\"type\":\"done\",\"tick\":0,\"sequence\":0,\"lengths\":[16,3],\"crcs\":["
         "\"00000000\"],",
         BST_WIRE_BAD_LENGTH},
        {"{\"version\":9,\"type\":\"done\",\"tick\":0,\"sequence\":0,\"lengths\":[16],\"crcs\":[],",
         BST_WIRE_BAD_LENGTH},
        {"{\"version\":9,\"type\":\"done\",\"tick\":0,\"sequence\":0,\"lengths\":[1,2,3],\"crcs\":["
         "],",
         BST_WIRE_BAD_HEADER},
        {"{\"version\":9,\"type\":\"done\",\"tick\":0,\"sequence\":-1,\"lengths\":[16],\"crcs\":["
         "\"00000000\"],",
         BST_WIRE_BAD_HEADER},
        {"{\"version\":9,\"type\":\"done\",\"tick\":0.5,\"sequence\":0,\"lengths\":[16],\"crcs\":["
         "\"00000000\"],",
         BST_WIRE_BAD_HEADER},
        {"{\"version\":9,\"type\":\"done\",\"tick\":1e3,\"sequence\":0,\"lengths\":[16],\"crcs\":["
         "\"00000000\"],",
         BST_WIRE_BAD_HEADER},
        {"{\"version\":9,\"type\":\"done\",\"tick\":9999999999999999,\"sequence\":0,\"lengths\":["
         "16],\"crcs\":[\"00000000\"],",
         BST_WIRE_BAD_HEADER},
        {"{\"version\":9,\"version\":9,\"type\":\"done\",\"tick\":0,\"sequence\":0,\"lengths\":[16]"
         ",\"crcs\":[\"00000000\"],",
         BST_WIRE_BAD_HEADER},
        {"{\"version\":9,\"type\":\"do\\u006ee\",\"tick\":0,\"sequence\":0,\"lengths\":[16],"
         "\"crcs\":[\"00000000\"],",
         BST_WIRE_BAD_HEADER},
        {"{\"version\":9,\"type\":\"done\",\"tick\":0,\"sequence\":0,\"lengths\":[16],\"crcs\":["
         "\"0000000A\"],",
         BST_WIRE_BAD_HEADER},
        {"[1,", BST_WIRE_BAD_HEADER},
        {"{\"a\":[[[[[[[[[[]]]]]]]]]],", BST_WIRE_BAD_HEADER},
        /* members that are not known are skipped, 8 levels deep */
        {"{\"a\":[[{\"b\":[[[[[1]]]]]}]],\"version\":9,\"type\":\"done\",\"tick\":0,\"sequence\":0,"
         "\"lengths\":[16],\"crcs\":[\"00000000\"],",
         BST_WIRE_GOOD},
        {"{\"a\":[[{\"b\":[[[[[[1]]]]]]}]],\"version\":9,\"type\":\"done\",\"tick\":0,\"sequence\":"
         "0,"
         "\"lengths\":[16],\"crcs\":[\"00000000\"],",
         BST_WIRE_BAD_HEADER},
        {"", BST_WIRE_BAD_HEADER},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        if (read_text(cases[i].text, &out) != cases[i].fault) {
            fail_msg("%s: not %s", cases[i].text, bst_wire_fault_name(cases[i].fault));
        }
    }
    char text[BST_LINK_HEADER_BYTES + 1];
    const bst_link_header good = {.type = BST_LINK_DONE, .parts = 1, .slot = -1, .step = -1};
    size_t n = bst_link_header_write(&good, text);
    assert_int_equal(bst_link_header_read(&ctx, text, n, &out), BST_WIRE_GOOD);
    /* any one bit changed, any end cut off */
    for (size_t i = 0; i < n; i++) {
        for (int bit = 0; bit < 8; bit++) {
            text[i] = (char)(text[i] ^ (1 << bit));
            assert_int_not_equal(bst_link_header_read(&ctx, text, n, &out), BST_WIRE_GOOD);
            text[i] = (char)(text[i] ^ (1 << bit));
        }
        assert_int_not_equal(bst_link_header_read(&ctx, text, i, &out), BST_WIRE_GOOD);
    }
}

/* What the sender's struct holds is what the tables declare: no member twice, none outside. */
static void tables_fit_their_structs(void **state) {
    (void)state;
    for (int type = 0; type < BST_LINK_TYPES; type++) {
        const bst_wire_message *m = bst_wire_message_of((bst_link_type)type);
        assert_int_equal(bst_wire_type_of(m->name), type);
        for (int list = 0; list < 2; list++) {
            const bst_wire_field *table = list ? m->items : m->record;
            size_t room = list ? m->item_bytes : m->header_bytes;
            for (const bst_wire_field *f = table; f && f->name; f++) {
                size_t one =
                    f->type == BST_WIRE_BOOL ? sizeof(bool) : bst_wire_number_bytes(f->type);
                assert_true(f->count > 0 && f->offset + one * (size_t)f->count <= room);
                for (const bst_wire_field *g = table; g != f; g++) {
                    assert_string_not_equal(g->name, f->name);
                    assert_int_not_equal(g->offset, f->offset);
                }
            }
        }
    }
    assert_int_equal(bst_wire_type_of("nothing"), BST_LINK_TYPES);
}

static uint64_t add_text(uint64_t h, const char *text) {
    return bst_fnv(h, text, strlen(text) + 1);
}

static uint64_t add_number(uint64_t h, int64_t number) {
    char text[24];
    snprintf(text, sizeof text, "%lld", (long long)number);
    return add_text(h, text);
}

/* What a peer must know to read and write a record: names, order, types, lengths and units. */
static uint64_t add_layout(uint64_t h, const bst_wire_field *table) {
    for (const bst_wire_field *f = table; f && f->name; f++) {
        h = add_text(add_text(h, f->name), f->unit);
        h = add_number(add_number(h, (int64_t)f->type), f->count);
        h = add_number(h, (int64_t)bst_wire_offset(table, f));
    }
    return add_text(h, "end");
}

/* Another layout needs another version: a peer of the old one would read wrong numbers. After a
 * change raise BST_LINK_VERSION and VERSION of python/boresight/link/tables.py, and state the new
 * digest here. */
static void layouts_are_those_of_the_version(void **state) {
    (void)state;
    const struct {
        int version;
        uint64_t digest;
    } known = {9, UINT64_C(0x372395ae0fb9748a)};
    uint64_t h = BST_FNV_START;
    for (int t = 0; t < BST_LINK_TYPES; t++) {
        const bst_wire_message *m = bst_wire_message_of((bst_link_type)t);
        h = add_number(add_text(h, m->name), m->pixels);
        h = add_layout(add_layout(h, m->record), m->items);
    }
    if (h != known.digest || BST_LINK_VERSION != known.version) {
        fail_msg(
            "version %d of the link has layouts of digest 0x%016llx; this test knows version "
            "%d, 0x%016llx: a changed layout needs a new version",
            BST_LINK_VERSION, (unsigned long long)h, known.version,
            (unsigned long long)known.digest);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(checksums_are_those_of_the_rfc),
        cmocka_unit_test(checksums_are_the_same_by_both_routes),
        cmocka_unit_test(a_record_lies_as_documented),
        cmocka_unit_test(what_is_encoded_is_decoded),
        cmocka_unit_test(wrong_values_are_refused),
        cmocka_unit_test(every_length_but_one_is_refused),
        cmocka_unit_test(headers_are_read),
        cmocka_unit_test(wrong_headers_are_refused),
        cmocka_unit_test(tables_fit_their_structs),
        cmocka_unit_test(layouts_are_those_of_the_version),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
