#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "imgproc/calibrate/calibration.h"
#include "imgproc/module_internal.h"
#include "imgproc/window_plan.h"
#include "sim/messages/message_invariants.h"
#include "sim/onboard/knowledge.h"
#include "sim/onboard/nav_motion.h"

enum {
    PORT_FRAME,
    PORT_PREDICTIONS,
    PORT_POINTING,
    PORT_NAV,
    PORT_DETECTIONS,
    PORT_REGIONS,
    PORT_COUNT
};

static const bst_port ports[PORT_COUNT] = {
    {BST_CHANNEL_FRAME, BST_PORT_IN, BST_PORT_TRIGGER, 0.0, 0},
    {BST_CHANNEL_PREDICTIONS, BST_PORT_IN, BST_PORT_OPTIONAL | BST_PORT_FEEDBACK, 30.0, 0},
    {BST_CHANNEL_POINTING_TELEMETRY, BST_PORT_IN, 0, 10.0, 0},
    {BST_CHANNEL_NAV_TELEMETRY, BST_PORT_IN, 0, 60.0, 0},
    {BST_CHANNEL_DETECTIONS, BST_PORT_OUT, 0, 0.0, 2048},
    {BST_CHANNEL_REGIONS_OF_INTEREST, BST_PORT_OUT, 0, 0.0, 0},
};
enum { CATALOGUE_CAPACITY = 16384 };
/* Least expected SNR of a star that gets a window. */
static const double WINDOW_STAR_SNR = 12.0;

static void destroy(void *self) {
    bst_imgproc_state *m = self;
    if (!m) {
        return;
    }
    for (int i = 0; i < BST_STEP_LANES; i++) {
        bst_imgproc_free(m->lanes[i].ip);
        free(m->lanes[i].made);
        bst_reference_pixels_free(&m->lanes[i].references);
    }
    bst_calibration_free(&m->maps);
    bst_starid_free(m->starid);
    bst_discriminator_free(m->discriminator);
    bst_predicted_stars_free(&m->sky);
    bst_stack_free(m->stack);
    bst_optics_photometer_free(&m->photometer);
    bst_pixel_learner_free(m->pixels);
    bst_psf_wings_free(m->wings);
    bst_plugin_detector_free(m->plugin);
    bst_imgproc_lost_close(&m->lost);
    bst_extended_step_close(&m->extended);
    free(m);
}

/* Creates the detector of a lane. */
static bst_status open_lane(bst_ctx *ctx, bst_imgproc_state *m, bst_imgproc_lane *l) {
    if (l->ip || m->plugin) {
        return BST_OK;
    }
    BST_TRY(bst_imgproc_create(ctx, &m->camera, bst_camera_electrons_per_s(&m->camera, 0.0),
                               m->config, &m->maps, &l->ip));
    return m->pixels
               ? bst_imgproc_collect_shows(ctx, l->ip, (int)m->config->bad_pixel_learning.capacity)
               : BST_OK;
}

static bst_status open_plugin(const bst_module_env *env, bst_imgproc_state *m) {
    if (!m->config->detector.desc) {
        return BST_OK;
    }
    if (m->config->stack.frames > 0 || m->config->track_windows || m->config->extended.enabled) {
        return bst_fail(
            env->ctx, BST_ERR_CONFIG,
            "/observers/%d/sensors/%d/modules/imgproc/detector: a plug-in looks at whole "
            "frames by itself; turn track_windows, stack and extended off",
            env->observer, env->sensor);
    }
    return bst_plugin_detector_create(env->ctx, &m->config->detector, &m->camera, &m->maps,
                                      (int)m->config->capacity, &m->plugin);
}

/* Restores a stack of another number of frames than is configured now, to leave it out: the next
 * frame begins a new stack. */
static bst_status skip_stack(bst_imgproc_state *m, bst_archive *archive, int64_t frames) {
    bst_stack_config config = m->config->stack;
    bst_stack *skipped;
    config.frames = frames;
    BST_TRY(bst_stack_create(bst_archive_ctx(archive), &m->camera, &config, 1, &skipped));
    bst_status status = bst_stack_archive(skipped, archive);
    bst_stack_free(skipped);
    return status;
}

