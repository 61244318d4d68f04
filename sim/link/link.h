/* The simulation's side of the link: other programs (peers) replace modules of a scenario. It binds
 * a local address (ZeroMQ ROUTER); peers connect (DEALER), name the modules that they play, and
 * answer each step. Packets: docs/reference/icd.md; use: docs/how-to/hardware_in_the_loop.md. Every
 * fault of a peer is counted: see bst_link_counter. Time-outs limit all waits. A link is for one
 * thread. */
#ifndef BST_LINK_LINK_H
#define BST_LINK_LINK_H

#include "boresight/archive.h"
#include "boresight/config.h"
#include "sim/astro/time.h"
#include "sim/link/packet.h"
#include "sim/link/payloads.h"

typedef struct bst_link bst_link;

typedef enum bst_link_silence { BST_LINK_STOP, BST_LINK_GO_ON } bst_link_silence;

/* The "link" block of a scenario. */
typedef struct bst_link_config {
    char address[128];
    char keys_file[512];      /* "": no authentication */
    double timeout_s;         /* for the answer to a step */
    double connect_timeout_s; /* for a peer's connection, before its first step */
    int32_t on_timeout;       /* bst_link_silence */
    bool shared_memory;
} bst_link_config;

extern const bst_config_desc bst_link_config_table[];

/* Waiting for the answer to a step. */
typedef enum bst_link_waiting {
    BST_LINK_AWAIT, /* until it arrives or the time-out expires */
    BST_LINK_HOLD,  /* for hold_s; then the run continues and uses the answer when it arrives */
    BST_LINK_RUSH,  /* no waiting: as hold_s 0 */
} bst_link_waiting;

/* Description of the run, for `welcome` and headers. */
typedef struct bst_link_run {
    const char *scenario;
    bst_time epoch;
    int64_t tick_rate_hz, duration_ticks;
    size_t pixel_bytes; /* of the largest frame */
    bst_link_waiting waiting;
    double hold_s;
} bst_link_run;

/* Checks the address; nothing is bound yet. */
bst_status bst_link_create(bst_ctx *ctx, const bst_link_config *config, const bst_link_run *run,
                           bst_link **out) BST_MUST_CHECK;
/* Creates a link without socket and peers: bst_link_put gives the answers of the parts.
 *
 * Errors:    BST_ERR_MEMORY
 * Ownership: free *out with bst_link_close */
bst_status bst_link_create_local(bst_ctx *ctx, const bst_link_run *run,
                                 bst_link **out) BST_MUST_CHECK;
/* Gives a part of a local link the answer to its next step.
 *
 * Given:     scope    "observer/sensor"; NULL: the first sensor with a part that sends such
 * messages type     of the message payload  struct of the type; copied Errors: BST_ERR_NOT_FOUND:
 * no such part; BST_ERR_FORMAT: a value out of range; BST_ERR_MEMORY */
bst_status bst_link_put(bst_ctx *ctx, bst_link *link, const char *scope, bst_link_type type,
                        const void *payload) BST_MUST_CHECK;
/* Archives the commands that a part of a local link has not taken.
 *
 * Errors:    BST_ERR_STATE: a peer plays the part; BST_ERR_FORMAT, BST_ERR_MEMORY */
bst_status bst_link_archive(bst_link *link, int part, bst_archive *archive) BST_MUST_CHECK;
/* Sets the reason of the run's end, for bst_link_close. */
void bst_link_set_end(bst_link *link, int reason, const char *text);
/* Sends `end` with the reason to the peers (bst_link_end.reason; the reason of bst_link_set_end
 * takes precedence) and frees the link; `link` may be NULL. */
void bst_link_close(bst_link *link, int reason, const char *text);

/* Adds a module that a peer plays; *number identifies it in bst_link_exchange. Before
 * bst_link_open. */
bst_status bst_link_add(bst_ctx *ctx, bst_link *link, const bst_link_part *part,
                        int *number) BST_MUST_CHECK;
/* Binds the address, once; otherwise the first exchange binds it. BST_ERR_IO: address in use. */
bst_status bst_link_open(bst_ctx *ctx, bst_link *link) BST_MUST_CHECK;
/* Waits up to connect_timeout_s until each part has a peer. Errors as bst_link_exchange. */
bst_status bst_link_gather(bst_ctx *ctx, bst_link *link) BST_MUST_CHECK;
/* Sets a function that is called about ten times a second while waiting; true ends the wait with
 * BST_ERR_INTERRUPTED. */
void bst_link_on_wait(bst_link *link, bool (*stop)(void *user), void *user);

/* A message to a peer. */
typedef struct bst_link_input {
    bst_link_type type;
    const void *payload; /* struct of the message type */
    int64_t tick;        /* tick at which it was written */
    /* BST_LINK_FRAME: pixels, sent without a copy. `hold` is called before sending, `release` after
     * it, possibly by another thread; both may be NULL. */
    const uint16_t *pixels;
    size_t pixel_bytes;
    void (*hold)(void *owner);
    void (*release)(void *owner);
    void *owner;
} bst_link_input;

