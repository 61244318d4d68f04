/* Engines of random make: modules that mix what they read, and write what came out. Every message
 * carries a hash of all that its writer has read until then, so that one message read too early or
 * too late changes all that follow. Steps and observers take random times. */
#ifndef BST_TESTS_ENGINE_RANDOM_ENGINE_H
#define BST_TESTS_ENGINE_RANDOM_ENGINE_H

#include <time.h>

#include "sim/engine/kernel/engine_state.h"
#include "tests/engine/fake_module.h"

enum { MOST_SENSORS = 5, MOST_MODULES = 5 * 6 + 2, RING = 8, POOL = 64, RECORDS = 60000 };

/* What a seed decides. */
typedef struct make {
    uint64_t seed;
    int sensors, links;
    bool closed;      /* control reads tracks, so that nothing is deferred */
    bool link_tracks; /* and the multi-sensor module too */
    bool wakes;       /* that asks to be woken, and so cannot say when it steps */
    bool task_steps;  /* tasks make the sensors' control step */
    bool lends;       /* a module lends memory to observers */
    bool link_first;  /* in name, so that it steps as early in a tick as it can */
    bool looks;
    int link_period;  /* 0: of the seed's choice */
    int64_t fails_at; /* tick, -1: never */
    int fails_module;
    int64_t full_at;  /* records until an observer fails, -1: never */
    int64_t stops_at; /* interrupted at this tick or later, -1: never */
} make;

/* Frames of one camera. */
typedef struct pooled {
    bst_frame frame;
    int lent;      /* atomic */
    int *recycled; /* counts; atomic */
} pooled;
typedef struct pool {
    pooled frames[POOL];
    int made, recycled, most;
} pool;

typedef struct scene {
    make m;
    bool delays;
    uint64_t records[RECORDS];
    int count;
    bst_ctx observers;
    pool pools[MOST_SENSORS];
    int faults; /* atomic: what may not be asserted on other threads */
} scene;

typedef struct module {
    fake base;
    scene *s;
    int number, sensor, members;
    uint64_t state;
    int64_t lent[RING];
    uint64_t kept[BST_STEP_LANES], looked[BST_STEP_LANES];
} module;

static inline uint64_t mix(uint64_t a, uint64_t b) {
    a = (a ^ (b + 0x9e3779b97f4a7c15u)) * 0xbf58476d1ce4e5b9u;
    return a ^ (a >> 29);
}

static inline int below(uint64_t *state, int n) {
    *state = mix(*state, 1);
    return (int)((*state >> 20) % (uint64_t)n);
}

/* Now and then up to 0.2 ms, by the clock: another time in every run. */
static inline void take_time(const scene *s) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    uint64_t chance = mix((uint64_t)now.tv_nsec, (uint64_t)(uintptr_t)&now);
    if (s->delays && chance % 8 == 0) {
        nanosleep(&(struct timespec){.tv_nsec = (long)(chance % 200000)}, NULL);
    }
}

/* ---- modules: they mix what they read, and write what came out ---- */

static inline uint64_t content_of(const char *channel, const void *payload) {
    uint64_t hash = 0;
    if (strcmp(channel, BST_CHANNEL_FRAME) == 0) {
        const bst_frame_message *m = payload;
        hash = mix((uint64_t)m->exposure_id, m->frame ? (uint64_t)m->frame->width : 0);
    } else if (strcmp(channel, BST_CHANNEL_POINTING_TELEMETRY) == 0) {
        const bst_pointing_telemetry *t = payload;
        for (int i = 0; i < t->capacity; i++) {
            hash = mix(hash, (uint64_t)t->items[i].tick);
        }
        hash = mix(hash, (uint64_t)t->written);
    } else if (strcmp(channel, BST_CHANNEL_PLANES) == 0) {
        const bst_planes *p = payload;
        hash = mix((uint64_t)p->exposure_id, (uint64_t)(p->segmentation ? p->segmentation[0] : 0));
    } else {
        memcpy(&hash, payload, sizeof hash);
    }
    return hash;
}