/* Saves or restores the stack, whose number of frames may change during a run. */
static bst_status archive_stack(bst_imgproc_state *m, bst_archive *archive) {
    const int64_t own = m->stack ? m->config->stack.frames : 0;
    const int64_t saved = bst_archive_integer(archive, own, 0, BST_STACK_MAX_FRAMES);
    if (saved != own) {
        return saved > 0 ? skip_stack(m, archive, saved) : BST_OK;
    }
    return m->stack ? bst_stack_archive(m->stack, archive) : BST_OK;
}

/* Saves or restores the module between two steps. Detections made ahead are not archived: the step
 * makes them again. */
static bst_status archive_module(void *self, bst_archive *archive) {
    bst_imgproc_state *m = self;
    m->steps = bst_archive_integer(archive, m->steps, 0, INT64_MAX / 2);
    BST_ARCHIVE(archive, m->window_v_limit);
    bst_discriminator_archive(m->discriminator, archive);
    bst_extended_step_archive(&m->extended, archive);
    if (m->pixels) {
        BST_TRY(bst_pixel_learner_archive(m->pixels, archive));
    }
    BST_TRY(archive_stack(m, archive));
    bst_imgproc_lost_archive(&m->lost, archive);
    BST_TRY(bst_imgproc_calibration_archive(m, archive));
    if (bst_archive_is_restoring(archive)) {
        m->first_slot = (int)(m->steps % BST_STEP_LANES); /* lanes begin at 0 again */
        for (int i = 0; i < BST_STEP_LANES; i++) {
            m->lanes[i].ready = false;
        }
    }
    return m->plugin ? bst_plugin_detector_archive(m->plugin, archive) : BST_OK;
}

/* Creates all parts of the module from the configuration. */
static bst_status prepare(const bst_module_env *env, bst_imgproc_state *m) {
    m->camera = *bst_knowledge_camera(env->knowledge);
    m->tick_rate_hz = env->tick_rate_hz;
    BST_TRY(bst_calibration_load(env->ctx, m->config, &m->camera, &m->maps));
    bst_status status = bst_calibration_psf(env->ctx, env->knowledge, &m->camera, &m->maps);
    if (status != BST_OK) {
        return bst_fail_prefix(env->ctx, status,
                               "/observers/%d/sensors/%d/knowledge/camera/psf_file", env->observer,
                               env->sensor);
    }
    BST_TRY(open_plugin(env, m));
    if (m->config->bad_pixel_learning.enabled && !m->plugin) {
        BST_TRY(bst_pixel_learner_create(env->ctx, &m->camera, &m->config->bad_pixel_learning,
                                         &m->pixels));
    }
    BST_TRY(open_lane(env->ctx, m, &m->lanes[0]));
    m->epoch_julian_year = bst_knowledge_julian_year(env->knowledge);
    BST_TRY(bst_predicted_stars_create(env->ctx, &m->camera, bst_knowledge_stars(env->knowledge),
                                       m->epoch_julian_year, CATALOGUE_CAPACITY, &m->sky));
    BST_TRY(bst_starid_create(env->ctx, CATALOGUE_CAPACITY, (int)m->config->capacity,
                              m->config->search_radius_px, &m->starid));
    BST_TRY(bst_discriminator_create(env->ctx, &m->camera, (int)m->config->capacity,
                                     &m->discriminator));
    if (m->config->stack.frames > 0 && m->config->track_windows) {
        return bst_fail(env->ctx, BST_ERR_CONFIG,
                        "imgproc: track_windows and stack do not go together: stacks are made of "
                        "whole frames; turn one of them off");
    }
    BST_TRY(bst_extended_step_open(env->ctx, &m->extended, &m->config->extended,
                                   m->config->stack.frames == 0 && !m->config->track_windows));
    if (m->config->stack.frames > 0) {
        BST_TRY(bst_stack_create(env->ctx, &m->camera, &m->config->stack, (int)m->config->threads,
                                 &m->stack));
    }
    BST_TRY(bst_optics_photometer_create(env->ctx, (int)m->config->capacity, &m->photometer));
    if (m->maps.psf) {
        BST_TRY(bst_psf_wings_create(env->ctx, m->maps.psf, (double)m->camera.width_px,
                                     (double)m->camera.height_px, m->config->jitter_px, &m->wings));
    }
    bst_imgproc_calibration_open(m);
    bst_imgproc_lost_open(m, bst_knowledge_stars(env->knowledge),
                          bst_knowledge_julian_year(env->knowledge));
    bst_env_set_capacity(env, PORT_DETECTIONS, (int)m->config->capacity);
    bst_env_set_capacity(env, PORT_REGIONS, m->config->track_windows ? BST_WINDOWS_MAX : 0);
    return BST_OK;
}

