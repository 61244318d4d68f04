#include "sim/engine/kernel/exposure_clock.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/engine/kernel/engine_internal.h"
#include "sim/messages/message_invariants.h"
#include "sim/world/frame_updates.h"
#include "sim/world/world.h"
#include "sim/world/world_config.h"

enum { PORT_COMMAND, PORT_EXPOSURE };

typedef struct exposure_clock {
    int64_t tick_rate_hz;
    int64_t exposure_ticks, period_ticks;
    struct {
        int64_t exposure_ticks, period_ticks, binning;
    } set;                        /* by the scenario */
    bst_window full, own, window; /* of the sensor, of the scenario, of the current exposure */
    int binning;
    struct {
        bool exposure, period, binning, window;
    } changed;          /* by the scenario since the state was saved: from the next exposure on */
    bool single_pixels; /* the detector reads a ramp: frames are not binned */
    double pixel_scale_arcsec; /* 0: the camera's scale */
    bst_frame_cursor updates;  /* exposures from a file, frame by frame; updates NULL: none */
    double dropped_fraction;
    double burst_begins,
        burst_ends; /* transition probabilities per frame; burst_ends 0: no bursts */
    bool in_burst;  /* the previous frame was lost */
    bst_rng_key drop_key;
    int64_t id;
    int64_t start_tick; /* tick of the current or next exposure */
    int64_t next_start_tick;
    bool open;
    /* Rolling shutter: the exposure opens lead_ticks before start_tick, the start of its middle
     * row. It is published when its last row is complete and its line of sight is known. */
    double row_time_s;
    int64_t lead_ticks, los_period_ticks, los_offset_ticks;
} exposure_clock;

/* Ticks between the starts of two exposures. */
static int64_t cycle_of(const exposure_clock *clock) {
    int64_t busy = clock->exposure_ticks + 2 * clock->lead_ticks;
    return busy > clock->period_ticks ? busy : clock->period_ticks;
}

/* Checks that every exposure time and period of a file is a whole number of ticks. */
static bst_status check_updates(const bst_module_env *env, const bst_frame_updates *updates) {
    for (int i = 0; i < bst_frame_updates_count(updates); i++) {
        const bst_frame_update *u = bst_frame_updates_item(updates, i);
        int64_t ticks;
        const char *key = "exposure_s";
        bst_status status = bst_seconds_to_ticks(env->ctx, env->tick_rate_hz,
                                                 u->exposure_s > 0.0 ? u->exposure_s : 0.0, &ticks);
        if (status == BST_OK) {
            key = "period_s";
            status = bst_seconds_to_ticks(env->ctx, env->tick_rate_hz, u->period_s, &ticks);
        }
        if (status != BST_OK) {
            return bst_fail_prefix(env->ctx, status, "%s: /frames/%d (frame %lld)/%s",
                                   bst_frame_updates_name(updates), i, (long long)u->frame, key);
        }
    }
    return BST_OK;
}

/* Checks that the first exposure and all periods leave time for the rows of a rolling shutter. */
static bst_status check_rows(const bst_module_env *env, const exposure_clock *clock) {
    double rate = (double)env->tick_rate_hz, lead_s = (double)clock->lead_ticks / rate;
    if (clock->start_tick < clock->lead_ticks) {
        return bst_fail(env->ctx, BST_ERR_CONFIG,
                        "first_s: with the detector's row_time_s the first row is exposed %.9g s "
                        "before the middle one, whose times are the exposure's: give %.9g or more "
                        "(found %.9g)",
                        lead_s, lead_s, (double)clock->start_tick / rate);
    }
    bst_frame_cursor c = clock->updates;
    if (!c.updates || bst_frame_updates_count(c.updates) == 0) {
        return BST_OK;
    }
    const bst_frame_update *last =
        bst_frame_updates_item(c.updates, bst_frame_updates_count(c.updates) - 1);
    for (; c.frame <= last->frame; bst_frame_cursor_next(&c)) {
        if (c.exposure_ticks + 2 * clock->lead_ticks > c.period_ticks) {
            return bst_fail(env->ctx, BST_ERR_CONFIG,
                            "%s: frame %lld: a period_s of %.9g is too short (allowed: at least "
                            "%.9g, from the start of the first row to the end of the last one with "
                            "the detector's row_time_s)",
                            bst_frame_updates_name(c.updates), (long long)c.frame, c.period_s,
                            c.exposure_s + 2.0 * lead_s);
        }
    }
    return BST_OK;
}

/* Checks that no frame is binned whose pixels are read one by one: with a ramp or 1/f noise of each
 * pixel. Pixels would be summed with the noise of each, which bst_camera_read_noise_e does not
 * contain. */
