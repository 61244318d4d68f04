/* Inside of the simulation's end, shared by its files only. */
#ifndef BST_LINK_LINK_INTERNAL_H
#define BST_LINK_LINK_INTERNAL_H

#include <zmq.h>

#include "sim/link/curve_keys.h"
#include "sim/link/endpoint.h"
#include "sim/link/ipc_socket.h"
#include "sim/link/link.h"
#include "sim/link/shared_frames.h"

enum {
    LINK_PEERS = 16,
    LINK_FLYING = 3, /* frames that ZeroMQ may hold without a copy at a time */
    LINK_NOTES = 32, /* lines kept for bst_link_note */
    LINK_NOTE_BYTES = 300,
    LINK_WARNINGS = 20,            /* lines of the log; then counters tell */
    LINK_REPLIES = 32,             /* `error` messages in answer to wrong ones, per step */
    LINK_FLOOD = 10000,            /* messages of a peer in a step, after which it is not heard */
    LINK_QUEUE = 64,               /* messages that wait in each direction, per peer */
    LINK_MESSAGE_BYTES = 16 << 20, /* of a part that a peer sends; beyond, it is disconnected */
    /* received by TCP and not taken, whole messages or parts of one: beyond, the worst connection
       is closed. The answer to a step is a few MiB at most. */
    LINK_WAITING_BYTES = 64 << 20,
    LINK_WAITING_ALL = 256 << 20,
    LINK_LOOK_MS = 10, /* between looks at them while waiting */
    LINK_FLOWS = 256,  /* connections at a time */
    LINK_ID_BYTES = 255,
    LINK_AHEAD = 2, /* steps of a part that its peer may have to answer, where answers are not
                       awaited */
    LINK_PARTING_MS = 500, /* for `end`, and what is before it, to leave */
    LINK_END_BYTES = 512,  /* room for its payload */
    LINK_EXTENSIONS = 10,  /* time-outs that a step may take at most, by `health` and `hello` */
};

/* What is counted besides the faults of wire.h. */
typedef enum link_event {
    LINK_DUPLICATE = BST_WIRE_FAULTS,
    LINK_OUT_OF_ORDER,
    LINK_GAP,
    LINK_LATE,
    LINK_REPEATED,
    LINK_INCOMPLETE,
    LINK_STRANGER,
    LINK_REFUSED,
    LINK_FLOODED,
    LINK_OVERSIZED, /* more bytes that are not taken than allowed */
    LINK_NO_KEY,    /* peers without the keys that the link asks for */
    LINK_TAKEOVER,
    LINK_HELLO_TAKEN,
    LINK_LEFT,
    LINK_UNANSWERED,
    LINK_ITEMS_DROPPED,
    LINK_HELD,
    LINK_SKIPPED,
    LINK_CONNECTED,
    LINK_DISCONNECTED,
    LINK_EVENTS
} link_event;

typedef struct link_id {
    uint8_t bytes[LINK_ID_BYTES];
    size_t count;
} link_id;

typedef struct link_peer {
    bool used, blocked, shared_memory;
    link_id id;
    char name[BST_LINK_NAME_BYTES];
    int64_t expected;   /* next sequence from it */
    int64_t sent;       /* next sequence to it */
    int64_t heard_step; /* exchange in which it has been heard so many times: */
    int heard;
} link_peer;

/* The answer to a step, as it comes in. */
typedef struct link_answer {
    bool open, finished; /* finished: `done` has come */
    int64_t step;
    double sent_s; /* wall time */
    bst_link_output *outputs;
    int output_count, taken;
} link_answer;

/* A connection by TCP, and the bytes of it that have been taken. */
typedef struct link_flow {
    int fd;
    int64_t taken;
} link_flow;

typedef struct link_part {
    bst_link_part about;
    int peer; /* -1: none */
    bool had_peer;
    int64_t step; /* of the next exchange */
    link_answer
        ahead[LINK_AHEAD]; /* steps whose answers are not awaited; their outputs are owned */
} link_part;

/* link_record.c: answers in a file */
typedef struct link_tape link_tape;

/* A frame that ZeroMQ holds. */
typedef struct link_flying {
    int busy; /* atomic */
    void (*release)(void *owner);
    void *owner;
} link_flying;