static inline uint64_t mix_sample(uint64_t state, const char *channel, bst_sample sample) {
    if (!sample.payload) {
        return mix(state, 77);
    }
    state = mix(state, content_of(channel, sample.payload));
    return mix(mix(state, (uint64_t)sample.written_tick),
               (uint64_t)(2 * sample.sequence + sample.stale));
}

static inline void recycle(void *owner) {
    pooled *f = owner;
    __atomic_fetch_add(f->recycled, 1, __ATOMIC_RELAXED);
    __atomic_store_n(&f->lent, 0, __ATOMIC_RELEASE);
}

/* Pixels of all frames; only their size is compared. */
static inline bst_status map_frame(void *owner, bst_ctx *ctx, const uint16_t **pixels) {
    static const uint16_t dark[0x10000];
    (void)owner, (void)ctx;
    *pixels = dark;
    return BST_OK;
}
static inline void unmap_frame(void *owner) {
    (void)owner;
}

static inline void write_frame(module *self, struct bst_step *step, int p) {
    static const bst_frame_ops ops = {.map = map_frame, .unmap = unmap_frame, .recycle = recycle};
    pool *from = &self->s->pools[self->sensor];
    int out = from->made - __atomic_load_n(&from->recycled, __ATOMIC_RELAXED);
    from->most = out + 1 > from->most ? out + 1 : from->most;
    int i = 0;
    while (i < POOL && __atomic_load_n(&from->frames[i].lent, __ATOMIC_ACQUIRE)) {
        i++;
    }
    if (i == POOL) {
        __atomic_fetch_add(&self->s->faults, 1, __ATOMIC_RELAXED);
        return;
    }
    pooled *f = &from->frames[i];
    int64_t id = (int64_t)self->state;
    f->frame = (bst_frame){.ops = &ops, .owner = f, .references = 1, .height = 1};
    f->frame.width = 1 + (int)(id & 0xfffe);
    f->recycled = &from->recycled;
    f->lent = 1;
    from->made++;
    bst_frame_message *m = bst_step_write(step, p, NULL);
    *m = (bst_frame_message){.frame = &f->frame, .exposure_id = id};
}

static inline void write_port(module *self, struct bst_step *step, int p, const char *channel) {
    if (strcmp(channel, BST_CHANNEL_FRAME) == 0) {
        write_frame(self, step, p);
        return;
    }
    void *payload = bst_step_write(step, p, NULL);
    if (strcmp(channel, BST_CHANNEL_POINTING_TELEMETRY) == 0) {
        bst_pointing_telemetry *t = payload;
        t->capacity = RING;
        t->items[t->written++ % RING].tick = (int64_t)self->state;
    } else if (strcmp(channel, BST_CHANNEL_PLANES) == 0) {
        self->lent[0] = (int64_t)self->state;
        *(bst_planes *)payload = (bst_planes){.exposure_id = (int64_t)self->state,
                                              .segmentation = (const int32_t *)(void *)self->lent};
    } else {
        memcpy(payload, &self->state, sizeof self->state);
    }
}

/* What a module that sees reads of modules that are not deferred: here and in its steps alike. */
static inline uint64_t see(const module *self, struct bst_step *step) {
    uint64_t hash = 5;
    const bst_port *ports = ((const bst_module_desc *)self->base.other)->ports;
    for (int p = 0; p < 3; p++) {
        bst_sample sample = p == 0 ? bst_step_next(step, p) : bst_step_latest(step, p);
        hash = mix_sample(hash, ports[p].channel, sample);
    }
    return hash;
}

static inline bst_status look(void *module_, struct bst_step *step) {
    module *self = module_;
    int lane = bst_step_lane(step);
    take_time(self->s);
    self->looked[lane] = 1 + (uint64_t)bst_step_tick(step);
    self->kept[lane] = see(self, step);
    return BST_OK;
}

/* Uses what was seen ahead of the step, which must be what it sees itself. */
static inline void see_again(module *self, struct bst_step *step) {
    int lane = bst_step_lane(step);
    uint64_t seen = see(self, step);
    if (self->looked[lane] == 1 + (uint64_t)bst_step_tick(step) && self->kept[lane] != seen) {
        __atomic_fetch_add(&self->s->faults, 1, __ATOMIC_RELAXED);
    }
    self->looked[lane] = 0;
    self->state = mix(self->state, seen);
}

