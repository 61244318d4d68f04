#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "boresight/camera_motion.h"
#include "obsgen/generator.h"
#include "obsgen/labels.h"
#include "obsgen/lost_attitude.h"
#include "obsgen/model/psf_bound.h"
#include "obsgen/obsgen.h"
#include "obsgen/pending_exposure.h"
#include "sim/core/invariant.h"
#include "sim/messages/message_invariants.h"
#include "sim/onboard/knowledge.h"
#include "sim/optics/column_level.h"
#include "sim/optics/photometry.h"
#include "sim/optics/psf.h"
#include "sim/world/frame_updates.h"
#include "sim/world/scene/field.h"
#include "sim/world/scene/los_track.h"
#include "sim/world/scene/truth_list.h"

typedef struct obsgen_config {
    char calibration_file[512];
    /* defaults from scenegen and imgproc if the sensor has them */
    double star_limit_v_mag, margin_px;
    int64_t truth_capacity, capacity, mesh_px;
    double false_alarms_per_frame, jitter_px, motion_bend_px, streak_min_px, streak_max_px,
        search_radius_px, false_splits, match_tolerance_px;
    int column_correction, attitude;
    int64_t lost_after_frames;
} obsgen_config;

static const char *const attitudes[] = {"telemetry", "unknown", NULL};
static const char *const no_file[] = {"theory", NULL};

#define OF_OTHERS " (scenegen's or imgproc's where the sensor has them)"
static const bst_config_desc config_table[] = {
    BST_PATH_OR(obsgen_config, calibration_file, no_file, "\"theory\"",
                "Calibration that `boresight calibrate-obsgen` wrote, or theory: no measured "
                "factors."),
    BST_REAL(obsgen_config, star_limit_v_mag, "mag", -30.0, 30.0, "16",
             "Stars fainter than this are left out" OF_OTHERS "."),
    BST_FORMER("v_limit", "star_limit_v_mag"),
    BST_REAL(obsgen_config, margin_px, "px", 0.0, 1e4, "0",
             "Sources this far outside the window count too" OF_OTHERS "."),
    BST_INT(obsgen_config, truth_capacity, "", 1, 1048576, "4096",
            "Sources that the truth of one exposure has room for" OF_OTHERS "."),
    BST_INT(obsgen_config, capacity, "", 1, 65536, "2048",
            "Detections kept per frame, the brightest first" OF_OTHERS "."),
    BST_REAL(obsgen_config, false_alarms_per_frame, "", 1e-6, 1e4, "1",
             "Detections per frame that noise alone may cause, on average" OF_OTHERS "."),
    BST_REAL(obsgen_config, false_splits, "", 0, 0.1, "0",
             "Share of single sources that the test for close pairs may split; 0: no such "
             "test" OF_OTHERS "."),
    BST_REAL(obsgen_config, jitter_px, "px", 0, 5, "0",
             "RMS per axis of the line-of-sight jitter that widens the onboard PSF" OF_OTHERS "."),
    BST_REAL(obsgen_config, motion_bend_px, "px", 0, 5, "0",
             "RMS per axis by which an exposure's path bends beside what telemetry and jitter_px "
             "show" OF_OTHERS "."),
    BST_REAL(obsgen_config, streak_min_px, "px", 0.5, 100, "1.5",
             "Star streaks shorter than this are taken for points" OF_OTHERS "."),
    BST_REAL(obsgen_config, streak_max_px, "px", 1, 128, "64",
             "Star streaks longer than this are not filtered for" OF_OTHERS "."),
    BST_INT(obsgen_config, mesh_px, "px", 8, 1024, "64",
            "Side of the meshes in which background and noise are estimated" OF_OTHERS "."),
    BST_REAL(obsgen_config, search_radius_px, "px", 2, 500, "60",
             "Greatest pointing error over which stars are identified" OF_OTHERS "."),
    BST_REAL(obsgen_config, match_tolerance_px, "px", 0.5, 20, "3",
             "Greatest distance of one star from its place after the common shift" OF_OTHERS "."),
    BST_ENUM(obsgen_config, attitude, attitudes, "\"telemetry\"",
             "Attitude at the start: by telemetry, or unknown" OF_OTHERS "."),
    BST_INT(obsgen_config, lost_after_frames, "", 0, 1000000, "0",
            "After so many frames in a row without an identified star the attitude is unknown "
            "again; 0: never" OF_OTHERS "."),
    BST_ENUM(obsgen_config, column_correction, bst_column_level_words, "\"auto\"",
             "Whether each column's level over the others' is taken off" OF_OTHERS "."),
    BST_FORMER("column_level", "column_correction"),
    BST_CONFIG_END,
};

