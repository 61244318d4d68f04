/* The simulation's end of the link: parts of a scenario that other programs play. It binds an
 * address of this machine (ZeroMQ ROUTER); peers connect to it (DEALER), say which parts they play,
 * and answer each step of such a part. What the bytes are: docs/reference/icd.md; how it is used:
 * docs/how-to/hardware_in_the_loop.md.
 *
 * Whatever a peer does has an answer that is counted: see bst_link_counter. Nothing waits longer
 * than the time-outs say. One thread uses a link. */
#ifndef BST_LINK_LINK_H
#define BST_LINK_LINK_H

#include "boresight/config.h"
#include "sim/astro/time.h"
#include "sim/link/packet.h"
#include "sim/link/payloads.h"

typedef struct bst_link bst_link;

typedef enum bst_link_silence { BST_LINK_STOP, BST_LINK_GO_ON } bst_link_silence;

/* A scenario's "link". */
typedef struct bst_link_config {
    char address[128];
    char keys_file[512];      /* "": the link asks for none */
    double timeout_s;         /* for the answer to a step */
    double connect_timeout_s; /* for a peer that plays a part, at its first step */
    int32_t on_timeout;       /* bst_link_silence */
    bool shared_memory;
} bst_link_config;

extern const bst_config_desc bst_link_config_table[];

/* How long a step waits for its answer. */
typedef enum bst_link_waiting {
    BST_LINK_AWAIT, /* until it comes, or the time-outs say that it does not */
    BST_LINK_HOLD,  /* for hold_s; then the run goes on, and the answer counts when it comes */
    BST_LINK_RUSH,  /* not at all: the same with hold_s 0 */
} bst_link_waiting;

/* What the run is, for `welcome` and headers. */
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
/* How the run has ended, for bst_link_close. */
void bst_link_set_end(bst_link *link, int reason, const char *text);
/* Tells the peers why (bst_link_end.reason; what bst_link_set_end has said goes before) and lets go
 * of everything; `link` may be NULL. */
void bst_link_close(bst_link *link, int reason, const char *text);

/* Adds a part that a peer is to play; *number is what bst_link_exchange takes. Before
 * bst_link_open. */
bst_status bst_link_add(bst_ctx *ctx, bst_link *link, const bst_link_part *part,
                        int *number) BST_MUST_CHECK;
/* Binds the address; once, else by the first exchange. BST_ERR_IO: it is taken. */
bst_status bst_link_open(bst_ctx *ctx, bst_link *link) BST_MUST_CHECK;
/* Waits until each part has a peer, for connect_timeout_s. Errors as bst_link_exchange. */
bst_status bst_link_gather(bst_ctx *ctx, bst_link *link) BST_MUST_CHECK;
/* Asked about ten times a second while waiting; true ends the wait with BST_ERR_INTERRUPTED. */
void bst_link_on_wait(bst_link *link, bool (*stop)(void *user), void *user);

/* A message to the peer. */
typedef struct bst_link_input {
    bst_link_type type;
    const void *payload; /* its struct */
    int64_t tick;        /* at which it was written */
    /* BST_LINK_FRAME: the pixels, sent without a copy. `hold` is called before they are, `release`
     * when they have been, perhaps from another thread; both may be NULL. */
    const uint16_t *pixels;
    size_t pixel_bytes;
    void (*hold)(void *owner);
    void (*release)(void *owner);
    void *owner;
} bst_link_input;

/* A message that the peer may answer with, at most one of each. */
typedef struct bst_link_output {
    bst_link_type type;
    void *payload; /* its struct with room for `capacity` items */
    int capacity;
    bool given;  /* set by the exchange */
    int dropped; /* items beyond the capacity */
} bst_link_output;

/* What a part is sent in a step, and what it may answer with. */
typedef struct bst_link_messages {
    const bst_link_input *inputs; /* [input_count] */
    int input_count;
    bst_link_output *outputs; /* [output_count] */
    int output_count;
} bst_link_messages;

/* One step of a part: sends the inputs (at most 63), waits for the answer. *answered false: there
 * was none in time, and on_timeout is BST_LINK_GO_ON. BST_ERR_IO: no peer came or answered, or one
 * said that it has failed; BST_ERR_INTERRUPTED: bst_link_on_wait. */
bst_status bst_link_exchange(bst_ctx *ctx, bst_link *link, int part, int64_t tick,
                             const bst_link_messages *messages, bool *answered) BST_MUST_CHECK;

/* Takes another answer of a part, if there is one, with BST_LINK_HOLD or BST_LINK_RUSH.
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

/* Writes what the parts are answered to a file, before the first exchange; bst_link_record_end says
 * whether it all got there. */
bst_status bst_link_record(bst_ctx *ctx, bst_link *link, const char *path) BST_MUST_CHECK;

/* Flushes and closes the recording of a link; without one it does nothing.
 *
 * Errors:    BST_ERR_IO if anything could not be written */
bst_status bst_link_record_end(bst_ctx *ctx, bst_link *link) BST_MUST_CHECK;
/* Has the parts answered from such a file: nothing is bound, nobody is waited for. An exchange that
 * is not the recorded one is BST_ERR_FORMAT. */
bst_status bst_link_replay(bst_ctx *ctx, bst_link *link, const char *path) BST_MUST_CHECK;
/* True if a link replays a recording. */
bool bst_link_replays(const bst_link *link);
/* For those who drop frames by the clock: while recording keeps *dropped of a frame of an instance
 * that is no part, while replaying sets it to what it was. */
bst_status bst_link_keep_drop(bst_ctx *ctx, bst_link *link, const char *instance, int64_t tick,
                              bool *dropped) BST_MUST_CHECK;

/* What has been counted, by name ("link_bad_crc"); false after the last. */
bool bst_link_counter(const bst_link *link, int index, const char **name, int64_t *count);
/* What a counter has grown by since this was last asked, for those who pass counts on; -1 after the
 * last counter. */
int64_t bst_link_news(bst_link *link, int index, const char **name);
/* The next line of what has happened that is worth a record ("peer x: ..."); NULL: no more. At most
 * a few dozen are kept between two calls. */
const char *bst_link_note(bst_link *link);

/* ---- a peer in C ---- */

typedef struct bst_link_peer bst_link_peer;

/* Connects to a simulation, which need not be there yet, and says hello. `keys_file`: of a link
 * that asks for keys (bst_curve_keys_read), else NULL. */
bst_status bst_link_peer_open(bst_ctx *ctx, const char *address, const char *keys_file,
                              const bst_link_hello *hello, bst_link_peer **out) BST_MUST_CHECK;
/* Closes the peer's side of a link and frees it; NULL is allowed. */
void bst_link_peer_close(bst_link_peer *peer);

/* A message that came. Pointers are lent until the next bst_link_peer_receive. */
typedef struct bst_link_received {
    bst_link_header header;
    const void *payload;    /* the struct of header.type */
    const uint16_t *pixels; /* of a frame */
} bst_link_received;

/* The next message; BST_ERR_NOT_FOUND when none came in time. After an `error` that says so, hello
 * is said again. Messages that are wrong are an error: a simulation sends none. */
bst_status bst_link_peer_receive(bst_ctx *ctx, bst_link_peer *peer, double timeout_s,
                                 bst_link_received *out) BST_MUST_CHECK;
/* Sends a payload of a type as part of the answer to `step` (a received header, or NULL: none). */
bst_status bst_link_peer_send(bst_ctx *ctx, bst_link_peer *peer, bst_link_type type,
                              const void *payload, const bst_link_header *step) BST_MUST_CHECK;

#endif
