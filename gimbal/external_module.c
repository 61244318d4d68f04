/* Line of sight driven by an external process over the link: an attitude simulator, or a payload
 * processor that commands pointing and exposure, reports target states, and receives the frames. */
#include <assert.h>
#include <stdlib.h>
#include <string.h>

#include "gimbal/modules.h"
#include "gimbal/platform_step.h"
#include "sim/link/external.h"

enum {
    PORT_SENSOR = BST_GIMBAL_MOUNT, /* no mount, and so no mount status */
    PORT_COMMAND,
    PORT_FRAME,
    PORT_TRUTH,
    PORT_COUNT,
    MOST_FRAMES = 8, /* most frames sent per step; more are not delivered to the peer */
    MOST_ATTITUDES = 65536,
    MOST_STATES = 4096,
};

static const bst_port ports[PORT_COUNT] = {
    BST_GIMBAL_PORTS_SEEN,
    [PORT_SENSOR] = {.channel = BST_CHANNEL_SENSOR_COMMAND,
                     .direction = BST_PORT_OUT,
                     .flags = BST_PORT_OPTIONAL},
    [PORT_COMMAND] = {.channel = BST_CHANNEL_LOS_COMMAND,
                      .direction = BST_PORT_IN,
                      .flags = BST_PORT_OPTIONAL | BST_PORT_FEEDBACK},
    [PORT_FRAME] = {.channel = BST_CHANNEL_FRAME,
                    .direction = BST_PORT_IN,
                    .flags = BST_PORT_OPTIONAL | BST_PORT_FEEDBACK},
    [PORT_TRUTH] = {.channel = BST_CHANNEL_TRUTH,
                    .direction = BST_PORT_IN,
                    .flags = BST_PORT_OPTIONAL | BST_PORT_FEEDBACK},
};

enum { OUT_POINTING, OUT_STATES, OUT_ATTITUDES, OUT_SENSOR, OUTPUTS };

typedef struct config {
    double update_rate_hz, exposure_s, period_s;
    bool send_frames, send_truth;
    bst_platform_config platform;
} config;

static const bst_config_desc config_table[] = {
    BST_REAL(config, update_rate_hz, "Hz", 0.001, 10000, "10",
             "Steps of the peer per second, each with the pointing until the next; divides the "
             "plant's rate."),
    BST_BOOL(config, send_frames, "true", "Sends the frames to the peer."),
    BST_BOOL(config, send_truth, "false", "Sends the true scene of each exposure too."),
    BST_REAL(config, exposure_s, "s", 0, 1e6, "0",
             "The longest exposure that the peer will command; 0: the sensor's."),
    BST_REAL(config, period_s, "s", 0, 1e6, "0",
             "The period of frames that the peer will command; 0: the sensor's."),
    BST_OBJECT(config, platform, bst_platform_config_table, "{}",
               "The spacecraft: drift and jitter on top of the peer's pointing, telemetry."),
    BST_CONFIG_END};

typedef struct module {
    bst_gimbal_base base;
    bst_platform platform;
    const bst_world *world;
    bst_link *link;
    int part;
    int64_t steps, update_steps;
    int64_t command_seen;
    bool commands_sensor, told_of_gap;
    bst_link_output outputs[OUTPUTS];
    /* pointing samples: the last one before the latest message, then the message's */
    bst_los_sample *samples;
    int count, at;
} module;

static void destroy(void *self) {
    module *m = self;
    if (m) {
        for (int i = 0; i < OUTPUTS; i++) {
            free(m->outputs[i].payload);
        }
        free(m->samples);
    }
    bst_gimbal_destroy(m);
}

