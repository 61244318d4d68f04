#include "sim/run/link_host.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/memory.h"
#include "sim/link/external.h"

enum { MOST_PORTS = 12, MOST_PENDING = 24, MOST_FRAMES = 4, RING = 16384, MOST_ITEMS = 65536 };

/* A frame received over the link. */
typedef struct host_frame {
    bst_frame frame;
    uint16_t *pixels;
    size_t room;
    bool busy;
} host_frame;

/* A message that is published in the next step. */
typedef struct pending {
    bst_link_type type;
    void *payload;
    size_t room;
    host_frame *frame;
} pending;

struct bst_link_host {
    const bst_scenario *scenario;
    const bst_scenario_module_config *module;
    char instance[256], source_name[256];
    bst_simulation *sim;
    bst_module_desc source;
    bst_port ports[MOST_PORTS];
    bst_link_type types[MOST_PORTS]; /* of the source's output ports */
    pending pending[MOST_PENDING];
    int pending_count;
    host_frame frames[MOST_FRAMES];
    /* outputs of the module in the latest step; repeated on request */
    bst_link_output outputs[MOST_PORTS];
    size_t output_room[MOST_PORTS];
    int output_count;
    int64_t step; /* latest step, -1: none */
    const char *keys_file;
};

/* Frame operation: the pixels of a received frame. */
static bst_status map_frame(void *owner, bst_ctx *ctx, const uint16_t **pixels) {
    (void)ctx;
    *pixels = ((host_frame *)owner)->pixels;
    return BST_OK;
}
static void unmap_frame(void *owner) {
    (void)owner;
}
/* Frame operation: marks a received frame's buffer as free. */
static void recycle_frame(void *owner) {
    ((host_frame *)owner)->busy = false;
}
static const bst_frame_ops frame_ops = {
    .map = map_frame, .unmap = unmap_frame, .recycle = recycle_frame};

/* ---- the module that writes what has come ---- */

/* Module interface: the source module uses the link host itself as its state. */
static bst_status source_create(const bst_module_env *env, const void *config, void **self) {
    (void)env;
    *self = *(void *const *)config;
    return BST_OK;
}
static void source_destroy(void *self) {
    (void)self;
}

/* Writes received pointing samples into the ring of the telemetry channel. */
static void write_ring(bst_pointing_telemetry *ring, const bst_link_pointing_telemetry *t) {
    ring->capacity = RING;
    ring->q_body_from_gcrf = t->q_body_from_gcrf;
    ring->settled = t->settled;
    ring->limited = t->limited;
    for (int i = 0; i < t->count; i++) {
        ring->items[(t->first + i) % RING] = t->items[i];
    }
    ring->written = t->first + t->count;
}

/* Module step: publishes the received messages on the channels of the hosted module. */
static bst_status source_step(void *self, struct bst_step *step) {
    bst_link_host *host = self;
    for (int i = 0; i < host->pending_count; i++) {
        const pending *one = &host->pending[i];
        int port = 0;
        while (port < host->source.port_count && host->types[port] != one->type) {
            port++;
        }
        if (port == host->source.port_count) {
            continue; /* not an input of this module, such as the truth */
        }
        void *out = bst_step_write(step, port, NULL);
        const bst_wire_message *about = bst_wire_message_of(one->type);
        if (one->type == BST_LINK_POINTING_TELEMETRY) {
            write_ring(out, one->payload);
        } else if (one->frame) {
            const bst_link_frame *f = one->payload;
            one->frame->frame.references = 1; /* owned by the channel */
            *(bst_frame_message *)out = (bst_frame_message){.frame = &one->frame->frame,
                                                            .exposure_id = f->exposure_id,
                                                            .start_tick = f->start_tick,
                                                            .end_tick = f->end_tick,
                                                            .window = f->window,
                                                            .binning = f->binning,
                                                            .bits = f->bits};
        } else {
            memcpy(out, one->payload,
                   about->header_bytes +
                       (size_t)bst_wire_items(about, one->payload) * about->item_bytes);
        }
    }
    host->pending_count = 0;
    return BST_OK;
}

/* ---- what the module writes ---- */

