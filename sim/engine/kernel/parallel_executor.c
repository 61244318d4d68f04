/* Sensors that share nothing but what links them are stepped by several threads: each is an island,
 * with a schedule of its own. Time is cut into spans, each up to the next step of a module that
 * links them, or a second. What links them steps alone, once all have come to the end of a span; an
 * island goes on to the next span after that, or at once when it is promised that nothing will be
 * written for it until then: so one that takes long holds up only those that wait for word. The
 * calling thread is one of the threads. Which of them does what is left to chance; what comes out
 * is not. Hooks are done by whoever has nothing to step, of whole spans only and one at a time, in
 * the order in which a run on one thread would have done them: by tick, then by the stepping order
 * of the instances. */
#include <signal.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/parallel.h"
#include "sim/core/wall_clock.h"
#include "sim/engine/kernel/parallel_internal.h"

/* HOOKS: done in one go. BACKLOG: of spans, from which on hooks go before steps. */
enum { HOOKS = 32, BACKLOG = BST_ISLAND_SPANS / 2 };

/* ---- stepping ---- */

static void step_island(bst_engine *engine, island *self, int64_t until_tick) {
    bst_heap *heap = &self->heap;
    while (self->status == BST_OK && heap->count > 0) {
        int index = heap->items[0];
        int64_t tick = engine->due[index];
        if (tick >= until_tick) {
            break;
        }
        self->last_tick = tick;
        self->status = bst_engine_step(&self->ctx, engine, index, tick);
        if (self->status != BST_OK) {
            self->failed_tick = tick;
            self->failed_instance = index;
        }
    }
}

/* The first step that failed, NULL: none. */
static const island *first_failure(const bst_islands *s) {
    const island *first = NULL;
    for (int i = 0; i <= s->count; i++) {
        const island *one = &s->islands[i];
        if (one->status != BST_OK &&
            (!first || bst_islands_before(one->failed_tick, one->failed_instance,
                                          first->failed_tick, first->failed_instance))) {
            first = one;
        }
    }
    return first;
}

/* Something changed that threads may wait for; by who holds the lock. */
static void tell(bst_islands *s) {
    if (s->sleeping > 0) {
        pthread_cond_broadcast(&s->changed);
    }
}

/* ---- spans; all with the lock held ---- */

/* When the instances that link the islands step next, as long as they do not run. */
static int64_t link_due(const bst_islands *s) {
    const bst_heap *links = &s->islands[s->count].heap;
    return links->count > 0 ? s->engine->due[links->items[0]] : INT64_MAX;
}

/* Whether there is a span after the last one, which is opened where it was not yet. */
static bool opens(bst_islands *s) {
    if (s->from_tick >= s->last_tick || s->opened >= s->end ||
        s->opened - s->hooked >= BST_ISLAND_SPANS || (!s->ahead && s->linked < s->opened)) {
        return false;
    }
    s->link_tick = s->ahead ? s->link_tick : link_due(s);
    int64_t until = s->from_tick + s->engine->tick_rate_hz;
    if (s->link_tick < until) {
        until = s->link_tick + 1;
    }
    until = until < s->last_tick ? until : s->last_tick;
    if (s->ahead && s->link_tick < until) {
        s->link_tick += s->engine->instances[s->link]->spec.period_ticks;
    }
    s->from_tick = s->until_tick[s->opened % BST_ISLAND_SPANS] = until;
    s->opened++;
    return true;
}

/* Whether an island can do its next span now. */
static bool can_step(bst_islands *s, const island *self) {
    if (self->busy || self->status != BST_OK || self->span >= s->end) {
        return false;
    }
    if (self->span > s->linked &&
        self->free_tick < s->until_tick[(self->span - 1) % BST_ISLAND_SPANS]) {
        return false;
    }
    return self->span < s->opened || opens(s);
}

static double expected_s(const island *i) {
    return i->took_s[0] > i->took_s[1] ? i->took_s[0] : i->took_s[1];
}

/* The island to be stepped next: the one that is farthest behind, among those what will take long;
 * NULL: none. */
static island *next_island(bst_islands *s) {
    island *best = NULL;
    for (int i = 0; i < s->count; i++) {
        island *one = &s->islands[i];
        bool better = !best || one->span < best->span ||
                      (one->span == best->span && expected_s(one) > expected_s(best));
        if (better && can_step(s, one)) {
            best = one;
        }
    }
    return best;
}