static bst_status check_single_pixels(const bst_module_env *env, const bst_exposure_config *c,
                                      const bst_frame_updates *updates) {
    const bst_camera *camera = bst_world_camera(env->world, env->observer, env->sensor);
    const char *why = camera->detector.ramp.reads > 0
                          ? "the camera's detector/ramp reads each pixel by itself (allowed: 1, "
                            "or ramp/reads 0)"
                          : "the camera's detector/pixel_flicker_noise is that of single pixels "
                            "(allowed: 1, or pixel_flicker_noise/rms_e 0)";
    if (c->binning > 1) {
        return bst_fail(env->ctx, BST_ERR_CONFIG, "binning: %lld, but %s", (long long)c->binning,
                        why);
    }
    for (int i = 0; updates && i < bst_frame_updates_count(updates); i++) {
        const bst_frame_update *u = bst_frame_updates_item(updates, i);
        if (u->binning > 1) {
            return bst_fail(
                env->ctx, BST_ERR_CONFIG, "%s: /frames/%d (frame %lld)/binning: %d, but %s",
                bst_frame_updates_name(updates), i, (long long)u->frame, u->binning, why);
        }
    }
    return BST_OK;
}

/* Gilbert's two-state channel for bursts of lost frames. A burst ends with probability 1/L per
 * frame, so that its mean length is L frames. The rate of bursts follows from the lost fraction.
 * Reference: E. N. Gilbert, "Capacity of a Burst-Noise Channel", Bell System Technical Journal 39
 * (1960), with all frames lost in the bad state and none in the good state. */
static bst_status set_losses(const bst_module_env *env, const bst_exposure_config *c,
                             exposure_clock *clock) {
    double share = c->dropped_fraction, frames = c->dropped_burst_frames;
    clock->dropped_fraction = share;
    clock->drop_key = bst_env_rng(env, "dropped_frames");
    if (frames == 0.0 || share == 0.0 || share == 1.0) {
        return BST_OK;
    }
    /* at least one frame between two bursts */
    double fewest = fmax(1.0, share / (1.0 - share));
    if (frames < fewest) {
        return bst_fail(env->ctx, BST_ERR_CONFIG,
                        "dropped_burst_frames: %.9g (allowed: 0, or %.9g and more, with a "
                        "frame between two bursts and a dropped_fraction of %.9g)",
                        frames, fewest, share);
    }
    clock->burst_ends = 1.0 / frames;
    clock->burst_begins = share / (1.0 - share) * clock->burst_ends;
    return BST_OK;
}

/* Draws whether the exposure that ends loses its frame. */
static bool loses_frame(exposure_clock *clock) {
    if (!(clock->dropped_fraction > 0.0)) {
        return false;
    }
    double u = bst_rng_uniform(clock->drop_key, (uint64_t)clock->id, 0);
    if (clock->burst_ends == 0.0 || clock->id == 0) {
        clock->in_burst = u < clock->dropped_fraction;
    } else {
        clock->in_burst = clock->in_burst ? u >= clock->burst_ends : u < clock->burst_begins;
    }
    return clock->in_burst;
}

/* Module interface: creates the exposure clock of a sensor. */
static bst_status create(const bst_module_env *env, const void *config, void **self) {
    const bst_exposure_config *c = config;
    exposure_clock *clock = calloc(1, sizeof *clock);
    if (!clock) {
        return bst_fail(env->ctx, BST_ERR_MEMORY, "out of memory for the exposure clock");
    }
    const bst_camera *camera = bst_world_camera(env->world, env->observer, env->sensor);
    clock->tick_rate_hz = env->tick_rate_hz;
    clock->full = (bst_window){0, 0, (int)camera->width_px, (int)camera->height_px};
    clock->binning = c->binning > 1 ? (int)c->binning : 1;
    bst_status status = set_losses(env, c, clock);
    if (status == BST_OK) {
        status = bst_exposure_window(env->ctx, c, camera->width_px, camera->height_px, &clock->own);
    }
    clock->window = clock->own;
    if (status == BST_OK) {
        status = bst_seconds_to_ticks(env->ctx, env->tick_rate_hz, c->exposure_s,
                                      &clock->exposure_ticks);
    }
    if (status == BST_OK) {
        status =
            bst_seconds_to_ticks(env->ctx, env->tick_rate_hz, c->period_s, &clock->period_ticks);
    }
    if (status == BST_OK) {
        status = bst_seconds_to_ticks(env->ctx, env->tick_rate_hz, c->first_s, &clock->start_tick);
    }
    const bst_frame_updates *updates =
        bst_world_frame_updates(env->world, env->observer, env->sensor);
    clock->single_pixels =
        camera->detector.ramp.reads > 0 || bst_detector_has_pixel_flicker(&camera->detector);
    if (status == BST_OK && clock->single_pixels) {
        status = check_single_pixels(env, c, updates);
    }
    if (status == BST_OK && updates) {
        status = check_updates(env, updates);
        clock->updates = bst_frame_cursor_begin(updates, camera, c, (double)env->tick_rate_hz);
    }
    if (status == BST_OK && camera->detector.row_time_s != 0.0) {
        clock->row_time_s = camera->detector.row_time_s;
        clock->lead_ticks = bst_detector_lead_ticks(&camera->detector, (int)camera->height_px,
                                                    (double)env->tick_rate_hz);
        clock->los_period_ticks = env->los_period_ticks;
        clock->los_offset_ticks = env->los_offset_ticks;
        status = check_rows(env, clock);
    }
    if (status != BST_OK) {
        free(clock);
        return status;
    }
    clock->set.exposure_ticks = clock->exposure_ticks;
    clock->set.period_ticks = clock->period_ticks;
    clock->set.binning = clock->binning;
    double cycle_s = (double)cycle_of(clock) / (double)env->tick_rate_hz, longest_s;
    if (updates) {
        bst_frame_updates_limits(updates, camera, c, &longest_s, &cycle_s);
    }
    bst_env_set_rate(env, 1.0 / cycle_s);
    *self = clock;
    return BST_OK;
}