/* Observer of the engine: copies an output of the hosted module for the link. */
static bst_status on_message(void *user, const char *scope, const char *channel,
                             const void *payload, int64_t tick) {
    bst_link_host *host = user;
    (void)scope;
    (void)tick;
    bst_link_type type = bst_external_type(channel);
    for (int i = 0; i < host->output_count; i++) {
        bst_link_output *output = &host->outputs[i];
        if (output->type != type) {
            continue;
        }
        const bst_wire_message *about = bst_wire_message_of(type);
        size_t bytes =
            about->header_bytes + (size_t)bst_wire_items(about, payload) * about->item_bytes;
        if (host->output_room[i] < bytes) {
            void *more = realloc(output->payload, bytes);
            if (!more) {
                return bst_fail(NULL, BST_ERR_MEMORY, "out of memory for %s", channel);
            }
            output->payload = more;
            host->output_room[i] = bytes;
        }
        memcpy(output->payload, payload, bytes);
        output->given = true;
    }
    return BST_OK;
}

/* Lists the hosted module's outputs, and its inputs as ports of the source module. */
static void find_ports(bst_link_host *host) {
    const bst_module_desc *desc = host->module->desc;
    for (int p = 0; p < desc->port_count && p < MOST_PORTS; p++) {
        const bst_port *port = &desc->ports[p];
        bst_link_type type = bst_external_type(port->channel);
        if (port->direction == BST_PORT_OUT && type != BST_LINK_TYPES) {
            host->outputs[host->output_count++] = (bst_link_output){.type = type};
        } else if (port->direction != BST_PORT_OUT && type != BST_LINK_TYPES) {
            bool items = bst_channel_type_find(port->channel)->item_bytes > 0;
            host->types[host->source.port_count] = type;
            host->ports[host->source.port_count++] =
                (bst_port){.channel = port->channel,
                           .direction = BST_PORT_OUT,
                           .capacity = type == BST_LINK_POINTING_TELEMETRY ? RING
                                       : items                             ? MOST_ITEMS
                                                                           : 0};
        }
    }
}

/* Finds the module of the scenario that the link part names. */
static bst_status find_part(bst_ctx *ctx, bst_link_host *host, const char *part) {
    const bst_observer_config *observers = host->scenario->observers.items;
    for (int m = 0; m < host->scenario->module_count && !host->module; m++) {
        const bst_scenario_module_config *module = &host->scenario->modules[m];
        const bst_observer_config *observer = &observers[module->observer];
        const bst_sensor_config *sensors = observer->sensors.items;
        char scope[180];
        snprintf(scope, sizeof scope, "%s/%s", observer->name, sensors[module->sensor].name);
        snprintf(host->instance, sizeof host->instance, "%s/%s", scope, module->name);
        snprintf(host->source_name, sizeof host->source_name, "%s/source", scope);
        bool named = strcmp(part, module->name) == 0 || strcmp(part, host->instance) == 0;
        host->module = named && !module->off ? module : NULL;
    }
    if (!host->module || !bst_external_serves(host->module->desc->role)) {
        return bst_fail(ctx, BST_ERR_NOT_FOUND,
                        "%s: no module \"%s\" that can be played over the link (allowed: imgproc, "
                        "tracker, control, or OBSERVER/SENSOR/MODULE)",
                        host->scenario->file, part);
    }
    if (host->module->desc->flags & BST_MODULE_NEEDS_LINK) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "%s: %s is itself of type \"external\"; serve a scenario that says what it "
                        "is",
                        host->scenario->file, host->instance);
    }
    return BST_OK;
}

/* Creates a simulation of the hosted module and the source module alone. */
static bst_status make(bst_ctx *ctx, bst_link_host *host, const char *part, int threads) {
    BST_TRY(find_part(ctx, host, part));
    host->source = (bst_module_desc){.abi = BST_MODULE_ABI,
                                     .role = "source",
                                     .type = "link",
                                     .config_bytes = sizeof host,
                                     .ports = host->ports,
                                     .create = source_create,
                                     .step = source_step,
                                     .destroy = source_destroy};
    find_ports(host);
    for (int i = 0; i < MOST_FRAMES; i++) {
        host->frames[i].frame = (bst_frame){.ops = &frame_ops, .owner = &host->frames[i]};
    }
    const bst_simulation_options options = {.threads = threads,
                                            .only = host->instance,
                                            .source = &host->source,
                                            .source_config = &host};
    BST_TRY(bst_simulation_create(ctx, host->scenario, &options, &host->sim));
    const bst_engine_hooks hooks = {.user = host, .message = on_message};
    bst_engine_set_hooks(bst_simulation_engine(host->sim), &hooks);
    return BST_OK;
}

