/* Receives messages on the simulation's side of the link; every value is checked before use. */
#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "sim/core/wall_clock.h"
#include "sim/link/link_internal.h"

enum { MOST_PARTS = 4 }; /* identity, header, payload, and one excess part */

typedef struct message {
    zmq_msg_t parts[MOST_PARTS];
    int count; /* stored parts; further ones are discarded */
    bool more;
    link_id id;
    bst_link_header header;
} message;

/* Payloads of control messages. */
typedef union control_message {
    bst_link_hello hello;
    bst_link_done done;
    bst_link_health health;
    bst_link_end end;
} control_message;

static int find_peer(const bst_link *link, const link_id *id) {
    for (int p = 0; p < LINK_PEERS; p++) {
        const link_peer *peer = &link->peers[p];
        if (peer->used && peer->id.count == id->count &&
            memcmp(peer->id.bytes, id->bytes, id->count) == 0) {
            return p;
        }
    }
    return -1;
}

void bst_link_unassign(bst_link *link, int peer) {
    for (int i = 0; i < link->part_count; i++) {
        if (link->parts[i].peer == peer) {
            link->parts[i].peer = -1;
            for (int a = 0; a < LINK_AHEAD; a++) {
                link->parts[i].ahead[a].open = false;
            }
        }
    }
}

/* True if the peer plays a part of the simulation. */
static bool plays_any(const bst_link *link, int peer) {
    for (int i = 0; i < link->part_count; i++) {
        if (link->parts[i].peer == peer) {
            return true;
        }
    }
    return false;
}

static const char *name_of(const bst_link *link, int peer) {
    return peer >= 0 && *link->peers[peer].name ? link->peers[peer].name : "a peer";
}

/* Counts an invalid message and sends an `error` to its sender. */
static void reject_message(bst_link *link, link_exchange *x, const message *m, int peer, int event,
                           const char *fault, const char *text) {
    bst_link_event(link, x->ctx, event, "%s: %s", name_of(link, peer), text);
    if (x->replies < LINK_REPLIES) {
        x->replies++;
        bst_link_reply(link, &m->id, peer >= 0 ? &link->peers[peer] : NULL, fault,
                       m->header.sequence, text);
    }
}

/* Checks whether a list as in bst_link_hello.serves names a part. */
static bool serves(const char *list, const char *instance) {
    const char *last = strrchr(instance, '/');
    last = last ? last + 1 : instance;
    while (*list) {
        size_t n = strcspn(list, ",");
        if ((n == 1 && *list == '*') || (strlen(instance) == n && !strncmp(list, instance, n)) ||
            (strlen(last) == n && !strncmp(list, last, n))) {
            return true;
        }
        list += n + (list[n] == ',');
    }
    return false;
}

/* Entry of the peer table for a connection: its own, a free one, or one without a part. */
static int place_for(bst_link *link, const link_id *id) {
    int known = find_peer(link, id);
    for (int p = 0; known < 0 && p < LINK_PEERS; p++) {
        known = !link->peers[p].used ? p : known;
    }
    /* replace peers that have left or play no part */
    for (int blocked = 0; blocked < 2; blocked++) {
        for (int p = 0; known < 0 && p < LINK_PEERS; p++) {
            known = !plays_any(link, p) && link->peers[p].blocked == blocked ? p : known;
        }
    }
    return known;
}

/* Answers `hello` with `welcome`. */
static void send_welcome(bst_link *link, int peer, const link_exchange *x) {
    bst_link_welcome *w = link->welcome;
    memset(w, 0, sizeof *w);
    snprintf(w->scenario, sizeof w->scenario, "%s", link->scenario);
    bst_time_to_utc(link->run.epoch, 6, w->epoch_utc, sizeof w->epoch_utc);
    w->tick_rate_hz = link->run.tick_rate_hz;
    w->duration_ticks = link->run.duration_ticks;
    w->timeout_s = link->config.timeout_s;
    if (link->shared && link->peers[peer].shared_memory) {
        snprintf(w->shared_memory, sizeof w->shared_memory, "%s",
                 bst_shared_frames_name(link->shared));
        w->slot_bytes = bst_shared_frames_slot_bytes(link->shared);
        w->slots = BST_LINK_SLOTS;
    }
    for (int i = 0; i < link->part_count; i++) {
        if (link->parts[i].peer == peer) {
            w->parts[w->count++] = link->parts[i].about;
        }
    }
    bst_link_header header = {.type = BST_LINK_WELCOME, .tick = x->tick, .step = -1};
    (void)bst_link_send(link, peer, &header, w, NULL, 0);
}

