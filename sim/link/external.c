#include "sim/link/external.h"

#include <assert.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/link/link.h"
#include "sim/onboard/knowledge.h"

enum {
    MOST_PORTS = 8,
    MOST_QUEUED = 8, /* queued messages per step; more are sent in the next exchange */
    MOST_INPUTS = MOST_PORTS + MOST_QUEUED,
    MOST_COUNTED = 100000,
};

bst_link_type bst_external_type(const char *channel) {
    return bst_wire_type_of(channel); /* messages have the names of their channels */
}

typedef struct external_config {
    int64_t max_items;
    bool send_truth;
    double exposure_s, period_s;
} external_config;

#define MAX_ITEMS(fallback, doc) BST_INT(external_config, max_items, "", 1, 16384, fallback, doc)

static const bst_config_desc imgproc_table[] = {
    MAX_ITEMS("2048", "Detections of a frame that there is room for; more are counted."),
    BST_BOOL(external_config, send_truth, "false",
             "Sends the true scene of each frame too, to train or judge a detector."),
    BST_CONFIG_END};

static const bst_config_desc tracker_table[] = {
    MAX_ITEMS("256", "Tracks and predictions that there is room for; more are counted."),
    BST_CONFIG_END};

static const bst_config_desc control_table[] = {
    BST_REAL(external_config, exposure_s, "s", 0, 1e6, "0",
             "The longest exposure that the peer will command; 0: the sensor's."),
    BST_REAL(external_config, period_s, "s", 0, 1e6, "0",
             "The period of frames that the peer will command; 0: the sensor's."),
    BST_CONFIG_END};

static const bst_port imgproc_ports[] = {
    {BST_CHANNEL_FRAME, BST_PORT_IN, BST_PORT_TRIGGER, 0.0, 0},
    {BST_CHANNEL_TRUTH, BST_PORT_IN, BST_PORT_OPTIONAL, 0.0, 0},
    {BST_CHANNEL_PREDICTIONS, BST_PORT_IN, BST_PORT_OPTIONAL | BST_PORT_FEEDBACK, 0.0, 0},
    {BST_CHANNEL_POINTING_TELEMETRY, BST_PORT_IN, 0, 0.0, 0},
    {BST_CHANNEL_NAV_TELEMETRY, BST_PORT_IN, 0, 0.0, 0},
    {BST_CHANNEL_DETECTIONS, BST_PORT_OUT, 0, 0.0, 2048},
};
enum { PORT_TRUTH = 1 };

static const bst_port tracker_ports[] = {
    {BST_CHANNEL_DETECTIONS, BST_PORT_IN, BST_PORT_TRIGGER, 0.0, 0},
    {BST_CHANNEL_POINTING_TELEMETRY, BST_PORT_IN, BST_PORT_OPTIONAL, 0.0, 0},
    {BST_CHANNEL_NAV_TELEMETRY, BST_PORT_IN, 0, 0.0, 0},
    {BST_CHANNEL_TRACKS, BST_PORT_OUT, 0, 0.0, 256},
    {BST_CHANNEL_PREDICTIONS, BST_PORT_OUT, 0, 0.0, 256},
    {BST_CHANNEL_TRACK_IDENTITIES, BST_PORT_OUT, 0, 0.0, 256},
    {BST_CHANNEL_TRACKS_SMOOTHED, BST_PORT_OUT, 0, 0.0, 256},
};

static const bst_port control_ports[] = {
    {BST_CHANNEL_TRACKS, BST_PORT_IN, BST_PORT_TRIGGER | BST_PORT_OPTIONAL, 0.0, 0},
    {BST_CHANNEL_POINTING_TELEMETRY, BST_PORT_IN, 0, 0.0, 0},
    {BST_CHANNEL_NAV_TELEMETRY, BST_PORT_IN, 0, 0.0, 0},
    {BST_CHANNEL_MOUNT_STATUS, BST_PORT_IN, BST_PORT_OPTIONAL, 0.0, 0},
    {BST_CHANNEL_LOS_COMMAND, BST_PORT_OUT, 0, 0.0, 0},
    {BST_CHANNEL_SENSOR_COMMAND, BST_PORT_OUT, 0, 0.0, 0},
    {BST_CHANNEL_CONTROL_STATUS, BST_PORT_OUT, 0, 0.0, 0},
};

typedef struct external {
    const bst_module_desc *desc;
    bst_link *link;
    int part;
    int64_t seen[MOST_PORTS];              /* sequence of the last message sent, per input */
    int64_t samples;                       /* number of telemetry samples sent so far */
    bst_link_pointing_telemetry *pointing; /* buffer for new telemetry samples */
    int pointing_room;
    bst_link_output outputs[MOST_PORTS]; /* by output port */
    int output_ports[MOST_PORTS], output_count;
} external;