static bst_status create(const bst_module_env *env, const void *config, void **self) {
    assert(env && env->knowledge && env->tick_rate_hz > 0 && config && self);
    bst_imgproc_state *m = calloc(1, sizeof *m);
    *self = NULL;
    if (!m) {
        return bst_fail(env->ctx, BST_ERR_MEMORY, "no memory for image processing");
    }
    m->config = config;
    m->window_v_limit = NAN;
    bst_status status = prepare(env, m);
    if (status != BST_OK) {
        destroy(m);
        return status;
    }
    *self = m;
    return BST_OK;
}

/* Tracker's estimate of the attitude error of the telemetry, propagated to mid-exposure. */
static bst_quat attitude_correction(const bst_imgproc_state *m, const bst_predictions *predictions,
                                    double mid_tick) {
    double dt = (mid_tick - (double)predictions->tick) / (double)m->tick_rate_hz;
    return bst_quat_from_rotvec(bst_vec3_axpy(predictions->attitude_error_cam_rad, dt,
                                              predictions->attitude_error_rate_cam_radps));
}

/* Plans the windows to search while a target is tracked; none: the whole frame. */
static bst_status plan_windows(bst_ctx *ctx, bst_imgproc_state *m, const bst_imgproc_exposure *e,
                               bst_quat q_cam_from_gcrf) {
    const bst_frame_message *message = e->message;
    if (isnan(m->window_v_limit) ||
        message->exposure_id % m->config->full_frame_period < m->config->full_frame_count) {
        return BST_OK;
    }
    double middle = 0.5 * ((double)message->start_tick + (double)message->end_tick);
    const bst_window_plan_input input = {
        .camera = &m->calibrator.camera,
        .config = m->config,
        .v_limit = m->window_v_limit,
        .message = message,
        .motion = e->motion,
        .light = &e->light,
        .predictions = e->predictions,
        .predictions_age_s = (middle - (double)e->predictions->tick) / (double)m->tick_rate_hz,
        .q_cam_from_gcrf = q_cam_from_gcrf};
    bool use;
    BST_TRY(bst_window_plan_make(ctx, &input, &m->sky, &m->windows, &use));
    if (!use) {
        bst_region_of_interest_clear(&m->windows);
    }
    return BST_OK;
}

/* Background and noise at a position, for bst_psf_wings_label. */
static void ground_at(const void *user, double x_px, double y_px, bst_psf_wings_ground *out) {
    bst_imgproc_ground(user, x_px, y_px, &out->level_e, &out->noise_e);
}

/* Labels artefacts in the PSF wings of bright stars. */
static bst_status label_wings(bst_ctx *ctx, bst_imgproc_state *m, const bst_imgproc_lane *l,
                              const bst_imgproc_exposure *e, const bst_frame_knowledge *known,
                              bst_detections *out) {
    const bst_frame_message *message = e->message;
    const bst_wing_labels_input input = {
        .camera = &m->calibrator.camera,
        .known = known,
        .motion = e->motion,
        .binning = message->binning,
        .exposure_s = (double)(message->end_tick - message->start_tick) / (double)m->tick_rate_hz,
        .ground = m->plugin ? bst_plugin_detector_ground : ground_at,
        .user = m->plugin ? (const void *)m->plugin : l->ip};
    return bst_wing_labels_make(ctx, &input, &m->sky, m->wings, out);
}

/* Camera motion during the exposure from telemetry; false: unknown. */
static bool motion_of(struct bst_step *step, const bst_frame_message *message,
                      bst_camera_motion *motion) {
    bst_sample pointing = bst_step_latest(step, PORT_POINTING);
    *motion = (bst_camera_motion){.q_cam_from_gcrf = BST_QUAT_IDENTITY};
    return pointing.payload && !pointing.stale &&
           bst_camera_motion_from_telemetry(pointing.payload, message->start_tick,
                                            message->end_tick, motion);
}

