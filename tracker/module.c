#include "tracker/module.h"

#include <assert.h>
#include <stdlib.h>

#include "boresight/camera_motion.h"
#include "sim/messages/message_invariants.h"
#include "sim/onboard/knowledge.h"
#include "tracker/attitude/photocentre.h"
#include "tracker/catalogue.h"
#include "tracker/tracker.h"

enum {
    PORT_DETECTIONS,
    PORT_POINTING,
    PORT_NAV,
    PORT_TASK,
    PORT_TRACKS,
    PORT_PREDICTIONS,
    PORT_SMOOTHED,
    PORT_IDENTITIES,
    PORT_COUNT
};

static const bst_port ports[PORT_COUNT] = {
    [PORT_DETECTIONS] = {BST_CHANNEL_DETECTIONS, BST_PORT_IN, BST_PORT_TRIGGER, 0.0, 0},
    [PORT_POINTING] = {BST_CHANNEL_POINTING_TELEMETRY, BST_PORT_IN, BST_PORT_OPTIONAL, 10.0, 0},
    [PORT_NAV] = {BST_CHANNEL_NAV_TELEMETRY, BST_PORT_IN, 0, 60.0, 0},
    [PORT_TASK] = {BST_CHANNEL_TASK, BST_PORT_IN, BST_PORT_OPTIONAL | BST_PORT_FEEDBACK, 0.0, 0},
    [PORT_TRACKS] = {BST_CHANNEL_TRACKS, BST_PORT_OUT, 0, 0.0, 256},
    [PORT_PREDICTIONS] = {BST_CHANNEL_PREDICTIONS, BST_PORT_OUT, 0, 0.0, 256},
    [PORT_IDENTITIES] = {BST_CHANNEL_TRACK_IDENTITIES, BST_PORT_OUT, 0, 0.0, 0},
    [PORT_SMOOTHED] = {BST_CHANNEL_TRACKS_SMOOTHED, BST_PORT_OUT, 0, 0.0, 0},
};

/* Most probabilities of a track: of each object, and of none. */
enum { TRACK_IDENTITIES = BST_IDENTITY_OBJECTS + 1 };
/* Probabilities below this are not published. */
static const double LEAST_PROBABILITY = 1e-3;

typedef struct tracker_module {
    bst_tracker *tracker;
    bst_knowledge_view *view;
    const bst_stars *stars;
    bst_star_epoch epoch; /* of the run, with the Sun of the latest frame */
    double blend_rad;
    double tick_rate_hz;
    bool orbits;
    bst_tracker_catalogue *catalogue; /* NULL: tracks are not compared with it */
} tracker_module;

/* Largest magnitude difference of a companion that affects a star's photocentre. */
static const double COMPANION_MAG = 6.0;
enum { MAX_COMPANIONS = 16 };

/* Photocentre of a catalogue star and its catalogue neighbours within one FWHM, which form one
 * image. */
static bst_vec3 photocentre(const tracker_module *m, bst_ctx *ctx, const bst_star *star) {
    bst_star near[MAX_COMPANIONS];
    int count = 0;
    const bst_star_query cone = {star->icrs, m->blend_rad, star->v_mag + COMPANION_MAG, m->epoch};
    if (bst_stars_query_seen(ctx, m->stars, &cone, near, MAX_COMPANIONS, &count) != BST_OK ||
        count > MAX_COMPANIONS) {
        return star->icrs;
    }
    return bst_photocentre(star, near, count, m->blend_rad);
}

/* Looks up the photocentre of a catalogue star (a bst_tracker_star_fn). */
static bool find_star(void *user, uint32_t star_id, bst_vec3 *icrs) {
    const tracker_module *m = user;
    bst_ctx quiet = {0}; /* an unknown identity is no failure of the run */
    bst_star star;
    if (bst_stars_find_seen(&quiet, m->stars, star_id, &m->epoch, &star) != BST_OK) {
        return false;
    }
    *icrs = photocentre(m, &quiet, &star);
    return true;
}

static void destroy(void *self) {
    tracker_module *m = self;
    if (m) {
        bst_tracker_free(m->tracker);
        bst_tracker_catalogue_free(m->catalogue);
        bst_knowledge_view_free(m->view);
        free(m);
    }
}