/* Both ports read the exposures: immediately for the truth, after delay_s for the detections. */
enum {
    PORT_EXPOSED,
    PORT_PROCESSED,
    PORT_LOS,
    PORT_PREDICTIONS,
    PORT_POINTING,
    PORT_NAV,
    PORT_TRUTH,
    PORT_DETECTIONS,
    PORT_COUNT
};

static const bst_port ports[PORT_COUNT] = {
    [PORT_EXPOSED] = {BST_CHANNEL_EXPOSURE, BST_PORT_IN, BST_PORT_TRIGGER, 0.0, 0},
    [PORT_PROCESSED] = {BST_CHANNEL_EXPOSURE, BST_PORT_IN, BST_PORT_TRIGGER, 0.0, 0},
    [PORT_LOS] = {BST_CHANNEL_LOS_HISTORY, BST_PORT_IN, 0, 0.0, 0},
    [PORT_PREDICTIONS] = {BST_CHANNEL_PREDICTIONS, BST_PORT_IN,
                          BST_PORT_OPTIONAL | BST_PORT_FEEDBACK, 30.0, 0},
    [PORT_POINTING] = {BST_CHANNEL_POINTING_TELEMETRY, BST_PORT_IN, 0, 10.0, 0},
    [PORT_NAV] = {BST_CHANNEL_NAV_TELEMETRY, BST_PORT_IN, 0, 60.0, 0},
    [PORT_TRUTH] = {BST_CHANNEL_TRUTH, BST_PORT_OUT, 0, 0.0, 4096},
    [PORT_DETECTIONS] = {BST_CHANNEL_DETECTIONS, BST_PORT_OUT, 0, 0.0, 2048},
};

/* Ghosts are sources if their light in a pixel is above this, in sigma of a dark one: the default
 * of scenegen's fidelity.tolerance_sigma. */
static const double GHOST_SIGMA = 0.05;
/* Largest number of pending exposures. */
enum { PENDING = 16 };
/* Relative change of the PSF width above which its bound is tabulated anew. */
static const double SAME_WIDTH = 0.005;

typedef struct obsgen {
    const obsgen_config *config;
    const bst_camera *world_camera;
    const bst_knowledge *knowledge;
    const bst_stars *world_stars;
    int64_t tick_rate_hz;
    bst_rng_key key;
    bst_obsgen_calibration calibration;
    bst_field *field;
    bst_truth_list list;
    bst_generator *generator;
    bst_camera camera;            /* at the plate scale and jitter of the latest exposure */
    bst_psf *psf;                 /* PSF of `camera`, if wider than the world's */
    double jitter_rad2, sigma_px; /* sigma_px: Gaussian that is the PSF or is equivalent to it */
    bst_response response; /* onboard filter to `psf`, at response_binning (0: not computed) */
    bst_crlb_table image_bound, onboard_bound; /* at bound_binning (0: not computed) */
    int bound_binning;
    int response_binning;
    bst_optics_photometer photometer;
    bst_obsgen_pending waiting[PENDING];
    bst_obsgen_lost lost;
    bst_discriminator *discriminator;
} obsgen;

static void destroy(void *self) {
    obsgen *o = self;
    if (!o) {
        return;
    }
    bst_field_free(o->field);
    bst_truth_list_free(&o->list);
    bst_generator_free(o->generator);
    bst_psf_free(o->psf);
    bst_optics_photometer_free(&o->photometer);
    bst_discriminator_free(o->discriminator);
    for (int i = 0; i < PENDING; i++) {
        bst_obsgen_pending_free(&o->waiting[i]);
    }
    free(o);
}

/* Sigma of the Gaussian with the noise-equivalent area of the camera's PSF at the field's centre,
 * px. */
static double gaussian_px(const bst_camera *c) {
    double sigma_px;
    if (!c->psf || bst_psf_gaussian(c->psf, &sigma_px)) {
        return bst_camera_psf_sigma_px(c);
    }
    return bst_psf_equivalent_fwhm_px(c->psf, 0.5 * (double)(c->width_px - 1),
                                      0.5 * (double)(c->height_px - 1)) /
           BST_FWHM_PER_SIGMA;
}