/* Whether what links the islands is to be stepped. */
static bool can_link(const bst_islands *s) {
    if (s->linking || s->linked >= s->opened || s->linked >= s->end - s->failed) {
        return false;
    }
    for (int i = 0; i < s->count; i++) {
        if (s->islands[i].span <= s->linked) {
            return false;
        }
    }
    return true;
}

static bool can_hook(const bst_islands *s) {
    return !s->hooking && s->hooked < s->linked;
}

/* Whether all is done but hooks. */
static bool finished(const bst_islands *s) {
    bool busy = s->linking || s->hooking;
    bool behind = false;
    for (int i = 0; i < s->count && !busy; i++) {
        busy = s->islands[i].busy;
        behind |= !busy && s->islands[i].status == BST_OK && s->islands[i].span < s->end;
    }
    if (busy || s->heard != BST_OK) {
        return !busy;
    }
    bool all = s->from_tick >= s->last_tick && s->linked == s->opened;
    return all || (s->linked == s->end - s->failed && !(s->failed && behind));
}

static void end_span(bst_islands *s, island *self) {
    self->busy = false;
    if (self->last_tick > s->engine->tick) {
        s->engine->tick = self->last_tick;
    }
    if (self->status == BST_OK) {
        self->span++;
    } else if (!s->failed || self->span + 1 < s->end) {
        s->failed = true;
        s->end = self->span + 1;
    }
    tell(s);
}

static void step_one(bst_islands *s, island *self) {
    int64_t until = s->until_tick[self->span % BST_ISLAND_SPANS];
    self->busy = true;
    pthread_mutex_unlock(&s->lock);
    double begun = bst_wall_seconds();
    step_island(s->engine, self, until);
    if (self->status == BST_OK && s->ahead && s->link >= 0) {
        self->status = bst_islands_put_aside(&self->ctx, s->engine, self);
        self->failed_tick = until - 1;
        self->failed_instance = s->link;
    }
    double took = bst_wall_seconds() - begun;
    pthread_mutex_lock(&s->lock);
    self->took_s[self->span & 1] = took;
    end_span(s, self);
}

/* Until when what links the islands has promised to write nothing for each. */
static void take_promises(bst_islands *s) {
    const instance *link = s->engine->instances[s->link];
    for (int i = 0; i < s->count; i++) {
        s->islands[i].free_tick = INT64_MAX;
    }
    for (int p = 0; p < link->port_count; p++) {
        const port_state *port = &link->ports[p];
        if (bst_instance_port(link, p)->direction == BST_PORT_OUT && port->channel >= 0) {
            island *to = &s->islands[port->island];
            to->free_tick = port->silent_until < to->free_tick ? port->silent_until : to->free_tick;
        }
    }
}

/* Steps what links the islands at the end of a span. */
static void step_links(bst_islands *s) {
    island *self = &s->islands[s->count];
    int64_t until = s->until_tick[self->span % BST_ISLAND_SPANS];
    s->linking = true;
    pthread_mutex_unlock(&s->lock);
    step_island(s->engine, self, until);
    pthread_mutex_lock(&s->lock);
    s->linking = false;
    if (s->ahead && s->link >= 0) {
        take_promises(s);
    }
    s->linked += self->status == BST_OK;
    end_span(s, self);
}

/* Does some hooks of the first span that has any left. */
static void hook_some(bst_islands *s) {
    s->hooking = true;
    int64_t span = s->hooked;
    pthread_mutex_unlock(&s->lock);
    bool all;
    bst_status heard = bst_islands_do_hooks(s->ctx, s->engine, span, HOOKS, INT64_MAX, 0, &all);
    pthread_mutex_lock(&s->lock);
    s->hooking = false;
    s->hooked += all;
    s->heard = heard;
    if (all || heard != BST_OK) {
        tell(s);
    }
}

/* Does one thing that there is to do, or waits. */
static void do_or_await(bst_islands *s) {
    bool going = s->heard == BST_OK;
    island *next;
    if (going && can_link(s)) {
        step_links(s);
    } else if (going && can_hook(s) && s->linked - s->hooked >= BACKLOG) {
        hook_some(s);
    } else if (going && (next = next_island(s)) != NULL) {
        step_one(s, next);
    } else if (going && can_hook(s)) {
        hook_some(s);
    } else {
        s->sleeping++;
        pthread_cond_wait(&s->changed, &s->lock);
        s->sleeping--;
    }
}

static void *work(void *user) {
    bst_islands *s = user;
    pthread_mutex_lock(&s->lock);
    while (!s->stop) {
        do_or_await(s);
    }
    pthread_mutex_unlock(&s->lock);
    return NULL;
}