/* Tick at which the complete open exposure can be published. */
static int64_t publication_tick(const exposure_clock *clock) {
    int64_t tick = clock->start_tick + clock->exposure_ticks;
    if (clock->row_time_s != 0.0) {
        tick += clock->lead_ticks;
        int64_t period = clock->los_period_ticks, past = tick - clock->los_offset_ticks;
        tick += period > 0 && past % period > 0 ? period - past % period : 0;
    }
    return tick;
}

/* Converts a commanded exposure time or period to whole ticks, at most one day. */
static int64_t commanded_ticks(const exposure_clock *clock, double seconds) {
    return (int64_t)floor(fmin(seconds, 86400.0) * (double)clock->tick_rate_hz + 0.5);
}

/* End of a window along one axis, at most the sensor size. */
static int clip_end(int start, int length, int limit) {
    int64_t end = (int64_t)start + length;
    return end < limit ? (int)end : limit;
}

/* Takes exposure, period and window from a sensor command, within the limits of the sensor. */
static void latch(exposure_clock *clock, const bst_sensor_command *command) {
    if (command->exposure_s > 0.0) {
        clock->exposure_ticks = commanded_ticks(clock, command->exposure_s);
    }
    if (command->period_s > 0.0) {
        int64_t period = commanded_ticks(clock, command->period_s);
        clock->period_ticks = period > 0 ? period : 1;
    }
    if (command->binning > 0 && !clock->single_pixels) {
        clock->binning = command->binning;
    }
    if (command->pixel_scale_arcsec > 0.0) {
        clock->pixel_scale_arcsec = command->pixel_scale_arcsec;
    }
    const bst_window *w = &command->window;
    clock->window = clock->own;
    if (w->width > 0 && w->height > 0) {
        int x0 = w->x0 < 0 ? 0 : w->x0, y0 = w->y0 < 0 ? 0 : w->y0;
        int x1 = clip_end(w->x0, w->width, clock->full.width);
        int y1 = clip_end(w->y0, w->height, clock->full.height);
        if (x1 > x0 && y1 > y0) {
            clock->window = (bst_window){x0, y0, x1 - x0, y1 - y0};
        }
    }
    int side =
        clock->window.width < clock->window.height ? clock->window.width : clock->window.height;
    clock->binning = clock->binning < side ? clock->binning : side;
}

/* Takes the settings that the scenario has changed. */
static void take_changes(exposure_clock *clock) {
    if (clock->changed.exposure) {
        clock->exposure_ticks = clock->set.exposure_ticks;
    }
    if (clock->changed.period) {
        clock->period_ticks = clock->set.period_ticks;
    }
    if (clock->changed.binning) {
        clock->binning = (int)clock->set.binning;
    }
    if (clock->changed.window) {
        clock->window = clock->own;
    }
    memset(&clock->changed, 0, sizeof clock->changed);
}

/* Opens an exposure: latches the sensor command and fixes start and end ticks. */
static void open_exposure(exposure_clock *clock, bst_sample command) {
    take_changes(clock);
    if (clock->updates.updates) { /* updates from a file take precedence over commands */
        clock->exposure_ticks = clock->updates.exposure_ticks;
        clock->period_ticks = clock->updates.period_ticks;
        clock->window = clock->updates.window;
        clock->binning = clock->updates.binning;
        clock->pixel_scale_arcsec = clock->updates.pixel_scale_arcsec;
    } else if (command.payload && !command.stale) {
        latch(clock, command.payload);
    }
    clock->next_start_tick = clock->start_tick + cycle_of(clock);
    clock->open = true;
}

