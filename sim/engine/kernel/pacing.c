#define _GNU_SOURCE /* cpu_set_t */
#include "sim/engine/kernel/pacing.h"

#include <errno.h>
#include <math.h>
#include <sched.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "sim/core/wall_clock.h"
#include "sim/engine/kernel/engine_internal.h"
#include "sim/link/link.h"

static const char *const mode_names[] = {"lockstep", "realtime", "fast", NULL};
static const char *const overrun_names[] = {"slip", "drop", "hold", NULL};

const bst_config_desc bst_pacing_config_table[] = {
    BST_ENUM(bst_pacing_config, mode, mode_names, "\"lockstep\"",
             "As quickly as work and peers allow; by the wall clock; or without waiting for peers: "
             "the last two do not repeat."),
    BST_ENUM(bst_pacing_config, overrun, overrun_names, "\"slip\"",
             "realtime, a deadline behind the clock: it is set back; frames are lost until the run "
             "has caught up; or all are made late, and peers not awaited beyond the deadline."),
    BST_REAL(bst_pacing_config, speed, "", 0.001, 1000, "1",
             "realtime: simulated seconds per second of the clock."),
    BST_REAL(bst_pacing_config, deadline_s, "s", 0, 3600, "0",
             "realtime: wall time from when a frame is due until it counts as late; 0: a frame "
             "period."),
    BST_INT(bst_pacing_config, priority, "", 0, 99, "0",
            "realtime: SCHED_FIFO priority of the stepping thread, if the system allows; 0: none."),
    BST_INT(bst_pacing_config, cpu, "", -1, 1023, "-1",
            "realtime: processor that the stepping thread stays on, if the system allows; -1: "
            "any."),
    BST_CONFIG_END};

const char *bst_pacing_mode_name(int32_t mode) {
    return mode_names[mode];
}
const char *bst_overrun_name(int32_t overrun) {
    return overrun_names[overrun];
}

const double bst_pacing_edges_ms[BST_PACING_BINS - 1] = {1,  2,  5,  10,  15,  20,  25,  30,
                                                         40, 50, 75, 100, 200, 500, 1000};

enum { RECENT = 256 };

/* An exposure that has ended and waits for its detections. */
typedef struct recent_frame {
    const char *scope;
    int64_t id, tick;
    double made_s; /* wall-clock time of its end */
} recent_frame;

struct bst_pacing {
    bst_pacing_config config;
    double rate_hz;
    pthread_mutex_t lock; /* detections may come from another thread */
    bool started;
    double origin_s; /* wall-clock time of tick 0 */
    double asked_s;  /* last call of the observer `interrupted` */
    bst_pacing_figures figures;
    recent_frame recent[RECENT];
    int next;
};

/* Deadline of a frame in seconds of wall time: the configured value, else the sensor's frame
 * period. */
static double deadline_of(const bst_pacing *p, const instance *writer) {
    double period_s = writer->spec.frame_period_s / p->config.speed;
    return p->config.deadline_s > 0.0 ? p->config.deadline_s : period_s > 0.0 ? period_s : 0.1;
}

/* Selects the channel whose messages complete a frame of a sensor: detections, else frame. */
static void choose_channels(bst_engine *engine) {
    static const char *const names[] = {BST_CHANNEL_DETECTIONS, BST_CHANNEL_FRAME};
    for (size_t n = 0; n < sizeof names / sizeof *names; n++) {
        for (int c = 0; c < engine->channel_count; c++) {
            channel *ch = &engine->channels[c];
            bool taken = false;
            for (int k = 0; k < engine->channel_count; k++) {
                taken |=
                    engine->channels[k].paced && strcmp(engine->channels[k].scope, ch->scope) == 0;
            }
            ch->paced = ch->paced || (!taken && strcmp(ch->type->name, names[n]) == 0);
        }
    }
}

/* Warns if the pacing asks for more than 60 frames per second of wall time. */
static void warn_of_rates(bst_ctx *ctx, const bst_engine *engine, const bst_pacing *p) {
    for (int i = 0; i < engine->instance_count; i++) {
        const instance *self = engine->instances[i];
        double rate_hz = p->config.speed / self->spec.frame_period_s;
        if (strcmp(self->spec.desc->role, "exposure") == 0 && rate_hz > 60.0 * (1.0 + 1e-9)) {
            bst_log(ctx, BST_LOG_WARNING,
                    "pacing: %s: %.4g frames per second of the clock; up to 60 are kept with care",
                    self->scope, rate_hz);
        }
    }
}