/* The calling thread's part, until all of it is done but hooks. */
static bool run_spans(bst_islands *s) {
    const bst_engine *engine = s->engine;
    bool interrupted = false;
    double asked = bst_wall_seconds();
    while (!finished(s)) {
        double now = bst_wall_seconds();
        if (engine->hooks.interrupted && !interrupted && now - asked > 0.02) {
            asked = now;
            int64_t tick = engine->tick;
            pthread_mutex_unlock(&s->lock);
            interrupted = engine->hooks.interrupted(engine->hooks.user, tick);
            pthread_mutex_lock(&s->lock);
            if (interrupted && s->opened < s->end) {
                s->end = s->opened; /* what is under way is brought to its end */
            }
        } else {
            do_or_await(s);
        }
    }
    s->hooking = true; /* what is left is for the caller */
    return interrupted;
}

bst_status bst_islands_run(bst_ctx *ctx, bst_engine *engine, int64_t until_tick) {
    bst_islands *s = engine->islands;
    pthread_mutex_lock(&s->lock);
    s->ctx = ctx;
    s->heard = BST_OK;
    s->last_tick = until_tick;
    s->end = s->failed ? s->end : INT64_MAX;
    s->hooking = false;
    tell(s);
    bool interrupted = run_spans(s);
    const island *failed = first_failure(s);
    bst_status status = BST_OK, heard = s->heard;
    for (; s->hooked < s->linked + s->failed && heard == BST_OK; s->hooked++) {
        bool all, last = s->hooked == s->linked;
        heard = bst_islands_do_hooks(ctx, engine, s->hooked, INT32_MAX,
                                     last ? failed->failed_tick : INT64_MAX,
                                     last ? failed->failed_instance : 0, &all);
    }
    pthread_mutex_unlock(&s->lock);
    for (int i = 0; i <= s->count; i++) {
        ctx->warnings += s->islands[i].ctx.warnings;
        s->islands[i].ctx.warnings = 0;
    }
    if (heard != BST_OK) {
        return heard;
    }
    if (failed) {
        status = bst_fail(ctx, failed->status, "%s", failed->ctx.message);
    } else if (interrupted) {
        status = bst_fail(ctx, BST_ERR_INTERRUPTED, "interrupted at %.3f s",
                          (double)engine->tick / (double)engine->tick_rate_hz);
    }
    return status;
}

/* ---- making them ---- */

/* Gives each instance the number of its island, sensors' instances first; returns how many there
 * are. */
static int number_islands(bst_engine *engine) {
    int count = 0;
    for (int i = 0; i < engine->instance_count; i++) {
        instance *self = engine->instances[i];
        self->order = i;
        self->island = -1;
        for (int k = 0; k < i && self->island < 0; k++) {
            const instance *other = engine->instances[k];
            bool same = other->island >= 0 && strcmp(other->scope, self->scope) == 0;
            self->island = same ? other->island : -1;
        }
        if (self->island < 0 && self->spec.member_count == 0) {
            self->island = count++;
        }
    }
    for (int i = 0; i < engine->instance_count; i++) {
        instance *self = engine->instances[i];
        self->island = self->spec.member_count > 0 ? count : self->island;
    }
    return count;
}

/* Whether instances of different islands can be stepped in any order between the steps of what
 * links them: no message makes another island step, none is read at the tick it was written. */
static bool can_part(const bst_engine *engine) {
    for (int i = 0; i < engine->instance_count; i++) {
        const instance *self = engine->instances[i];
        if (self->spec.member_count > 0 && self->trigger_count > 0) {
            return false;
        }
        for (int p = 0; p < self->port_count && self->spec.member_count == 0; p++) {
            const bst_port *port = bst_instance_port(self, p);
            const port_state *state = &self->ports[p];
            if (port->direction == BST_PORT_OUT || state->channel < 0) {
                continue;
            }
            int writer = engine->channels[state->channel].writer;
            if (engine->instances[writer]->spec.member_count > 0 &&
                (state->delay_ticks < 1 || (port->flags & BST_PORT_TRIGGER))) {
                return false;
            }
        }
    }
    return true;
}