static void destroy(void *self) {
    external *m = self;
    if (m) {
        for (int i = 0; i < m->output_count; i++) {
            free(m->outputs[i].payload);
        }
        free(m->pointing);
        free(m);
    }
}

bst_link_part bst_external_describe(const bst_module_env *env, const char *role) {
    const bst_camera *c = bst_knowledge_camera(env->knowledge);
    bst_link_part part = {.width_px = (int32_t)c->width_px,
                          .height_px = (int32_t)c->height_px,
                          .bits = (int32_t)c->bits,
                          .pixel_scale_rad = bst_camera_scale_rad(c),
                          .boresight_px = {bst_camera_centre_x(c), bst_camera_centre_y(c)},
                          .psf_fwhm_px = c->psf_fwhm_px,
                          .gain_e_per_dn = c->gain_e_per_dn,
                          .offset_dn = c->offset_dn,
                          .read_noise_e = bst_camera_read_noise_e(c),
                          .dark_e_per_s = c->dark_current_e_per_s,
                          .full_well_e = bst_camera_full_e(c),
                          .flux_v0_e_per_s = bst_camera_electrons_per_s(c, 0.0),
                          .exposure_s = env->frame_exposure_s,
                          .period_s = env->frame_period_s,
                          .period_ticks = env->period_ticks};
    snprintf(part.instance, sizeof part.instance, "%s", env->instance);
    snprintf(part.role, sizeof part.role, "%s", role);
    return part;
}

/* Creates an external module: output buffers and its part of the link. */
static bst_status create(const bst_module_env *env, const bst_module_desc *desc,
                         const external_config *config, void **self) {
    external *m = calloc(1, sizeof *m);
    *self = NULL;
    if (!m) {
        return bst_fail(env->ctx, BST_ERR_MEMORY, "out of memory for an external %s", desc->role);
    }
    m->desc = desc;
    m->link = env->link;
    for (int p = 0; p < desc->port_count; p++) {
        const bst_port *port = &desc->ports[p];
        m->seen[p] = -1;
        if (port->direction != BST_PORT_OUT) {
            continue;
        }
        const bst_channel_type *type = bst_channel_type_find(port->channel);
        int items = type->item_bytes ? (int)config->max_items : 0;
        bst_env_set_capacity(env, p, items);
        assert(m->output_count < (int)(sizeof m->outputs / sizeof m->outputs[0]));
        m->output_ports[m->output_count] = p;
        m->outputs[m->output_count++] = (bst_link_output){
            .type = bst_external_type(port->channel),
            .payload = calloc(1, type->header_bytes + (size_t)items * type->item_bytes),
            .capacity = items};
        if (!m->outputs[m->output_count - 1].payload) {
            destroy(m);
            return bst_fail(env->ctx, BST_ERR_MEMORY, "out of memory for %d items", items);
        }
    }
    bst_link_part part = bst_external_describe(env, desc->role);
    bst_status status = bst_link_add(env->ctx, m->link, &part, &m->part);
    if (status != BST_OK) {
        destroy(m);
        return status;
    }
    *self = m;
    return BST_OK;
}

static bst_status create_imgproc(const bst_module_env *env, const void *config, void **self) {
    const external_config *c = config;
    if (!c->send_truth) {
        bst_env_ignore(env, PORT_TRUTH);
    }
    return create(env, &bst_external_imgproc_module, c, self);
}

static bst_status create_tracker(const bst_module_env *env, const void *config, void **self) {
    return create(env, &bst_external_tracker_module, config, self);
}

static bst_status create_control(const bst_module_env *env, const void *config, void **self) {
    return create(env, &bst_external_control_module, config, self);
}

/* Copies the telemetry samples that have not been sent yet. */
static bst_status new_samples(external *m, bst_ctx *ctx, const bst_pointing_telemetry *t) {
    if (m->pointing_room < t->capacity) {
        void *room = realloc(
            m->pointing, sizeof *m->pointing + (size_t)t->capacity * sizeof(bst_pointing_sample));
        if (!room) {
            return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %d samples", t->capacity);
        }
        m->pointing = room;
        m->pointing_room = t->capacity;
    }
    int64_t oldest = t->written - t->capacity;
    int64_t first = m->samples > oldest ? m->samples : oldest;
    first = first > 0 ? first : 0;
    *m->pointing = (bst_link_pointing_telemetry){.first = first,
                                                 .capacity = t->capacity,
                                                 .count = (int32_t)(t->written - first),
                                                 .q_body_from_gcrf = t->q_body_from_gcrf,
                                                 .settled = t->settled,
                                                 .limited = t->limited};
    for (int64_t i = first; i < t->written; i++) {
        m->pointing->items[i - first] = t->items[i % t->capacity];
    }
    m->samples = t->written;
    return BST_OK;
}