static bst_status prepare(const bst_module_env *env, obsgen *o) {
    const obsgen_config *c = o->config;
    if (strcmp(c->calibration_file, no_file[0]) == 0 || !*c->calibration_file) {
        bst_obsgen_calibration_theory(&o->calibration);
    } else {
        BST_TRY(bst_obsgen_calibration_read(env->ctx, c->calibration_file, &o->calibration));
    }
    const bst_generator_settings settings = {.capacity = (int)c->capacity,
                                             .false_alarms_per_frame = c->false_alarms_per_frame,
                                             .false_splits = c->false_splits,
                                             .jitter_px = c->jitter_px,
                                             .motion_bend_px = c->motion_bend_px,
                                             .streak_min_px = c->streak_min_px,
                                             .streak_max_px = c->streak_max_px,
                                             .mesh_px = (int)c->mesh_px,
                                             .column_correction = c->column_correction};
    BST_TRY(bst_generator_create(env->ctx, o->world_camera, bst_knowledge_camera(env->knowledge),
                                 &settings, &o->calibration, o->key, &o->generator));
    BST_TRY(bst_generator_reserve_streaks(env->ctx, o->generator, (int)o->world_camera->width_px,
                                          (int)o->world_camera->height_px));
    BST_TRY(bst_field_create(env->ctx, env->world, env->observer, env->sensor, &o->field));
    bst_field_set_background_places_only(o->field);
    BST_TRY(bst_optics_photometer_create(env->ctx, (int)c->capacity, &o->photometer));
    BST_TRY(bst_discriminator_create(env->ctx, bst_knowledge_camera(env->knowledge),
                                     (int)c->capacity, &o->discriminator));
    bst_env_set_capacity(env, PORT_TRUTH, (int)c->truth_capacity);
    bst_env_set_capacity(env, PORT_DETECTIONS, (int)c->capacity);
    return BST_OK;
}

static bst_status create(const bst_module_env *env, const void *config, void **self) {
    assert(env && env->world && env->knowledge && env->tick_rate_hz > 0 && self);
    obsgen *o = calloc(1, sizeof *o);
    *self = NULL;
    if (!o) {
        return bst_fail(env->ctx, BST_ERR_MEMORY, "no memory for %s", env->instance);
    }
    o->config = config;
    o->world_camera = bst_world_camera(env->world, env->observer, env->sensor);
    o->world_stars = bst_world_stars(env->world);
    o->camera = *o->world_camera;
    o->sigma_px = gaussian_px(&o->camera);
    o->lost = bst_obsgen_lost_begin(o->config->attitude == 1, o->config->lost_after_frames);
    o->knowledge = env->knowledge;
    o->tick_rate_hz = env->tick_rate_hz;
    o->key = bst_env_rng(env, "observations");
    for (int i = 0; i < PENDING; i++) {
        o->waiting[i].exposure_id = -1;
    }
    bst_status status = prepare(env, o);
    if (status != BST_OK) {
        destroy(o);
        return status;
    }
    *self = o;
    return BST_OK;
}

/* Sets the true camera to a plate scale, its PSF widened by jitter. */
static bst_status use_camera(bst_ctx *ctx, obsgen *o, double scale_arcsec, double jitter_rad2) {
    bst_camera camera;
    bst_psf *psf;
    BST_TRY(
        bst_psf_camera_trembling(ctx, o->world_camera, scale_arcsec, jitter_rad2, &camera, &psf));
    bst_psf_free(o->psf);
    o->psf = psf;
    o->camera = camera;
    o->jitter_rad2 = jitter_rad2;
    bst_field_set_camera(o->field, &o->camera);
    o->sigma_px = gaussian_px(&o->camera);
    o->response_binning = 0;
    return BST_OK;
}

/* Sets the true camera to the exposure's plate scale and jitter. */
static bst_status set_camera(bst_ctx *ctx, obsgen *o, double scale_arcsec, double jitter_rad2) {
    if (scale_arcsec <= 0.0) {
        scale_arcsec = o->camera.pixel_scale_arcsec;
    }
    if (scale_arcsec == o->camera.pixel_scale_arcsec && jitter_rad2 == o->jitter_rad2) {
        return BST_OK;
    }
    return use_camera(ctx, o, scale_arcsec, jitter_rad2);
}