/* A message that a peer may answer with, at most one of each type. */
typedef struct bst_link_output {
    bst_link_type type;
    void *payload; /* struct of the type with room for `capacity` items */
    int capacity;
    bool given;  /* set by the exchange: it was received */
    int dropped; /* items beyond the capacity */
} bst_link_output;

/* Messages to a peer in one step, and its possible answers. */
typedef struct bst_link_messages {
    const bst_link_input *inputs; /* [input_count] */
    int input_count;
    bst_link_output *outputs; /* [output_count] */
    int output_count;
} bst_link_messages;

/* Executes one step of a part: sends the inputs (at most 63) and waits for the answer. *answered
 * false: time-out, and on_timeout is BST_LINK_GO_ON. BST_ERR_IO: no peer, no answer, or the peer
 * reports a failure; BST_ERR_INTERRUPTED: bst_link_on_wait. */
bst_status bst_link_exchange(bst_ctx *ctx, bst_link *link, int part, int64_t tick,
                             const bst_link_messages *messages, bool *answered) BST_MUST_CHECK;

/* Takes another received answer of a part, with BST_LINK_HOLD or BST_LINK_RUSH.
 *
 * Given:     part  number of the part
 *            tick  tick of the step
 * Returned:  outputs  [output_count] the answer
 *            *more    true if there was one; always false with BST_LINK_AWAIT
 * Notes:     in these modes answers arrive at any time. bst_link_exchange returns the oldest one,
 *            even of an earlier step, and *answered false is not a failure there; this function
 *            returns the others. */
bst_status bst_link_more(bst_ctx *ctx, bst_link *link, int part, int64_t tick,
                         bst_link_output *outputs, int output_count, bool *more) BST_MUST_CHECK;

/* True if the peer of a part can take another step; then the inputs of the step should be prepared.
 *
 * Given:     part     number of the part
 *            tick     tick of the step
 *            outputs  [output_count] payloads of the part's outputs
 * Returned:  *ready  false if LINK_AHEAD steps are unanswered (counted); always true with
 *                    BST_LINK_AWAIT
 * Errors:    those of bst_link_exchange */
bst_status bst_link_ready(bst_ctx *ctx, bst_link *link, int part, int64_t tick,
                          const bst_link_output *outputs, int output_count,
                          bool *ready) BST_MUST_CHECK;

/* Starts recording the answers of all parts to a file, before the first exchange.
 * bst_link_record_end reports write errors. */
bst_status bst_link_record(bst_ctx *ctx, bst_link *link, const char *path) BST_MUST_CHECK;

/* Flushes and closes the recording of a link; without one it does nothing.
 *
 * Errors:    BST_ERR_IO if anything could not be written */
bst_status bst_link_record_end(bst_ctx *ctx, bst_link *link) BST_MUST_CHECK;
/* Replays a recording: answers come from the file, without a socket or peers. BST_ERR_FORMAT: an
 * exchange differs from the recorded one. */
bst_status bst_link_replay(bst_ctx *ctx, bst_link *link, const char *path) BST_MUST_CHECK;
/* True if a link replays a recording. */
bool bst_link_replays(const bst_link *link);
/* Records or replays a frame drop of pacing, for an instance that is no external part. Recording:
 * stores *dropped; replaying: sets it. */
bst_status bst_link_keep_drop(bst_ctx *ctx, bst_link *link, const char *instance, int64_t tick,
                              bool *dropped) BST_MUST_CHECK;

/* Counters of the link by name ("link_bad_crc"); false after the last. */
bool bst_link_counter(const bst_link *link, int index, const char **name, int64_t *count);
/* Increase of a counter since the last call; -1 after the last counter. */
int64_t bst_link_news(bst_link *link, int index, const char **name);
/* Next line of the link's notes ("peer x: ..."); NULL: no more. It keeps a few dozen lines between
 * calls. */
const char *bst_link_note(bst_link *link);

/* ---- a peer in C ---- */

typedef struct bst_link_peer bst_link_peer;

/* Connects a peer to a simulation, which may start later, and sends `hello`. `keys_file`: for a
 * link with authentication (bst_curve_keys_read), else NULL. */
bst_status bst_link_peer_open(bst_ctx *ctx, const char *address, const char *keys_file,
                              const bst_link_hello *hello, bst_link_peer **out) BST_MUST_CHECK;
/* Closes the peer's side of a link and frees it; NULL is allowed. */
void bst_link_peer_close(bst_link_peer *peer);

/* A received message. Pointers are valid until the next bst_link_peer_receive. */
typedef struct bst_link_received {
    bst_link_header header;
    const void *payload;    /* struct of header.type */
    const uint16_t *pixels; /* of a frame */
} bst_link_received;

/* Receives the next message of the simulation; BST_ERR_NOT_FOUND: time-out. Repeats `hello` after
 * an `error` that asks for it. Invalid messages are an error. */
bst_status bst_link_peer_receive(bst_ctx *ctx, bst_link_peer *peer, double timeout_s,
                                 bst_link_received *out) BST_MUST_CHECK;
/* Sends a payload as part of the answer to `step` (a received header, or NULL: none). */
bst_status bst_link_peer_send(bst_ctx *ctx, bst_link_peer *peer, bst_link_type type,
                              const void *payload, const bst_link_header *step) BST_MUST_CHECK;

#endif
