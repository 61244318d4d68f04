/* Saves and restores the state of an engine: schedule, counters, channels with their messages, and
 * the modules. Between two calls of bst_engine_advance only. */
#include <assert.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/engine/kernel/engine_state.h"
#include "sim/engine/kernel/executor_internal.h"
#include "sim/engine/kernel/saved_frame.h"

/* ---- channels ---- */

/* The slot that owns the frame of a message: of the channel, or of a copy of another process. */
static const slot *owner_of(const bst_engine *engine, const channel *ch, int64_t sequence) {
    const slot *s = bst_log_slot(&ch->log, sequence);
    for (int r = 0; !s->owned && r < ch->reader_count; r++) {
        const channel_reader *reader = &ch->readers[r];
        const port_state *port = &engine->instances[reader->instance]->ports[reader->port];
        const message_log *copy = port->copies != BST_COPY_NONE ? port->log : NULL;
        for (int64_t k = copy ? copy->oldest : 0; copy && !s->owned && k < copy->written; k++) {
            const slot *other = bst_log_slot(copy, k);
            s = other->sequence == sequence && other->owned ? other : s;
        }
    }
    return s;
}

/* Archives the frame of a message; only BST_CHANNEL_FRAME messages own something. */
static bst_status archive_frame(bst_ctx *ctx, bst_archive *archive, const bst_engine *engine,
                                channel *ch, int64_t sequence) {
    slot *s = bst_log_slot(&ch->log, sequence);
    if (bst_archive_is_restoring(archive)) {
        bool owned = false;
        BST_ARCHIVE(archive, owned);
        bst_frame_message *message = s->payload;
        message->frame = NULL;
        s->owned = owned;
        return owned ? bst_frame_restore(ctx, archive, &message->frame) : BST_OK;
    }
    const slot *owner = owner_of(engine, ch, sequence);
    bool owned = owner->owned;
    BST_ARCHIVE(archive, owned);
    return owned ? bst_frame_save(ctx, archive, ((bst_frame_message *)owner->payload)->frame)
                 : BST_OK;
}

/* Archives a message: header and items in use. */
static bst_status archive_message(bst_ctx *ctx, bst_archive *archive, const bst_engine *engine,
                                  channel *ch, int64_t sequence) {
    const bst_channel_type *type = ch->type;
    slot *s = bst_log_slot(&ch->log, sequence);
    BST_ARCHIVE(archive, s->written_tick);
    s->sequence = sequence;
    if (type->lends) { /* refers to memory of the writer, which fills it anew; no module reads it */
        return BST_OK;
    }
    bst_archive_bytes(archive, s->payload, type->header_bytes);
    if (type->count) {
        int items = type->count(s->payload);
        if (items < 0 || items > ch->capacity) {
            return bst_fail(ctx, BST_ERR_FORMAT,
                            "the saved state has %d items in %s/%s (allowed: %d)", items, ch->scope,
                            type->name, ch->capacity);
        }
        bst_archive_bytes(archive, (char *)s->payload + type->header_bytes,
                          (size_t)items * type->item_bytes);
    } else {
        bst_archive_bytes(archive, (char *)s->payload + type->header_bytes,
                          ch->payload_bytes - type->header_bytes);
    }
    return type->release ? archive_frame(ctx, archive, engine, ch, sequence) : BST_OK;
}

/* Position of an input's cursor in its channel: that of a copy counts from another message. */
static int64_t channel_position(const port_state *port, int64_t cursor) {
    if (port->copies == BST_COPY_NONE) {
        return cursor;
    }
    return cursor < port->log->written && cursor >= port->log->oldest
               ? bst_log_slot(port->log, cursor)->sequence
               : port->copied;
}

/* Archives what the readers of a channel have read. */
static void archive_cursors(bst_archive *archive, bst_engine *engine, const channel *ch) {
    for (int r = 0; r < ch->reader_count; r++) {
        const channel_reader *reader = &ch->readers[r];
        port_state *port = &engine->instances[reader->instance]->ports[reader->port];
        int64_t cursor = channel_position(port, port->cursor);
        int64_t triggered = port->copies == BST_COPY_SAMPLED
                                ? port->announced
                                : channel_position(port, port->trigger_cursor);
        BST_ARCHIVE(archive, cursor);
        BST_ARCHIVE(archive, triggered);
        if (bst_archive_is_restoring(archive)) {
            port->cursor = cursor;
            port->trigger_cursor = triggered;
        }
    }
}

/* Releases what the messages of a channel own, and forgets memory of the writer that they lend.
 * Other content may stay: writers fill what they publish. */
static void empty_log(channel *ch) {
    for (int s = 0; s < ch->log.depth; s++) {
        slot *one = &ch->log.slots[s];
        if (one->owned && ch->type->release) {
            ch->type->release(one->payload);
        }
        one->owned = false;
        if (ch->type->lends) {
            memset(one->payload, 0, ch->payload_bytes);
        }
    }
}