/* Ends an exposure and fills its message. `late`: pacing drops the frame. */
static void close_exposure(exposure_clock *clock, bool late, bst_exposure *out) {
    bool lost = loses_frame(clock);
    *out = (bst_exposure){.id = clock->id,
                          .start_tick = clock->start_tick,
                          .end_tick = clock->start_tick + clock->exposure_ticks,
                          .window = clock->window,
                          .binning = clock->binning,
                          .pixel_scale_arcsec = clock->pixel_scale_arcsec,
                          .dropped = late || lost};
    assert(bst_exposure_is_valid(out));
    if (clock->updates.updates) {
        bst_frame_cursor_next(&clock->updates);
    }
    clock->id++;
    clock->open = false;
    clock->start_tick = clock->next_start_tick;
}

/* Module step: opens and closes exposures and publishes them. */
static bst_status step(void *self, struct bst_step *step) {
    exposure_clock *clock = self;
    int64_t tick = bst_step_tick(step);
    /* an exposure may end and the next one begin in the same tick; an exposure of zero length ends
     * too */
    for (;;) {
        int64_t open_tick = clock->start_tick - clock->lead_ticks;
        if (!clock->open && open_tick <= tick) {
            open_exposure(clock, bst_step_latest(step, PORT_COMMAND));
        }
        if (!clock->open || publication_tick(clock) > tick) {
            bst_step_wake_at(step, clock->open ? publication_tick(clock) : open_tick);
            return BST_OK;
        }
        bool late = bst_pacing_frame(step, clock->id);
        close_exposure(clock, late, bst_step_write(step, PORT_EXPOSURE, NULL));
    }
}

/* Notes the settings that the scenario has changed since the state was saved. They hold from the
 * next exposure on; the sensor itself has changed at once. */
static void note_changes(exposure_clock *clock, const exposure_clock *saved) {
    clock->changed.exposure |= saved->set.exposure_ticks != clock->set.exposure_ticks;
    clock->changed.period |= saved->set.period_ticks != clock->set.period_ticks;
    clock->changed.binning |= saved->set.binning != clock->set.binning;
    clock->changed.window |= memcmp(&saved->own, &clock->own, sizeof saved->own) != 0;
    clock->binning =
        clock->single_pixels ? 1 : clock->binning; /* commanded before there was a ramp */
    const bst_window *w = &clock->window;
    if (w->x0 + w->width > clock->full.width || w->y0 + w->height > clock->full.height) {
        clock->window = clock->own;
    }
}

/* Module interface: archives the settings in force and the exposure in progress. */
static bst_status archive(void *self, bst_archive *archive) {
    exposure_clock *clock = self, saved = *clock;
    BST_ARCHIVE(archive, saved.set);
    BST_ARCHIVE(archive, saved.own);
    BST_ARCHIVE(archive, clock->exposure_ticks);
    BST_ARCHIVE(archive, clock->period_ticks);
    BST_ARCHIVE(archive, clock->window);
    BST_ARCHIVE(archive, clock->binning);
    BST_ARCHIVE(archive, clock->pixel_scale_arcsec);
    bst_archive_bool(archive, &clock->changed.exposure);
    bst_archive_bool(archive, &clock->changed.period);
    bst_archive_bool(archive, &clock->changed.binning);
    bst_archive_bool(archive, &clock->changed.window);
    bst_archive_bool(archive, &clock->in_burst);
    BST_ARCHIVE(archive, clock->id);
    BST_ARCHIVE(archive, clock->start_tick);
    BST_ARCHIVE(archive, clock->next_start_tick);
    bst_archive_bool(archive, &clock->open);
    bst_frame_cursor_archive(&clock->updates, archive);
    if (bst_archive_is_restoring(archive)) {
        note_changes(clock, &saved);
    }
    return BST_OK;
}

static void destroy(void *self) {
    free(self);
}

static const bst_port ports[] = {
    [PORT_COMMAND] = {.channel = BST_CHANNEL_SENSOR_COMMAND,
                      .direction = BST_PORT_IN,
                      .flags = BST_PORT_OPTIONAL | BST_PORT_FEEDBACK},
    [PORT_EXPOSURE] = {.channel = BST_CHANNEL_EXPOSURE, .direction = BST_PORT_OUT},
};

const bst_module_desc bst_exposure_clock_module = {
    .abi = BST_MODULE_ABI,
    .role = "exposure",
    .type = "clock",
    .doc = "Opens and closes exposures at exact ticks.",
    .flags = BST_MODULE_READS_TRUTH,
    .config_bytes = sizeof(bst_exposure_config),
    .ports = ports,
    .port_count = sizeof ports / sizeof *ports,
    .create = create,
    .step = step,
    .destroy = destroy,
    .archive = archive,
};
