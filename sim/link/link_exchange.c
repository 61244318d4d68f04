/* Exchange of one step with the peer that plays a part. */
#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/wall_clock.h"
#include "sim/link/crc32c.h"
#include "sim/link/link_internal.h"

/* Inputs of a step; checksums of pixels are computed once. */
typedef struct sending {
    const bst_link_input *inputs;
    int count, attempt;
    uint64_t has_crc; /* bit i: input i, below 64 */
    uint32_t crcs[64];
} sending;

/* Sends the inputs of a step, then `step`. A peer that takes none of them is disconnected. */
static void send_step(bst_link *link, link_exchange *x, sending *s) {
    link_part *part = &link->parts[x->part];
    int peer = part->peer;
    bool sent = true;
    for (int i = 0; sent && i <= s->count; i++) {
        bst_link_step step = {.inputs = s->count, .attempt = s->attempt};
        const bst_link_input *input = i < s->count ? &s->inputs[i] : NULL;
        bst_link_header header = {.type = input ? input->type : BST_LINK_STEP,
                                  .tick = input ? input->tick : x->tick,
                                  .step = part->step - 1};
        memcpy(header.instance, part->about.instance, sizeof header.instance);
        const bst_link_input *frame = input && input->type == BST_LINK_FRAME ? input : NULL;
        if (frame && !(s->has_crc >> i & 1) && !(link->shared && link->peers[peer].shared_memory)) {
            s->crcs[i] = bst_crc32c(frame->pixels, frame->pixel_bytes);
            s->has_crc |= UINT64_C(1) << i;
        }
        sent = bst_link_send(link, peer, &header, input ? input->payload : &step, frame,
                             frame ? s->crcs[i] : 0);
    }
    s->attempt++;
    if (!sent) {
        bst_link_event(link, x->ctx, LINK_LEFT, "%s is gone", link->peers[peer].name);
        bst_link_unassign(link, peer);
    }
}

/* Handles a step without answer: ends the run, or continues without the peer (on_silence). */
static bst_status handle_silence(bst_link *link, link_exchange *x, double waited_s,
                                 bool *answered) {
    link_part *part = &link->parts[x->part];
    int peer = part->peer;
    if (peer >= 0) {
        bst_link_event(link, x->ctx, LINK_UNANSWERED, "%s has not answered step %lld of %s",
                       link->peers[peer].name, (long long)part->step - 1, part->about.instance);
    } else {
        bst_link_event(link, x->ctx, LINK_UNANSWERED,
                       "step %lld of %s is not answered: no peer plays it",
                       (long long)part->step - 1, part->about.instance);
    }
    *answered = false;
    for (int i = 0; i < x->answer.output_count; i++) {
        x->answer.outputs[i].given = false; /* discard an incomplete answer */
    }
    if (link->config.on_timeout == BST_LINK_GO_ON) {
        if (peer >= 0) {
            bst_link_unassign(link, peer); /* until the next `hello` */
        }
        return BST_OK;
    }
    if (peer >= 0) {
        return bst_fail(x->ctx, BST_ERR_IO,
                        "link: \"%s\" has not answered step %lld of %s within %.3g s; "
                        "/link/timeout_s allows more, /link/on_timeout \"go_on\" does without",
                        link->peers[peer].name, (long long)part->step - 1, part->about.instance,
                        waited_s);
    }
    return bst_fail(x->ctx, BST_ERR_IO,
                    "link: %s plays %s at %s, for which the run waited %.3g s; start one, for "
                    "example: boresight serve SCENARIO.json --part %s --link %s",
                    part->had_peer ? "its peer has left and no peer" : "no peer",
                    part->about.instance, link->address, waited_s, part->about.instance,
                    link->address);
}

