/* Internal types of the simulation's side of the link. */
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
    LINK_FLYING = 3, /* frames that ZeroMQ may hold without a copy */
    LINK_NOTES = 32, /* lines kept for bst_link_note */
    LINK_NOTE_BYTES = 300,
    LINK_WARNINGS = 20, /* warnings in the log; further ones are only counted */
    LINK_REPLIES = 32,  /* `error` replies per step */
    LINK_FLOOD = 10000, /* messages of a peer in a step; further ones are ignored */
    LINK_QUEUE = 64,    /* queued messages per peer and direction */
    LINK_MESSAGE_BYTES =
        16 << 20, /* limit of a received message part; a peer that exceeds it is disconnected */
    /* limit of received and unread bytes (complete or partial messages); beyond it the worst
     * connection is closed. The answer to a step has a few MiB. */
    LINK_WAITING_BYTES = 64 << 20,
    LINK_WAITING_ALL = 256 << 20,
    LINK_LOOK_MS = 10, /* ms between checks while waiting */
    LINK_FLOWS = 256,  /* simultaneous connections */
    LINK_ID_BYTES = 255,
    LINK_AHEAD = 2,        /* unanswered steps of a part if answers are not awaited */
    LINK_PARTING_MS = 500, /* ms for sending `end` and earlier messages */
    LINK_END_BYTES = 512,  /* buffer for the payload of `end` */
    LINK_EXTENSIONS =
        10, /* maximum number of time-outs per step, extended by `health` and `hello` */
};

/* Counted events besides the faults of wire.h. */
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
    LINK_OVERSIZED, /* too many unread bytes */
    LINK_NO_KEY,    /* peers without valid keys */
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
    int64_t expected;   /* next sequence number from the peer */
    int64_t sent;       /* next sequence number to the peer */
    int64_t heard_step; /* exchange to which the number of received messages refers: */
    int heard;
} link_peer;

/* The answer to a step, while it is received. */
typedef struct link_answer {
    bool open, finished; /* finished: `done` was received */
    int64_t step;
    double sent_s; /* wall time */
    bst_link_output *outputs;
    int output_count, taken;
} link_answer;

/* A TCP connection and the number of bytes read from it. */
typedef struct link_flow {
    int fd;
    int64_t taken;
} link_flow;

/* A message that the program itself gives to a part (link_local.c). */
typedef struct link_given {
    void *payload; /* owned; NULL: none yet */
    size_t bytes;
    bool pending; /* the part has not taken it */
} link_given;

typedef struct link_part {
    bst_link_part about;
    link_given given[BST_LINK_TYPES]; /* of a local link */
    int peer;                         /* -1: none */
    bool had_peer;
    int64_t step;                  /* number of the next exchange */
    link_answer ahead[LINK_AHEAD]; /* unawaited steps; their outputs are owned */
} link_part;

/* link_record.c: recorded answers */
typedef struct link_tape link_tape;

/* A frame that ZeroMQ holds. */
typedef struct link_flying {
    int busy; /* atomic */
    void (*release)(void *owner);
    void *owner;
} link_flying;

struct bst_link {
    bool local; /* no socket: bst_link_put gives the answers */
    bst_link_config config;
    char address[BST_LINK_ENDPOINT_BYTES];
    char scenario[BST_LINK_NAME_BYTES];
    bst_link_run run;
    void *context, *router, *monitor;
    void *asker; /* socket of ZeroMQ's authentication requests; NULL: no keys */
    bst_curve_keys keys;
    link_flow flows[LINK_FLOWS];
    int flow_count;
    double flow_looked; /* wall time */
    bst_ipc_socket ipc; /* path "": none */
    bst_shared_frames *shared;
    link_peer peers[LINK_PEERS];
    link_part *parts;
    int part_count;
    bst_link_welcome *welcome; /* with room for all parts */
    link_flying flying[LINK_FLYING];
    link_tape *tape; /* NULL: neither recorded nor replayed */
    int64_t counts[LINK_EVENTS], reported[LINK_EVENTS];
    bst_link_end end;
    bool has_end;
    int64_t exchanges;
    int warnings;
    int parting; /* atomic: number of unsent `end` messages */
    char notes[LINK_NOTES][LINK_NOTE_BYTES];
    int note_first, note_count;
    bool (*stop)(void *user);
    void *stop_user;
};

/* The step of a part in progress. */
typedef struct link_exchange {
    bst_ctx *ctx;
    int part; /* -1: none; messages are only checked */
    int64_t tick;
    link_answer answer; /* BST_LINK_AWAIT: answer to this step; the caller owns the outputs */
    bool resend;        /* the peer has (re)connected: send again */
    bool prolong;       /* restart the time-out */
    bool failed;        /* reported by the peer: the message is in ctx */
    bool quiet;         /* no message was received */
    int replies;
} link_exchange;

/* link.c */
/* Counts an event, and adds the line to notes and log. */
void bst_link_event(bst_link *link, bst_ctx *ctx, int event, const char *format, ...)
    BST_PRINTF(4, 5);
/* Closes a recording's file and frees it (link_record.c); NULL is allowed. */
void bst_link_tape_free(link_tape *tape);
/* Records the answer to a call. */
void bst_link_tape_answer(bst_link *link, int part, int64_t tick, const bst_link_output *outputs,
                          int count);
/* Records the results of bst_link_ready and bst_link_more of a step without an answer. */
void bst_link_tape_note(bst_link *link, int part, int64_t tick, bool ready, bool more);

/* Replays the answer to a call.
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
/* link_local.c */
/* Answers a step of a part with what bst_link_put has given. */
void bst_link_local_answer(bst_link *link, int part, const bst_link_messages *messages);
/* Frees what a part was given. */
void bst_link_local_free(link_part *part);
/* link_send.c */
/* Sends a message to a peer. False: disconnected or its queue is full. `crc`: of the pixels. */
bool bst_link_send(bst_link *link, int peer, bst_link_header *header, const void *payload,
                   const bst_link_input *frame, uint32_t crc);
/* Sends `end`; `room` holds its payload until link->parting reports that it was sent. */
bool bst_link_send_end(bst_link *link, int peer, uint8_t *room);
/* Sends an `error` in reply to a message. */
void bst_link_reply(bst_link *link, const link_id *id, link_peer *peer, const char *fault,
                    int64_t sequence, const char *text);
/* link_flow.c */
/* Starts counting the bytes of a new connection. */
void bst_link_flow_open(bst_link *link, int fd);
/* Removes the connection of a closed file descriptor. */
void bst_link_flow_close(bst_link *link, int fd);
/* Counts a received message part as read from its connection. */
void bst_link_flow_take(bst_link *link, zmq_msg_t *part);

/* Closes the connection with most bytes waiting if a limit is exceeded; checks at intervals only.
 */
void bst_link_flow_check(bst_link *link, bst_ctx *ctx);
/* True if connections must be checked while waiting. */
bool bst_link_flow_watched(const bst_link *link);
/* link_receive.c */
/* Waits up to wait_ms for one message and processes it, or reports its fault. */
bst_status bst_link_take(bst_link *link, link_exchange *x, int wait_ms) BST_MUST_CHECK;
/* Removes the parts of a peer; its unanswered steps are lost. */
void bst_link_unassign(bst_link *link, int peer);

#endif