/* Sigma of the Gaussian with an image's noise-equivalent area, without the pixel width, px. */
static double own_sigma(const bst_obsgen_image_width *w) {
    return sqrt(fmax(w->across_px * w->along_px - 1.0 / 12.0, 0.04));
}

/* Sets the response of the onboard filter to the exposure's PSF if one of them is not Gaussian;
 * otherwise the generator computes it. */
static bst_status set_response(bst_ctx *ctx, obsgen *o, int binning, bst_obsgen_pending *p) {
    const bst_camera *known = bst_knowledge_camera(o->knowledge);
    double sigma_px;
    bool gaussian = !o->camera.psf || bst_psf_gaussian(o->camera.psf, &sigma_px);
    const bst_psf *onboard = bst_knowledge_psf(o->knowledge);
    p->own_response = !gaussian || onboard;
    if (!p->own_response) {
        return BST_OK;
    }
    if (o->response_binning != binning) {
        const bst_response_side source = {gaussian ? NULL : o->camera.psf,
                                          gaussian ? o->sigma_px : 0.0};
        double own = onboard ? 0.0 : bst_camera_psf_sigma_px(known);
        const bst_response_side filter = {onboard, hypot(own, o->config->jitter_px)};
        bst_response_set(&o->response, &source, &filter, binning,
                         0.5 * (double)(o->camera.width_px - 1),
                         0.5 * (double)(o->camera.height_px - 1));
        double x = 0.5 * (double)(o->camera.width_px - 1),
               y = 0.5 * (double)(o->camera.height_px - 1);
        double width = own_sigma(&o->response.source), model = own_sigma(&o->response.filter);
        bool binned = o->bound_binning != binning;
        if (binned || fabs(width - o->image_bound.sigma_px) > SAME_WIDTH * width) {
            BST_TRY(bst_psf_bound_init(ctx, &source, binning, x, y, width, &o->image_bound));
        }
        if (binned) {
            BST_TRY(bst_psf_bound_init(ctx, &filter, binning, x, y, model, &o->onboard_bound));
        }
        o->bound_binning = o->response_binning = binning;
    }
    p->response = o->response;
    p->image_bound = o->image_bound;
    p->onboard_bound = o->onboard_bound;
    return BST_OK;
}

/* Sources whose brightest pixels are wanted. */
typedef struct peak_request {
    double sigma_px;
    const bst_scene_source *sources;
} peak_request;

/* Expected brightest-pixel electrons of a truth item (callback). */
static double peak_e(const void *user, int index, const bst_truth_item *item) {
    const peak_request *q = user;
    const bst_ghost *ghost = q->sources[index].ghost;
    double blur2 = ghost ? bst_ghost_variance_px2(ghost) : 0.0;
    return bst_generator_peak_e(sqrt(q->sigma_px * q->sigma_px + blur2), item);
}

/* Stores of which ghosts the items of a pending exposure are. */
static void store_ghosts(const obsgen *o, const bst_scene_source *sources, bst_obsgen_pending *p) {
    const bst_ghosts *ghosts = o->camera.ghost_images;
    for (int i = 0; i < p->truth->count; i++) {
        const bst_ghost *ghost = sources[o->list.source_of[i]].ghost;
        p->ghost[i] = ghost ? (int32_t)(ghost - ghosts->items) : -1;
    }
}