/* Returns the oldest complete answer of a part to the caller. */
static bool oldest_answer(bst_link *link, int number, bst_link_output *outputs, int output_count) {
    link_part *part = &link->parts[number];
    link_answer *oldest = NULL;
    for (int a = 0; a < LINK_AHEAD; a++) {
        link_answer *answer = &part->ahead[a];
        if (answer->open && answer->finished && (!oldest || answer->step < oldest->step)) {
            oldest = answer;
        }
    }
    for (int i = 0; oldest && i < output_count; i++) {
        const bst_link_output *from = &oldest->outputs[i];
        const bst_wire_message *about = bst_wire_message_of(from->type);
        outputs[i].given = from->given;
        outputs[i].dropped = from->dropped;
        if (from->given) {
            memcpy(outputs[i].payload, from->payload,
                   about->header_bytes +
                       (size_t)bst_wire_items(about, from->payload) * about->item_bytes);
        }
    }
    if (oldest) {
        oldest->open = false;
    }
    return oldest != NULL;
}

bst_status bst_link_more(bst_ctx *ctx, bst_link *link, int number, int64_t tick,
                         bst_link_output *outputs, int output_count, bool *more) {
    assert(link && outputs && more && number >= 0 && number < link->part_count &&
           output_count >= 0);
    *more = false;
    if (link->run.waiting == BST_LINK_AWAIT) {
        return BST_OK;
    }
    if (bst_link_replays(link)) {
        return bst_link_tape_read_more(ctx, link, number, tick, outputs, output_count, more);
    }
    *more = oldest_answer(link, number, outputs, output_count);
    if (*more) {
        bst_link_tape_answer(link, number, tick, outputs, output_count);
    } else {
        bst_link_tape_note(link, number, tick, false, true);
    }
    return BST_OK;
}

/* Allocates buffers for answers that are not awaited. */
static bst_status make_ahead(bst_ctx *ctx, link_part *part, const bst_link_output *outputs,
                             int count) {
    for (int a = 0; a < LINK_AHEAD && !part->ahead[a].outputs; a++) {
        link_answer *answer = &part->ahead[a];
        answer->outputs = calloc((size_t)count + 1, sizeof *answer->outputs);
        if (!answer->outputs) {
            return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the link's answers");
        }
        for (int i = 0; i < count; i++) {
            const bst_wire_message *about = bst_wire_message_of(outputs[i].type);
            answer->outputs[i] = (bst_link_output){
                .type = outputs[i].type,
                .capacity = outputs[i].capacity,
                .payload = calloc(
                    1, about->header_bytes + (size_t)outputs[i].capacity * about->item_bytes)};
            answer->output_count++;
            if (!answer->outputs[i].payload) {
                return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the link's answers");
            }
        }
    }
    return BST_OK;
}

/* Buffer for the answer to another step. NULL: none is free, or unread frames in shared memory
 * would be overwritten. */
static link_answer *free_place(bst_link *link, link_part *part) {
    int open = 0;
    for (int i = 0; i < link->part_count; i++) {
        for (int a = 0; a < LINK_AHEAD; a++) {
            open += link->parts[i].ahead[a].open;
        }
    }
    link_answer *place = NULL;
    for (int a = 0; a < LINK_AHEAD && !(link->shared && open >= BST_LINK_SLOTS - 1); a++) {
        place = !part->ahead[a].open && !place ? &part->ahead[a] : place;
    }
    return place;
}

/* Receives messages until `until` (wall seconds) or until `enough` is true; at least those already
 * received. */
static bst_status take_until(bst_link *link, link_exchange *x, double until,
                             bool (*enough)(bst_link *link, link_exchange *x)) {
    for (;;) {
        bool over = enough && enough(link, x);
        double left = over ? 0.0 : until - bst_wall_seconds();
        BST_TRY(bst_link_take(link, x, left <= 0.0 ? 0 : left > 0.1 ? 100 : (int)(left * 1e3) + 1));
        if (link->stop && link->stop(link->stop_user)) {
            return bst_fail(x->ctx, BST_ERR_INTERRUPTED, "interrupted while waiting for %s",
                            link->parts[x->part > 0 ? x->part : 0].about.instance);
        }
        if (x->quiet && (over || bst_wall_seconds() >= until)) {
            return BST_OK;
        }
    }
}

