/* Threads that step logical processes and call observers. The assignment of work to threads varies;
 * the results do not. See docs/explanation/executor.md. */
#include <signal.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/parallel.h"
#include "sim/core/wall_clock.h"
#include "sim/engine/kernel/executor_internal.h"

/* ---- choice of work; with the lock held ---- */

/* Checks whether a thread may step a logical process. */
static bool may_step(const bst_executor *x, const logical_process *self, bool caller) {
    return !x->caller_only || caller == (self->kind == BST_PROCESS_SENSORS);
}

/* Predicted duration of a process's next window, from the last two. */
static double expected_s(const logical_process *self) {
    return self->took_s[0] > self->took_s[1] ? self->took_s[0] : self->took_s[1];
}

/* Selects the logical process to step next: first multi-sensor modules, which others wait for, then
 * the one with the smallest clock, then the one with the longest window. NULL: none can step. */
static logical_process *next_process(bst_executor *x, bool caller) {
    logical_process *best = NULL;
    const int64_t least = bst_sync_least_clock(x);
    for (int k = 0; k < x->count; k++) {
        logical_process *self = &x->processes[k];
        if (!may_step(x, self, caller) || !bst_sync_can_step(x, self, least)) {
            continue;
        }
        if (self->kind == BST_PROCESS_LINK) {
            return self;
        }
        if (!best || self->clock < best->clock ||
            (self->clock == best->clock && expected_s(self) > expected_s(best))) {
            best = self;
        }
    }
    return best;
}

/* The next sample on which a deferred module may call `ahead`. */
static sample_point *next_look(bst_executor *x, logical_process **of) {
    for (int k = 0; k < x->count; k++) {
        sample_point *sample = bst_sync_next_look(&x->processes[k]);
        if (sample) {
            *of = &x->processes[k];
            return sample;
        }
    }
    return NULL;
}

/* Steps a logical process without the executor's lock. */
static void step_process(bst_executor *x, logical_process *self) {
    self->busy = true;
    bst_observers_begin_window(&self->log);
    pthread_mutex_unlock(&x->lock);
    bst_process_step(x, self);
    pthread_mutex_lock(&x->lock);
    bst_sync_end_window(x, self);
}

/* Lets a logical process compute ahead at a sample point, without the lock. */
static void look_ahead(bst_executor *x, logical_process *self, sample_point *sample) {
    sample_point copy = *sample;
    sample->look = BST_LOOK_BUSY;
    x->looking++;
    pthread_mutex_unlock(&x->lock);
    bst_process_look(x, self, &copy);
    pthread_mutex_lock(&x->lock);
    sample->look = BST_LOOK_DONE;
    x->looking--;
    bst_sync_wake(x);
}

/* Does one unit of work: a window, observers or a look-ahead. False: no work for this thread. */
static bool do_work(bst_executor *x, bool caller) {
    if (!x->running || x->heard != BST_OK) {
        return false;
    }
    bool others = !(x->caller_only && caller); /* the calling thread only steps its own process */
    if (others && bst_observers_behind(x) && bst_observers_ready(x)) {
        bst_observers_work(x);
        return true;
    }
    logical_process *self = next_process(x, caller);
    if (self) {
        step_process(x, self);
        return true;
    }
    if (others && bst_observers_ready(x)) {
        bst_observers_work(x);
        return true;
    }
    sample_point *sample = others ? next_look(x, &self) : NULL;
    if (sample) {
        look_ahead(x, self, sample);
    }
    return sample != NULL;
}

/* Sleeps until the state of the executor changes; with its lock held. */
static void await_change(bst_executor *x) {
    x->sleeping++;
    pthread_cond_wait(&x->changed, &x->lock);
    x->sleeping--;
}

/* Main function of an executor thread. */
static void *work(void *user) {
    bst_executor *x = user;
    pthread_mutex_lock(&x->lock);
    while (!x->stop) {
        if (!do_work(x, false)) {
            await_change(x);
        }
    }
    pthread_mutex_unlock(&x->lock);
    return NULL;
}

/* Checks whether the executor has no work in progress and none can begin. */
static bool finished(bst_executor *x) {
    bool busy = x->observing || x->looking > 0;
    for (int k = 0; k < x->count && !busy; k++) {
        busy = x->processes[k].busy;
    }
    return !busy && (x->heard != BST_OK || (!next_process(x, true) && !next_process(x, false) &&
                                            !bst_observers_ready(x)));
}

/* ---- a run ---- */

/* Stops the run: windows in progress complete, and all processes end at one tick. */
static void interrupt(bst_executor *x) {
    int64_t end = 0;
    for (int k = 0; k < x->count; k++) {
        const logical_process *self = &x->processes[k];
        int64_t tick = self->busy ? self->limit : self->clock;
        end = tick > end ? tick : end;
    }
    x->end = end < x->end ? end : x->end;
    x->interrupted = true;
}

/* The calling thread works until the run is complete, and polls for interrupts every 20 ms. */
static void work_to_end(bst_executor *x) {
    const bst_engine_hooks *hooks = &x->engine->hooks;
    while (!finished(x)) {
        double now = bst_wall_seconds();
        if (hooks->interrupted && !x->interrupted && now - x->engine->asked_s > 0.02) {
            x->engine->asked_s = now;
            int64_t tick = x->engine->tick;
            pthread_mutex_unlock(&x->lock);
            bool interrupted = hooks->interrupted(hooks->user, tick);
            pthread_mutex_lock(&x->lock);
            if (interrupted) {
                interrupt(x);
            }
        } else if (!do_work(x, true)) {
            await_change(x);
        }
    }
}