/* Retains a frame's pixels while ZeroMQ sends them. */
static void hold_frame(void *owner) {
    const uint16_t *pixels;
    bst_frame_retain(owner);
    (void)!bst_frame_map(owner, NULL, &pixels); /* maps are counted: this one is nested */
}

/* Releases a frame after ZeroMQ has sent its pixels. */
static void release_frame(void *owner) {
    bst_frame_unmap(owner);
    bst_frame_release(owner);
}

bst_status bst_external_frame(bst_ctx *ctx, const bst_frame_message *f, int64_t tick,
                              bst_link_frame *payload, bst_link_input *input) {
    *payload = (bst_link_frame){.exposure_id = f->exposure_id,
                                .start_tick = f->start_tick,
                                .end_tick = f->end_tick,
                                .window = f->window,
                                .binning = f->binning,
                                .bits = f->bits,
                                .width = f->frame->width,
                                .height = f->frame->height};
    *input = (bst_link_input){
        .type = BST_LINK_FRAME,
        .payload = payload,
        .tick = tick,
        .pixel_bytes = sizeof(uint16_t) * (size_t)f->frame->width * (size_t)f->frame->height,
        .hold = hold_frame,
        .release = release_frame,
        .owner = f->frame};
    return bst_frame_map(f->frame, ctx, &input->pixels);
}

void bst_external_tell(bst_link *link, struct bst_step *step) {
    const char *name;
    for (int i = 0;; i++) {
        int64_t grown = bst_link_news(link, i, &name);
        if (grown < 0) {
            break;
        }
        for (int64_t k = 0; k < grown && k < MOST_COUNTED; k++) {
            bst_step_count(step, name);
        }
    }
    for (const char *note = bst_link_note(link); note; note = bst_link_note(link)) {
        bst_step_event(step, "link", "%s", note);
    }
}

/* Publishes a peer's answer on the channels. */
static void publish_answer(external *m, struct bst_step *step) {
    for (int i = 0; i < m->output_count; i++) {
        const bst_link_output *output = &m->outputs[i];
        if (!output->given) {
            continue;
        }
        const bst_wire_message *about = bst_wire_message_of(output->type);
        int items = bst_wire_items(about, output->payload);
        void *to = bst_step_write(step, m->output_ports[i], NULL);
        memcpy(to, output->payload, about->header_bytes + (size_t)items * about->item_bytes);
    }
}

/* Publishes late answers of the peer, one by one. */
static bst_status publish_more(external *m, struct bst_step *step) {
    for (;;) {
        bool more;
        BST_TRY(bst_link_more(bst_step_ctx(step), m->link, m->part, bst_step_tick(step), m->outputs,
                              m->output_count, &more));
        if (!more) {
            return BST_OK;
        }
        publish_answer(m, step);
    }
}

/* Publishes answers to earlier steps, and checks whether the peer can take this step. */
static bst_status ready(external *m, struct bst_step *step, bool *is_ready) {
    bst_status status = bst_link_ready(bst_step_ctx(step), m->link, m->part, bst_step_tick(step),
                                       m->outputs, m->output_count, is_ready);
    bst_external_tell(m->link, step);
    BST_TRY(status);
    return publish_more(m, step);
}

/* Exchanges one step with the peer and publishes its answer. */
static bst_status exchange(external *m, struct bst_step *step, const bst_link_input *inputs,
                           int count) {
    bool answered;
    const bst_link_messages messages = {inputs, count, m->outputs, m->output_count};
    bst_status status = bst_link_exchange(bst_step_ctx(step), m->link, m->part, bst_step_tick(step),
                                          &messages, &answered);
    bst_external_tell(m->link, step);
    BST_TRY(status);
    publish_answer(m, step);
    return publish_more(m, step);
}

/* True if the port's channel is a queue. */
static bool is_queue(const bst_port *port) {
    return bst_channel_type_find(port->channel)->kind == BST_CHANNEL_QUEUE;
}

/* Adds the newest messages of inputs that are not queues, unless they were already sent. */
static bst_status add_latest(external *m, struct bst_step *step, bst_link_input *inputs,
                             int *count) {
    for (int p = 0; p < m->desc->port_count; p++) {
        const bst_port *port = &m->desc->ports[p];
        if (port->direction != BST_PORT_IN || is_queue(port)) {
            continue;
        }
        bst_sample sample = bst_step_latest(step, p);
        if (!sample.payload || sample.sequence == m->seen[p]) {
            continue;
        }
        m->seen[p] = sample.sequence;
        bst_link_input *input = &inputs[(*count)++];
        *input = (bst_link_input){.type = bst_external_type(port->channel),
                                  .payload = sample.payload,
                                  .tick = sample.written_tick};
        if (input->type == BST_LINK_POINTING_TELEMETRY) {
            BST_TRY(new_samples(m, bst_step_ctx(step), sample.payload));
            input->payload = m->pointing;
        }
    }
    return BST_OK;
}