/* True if the part can accept a further step without waiting. */
static bool has_place(bst_link *link, link_exchange *x) {
    link_part *part = &link->parts[x->part];
    bool finished = false;
    for (int a = 0; a < LINK_AHEAD; a++) {
        finished |= part->ahead[a].open && part->ahead[a].finished;
    }
    return finished || part->peer < 0 || free_place(link, part);
}

/* True if all steps sent to the part have been answered. */
static bool newest_finished(bst_link *link, link_exchange *x) {
    link_part *part = &link->parts[x->part];
    bool waiting = false;
    for (int a = 0; a < LINK_AHEAD; a++) {
        waiting |= part->ahead[a].open && !part->ahead[a].finished;
    }
    return !waiting;
}

bst_status bst_link_ready(bst_ctx *ctx, bst_link *link, int number, int64_t tick,
                          const bst_link_output *outputs, int output_count, bool *ready) {
    *ready = true;
    if (link->run.waiting == BST_LINK_AWAIT) {
        return BST_OK;
    }
    if (bst_link_replays(link)) {
        return bst_link_tape_read_ready(ctx, link, number, tick, ready);
    }
    BST_TRY(bst_link_open(ctx, link));
    link_part *part = &link->parts[number];
    BST_TRY(make_ahead(ctx, part, outputs, output_count));
    link->exchanges++;
    link_exchange x = {.ctx = ctx, .part = number, .tick = tick};
    double now = bst_wall_seconds(), oldest = now;
    BST_TRY(take_until(link, &x, now + (link->run.waiting == BST_LINK_HOLD ? link->run.hold_s : 0),
                       has_place));
    bool place = free_place(link, part) != NULL;
    for (int a = 0; a < LINK_AHEAD; a++) {
        const link_answer *answer = &part->ahead[a];
        place |= answer->open && answer->finished; /* bst_link_more frees a buffer */
        oldest = answer->open && !answer->finished ? fmin(oldest, answer->sent_s) : oldest;
    }
    if (part->peer >= 0 && bst_wall_seconds() - oldest > link->config.timeout_s) {
        bool answered;
        BST_TRY(handle_silence(link, &x, bst_wall_seconds() - oldest, &answered));
    }
    *ready = part->peer >= 0 && place;
    if (!*ready) {
        link->counts[LINK_SKIPPED]++;
    }
    bst_link_tape_note(link, number, tick, *ready, false);
    return BST_OK;
}

/* Executes a step without waiting for its answer, or only for hold_s. */
static bst_status exchange_ahead(bst_ctx *ctx, bst_link *link, int number, int64_t tick,
                                 const bst_link_messages *m, bool *answered) {
    link_part *part = &link->parts[number];
    *answered = false;
    for (int i = 0; i < m->output_count; i++) {
        m->outputs[i].given = false;
    }
    link_exchange x = {.ctx = ctx, .part = number, .tick = tick};
    BST_TRY(make_ahead(ctx, part, m->outputs, m->output_count));
    link_answer *place = free_place(link, part);
    if (part->peer < 0 || !place) {
        link->counts[LINK_SKIPPED]++;
        return BST_OK;
    }
    link->exchanges++;
    place->open = true;
    place->finished = false;
    place->step = part->step++;
    place->taken = 0;
    place->sent_s = bst_wall_seconds();
    for (int i = 0; i < place->output_count; i++) {
        place->outputs[i].given = false;
        place->outputs[i].dropped = 0;
    }
    sending s = {.inputs = m->inputs, .count = m->input_count};
    send_step(link, &x, &s);
    bool hold = link->run.waiting == BST_LINK_HOLD;
    BST_TRY(take_until(link, &x, place->sent_s + (hold ? link->run.hold_s : 0.0), newest_finished));
    *answered = oldest_answer(link, number, m->outputs, m->output_count);
    link->counts[LINK_HELD] += !*answered;
    return BST_OK;
}