/* Publishes the truth of an exposure and stores all its sources until it is processed. */
static bst_status store_exposure(obsgen *o, struct bst_step *step, const bst_exposure *e,
                                 const bst_los_history *history) {
    bst_ctx *ctx = bst_step_ctx(step);
    BST_TRY(set_camera(ctx, o, e->pixel_scale_arcsec, history->jitter_rad2));
    bst_los_track track;
    int64_t lead =
        bst_detector_lead_ticks(&o->camera.detector, e->window.height, (double)o->tick_rate_hz);
    BST_TRY(bst_field_track(ctx, o->field, history, e->start_tick - lead, e->end_tick + lead,
                            o->tick_rate_hz, &track));
    const bst_field_options options = {
        .v_limit = o->config->star_limit_v_mag,
        .margin_px = fmax(o->config->margin_px, ceil(6.0 * o->sigma_px)),
        .lead_s = (double)lead / (double)o->tick_rate_hz,
        .ghost_sigma = GHOST_SIGMA,
        .binning = e->binning};
    int capacity, count;
    const bst_scene_source *sources;
    bst_truth *truth = bst_step_write(step, PORT_TRUTH, &capacity);
    truth->exposure_id = e->id;
    truth->dropped = e->dropped;
    BST_TRY(bst_field_query(ctx, o->field, &track, e->start_tick, e->end_tick, o->tick_rate_hz,
                            e->window, &options, truth, &sources, &count));
    truth->hits = 0;
    truth->hits_e = 0.0;
    truth->error_sigma = NAN;
    truth->nodes = 0;
    truth->one_track = false;
    const peak_request peaks = {o->sigma_px, sources};
    const bst_truth_request request = {.field = o->field,
                                       .camera = &o->camera,
                                       .track = &track,
                                       .sources = sources,
                                       .count = count,
                                       .window = e->window,
                                       .binning = e->binning,
                                       .peak_e = peak_e,
                                       .peak_of_points = true,
                                       .user = &peaks};
    BST_TRY(bst_truth_list_fill(ctx, &o->list, &request, truth, capacity, NULL));
    if (truth->lost > 0) {
        bst_step_count(step, "truth_overflow");
    }
    assert(bst_truth_is_valid(truth, capacity));
    bst_obsgen_pending *p = &o->waiting[e->id % PENDING];
    p->exposure_id = e->dropped ? -1 : e->id;
    if (e->dropped) {
        return BST_OK;
    }
    BST_TRY(bst_obsgen_pending_set_path(ctx, p, &o->camera, &track, options.lead_s, e->window));
    p->sigma_px = o->sigma_px;
    BST_TRY(set_response(ctx, o, e->binning > 1 ? e->binning : 1, p));
    BST_TRY(bst_obsgen_pending_reserve(ctx, p, count));
    if (truth->lost == 0) {
        memcpy(p->truth, truth, sizeof *truth + (size_t)count * sizeof truth->items[0]);
    } else {
        memcpy(p->truth, truth, sizeof *truth);
        BST_TRY(bst_truth_list_fill(ctx, &o->list, &request, p->truth, p->room, NULL));
    }
    store_ghosts(o, sources, p);
    return BST_OK;
}

/* Sets the onboard attitude of an exposure from telemetry. */
static void set_attitude(const obsgen *o, struct bst_step *step, const bst_exposure *e,
                         bool *oriented, bool *locked, bst_camera_motion *known,
                         bst_detections *out) {
    bst_sample pointing = bst_step_latest(step, PORT_POINTING);
    bst_sample predicted = bst_step_latest(step, PORT_PREDICTIONS);
    bst_camera_motion motion = {.q_cam_from_gcrf = BST_QUAT_IDENTITY};
    *oriented =
        pointing.payload && !pointing.stale &&
        bst_camera_motion_from_telemetry(pointing.payload, e->start_tick, e->end_tick, &motion);
    out->q_cam_from_gcrf = out->q_telemetry_from_gcrf = motion.q_cam_from_gcrf;
    *known = motion;
    const bst_predictions *p = predicted.stale ? NULL : predicted.payload;
    *locked = *oriented && p && p->attitude_valid;
    if (*locked) {
        double middle = 0.5 * ((double)e->start_tick + (double)e->end_tick);
        double dt = (middle - (double)p->tick) / (double)o->tick_rate_hz;
        bst_quat error = bst_quat_from_rotvec(
            bst_vec3_axpy(p->attitude_error_cam_rad, dt, p->attitude_error_rate_cam_radps));
        out->q_cam_from_gcrf = bst_quat_unit(bst_quat_mul(error, motion.q_cam_from_gcrf));
    }
    if (bst_obsgen_lost_enabled(&o->lost)) {
        /* the tracker's correction is one of small angles; the error is one of the inertial axes:
         * on the right */
        *locked = *oriented && o->lost.known;
        out->q_cam_from_gcrf =
            *locked ? bst_quat_unit(bst_quat_mul(motion.q_cam_from_gcrf, o->lost.error))
                    : motion.q_cam_from_gcrf;
    }
}

/* Distance of the stars from their positions by the onboard attitude, px. */
static double shift_px(const obsgen *o, const bst_truth *t, bst_quat q_onboard) {
    bst_vec3 e =
        bst_quat_to_rotvec(bst_quat_mul(q_onboard, bst_quat_conj(t->q_cam_from_gcrf_mean)));
    return hypot(e.x, e.y) / bst_camera_scale_rad(&o->camera);
}