/* Finds the one instance that links the islands, and whether they may go ahead of it. */
static void find_link(bst_islands *s) {
    bst_engine *engine = s->engine;
    s->link = -1;
    s->ahead = true;
    for (int i = 0; i < engine->instance_count; i++) {
        const instance *self = engine->instances[i];
        if (self->spec.member_count > 0) {
            s->ahead = s->ahead && s->link < 0 && self->spec.period_ticks > 0 &&
                       (self->spec.desc->flags & BST_MODULE_PROMISES);
            s->link = i;
        }
    }
    for (int i = 0; i <= s->count; i++) {
        s->islands[i].free_tick = s->link < 0 ? INT64_MAX : INT64_MIN;
    }
    if (s->link < 0 || !s->ahead) {
        return;
    }
    instance *link = engine->instances[s->link];
    for (int p = 0; p < link->port_count; p++) {
        port_state *port = &link->ports[p];
        bst_port_direction direction = bst_instance_port(link, p)->direction;
        const channel *ch = port->channel >= 0 ? &engine->channels[port->channel] : NULL;
        if (ch && (direction == BST_PORT_MODIFY || ch->type->in_place)) {
            s->ahead = false;
        }
        for (int i = 0; ch && i < engine->instance_count; i++) {
            if (i != s->link && strcmp(engine->instances[i]->scope, ch->scope) == 0) {
                port->island = engine->instances[i]->island;
            }
        }
    }
    link->reads_aside = s->ahead;
}

static void free_islands(bst_islands *s) {
    for (int i = 0; s->islands && i <= s->count; i++) {
        free(s->islands[i].heap.items);
        bst_islands_free_notes(&s->islands[i]);
    }
    free(s->islands);
    free(s->threads);
    free(s);
}

static bst_status fill(bst_ctx *ctx, bst_islands *s, int threads) {
    bst_engine *engine = s->engine;
    s->islands = calloc((size_t)s->count + 1, sizeof *s->islands);
    s->threads = calloc((size_t)threads + 1, sizeof *s->threads);
    bool enough = s->islands && s->threads;
    for (int i = 0; enough && i <= s->count; i++) {
        island *self = &s->islands[i];
        self->last_tick = -1;
        bst_ctx_init(&self->ctx, ctx->log, ctx->log_user, ctx->log_level);
        self->heap.items = calloc((size_t)engine->instance_count + 1, sizeof *self->heap.items);
        enough = self->heap.items != NULL;
    }
    if (!enough) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %d sensors", s->count);
    }
    for (int i = 0; i < engine->instance_count; i++) {
        instance *self = engine->instances[i];
        self->heap = &s->islands[self->island].heap;
        engine->place[i] = self->heap->count;
        self->heap->items[self->heap->count++] = i;
    }
    s->from_tick = INT64_MAX;
    for (int i = 0; i < engine->instance_count; i++) {
        bst_engine_set_due(engine, i, engine->due[i]);
        s->from_tick = engine->due[i] < s->from_tick ? engine->due[i] : s->from_tick;
    }
    find_link(s);
    s->link_tick = link_due(s);
    return BST_OK;
}

bst_status bst_engine_part(bst_ctx *ctx, bst_engine *engine, int threads, bool *parted) {
    *parted = false;
    if (!engine->loaded || engine->overlap || engine->islands) {
        return bst_fail(ctx, BST_ERR_STATE, "an engine is parted once, after loading");
    }
    int count = number_islands(engine);
    if (count < 2 || threads < 2 || engine->releasable_count > 0 || !can_part(engine)) {
        return BST_OK;
    }
    bst_islands *s = calloc(1, sizeof *s);
    if (!s) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %d sensors", count);
    }
    s->engine = engine;
    s->count = count;
    int wanted = (threads < count ? threads : count) - 1;
    bst_status status = fill(ctx, s, wanted);
    if (status != BST_OK) {
        free_islands(s);
        return status;
    }
    pthread_mutex_init(&s->lock, NULL);
    pthread_cond_init(&s->changed, NULL);
    sigset_t all, before; /* signals are the main thread's */
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    while (s->thread_count < wanted &&
           bst_core_thread_start(&s->threads[s->thread_count], work, s) == 0) {
        s->thread_count++;
    }
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    engine->islands = s;
    if (s->thread_count == 0) {
        return bst_fail(ctx, BST_ERR_MEMORY, "cannot start a thread");
    }
    *parted = true;
    return BST_OK;
}

void bst_islands_stop(bst_engine *engine) {
    bst_islands *s = engine->islands;
    if (!s) {
        return;
    }
    pthread_mutex_lock(&s->lock);
    s->stop = true;
    tell(s);
    pthread_mutex_unlock(&s->lock);
    for (int i = 0; i < s->thread_count; i++) {
        pthread_join(s->threads[i], NULL);
    }
    pthread_cond_destroy(&s->changed);
    pthread_mutex_destroy(&s->lock);
    free_islands(s);
    engine->islands = NULL;
}