/* Detects the sources of a frame. The result depends on the camera's rotation during the exposure,
 * not on its pointing. */
static bst_status detect_sources(bst_ctx *ctx, const bst_imgproc_state *m, bst_imgproc_lane *l,
                                 const bst_imgproc_exposure *e, bool beside_another,
                                 bst_detections *out, int capacity) {
    const bst_frame_message *message = e->message;
    const bst_imgproc_windows windows = {m->windows.items, m->windows.count};
    const uint16_t *pixels;
    if (m->pixels) {
        bst_imgproc_use_map(l->ip, bst_pixel_learner_map(m->pixels, l->map));
    }
    BST_TRY(bst_frame_map(message->frame, ctx, &pixels));
    bst_imgproc_frame frame = {
        .pixels = pixels,
        .window = message->window,
        .binning = message->binning,
        .bits = message->bits,
        .exposure_s = (double)(message->end_tick - message->start_tick) / (double)m->tick_rate_hz,
        .beside_another = beside_another,
        .detections_only = !m->stack && !m->config->long_streaks};
    bst_status status = bst_reference_pixels_subtract(
        ctx, &l->references, &m->config->reference_pixels, &m->camera, &frame, &frame);
    if (status != BST_OK) {
        bst_frame_unmap(message->frame);
        return status;
    }
    status = m->plugin ? bst_plugin_detector_detect(ctx, m->plugin, &frame, message->exposure_id,
                                                    e->motion, out, capacity)
             : windows.count > 0 ? bst_imgproc_detect_windows(ctx, l->ip, &frame, &windows,
                                                              e->motion, out, capacity)
                                 : bst_imgproc_detect(ctx, l->ip, &frame, e->motion, out, capacity);
    bst_frame_unmap(message->frame);
    return status;
}

/* Detects the sources of the next frame ahead of its step. */
static bst_status detect_ahead(void *self, struct bst_step *step) {
    bst_imgproc_state *m = self;
    bst_imgproc_lane *l = &m->lanes[bst_step_lane(step)];
    bst_ctx *ctx = bst_step_ctx(step);
    l->ready = false;
    bst_sample sample = bst_step_next(step, PORT_FRAME);
    /* the windows are known only in the step itself */
    if (!sample.payload || m->config->track_windows || m->plugin) { /* frame by frame */
        return BST_OK;
    }
    BST_TRY(open_lane(ctx, m, l));
    l->map = (bst_step_lane(step) + m->first_slot) % BST_STEP_LANES;
    int capacity = (int)m->config->capacity;
    if (!l->made) {
        l->made = malloc(sizeof *l->made + (size_t)capacity * sizeof l->made->items[0]);
        if (!l->made) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d detections", capacity);
        }
    }
    const bst_frame_message *message = sample.payload;
    bst_camera_motion motion;
    bool oriented = motion_of(step, message, &motion);
    const bst_imgproc_exposure e = {.message = message, .motion = oriented ? &motion : NULL};
    BST_TRY(detect_sources(ctx, m, l, &e, true, l->made, capacity));
    l->exposure_id = message->exposure_id;
    l->ready = true;
    return BST_OK;
}

/* Detections of a frame: computed ahead or now. */
static bst_status detections_of(bst_ctx *ctx, bst_imgproc_state *m, bst_imgproc_lane *l,
                                const bst_imgproc_exposure *e, bst_detections *out, int capacity) {
    const bst_detections *made = l->ready ? l->made : NULL;
    l->ready = false;
    if (!made || l->exposure_id != e->message->exposure_id) {
        BST_TRY(open_lane(ctx, m, l));
        return detect_sources(ctx, m, l, e, false, out, capacity);
    }
    out->background_e = made->background_e;
    out->noise_e = made->noise_e;
    out->threshold_snr = made->threshold_snr;
    out->shared_xx = made->shared_xx;
    out->shared_xy = made->shared_xy;
    out->shared_yy = made->shared_yy;
    out->stars_identified = made->stars_identified;
    out->count = made->count;
    out->lost = made->lost;
    memcpy(out->items, made->items, (size_t)out->count * sizeof out->items[0]);
    return BST_OK;
}