/* Adds correctly identified stars to the photometric zero point. */
static void add_stars(obsgen *o, const bst_generator_frame *frame,
                      const bst_obsgen_generated *generated, const bst_detections *detections) {
    for (int i = 0; i < detections->count; i++) {
        const bst_detection *d = &detections->items[i];
        if (d->star_id != 0 && generated[i].item >= 0) {
            double electrons = frame->truth->items[generated[i].item].electrons;
            bst_optics_photometer_add(
                &o->photometer, d,
                bst_camera_v_mag(o->world_camera, electrons / frame->exposure_s));
        }
    }
}

/* Labels the detections that are no identified stars. */
static void label(const obsgen *o, struct bst_step *step, const bst_exposure *e,
                  const bst_truth *truth, const bst_generator_result *made, bst_detections *out) {
    const bst_sample nav = bst_step_latest(step, PORT_NAV);
    const bst_sample predicted = bst_step_latest(step, PORT_PREDICTIONS);
    const bst_obsgen_labels_frame frame = {
        .camera = bst_knowledge_camera(o->knowledge),
        .truth = truth,
        .generated = made->items,
        .window = e->window,
        .streak_px = made->streak_px,
        .nav = nav.stale ? NULL : nav.payload,
        .predicted = predicted.stale ? NULL : predicted.payload,
        .middle_tick = 0.5 * ((double)e->start_tick + (double)e->end_tick),
        .tick_rate_hz = (double)o->tick_rate_hz};
    bst_obsgen_label(o->discriminator, &frame, out);
}

/* Generates and publishes the detections of a stored exposure. */
static bst_status process_exposure(obsgen *o, struct bst_step *step, const bst_exposure *e) {
    bst_obsgen_pending *p = &o->waiting[e->id % PENDING];
    if (p->exposure_id != e->id) {
        return BST_OK; /* exposure was dropped */
    }
    p->exposure_id = -1;
    bst_ctx *ctx = bst_step_ctx(step);
    int capacity;
    bst_detections *out = bst_step_write(step, PORT_DETECTIONS, &capacity);
    out->exposure_id = e->id;
    out->start_tick = e->start_tick;
    out->end_tick = e->end_tick;
    bool oriented, locked;
    bst_camera_motion motion;
    set_attitude(o, step, e, &oriented, &locked, &motion, out);
    bst_generator_frame frame = bst_obsgen_pending_frame(p, e, (double)o->tick_rate_hz);
    if (oriented) {
        const bst_camera *camera = bst_knowledge_camera(o->knowledge);
        bst_camera_motion_streak(&motion, camera, e->window.x0 + 0.5 * (e->window.width - 1),
                                 e->window.y0 + 0.5 * (e->window.height - 1), &frame.streak_dx_px,
                                 &frame.streak_dy_px);
        bst_camera_motion_bend(&motion, camera, &frame.bend_x_px, &frame.bend_y_px);
        frame.followed = bst_camera_motion_is_uneven(&motion, camera, frame.sigma_px);
        frame.bend_sigma_px = motion.bend_sigma_rad / bst_camera_scale_rad(camera);
    }
    bst_generator_result made;
    BST_TRY(bst_generator_run(ctx, o->generator, &frame, &made));
    out->background_e = made.background_e;
    out->noise_e = made.noise_e;
    out->threshold_snr = made.threshold_snr;
    bst_generator_set_shared(&motion, bst_knowledge_camera(o->knowledge), &frame, &made, out);
    out->stars_identified = 0;
    out->count = made.count < capacity ? made.count : capacity;
    out->lost = made.lost + made.count - out->count;
    for (int i = 0; i < out->count; i++) {
        out->items[i] = made.items[i].detection;
    }
    bst_optics_photometer_begin(&o->photometer);
    bst_sample nav = bst_step_latest(step, PORT_NAV);
    if (oriented && nav.payload && !nav.stale && !made.smeared) {
        const bst_identify_options options = {
            .catalogue = bst_knowledge_stars(o->knowledge),
            .world_catalogue = o->world_stars,
            .julian_year = bst_knowledge_julian_year(o->knowledge),
            .search_radius_px = o->config->search_radius_px,
            .match_tolerance_px = o->config->match_tolerance_px,
            .probability = o->calibration.star_id_probability,
            /* a star of 0.7 of the threshold, 3.5 of 5, is detected in 7 % of the frames */
            .v_limit = bst_generator_v_limit(o->generator, 0.7 * made.threshold_snr),
            .locked = locked,
            .shift_px = shift_px(o, p->truth, out->q_cam_from_gcrf),
            .key = o->key};
        BST_TRY(bst_obsgen_lost_identify(&o->lost, step, &options, &frame, made.items, out));
        add_stars(o, &frame, made.items, out);
    }
    bst_optics_zero_point zero_point = bst_optics_photometer_zero_point(&o->photometer);
    bst_photometry_apply(&zero_point, bst_camera_v_mag(bst_knowledge_camera(o->knowledge), 1.0),
                         out);
    if (!made.smeared) {
        label(o, step, e, p->truth, &made, out);
    }
    if (out->stars_identified == 0) {
        bst_step_count(step, "frame_without_stars");
    }
    if (out->lost > 0) {
        bst_step_count(step, "detections_overflow");
    }
    assert(bst_detections_are_valid(out, capacity));
    return BST_OK;
}

