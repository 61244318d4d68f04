/* A step of a part that a peer plays. */
#include <string.h>

#include "sim/core/wall_clock.h"
#include "sim/link/crc32c.h"
#include "sim/link/link_internal.h"

/* The pixels' checksums are worked out once, however often they are sent. */
typedef struct sending {
    const bst_link_input *inputs;
    int count, attempt;
    bool has_crc;
    uint32_t crc;
} sending;

/* Inputs, then `step`. A peer that takes none of it has gone. */
static void send_step(bst_link *link, link_exchange *x, sending *s) {
    link_part *part = &link->parts[x->part];
    int peer = part->peer;
    bool sent = true;
    for (int i = 0; sent && i <= s->count; i++) {
        bst_link_step step = {.inputs = s->count, .attempt = s->attempt};
        const bst_link_input *input = i < s->count ? &s->inputs[i] : NULL;
        bst_link_header header = {.type = input ? input->type : BST_LINK_STEP,
                                  .tick = input ? input->tick : x->tick,
                                  .step = x->step};
        memcpy(header.instance, part->about.instance, sizeof header.instance);
        const bst_link_input *frame = input && input->type == BST_LINK_FRAME ? input : NULL;
        if (frame && !s->has_crc && !(link->shared && link->peers[peer].shared_memory)) {
            s->crc = bst_crc32c(frame->pixels, frame->pixel_bytes);
            s->has_crc = true;
        }
        sent = bst_link_send(link, peer, &header, input ? input->payload : &step, frame, s->crc);
    }
    s->attempt++;
    if (!sent) {
        bst_link_event(link, x->ctx, LINK_LEFT, "%s is gone", link->peers[peer].name);
        bst_link_unassign(link, peer);
    }
}

static bst_status silent(bst_link *link, link_exchange *x, double waited_s, bool *answered) {
    link_part *part = &link->parts[x->part];
    int peer = part->peer;
    bst_link_event(link, x->ctx, LINK_UNANSWERED, "%s has not answered step %lld of %s",
                   peer >= 0 ? link->peers[peer].name : "nobody", (long long)x->step,
                   part->about.instance);
    *answered = false;
    for (int i = 0; i < x->output_count; i++) {
        x->outputs[i].given = false; /* half of an answer is none */
    }
    if (link->config.on_silence == BST_LINK_GO_ON) {
        if (peer >= 0) {
            bst_link_unassign(link, peer); /* until it says hello again */
        }
        return BST_OK;
    }
    if (peer >= 0) {
        return bst_fail(x->ctx, BST_ERR_IO,
                        "link: \"%s\" has not answered step %lld of %s within %.3g s; "
                        "/link/timeout_s allows more, /link/on_silence \"go_on\" does without",
                        link->peers[peer].name, (long long)x->step, part->about.instance, waited_s);
    }
    return bst_fail(x->ctx, BST_ERR_IO,
                    "link: %s plays %s at %s, for which the run waited %.3g s; start one, for "
                    "example: boresight serve SCENARIO.json --part %s --link %s",
                    part->had_peer ? "its peer has left and nobody" : "nobody",
                    part->about.instance, link->address, waited_s, part->about.instance,
                    link->address);
}

bst_status bst_link_exchange(bst_ctx *ctx, bst_link *link, int number, int64_t tick,
                             const bst_link_input *inputs, int input_count,
                             bst_link_output *outputs, int output_count, bool *answered) {
    BST_TRY(bst_link_open(ctx, link));
    link->exchanges++;
    link_part *part = &link->parts[number];
    link_exchange x = {.ctx = ctx,
                       .part = number,
                       .step = part->step++,
                       .tick = tick,
                       .outputs = outputs,
                       .output_count = output_count,
                       .resend = part->peer >= 0};
    sending s = {.inputs = inputs, .count = input_count};
    double began = bst_wall_seconds();
    bool first = !part->had_peer;
    /* one that has been lost already is not waited for again where the run does without */
    bool waits = part->peer >= 0 || first || link->config.on_silence == BST_LINK_STOP;
    double limit = !waits ? 0.0 : first ? link->config.connect_timeout_s : link->config.timeout_s;
    double end = began + limit, last = began + LINK_EXTENSIONS * link->config.timeout_s;
    *answered = true;
    for (;;) {
        if (x.resend && part->peer >= 0) {
            x.resend = false;
            x.taken = 0;
            for (int i = 0; i < output_count; i++) {
                outputs[i].given = false;
                outputs[i].dropped = 0;
            }
            send_step(link, &x, &s);
        }
        double left = end - bst_wall_seconds();
        int wait_ms = left <= 0.0 ? 0 : left > 0.1 ? 100 : (int)(left * 1e3) + 1;
        BST_TRY(bst_link_take(link, &x, wait_ms));
        if (x.finished) {
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
            return silent(link, &x, now - began, answered);
        }
    }
}