bst_status bst_engine_pace(bst_ctx *ctx, bst_engine *engine, const bst_pacing_config *config) {
    if (!engine->loaded || engine->pacing || engine->executor) {
        return bst_fail(ctx, BST_ERR_STATE, "an engine is paced once, after loading");
    }
    bst_pacing *p = calloc(1, sizeof *p);
    if (!p) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the pacing");
    }
    p->config = *config;
    p->rate_hz = (double)engine->tick_rate_hz;
    pthread_mutex_init(&p->lock, NULL);
    engine->pacing = p;
    if (!config->replay) {
        choose_channels(engine);
    }
    warn_of_rates(ctx, engine, p);
    return BST_OK;
}

void bst_pacing_free(bst_pacing *p) {
    if (p) {
        pthread_mutex_destroy(&p->lock);
        free(p);
    }
}

bool bst_engine_pacing(const bst_engine *engine, bst_pacing_figures *out) {
    if (!engine->pacing || engine->pacing->config.replay) {
        return false;
    }
    pthread_mutex_lock(&engine->pacing->lock);
    *out = engine->pacing->figures;
    pthread_mutex_unlock(&engine->pacing->lock);
    return true;
}

/* Wall-clock time at which a tick is due. */
static double due_s(const bst_pacing *p, int64_t tick) {
    return p->origin_s + (double)tick / p->rate_hz / p->config.speed;
}

bst_status bst_pacing_wait(bst_ctx *ctx, bst_engine *engine, int64_t tick) {
    bst_pacing *p = engine->pacing;
    double now = bst_wall_seconds();
    if (!p->started) {
        pthread_mutex_lock(&p->lock);
        p->started = true;
        p->origin_s = now - (double)tick / p->rate_hz / p->config.speed;
        pthread_mutex_unlock(&p->lock);
        p->asked_s = now;
    }
    double due = due_s(p, tick);
    while (now < due) {
        double until = due - now > 0.05 ? now + 0.05 : due, whole = floor(until);
        struct timespec at = {(time_t)whole, (long)((until - whole) * 1e9)};
        (void)clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &at,
                              NULL); /* a signal also ends the sleep */
        now = bst_wall_seconds();
        if (engine->hooks.interrupted && now - p->asked_s > 0.02) {
            p->asked_s = now;
            if (engine->hooks.interrupted(engine->hooks.user, tick)) {
                return bst_fail(ctx, BST_ERR_INTERRUPTED, "interrupted at %.3f s",
                                (double)tick / p->rate_hz);
            }
        }
    }
    return BST_OK;
}

/* Reads or writes a dropped frame in the recording of a linked run. */
static bool drop_in_recording(struct bst_step *step, const bst_pacing *p, bool drop) {
    struct bst_link *link = step->self->spec.link;
    if (link && p->config.mode == BST_PACING_REALTIME && p->config.overrun == BST_OVERRUN_DROP) {
        bst_status status =
            bst_link_keep_drop(step->ctx, link, step->self->name, step->tick, &drop);
        step->hook_status = step->hook_status == BST_OK ? status : step->hook_status;
    }
    return drop;
}

bool bst_pacing_frame(struct bst_step *step, int64_t id) {
    bst_pacing *p = step->engine->pacing;
    if (!p) {
        return false;
    }
    if (p->config.replay) {
        return drop_in_recording(step, p, false);
    }
    pthread_mutex_lock(&p->lock);
    /* only real-time pacing can be late */
    double now = bst_wall_seconds();
    double behind = p->config.mode == BST_PACING_REALTIME ? now - due_s(p, step->tick) : 0.0;
    double deadline = deadline_of(p, step->self);
    bool overrun = behind > deadline, drop = overrun && p->config.overrun == BST_OVERRUN_DROP;
    p->figures.deadline_s = fmax(p->figures.deadline_s, deadline);
    p->figures.frames++;
    p->figures.overruns += overrun;
    p->figures.dropped += drop;
    if (overrun && p->config.overrun == BST_OVERRUN_SLIP) {
        p->origin_s += behind;
        p->figures.slipped_s += behind;
    }
    if (!drop) {
        p->recent[p->next] = (recent_frame){step->self->scope, id, step->tick, now};
        p->next = (p->next + 1) % RECENT;
    }
    pthread_mutex_unlock(&p->lock);
    if (overrun) {
        static const char *const words[] = {"the clock is set back", "the frame is dropped",
                                            "the run hurries"};
        bst_step_event(step, "overrun", "%.3f s behind the clock: %s", behind,
                       words[p->config.overrun]);
    }
    return drop_in_recording(step, p, drop);
}