/* Steps imgproc or tracker externally: one exchange per frame or set of detections. */
static bst_status step_by_queue(void *self, struct bst_step *step) {
    external *m = self;
    for (bst_sample next = bst_step_next(step, 0); next.payload; next = bst_step_next(step, 0)) {
        bst_link_input inputs[MOST_INPUTS];
        int count = 0;
        bool is_ready;
        BST_TRY(ready(m, step, &is_ready));
        if (!is_ready) {
            continue; /* the frame is lost to the peer */
        }
        BST_TRY(add_latest(m, step, inputs, &count));
        if (m->desc->ports[0].channel[0] == 'd') { /* the channel "detections" */
            inputs[count++] = (bst_link_input){
                .type = BST_LINK_DETECTIONS, .payload = next.payload, .tick = next.written_tick};
            BST_TRY(exchange(m, step, inputs, count));
            continue;
        }
        const bst_frame_message *message = next.payload;
        bst_link_frame frame;
        for (bst_sample truth = bst_step_next(step, PORT_TRUTH); truth.payload;
             truth = bst_step_next(step, PORT_TRUTH)) {
            const bst_truth *t = truth.payload;
            if (t->exposure_id == message->exposure_id) {
                inputs[count++] = (bst_link_input){
                    .type = BST_LINK_TRUTH, .payload = t, .tick = truth.written_tick};
                break;
            }
        }
        BST_TRY(bst_external_frame(bst_step_ctx(step), message, next.written_tick, &frame,
                                   &inputs[count++]));
        bst_status status = exchange(m, step, inputs, count);
        bst_frame_unmap(message->frame);
        BST_TRY(status);
    }
    return BST_OK;
}

/* Steps control externally: one exchange per step, with the tracks since the last one. */
static bst_status step_control(void *self, struct bst_step *step) {
    external *m = self;
    bst_link_input inputs[MOST_INPUTS];
    int count = 0;
    bool is_ready;
    BST_TRY(ready(m, step, &is_ready));
    if (!is_ready) {
        return BST_OK; /* tracks are sent in the next step */
    }
    BST_TRY(add_latest(m, step, inputs, &count));
    for (int i = 0; i < MOST_QUEUED; i++) {
        bst_sample next = bst_step_next(step, 0);
        if (!next.payload) {
            break;
        }
        inputs[count++] = (bst_link_input){
            .type = BST_LINK_TRACKS, .payload = next.payload, .tick = next.written_tick};
    }
    return exchange(m, step, inputs, count);
}

/* Archives what was sent to the program that plays the module; a peer has the rest of the state. */
static bst_status archive_external(void *self, bst_archive *archive) {
    external *m = self;
    BST_TRY(bst_link_archive(m->link, m->part, archive));
    BST_ARCHIVE(archive, m->seen);
    BST_ARCHIVE(archive, m->samples);
    return BST_OK;
}

#define EXTERNAL(role_, table_, ports_, rate_, create_, step_)                                   \
    {                                                                                            \
        .abi = BST_MODULE_ABI, .role = role_, .type = "external",                                \
        .doc = "Played by another program over the link.", .flags = BST_MODULE_NEEDS_LINK,       \
        .config = table_, .config_bytes = sizeof(external_config), .default_rate_hz = rate_,     \
        .ports = ports_, .port_count = (int)(sizeof ports_ / sizeof *ports_), .create = create_, \
        .step = step_, .destroy = destroy, .archive = archive_external,                          \
    }

const bst_module_desc bst_external_imgproc_module =
    EXTERNAL("imgproc", imgproc_table, imgproc_ports, 0.0, create_imgproc, step_by_queue);
const bst_module_desc bst_external_tracker_module =
    EXTERNAL("tracker", tracker_table, tracker_ports, 0.0, create_tracker, step_by_queue);
const bst_module_desc bst_external_control_module =
    EXTERNAL("control", control_table, control_ports, 20.0, create_control, step_control);

bool bst_external_role(const char *role) {
    return strcmp(role, "gimbal") == 0 || bst_external_serves(role);
}

bool bst_external_serves(const char *role) {
    return strcmp(role, "imgproc") == 0 || strcmp(role, "tracker") == 0 ||
           strcmp(role, "control") == 0;
}