static bst_status create(const bst_module_env *env, const void *config, bst_filter_kind filter,
                         void **self) {
    assert(env && env->knowledge && env->tick_rate_hz > 0 && config && self);
    bst_tracker_config with_filter = *(const bst_tracker_config *)config;
    with_filter.filter = filter;
    const bst_tracker_config *c = &with_filter;
    tracker_module *m = calloc(1, sizeof *m);
    *self = NULL;
    if (!m) {
        return bst_fail(env->ctx, BST_ERR_MEMORY, "tracker: out of memory");
    }
    m->stars = bst_knowledge_stars(env->knowledge);
    m->epoch.julian_year = bst_knowledge_julian_year(env->knowledge);
    m->tick_rate_hz = (double)env->tick_rate_hz;
    m->orbits = c->motion == 1;
    const bst_camera *camera = bst_knowledge_camera(env->knowledge);
    m->blend_rad = camera->psf_fwhm_px * bst_camera_scale_rad(camera);
    bst_status status = bst_knowledge_view_create(env->ctx, env->knowledge, &m->view);
    if (status == BST_OK) {
        status = bst_tracker_create(env->ctx, c, bst_knowledge_camera(env->knowledge),
                                    env->tick_rate_hz, find_star, m, &m->tracker);
    }
    if (status == BST_OK && c->identity_period_s > 0.0) {
        status = bst_tracker_catalogue_create(env->ctx, c, env->knowledge, m->view, &m->catalogue);
    }
    if (status != BST_OK) {
        destroy(m);
        return status;
    }
    bst_env_set_capacity(env, PORT_TRACKS, (int)c->max_tracks);
    bst_env_set_capacity(env, PORT_PREDICTIONS, (int)c->max_tracks);
    int compared = c->max_tracks < BST_IDENTITY_TRACKS ? (int)c->max_tracks : BST_IDENTITY_TRACKS;
    bst_env_set_capacity(env, PORT_IDENTITIES, m->catalogue ? compared * TRACK_IDENTITIES : 0);
    bst_env_set_capacity(env, PORT_SMOOTHED, bst_tracker_smoothed_room(c));
    *self = m;
    return BST_OK;
}

static bst_status create_ekf(const bst_module_env *env, const void *config, void **self) {
    return create(env, config, BST_FILTER_EKF, self);
}

static bst_status create_ukf(const bst_module_env *env, const void *config, void **self) {
    return create(env, config, BST_FILTER_UKF, self);
}

static bst_status create_imm(const bst_module_env *env, const void *config, void **self) {
    return create(env, config, BST_FILTER_IMM, self);
}

/* Publishes the tracker's events of the frame. */
static void publish_events(struct bst_step *step, const bst_tracker *tracker) {
    static const char *const kinds[] = {[BST_TRACKER_TRACK_CONFIRMED] = "track_confirmed",
                                        [BST_TRACKER_TRACK_LOST] = "track_lost",
                                        [BST_TRACKER_TARGET_SELECTED] = "target_selected",
                                        [BST_TRACKER_TARGET_LOST] = "target_lost",
                                        [BST_TRACKER_ATTITUDE_LOST] = "attitude_lost",
                                        [BST_TRACKER_TRACK_RESUMED] = "track_resumed",
                                        [BST_TRACKER_MANOEUVRE] = "manoeuvre",
                                        [BST_TRACKER_BRIGHTNESS_CHANGE] = "brightness_change",
                                        [BST_TRACKER_TARGET_AMBIGUOUS] = "target_ambiguous",
                                        [BST_TRACKER_TARGET_RESOLVED] = "target_resolved"};
    int count;
    const bst_tracker_event *events = bst_tracker_events(tracker, &count);
    for (int i = 0; i < count; i++) {
        const bst_tracker_event *e = &events[i];
        if (e->kind == BST_TRACKER_ATTITUDE_LOST) {
            bst_step_event(step, kinds[e->kind], "no attitude from stars that is good enough");
        } else if (e->kind == BST_TRACKER_MANOEUVRE || e->kind == BST_TRACKER_BRIGHTNESS_CHANGE) {
            bst_step_event(step, kinds[e->kind], "track %lld, chi-square %.1f of %d, V %.2f",
                           (long long)e->track_id, e->statistic,
                           e->kind == BST_TRACKER_MANOEUVRE ? 2 : 1, e->v_mag);
        } else if (e->kind == BST_TRACKER_TARGET_AMBIGUOUS) {
            bst_step_event(
                step, kinds[e->kind], "track %lld with probability %.3f, track %lld with %.3f",
                (long long)e->track_id, e->statistic, (long long)e->rival_id, e->rival_probability);
        } else if (e->kind == BST_TRACKER_TARGET_RESOLVED) {
            bst_step_event(step, kinds[e->kind], "track %lld with probability %.3f",
                           (long long)e->track_id, e->statistic);
        } else if (e->kind == BST_TRACKER_TARGET_LOST) {
            bst_step_event(step, kinds[e->kind], "track %lld", (long long)e->track_id);
        } else {
            double ra, dec;
            bst_vec3_to_radec(e->direction_gcrf, &ra, &dec);
            bst_step_event(step, kinds[e->kind],
                           "track %lld at RA %.5f Dec %.5f deg, %.3f arcsec/s, V %.2f",
                           (long long)e->track_id, ra / BST_DEG_RAD, dec / BST_DEG_RAD,
                           bst_vec3_norm(e->rate_gcrf_radps) / BST_ARCSEC_RAD, e->v_mag);
        }
    }
}