static bst_status make_outputs(bst_ctx *ctx, module *m) {
    static const bst_link_type types[OUTPUTS] = {BST_LINK_POINTING, BST_LINK_TARGET_STATES,
                                                 BST_LINK_TARGET_ATTITUDES,
                                                 BST_LINK_SENSOR_COMMAND};
    static const int room[OUTPUTS] = {MOST_ATTITUDES, MOST_STATES, MOST_STATES, 0};
    m->samples = calloc(MOST_ATTITUDES + 1, sizeof *m->samples);
    bool made = m->samples;
    for (int i = 0; i < OUTPUTS; i++) {
        const bst_wire_message *about = bst_wire_message_of(types[i]);
        m->outputs[i] = (bst_link_output){
            .type = types[i],
            .capacity = room[i],
            .payload = calloc(1, about->header_bytes + (size_t)room[i] * about->item_bytes)};
        made = made && m->outputs[i].payload;
    }
    return made ? BST_OK : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for an external gimbal");
}

static bst_status prepare_external(const bst_module_env *env, const void *config_in, void *self) {
    assert(env && env->world && env->link && config_in && self);
    const config *c = config_in;
    module *m = self;
    m->world = env->world;
    m->link = env->link;
    m->command_seen = -1;
    m->commands_sensor = bst_env_writes(env, PORT_SENSOR);
    if (!c->send_frames) {
        bst_env_ignore(env, PORT_FRAME);
    }
    if (!c->send_truth) {
        bst_env_ignore(env, PORT_TRUTH);
    }
    if (c->platform.spacecraft.type != BST_CRAFT_INERTIAL) {
        return bst_fail(env->ctx, BST_ERR_CONFIG,
                        "platform/spacecraft/type: the peer says where the camera points, whatever "
                        "the body does; leave it \"inertial\"");
    }
    BST_TRY(make_outputs(env->ctx, m));
    BST_TRY(bst_platform_divider(env->ctx, "update_rate_hz", 1.0 / m->base.dt_s, c->update_rate_hz,
                                 &m->update_steps));
    BST_TRY(bst_gimbal_platform_init(env, &c->platform, &m->base, &m->platform));
    BST_TRY(bst_gimbal_base_init(env, &c->platform, env->exposure_s, 0, &m->base));
    bst_link_part part = bst_external_describe(env, "gimbal");
    part.period_ticks = env->period_ticks * m->update_steps;
    return bst_link_add(env->ctx, m->link, &part, &m->part);
}

static bst_status create_external(const bst_module_env *env, const void *config_in, void **self) {
    return bst_gimbal_create(env, sizeof(module), prepare_external, destroy, config_in, self);
}

/* Camera attitude at a tick: slerp between two samples, constant before the first and after the
 * last. */
static bst_quat attitude_at(module *m, int64_t tick) {
    if (m->count == 0) {
        return m->platform.q_nominal_from_gcrf;
    }
    while (m->at + 1 < m->count && m->samples[m->at + 1].tick <= tick) {
        m->at++;
    }
    const bst_los_sample *a = &m->samples[m->at];
    if (tick <= a->tick || m->at + 1 == m->count) {
        return a->q_cam_from_gcrf;
    }
    return bst_quat_slerp(a->q_cam_from_gcrf, a[1].q_cam_from_gcrf,
                          (double)(tick - a->tick) / (double)(a[1].tick - a->tick));
}

/* Takes a pointing message; it continues from the current line of sight. */
static void apply_pointing(module *m, struct bst_step *s, const bst_link_pointing *pointing) {
    int64_t tick = bst_step_tick(s);
    bst_los_sample now = {tick, attitude_at(m, tick)};
    bool began = m->count > 0;
    m->count = m->at = 0;
    if (began) {
        m->samples[m->count++] = now;
    }
    for (int i = 0; i < pointing->count; i++) {
        const bst_los_sample *sample = &pointing->items[i];
        if (i > 0 && sample->tick <= pointing->items[i - 1].tick) {
            bst_step_count(s, "pointing_disorder");
            continue;
        }
        if (sample->tick <= tick) { /* the newest of these samples is the current attitude */
            m->count = 0;
            now = *sample;
            now.tick = tick;
            m->samples[m->count++] = now;
        } else if (m->count <= MOST_ATTITUDES) {
            assert(m->count < MOST_ATTITUDES + 1);
            m->samples[m->count++] = *sample;
        }
    }
}