/* Handles `hello`: assigns to the peer the parts that it serves. */
static void take_hello(bst_link *link, link_exchange *x, const message *m,
                       const bst_link_hello *hello) {
    int p = place_for(link, &m->id);
    if (p < 0) {
        reject_message(link, x, m, -1, LINK_REFUSED, "refused", "there are 16 peers already");
        return;
    }
    link_peer *peer = &link->peers[p];
    bst_link_unassign(link, p);
    *peer = (link_peer){.used = true,
                        .id = m->id,
                        .heard_step = peer->heard_step,
                        .heard = peer->heard,
                        .sent = peer->sent,
                        .shared_memory = hello->shared_memory,
                        .expected = m->header.sequence + 1};
    memcpy(peer->name, hello->name, sizeof peer->name);
    int played = 0;
    for (int i = 0; i < link->part_count; i++) {
        link_part *part = &link->parts[i];
        if (!serves(hello->serves, part->about.instance)) {
            continue;
        }
        if (part->peer >= 0) {
            bst_link_event(link, x->ctx, LINK_TAKEOVER, "%s takes %s from %s", name_of(link, p),
                           part->about.instance, name_of(link, part->peer));
        }
        part->peer = p;
        part->had_peer = true;
        for (int a = 0; a < LINK_AHEAD; a++) {
            part->ahead[a].open = false;
        }
        played++;
        if (i == x->part) {
            x->resend = x->prolong = true;
        }
    }
    if (played == 0) {
        char text[400];
        snprintf(text, sizeof text, "no part is called \"%.100s\" (there is %.160s%s)",
                 hello->serves, link->parts[0].about.instance,
                 link->part_count > 1 ? " and others" : "");
        reject_message(link, x, m, p, LINK_REFUSED, "refused", text);
        return;
    }
    bst_link_event(link, x->ctx, LINK_HELLO_TAKEN, "%s plays %d part%s", name_of(link, p), played,
                   played > 1 ? "s" : "");
    send_welcome(link, p, x);
}

/* Checks the sequence number of a message. False: discard it. */
static bool in_order(bst_link *link, link_exchange *x, const message *m, int p) {
    link_peer *peer = &link->peers[p];
    int64_t sequence = m->header.sequence;
    char text[120];
    if (sequence < peer->expected) {
        bool last = sequence == peer->expected - 1;
        snprintf(text, sizeof text, "sequence %lld has %s (expected: %lld)", (long long)sequence,
                 last ? "come already" : "been passed", (long long)peer->expected);
        reject_message(link, x, m, p, last ? LINK_DUPLICATE : LINK_OUT_OF_ORDER,
                       last ? "duplicate" : "out_of_order", text);
        return false;
    }
    if (sequence > peer->expected) {
        bst_link_event(link, x->ctx, LINK_GAP, "%s: sequence %lld after %lld", name_of(link, p),
                       (long long)sequence, (long long)peer->expected - 1);
    }
    peer->expected = sequence + 1;
    return true;
}

/* The output of this type in a peer's answer; NULL: none. */
static bst_link_output *output_of(const link_answer *answer, bst_link_type type) {
    for (int i = 0; i < answer->output_count; i++) {
        if (answer->outputs[i].type == type) {
            return &answer->outputs[i];
        }
    }
    return NULL;
}

/* The unfinished answer to which a message of peer p belongs; NULL: none. */
static link_answer *answer_of(bst_link *link, link_exchange *x, const bst_link_header *h, int p) {
    for (int i = 0; i < link->part_count; i++) {
        link_part *part = &link->parts[i];
        if (part->peer != p || strcmp(h->instance, part->about.instance) != 0) {
            continue;
        }
        if (i == x->part && x->answer.open && x->answer.step == h->step) {
            return &x->answer;
        }
        for (int a = 0; a < LINK_AHEAD; a++) {
            if (part->ahead[a].open && !part->ahead[a].finished && part->ahead[a].step == h->step) {
                return &part->ahead[a];
            }
        }
    }
    return NULL;
}