static bst_status archive_channel(bst_ctx *ctx, bst_archive *archive, bst_engine *engine,
                                  channel *ch) {
    message_log *log = &ch->log;
    int64_t written = log->written, oldest = log->oldest;
    BST_ARCHIVE(archive, written);
    BST_ARCHIVE(archive, oldest);
    BST_ARCHIVE(archive, ch->released);
    if (bst_archive_is_restoring(archive)) {
        if (oldest < 0 || written < oldest || written - oldest > log->depth) {
            return bst_fail(ctx, BST_ERR_FORMAT,
                            "the saved state has %lld messages of %s/%s (allowed: %d)",
                            (long long)(written - oldest), ch->scope, ch->type->name, log->depth);
        }
        empty_log(ch);
        log->written = written;
        log->oldest = oldest;
        log->head = (int)(written % log->depth);
    }
    for (int64_t k = oldest; k < written; k++) {
        BST_TRY(archive_message(ctx, archive, engine, ch, k));
    }
    archive_cursors(archive, engine, ch);
    const instance *writer = engine->instances[ch->writer];
    BST_ARCHIVE(archive, writer->ports[ch->writer_port].silent_until);
    return BST_OK;
}

/* ---- instances and counters ---- */

/* Which part of the state a module instance belongs to. */
static unsigned component_of(const instance *self) {
    static const struct {
        const char *role;
        unsigned component;
    } roles[] = {{"gimbal", BST_STATE_PLANT},
                 {"scenegen", BST_STATE_PLANT},
                 {"obsgen", BST_STATE_PLANT},
                 {"exposure", BST_STATE_TIME}};
    for (size_t i = 0; i < sizeof roles / sizeof *roles; i++) {
        if (strcmp(roles[i].role, self->spec.desc->role) == 0) {
            return roles[i].component;
        }
    }
    return BST_STATE_ONBOARD;
}

static bst_status archive_instance(bst_ctx *ctx, bst_archive *archive, instance *self) {
    const bst_module_desc *desc = self->spec.desc;
    if (!desc->archive) {
        return bst_fail(ctx, BST_ERR_STATE,
                        "%s cannot be saved: its type \"%s\" has no function \"archive\" (of a "
                        "plug-in: see bst_module_desc in boresight/module.h)",
                        self->name, desc->type);
    }
    BST_ARCHIVE(archive, self->steps);
    BST_ARCHIVE(archive, self->next_period);
    BST_ARCHIVE(archive, self->wake);
    bst_status status = desc->archive(self->self, archive);
    return status == BST_OK ? BST_OK : bst_fail_prefix(ctx, status, "%s", self->name);
}

static void archive_counters(bst_archive *archive, bst_engine *engine) {
    BST_ARCHIVE(archive, engine->tick);
    engine->counter_count = bst_archive_count(archive, engine->counter_count, MAX_COUNTERS);
    bst_archive_bytes(archive, engine->counters,
                      (size_t)engine->counter_count * sizeof *engine->counters);
    for (int i = 0; i < engine->counter_count; i++) { /* of a damaged archive too */
        engine->counters[i].name[sizeof engine->counters[i].name - 1] = '\0';
    }
}

/* Computes when each instance is due, and orders the heap. */
static void reschedule(bst_engine *engine) {
    for (int i = 0; i < engine->instance_count; i++) {
        bst_engine_set_due(engine, i, bst_engine_earliest(engine->instances[i]));
    }
}

/* Archives one record, or skips it if its component is not wanted. */
typedef bst_status (*archive_part)(bst_ctx *ctx, bst_archive *archive, bst_engine *engine,
                                   int index);

static bst_status archive_record(bst_ctx *ctx, bst_archive *archive, bst_engine *engine,
                                 const char *name, bool wanted, archive_part part, int index) {
    if (!wanted) {
        return bst_archive_skip(ctx, archive, name);
    }
    BST_TRY(bst_archive_begin(ctx, archive, name));
    bst_status status = part(ctx, archive, engine, index);
    bst_status ended = bst_archive_end(ctx, archive);
    return status == BST_OK ? ended : status;
}

static bst_status part_engine(bst_ctx *ctx, bst_archive *archive, bst_engine *engine, int index) {
    (void)ctx, (void)index;
    archive_counters(archive, engine);
    return BST_OK;
}

static bst_status part_instance(bst_ctx *ctx, bst_archive *archive, bst_engine *engine, int index) {
    return archive_instance(ctx, archive, engine->instances[index]);
}

static bst_status part_channel(bst_ctx *ctx, bst_archive *archive, bst_engine *engine, int index) {
    return archive_channel(ctx, archive, engine, &engine->channels[index]);
}

bst_status bst_engine_archive(bst_ctx *ctx, bst_engine *engine, bst_archive *archive,
                              unsigned components) {
    assert(engine && archive);
    if (!engine->loaded || (bst_archive_is_restoring(archive) && engine->executor)) {
        return bst_fail(ctx, BST_ERR_STATE,
                        "a state is restored after loading and before the engine gets its threads");
    }
    if (!bst_archive_is_restoring(archive)) {
        components = BST_STATE_ALL;
    }
    BST_TRY(archive_record(ctx, archive, engine, "engine", components & BST_STATE_TIME, part_engine,
                           0));
    for (int i = 0; i < engine->instance_count; i++) {
        const instance *self = engine->instances[i];
        BST_TRY(archive_record(ctx, archive, engine, self->name, components & component_of(self),
                               part_instance, i));
    }
    for (int c = 0; c < engine->channel_count; c++) {
        const channel *ch = &engine->channels[c];
        char name[256];
        snprintf(name, sizeof name, "channel %.180s/%.60s", ch->scope, ch->type->name);
        BST_TRY(archive_record(ctx, archive, engine, name,
                               components & component_of(engine->instances[ch->writer]),
                               part_channel, c));
    }
    if (bst_archive_is_restoring(archive)) {
        reschedule(engine);
    }
    return BST_OK;
}