static inline bst_status step_any(fake *base, struct bst_step *step) {
    module *self = (module *)base;
    const bst_module_desc *desc = base->other;
    int64_t tick = bst_step_tick(step);
    take_time(self->s);
    self->state = mix(self->state, (uint64_t)tick);
    if (desc->ahead) {
        see_again(self, step);
    }
    int members = self->members > 0 ? self->members : 1;
    for (int k = 0; k < members * desc->port_count; k++) {
        const bst_port *port = &desc->ports[k % desc->port_count];
        bool queue = bst_channel_type_find(port->channel)->kind == BST_CHANNEL_QUEUE;
        if (port->direction == BST_PORT_OUT) {
            continue;
        }
        bst_sample sample = queue ? bst_step_next(step, k) : bst_step_latest(step, k);
        self->state = mix_sample(self->state, port->channel, sample);
        while (queue && sample.payload) {
            sample = bst_step_next(step, k);
            self->state = mix_sample(self->state, port->channel, sample);
        }
    }
    if (tick >= self->s->m.fails_at && self->s->m.fails_at >= 0 &&
        self->number == self->s->m.fails_module) {
        bst_step_event(step, "end", "%d", self->number);
        return bst_fail(bst_step_ctx(step), BST_ERR_NUMERIC, "module %d", self->number);
    }
    if (self->state % 7 == 0) {
        bst_step_event(step, "report", "%d", (int)(self->state % 1000));
        bst_step_count(step, "reported");
    }
    for (int k = 0; k < members * desc->port_count; k++) {
        const bst_port *port = &desc->ports[k % desc->port_count];
        bool task = strcmp(port->channel, BST_CHANNEL_TASK) == 0;
        if (port->direction == BST_PORT_OUT && bst_step_tick(step) % (1 + k % 3) == 0 &&
            (!task || tick % (1 + k % 7) == 0)) {
            write_port(self, step, k, port->channel);
        }
        if (port->direction == BST_PORT_OUT && (desc->flags & BST_MODULE_HAS_LOOKAHEAD)) {
            int64_t every = 1 + k % 7; /* of tasks that are written, at least */
            bst_step_set_lookahead(step, k, (tick / every + 1) * every);
        }
    }
    if (self->members > 0 && self->s->m.wakes) {
        bst_step_wake_at(step, tick + 1 + (int64_t)(self->state % 40));
    }
    return BST_OK;
}

/* Logs are as long as the declared rates ask for: one that wakes itself may step at every tick. */
static inline bst_status declare_rate(fake *base, const bst_module_env *env) {
    if (((module *)base)->s->m.wakes) {
        bst_env_set_rate(env, (double)env->tick_rate_hz);
    }
    return BST_OK;
}

static inline bst_status archive_any(void *module_, bst_archive *archive) {
    module *self = module_;
    BST_ARCHIVE(archive, self->state);
    BST_ARCHIVE(archive, self->lent);
    return BST_OK;
}

/* ---- engines ---- */

#define IN(channel_, flags_) \
    { .channel = channel_, .direction = BST_PORT_IN, .flags = flags_ }
#define OUT(channel_) \
    { .channel = channel_, .direction = BST_PORT_OUT, .capacity = RING }

static const bst_port clock_ports[] = {OUT(BST_CHANNEL_EXPOSURE),
                                       IN(BST_CHANNEL_TASK, BST_PORT_OPTIONAL | BST_PORT_FEEDBACK)};
static const bst_port plant_ports[] = {
    OUT(BST_CHANNEL_NAV_TELEMETRY), OUT(BST_CHANNEL_POINTING_TELEMETRY),
    IN(BST_CHANNEL_SENSOR_COMMAND, BST_PORT_OPTIONAL | BST_PORT_FEEDBACK)};