/* Exposure number of a frame or detections message. */
static int64_t exposure_of(const channel *ch, const void *payload) {
    return strcmp(ch->type->name, BST_CHANNEL_FRAME) == 0
               ? ((const bst_frame_message *)payload)->exposure_id
               : ((const bst_detections *)payload)->exposure_id;
}

/* Delay in ticks from an exposure's end to the step of the channel's writer. */
static int64_t declared_delay(const instance *writer) {
    int64_t longest = 0;
    for (int t = 0; t < writer->trigger_count; t++) {
        int64_t delay = writer->ports[writer->triggers[t]].delay_ticks;
        longest = delay > longest ? delay : longest;
    }
    return longest;
}

void bst_pacing_done(const struct bst_step *step, const channel *ch, const void *payload) {
    bst_pacing *p = step->engine->pacing;
    int64_t id = exposure_of(ch, payload), tick = step->tick;
    pthread_mutex_lock(&p->lock);
    double now = bst_wall_seconds(), made_s = now;
    for (int i = 0; i < RECENT; i++) {
        const recent_frame *r = &p->recent[i];
        if (r->scope && r->id == id && strcmp(r->scope, ch->scope) == 0) {
            int64_t due = r->tick + declared_delay(step->self);
            tick = due < tick
                       ? due
                       : tick; /* a late external answer: count from the time at which it was due */
            made_s = r->made_s;
        }
    }
    double since = p->config.mode == BST_PACING_REALTIME ? due_s(p, tick) : made_s;
    double response = fmax(0.0, now - since);
    int bin = 0;
    while (bin < BST_PACING_BINS - 1 && response * 1e3 > bst_pacing_edges_ms[bin]) {
        bin++;
    }
    bst_pacing_figures *f = &p->figures;
    f->done++;
    f->late += response > deadline_of(p, step->self);
    f->longest_s = fmax(f->longest_s, response);
    f->sum_s += response;
    f->histogram[bin]++;
    pthread_mutex_unlock(&p->lock);
}

bool bst_pacing_by_clock(const bst_engine *engine) {
    const bst_pacing *p = engine->pacing;
    return p && p->config.mode == BST_PACING_REALTIME && !p->config.replay;
}

/* ---- scheduling of the thread ---- */

typedef struct saved_thread {
    int policy;
    struct sched_param param;
    cpu_set_t cpus;
} saved_thread;

_Static_assert(sizeof(saved_thread) <= sizeof(bst_pacing_thread), "room for what is restored");

void bst_pacing_thread_take(bst_ctx *ctx, bst_engine *engine, bst_pacing_thread *saved_out) {
    bst_pacing *p = engine->pacing;
    saved_thread saved;
    memset(&saved, 0, sizeof saved);
    if (p->config.replay) {
        return;
    }
    (void)pthread_getschedparam(pthread_self(), &saved.policy, &saved.param);
    (void)pthread_getaffinity_np(pthread_self(), sizeof saved.cpus, &saved.cpus);
    memcpy(saved_out, &saved, sizeof saved);
    if (p->config.priority > 0) {
        const struct sched_param wanted = {.sched_priority = (int)p->config.priority};
        int why = pthread_setschedparam(pthread_self(), SCHED_FIFO, &wanted);
        p->figures.priority = why == 0;
        if (why != 0) {
            bst_log(ctx, BST_LOG_WARNING,
                    "pacing: no real-time priority of %lld: %s (root, CAP_SYS_NICE or a limit "
                    "\"rtprio\" of at least as much allow it); the run goes on without",
                    (long long)p->config.priority, strerror(why));
        }
    }
    if (p->config.cpu >= 0) {
        cpu_set_t one;
        CPU_ZERO(&one);
        CPU_SET((size_t)p->config.cpu, &one);
        int why = pthread_setaffinity_np(pthread_self(), sizeof one, &one);
        p->figures.cpu = why == 0;
        if (why != 0) {
            bst_log(ctx, BST_LOG_WARNING,
                    "pacing: cannot stay on processor %lld: %s; the run goes on without",
                    (long long)p->config.cpu, strerror(why));
        }
    }
}

void bst_pacing_thread_give_back(const bst_engine *engine, const bst_pacing_thread *saved_in) {
    saved_thread saved;
    memcpy(&saved, saved_in, sizeof saved);
    if (engine->pacing->figures.priority) {
        (void)pthread_setschedparam(pthread_self(), saved.policy, &saved.param);
    }
    if (engine->pacing->figures.cpu) {
        (void)pthread_setaffinity_np(pthread_self(), sizeof saved.cpus, &saved.cpus);
    }
}