bst_status bst_link_host_create(bst_ctx *ctx, const bst_scenario *scenario, const char *part,
                                int threads, bst_link_host **out) {
    *out = NULL;
    bst_link_host *host = calloc(1, sizeof *host);
    if (!host) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a part of the link");
    }
    host->scenario = scenario;
    host->step = -1;
    bst_status status = make(ctx, host, part, threads);
    if (status != BST_OK) {
        bst_link_host_free(host);
        return status;
    }
    *out = host;
    return BST_OK;
}

void bst_link_host_free(bst_link_host *host) {
    if (!host) {
        return;
    }
    bst_simulation_free(host->sim);
    for (int i = 0; i < MOST_PENDING; i++) {
        free(host->pending[i].payload);
    }
    for (int i = 0; i < MOST_FRAMES; i++) {
        free(host->frames[i].pixels);
    }
    for (int i = 0; i < host->output_count; i++) {
        free(host->outputs[i].payload);
    }
    free(host);
}

const char *bst_link_host_instance(const bst_link_host *host) {
    return host->instance;
}

/* ---- playing ---- */

/* Stores an input for the next step. */
static bst_status keep(bst_ctx *ctx, bst_link_host *host, const bst_link_received *got) {
    const bst_wire_message *about = bst_wire_message_of(got->header.type);
    if (host->pending_count == MOST_PENDING) {
        return bst_fail(ctx, BST_ERR_FORMAT, "link: more than %d inputs in a step", MOST_PENDING);
    }
    int items = bst_wire_items(about, got->payload);
    if (items > MOST_ITEMS) {
        return bst_fail(ctx, BST_ERR_FORMAT, "link: %d items of %s (allowed: %d)", items,
                        about->name, MOST_ITEMS);
    }
    pending *one = &host->pending[host->pending_count];
    size_t bytes = about->header_bytes + (size_t)items * about->item_bytes;
    BST_TRY(bst_memory_grow(ctx, "out of memory", &one->payload, &one->room, bytes));
    memcpy(one->payload, got->payload, bytes);
    one->type = got->header.type;
    one->frame = NULL;
    if (one->type == BST_LINK_FRAME) {
        const bst_link_frame *f = got->payload;
        host_frame *frame = NULL;
        for (int i = 0; i < MOST_FRAMES && !frame; i++) {
            frame = host->frames[i].busy ? NULL : &host->frames[i];
        }
        if (!frame) {
            return bst_fail(ctx, BST_ERR_STATE, "link: %d frames are being worked on", MOST_FRAMES);
        }
        size_t size = sizeof(uint16_t) * (size_t)f->width * (size_t)f->height;
        void *pixels = frame->pixels;
        BST_TRY(bst_memory_grow(ctx, "out of memory", &pixels, &frame->room, size));
        frame->pixels = pixels;
        memcpy(frame->pixels, got->pixels, size);
        frame->frame.width = f->width;
        frame->frame.height = f->height;
        frame->busy = true;
        one->frame = frame;
    }
    host->pending_count++;
    return BST_OK;
}

/* Discards received inputs and frees their frames. */
static void forget_inputs(bst_link_host *host) {
    for (int i = 0; i < host->pending_count; i++) {
        if (host->pending[i].frame) {
            host->pending[i].frame->busy = false;
        }
    }
    host->pending_count = 0;
}

/* Steps the hosted module and sends its outputs; repeats them if the step was answered before. */
static bst_status answer(bst_ctx *ctx, bst_link_host *host, bst_link_peer *peer,
                         const bst_link_header *step) {
    if (step->step != host->step) {
        for (int i = 0; i < host->output_count; i++) {
            host->outputs[i].given = false;
        }
        bst_engine *engine = bst_simulation_engine(host->sim);
        BST_TRY(bst_engine_wake(ctx, engine, host->source_name, step->tick));
        BST_TRY(bst_engine_advance(ctx, engine, step->tick + 1));
        host->step = step->step;
    }
    forget_inputs(host);
    bst_link_done done = {.outputs = 0};
    for (int i = 0; i < host->output_count; i++) {
        if (host->outputs[i].given) {
            BST_TRY(bst_link_peer_send(ctx, peer, host->outputs[i].type, host->outputs[i].payload,
                                       step));
            done.outputs++;
        }
    }
    return bst_link_peer_send(ctx, peer, BST_LINK_DONE, &done, step);
}