/* Adds the frame to the stack; a full stack appends its detections to those of its last frame. */
static void add_to_stack(bst_imgproc_state *m, const bst_imgproc_lane *l, double middle_tick,
                         bst_quat q_cam_from_gcrf, const bst_optics_zero_point *zero_point,
                         bst_detections *out, int capacity) {
    bst_stack_frame frame =
        bst_imgproc_stack_frame(l->ip, middle_tick / (double)m->tick_rate_hz, q_cam_from_gcrf);
    if (bst_stack_add(m->stack, &frame) == m->config->stack.frames) {
        int count, before = out->count;
        const bst_stack_found *found = bst_stack_search(m->stack, &count);
        bst_imgproc_append_stack(l->ip, found, count, m->camera.psf_fwhm_px, out, capacity);
        for (int i = before; i < out->count; i++) {
            bst_photometry_correct(zero_point, &out->items[i]);
        }
    }
}

/* Updates the bad-pixel learner with the frame. */
static void learn_pixels(bst_imgproc_state *m, struct bst_step *step, const bst_imgproc_lane *l,
                         const bst_frame_message *message, const bst_frame_knowledge *known,
                         bst_detections *out) {
    int64_t lost = bst_pixel_learner_lost(m->pixels);
    double middle_s =
        0.5 * ((double)message->start_tick + (double)message->end_tick) / (double)m->tick_rate_hz;
    const bst_pixel_step_input input = {
        known, &m->windows, message->binning, middle_s, bst_imgproc_shows(l->ip), out};
    bst_pixel_step(m->pixels, &m->camera, &input);
    if (bst_pixel_learner_waits(m->pixels)) {
        bst_step_count(step, "bad_pixels_sky_at_rest");
    }
    if (bst_pixel_learner_lost(m->pixels) > lost) {
        bst_step_count(step, "bad_pixels_overflow");
    }
}

/* Observer's position and velocity at mid-exposure; the navigation telemetry may be later by the
 * read-out time. */
static bst_light observer_at(const bst_imgproc_state *m, const bst_nav_telemetry *nav,
                             double middle_tick) {
    return bst_nav_light_after(nav, (middle_tick - (double)nav->tick) / (double)m->tick_rate_hz);
}

/* Labels detections that are no stars, and refines the fit of possible objects. */
static void label_objects(bst_imgproc_state *m, const bst_imgproc_lane *l,
                          const bst_frame_knowledge *known, const bst_optics_zero_point *zero_point,
                          bst_detections *out) {
    bst_discriminator_label(m->discriminator, known, out);
    for (int i = 0; i < out->count && !m->plugin; i++) {
        if (out->items[i].label == BST_LABEL_OBJECT) {
            bst_imgproc_refine(l->ip, out, i, zero_point);
        }
    }
}

/* Detects the frame's sources and fills the message's header, except for the stars.
 *
 * Returned:  *e  what is known of the exposure */
static bst_status detect_frame(bst_imgproc_state *m, struct bst_step *step, bst_imgproc_lane *l,
                               bst_imgproc_exposure *e, bst_detections *out, int capacity) {
    const bst_frame_message *message = e->message;
    bst_sample nav = bst_step_latest(step, PORT_NAV);
    double middle = 0.5 * ((double)message->start_tick + (double)message->end_tick);
    e->locked = e->motion && e->predictions && e->predictions->attitude_valid;
    if (e->locked) {
        out->q_cam_from_gcrf = bst_quat_unit(bst_quat_mul(
            attitude_correction(m, e->predictions, middle), out->q_telemetry_from_gcrf));
    }
    if (m->lost.enabled) {
        /* the tracker's correction is one of small angles */
        e->locked = e->motion && bst_imgproc_lost_attitude(&m->lost, out->q_telemetry_from_gcrf,
                                                           &out->q_cam_from_gcrf);
    }
    bst_region_of_interest_clear(&m->windows);
    out->windows = 0;
    e->navigated = nav.payload && !nav.stale;
    if (e->navigated) {
        e->light = observer_at(m, nav.payload, middle);
    }
    m->sky.julian_year =
        bst_stars_year_after(m->sky.stars, m->epoch_julian_year, middle / (double)m->tick_rate_hz);
    if (m->config->track_windows && e->locked && e->predictions && e->navigated) {
        BST_TRY(plan_windows(bst_step_ctx(step), m, e, out->q_cam_from_gcrf));
        out->windows = m->windows.count;
    }
    BST_TRY(detections_of(bst_step_ctx(step), m, l, e, out, capacity));
    if (!m->plugin) {
        m->window_v_limit = bst_imgproc_v_limit(l->ip, WINDOW_STAR_SNR);
        const bst_extended_input input = {
            &m->calibrator.camera,           message,        bst_imgproc_silhouettes(l->ip),
            e->motion && e->navigated,       e->light.sun_m, out->q_cam_from_gcrf,
            middle / (double)m->tick_rate_hz};
        bst_extended_step_begin(&m->extended, &input, out);
    }
    return BST_OK;
}