static bst_status step_module(void *self, struct bst_step *step) {
    bst_sample exposure;
    while ((exposure = bst_step_next(step, PORT_EXPOSED)).payload) {
        bst_sample history = bst_step_latest(step, PORT_LOS);
        if (!history.payload) {
            return bst_fail(bst_step_ctx(step), BST_ERR_STATE,
                            "an exposure ended before any line of sight was published");
        }
        BST_TRY(store_exposure(self, step, exposure.payload, history.payload));
    }
    while ((exposure = bst_step_next(step, PORT_PROCESSED)).payload) {
        BST_TRY(process_exposure(self, step, exposure.payload));
    }
    return BST_OK;
}

/* Saves or restores the true camera: its PSF follows from plate scale and jitter. */
static bst_status archive_camera(obsgen *o, bst_archive *archive) {
    bst_ctx *ctx = bst_archive_ctx(archive);
    double scale_arcsec = o->camera.pixel_scale_arcsec, jitter_rad2 = o->jitter_rad2;
    BST_ARCHIVE(archive, scale_arcsec);
    BST_ARCHIVE(archive, jitter_rad2);
    if (!bst_archive_is_restoring(archive)) {
        return BST_OK;
    }
    if (!(bst_is_positive(scale_arcsec) && bst_is_variance(jitter_rad2))) {
        return bst_fail(ctx, BST_ERR_FORMAT,
                        "the saved camera of the generator is damaged: a pixel of %g arcsec, a "
                        "jitter of %g rad^2",
                        scale_arcsec, jitter_rad2);
    }
    return use_camera(ctx, o, scale_arcsec, jitter_rad2);
}

/* The generator, `response` and the photometer have no state of their own: they are the work space
 * of a frame, and caches whose values depend on the frame and the camera alone. The bounds are
 * saved, because they are kept while the width of the PSF changes little. */
static bst_status archive_module(void *self, bst_archive *archive) {
    obsgen *o = self;
    BST_TRY(archive_camera(o, archive));
    bst_obsgen_lost_archive(&o->lost, archive);
    bst_discriminator_archive(o->discriminator, archive);
    BST_ARCHIVE(archive, o->bound_binning);
    if (o->bound_binning != 0) {
        BST_ARCHIVE(archive, o->image_bound);
        BST_ARCHIVE(archive, o->onboard_bound);
    }
    for (int i = 0; i < PENDING; i++) {
        BST_TRY(bst_obsgen_pending_archive(&o->waiting[i], o->world_camera->ghosts.count, archive));
    }
    return BST_OK;
}

static const char *const substitutes_for[] = {"scenegen", "imgproc", NULL};

const bst_module_desc bst_obsgen_module = {
    .abi = BST_MODULE_ABI,
    .role = "obsgen",
    .type = "statistical",
    .doc =
        "Makes detections from the truth, by the statistics of rendering and image processing, "
        "where observation_source is generator.",
    .flags = BST_MODULE_READS_TRUTH | BST_MODULE_INPUTS_ONLY,
    .config = config_table,
    .config_bytes = sizeof(obsgen_config),
    .default_rate_hz = 0.0,
    .ports = ports,
    .port_count = PORT_COUNT,
    .create = create,
    .step = step_module,
    .destroy = destroy,
    .archive = archive_module,
    .substitutes_for = substitutes_for,
};