/* The process whose module failed first, in the order of a run on one thread; NULL: none. */
static const logical_process *first_failure(const bst_executor *x) {
    const logical_process *first = NULL;
    for (int k = 0; k < x->count; k++) {
        const logical_process *one = &x->processes[k];
        if (one->status != BST_OK &&
            (!first || bst_before(one->failed_tick, one->failed_instance, first->failed_tick,
                                  first->failed_instance))) {
            first = one;
        }
    }
    return first;
}

/* Status of a run: the first failure in the order of a run on one thread. */
static bst_status outcome(bst_ctx *ctx, const bst_executor *x) {
    bst_engine *engine = x->engine;
    const logical_process *failed = first_failure(x);
    if (x->heard != BST_OK) {
        return bst_engine_heard(ctx, engine, x->heard);
    }
    if (failed) {
        engine->tick = failed->failed_tick;
        return bst_fail(ctx, failed->status, "%s", failed->ctx.message);
    }
    for (int k = 0; k < x->count; k++) {
        if (x->processes[k].clock < x->end) {
            return bst_fail(ctx, BST_ERR_STATE,
                            "the executor stands still at tick %lld of %lld (a fault of the "
                            "program; --serial runs without it)",
                            (long long)x->processes[k].clock, (long long)x->end);
        }
    }
    return x->interrupted ? bst_fail(ctx, BST_ERR_INTERRUPTED, "interrupted at %.3f s",
                                     (double)engine->tick / (double)engine->tick_rate_hz)
                          : BST_OK;
}

bst_status bst_executor_run(bst_ctx *ctx, bst_engine *engine, int64_t until_tick) {
    bst_executor *x = engine->executor;
    pthread_mutex_lock(&x->lock);
    const logical_process *failed = first_failure(x);
    x->end = failed && failed->failed_tick < until_tick ? failed->failed_tick + 1 : until_tick;
    x->interrupted = false;
    x->running = true;
    for (int k = 0; k < x->count; k++) {
        bst_sync_follow(x, &x->processes[k]);
    }
    bst_sync_wake(x);
    work_to_end(x);
    x->running = false;
    bst_status status = outcome(ctx, x);
    pthread_mutex_unlock(&x->lock);
    for (int k = 0; k < x->count; k++) {
        ctx->warnings += x->processes[k].ctx.warnings;
        x->processes[k].ctx.warnings = 0;
    }
    return status;
}

/* ---- creation ---- */

/* Number of threads, besides the calling one, that can have work. */
static int helpers_wanted(const bst_executor *x, int threads) {
    int tasks = 1, least = 1; /* one task for observers */
    for (int k = 0; k < x->count; k++) {
        const logical_process *self = &x->processes[k];
        bool looks = self->looker >= 0;
        tasks += looks + !(x->caller_only && self->kind == BST_PROCESS_SENSORS);
        least = looks ? 2 : least;
    }
    tasks -= !x->caller_only; /* the calling thread takes one task */
    int wanted = threads - 1 > least ? threads - 1 : least;
    return wanted < tasks ? wanted : tasks;
}

static bst_status start_threads(bst_ctx *ctx, bst_executor *x, int wanted) {
    x->threads = calloc((size_t)wanted + 1, sizeof *x->threads);
    if (!x->threads) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %d threads", wanted);
    }
    sigset_t all, before; /* signals go to the main thread */
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    int error = 0;
    while (x->thread_count < wanted && !error) {
        error = bst_core_thread_start(&x->threads[x->thread_count], work, x);
        x->thread_count += !error;
    }
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    return x->thread_count > 0
               ? BST_OK
               : bst_fail(ctx, BST_ERR_MEMORY, "cannot start a thread: %s", strerror(error));
}

bst_status bst_engine_parallel(bst_ctx *ctx, bst_engine *engine, int threads) {
    if (!engine->loaded || engine->executor || engine->paused) {
        return bst_fail(ctx, BST_ERR_STATE,
                        "an engine gets its threads once, after loading and not within a tick");
    }
    bst_executor *x = calloc(1, sizeof *x);
    if (!x) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the executor");
    }
    x->engine = engine;
    pthread_mutex_init(&x->lock, NULL);
    pthread_mutex_init(&x->asking, NULL);
    pthread_cond_init(&x->changed, NULL);
    engine->executor = x; /* freed with the engine, also after an error */
    bst_status status = bst_partition_make(ctx, x, threads);
    return status == BST_OK ? start_threads(ctx, x, helpers_wanted(x, threads)) : status;
}

void bst_executor_free(bst_engine *engine) {
    bst_executor *x = engine->executor;
    if (!x) {
        return;
    }
    pthread_mutex_lock(&x->lock);
    x->stop = true;
    bst_sync_wake(x);
    pthread_mutex_unlock(&x->lock);
    for (int i = 0; i < x->thread_count; i++) {
        pthread_join(x->threads[i], NULL);
    }
    bst_observers_discard(x);
    bst_partition_free(x);
    pthread_cond_destroy(&x->changed);
    pthread_mutex_destroy(&x->asking);
    pthread_mutex_destroy(&x->lock);
    free(x->threads);
    free(x);
    engine->executor = NULL;
}