/* Buffer for the payload of a message. NULL, after an error reply: the message is rejected. */
static void *room_for(bst_link *link, link_exchange *x, const message *m, int p,
                      control_message *control, int *capacity) {
    const bst_link_header *h = &m->header;
    *capacity = 0;
    if (h->type == BST_LINK_HELLO || h->type == BST_LINK_HEALTH || h->type == BST_LINK_END) {
        return control;
    }
    const link_part *part = x->part >= 0 ? &link->parts[x->part] : NULL;
    const link_answer *answer = answer_of(link, x, h, p);
    char text[300];
    if (!answer) {
        snprintf(text, sizeof text, "%s for step %lld of %.100s; step %lld of %.100s is under way",
                 bst_wire_message_of(h->type)->name, (long long)h->step, h->instance,
                 part ? (long long)part->step - 1 : -1LL, part ? part->about.instance : "no part");
        reject_message(link, x, m, p, LINK_LATE, "late", text);
        return NULL;
    }
    if (h->type == BST_LINK_DONE) {
        return control;
    }
    bst_link_output *output = output_of(answer, h->type);
    if (!output) {
        snprintf(text, sizeof text, "%s is no output of %.160s", bst_wire_message_of(h->type)->name,
                 h->instance);
        reject_message(link, x, m, p, BST_WIRE_UNEXPECTED, bst_wire_fault_name(BST_WIRE_UNEXPECTED),
                       text);
        return NULL;
    }
    if (output->given) {
        snprintf(text, sizeof text, "a second %s in step %lld: the first one holds",
                 bst_wire_message_of(h->type)->name, (long long)h->step);
        reject_message(link, x, m, p, LINK_REPEATED, "repeated", text);
        return NULL;
    }
    *capacity = output->capacity;
    return output->payload;
}

/* Completes the answer to a step at `done`, if all its messages were received. */
static void take_done(bst_link *link, link_exchange *x, const message *m, int p,
                      const bst_link_done *done) {
    char text[120];
    link_answer *answer = answer_of(link, x, &m->header, p);
    answer->finished = done->outputs == answer->taken;
    if (!answer->finished) {
        snprintf(text, sizeof text,
                 "done with %d outputs, %d have been taken: send what is missing, "
                 "then done again",
                 done->outputs, answer->taken);
        reject_message(link, x, m, p, LINK_INCOMPLETE, "incomplete", text);
    }
}

/* Restarts the time-outs of steps that are not awaited. */
static void prolong_ahead(bst_link *link, int p) {
    for (int i = 0; i < link->part_count; i++) {
        for (int a = 0; link->parts[i].peer == p && a < LINK_AHEAD; a++) {
            link->parts[i].ahead[a].sent_s = bst_wall_seconds();
        }
    }
}

/* Handles a decoded message of a peer: hello, done, health, end or an output. */
static void take_content(bst_link *link, link_exchange *x, const message *m, int p,
                         const control_message *control, int dropped) {
    bst_link_output *output;
    link_answer *answer;
    switch (m->header.type) {
        case BST_LINK_HELLO:
            take_hello(link, x, m, &control->hello);
            return;
        case BST_LINK_DONE:
            take_done(link, x, m, p, &control->done);
            return;
        case BST_LINK_HEALTH:
            x->prolong |= x->part >= 0 && link->parts[x->part].peer == p;
            prolong_ahead(link, p);
            if (control->health.state == 2) {
                bst_fail(x->ctx, BST_ERR_IO, "link: %s says that it has failed: %s",
                         name_of(link, p), control->health.text);
                x->failed = true;
            }
            return;
        case BST_LINK_END:
            bst_link_event(link, x->ctx, LINK_LEFT, "%s leaves: %s", name_of(link, p),
                           control->end.text);
            bst_link_unassign(link, p);
            return;
        default:
            answer = answer_of(link, x, &m->header, p);
            output = output_of(answer, m->header.type);
            output->given = true;
            answer->taken++;
            output->dropped = dropped;
            if (dropped > 0) {
                bst_link_event(link, x->ctx, LINK_ITEMS_DROPPED,
                               "%s: %d items of %s beyond the %d that there is room for",
                               name_of(link, p), dropped, bst_wire_message_of(m->header.type)->name,
                               output->capacity);
            }
    }
}