bst_status bst_link_gather(bst_ctx *ctx, bst_link *link) {
    if (link->local || bst_link_replays(link)) {
        return BST_OK;
    }
    BST_TRY(bst_link_open(ctx, link));
    double began = bst_wall_seconds();
    for (int i = 0; i < link->part_count; i++) {
        link_exchange x = {.ctx = ctx, .part = i};
        while (link->parts[i].peer < 0) {
            BST_TRY(bst_link_take(link, &x, 100));
            if (link->stop && link->stop(link->stop_user)) {
                return bst_fail(ctx, BST_ERR_INTERRUPTED, "interrupted while waiting for %s",
                                link->parts[i].about.instance);
            }
            double waited = bst_wall_seconds() - began;
            if (link->parts[i].peer < 0 && waited >= link->config.connect_timeout_s) {
                bool answered;
                return handle_silence(link, &x, waited, &answered);
            }
        }
    }
    return BST_OK;
}

/* Sends a step to the peer and waits for its answer, repeating it for a reconnected peer. */
static bst_status exchange_awaited(bst_ctx *ctx, bst_link *link, int number, int64_t tick,
                                   const bst_link_messages *m, bool *answered) {
    link->exchanges++;
    link_part *part = &link->parts[number];
    link_exchange x = {.ctx = ctx,
                       .part = number,
                       .tick = tick,
                       .answer = {.open = true,
                                  .step = part->step++,
                                  .outputs = m->outputs,
                                  .output_count = m->output_count},
                       .resend = part->peer >= 0};
    sending s = {.inputs = m->inputs, .count = m->input_count};
    double began = bst_wall_seconds();
    bool first = !part->had_peer;
    /* with on_timeout = go on, do not wait again for a lost peer */
    bool waits = part->peer >= 0 || first || link->config.on_timeout == BST_LINK_STOP;
    double limit = !waits ? 0.0 : first ? link->config.connect_timeout_s : link->config.timeout_s;
    double end = began + limit, last = began + LINK_EXTENSIONS * link->config.timeout_s;
    *answered = true;
    for (;;) {
        if (x.resend && part->peer >= 0) {
            x.resend = false;
            x.answer.taken = 0;
            for (int i = 0; i < m->output_count; i++) {
                m->outputs[i].given = false;
                m->outputs[i].dropped = 0;
            }
            send_step(link, &x, &s);
        }
        double left = end - bst_wall_seconds();
        int wait_ms = left <= 0.0 ? 0 : left > 0.1 ? 100 : (int)(left * 1e3) + 1;
        BST_TRY(bst_link_take(link, &x, wait_ms));
        if (x.answer.finished) {
            return BST_OK;
        }
        if (link->stop && link->stop(link->stop_user)) {
            return bst_fail(ctx, BST_ERR_INTERRUPTED, "interrupted while waiting for %s",
                            part->about.instance);
        }
        double now = bst_wall_seconds();
        if (x.prolong) {
            x.prolong = false;
            if (first && part->peer >= 0) {
                first = false;
                last = now + LINK_EXTENSIONS * link->config.timeout_s;
            }
            end = now + link->config.timeout_s < last ? now + link->config.timeout_s : last;
        }
        if (now >= end && !x.resend) {
            return handle_silence(link, &x, now - began, answered);
        }
    }
}

bst_status bst_link_exchange(bst_ctx *ctx, bst_link *link, int number, int64_t tick,
                             const bst_link_messages *m, bool *answered) {
    assert(link && m && answered && number >= 0 && number < link->part_count);
    if (link->local) {
        *answered = true;
        bst_link_local_answer(link, number, m);
        return BST_OK;
    }
    if (bst_link_replays(link)) {
        *answered = true;
        return bst_link_tape_read(ctx, link, number, tick, m->outputs, m->output_count);
    }
    BST_TRY(bst_link_open(ctx, link));
    BST_TRY((link->run.waiting == BST_LINK_AWAIT ? exchange_awaited : exchange_ahead)(
        ctx, link, number, tick, m, answered));
    bst_link_tape_answer(link, number, tick, m->outputs, m->output_count);
    return BST_OK;
}