/* Passes the target states of a message to the world. */
static void take_states(module *m, struct bst_step *s, const bst_link_target_states *states) {
    for (int i = 0; i < states->count; i++) {
        const bst_link_target_state *item = &states->items[i];
        bst_world_state state = {item->position_gcrf_m, item->velocity_gcrf_mps};
        bst_ctx why = {0};
        bool past = item->tick < bst_step_tick(s);
        if (past || bst_world_steer(&why, m->world, item->object,
                                    (double)item->tick / m->base.tick_rate_hz, &state) != BST_OK) {
            bst_step_count(s, "target_state_refused");
            bst_step_event(s, "link", "target_states, item %d: %s", i,
                           past ? "its tick is before the step's" : why.message);
        }
    }
}

/* Passes the target attitudes of a message to the world. */
static void take_attitudes(module *m, struct bst_step *s,
                           const bst_link_target_attitudes *attitudes) {
    for (int i = 0; i < attitudes->count; i++) {
        const bst_link_target_attitude *item = &attitudes->items[i];
        bst_ctx why = {0};
        bool past = item->tick < bst_step_tick(s);
        if (past ||
            bst_world_turn(&why, m->world, item->object, (double)item->tick / m->base.tick_rate_hz,
                           item->q_body_from_gcrf, item->rate_body_radps) != BST_OK) {
            bst_step_count(s, "target_state_refused");
            bst_step_event(s, "link", "target_attitudes, item %d: %s", i,
                           past ? "its tick is before the step's" : why.message);
        }
    }
}

/* Publishes the sensor command and other parts of the peer's answer. */
static void publish_answer(module *m, struct bst_step *s) {
    if (m->outputs[OUT_POINTING].given) {
        apply_pointing(m, s, m->outputs[OUT_POINTING].payload);
    }
    if (m->outputs[OUT_STATES].given) {
        take_states(m, s, m->outputs[OUT_STATES].payload);
    }
    if (m->outputs[OUT_ATTITUDES].given) {
        take_attitudes(m, s, m->outputs[OUT_ATTITUDES].payload);
    }
    if (m->outputs[OUT_SENSOR].given && m->commands_sensor) {
        memcpy(bst_step_write(s, PORT_SENSOR, NULL), m->outputs[OUT_SENSOR].payload,
               sizeof(bst_sensor_command));
    } else if (m->outputs[OUT_SENSOR].given) {
        bst_step_count(s, "sensor_command_ignored"); /* a control module commands the sensor */
    }
}

/* Publishes answers to earlier steps that have arrived meanwhile. */
static bst_status publish_more(module *m, struct bst_step *s) {
    for (;;) {
        bool more;
        BST_TRY(bst_link_more(bst_step_ctx(s), m->link, m->part, bst_step_tick(s), m->outputs,
                              OUTPUTS, &more));
        if (!more) {
            return BST_OK;
        }
        publish_answer(m, s);
    }
}