/* Publishes the windows of a frame, if not all of it was searched. */
static void publish_windows(const bst_imgproc_state *m, struct bst_step *step,
                            const bst_frame_message *message) {
    if (m->windows.count == 0) {
        return;
    }
    int capacity;
    bst_regions_of_interest *out = bst_step_write(step, PORT_REGIONS, &capacity);
    assert(m->windows.planned_count <= capacity);
    out->exposure_id = message->exposure_id;
    out->start_tick = message->start_tick;
    out->end_tick = message->end_tick;
    out->count = m->windows.planned_count;
    memcpy(out->items, m->windows.planned, (size_t)out->count * sizeof out->items[0]);
    assert(bst_regions_of_interest_are_valid(out, capacity));
}

/* Adds what needs labels: extended targets, and detections of a stack. */
static void append_detections(bst_imgproc_state *m, const bst_imgproc_lane *l,
                              const bst_imgproc_exposure *e, bst_quat q_cam_from_gcrf,
                              const bst_optics_zero_point *zero_point, bst_detections *out,
                              int capacity) {
    const bst_frame_message *message = e->message;
    double ticks = (double)(message->end_tick - message->start_tick);
    bst_extended_step_append(&m->extended, ticks / (double)m->tick_rate_hz, zero_point, out,
                             capacity);
    if (m->stack && !bst_imgproc_smeared(l->ip)) {
        double middle = 0.5 * ((double)message->start_tick + (double)message->end_tick);
        add_to_stack(m, l, middle, q_cam_from_gcrf, zero_point, out, capacity);
    }
}

/* Counts what the step reports. */
static void count_losses(struct bst_step *step, const bst_detections *out) {
    if (out->stars_identified == 0) {
        bst_step_count(step, "frame_without_stars");
    }
    if (out->lost > 0) {
        bst_step_count(step, "detections_overflow");
    }
}

/* Bad-pixel learner, and the map that masked a frame. */
typedef struct suspected_pixels {
    const bst_pixel_learner *learner;
    const bst_pixel_map *left_out;
} suspected_pixels;

/* Log odds that a pixel is a defect, for the labels of the frame's detections. */
static double suspicion_of(const void *user, int32_t pixel) {
    const suspected_pixels *s = user;
    return bst_pixel_learner_suspicion(s->learner, s->left_out, pixel);
}