static const bst_port camera_ports[] = {IN(BST_CHANNEL_EXPOSURE, BST_PORT_TRIGGER),
                                        IN(BST_CHANNEL_POINTING_TELEMETRY, 0),
                                        OUT(BST_CHANNEL_FRAME), OUT(BST_CHANNEL_PLANES)};
static const bst_port seeing_ports[] = {
    IN(BST_CHANNEL_FRAME, BST_PORT_TRIGGER),
    IN(BST_CHANNEL_POINTING_TELEMETRY, 0),
    {.channel = BST_CHANNEL_NAV_TELEMETRY, .direction = BST_PORT_IN, .max_age_s = 0.01},
    IN(BST_CHANNEL_PREDICTIONS, BST_PORT_FEEDBACK),
    OUT(BST_CHANNEL_DETECTIONS)};
static const bst_port following_ports[] = {
    IN(BST_CHANNEL_DETECTIONS, BST_PORT_TRIGGER), IN(BST_CHANNEL_NAV_TELEMETRY, 0),
    IN(BST_CHANNEL_TASK, BST_PORT_OPTIONAL | BST_PORT_FEEDBACK), OUT(BST_CHANNEL_TRACKS),
    OUT(BST_CHANNEL_PREDICTIONS)};
static const bst_port control_ports[] = {
    OUT(BST_CHANNEL_SENSOR_COMMAND), OUT(BST_CHANNEL_CONTROL_STATUS),
    IN(BST_CHANNEL_TASK, BST_PORT_OPTIONAL | BST_PORT_FEEDBACK), IN(BST_CHANNEL_NAV_TELEMETRY, 0),
    IN(BST_CHANNEL_TRACKS, 0)};
static const bst_port stepped_control_ports[] = {
    OUT(BST_CHANNEL_SENSOR_COMMAND), OUT(BST_CHANNEL_CONTROL_STATUS),
    IN(BST_CHANNEL_TASK, BST_PORT_OPTIONAL | BST_PORT_FEEDBACK | BST_PORT_TRIGGER),
    IN(BST_CHANNEL_NAV_TELEMETRY, 0), IN(BST_CHANNEL_TRACKS, 0)};
static const bst_port tasking_ports[] = {
    IN(BST_CHANNEL_CONTROL_STATUS, 0), IN(BST_CHANNEL_EXPOSURE, 0),
    IN(BST_CHANNEL_POINTING_TELEMETRY, 0), OUT(BST_CHANNEL_TASK), IN(BST_CHANNEL_TRACKS, 0)};

enum { CLOCK, PLANT, CAMERA, SEEING, FOLLOWING, CONTROL, ROLES };

static inline void describe(const make *m, bst_module_desc descs[ROLES + 1]) {
    bst_module_desc all[ROLES + 1] = {FAKE_DESC(clock_ports),     FAKE_DESC(plant_ports),
                                      FAKE_DESC(camera_ports),    FAKE_DESC(seeing_ports),
                                      FAKE_DESC(following_ports), FAKE_DESC(control_ports),
                                      FAKE_DESC(tasking_ports)};
    all[SEEING].flags = all[FOLLOWING].flags = BST_MODULE_DEFERRABLE;
    all[SEEING].ahead = m->looks ? look : NULL;
    all[CAMERA].port_count -= !m->lends;
    if (m->task_steps) {
        all[CONTROL].ports = stepped_control_ports;
    }
    all[CONTROL].port_count -= !m->closed; /* without the tracks */
    all[ROLES].port_count -= !m->link_tracks;
    all[ROLES].flags =
        BST_MODULE_MULTI_SENSOR | (m->wakes ? 0u : (unsigned)BST_MODULE_HAS_LOOKAHEAD);
    for (int r = 0; r <= ROLES; r++) {
        all[r].archive = archive_any;
    }
    memcpy(descs, all, sizeof all);
}

