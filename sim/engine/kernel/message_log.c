/* What islands leave for others: messages and events for the hooks, which whoever is free does in
 * the order in which a run on one thread would have done them; and inputs for the module that links
 * them, which reads them as they were at the end of a span while islands are at later ones. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/engine/kernel/parallel_internal.h"

enum { ALIGN = 16, KIND_BYTES = 48 };

/* Before the content of each message, event or input. */
typedef struct note {
    size_t bytes; /* with the content */
    int64_t tick;
    int instance;
    const channel *ch; /* NULL: an event */
    /* of an input */
    int port;
    bool unread; /* one of a queue; else the newest */
    int64_t sequence;
} note;

typedef struct event_text {
    char kind[KIND_BYTES], text[400];
} event_text;

enum { NOTE_BYTES = (sizeof(note) + ALIGN - 1) / ALIGN * ALIGN };

static bst_status take_note(bst_ctx *ctx, notes *n, const note *head, const void *content,
                            size_t bytes) {
    size_t whole = NOTE_BYTES + (bytes + ALIGN - 1) / ALIGN * ALIGN;
    if (n->used + whole > n->room) {
        size_t room = 2 * (n->room + whole) + 65536;
        char *more = aligned_alloc(ALIGN, room / ALIGN * ALIGN);
        if (!more) {
            return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %zu bytes of messages", room);
        }
        memcpy(more, n->bytes ? n->bytes : more, n->used);
        free(n->bytes);
        n->bytes = more;
        n->room = room / ALIGN * ALIGN;
    }
    note *to = (note *)(void *)(n->bytes + n->used);
    *to = *head;
    to->bytes = whole;
    memcpy(n->bytes + n->used + NOTE_BYTES, content, bytes);
    n->used += whole;
    return BST_OK;
}

static note *first_note(const notes *n) {
    return n->read < n->used ? (note *)(void *)(n->bytes + n->read) : NULL;
}

static const void *content_of(const note *n) {
    return (const char *)n + NOTE_BYTES;
}

static size_t content_bytes(const channel *ch, const void *payload) {
    const bst_channel_type *type = ch->type;
    return type->count ? type->header_bytes + type->item_bytes * (size_t)type->count(payload)
                       : ch->payload_bytes;
}

void bst_islands_free_notes(island *self) {
    for (int k = 0; k < BST_ISLAND_SPANS; k++) {
        free(self->notes[k].bytes);
        free(self->inputs[k].bytes);
    }
}

/* ---- for the hooks ---- */

static notes *notes_of(bst_engine *engine, const instance *self) {
    island *own = &engine->islands->islands[self->island];
    return &own->notes[own->span % BST_ISLAND_SPANS];
}

bst_status bst_islands_message(struct bst_step *step, const channel *ch, const void *payload) {
    note head = {.tick = step->tick, .instance = step->self->order, .ch = ch};
    return take_note(step->ctx, notes_of(step->engine, step->self), &head, payload,
                     content_bytes(ch, payload));
}

bst_status bst_islands_event(struct bst_step *step, const char *kind, const char *text) {
    event_text e;
    memset(&e, 0, sizeof e);
    snprintf(e.kind, sizeof e.kind, "%s", kind);
    snprintf(e.text, sizeof e.text, "%s", text);
    note head = {.tick = step->tick, .instance = step->self->order};
    return take_note(step->ctx, notes_of(step->engine, step->self), &head, &e, sizeof e);
}

/* The notes of a span with the next one to be heard; NULL: none is left. */
static notes *next_notes(const bst_islands *s, int64_t span) {
    notes *from = NULL;
    const note *next = NULL;
    for (int i = 0; i <= s->count; i++) {
        notes *own = &s->islands[i].notes[span % BST_ISLAND_SPANS];
        const note *n = first_note(own);
        if (n && (!next || bst_islands_before(n->tick, n->instance, next->tick, next->instance))) {
            next = n;
            from = own;
        }
    }
    return from;
}