/* Adds the probability of a track's identity, if it is not negligible. */
static void add_identity(bst_track_identities *out, int room, int64_t track_id, int32_t object,
                         double probability) {
    if (probability < LEAST_PROBABILITY) {
        return;
    }
    if (out->count < room) {
        out->items[out->count++] = (bst_track_identity){track_id, object, probability};
    } else {
        out->lost++;
    }
}

/* Publishes the comparison of the tracks with the catalogue. */
static void publish_identities(const tracker_module *m, struct bst_step *step,
                               const bst_tracks *tracks) {
    int room;
    const bst_identity *identity = bst_tracker_identity(m->tracker);
    bst_track_identities *out = bst_step_write(step, PORT_IDENTITIES, &room);
    *out = (bst_track_identities){
        .exposure_id = tracks->exposure_id, .tick = tracks->tick, .lost = identity->left_out};
    for (int t = 0; t < identity->tracks; t++) {
        int64_t id = identity->track_id[t];
        for (int o = 0; o < identity->objects; o++) {
            add_identity(out, room, id, identity->object[o], identity->probability[t][o]);
        }
        add_identity(out, room, id, BST_IDENTITY_UNKNOWN, identity->unknown[t]);
    }
    assert(bst_track_identities_are_valid(out, room));
}

/* Publishes the smoothed tracks of an earlier frame. */
static void publish_smoothed(const tracker_module *m, struct bst_step *step) {
    int room;
    bst_tracks_smoothed *out = bst_step_write(step, PORT_SMOOTHED, &room);
    bst_tracker_smoothed(m->tracker, out, room);
    assert(bst_tracks_smoothed_are_valid(out, room));
}

/* False for an attitude of zeros, which means that it is not known. */
static bool is_known(bst_quat q) {
    return q.x != 0.0 || q.y != 0.0 || q.z != 0.0 || q.w != 0.0;
}

/* Adds the uncertainty of the onboard clock to that of the cue. */
static void widen_by_clock(tracker_module *m, double seconds, double sigma_s,
                           bst_onboard_cue *cue) {
    bst_onboard_cue later;
    bst_ctx quiet = {0};
    if (bst_knowledge_cue_at(&quiet, m->view, seconds + sigma_s, &later) != BST_OK) {
        /* an orbit ends before */
        cue->sigma_rad = hypot(cue->sigma_rad, sigma_s * bst_vec3_norm(cue->rate_gcrf_radps));
        return;
    }
    bst_vec3 turned = bst_vec3_sub(later.rate_gcrf_radps, cue->rate_gcrf_radps);
    cue->sigma_rad =
        hypot(cue->sigma_rad, bst_vec3_angle(later.direction_gcrf, cue->direction_gcrf));
    cue->rate_sigma_radps = hypot(cue->rate_sigma_radps, bst_vec3_norm(turned));
}

/* Reads the cue at mid-exposure. */
static bst_status read_cue(tracker_module *m, struct bst_step *step, double seconds,
                           double clock_sigma_s, bst_tracker_cue *out) {
    bst_ctx *ctx = bst_step_ctx(step);
    bst_onboard_cue cue;
    BST_TRY(bst_knowledge_cue_at(ctx, m->view, seconds, &cue));
    if (clock_sigma_s > 0.0) {
        widen_by_clock(m, seconds, clock_sigma_s, &cue);
    }
    *out = (bst_tracker_cue){.valid = cue.valid,
                             .direction_gcrf = cue.direction_gcrf,
                             .rate_gcrf_radps = cue.rate_gcrf_radps,
                             .sigma_rad = cue.sigma_rad,
                             .rate_sigma_radps = cue.rate_sigma_radps,
                             .v_mag = cue.v_mag,
                             .v_mag_sigma = cue.v_mag_sigma};
    BST_TRY(bst_knowledge_belt_eye_at(ctx, m->view, seconds, &out->in_region, &out->belt_eye));
    if (m->orbits && bst_tracker_may_start_orbit(m->tracker)) {
        bool known;
        BST_TRY(bst_knowledge_cue_range_at(ctx, m->view, seconds, &known, &out->range_m,
                                           &out->range_rate_mps));
    }
    return BST_OK;
}