static inline make make_of(uint64_t seed) {
    uint64_t r = mix(seed, 3);
    make m = {.seed = seed, .fails_at = -1, .full_at = -1, .stops_at = -1};
    m.sensors = below(&r, 3) == 0 ? 1 : 2 + below(&r, MOST_SENSORS - 1);
    m.links = m.sensors > 1 && below(&r, 4) > 0;
    m.closed = below(&r, 2);
    m.link_tracks = m.links && below(&r, 2);
    m.wakes = below(&r, 3) == 0;
    m.task_steps = m.links && below(&r, 3) == 0;
    m.lends = below(&r, 6) == 0;
    m.looks = below(&r, 3) > 0;
    m.link_first = below(&r, 2);
    int end = below(&r, 8);
    m.fails_at = end == 0 ? 200 + below(&r, 500) : -1;
    m.fails_module = below(&r, m.sensors * ROLES + m.links);
    m.full_at = end == 1 ? 100 + below(&r, 2000) : -1;
    m.stops_at = end == 2 ? 100 + below(&r, 500) : -1;
    return m;
}

static inline bst_status see_record(scene *s, uint64_t record) {
    take_time(s);
    if (s->count == s->m.full_at) {
        return bst_fail(&s->observers, BST_ERR_IO, "disk full");
    }
    if (s->count < RECORDS) {
        s->records[s->count++] = record;
    }
    return BST_OK;
}

static inline uint64_t hash_text(const char *text) {
    uint64_t hash = 1;
    while (*text) {
        hash = mix(hash, (uint64_t)(unsigned char)*text++);
    }
    return hash;
}

static inline bst_status see_message(void *user, const char *scope, const char *channel,
                                     const void *payload, int64_t tick) {
    return see_record(user, mix(mix(hash_text(scope), hash_text(channel)),
                                mix(content_of(channel, payload), (uint64_t)tick)));
}

static inline bst_status see_event(void *user, int64_t tick, const char *name, const char *kind,
                                   const char *text) {
    return see_record(
        user, mix(mix(hash_text(name), hash_text(kind)), mix(hash_text(text), (uint64_t)tick)));
}

/* A frame in three without its pixels, half of the telemetry not at all. */
static inline bool wants(void *user, const char *scope, const char *channel, const void *payload,
                         int64_t tick, bst_hook_mark *mark) {
    (void)user, (void)scope;
    if (strcmp(channel, BST_CHANNEL_FRAME) == 0) {
        mark->bare = ((const bst_frame_message *)payload)->exposure_id % 3 == 0;
    }
    return strcmp(channel, BST_CHANNEL_NAV_TELEMETRY) != 0 || tick % 2 == 0;
}

static inline bool interrupted(void *user, int64_t tick) {
    const scene *s = user;
    return s->m.stops_at >= 0 && tick >= s->m.stops_at;
}

static inline void add_modules(bst_ctx *ctx, bst_engine *engine, scene *s,
                               const bst_module_desc *descs, module *modules, fake **pointers,
                               bst_fleet_member *members) {
    static const char *const scopes[] = {"o0/s", "o1/s", "o2/s", "o3/s", "o4/s"};
    static const char *const roles[] = {"clock",  "plant",     "camera",
                                        "seeing", "following", "control"};
    uint64_t r = mix(s->m.seed, 4);
    for (int n = 0; n < s->m.sensors * ROLES + s->m.links; n++) {
        int sensor = n / ROLES, role = sensor < s->m.sensors ? n % ROLES : ROLES;
        const bst_module_desc *desc = &descs[role];
        bool link = role == ROLES;
        modules[n] = (module){.base = {.on_step = step_any, .other = (void *)(uintptr_t)desc},
                              .s = s,
                              .number = n,
                              .sensor = sensor,
                              .members = link ? s->m.sensors : 0,
                              .state = (uint64_t)n};
        pointers[n] = &modules[n].base;
        modules[n].base.on_create = link ? declare_rate : NULL;
        char name[64];
        snprintf(name, sizeof name, "%s/%s",
                 link ? (s->m.link_first ? "a" : "tasking") : scopes[sensor],
                 link ? "x" : roles[role]);
        bst_instance_spec spec = FAKE_SPEC(*desc, name, pointers[n], 0);
        spec.scope = link ? "" : scopes[sensor];
        static const int longest[] = {30, 4, 0, 0, 0, 25, 35};
        spec.period_ticks =
            longest[role] ? 1 + below(&r, longest[role]) + (role == CLOCK ? 10 : 0) : 0;
        spec.offset_ticks = below(&r, 5);
        spec.period_ticks = link && s->m.link_period ? s->m.link_period : spec.period_ticks;
        if (role == CAMERA || role == SEEING || role == FOLLOWING || role == ROLES) {
            int64_t delay = below(&r, 3) ? below(&r, 30) : 0;
            spec.delays[0] = (bst_input_delay){0, role == FOLLOWING && !s->m.closed ? 0 : delay};
            spec.delay_count = 1;
        }
        if (role == CONTROL) {
            spec.delays[0] = (bst_input_delay){2, 1 + below(&r, 10)};
            spec.delays[1] = (bst_input_delay){4, 1 + below(&r, 10)};
            spec.delay_count = 1 + s->m.closed;
        }
        spec.planes = role == CAMERA && s->m.lends;
        if (!link && role == CLOCK) {
            members[sensor] = (bst_fleet_member){.scope = scopes[sensor], .observer = sensor};
        }
        spec.members = link ? members : NULL;
        spec.member_count = link ? s->m.sensors : 0;
        fake_add(ctx, engine, spec);
    }
}