/* Checks that tick rate and period of the simulation match the scenario here. */
static bst_status check_welcome(bst_ctx *ctx, const bst_link_host *host,
                                const bst_link_welcome *welcome) {
    bst_log(ctx, BST_LOG_INFO, "link: plays %s of \"%s\"", host->instance, welcome->scenario);
    if (welcome->tick_rate_hz != host->scenario->tick_rate_hz ||
        (welcome->count > 0 && welcome->parts[0].period_ticks != host->module->period_ticks)) {
        return bst_fail(
            ctx, BST_ERR_CONFIG,
            "link: the simulation steps %s every %lld ticks of %lld Hz, %s says %lld "
            "of %lld: both have to run the same scenario",
            host->instance, welcome->count > 0 ? (long long)welcome->parts[0].period_ticks : 0LL,
            (long long)welcome->tick_rate_hz, host->scenario->file,
            (long long)host->module->period_ticks, (long long)host->scenario->tick_rate_hz);
    }
    return BST_OK;
}

/* Receives the next message; calls `stop` ten times a second. */
static bst_status receive(bst_ctx *ctx, bst_link_peer *peer, double timeout_s, bool (*stop)(void),
                          bst_link_received *out) {
    const double slice_s = 0.1;
    for (double waited = 0.0;; waited += slice_s) {
        bst_status status = bst_link_peer_receive(ctx, peer, slice_s, out);
        if (stop && stop()) {
            return bst_fail(ctx, BST_ERR_INTERRUPTED, "interrupted");
        }
        if (status == BST_ERR_INTERRUPTED) {
            continue;
        }
        if (status != BST_ERR_NOT_FOUND) {
            return status;
        }
        if (waited >= timeout_s) {
            return bst_fail(ctx, BST_ERR_IO, "link: nothing has come for %.3g s", timeout_s);
        }
    }
}

/* Handles messages of the simulation until it sends `end`. */
static bst_status play(bst_ctx *ctx, bst_link_host *host, bst_link_peer *peer, double timeout_s,
                       bool (*stop)(void), int *reason) {
    bst_link_received got;
    for (;;) {
        BST_TRY(receive(ctx, peer, timeout_s, stop, &got));
        switch (got.header.type) {
            case BST_LINK_WELCOME:
                forget_inputs(host);
                BST_TRY(check_welcome(ctx, host, got.payload));
                break;
            case BST_LINK_STEP:
                BST_TRY(answer(ctx, host, peer, &got.header));
                break;
            case BST_LINK_ERROR:
                bst_log(ctx, BST_LOG_WARNING, "link: the simulation has not taken a message: %s",
                        ((const bst_link_error *)got.payload)->text);
                if (strcmp(((const bst_link_error *)got.payload)->fault, "refused") == 0) {
                    return bst_fail(ctx, BST_ERR_NOT_FOUND, "link: %s",
                                    ((const bst_link_error *)got.payload)->text);
                }
                break;
            case BST_LINK_END:
                *reason = ((const bst_link_end *)got.payload)->reason;
                bst_log(ctx, BST_LOG_INFO, "link: the run has ended: %s",
                        ((const bst_link_end *)got.payload)->text);
                return BST_OK;
            default:
                BST_TRY(keep(ctx, host, &got));
        }
    }
}

void bst_link_host_use_keys(bst_link_host *host, const char *keys_file) {
    host->keys_file = keys_file;
}

bst_status bst_link_host_play(bst_ctx *ctx, bst_link_host *host, const char *address,
                              bool shared_memory, double timeout_s, bool (*stop)(void),
                              int *reason) {
    bst_link_hello hello = {.name = "boresight serve", .shared_memory = shared_memory};
    bst_link_peer *peer = NULL;
    snprintf(hello.serves, sizeof hello.serves, "%s", host->instance);
    BST_TRY(bst_link_peer_open(ctx, address, host->keys_file, &hello, &peer));
    bst_status status = play(ctx, host, peer, timeout_s, stop, reason);
    if (status != BST_OK) {
        bst_ctx leaving = {0};
        bst_link_end end = {.reason = 3, .text = "boresight serve ends"};
        (void)!bst_link_peer_send(&leaving, peer, BST_LINK_END, &end, NULL);
        bst_fail_prefix(ctx, status, "%.200s", address);
    }
    bst_link_peer_close(peer);
    return status;
}