struct bst_link {
    bst_link_config config;
    char address[BST_LINK_ENDPOINT_BYTES];
    char scenario[BST_LINK_NAME_BYTES];
    bst_link_run run;
    void *context, *router, *monitor;
    void *asker; /* where ZeroMQ asks about peers' keys; NULL: there are none */
    bst_curve_keys keys;
    link_flow flows[LINK_FLOWS];
    int flow_count;
    double flow_looked; /* wall time */
    bst_ipc_socket ipc; /* path "": none */
    bst_shared_frames *shared;
    link_peer peers[LINK_PEERS];
    link_part *parts;
    int part_count;
    bst_link_welcome *welcome; /* room for all parts */
    link_flying flying[LINK_FLYING];
    link_tape *tape; /* NULL: neither recorded nor replayed */
    int64_t counts[LINK_EVENTS], told[LINK_EVENTS];
    bst_link_end end;
    bool has_end;
    int64_t exchanges;
    int warnings;
    int parting; /* atomic: `end` messages that have not left */
    char notes[LINK_NOTES][LINK_NOTE_BYTES];
    int note_first, note_count;
    bool (*stop)(void *user);
    void *stop_user;
};

/* A step of a part that is under way. */
typedef struct link_exchange {
    bst_ctx *ctx;
    int part; /* -1: none, messages are only looked at */
    int64_t tick;
    link_answer answer; /* BST_LINK_AWAIT: of this step; the outputs are the caller's */
    bool resend;        /* its peer has come, or come back */
    bool prolong;       /* its time-out starts anew */
    bool failed;        /* the peer says so: the message is in ctx */
    bool quiet;         /* no message has come */
    int replies;
} link_exchange;

/* link.c */
/* Counts, and keeps the line as a note and in the log. */
void bst_link_event(bst_link *link, bst_ctx *ctx, int event, const char *format, ...)
    BST_PRINTF(4, 5);
/* Closes a recording's file and frees it (link_record.c); NULL is allowed. */
void bst_link_tape_free(link_tape *tape);
/* Records the answer of a call. */
void bst_link_tape_answer(bst_link *link, int part, int64_t tick, const bst_link_output *outputs,
                          int count);
/* Records the results of bst_link_ready and bst_link_more of a step without an answer. */
void bst_link_tape_note(bst_link *link, int part, int64_t tick, bool ready, bool more);

/* Replays the answer of a call.
 *
 * Errors:    BST_ERR_FORMAT if the recording does not fit the run */
bst_status bst_link_tape_read(bst_ctx *ctx, bst_link *link, int part, int64_t tick,
                              bst_link_output *outputs, int count) BST_MUST_CHECK;

/* bst_link_more from a recording.
 *
 * Returned:  *more  true if an answer was stored in outputs
 * Errors:    BST_ERR_FORMAT if the recording does not fit the run */
bst_status bst_link_tape_read_more(bst_ctx *ctx, bst_link *link, int part, int64_t tick,
                                   bst_link_output *outputs, int count, bool *more) BST_MUST_CHECK;

/* bst_link_ready from a recording.
 *
 * Errors:    BST_ERR_FORMAT if the recording does not fit the run */
bst_status bst_link_tape_read_ready(bst_ctx *ctx, bst_link *link, int part, int64_t tick,
                                    bool *ready) BST_MUST_CHECK;
/* link_send.c */
/* Sends a message to a peer; false when it is gone or takes nothing. `crc`: of the pixels. */
bool bst_link_send(bst_link *link, int peer, bst_link_header *header, const void *payload,
                   const bst_link_input *frame, uint32_t crc);
/* Sends `end`; `room` holds its payload until link->parting says that it has left. */
bool bst_link_send_end(bst_link *link, int peer, uint8_t *room);
/* An `error` in answer to a message. */
void bst_link_reply(bst_link *link, const link_id *id, link_peer *peer, const char *fault,
                    int64_t sequence, const char *text);
/* link_flow.c */
/* Starts counting the bytes of a new connection. */
void bst_link_flow_open(bst_link *link, int fd);
/* Forgets the connection of a file descriptor that was closed. */
void bst_link_flow_close(bst_link *link, int fd);
/* Counts a received message part as read from its connection. */
void bst_link_flow_take(bst_link *link, zmq_msg_t *part);

/* Closes the connection with most bytes waiting if a limit is exceeded; checks at intervals only.
 */
void bst_link_flow_check(bst_link *link, bst_ctx *ctx);
/* Whether there are connections to be looked at while waiting. */
bool bst_link_flow_watched(const bst_link *link);
/* link_receive.c */
/* Waits up to wait_ms for one message and takes it, or says what is wrong with it. */
bst_status bst_link_take(bst_link *link, link_exchange *x, int wait_ms) BST_MUST_CHECK;
/* Takes its parts from a peer. What it has not answered is lost. */
void bst_link_unassign(bst_link *link, int peer);

#endif