/* Processes a frame message into detections. */
static bst_status process_frame(bst_imgproc_state *m, struct bst_step *step,
                                const bst_frame_message *message) {
    bst_ctx *ctx = bst_step_ctx(step);
    bst_imgproc_lane *l = &m->lanes[bst_step_lane(step)];
    bst_camera_motion motion;
    bool oriented = motion_of(step, message, &motion);
    bst_sample predicted = bst_step_latest(step, PORT_PREDICTIONS);
    int capacity = 0;
    bst_detections *out = bst_step_write(step, PORT_DETECTIONS, &capacity);
    out->exposure_id = message->exposure_id;
    out->start_tick = message->start_tick;
    out->end_tick = message->end_tick;
    out->q_cam_from_gcrf = out->q_telemetry_from_gcrf = motion.q_cam_from_gcrf;
    bst_camera_calibrator_get(&m->calibrator, &out->calibration);
    const bst_predictions *predictions = predicted.stale ? NULL : predicted.payload;
    bst_imgproc_exposure e = {
        .message = message, .motion = oriented ? &motion : NULL, .predictions = predictions};
    BST_TRY(detect_frame(m, step, l, &e, out, capacity));
    publish_windows(m, step, message);
    bool smeared = !m->plugin && bst_imgproc_smeared(l->ip), followed = false;
    if (smeared && m->config->long_streaks) {
        bst_sample pointing = bst_step_latest(step, PORT_POINTING);
        BST_TRY(bst_imgproc_find_long_streaks(ctx, m, l, &e, pointing.payload, out, &followed));
    }
    bst_optics_photometer_begin(&m->photometer);
    bst_frame_knowledge known = {.q_cam_from_gcrf = out->q_cam_from_gcrf,
                                 .window = message->window,
                                 .streak_px = m->plugin ? bst_plugin_detector_streak_px(m->plugin)
                                                        : bst_imgproc_streak_px(l->ip),
                                 .predictions = predictions};
    if (oriented && e.navigated && (!smeared || followed)) {
        BST_TRY(m->lost.enabled
                    ? bst_imgproc_lost_identify(m, step, l, &e, out, &known.q_cam_from_gcrf)
                    : bst_imgproc_identify_stars(ctx, m, l, &e, out, &known.q_cam_from_gcrf));
        BST_TRY(bst_imgproc_calibrate_camera(m, step, l, &e, out, &known.q_cam_from_gcrf));
        known.light = e.light;
        known.oriented = out->stars_identified > 0;
    }
    bst_optics_zero_point zero_point = bst_optics_photometer_zero_point(&m->photometer);
    bst_photometry_apply(&zero_point, bst_camera_v_mag(&m->camera, 1.0), out);
    if (predictions) {
        double middle = 0.5 * ((double)message->start_tick + (double)message->end_tick);
        known.predictions_age_s = (middle - (double)predictions->tick) / (double)m->tick_rate_hz;
    }
    suspected_pixels suspected = {m->pixels,
                                  m->pixels ? bst_pixel_learner_map(m->pixels, l->map) : NULL};
    known.suspicion = m->pixels ? suspicion_of : NULL;
    known.suspicion_user = &suspected;
    if (m->pixels && oriented) {
        learn_pixels(m, step, l, message, &known, out);
    }
    out->bad_pixels = m->pixels ? bst_pixel_learner_bad_count(m->pixels) : 0;
    if (m->wings && !smeared && m->windows.count == 0) {
        BST_TRY(label_wings(ctx, m, l, &e, &known, out));
    }
    if (!smeared || followed) {
        label_objects(m, l, &known, &zero_point, out);
        if (followed) {
            bst_imgproc_label_long_streaks(l, out);
        }
    }
    append_detections(m, l, &e, known.q_cam_from_gcrf, &zero_point, out, capacity);
    count_losses(step, out);
    assert(bst_detections_are_valid(out, capacity));
    return BST_OK;
}

static bst_status step_module(void *self, struct bst_step *step) {
    bst_imgproc_state *m = self;
    bst_sample sample;
    /* Lanes alternate by step; without look-ahead the bad-pixel map is equally old. */
    int slot = (int)(m->steps % BST_STEP_LANES);
    m->lanes[bst_step_lane(step)].map = slot;
    while ((sample = bst_step_next(step, PORT_FRAME)).payload) {
        BST_TRY(process_frame(self, step, sample.payload));
    }
    if (m->pixels) {
        bst_pixel_learner_publish(m->pixels, slot, m->steps);
    }
    m->steps++;
    return BST_OK;
}

const bst_module_desc bst_imgproc_module = {
    .abi = BST_MODULE_ABI,
    .role = "imgproc",
    .type = "standard",
    .flags = BST_MODULE_DEFERRABLE,
    .doc = "Calibrates frames, detects and locates sources with matched filters, identifies stars.",
    .config = bst_imgproc_config_table,
    .config_bytes = sizeof(bst_imgproc_config),
    .ports = ports,
    .port_count = PORT_COUNT,
    .create = create,
    .step = step_module,
    .destroy = destroy,
    .ahead = detect_ahead,
    .archive = archive_module,
};