/* Exchanges one step with the peer, with the frames since the last one. */
static bst_status exchange(module *m, struct bst_step *s) {
    bst_ctx *ctx = bst_step_ctx(s);
    int64_t tick = bst_step_tick(s);
    bool ready, answered;
    bst_status status = bst_link_ready(ctx, m->link, m->part, tick, m->outputs, OUTPUTS, &ready);
    bst_external_tell(m->link, s);
    BST_TRY(status);
    BST_TRY(publish_more(m, s));
    if (!ready) {
        return BST_OK;
    }
    bst_link_input inputs[2 * MOST_FRAMES + 1];
    bst_link_frame frames[MOST_FRAMES];
    bst_frame *mapped[MOST_FRAMES];
    int count = 0, frame_count = 0;
    bst_sample command = bst_step_latest(s, PORT_COMMAND);
    if (command.payload && command.sequence != m->command_seen) {
        m->command_seen = command.sequence;
        inputs[count++] = (bst_link_input){
            .type = BST_LINK_LOS_COMMAND, .payload = command.payload, .tick = command.written_tick};
    }
    for (bst_sample next = bst_step_next(s, PORT_TRUTH); next.payload && count <= MOST_FRAMES;
         next = bst_step_next(s, PORT_TRUTH)) {
        inputs[count++] = (bst_link_input){
            .type = BST_LINK_TRUTH, .payload = next.payload, .tick = next.written_tick};
    }
    for (bst_sample next = bst_step_next(s, PORT_FRAME); next.payload && status == BST_OK;
         next = bst_step_next(s, PORT_FRAME)) {
        const bst_frame_message *message = next.payload;
        if (frame_count == MOST_FRAMES) {
            bst_step_count(s, "frames_not_sent");
            continue;
        }
        status = bst_external_frame(ctx, message, next.written_tick, &frames[frame_count],
                                    &inputs[count]);
        if (status == BST_OK) {
            mapped[frame_count++] = message->frame;
            count++;
        }
    }
    if (status == BST_OK) {
        const bst_link_messages messages = {inputs, count, m->outputs, OUTPUTS};
        status = bst_link_exchange(ctx, m->link, m->part, tick, &messages, &answered);
    }
    for (int i = 0; i < frame_count; i++) {
        bst_frame_unmap(mapped[i]);
    }
    bst_external_tell(m->link, s);
    BST_TRY(status);
    publish_answer(m, s);
    return publish_more(m, s);
}

static bst_status step(void *self, struct bst_step *s) {
    module *m = self;
    int64_t n = m->steps++;
    if (n % m->update_steps == 0) {
        BST_TRY(exchange(m, s));
    }
    int64_t tick = bst_step_tick(s);
    bst_quat q_cam_from_body =
        bst_quat_mul(attitude_at(m, tick), bst_quat_conj(m->platform.q_nominal_from_gcrf));
    bool gap = m->count == 0 || tick > m->samples[m->count - 1].tick;
    if (gap && !m->told_of_gap) {
        bst_step_count(s, "pointing_held");
        bst_step_event(s, "link", "no pointing for this tick: the line of sight stays");
    }
    m->told_of_gap = gap;
    bst_gimbal_publish_sight(
        s, &m->platform,
        bst_platform_true_camera(&m->platform, n, bst_step_seconds(s), q_cam_from_body));
    return bst_gimbal_publish_exact(s, &m->platform, &m->base, n, q_cam_from_body);
}

static bst_status archive_module(void *self, bst_archive *archive) {
    module *m = self;
    BST_TRY(bst_link_archive(m->link, m->part, archive));
    BST_ARCHIVE(archive, m->steps);
    BST_ARCHIVE(archive, m->command_seen);
    bst_archive_bool(archive, &m->told_of_gap);
    m->count = bst_archive_count(archive, m->count, MOST_ATTITUDES + 1);
    m->at = bst_archive_count(archive, m->at, m->count > 0 ? m->count - 1 : 0);
    bst_archive_bytes(archive, m->samples, (size_t)m->count * sizeof *m->samples);
    bst_platform_archive(&m->platform, archive);
    return BST_OK;
}

const bst_module_desc bst_gimbal_external_module = {
    .abi = BST_MODULE_ABI,
    .role = "gimbal",
    .type = "external",
    .doc =
        "Pointing by another program over the link, which may steer objects and set the sensor "
        "too, and gets the frames.",
    .flags = BST_MODULE_READS_TRUTH | BST_MODULE_NEEDS_LINK,
    .config = config_table,
    .config_bytes = sizeof(config),
    .default_rate_hz = 1000.0,
    .ports = ports,
    .port_count = PORT_COUNT,
    .create = create_external,
    .step = step,
    .destroy = destroy,
    .archive = archive_module,
};