/* Checks the number of messages of a peer: one that floods the link is ignored. */
static bool is_heard(bst_link *link, const link_exchange *x, int p) {
    link_peer *peer = &link->peers[p];
    if (peer->heard_step != link->exchanges) {
        peer->heard_step = link->exchanges;
        peer->heard = 0;
    }
    if (!peer->blocked && ++peer->heard > LINK_FLOOD) {
        peer->blocked = true;
        bst_link_unassign(link, p);
        bst_link_event(link, x->ctx, LINK_FLOODED,
                       "%s sent %d messages in a step; it is not heard any more on this connection",
                       name_of(link, p), LINK_FLOOD);
    } else if (peer->blocked) {
        link->counts[LINK_FLOODED]++;
    }
    return !peer->blocked;
}

/* Reads the header of a message and checks that it is for the simulation. */
static bst_wire_fault read_header(bst_ctx *why, message *m) {
    m->header = (bst_link_header){.type = BST_LINK_TYPES, .sequence = -1};
    if (m->count < 2) {
        bst_fail(why, BST_ERR_FORMAT, "a message has a header and a payload; this has neither");
        return BST_WIRE_BAD_LENGTH;
    }
    bst_wire_fault fault = bst_link_header_read(why, zmq_msg_data(&m->parts[1]),
                                                zmq_msg_size(&m->parts[1]), &m->header);
    if (fault == BST_WIRE_GOOD &&
        !(bst_wire_message_of(m->header.type)->from & BST_WIRE_FROM_PEER)) {
        bst_fail(why, BST_ERR_FORMAT, "only the simulation sends %s",
                 bst_wire_message_of(m->header.type)->name);
        fault = BST_WIRE_UNEXPECTED;
    }
    return fault;
}

/* Checks the number of message parts, their length and checksum. */
static bst_wire_fault check_parts(bst_ctx *why, message *m) {
    if (m->count != 3 || m->more) {
        bst_fail(why, BST_ERR_FORMAT, "%s has a header and one part; %s came",
                 bst_wire_message_of(m->header.type)->name, m->count < 3 ? "fewer" : "more");
        return BST_WIRE_BAD_LENGTH;
    }
    return bst_link_part_check(why, &m->header, 0, zmq_msg_data(&m->parts[2]),
                               zmq_msg_size(&m->parts[2]));
}

/* Checks, decodes and handles one message of a peer. */
static void take_message(bst_link *link, link_exchange *x, message *m) {
    int p = find_peer(link, &m->id);
    if (p < 0 && (p = place_for(link, &m->id)) >= 0) {
        link->peers[p] = (link_peer){.used = true, .id = m->id};
    }
    if (p >= 0 && !is_heard(link, x, p)) {
        return;
    }
    bst_ctx why = {0}; /* a faulty message does not end the run */
    bst_wire_fault fault = read_header(&why, m);
    if (fault == BST_WIRE_GOOD && m->header.type != BST_LINK_HELLO) {
        if (p < 0 || (!plays_any(link, p) && m->header.type != BST_LINK_END)) {
            reject_message(link, x, m, p, LINK_STRANGER, "stranger",
                           "this peer plays no part now: say hello (again)");
            return;
        }
    }
    /* a rejected message uses up its number, so far as that can be read */
    bool numbered = m->header.type != BST_LINK_HELLO && m->header.sequence >= 0;
    if (numbered && p >= 0 && plays_any(link, p) && !in_order(link, x, m, p)) {
        return;
    }
    if (fault == BST_WIRE_GOOD) {
        fault = check_parts(&why, m);
    }
    int capacity = 0, dropped = 0;
    control_message control;
    void *room = NULL;
    if (fault == BST_WIRE_GOOD) {
        room = room_for(link, x, m, p, &control, &capacity);
        if (!room) {
            return;
        }
        fault =
            bst_wire_decode(&why, bst_wire_message_of(m->header.type), zmq_msg_data(&m->parts[2]),
                            zmq_msg_size(&m->parts[2]), room, capacity, &dropped);
    }
    if (fault != BST_WIRE_GOOD) {
        reject_message(link, x, m, p, (int)fault, bst_wire_fault_name(fault), why.message);
        return;
    }
    link->counts[BST_WIRE_GOOD]++;
    take_content(link, x, m, p, &control, dropped);
}