bst_status bst_islands_do_hooks(bst_ctx *ctx, bst_engine *engine, int64_t span, int most,
                                int64_t last_tick, int last_instance, bool *all) {
    bst_islands *s = engine->islands;
    const bst_engine_hooks *hooks = &engine->hooks;
    bst_status status = BST_OK;
    *all = false;
    for (int done = 0; done < most && status == BST_OK && !*all; done++) {
        notes *from = next_notes(s, span);
        const note *next = from ? first_note(from) : NULL;
        if (!next || bst_islands_before(last_tick, last_instance, next->tick, next->instance)) {
            *all = true;
            break;
        }
        if (next->ch) {
            status = hooks->message(hooks->user, next->ch->scope, next->ch->type->name,
                                    content_of(next), next->tick);
        } else {
            const event_text *e = content_of(next);
            status = hooks->event(hooks->user, next->tick, engine->instances[next->instance]->name,
                                  e->kind, e->text);
        }
        status = bst_engine_heard(ctx, engine, status);
        from->read += next->bytes;
    }
    for (int i = 0; i <= s->count && (*all || status != BST_OK); i++) {
        notes *n = &s->islands[i].notes[span % BST_ISLAND_SPANS];
        n->used = n->read = 0;
    }
    return status;
}

/* ---- for what links the islands ---- */

static bst_status put_message(bst_ctx *ctx, notes *n, const channel *ch, int port, int64_t sequence,
                              bool unread) {
    const slot *s = bst_engine_slot(ch, sequence);
    note head = {
        .tick = s->written_tick, .ch = ch, .port = port, .unread = unread, .sequence = sequence};
    return take_note(ctx, n, &head, s->payload, content_bytes(ch, s->payload));
}

bst_status bst_islands_put_aside(bst_ctx *ctx, bst_engine *engine, island *self) {
    const bst_islands *s = engine->islands;
    instance *link = engine->instances[s->link];
    int slot_ = (int)(self->span % BST_ISLAND_SPANS);
    int64_t tick = s->until_tick[slot_] - 1;
    notes *n = &self->inputs[slot_];
    n->used = n->read = 0;
    for (int p = 0; p < link->port_count; p++) {
        port_state *port = &link->ports[p];
        if (bst_instance_port(link, p)->direction != BST_PORT_IN || port->channel < 0) {
            continue;
        }
        const channel *ch = &engine->channels[port->channel];
        if (&s->islands[engine->instances[ch->writer]->island] != self) {
            continue;
        }
        int64_t newest = bst_engine_newest(ch, port, tick);
        if (newest >= 0) {
            BST_TRY(put_message(ctx, n, ch, p, newest, false));
        }
        int64_t next =
            ch->type->kind == BST_CHANNEL_QUEUE ? bst_engine_unread(engine, ch, port, tick) : -1;
        while (next >= 0) {
            port->cursor++;
            BST_TRY(put_message(ctx, n, ch, p, next, true));
            next = bst_engine_unread(engine, ch, port, tick);
        }
    }
    return BST_OK;
}

static bst_sample read_input(struct bst_step *step, int port_index, bool unread) {
    const bst_islands *s = step->engine->islands;
    const port_state *port = &step->self->ports[port_index];
    const channel *ch = &step->engine->channels[port->channel];
    island *from = &s->islands[step->engine->instances[ch->writer]->island];
    notes *n = &from->inputs[s->islands[s->count].span % BST_ISLAND_SPANS];
    for (size_t at = 0; at < n->used;) {
        note *one = (note *)(void *)(n->bytes + at);
        if (one->port == port_index && one->unread == unread) {
            one->port = unread ? -1 : one->port; /* read */
            return bst_engine_sample(step, port, content_of(one), one->tick, one->sequence);
        }
        at += one->bytes;
    }
    return (bst_sample){NULL, 0, -1, true};
}

bst_sample bst_islands_latest(struct bst_step *step, int port) {
    return read_input(step, port, false);
}

bst_sample bst_islands_next(struct bst_step *step, int port) {
    return read_input(step, port, true);
}