/* Processes a detections message: tracker step, tracks and predictions. */
static bst_status process_detections(tracker_module *m, struct bst_step *step,
                                     const bst_detections *detections) {
    if (bst_tracker_check(m->tracker, detections) != BST_TRACKER_USED) {
        bst_step_count(step, "tracker_frame_ignored");
        return BST_OK;
    }
    bst_sample nav = bst_step_latest(step, PORT_NAV);
    if (!nav.payload || nav.stale) {
        bst_step_count(step, "tracker_no_navigation");
        return BST_OK;
    }
    m->epoch.sun_m = ((const bst_nav_telemetry *)nav.payload)->sun_m;
    bst_sample pointing = bst_step_latest(step, PORT_POINTING);
    const bst_pointing_telemetry *telemetry = pointing.payload;
    bst_tracker_input input = {.detections = detections, .nav = nav.payload};
    if (telemetry && !pointing.stale && telemetry->written > 0) {
        input.q_telemetry_now =
            &telemetry->items[(telemetry->written - 1) % telemetry->capacity].q_cam_from_gcrf;
    }
    bst_camera_motion motion;
    if (!is_known(detections->q_telemetry_from_gcrf)) { /* a peer may not know it */
        if (!telemetry || pointing.stale ||
            !bst_camera_motion_from_telemetry(telemetry, detections->start_tick,
                                              detections->end_tick, &motion)) {
            bst_step_count(step, "tracker_no_attitude");
            return BST_OK;
        }
        input.q_telemetry_mid = &motion.q_cam_from_gcrf;
    }
    double seconds =
        0.5 * (double)(detections->start_tick + detections->end_tick) / m->tick_rate_hz;
    if (bst_knowledge_view_task(m->view, bst_step_latest(step, PORT_TASK).payload)) {
        bst_tracker_retarget(m->tracker);
    }
    double clock_sigma_s =
        bst_tracker_clock_sigma_s(m->tracker, bst_knowledge_view_clock_s(m->view));
    BST_TRY(read_cue(m, step, seconds, clock_sigma_s, &input.cue));
    if (m->catalogue) {
        input.near = bst_tracker_catalogue_near;
        input.sight = bst_tracker_catalogue_sight;
        input.near_user = m->catalogue;
        input.cue_object = bst_tracker_catalogue_set(m->catalogue, seconds, clock_sigma_s);
    }
    int track_room, prediction_room;
    bst_tracks *tracks = bst_step_write(step, PORT_TRACKS, &track_room);
    bst_predictions *predictions = bst_step_write(step, PORT_PREDICTIONS, &prediction_room);
    bst_tracker_outcome outcome =
        bst_tracker_step(m->tracker, &input, tracks, track_room, predictions, prediction_room);
    if (bst_knowledge_view_set_clock(m->view, tracks->clock_offset_s, tracks->clock_sigma_s)) {
        bst_tracker_cue_corrected(m->tracker);
    }
    assert(bst_tracks_are_valid(tracks, track_room));
    assert(bst_predictions_are_valid(predictions, prediction_room));
    if (bst_tracker_identity(m->tracker)) {
        publish_identities(m, step, tracks);
    }
    if (m->catalogue && bst_tracker_catalogue_failed(m->catalogue)) {
        bst_step_count(step, "tracker_no_catalogue");
    }
    if (bst_tracker_has_smoothed(m->tracker)) {
        publish_smoothed(m, step);
    }
    if (outcome == BST_TRACKER_NO_ATTITUDE) {
        bst_step_count(step, "tracker_no_attitude");
    }
    if (tracks->lost > 0) {
        bst_step_count(step, "tracker_overflow");
    }
    publish_events(step, m->tracker);
    return BST_OK;
}

static bst_status step_module(void *self, struct bst_step *step) {
    for (;;) {
        bst_sample sample = bst_step_next(step, PORT_DETECTIONS);
        if (!sample.payload) {
            return BST_OK;
        }
        BST_TRY(process_detections(self, step, sample.payload));
    }
}

static bst_status archive_module(void *self, bst_archive *archive) {
    tracker_module *m = self;
    bst_knowledge_view_archive(m->view, archive);
    return bst_tracker_archive(m->tracker, archive);
}

#define DESCRIPTOR(name, what)                                                                   \
    {                                                                                            \
        .abi = BST_MODULE_ABI, .role = "tracker", .type = #name, .flags = BST_MODULE_DEFERRABLE, \
        .doc = "Attitude from stars, " what ", association by name.",                            \
        .config = bst_tracker_config_table, .config_bytes = sizeof(bst_tracker_config),          \
        .ports = ports, .port_count = PORT_COUNT, .create = create_##name, .step = step_module,  \
        .destroy = destroy, .archive = archive_module                                            \
    }

const bst_module_desc bst_tracker_module = DESCRIPTOR(ekf, "extended Kalman filters");
const bst_module_desc bst_tracker_ukf_module = DESCRIPTOR(ukf, "unscented Kalman filters");
const bst_module_desc bst_tracker_imm_module =
    DESCRIPTOR(imm, "two interacting models (quiet, manoeuvring) per track");