/* Receives one complete message if there is one. */
static bool receive(bst_link *link, message *m) {
    m->count = 0;
    m->more = false;
    int more = 1;
    while (more) {
        zmq_msg_t spare, *part = m->count < MOST_PARTS ? &m->parts[m->count] : &spare;
        zmq_msg_init(part);
        if (zmq_msg_recv(part, link->router, ZMQ_DONTWAIT) < 0) {
            zmq_msg_close(part);
            break;
        }
        more = zmq_msg_more(part);
        bst_link_flow_take(link, part);
        if (part == &spare) {
            m->more = true;
            zmq_msg_close(&spare);
        } else {
            m->count++;
        }
    }
    if (m->count > 0) {
        size_t bytes = zmq_msg_size(&m->parts[0]);
        m->id.count = bytes < LINK_ID_BYTES ? bytes : LINK_ID_BYTES;
        memcpy(m->id.bytes, zmq_msg_data(&m->parts[0]), m->id.count);
    }
    return m->count > 0;
}

/* Processes new and closed connections. */
static void watch(bst_link *link) {
    for (int i = 0; i < 1000; i++) {
        uint8_t event[6] = {0};
        char address[300];
        if (zmq_recv(link->monitor, event, sizeof event, ZMQ_DONTWAIT) < 0 ||
            zmq_recv(link->monitor, address, sizeof address, ZMQ_DONTWAIT) < 0) {
            return;
        }
        uint16_t kind;
        int32_t fd;
        memcpy(&kind, event, sizeof kind);
        memcpy(&fd, event + sizeof kind, sizeof fd);
        if (kind == ZMQ_EVENT_ACCEPTED) {
            bst_link_flow_open(link, fd);
        } else {
            bst_link_flow_close(link, fd);
        }
        link->counts[kind == ZMQ_EVENT_ACCEPTED ? LINK_CONNECTED : LINK_DISCONNECTED]++;
    }
}

bst_status bst_link_take(bst_link *link, link_exchange *x, int wait_ms) {
    zmq_pollitem_t items[3] = {{.socket = link->router, .events = ZMQ_POLLIN},
                               {.socket = link->monitor, .events = ZMQ_POLLIN},
                               {.socket = link->asker, .events = ZMQ_POLLIN}};
    /* parts of an incomplete message do not wake the poll */
    if (bst_link_flow_watched(link) && wait_ms > LINK_LOOK_MS) {
        wait_ms = LINK_LOOK_MS;
    }
    int ready = zmq_poll(items, link->asker ? 3 : 2, wait_ms);
    if (ready < 0 && errno != EINTR) {
        return bst_fail(x->ctx, BST_ERR_IO, "link: %s", zmq_strerror(errno));
    }
    if (ready > 0 && items[1].revents) {
        watch(link);
    }
    if (ready > 0 && link->asker && items[2].revents &&
        bst_curve_answer(link->asker, &link->keys)) {
        bst_link_event(link, x->ctx, LINK_NO_KEY, "a peer that has not the keys is refused");
    }
    bst_link_flow_check(link, x->ctx);
    message m;
    x->quiet = true;
    if (ready > 0 && items[0].revents && receive(link, &m)) {
        x->quiet = false;
        take_message(link, x, &m);
        for (int i = 0; i < m.count; i++) {
            zmq_msg_close(&m.parts[i]);
        }
    }
    return x->failed ? BST_ERR_IO : BST_OK;
}