typedef struct result {
    bst_status status;
    char message[200];
    int64_t reported, stale, overflow, steps;
} result;

enum { END = 800 };

/* Where a run is saved, and the state that it is restored from. */
typedef struct saving {
    int64_t tick;         /* saved at this tick, or restored there */
    bst_archive *archive; /* NULL: neither */
} saving;

static inline bst_status run_to_end(bst_ctx *ctx, bst_engine *engine) {
    bst_status status = bst_engine_run(ctx, engine, 333);
    for (int64_t until = 334; status == BST_OK && until <= END; until += 233) {
        status = bst_engine_run(ctx, engine, until);
    }
    return status;
}

static inline result play_part(scene *s, int threads, const saving *save, const saving *restored) {
    bst_ctx ctx = {0};
    static module modules[MOST_MODULES];
    static fake *pointers[MOST_MODULES];
    bst_fleet_member members[MOST_SENSORS];
    bst_module_desc descs[ROLES + 1];
    describe(&s->m, descs);
    bst_engine *engine = fake_engine(&ctx, 100);
    add_modules(&ctx, engine, s, descs, modules, pointers, members);
    bst_assert_ok(&ctx, bst_engine_load(&ctx, engine));
    if (restored) {
        bst_assert_ok(&ctx, bst_engine_archive(&ctx, engine, restored->archive, BST_STATE_ALL));
    }
    if (threads > 0) {
        bst_assert_ok(&ctx, bst_engine_parallel(&ctx, engine, threads));
    }
    bst_engine_set_hooks(engine, &(bst_engine_hooks){.user = s,
                                                     .message = see_message,
                                                     .event = see_event,
                                                     .interrupted = interrupted,
                                                     .wants = wants,
                                                     .ctx = &s->observers});
    result r = {.status =
                    save ? bst_engine_advance(&ctx, engine, save->tick) : run_to_end(&ctx, engine)};
    if (save && r.status == BST_OK) {
        bst_assert_ok(&ctx, bst_engine_archive(&ctx, engine, save->archive, BST_STATE_ALL));
    }
    snprintf(r.message, sizeof r.message, "%.199s", ctx.message);
    r.reported = fake_counter(engine, "reported");
    r.stale = fake_counter(engine, "stale_input");
    r.overflow = fake_counter(engine, "queue_overflow");
    for (int i = 0; i < bst_engine_instance_count(engine); i++) {
        r.steps += bst_engine_instance_steps(engine, i);
    }
    bst_engine_free(engine);
    return r;
}

static inline result play(scene *s, int threads) {
    return play_part(s, threads, NULL, NULL);
}

static inline scene *new_scene(const make *m, bool delays) {
    scene *s = test_calloc(1, sizeof *s);
    s->m = *m;
    s->delays = delays;
    return s;
}

#endif
